"""Splats that somebody else has found, frame by frame: what may be coded of them, and which continue which."""

from collections.abc import Iterable, Iterator
from typing import Any, Final, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from gsvc_base.arrays import F4, F8, I8
from gsvc_base.constants import SMALLEST_NORMAL
from gsvc_base.errors import UsageError
from gsvc_base.splats import PARAMETERS_PER_SPLAT, Splats
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.bitstream.work import rendering_work
from gsvc_ref.main.state import X_MOST
from gsvc_ref.paper.half import LARGEST_HALF
from gsvc_ref.paper.lsq_parameters import SCALE_FLOOR

Degenerate = Literal["refuse", "turn", "remove"]
FrameOfSplats = Splats | ArrayLike | tuple[Splats | ArrayLike, ArrayLike]
"""The splats of a frame, or these and their ids."""

COLUMN_NAMES: Final = ("x", "y", "l11", "l21", "l22", "R", "G", "B")
COLUMN_L11, COLUMN_L21, COLUMN_L22 = 2, 3, 4

LARGEST_FACTOR: Final = 2.0**40
"""Largest magnitude of l11, l21 and l22 in pixels: far beyond every frame, and its square is far from overflow."""

REMEDIES: Final = {
    "refuse": "degenerate='turn' turns the sign of a column of L, which leaves L L^T as it is, right for trainers "
    "that do not hold l11 and l22 above 0; degenerate='remove' leaves such splats out, as renderers do",
    "turn": "a zero has no sign to turn; degenerate='remove' leaves such splats out, as renderers do",
}
"""What can be done about degenerate splats, by what was chosen."""


class SplatsError(UsageError):
    """Splats of a frame that cannot be coded."""

    def __init__(self, frame: int, message: str, splat: int | None = None) -> None:
        super().__init__(frame, message, splat)
        self.frame = frame

    def __str__(self) -> str:
        frame, message, splat = self.args
        return f"frame {frame}: {message}" if splat is None else f"frame {frame}, splat {splat}: {message}"


class GivenSplats(NamedTuple):
    """The splats of one frame, all of which may be coded."""

    parameters: F4
    """(N, 8) f4 in the columns of `Splats.to_array`; l11 and l22 are at least 2^-24 pixels."""
    ids: I8
    """(N,) i8: equal numbers in successive frames are the same splat."""

    def equals(self, other: "GivenSplats | None") -> bool:
        """Whether another frame has the same splats, with the same ids."""
        return (
            other is not None
            and np.array_equal(self.parameters, other.parameters)
            and np.array_equal(self.ids, other.ids)
        )


