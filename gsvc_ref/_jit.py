"""How gsvc_ref compiles: one typed decorator around Numba, so that every kernel is compiled by the same rules."""

import os
import shutil
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")

PACKAGE: Final = Path(__file__).resolve().parent


def kernel(
    *, parallel: bool = False, contract: bool = False, inline: bool = False
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Compile a function with Numba, cached on disk; it stays plain Python under ``NUMBA_DISABLE_JIT=1``.

    Parameters
    ----------
    parallel
        Allow ``numba.prange``. Every iteration must write memory of its own.
    contract
        Allow a multiply and an add to be fused. Never set for anything that must be exact (spec.md section 3.3).
    inline
        Ask LLVM to inline the function into its callers.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        options: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "parallel": parallel}
        if contract:
            options["fastmath"] = {"contract"}
        if inline:
            options["forceinline"] = True
        return cast(Callable[P, R], numba.njit(**options)(function))

    return decorate


def sources_key() -> str:
    """A short name for the present state of all sources of the package: their paths, sizes and times."""
    digest = sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        status = path.stat()
        digest.update(f"{path.relative_to(PACKAGE)} {status.st_size} {status.st_mtime_ns}\n".encode())
    return digest.hexdigest()[:16]


def choose_cache() -> None:
    """Give the compiled kernels a folder that belongs to the present sources.

    Numba alone looks only at the file of the function that it loads, so after an edit of a kernel in another file, or
    an update, it would go on running what that kernel was. NUMBA_CACHE_DIR, when set, is left alone.
    """
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    base = PACKAGE / "__pycache__"
    if not os.access(base if base.is_dir() else PACKAGE, os.W_OK):
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gsvc_ref"
    present = base / f"kernels-{sources_key()}"
    if not present.is_dir():
        for stale in base.glob("kernels-*"):
            shutil.rmtree(stale, ignore_errors=True)
    numba.config.CACHE_DIR = str(present)  # type: ignore[attr-defined]


choose_cache()
