"""Elements of a wrong output as a table: expected, given, their ratio, and a colour for the error."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.cli.text import plural
from gsvc_conformance.names import columns, element, item
from gsvc_conformance.operation import Operation
from gsvc_conformance.report.measures import (
    F8,
    Expected,
    colors_of,
    error_ratios,
    measure_of,
    text_color,
    wrong_elements,
)

MAX_ROWS: Final = 8
"""Maximum number of rows that are shown."""
MAX_COLUMNS: Final = 12
"""A matrix that is no wider than this is shown row by row, such as (N, 8); of anything else single elements are."""


@dataclass(frozen=True)
class Cell:
    """One element.

    Attributes
    ----------
    given, expected
        The numbers.
    ratio
        given / expected, or the difference of integers; empty if there is neither.
    color
        The background and the text's colour of a wrong element, for CSS; empty if it is right.
    """

    given: str
    expected: str
    ratio: str
    color: tuple[str, str] | None


@dataclass(frozen=True)
class ElementTable:
    """Rows of an output, the worst first.

    Attributes
    ----------
    title
        A sentence that says what is shown, and what is left out.
    columns
        The names of the columns; a single one that is empty where each row is one element.
    rows
        The name of each row, and its cells.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, tuple[Cell, ...]], ...]


def element_table(operation: Operation, name: str, expectation: Expected, actual: NDArray[Any]) -> ElementTable:
    """The worst rows of a matrix such as (N, 8), or the worst elements of anything else.

    Parameters
    ----------
    operation, name
        The operation and the name of the output.
    expectation
        The expectation.
    actual
        The array that was given, of the expected type and shape.
    """
    ratio = error_ratios(expectation, actual)
    wrong = wrong_elements(expectation, ratio)
    by_row = actual.ndim == 2 and 1 < actual.shape[1] <= MAX_COLUMNS
    if by_row:
        named = columns(operation, name, actual.shape[1])
        heads = named if len(named) == actual.shape[1] else tuple(f"column {k}" for k in range(actual.shape[1]))
        of_rows, severity, thing = np.asarray(wrong.any(axis=1)), ratio.max(axis=1), "row"
    else:
        heads, of_rows, severity, thing = ("",), wrong.ravel(), ratio.ravel(), "element"
    chosen = np.argsort(-severity, kind="stable")[: min(MAX_ROWS, max(int(of_rows.sum()), 1))]
    cells = _Cells(expectation, actual, ratio, wrong)
    rows = []
    for n in map(int, chosen):
        if by_row:
            rows.append((f"{item(operation, name)} {n}", tuple(cells.at((n, k)) for k in range(len(heads)))))
        else:
            place = tuple(int(index) for index in np.unravel_index(n, actual.shape))
            rows.append((element(operation, name, place, actual.shape), (cells.at(place),)))
    return ElementTable(_title(name, thing, len(rows), of_rows, measure_of(expectation)), heads, tuple(rows))


def _title(name: str, thing: str, shown: int, wrong: NDArray[np.bool_], measure: str) -> str:
    """What the table shows, and how much it leaves out."""
    count = int(wrong.sum())
    if not count:
        what = f"no {thing} is wrong by itself, but all together are; the {plural(shown, thing)} with the largest error"
    elif shown < count:
        what = f"the {shown} worst of {plural(count, f'wrong {thing}')}, {count - shown:,} left out"
    else:
        what = f"{plural(count, f'wrong {thing}')}"
    right = f"; {plural(len(wrong) - count, thing)} right" if count < len(wrong) else ""
    return f"{name}: {what}{right}. The colour is {measure}."


@dataclass(frozen=True)
class _Cells:
    """The elements of an output as cells."""

    expectation: Expected
    actual: NDArray[Any]
    ratio: F8
    wrong: NDArray[np.bool_]

    def at(self, place: tuple[int, ...]) -> Cell:
        given, expected = self.actual[place], self.expectation.value[place]
        color = None
        if self.wrong[place]:
            rgb = colors_of(self.expectation, np.asarray(self.ratio[place]))
            color = (f"#{bytes(rgb).hex()}", text_color(rgb))
        return Cell(_number(given), _number(expected), _relation(given, expected), color)


def _number(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, np.floating) else str(value)


def _relation(given: Any, expected: Any) -> str:
    """Their ratio, of integers their difference, where it says anything."""
    if given == expected:
        return ""
    if not isinstance(given, np.floating):
        return f"{int(given) - int(expected):+d}"
    wide, right = float(given), float(expected)
    return f"× {wide / right + 0.0:.4g}" if right and np.isfinite([wide, right]).all() else ""
