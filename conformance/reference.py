"""gsvc_ref behind the names and signatures of the stages: ``reference.render_sum(parameters=..., ...)``.

`conformance.pairs` says which of its functions that is; where it has none of the name, `conformance.stages` translates.
"""

from collections.abc import Callable

from conformance.stage import Values, stages


def namespace() -> dict[str, Callable[..., Values]]:
    """gsvc_ref's function of every stage, by name."""
    return {name: stage.reference for name, stage in stages().items()}


def __getattr__(name: str) -> Callable[..., Values]:
    try:
        return namespace()[name]
    except KeyError:
        raise AttributeError(f"there is no stage {name}") from None
