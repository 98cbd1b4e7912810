"""A ball that moves in front of a scene, with an antialiased edge."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8
from gsvc_base.portable import hypot

Color = tuple[float, float, float]


@dataclass(frozen=True)
class Ball:
    """A ball lit from the upper left.

    Attributes
    ----------
    x, y
        Its centre in pixels; (0.5, 0.5) is the centre of the first pixel.
    radius
        Radius in pixels.
    color
        (R, G, B) of its lit side, 1.0 = full scale.
    """

    x: float
    y: float
    radius: float
    color: Color


_LIGHT = np.array([-0.5, -0.6, 0.62]) / math.sqrt(0.25 + 0.36 + 0.62 * 0.62)


def paint_ball(picture: F4, ball: Ball) -> F4:
    """The (H, W, 3) f4 picture with the ball in front, as a new array.

    The edge falls off over one pixel: at each pixel the ball's part is the clipped signed distance to its outline.
    """
    height, width = picture.shape[:2]
    dx = (np.arange(width) + 0.5 - ball.x) / ball.radius  # (W,) f8
    dy = ((np.arange(height) + 0.5 - ball.y) / ball.radius)[:, None]  # (H, 1) f8
    part = np.clip((1 - hypot(dx, dy)) * ball.radius + 0.5, 0, 1)[..., None]  # (H, W, 1) f8
    return np.asarray(picture * (1 - part) + ball_colors(dx, dy, ball.color) * part, np.float32)


def ball_colors(dx: NDArray[np.floating[Any]], dy: NDArray[np.floating[Any]], color: Color) -> F8:
    """The (H, W, 3) f8 colours of a ball lit from the upper left, by places relative to its centre, in radii.

    Beyond its outline it has the colours of the nearest point of the outline.
    """
    distance = hypot(dx, dy)  # (H, W) f8, in radii
    inside = np.minimum(distance, 1)
    scale = np.divide(inside, distance, out=np.ones_like(distance), where=distance > 0)
    out = np.sqrt(1 - inside * inside)
    facing = dx * scale * _LIGHT[0] + dy * scale * _LIGHT[1] + out * _LIGHT[2]  # normal . light
    diffuse = 0.30 + 0.70 * np.maximum(facing, 0)
    lit = np.maximum(facing, 0)
    sixth = lit * lit * lit * (lit * lit * lit)
    highlight = 0.55 * (sixth * sixth * (sixth * sixth))  # times lit^24
    shaded = diffuse[..., None] * np.asarray(color) + highlight[..., None]  # (H, W, 3) f8
    return np.asarray(np.minimum(shaded, 1))
