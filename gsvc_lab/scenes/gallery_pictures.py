"""Pictures of the gallery: which frames to show, and ground truth to look at."""

import colorsys
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F8, U1

_CELL: Final = 4  # pixels in which two frames are compared
_MISSED: Final = 1.5  # times the usual difference of two neighbours
_NOTICED: Final = 3.0  # of 255
_UNKNOWN: Final = np.array([150, 150, 150])
_NEW: Final = np.array([30, 30, 34])
_OUTLINE: Final = np.array([20, 20, 20])
_HUES: Final = 360
_STILL: Final = 1e-6  # pixels; what is less is rounding


def telling_frames(clip: Sequence[U1], count: int) -> list[int]:
    """The numbers of frames to show: evenly spaced, but for one that they would miss, such as a flash.

    `clip`: (H, W, 3) u1 frames. `count`: number of frames to choose, at least 3; of a shorter clip all.
    """
    small = [_shrunk(frame) for frame in clip]
    chosen = sorted({round(number) for number in np.linspace(0, len(clip) - 1, count)})
    distance = np.min([_differences(small, number) for number in chosen], axis=0)
    usual = np.median([_differences(small, before)[after] for before, after in pairwise(chosen)] or [np.inf])
    missed = int(np.argmax(distance))
    if distance[missed] > _MISSED * usual + _NOTICED:
        chosen.remove(min(chosen[1:-1], key=lambda number: abs(number - missed)))
        chosen = sorted([*chosen, missed])
    return chosen


def changing_frames(clip: Sequence[U1], count: int) -> list[int]:
    """The numbers of the frames that differ most from the one before; frame 0 where there is no other."""
    small = [_shrunk(frame) for frame in clip]
    changes = [float(np.abs(after - before).mean()) for before, after in pairwise(small)]
    return sorted(range(1, len(clip)), key=lambda number: -changes[number - 1])[:count] or [0]


def _shrunk(frame: U1) -> F8:
    height, width = (size - size % _CELL for size in frame.shape[:2])
    cells = frame[:height, :width].reshape(height // _CELL, _CELL, width // _CELL, _CELL, 3)
    return np.asarray(cells.mean(axis=(1, 3), dtype=np.float64))


def _differences(small: Sequence[F8], number: int) -> F8:
    return np.array([np.abs(frame - small[number]).mean() for frame in small])


def truth_picture(known: dict[str, Any]) -> U1:
    """The motion and the outlines of objects of one frame as an (H, W, 3) u1 picture.

    The hue is the direction of the motion, its strength the speed, full at the fastest of the frame; white stands
    still. What was not to be seen before is nearly black, and grey what has no known motion.

    `known`: ground truth of a frame, as `gsvc_lab.scenes.ground_truth` gives it.
    """
    right, below = np.asarray(known["motion"], np.float64)
    known_motion = np.isfinite(right) & np.isfinite(below)
    right, below = np.where(known_motion, right, 0), np.where(known_motion, below, 0)
    speed = np.hypot(right, below)
    strength = speed / max(float(speed.max()), 1e-9)
    wheel = np.array([colorsys.hsv_to_rgb(hue / _HUES, 0.85, 0.95) for hue in range(_HUES)]) * 255
    hue = np.rint(np.degrees(np.arctan2(below, right))).astype(np.int64) % _HUES
    picture = 255 * (1 - strength[..., None]) + wheel[hue] * strength[..., None]  # (H, W, 3) f8
    picture[~known_motion] = _UNKNOWN
    picture[~known["visible_before"]] = _NEW
    for key, seen in known.items():
        if key.endswith(".seen"):
            picture[_edge(np.asarray(seen) >= 0.5)] = _OUTLINE
    return np.rint(picture).astype(np.uint8)


def motion_wheel(size: int) -> U1:
    """All directions and speeds as `truth_picture` colours them, from the middle outwards, (size, size, 3) u1."""
    x, y = (np.mgrid[0:size, 0:size][::-1] + 0.5) * (2 / size) - 1
    inside = np.hypot(x, y) <= 1
    return truth_picture({"motion": np.stack([x, y]) * inside, "visible_before": np.ones_like(inside)})


def shows_something(known: dict[str, Any]) -> bool:
    """Whether the motion and the objects of a frame make a picture worth looking at."""
    return bool((~(np.abs(known["motion"]) <= _STILL)).any()) or any(key.endswith(".seen") for key in known)


def _edge(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The pixels inside with one outside to the left, right, above or below."""
    padded = np.pad(inside, 1, mode="edge")
    around = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return np.asarray(inside & ~around)
