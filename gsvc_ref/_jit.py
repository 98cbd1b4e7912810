"""One typed decorator around Numba, so that every kernel is compiled by the same rules."""

import types
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

from gsvc_ref._compiler import numba
from gsvc_ref._kernel_cache import KernelCache, kernel_folder
from gsvc_ref._kernel_parts import PARTS, Part, RememberingCompiler

P = ParamSpec("P")
R = TypeVar("R")


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
        # Where nothing is said about contraction, Numba compiles a kernel as it does the one that calls it first.
        fastmath = {"contract"} if contract else False
        options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": fastmath}
        if PARTS:
            options |= {"no_cfunc_wrapper": True, "pipeline_class": RememberingCompiler}
        if inline:
            options["forceinline"] = True
        compiled: Any = numba.njit(**options)(function)
        if compiled is not function:  # it is where the compiler is switched off
            _keep(compiled, function)
            if PARTS:
                part = Part(compiled)
                compiled.get_call_template, compiled.get_overload = part.get_call_template, part.get_overload
        return cast(Callable[P, R], compiled)

    return decorate


def _keep(compiled: Any, function: Callable[..., Any]) -> None:
    """Let Numba keep what it compiles in our folder."""
    folder = kernel_folder(function.__module__.partition(".")[0])
    if folder is not None:
        compiled._cache = KernelCache(function, folder)


def without_contraction(contracted: Callable[P, R], **names: Any) -> Callable[P, R]:
    """The twin of an inlined kernel that rounds every operation: the same text, compiled without contraction.

    Parameters
    ----------
    contracted
        A function decorated with ``kernel(contract=True, inline=True)``.
    names
        Values of global names of its module in the twin, where it calls kernels that have twins themselves.
    """
    plain = cast(types.FunctionType, getattr(contracted, "py_func", contracted))
    name = f"{plain.__name__}_strict"
    twin = types.FunctionType(plain.__code__, {**plain.__globals__, **names}, name)
    twin.__qualname__ = name  # Numba's cache knows functions by it
    twin.__module__ = plain.__module__
    return kernel(inline=True)(cast(Callable[P, R], twin))
