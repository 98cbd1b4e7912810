"""How gsvc_ref compiles: one typed decorator around Numba, so that every kernel is compiled by the same rules."""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba

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
        options: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "parallel": parallel}
        if contract:
            options["fastmath"] = {"contract"}
        if inline:
            options["forceinline"] = True
        return cast(Callable[P, R], numba.njit(**options)(function))

    return decorate
