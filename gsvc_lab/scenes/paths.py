"""Beginning and end of effects, and the course of gradual changes between them."""

import math
from typing import Final

from gsvc_base.portable import cos
from gsvc_lab.scenes.parameters import ParameterError

PACES: Final = ("even", "gentle")


def frame_at(time: float) -> int:
    """The frame that a moment belongs to: the nearest one, of two the later."""
    return math.floor(time + 0.5)


def begun(time: float, start: int) -> bool:
    """Whether a moment belongs to frame `start` or a later one."""
    return frame_at(time) >= start


def gentle(share: float) -> float:
    """The progress of a motion that is slow at both ends, by a cosine, from 0 at 0 to 1 at 1."""
    return float(0.5 - 0.5 * cos(math.pi * share))


def progress(time: float, start: int, end: int | None, frames: int, pace: str = "even") -> float:
    """The part of a change that is done: 0 up to frame `start`, 1 from frame `end` on (None: the last of the clip).

    `time`: time in frames. `start` and `end`: numbers of frames. `frames`: number of frames of the clip. `pace`: one of
    `PACES`.
    """
    last = max(frames - 1, start + 1) if end is None else end
    share = min(max((time - start) / (last - start), 0.0), 1.0)
    return gentle(share) if pace == "gentle" else share


def check_order(start: int, end: int | None) -> None:
    """Refuse an end that is not after the start.

    A ParameterError says that it says both.
    """
    if end is not None and end <= start:
        raise ParameterError("end", f"is {end}; it must be after start, which is {start}")
