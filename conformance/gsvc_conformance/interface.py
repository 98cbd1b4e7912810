"""What Python programs use of the kit: vectors, their judgement, and what wrong answers look like.

The package exports these names: ``from gsvc_conformance import vectors, judge``. The pytest plug-in and the commands
stand on the same code.
"""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from gsvc_conformance.causes import Causes
from gsvc_conformance.implementations import collect
from gsvc_conformance.operation import checked_operations
from gsvc_conformance.report.console import cause_lines, result_lines
from gsvc_conformance.results import FAULTS, Result
from gsvc_conformance.runner import Answered, Judged, judge_answer
from gsvc_conformance.vector import VECTORS, Vector
from gsvc_conformance.vector_folder import Selection, VectorFolder
from gsvc_conformance.verdicts import Report


def vectors(
    operation: str | None = None,
    *,
    case: str | None = None,
    group: str | None = None,
    tier: str | None = None,
    set: int | None = None,
    folder: str | Path | None = None,
) -> Iterator[Vector]:
    """Golden vectors, from the core ones to streams that must be refused; each is read when it is asked for.

    Parameters
    ----------
    operation
        Only those of an operation, such as ``render_sum``; `gsvc-conformance list` names all.
    case
        Only those whose id, or its last part, matches a glob: ``core/*``, ``*needle*``.
    group
        Only those of a conformance class, such as ``rendering``.
    tier
        Only those of a tier: ``core``, ``uncommon``, ``stress`` or ``faulty``.
    set
        Only those of a numbered set; None: of the newest.
    folder
        A folder of vectors; None: those that the kit has.

    Returns
    -------
    Iterator[Vector]
        Each has `id`, `title`, `operation` (with its `name`), `tier`, `level`, `inputs` (arrays, numbers and bytes by
        the names of the operation's inputs; each read anew, so that they may be changed) and `expected` (an
        `Expectation` by the name of each output, with its number `value` and, where one is allowed, its `bound`).

    Raises
    ------
    UsageError
        There is no such operation, set or folder, nothing is selected, or a file is damaged.

    Examples
    --------
    >>> from gsvc_conformance import vectors
    >>> vector = next(vectors("render_sum", case="needle_across"))
    >>> vector.id
    'core/render_sum/needle_across'
    >>> {name: getattr(value, "shape", value) for name, value in vector.inputs.items()}
    {'parameters': (1, 8), 'width': 25, 'height': 23}
    >>> vector.expected["sum"].value.shape, vector.expected["sum"].bound.shape
    ((23, 25, 3), (23, 25, 3))
    """
    selection = Selection(
        operations=checked_operations(_some(operation)), patterns=_some(case), groups=_some(group), tiers=_some(tier)
    )
    found = VectorFolder(VECTORS if folder is None else Path(folder), "newest" if set is None else set)
    return found.read(found.select(selection))


def _some(value: str | None) -> tuple[str, ...]:
    return () if value is None else (value,)


def judge(vector: Vector, outputs: Mapping[str, Any]) -> Result:
    """Judge what an implementation gave for a vector.

    Parameters
    ----------
    vector
        One of `vectors`.
    outputs
        By the names of the operation's outputs: arrays of their types and shapes, Python's numbers, texts.

    Returns
    -------
    Result
        `passed`; `outcome`: ``pass``, ``fail``, ``error`` where an output is missing, or ``unsupported`` where a stream
        above level 1 is refused as unsupported; `message`: what is wrong, where and by how much; `ratio`: the worst
        error as a multiple of its bound, None where nothing has a bound; `outputs`: the same for each output.

    Examples
    --------
    >>> from gsvc_conformance import judge, vectors
    >>> vector = next(vectors("from_half"))
    >>> judge(vector, {"values": vector.inputs["bits"].view("f2").astype("f4")}).passed
    True
    >>> result = judge(vector, {"values": vector.inputs["bits"].astype("f4")})
    >>> result.outcome
    'fail'
    >>> result.message  # doctest: +ELLIPSIS
    'output values is ..., expected ...'
    """
    return _judged(vector, outputs).result


def _judged(vector: Vector, outputs: Mapping[str, Any]) -> Judged:
    return judge_answer(vector, Answered(collect(vector.operation, outputs), 0.0))


def assert_vector(vector: Vector, outputs: Mapping[str, Any]) -> None:
    """Raise an AssertionError with the kit's message if `judge` finds something wrong.

    Parameters
    ----------
    vector, outputs
        As in `judge`.

    Raises
    ------
    AssertionError
        The outcome is ``fail`` or ``error``.

    Examples
    --------
    >>> import pytest
    >>> from gsvc_conformance import assert_vector, vectors
    >>> @pytest.mark.parametrize("vector", vectors("from_half"), ids=lambda vector: vector.id)
    ... def test_from_half(vector):
    ...     assert_vector(vector, {"values": vector.inputs["bits"].view("f2").astype("f4")})
    """
    result = judge(vector, outputs)
    if result.outcome in FAULTS:
        raise AssertionError("\n".join(result_lines(result)))


def diagnose(answers: Iterable[tuple[Vector, Mapping[str, Any]]]) -> list[str]:
    """Say what wrong answers look like.

    Parameters
    ----------
    answers
        Vectors with their outputs as in `judge`, in the order in which they were asked for: all of an operation, also
        those that pass, since a cause must not explain these.

    Returns
    -------
    list[str]
        At most three sentences, that which explains most failures first; none if nothing is wrong or known.

    Examples
    --------
    >>> import numpy as np
    >>> from gsvc_conformance import diagnose, vectors
    >>> def zeros(vector):
    ...     return {"values": np.zeros(vector.inputs["bits"].shape, "f4")}
    >>> diagnose((vector, zeros(vector)) for vector in vectors("from_half"))  # doctest: +ELLIPSIS
    ['...']
    """
    causes, results = Causes(), []
    for vector, outputs in answers:
        judged = _judged(vector, outputs)
        causes.add(judged)
        results.append(judged.result)
    return cause_lines(Report({}, "", "", [], causes.find(results)[0]))