class Limits(NamedTuple):
    """The least and the largest value of each parameter, (8,) f8 each."""

    low: F8
    high: F8

    @classmethod
    def of(cls, positions: F8, color: float) -> "Limits":
        """Limits of the least and largest x and y, (2, 2), and of the magnitude of a colour."""
        low, high = (
            np.concatenate([positions[side], [sign * LARGEST_FACTOR] * 3, [sign * color] * 3])
            for side, sign in ((0, -1), (1, 1))
        )
        return cls(low, high)

    @classmethod
    def of_paper(cls, width: int, height: int) -> "Limits":
        """Those of profile `paper`.

        A position is coded as h of fl(fl(h + 1) * half), a colour as a sum of codewords, all of which are binary16.
        """
        half = np.array([width / 2, height / 2])
        return cls.of(np.stack([(1 - LARGEST_HALF) * half, (1 + LARGEST_HALF) * half]), LARGEST_HALF)

    @classmethod
    def of_main(cls) -> "Limits":
        """Those of profile `main`: positions of states, to whole pixels."""
        most = float(X_MOST // 256 - 1)
        return cls.of(np.array([[-most, -most], [most, most]]), LARGEST_HALF)


class GivenFrames:
    """The frames that a caller gives, checked one by one."""

    def __init__(self, frames: Iterable[FrameOfSplats], limits: Limits, degenerate: Degenerate) -> None:
        if degenerate not in get_args(Degenerate):
            raise UsageError(f"degenerate is {degenerate!r}; it must be one of {', '.join(get_args(Degenerate))}")
        self._frames, self._degenerate = _iterator(frames), degenerate
        self._low, self._high = limits
        self._with_ids: bool | None = None
        self._last_ids, self._next_id = np.empty(0, np.int64), 0
        self.turned = self.removed = 0  # splats so far whose signs were turned, and that were left out

    def __iter__(self) -> Iterator[GivenSplats]:
        for number, item in enumerate(self._frames):
            given, ids = item if isinstance(item, tuple) and len(item) == 2 else (item, None)
            parameters = _parameters(given, number)
            self._check(parameters, number)
            yield self._cleaned(parameters, self._ids(ids, len(parameters), number), number)

    def _check(self, parameters: F4, number: int) -> None:
        """Refuse what is not finite or cannot be coded."""
        with np.errstate(invalid="ignore"):
            wrong = ~((parameters >= self._low) & (parameters <= self._high))
        if wrong.any():
            splat, column = (int(place) for place in np.argwhere(wrong)[0])
            low, high = self._low[column], self._high[column]
            raise SplatsError(
                number,
                f"{COLUMN_NAMES[column]} is {parameters[splat, column]}; it must be a number from {low:.9g} to "
                f"{high:.9g}",
                splat,
            )

    def _ids(self, ids: ArrayLike | None, count: int, number: int) -> I8:
        """The ids of a frame; without any, rows continue those of the frame before where it has as many."""
        if self._with_ids not in (None, ids is not None):
            raise UsageError(f"frame {number} comes {'with' if ids is not None else 'without'} ids; give all or none")
        self._with_ids = ids is not None
        if ids is not None:
            return _checked_ids(ids, count, number)
        if count != len(self._last_ids):
            self._last_ids = np.arange(self._next_id, self._next_id + count)
            self._next_id += count
        return self._last_ids

    def _cleaned(self, parameters: F4, ids: I8, number: int) -> GivenSplats:
        """The splats after degenerate ones were turned or removed."""
        bad = _degenerate(parameters)
        if bad.any() and self._degenerate == "turn":
            columns = parameters[:, [COLUMN_L11, COLUMN_L22]] < 0
            parameters = turned(parameters)
            self.turned += int(columns.any(axis=1).sum())
            bad = _degenerate(parameters)
        if bad.any() and self._degenerate != "remove":
            splat = int(np.flatnonzero(bad)[0])
            column = COLUMN_L11 if parameters[splat, COLUMN_L11] < SMALLEST_NORMAL else COLUMN_L22
            raise SplatsError(
                number,
                f"{COLUMN_NAMES[column]} is {parameters[splat, column]}; it must be at least 2^-126, or the splat "
                f"covers nothing: {REMEDIES[self._degenerate]}",
                splat,
            )
        if bad.any():
            self.removed += int(bad.sum())
            parameters, ids = parameters[~bad], ids[~bad]
        parameters = parameters.copy()  # the caller may fill the same array again
        for column in (COLUMN_L11, COLUMN_L22):
            np.maximum(parameters[:, column], SCALE_FLOOR, out=parameters[:, column])
        return GivenSplats(parameters, ids)


def turned(parameters: F4) -> F4:
    """The parameters (N, 8) f4 with the columns of L turned so that l11 and l22 are not negative; L L^T stays."""
    result = parameters.copy()
    first, second = parameters[:, COLUMN_L11] < 0, parameters[:, COLUMN_L22] < 0
    result[first, COLUMN_L11] *= -1
    result[first, COLUMN_L21] *= -1
    result[second, COLUMN_L22] *= -1
    return result


def check_level(parameters: F4, number: int, width: int, height: int, level: int) -> None:
    """Refuse a frame that no level up to this one allows, before anything is rendered."""
    limits = LEVELS[level]
    count, work = len(parameters), rendering_work(parameters, width, height)
    for what, has, most, rule in (
        ("splats", count, limits.splats, "R-5-2"),
        ("pairs of rendering work", work, limits.work, "R-5-4"),
    ):
        if has > most:
            higher = "" if level == max(LEVELS) else ", or a higher level"
            raise UsageError(
                f"frame {number} has {has} {what}; level {level} allows {most} ({rule}): give fewer{higher}"
            )


def _degenerate(parameters: F4) -> Any:
    """Whether each splat covers nothing, (N,) bool (R-9.1-2)."""
    return (parameters[:, [COLUMN_L11, COLUMN_L22]] < SMALLEST_NORMAL).any(axis=1)


def _iterator(frames: Iterable[FrameOfSplats]) -> Iterator[FrameOfSplats]:
    one_frame = isinstance(frames, Splats) or (isinstance(frames, np.ndarray) and frames.ndim < 3)
    if one_frame or isinstance(frames, str | bytes) or not hasattr(frames, "__iter__"):
        raise UsageError(
            f"the frames are one {type(frames).__name__}; give an iterable with the splats of each frame, such as a "
            f"list of arrays (N, {PARAMETERS_PER_SPLAT})"
        )
    return iter(frames)


def _parameters(given: Splats | ArrayLike, number: int) -> F4:
    try:
        return Splats.parameters_of(given)
    except UsageError as error:
        raise SplatsError(number, str(error)) from None


def _checked_ids(ids: ArrayLike, count: int, number: int) -> I8:
    array = np.asarray(ids)
    if array.shape != (count,) or array.dtype.kind not in "iu":
        raise SplatsError(
            number, f"the ids are {array.dtype} of shape {array.shape}; they must be integers, ({count},)"
        )
    numbers = array.astype(np.int64)
    if len(np.unique(numbers)) != count:
        raise SplatsError(number, "two splats have the same id; each must have one of its own")
    return numbers
