"""One typed decorator for Numba, so that every kernel is compiled by the same rules.

Numba is loaded when Python first calls a kernel: what only imports kernels, or reads small streams, does without.
"""

import functools
import os
import types
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Final, ParamSpec, TypeVar, cast

import numpy as np

P = ParamSpec("P")
R = TypeVar("R")

DISABLED: Final = os.environ.get("NUMBA_DISABLE_JIT", "").strip() not in ("", "0")
OPTIONS: Final = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}

SMALL_TO_READ: Final = 1 << 14
SMALL_TO_COPY: Final = 1 << 20
"""Bytes of streams that plain Python decodes, or checks and copies, in the time that Numba takes to load."""

_plain: Final = ContextVar("_plain", default=False)


_parts: Final[deque[tuple[Callable[..., Any], Callable[..., Any], dict[str, Any]]]] = deque()
"""Kernels that Numba does not know of yet."""


def kernel(*, contract: bool = False, inline: bool = False) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Compile a function with Numba, cached on disk; it stays plain Python under ``NUMBA_DISABLE_JIT=1``.

    `contract` allows a multiply and an add to be fused: never for anything that must be exact (spec.md section 3.3).
    `inline` asks LLVM to inline the function into its callers. Kernels copy from one array to another element by
    element: an assignment of slices would have Numba compile the text of its message on unequal shapes, for three
    seconds.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        if DISABLED:
            return function
        # Where nothing is said about contraction, Numba compiles a kernel as it does the one that calls it first.
        options: Any = OPTIONS | {"fastmath": {"contract"} if contract else False}
        if inline:
            options["forceinline"] = True

        @functools.cache  # most kernels are never called from Python
        def dispatcher() -> Any:
            from gsvc_ref._compiler import compiled

            return compiled(function, options, _parts)

        @functools.wraps(function)
        def call(*arguments: P.args, **named: P.kwargs) -> R:
            return cast(R, (function if _plain.get() else dispatcher())(*arguments, **named))

        _parts.append((call, function, options))
        call.__dict__["dispatcher"] = dispatcher
        return call

    return decorate


def without_contraction(contracted: Callable[P, R], **names: Any) -> Callable[P, R]:
    """The twin of a kernel with ``contract=True, inline=True`` that rounds every operation, from the same text.

    `names` are values of global names of its module in the twin, where it calls kernels that have twins themselves.
    """
    plain = cast(types.FunctionType, getattr(contracted, "__wrapped__", contracted))
    name = f"{plain.__name__}_strict"
    twin = types.FunctionType(plain.__code__, {**plain.__globals__, **names}, name)
    twin.__qualname__ = name  # Numba's cache knows functions by it
    twin.__module__ = plain.__module__
    return kernel(inline=True)(cast(Callable[P, R], twin))


@contextmanager
def plain_kernels() -> Iterator[None]:
    """Run kernels as plain Python inside the block: those that read and reconstruct give the same bits either way."""
    token = _plain.set(True)
    try:
        with np.errstate(all="ignore"):  # compiled kernels do not warn either
            yield
    finally:
        _plain.reset(token)


def are_plain() -> bool:
    """Whether kernels run as plain Python here."""
    return DISABLED or _plain.get()
