"""Numba, set up: which variables it cannot use, how wide its vectors are, and how it gets to know kernels."""

import os
from collections import deque
from collections.abc import Callable
from threading import Lock
from typing import Any, Final

from gsvc_base.errors import UsageError

try:
    import numba
    import numba.extending
except ValueError as error:
    VARIABLES = ", ".join(name for name in os.environ if name.startswith("NUMBA_"))
    raise UsageError(f"Numba does not start ({str(error).rstrip('.')}): correct or unset {VARIABLES}") from None

from numba.core import codegen

from gsvc_ref._kernel_cache import keep

__all__ = ["compiled", "numba"]

_lock = Lock()


Part = tuple[Callable[..., Any], Callable[..., Any], dict[str, Any]]
"""A kernel that others may call: its name in them, the function that it means, and the options for the compiler."""


def compiled(function: Callable[..., Any], options: dict[str, Any], parts: deque[Part]) -> Any:
    """A function that is compiled when it is called; `parts` are other kernels that it may call, which it takes."""
    njit: Any = numba.njit
    with _lock:
        while parts:
            _tell(*parts.popleft())
        return keep(njit(**options)(function))


def _tell(call: Callable[..., Any], function: Callable[..., Any], options: dict[str, Any]) -> None:
    """Have kernels that call a part compile it with themselves.

    As a dispatcher it would also get a function that takes Python's objects, and a file for it on disk.
    """

    def meant(*arguments: Any, **named: Any) -> Callable[..., Any]:
        return function

    overload: Any = numba.extending.overload
    overload(call, jit_options=options, strict=False)(meant)


PREFER_256: Final = frozenset((
    "skylake-avx512", "cascadelake", "cooperlake", "cannonlake", "icelake-client", "icelake-server", "tigerlake",
    "rocketlake", "sapphirerapids", "emeraldrapids", "graniterapids", "graniterapids-d",
))  # fmt: skip
"""Intel's processors with AVX-512 by LLVM's names. For them alone LLVM makes vectors of 256 bits where it might make
some of 512: the first of them had to lower their clock for these. For AMD's it makes what suits them already."""


def widened(cpu: str, features: str) -> str | None:
    """The features of a processor with vectors of 512 bits; None where there are none, or LLVM makes them anyway.

    `cpu` is LLVM's name, and `features` is what the processor has and may use, as LLVM writes it: ``+avx2,-avx512f``.
    """
    if cpu not in PREFER_256 or "+avx512f" not in features.split(","):
        return None
    return f"{features},-prefer-256-bit"


def use_wide_vectors() -> None:
    """Let Numba make vectors as wide as the processor has, unless NUMBA_CPU_NAME or NUMBA_CPU_FEATURES say otherwise.

    It is a setting of the process, which counts until Numba compiles or loads its first kernel. Kernels on disk are
    told apart by Numba, which keeps name and features with them. Results of precision ``deterministic`` do not depend
    on it: the 16 lanes of a tile are sums of their own in whatever registers they lie, lanes are added in an order that
    the source states (`sums.tree`), and without contraction LLVM rounds each operation as it is written.
    """
    config: Any = numba.config
    machine: Any = codegen
    if config.CPU_NAME is not None or config.CPU_FEATURES is not None:
        return
    cpu = machine.ll.get_host_cpu_name()
    features = widened(cpu, machine.get_host_cpu_features())
    if features is not None:
        config.CPU_NAME, config.CPU_FEATURES = cpu, features


use_wide_vectors()
