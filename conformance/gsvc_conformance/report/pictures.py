"""What a page shows of a wrong output: pictures with its errors where it is a picture, else a table of elements."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.encoding import Task, worst_frame
from gsvc_conformance.expectations import NO_ARRAYS, Encoding
from gsvc_conformance.names import dimensions
from gsvc_conformance.operation import Values
from gsvc_conformance.report.element_tables import ElementTable, element_table
from gsvc_conformance.report.measures import NOT_FINITE, U1, Expected, colors_of, error_ratios, measure_of, ramp
from gsvc_conformance.report.png import png_uri
from gsvc_conformance.results import Result
from gsvc_conformance.vector import Vector

F8 = NDArray[np.float64]

WINDOW: Final = 192
"""Pixels of a picture along each axis, around the worst one."""
FEWEST: Final = 4
"""Minimum number of elements of an output that is shown: for fewer the sentence says enough."""
SIMPLEST: Final = 3
"""Number of the simplest wrong vectors of an operation that are shown; the worst one is shown besides."""
USUAL: Final = (0.1, 1.5)
"""Ends of the largest magnitudes of colours in 0..1, which are painted as they are."""


@dataclass(frozen=True)
class Picture:
    """One picture for the page.

    Attributes
    ----------
    uri
        The data URI.
    caption
        A sentence that says what it shows.
    width, height
        Size in pixels.
    mark
        The column and the row of the worst pixel.
    """

    uri: str
    caption: str
    width: int
    height: int
    mark: tuple[int, int]


View = tuple[Picture, ...] | ElementTable
"""What the page shows of a vector: expected, actual and error as pictures, or a table."""


def view_of(vector: Vector, outputs: Values, result: Result) -> View | None:
    """The worst output that can be shown; None if none can."""
    for name, expectation in vector.expected.items():
        if isinstance(expectation, Encoding):
            return _of_stream(expectation.task, outputs[name]) or None
    wrong = [out for out in result.outputs if not out.passed and out.place]
    for out in sorted(wrong, key=lambda out: -(out.ratio or 0)):
        expectation, actual = vector.expected[out.name], outputs[out.name]
        if isinstance(expectation, NO_ARRAYS) or out.place is None or actual.size < FEWEST:
            continue
        axes = _axes(dimensions(vector.operation, out.name))
        if axes is None:
            return element_table(vector.operation, out.name, expectation, actual)
        return _pictures(vector.inputs, out.name, expectation, actual, out.place, axes)
    return None


def _axes(letters: tuple[str, ...]) -> tuple[int, int] | None:
    """The axes of rows and columns of pixels, or None: ``("T", "H", "W", "3")`` has 1 and 2."""
    lower = [letter.lower() for letter in letters]
    return (lower.index("h"), lower.index("w")) if {"h", "w"} <= {*lower} else None


def _of_stream(task: Task, stream: object) -> tuple[Picture, ...]:
    """Source, pixels and error of the worst frame of a stream that an encoder made; none if none can be compared."""
    if (worst := worst_frame(stream, task)) is None:
        return ()
    number, pixels = worst
    peak = 2.0**task.bit_depth - 1
    source, actual = task.frames[number] / peak, pixels / peak
    ratio = (abs(actual - source) / 10 ** (-task.floor / 20)).max(axis=2)
    height, width = ratio.shape
    row, column = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    shown = {
        f"source (frame {number})": _paint(source),
        f"decoded (frame {number})": _paint(actual),
        "error / root mean squared error that the floor allows": ramp(ratio),
    }
    mark = (int(column), int(row))
    return tuple(Picture(png_uri(painted), caption, width, height, mark) for caption, painted in shown.items())


def _pictures(
    inputs: Mapping[str, Any], name: str, expectation: Expected, actual: NDArray[Any], place: tuple[int, ...],
    axes: tuple[int, int],
) -> tuple[Picture, ...]:  # fmt: skip
    """Expected, actual and error, each of the same pixels."""
    pick, mark, where = _window(actual.shape, place, axes)
    paint, scale = _painter(inputs, expectation.value)
    worst = pick(error_ratios(expectation, actual)).max(axis=2)
    row, column = place[axes[0]], place[axes[1]]
    shown = {
        f"{name}, expected{where}{scale}": paint(pick(expectation.value)),
        f"{name}, actual{where}{scale}": paint(pick(actual)),
        f"{measure_of(expectation)}{where}, the worst in row {row}, column {column}": colors_of(expectation, worst),
    }
    height, width = worst.shape
    return tuple(Picture(png_uri(pixels), caption, width, height, mark) for caption, pixels in shown.items())


def _window(
    shape: tuple[int, ...], place: tuple[int, ...], axes: tuple[int, int]
) -> tuple[Callable[[NDArray[Any]], NDArray[Any]], tuple[int, int], str]:
    """A function that takes the shown (H, W, channels) out of an array, the worst pixel there, and words for it."""
    firsts = [max(0, min(place[axis] - WINDOW // 2, shape[axis] - WINDOW)) for axis in axes]
    rows, columns = (slice(first, first + WINDOW) for first in firsts)
    frame = place[0] if axes[0] == 1 else None

    def pick(array: NDArray[Any]) -> NDArray[Any]:
        part = (array if frame is None else array[frame])[rows, columns]
        return part if part.ndim == 3 else part[..., None]

    words = [f"frame {frame}"] if frame is not None else []
    for name, axis, first in zip(("rows", "columns"), axes, firsts, strict=True):
        if shape[axis] > WINDOW:
            words.append(f"{name} {first} to {first + WINDOW - 1} of {shape[axis]:,}")
    mark = (place[axes[1]] - firsts[1], place[axes[0]] - firsts[0])
    return pick, mark, f" ({', '.join(words)})" if words else ""


def _painter(inputs: Mapping[str, Any], expected: NDArray[Any]) -> tuple[Callable[[NDArray[Any]], U1], str]:
    """A function that paints (H, W, channels) values, and words for its scale where white is not the usual white."""
    if expected.dtype.kind == "u":
        peak = (1 << inputs["bit_depth"]) - 1 if "bit_depth" in inputs else max(int(expected.max()), 1)
        return lambda values: _paint(values / peak), ""
    finite = np.where(np.isfinite(expected), expected, 0.0).astype(np.float64)
    largest = float(abs(finite).max()) or 1.0
    if finite.min() < -USUAL[0] * largest:
        return lambda values: _paint(0.5 + values / (2 * largest)), f"; grey is 0, white {largest:.3g}"
    if USUAL[0] <= largest <= USUAL[1]:
        return _paint, ""
    return lambda values: _paint(values / largest), f"; white is {largest:.3g}"


def _paint(values: NDArray[Any]) -> U1:
    """(H, W, 3) u1 of (H, W, 1 or 3) values, of which 0 is black and 1 is white; what is no number is pink."""
    wide = np.repeat(values, 3, axis=2) if values.shape[2] == 1 else values
    colors = np.rint(255 * np.clip(np.nan_to_num(wide.astype(np.float64)), 0, 1)).astype(np.uint8)
    colors[~np.isfinite(wide).all(axis=2)] = NOT_FINITE
    return colors


class PictureBook:
    """The views of the simplest few wrong vectors of each operation, and of the worst one.

    Attributes
    ----------
    faults
        A sentence about each vector that could not be drawn.
    """

    def __init__(self) -> None:
        self.faults: list[str] = []
        self._simplest: dict[str, list[tuple[tuple[int, bool, int, str], View]]] = {}
        self._worst: dict[str, tuple[float, str, View]] = {}

    def add(self, vector: Vector, outputs: Values, result: Result) -> None:
        """Take the view of a wrong vector, if it is among the simplest of its operation so far, or the worst."""
        simplest = self._simplest.setdefault(result.operation, [])
        rank = result.simplicity
        ratio = result.ratio or 0.0
        simple = len(simplest) < SIMPLEST or rank < simplest[-1][0]
        worst = result.operation not in self._worst or (-ratio, result.id) < (
            -self._worst[result.operation][0],
            self._worst[result.operation][1],
        )
        view: View | None = None
        try:
            view = view_of(vector, outputs, result) if simple or worst else None
        except Exception as error:  # an output may break what draws it: the page has everything else
            self.faults.append(f"{result.id} has no picture ({type(error).__name__}: {error}); please report it")
        if view is not None and worst:
            self._worst[result.operation] = (ratio, result.id, view)
        if view is not None and simple:
            simplest.append((rank, view))
            simplest.sort(key=lambda entry: entry[0])
            del simplest[SIMPLEST:]

    def pictures(self) -> dict[str, View]:
        """The views, by the id of the vector."""
        found = {name: view for _, name, view in self._worst.values()}
        return found | {rank[-1]: view for entries in self._simplest.values() for rank, view in entries}
