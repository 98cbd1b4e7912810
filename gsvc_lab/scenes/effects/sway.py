"""A round part of the picture moves to and fro and turns, as a head does that talks; around it nothing moves."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gsvc_base.arrays import F8
from gsvc_base.portable import cos, hypot, sin
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import WarpEffect
from gsvc_lab.scenes.parameters import number, pair, parameter


@dataclass(frozen=True)
class Sway(WarpEffect):
    """A part of the picture moves as a whole within half of its size, and less and less out to its edge.

    It goes to the side as sin(w t) and down as sin(2 w t), and turns as cos(w t), with w = 2 pi / period.
    """

    SUMMARY: ClassVar[str] = "A part of the picture moves and turns a little, as a head does that talks."

    place: tuple[float, float] = parameter(
        pair(0, 1), "its middle, as fractions of the frame's width and height", (0.5, 0.5)
    )
    width: float = parameter(number(0.01, 10), "its width, as a fraction of the frame's shorter side", 0.6)
    height: float = parameter(number(0.01, 10), "its height likewise", 0.7)
    reach: tuple[float, float] = parameter(
        pair(-1, 1), "how far it goes right and down at most, as fractions of the frame's shorter side", (0.02, 0.01)
    )
    turn: float = parameter(number(-90, 90), "by how many degrees it turns to either side", 3.0)
    period: float = parameter(number(2, 1e6), "frames to and fro", 30.0)

    def displacement(self, x: F8, y: F8, canvas: Canvas, time: float) -> tuple[F8, F8]:
        """Distances right and below of themselves at which pixels with centres (x, y) read, in pixels."""
        phase = 2 * math.pi * time / self.period
        dx, dy = x - self.place[0] * canvas.width, y - self.place[1] * canvas.height
        size = canvas.shorter / 2
        share = self._share(hypot(dx / (self.width * size), dy / (self.height * size)))
        angle = -math.radians(self.turn) * cos(phase)  # what has turned one way is read from the other
        cosine, sine = cos(angle), sin(angle)
        right = dx * cosine - dy * sine - dx - self.reach[0] * canvas.shorter * sin(phase)
        below = dx * sine + dy * cosine - dy - self.reach[1] * canvas.shorter * sin(2 * phase)
        return np.asarray(share * right), np.asarray(share * below)

    def _share(self, radius: F8) -> F8:
        """1 up to half of its size, 0 from its edge, smooth between."""
        part = np.clip(2 * (1 - radius), 0, 1)
        return np.asarray(part * part * (3 - 2 * part))


EFFECT = Sway
