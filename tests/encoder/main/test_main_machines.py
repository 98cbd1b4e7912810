"""Whole encodes of profile `main` in the precision deterministic: the same bytes on any kind of CPU."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from codec_cases import encoded, waves
from numpy._core import _multiarray_umath as multiarray

from gsvc_ref.encoder import Settings

DISPATCHED = [name for name in multiarray.__cpu_dispatch__ if multiarray.__cpu_features__[name]]
"""The kinds of CPU that NumPy has loops of its own for here."""

GENERIC = {
    "NUMBA_CPU_NAME": "generic",
    "NUMBA_CPU_FEATURES": "",
    "NPY_DISABLE_CPU_FEATURES": " ".join(DISPATCHED),
    "OPENBLAS_CORETYPE": "Nehalem",
}
"""The least of everything: kernels for any x86-64, NumPy's plain loops, and an old BLAS should anything call it."""


def digest(threads: int) -> str:
    """Of a stream with an I-frame, a motion field, differences and new splats."""
    settings = Settings.quick(
        profile="main", splats=40, key_frames=(0,), threads=threads, precision="deterministic", decisions=False
    )
    return hashlib.sha256(encoded(waves(48, 40, 3, speed=2.5), settings)[1]).hexdigest()


def test_bytes_do_not_depend_on_the_threads() -> None:
    assert digest(1) == digest(2)


@pytest.mark.exhaustive
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="both processes would be interpreted by the same Python")
def test_bytes_do_not_depend_on_the_cpu(tmp_path: Path) -> None:
    environment = {**os.environ, **GENERIC, "NUMBA_CACHE_DIR": str(tmp_path)}
    program = "from encoder.main.test_main_machines import digest; print(digest(1))"
    other = subprocess.run(
        [sys.executable, "-c", program], cwd=Path(__file__).parents[1], env=environment, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert other.stdout.strip() == digest(2)
