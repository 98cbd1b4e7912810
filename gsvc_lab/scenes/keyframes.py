"""Values over time: given at some frames, moved between them; and when something is to be seen."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Final

from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.parameters import MAX_FRAMES, ParameterError, Rule, number, pair, several
from gsvc_lab.scenes.paths import begun, frame_at, gentle

MAX_KEYS: Final = 1000
"""Interpolation of a list of values over time."""


def is_shown(start: int, end: int | None, time: float) -> bool:
    """Whether a moment belongs to the frames `start` to `end` - 1; None for no end."""
    return begun(time, start) and (end is None or not begun(time, end))


def places() -> Rule:
    """Places of something that may also be outside the frame."""
    return several(pair(-10, 10), 1, MAX_KEYS)


def values(low: float, high: float) -> Rule:
    """Values of something that changes over time."""
    return several(number(low, high), 1, MAX_KEYS)


def frames() -> Rule:
    """At which values hold; they may lie before the clip or after it."""
    return several(number(-MAX_FRAMES, MAX_FRAMES), 0, MAX_KEYS)


def check_keys(at: Sequence[float], **values: Sequence[Any]) -> None:
    """Refuse values over time that don't fit together.

    `at`: frames of the values; empty for evenly spaced ones over the clip. `**values`: each has one value for all
    frames or one for each of `at`. A ParameterError says that the frames don't grow, or a number of values is wrong.
    """
    if any(after <= before for before, after in pairwise(at)):
        raise ParameterError("at", f"is {list(at)}; each frame must be greater than the one before")
    count = len(at) or max(len(keys) for keys in values.values())
    for key, keys in values.items():
        if len(keys) not in {1, count}:
            others = f"one for each of the {count} frames of `at`" if at else f"{count}, as the longest list has"
            raise ParameterError(key, f"has {len(keys)} values; it must have one for all frames, or {others}")


def key_before(
    at: Sequence[float], count: int, canvas: Canvas, time: float, pace: str, repeat: bool = False
) -> tuple[int, float]:
    """The one of `count` keys that a moment follows, and the part of the way to the next, 0 to 1.

    `at`: frames of the keys; empty for evenly spaced ones from the clip's first frame to its last. `count`: number of
    keys. `canvas`: the clip. `time`: the moment in frames. `pace`: ``jump`` stays at a key until the frame of the next,
    ``gentle`` is slow at both ends, all others are even. `repeat`: whether all starts again where the last key would
    be.
    """
    if count == 1:
        return 0, 0.0
    times = at or [index * max(canvas.frames - 1, 1) / (count - 1) for index in range(count)]
    if pace == "jump":  # which an open shutter must not see both sides of
        time = frame_at(time)
    if repeat and times[-1] > times[0]:
        time = times[0] + (time - times[0]) % (times[-1] - times[0])
    if pace == "jump":
        return max(sum(frame_at(key) <= time for key in times) - 1, 0), 0.0
    if time >= times[-1]:
        return count - 1, 0.0
    index = max(sum(key <= time for key in times) - 1, 0)
    part = max(time - times[index], 0) / (times[index + 1] - times[index])
    return index, gentle(part) if pace == "gentle" else part


def value_at(values: Sequence[float], index: int, part: float) -> float:
    """The value a part of the way from a key to the next; the only one where there is one for all."""
    if len(values) == 1:
        return values[0]
    return values[index] if part == 0 else (1 - part) * values[index] + part * values[index + 1]
