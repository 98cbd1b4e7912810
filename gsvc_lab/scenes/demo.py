"""The clip of `gsvc demo`: a hand-held camera over two photographs, a ball in front, one cut."""

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.draws import Draws
from gsvc_base.errors import UsageError
from gsvc_base.portable import sin
from gsvc_lab.scenes.camera import Camera, view
from gsvc_lab.scenes.paths import gentle
from gsvc_lab.scenes.photographs import photograph
from gsvc_lab.scenes.shapes import Ball, paint_ball

DEMO_FRAME_RATE: Final = Fraction(24)
"""Frames per second."""

_FIRST_SHOT: Final = 0.55
_BALL_COLOR: Final = (0.10, 0.55, 0.80)
_SWAY: Final = 0.004


def demo_cut(frames: int) -> int:
    """The number of the first frame after the cut in a demo clip of this length; 0 for one frame: no cut."""
    return round(frames * _FIRST_SHOT) if frames > 1 else 0


def demo_clip(width: int = 192, height: int = 112, frames: int = 40, seed: int = 0) -> Iterator[NDArray[np.uint8]]:
    """Draw the demo clip: a pan and zoom over a cup of coffee, a cut to a cat, and a bouncing ball in front of both.

    Parameters
    ----------
    width, height
        Size in pixels.
    frames
        Number of frames, at 24 frames per second.
    seed
        Decides how the hand that holds the camera sways; same seed, same bytes.

    Returns
    -------
    Iterator of (height, width, 3) u1
        The frames, each drawn when asked for.

    Raises
    ------
    UsageError
        The size or the number of frames is not positive.
    """
    if width < 1 or height < 1 or frames < 1:
        raise UsageError(
            f"a demo clip of {frames} frames of {width}x{height} pixels was asked for; all must be positive"
        )
    return _draw(width, height, frames, Draws(seed))


def _draw(width: int, height: int, frames: int, rng: Draws) -> Iterator[NDArray[np.uint8]]:
    """Yield the frames of the checked clip."""
    sway_x, sway_y = _sway(frames, rng), _sway(frames, rng)
    cut = demo_cut(frames)
    shots = (("coffee", 0, cut, _over_the_coffee), ("chelsea", cut, frames, _along_the_cat))
    for name, start, end, path in shots:
        picture = photograph(name)
        for number in range(start, end):
            camera = path(gentle((number - start) / max(end - start - 1, 1)), sway_x[number], sway_y[number])
            scene = paint_ball(view(picture, camera, width, height), _ball(number, width, height))
            yield np.rint(scene * 255).astype(np.uint8)


def _over_the_coffee(progress: float, sway_x: float, sway_y: float) -> Camera:
    """The camera on its way from the table towards the cup."""
    return Camera(0.46 + 0.05 * progress + sway_x, 0.50 - 0.02 * progress + sway_y, 0.92 - 0.14 * progress)


def _along_the_cat(progress: float, sway_x: float, sway_y: float) -> Camera:
    """The camera on its way from one eye to the other, rolling a little."""
    return Camera(0.46 + 0.09 * progress + sway_x, 0.50 + sway_y, 0.80 + 0.06 * progress, -0.03 + 0.05 * progress)


def _ball(number: int, width: int, height: int) -> Ball:
    """The ball in a frame: to and fro at even speed, two seconds across, bouncing off the frame's lower edge."""
    radius = 0.09 * min(width, height)
    seconds = number / float(DEMO_FRAME_RATE)
    across = abs((seconds / 2 + 1) % 2 - 1)
    flight = (seconds / 0.8 + 0.35) % 1
    bounce = 4 * flight * (1 - flight)
    return Ball(
        x=width * (0.08 + 0.84 * across),
        y=height - radius - (0.62 * height - radius) * bounce,
        radius=radius,
        color=_BALL_COLOR,
    )


def _sway(frames: int, rng: Draws) -> list[float]:
    """The motion of the camera by a hand, per frame, as a fraction of the picture: three slow waves of random phase."""
    phases = rng.uniform(0, 2 * math.pi, 3)
    seconds = np.arange(frames) / float(DEMO_FRAME_RATE)
    slow, middle, fast = (
        sin(2 * math.pi * frequency * seconds + phase) for frequency, phase in zip((0.7, 1.3, 2.1), phases, strict=True)
    )
    return [float(value) for value in _SWAY * (0.6 * slow + 0.3 * middle + 0.1 * fast)]
