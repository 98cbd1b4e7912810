"""gsvc_ref by the names and signatures of the operations: ``reference.render_sum(parameters=..., ...)``.

`gsvc_conformance.pairs` says which of its functions that is; where it has none of the name,
`gsvc_conformance.operations` translates.
"""

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Final

from gsvc_conformance.operation import Values, operations

COMPILER: Final = "gsvc_ref._compiler"
NEEDED: Final = ("gsvc_ref", "numba")
"""The second is loaded by that module of the first: beside a checkout gsvc_ref itself is always there."""


def is_installed() -> bool:
    """Whether gsvc_ref and its packages are there."""
    return all(map(find_spec, NEEDED))


def namespace() -> dict[str, Callable[..., Values]]:
    """gsvc_ref's function of every operation, by name.

    Raises
    ------
    ModuleNotFoundError
        gsvc_ref or one of its packages is not installed.
    """
    import_module(COMPILER)
    return {name: operation.reference for name, operation in operations().items()}


def __getattr__(name: str) -> Callable[..., Values]:
    try:
        return namespace()[name]
    except KeyError:
        raise AttributeError(f"there is no operation {name}") from None
