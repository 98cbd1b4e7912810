"""gsvc_ref by the names and signatures of the operations: ``reference.render_sum(parameters=..., ...)``.

`gsvc_conformance.pairs` says which of its functions that is; where it has none of the name,
`gsvc_conformance.operations` translates.
"""

from collections.abc import Callable
from importlib import import_module

from gsvc_conformance.operation import Values, operations


def namespace() -> dict[str, Callable[..., Values]]:
    """gsvc_ref's function of every operation, by name.

    Raises
    ------
    ModuleNotFoundError
        gsvc_ref is not installed.
    """
    import_module("gsvc_ref")
    return {name: operation.reference for name, operation in operations().items()}


def __getattr__(name: str) -> Callable[..., Values]:
    try:
        return namespace()[name]
    except KeyError:
        raise AttributeError(f"there is no operation {name}") from None
