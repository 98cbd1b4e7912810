"""The scene seen through moving water: travelling waves that bend the light and shade it."""

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar, Self

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.draws import Draws
from gsvc_base.portable import cos, power, sin
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import WarpEffect
from gsvc_lab.scenes.parameters import number, parameter, whole

_LONGEST = 1.6  # times the mean wavelength; the shortest is as many times shorter


@dataclass(frozen=True)
class Wave:
    """One travelling wave of the surface: height * sin(kx x + ky y - omega t + phase)."""

    kx: float  # radians per pixel
    ky: float
    omega: float  # radians per frame
    phase: float
    height: float  # pixels


@dataclass(frozen=True)
class Water(WarpEffect):
    """A sum of waves whose slope displaces what each pixel reads; longer waves are higher and faster, as at sea.

    The displacement is (dh/dx, dh/dy) of the sum h of the waves, scaled so that its root mean square is `strength`.
    """

    SUMMARY: ClassVar[str] = "Waves travel over the scene and bend it: everything moves, nowhere alike, all the time."

    strength: float = parameter(
        number(0, 0.2), "root mean square of the displacement, as a fraction of the frame's shorter side", 0.008
    )
    wavelength: float = parameter(number(0.01, 10), "mean, as a fraction of the frame's shorter side", 0.22)
    period: float = parameter(number(2, 1e5), "frames until a wave of that length has passed by", 30.0)
    waves: int = parameter(whole(1, 100), "how many there are, of lengths around the mean", 7)
    direction: float = parameter(number(-360, 360), "in degrees, where they go: 0 to the right, 90 down", 70.0)
    spread: float = parameter(number(0, 180), "by how many degrees they go to either side of it", 60.0)
    shading: float = parameter(number(0, 2), "how much their slopes change the brightness; 0 not at all", 0.12)
    shore: float = parameter(number(0, 1), "where the water begins, as a fraction of the height from the top", 0.0)
    _waves: tuple[Wave, ...] = field(default=(), init=False, repr=False)

    def prepare(self, canvas: Canvas, rng: Callable[[], Draws]) -> Self:
        """The effect with its waves drawn: directions, lengths and phases."""
        draw = rng()
        middle, spread = math.radians(self.direction), math.radians(self.spread)
        waves = []
        for _ in range(self.waves):
            angle = middle + spread * draw.uniform(-1, 1)
            longer = power(_LONGEST, draw.uniform(-1, 1))
            k = 2 * math.pi / (self.wavelength * longer * canvas.shorter)
            # In deep water the square of the frequency goes with the wave number.
            omega = 2 * math.pi / (self.period * math.sqrt(longer))
            waves.append(Wave(k * cos(angle), k * sin(angle), omega, draw.uniform(0, 2 * math.pi), longer))
        square = sum(0.5 * wave.height * wave.height * (wave.kx * wave.kx + wave.ky * wave.ky) for wave in waves)
        scale = self.strength * canvas.shorter / math.sqrt(square)
        drawn = copy.copy(self)
        scaled = (Wave(wave.kx, wave.ky, wave.omega, wave.phase, scale * wave.height) for wave in waves)
        object.__setattr__(drawn, "_waves", tuple(scaled))
        return drawn

    def displacement(self, x: F8, y: F8, canvas: Canvas, time: float) -> tuple[F8, F8]:
        """Distances right and below of themselves at which pixels with centres (x, y) read, in pixels."""
        right = np.zeros(np.broadcast_shapes(x.shape, y.shape))
        below = np.zeros_like(right)
        for wave in self._waves:
            # cos(across + down), a product of rows and columns where x and y are such.
            across, down = wave.kx * x, wave.ky * y - wave.omega * time + wave.phase
            slope = wave.height * (cos(across) * cos(down) - sin(across) * sin(down))
            right += wave.kx * slope
            below += wave.ky * slope
        depth = self._depth(y, canvas)
        return right * depth, below * depth

    def shade(self, picture: F4, canvas: Canvas, time: float) -> F4:
        """The picture, brighter on one side of the waves and darker on the other."""
        if self.shading == 0 or self.strength == 0:
            return picture
        right, below = self.displacement(*canvas.centres(), canvas, time)
        slope = (right + below) / (math.sqrt(2) * self.strength * canvas.shorter)
        return np.asarray(np.clip(picture * (1 + self.shading * slope[..., None]), 0, 1), np.float32)

    def _depth(self, y: F8, canvas: Canvas) -> F8:
        """0 above the shore, 1 well below it, smooth between."""
        if self.shore == 0:
            return np.ones_like(y)
        part = np.clip((y / canvas.height - self.shore) / 0.15, 0, 1)
        return np.asarray(part * part * (3 - 2 * part))


EFFECT = Water
