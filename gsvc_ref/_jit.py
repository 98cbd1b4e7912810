"""How gsvc_ref compiles: one typed decorator around Numba, so that every kernel is compiled by the same rules."""

import shutil
import sys
import types
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import Any, ParamSpec, TypeVar, cast

from gsvc_ref._compiler import numba
from gsvc_ref._kernel_cache import FOLDER, KernelCache
from gsvc_ref._kernel_folder import ADVICE, chosen_folder, stale_folders

P = ParamSpec("P")
R = TypeVar("R")


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
        options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "parallel": parallel}
        if contract:
            options["fastmath"] = {"contract"}
        if inline:
            options["forceinline"] = True
        compiled = numba.njit(**options)(function)
        if compiled is not function:  # it is where the compiler is switched off
            with suppress(OSError, RuntimeError):  # without a folder nothing is kept
                cache: Any = KernelCache
                compiled._cache = cache(function)
        return cast(Callable[P, R], compiled)

    return decorate


def without_contraction(contracted: Callable[P, R], **names: Any) -> Callable[P, R]:
    """The twin of an inlined kernel that rounds every operation: the same text, compiled without contraction.

    Parameters
    ----------
    contracted
        A function decorated with ``kernel(contract=True, inline=True)``.
    names
        What global names of its module mean in the twin, where it calls kernels that have twins themselves.
    """
    plain = cast(types.FunctionType, getattr(contracted, "py_func", contracted))
    name = f"{plain.__name__}_strict"
    twin = types.FunctionType(plain.__code__, {**plain.__globals__, **names}, name)
    twin.__qualname__ = name  # Numba's cache knows functions by it
    twin.__module__ = plain.__module__
    return kernel(inline=True)(cast(Callable[P, R], twin))


def _warn(sentence: str) -> None:
    """Warn; where warnings are errors (``python -W error``) only tell it, for what is slow works all the same."""
    try:
        warnings.warn(sentence, stacklevel=3)
    except Warning:
        if sys.stderr is not None:
            print(sentence, file=sys.stderr)


def prepare_kernel_folder() -> None:
    """Remove the kernels of sources that are no more; warn if kernels cannot be kept."""
    chosen = chosen_folder()
    if FOLDER is None:
        _warn(f"compiled kernels cannot be kept, so each start takes half a minute: {ADVICE}")
    elif chosen is not None and chosen != FOLDER:
        _warn(f"compiled kernels cannot be kept in {chosen}, where NUMBA_CACHE_DIR says: they are kept in {FOLDER}")
    if FOLDER is not None and not FOLDER.is_dir():
        for stale in stale_folders():
            shutil.rmtree(stale, ignore_errors=True)


prepare_kernel_folder()
