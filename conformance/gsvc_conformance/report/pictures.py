"""Pictures of a wrong output: what was expected, what came, and the error against its bound."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.encoding import Task, worst_frame
from gsvc_conformance.expectations import NO_ARRAYS, Bounded, Decision, Encoding, Exact, Interval
from gsvc_conformance.operation import Values
from gsvc_conformance.results import Result
from gsvc_conformance.vectors import Vector
from gsvc_lab.pages.pictures import png_uri

U1 = NDArray[np.uint8]
F8 = NDArray[np.float64]

MAX_ROWS: Final = 256
"""Rows of a table that are shown, around the worst one; they are the columns of the picture."""
TABLE_COLUMNS: Final = 16
"""A matrix that is no wider than this is a table, such as (N, 8); a wider one is a plane of pixels."""
FEWEST: Final = 4
"""Minimum number of elements of an output with a picture: for fewer the sentence says enough."""
WORST_OF_OPERATION: Final = 3
"""Maximum number of wrong vectors of an operation that have pictures."""
FLATTEST: Final = 8
"""Maximum width of a picture in heights; a wider one is stretched."""

RAMP: Final = (0.0, 1.0, 1.0001, 2.0)
RAMP_COLORS: Final = np.array([(24, 28, 36), (42, 157, 143), (255, 214, 10), (230, 30, 30)], np.float64)
"""Error/bound: dark to green from 0 to 1, yellow to red on a logarithmic scale from 1 to 10,000."""
DECADES: Final = 4
NOT_FINITE: Final = (255, 0, 200)
KEY: Final = (
    "Errors: dark to green are within their bounds, yellow to red up to 10,000 times that, pink have no measure. "
    "Errors in units in the last place: dark is equal, yellow to red are up to 10,000 units."
)
SIGNED: Final = np.array([(48, 112, 214), (236, 236, 236), (230, 120, 20)], np.float64)
"""The colours of -1, 0 and 1 in tables."""


@dataclass(frozen=True)
class Picture:
    """One picture for the page: a data URI and what it shows."""

    uri: str
    caption: str


@dataclass(frozen=True)
class View:
    """The shown part of an array: a function that takes it out as (H, W, 3) or (H, W), and words for the caption."""

    pick: Callable[[NDArray[Any]], NDArray[Any]]
    where: str = ""
    table: bool = False


def pictures_of(vector: Vector, outputs: Values, result: Result) -> list[Picture]:
    """Expected, actual and error of the worst output that can be shown; none if none can."""
    for name, expectation in vector.expected.items():
        if isinstance(expectation, Encoding):
            return _of_stream(expectation.task, outputs[name])
    wrong = [out for out in result.outputs if not out.passed and out.place]
    for out in sorted(wrong, key=lambda out: -(out.ratio or 0)):
        expectation, actual = vector.expected[out.name], outputs[out.name]
        if isinstance(expectation, NO_ARRAYS) or out.place is None or actual.size < FEWEST:
            continue
        view, peak = _view(actual.shape, out.place), _peak(vector.inputs, expectation.value)
        shown = {"expected": expectation.value, "actual": actual}
        planes = {name: view.pick(array.astype(np.float64)) / peak for name, array in shown.items()}
        largest = _largest(planes["expected"]) if view.table else None
        worst = view.pick(error_ratios(expectation, actual))
        return [
            *(_picture(_paint(plane, largest), f"{out.name}, {name}{view.where}") for name, plane in planes.items()),
            _picture(ramp(worst.max(axis=2) if worst.ndim == 3 else worst), _title(expectation, view, out.place)),
        ]
    return []


def _of_stream(task: Task, stream: object) -> list[Picture]:
    """Source, pixels and error of the worst frame of a stream that an encoder made; none if none can be compared."""
    if (worst := worst_frame(stream, task)) is None:
        return []
    number, pixels = worst
    peak = 2.0**task.bit_depth - 1
    source, actual = task.frames[number] / peak, pixels / peak
    ratio = abs(actual - source) / 10 ** (-task.floor / 20)
    return [
        _picture(_paint(source, None), f"source (frame {number})"),
        _picture(_paint(actual, None), f"decoded (frame {number})"),
        _picture(ramp(ratio.max(axis=2)), "error / root mean squared error that the floor allows"),
    ]


def _title(expectation: Exact | Decision | Bounded | Interval, view: View, place: tuple[int, ...]) -> str:
    """The caption of the picture of errors, with the place of the worst pixel."""
    floats = isinstance(expectation, Exact) and expectation.value.dtype.kind == "f"
    measure = "error in units in the last place" if floats else "error/bound"
    if view.table:
        return f"{measure}{view.where}"
    row, column = place[1:3] if view.where else place[:2]
    return f"{measure}{view.where}, the worst in row {row}, column {column}"


def error_ratios(expectation: Exact | Decision | Bounded | Interval, actual: NDArray[Any]) -> F8:
    """Error/bound of each element; where there is no bound, 0 for a right element and infinity for a wrong one.

    Of numbers that must be exact it is the distance in units in the last place, at least 1 where a bit differs.
    """
    if isinstance(expectation, Bounded):
        with np.errstate(all="ignore"):
            error = abs(actual.astype(np.float64) - expectation.value)
            ratio = np.where(error == 0, 0.0, error / np.asarray(expectation.bound, np.float64))
        return np.where(np.isnan(ratio), np.inf, ratio)
    if isinstance(expectation, Interval):
        wide = actual.astype(np.float64)
        beyond = np.maximum(expectation.lowest - wide, wide - expectation.highest)
        return np.where(beyond > 0, 1 + beyond, 0.0)
    if isinstance(expectation, Exact) and expectation.value.dtype.kind == "f":
        return _units_between(actual, expectation.value)
    wrong = actual != expectation.value
    if isinstance(expectation, Decision) and expectation.alternative is not None:
        wrong &= actual != expectation.alternative
    return np.where(wrong, np.inf, 0.0)


def _units_between(actual: NDArray[Any], expected: NDArray[Any]) -> F8:
    """The distance of two arrays of one type in floating-point numbers; infinite if only one is finite, or a NaN."""
    bits = [np.ascontiguousarray(array).view(f"i{array.dtype.itemsize}") for array in (actual, expected)]
    steps = [np.where(b < 0, np.iinfo(b.dtype).min - b, b).astype(np.float64) for b in bits]
    apart = np.where(bits[0] == bits[1], 0.0, np.maximum(abs(steps[0] - steps[1]), 1))
    return np.where(np.isfinite(actual) & np.isfinite(expected) | (apart == 0), apart, np.inf)


def ramp(ratio: F8) -> U1:
    """(..., 3) u1 colours of error/bound ratios."""
    with np.errstate(divide="ignore"):
        high = 1 + np.minimum(np.log10(np.maximum(ratio, 1)), DECADES) / DECADES
    along = np.where(ratio <= 1, ratio, np.maximum(high, RAMP[2]))
    channels = [np.interp(along, RAMP, RAMP_COLORS[:, c]) for c in range(3)]
    colors = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
    colors[~np.isfinite(ratio)] = NOT_FINITE
    return colors


def _view(shape: tuple[int, ...], place: tuple[int, ...]) -> View:
    if len(shape) == 4:
        return View(lambda array: array[place[0]], f" (frame {place[0]})")
    if len(shape) == 3 or (len(shape) == 2 and shape[1] > TABLE_COLUMNS):
        return View(lambda array: array)
    first = max(0, min(place[0] - MAX_ROWS // 2, shape[0] - MAX_ROWS))
    end = min(shape[0], first + MAX_ROWS)
    where = f" (rows {first} to {end - 1}, from left to right)"
    return View(lambda array: array.reshape(shape[0], -1)[first:end].T, where, table=True)


def _peak(inputs: Mapping[str, Any], expected: NDArray[Any]) -> float:
    """The value of white."""
    if expected.dtype.kind != "u":
        return 1.0
    return float((1 << inputs["bit_depth"]) - 1 if "bit_depth" in inputs else max(int(expected.max()), 1))


def _largest(table: F8) -> F8:
    """The largest finite magnitude of each row, or 1."""
    largest = np.where(np.isfinite(table), abs(table), 0).max(axis=1, keepdims=True)
    return np.where(largest > 0, largest, 1.0)


def _paint(plane: F8, largest: F8 | None) -> U1:
    """(H, W, 3) u1: pixels as they are; of a table, blue for negative and orange for positive numbers."""
    if largest is None:
        pixels = plane if plane.ndim == 3 else np.repeat(plane[..., None], 3, axis=2)
        colors = np.rint(255 * np.clip(np.nan_to_num(pixels), 0, 1)).astype(np.uint8)
        broken = ~np.isfinite(pixels).all(axis=2)
    else:
        share = np.clip(np.nan_to_num(plane) / largest, -1, 1)
        colors = np.stack([np.rint(np.interp(share, (-1, 0, 1), SIGNED[:, c])) for c in range(3)], -1).astype(np.uint8)
        broken = ~np.isfinite(plane)
    colors[broken] = NOT_FINITE
    return colors


def _picture(pixels: U1, caption: str) -> Picture:
    """A picture, stretched if it is too flat to be seen."""
    height, width = pixels.shape[:2]
    return Picture(png_uri(np.repeat(pixels, max(1, width // (FLATTEST * height)), axis=0)), caption)


class PictureBook:
    """The pictures of the worst few wrong vectors of each operation."""

    def __init__(self) -> None:
        self._chosen: dict[str, list[tuple[float, str, list[Picture]]]] = {}

    def add(self, vector: Vector, outputs: Values, result: Result) -> None:
        """Take the pictures of a wrong vector, if it is among the worst of its operation so far."""
        chosen = self._chosen.setdefault(vector.operation.name, [])
        ratio = result.ratio or 0.0
        if len(chosen) < WORST_OF_OPERATION or ratio > chosen[-1][0]:
            if pictures := pictures_of(vector, outputs, result):
                chosen.append((ratio, vector.id, pictures))
            chosen.sort(key=lambda entry: -entry[0])
            del chosen[WORST_OF_OPERATION:]

    def pictures(self) -> dict[str, list[Picture]]:
        """The pictures, by the id of the vector."""
        return {name: pictures for chosen in self._chosen.values() for _, name, pictures in chosen}
