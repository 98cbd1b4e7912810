import math

import numba
import pytest

from gsvc_ref import spec
from gsvc_ref.metrics import ssim


@pytest.fixture(autouse=True)
def _no_loops_without_the_compiler(monkeypatch):
    """Interpreted, the kernel takes minutes on whole frames: spec.md's code stands in, a test holds the two equal."""

    def plain(x, y, vertical, horizontal, c1, c2):
        return spec.mean_similarities(x, y, round(math.sqrt(c1) / ssim.LUMINANCE_K))

    if numba.config.DISABLE_JIT:
        monkeypatch.setattr(ssim, "mean_similarity", plain)
