import numba
import pytest

from gsvc_ref.metrics import ssim


@pytest.fixture(autouse=True)
def _no_loops_without_the_compiler(monkeypatch):
    """Interpreted, the kernel takes minutes on whole frames: the definition stands in, a test holds the two equal."""
    if numba.config.DISABLE_JIT:
        monkeypatch.setattr(ssim, "mean_similarity", ssim.mean_similarity_plain)
