"""One typed decorator around Numba, so that every kernel is compiled by the same rules."""

import functools
import types
from collections.abc import Callable
from typing import Any, Final, ParamSpec, TypeVar, cast

from gsvc_ref._compiler import numba
from gsvc_ref._kernel_cache import keep

P = ParamSpec("P")
R = TypeVar("R")

config: Any = numba.config
OPTIONS: Final = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def kernel(*, contract: bool = False, inline: bool = False) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Compile a function with Numba, cached on disk; it stays plain Python under ``NUMBA_DISABLE_JIT=1``.

    Kernels copy from one array to another element by element: an assignment of slices would have Numba compile the
    text of its message on unequal shapes, for three seconds.

    Parameters
    ----------
    contract
        Allow a multiply and an add to be fused. Never set for anything that must be exact (spec.md section 3.3).
    inline
        Ask LLVM to inline the function into its callers.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        if config.DISABLE_JIT:
            return function
        # Where nothing is said about contraction, Numba compiles a kernel as it does the one that calls it first.
        options: Any = OPTIONS | {"fastmath": {"contract"} if contract else False}
        if inline:
            options["forceinline"] = True

        @functools.cache  # most kernels are never called from Python
        def dispatcher() -> Any:
            return keep(numba.njit(**options)(function))

        @functools.wraps(function)
        def call(*arguments: P.args, **named: P.kwargs) -> R:
            return cast(R, dispatcher()(*arguments, **named))

        # Kernels that call this one compile it as part of themselves. The dispatcher would also make a function that
        # takes Python's objects, and keep it on disk: half of the time of a first start.
        @numba.extending.overload(call, jit_options=options, strict=False)
        def part(*arguments: Any, **named: Any) -> Callable[P, R]:
            return function

        call.__dict__["dispatcher"] = dispatcher
        return call

    return decorate


def without_contraction(contracted: Callable[P, R], **names: Any) -> Callable[P, R]:
    """The twin of an inlined kernel that rounds every operation: the same text, compiled without contraction.

    Parameters
    ----------
    contracted
        A function decorated with ``kernel(contract=True, inline=True)``.
    names
        Values of global names of its module in the twin, where it calls kernels that have twins themselves.
    """
    plain = cast(types.FunctionType, getattr(contracted, "__wrapped__", contracted))
    name = f"{plain.__name__}_strict"
    twin = types.FunctionType(plain.__code__, {**plain.__globals__, **names}, name)
    twin.__qualname__ = name  # Numba's cache knows functions by it
    twin.__module__ = plain.__module__
    return kernel(inline=True)(cast(Callable[P, R], twin))
