"""A whole encode in the precision deterministic: the same bytes on any kind of CPU."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from codec_cases import encoded, paper_quick, waves
from numpy._core import _multiarray_umath as multiarray

from gsvc_ref.encoder import Settings

JIT = not numba.config.DISABLE_JIT

DISPATCHED = [name for name in multiarray.__cpu_dispatch__ if multiarray.__cpu_features__[name]]
"""The kinds of CPU that NumPy has loops of its own for here."""

GENERIC = {
    "NUMBA_CPU_NAME": "generic",
    "NUMBA_CPU_FEATURES": "",
    "NPY_DISABLE_CPU_FEATURES": " ".join(DISPATCHED),
    "OPENBLAS_CORETYPE": "Nehalem",
}
"""The least of everything: kernels for any x86-64, NumPy's plain loops, and an old BLAS should anything call it."""


def settings(threads: int) -> Settings:
    """Everything that an encode may do: a choice of quantisers, detection of key frames, motion, fine-tuning."""
    return paper_quick(splats=60, iterations=20, threads=threads, precision="deterministic")


def digest(threads: int) -> str:
    """Of the stream."""
    return hashlib.sha256(encoded(waves(48, 40, 3, speed=2.5), settings(threads))[1]).hexdigest()


@pytest.mark.exhaustive
@pytest.mark.skipif(not JIT, reason="both processes would be interpreted by the same Python")
def test_bytes_do_not_depend_on_the_cpu(tmp_path):
    environment = {**os.environ, **GENERIC, "NUMBA_CACHE_DIR": str(tmp_path)}
    program = "from encoder.test_reproducible import digest; print(digest(1))"
    other = subprocess.run(
        [sys.executable, "-c", program], cwd=Path(__file__).parents[1], env=environment, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert other.stdout.strip() == digest(2)
