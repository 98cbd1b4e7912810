"""gsvc_ref by the names and signatures of the operations: ``reference.render_sum(parameters=..., ...)``.

`gsvc_conformance.pairs` says which of its functions that is; where it has none of the name,
`gsvc_conformance.operations` translates.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Final

from gsvc_conformance.operation import Values, operations

RENDERING: Final = "gsvc_ref.rendering"
"""A module that needs all packages of gsvc_ref: beside a checkout gsvc_ref itself is always there."""


def is_installed() -> bool:
    """Whether gsvc_ref and its packages are there."""
    try:
        import_module(RENDERING)
    except ModuleNotFoundError:
        return False
    return True


def namespace() -> dict[str, Callable[..., Values]]:
    """gsvc_ref's function of every operation, by name.

    Raises
    ------
    ModuleNotFoundError
        gsvc_ref or one of its packages is not installed.
    """
    import_module(RENDERING)
    return {name: operation.reference for name, operation in operations().items()}


def __getattr__(name: str) -> Callable[..., Values]:
    try:
        return namespace()[name]
    except KeyError:
        raise AttributeError(f"there is no operation {name}") from None
