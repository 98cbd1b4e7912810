"""The base picture of a scene, before any effect: a colour, a gradient, a texture, a photograph or a picture file."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4
from gsvc_base.errors import GsvcError
from gsvc_base.portable import cos, sin, total
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.parameters import (
    Checked,
    ParameterError,
    choice,
    color,
    number,
    parameter,
    parameters,
    table,
    text,
)
from gsvc_lab.scenes.photographs import PHOTOGRAPHS, photograph
from gsvc_lab.scenes.sampling import smoothed
from gsvc_lab.scenes.seeds import generator

Color = tuple[float, float, float]

MAX_IMAGE_PIXELS: Final = 2**25
"""Maximum number of pixels of a picture file: 8192 x 4096."""


@dataclass(frozen=True)
class Gradient(Checked):
    """An even change from one colour to another across the frame."""

    from_: Color = parameter(color(), "the colour where it begins")
    to: Color = parameter(color(), "the colour where it ends")
    angle: float = parameter(number(-360, 360), "its direction in degrees: 0 to the right, 90 down", 0.0)

    def picture(self, canvas: Canvas, seed: int) -> F4:
        """Its picture of the frame's size, (H, W, 3) f4; the two colours stand in the outermost corners or edges."""
        cosine, sine = cos(math.radians(self.angle)), sin(math.radians(self.angle))
        x, y = canvas.centres()
        length = canvas.width * abs(cosine) + canvas.height * abs(sine)
        share = ((x - canvas.width / 2) * cosine + (y - canvas.height / 2) * sine) / length + 0.5  # (H, W) f8
        return _mix(self.from_, self.to, share)


@dataclass(frozen=True)
class Checker(Checked):
    """A board of squares in two colours, with antialiased edges."""

    size: float = parameter(number(0.001, 1), "the side of a square as a fraction of the frame's shorter side", 0.1)
    first: Color = parameter(color(), "the colour of the square in the middle", (0.9, 0.9, 0.9))
    second: Color = parameter(color(), "the colour of its neighbours", (0.1, 0.1, 0.1))

    def picture(self, canvas: Canvas, seed: int) -> F4:
        """Its picture of the frame's size, (H, W, 3) f4."""
        side = max(self.size * canvas.shorter, 1.0)
        x, y = canvas.centres()
        across, down = _stripes((x - canvas.width / 2) / side, side), _stripes((y - canvas.height / 2) / side, side)
        return _mix(self.second, self.first, 0.5 + 0.5 * across * down)


@dataclass(frozen=True)
class Noise(Checked):
    """A random texture without any form in it; the scene's seed decides which."""

    size: float = parameter(number(0, 1), "the size of its blobs as a fraction of the frame's shorter side", 0.02)
    mean: Color = parameter(color(), "its mean colour", (0.5, 0.5, 0.5))
    contrast: float = parameter(number(0, 1), "the standard deviation of its samples", 0.15)

    def picture(self, canvas: Canvas, seed: int) -> F4:
        """Its picture of the frame's size, (H, W, 3) f4; the channels are independent."""
        samples = generator(seed, "base noise").standard_normal((canvas.height, canvas.width, 3))
        sigma = 0.5 * self.size * canvas.shorter
        if sigma > 0:
            samples = smoothed(samples, sigma)
            off = samples - total(samples) / samples.size
            samples /= max(math.sqrt(total(off * off) / samples.size), 1e-12)
        return np.asarray(np.clip(np.array(self.mean) + self.contrast * samples, 0, 1), np.float32)


@dataclass(frozen=True)
class Base(Checked):
    """The base picture of a scene, before any effect: exactly one of these."""

    color: Color | None = parameter(color(), "one colour everywhere", None)
    gradient: Gradient | None = parameter(table(Gradient), "an even change of colour", None)
    checker: Checker | None = parameter(table(Checker), "a board of squares", None)
    noise: Noise | None = parameter(table(Noise), "a random texture", None)
    photograph: str | None = parameter(choice(*PHOTOGRAPHS), "a photograph of the scikit-image package", None)
    image: str | None = parameter(text(4096), "a PNG or JPEG file, its path relative to the scene's file", None)

    def __post_init__(self) -> None:
        super().__post_init__()
        names = [item.name for item in parameters(Base)]
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            found = f"has {' and '.join(given)}" if given else "is empty"
            raise ParameterError("", f"{found}; it must have exactly one of {', '.join(names)}")

    @property
    def name(self) -> str:
        """Its name for people, in one word or two."""
        if self.color is not None:
            return "colour"
        return (
            self.photograph
            or self.image
            or next(item.name for item in parameters(Base) if getattr(self, item.name) is not None)
        )

    def path(self, folder: Path | None) -> Path | None:
        """The file of an `image`, else None; a relative path begins in `folder`, None for the current one."""
        return None if self.image is None else (folder or Path()) / self.image

    def picture(self, canvas: Canvas, seed: int, folder: Path | None = None) -> F4:
        """Draw or read it.

        Parameters
        ----------
        canvas
            A texture is drawn in the size of its frames.
        seed
            Seed of the scene.
        folder
            Folder in which relative paths begin.

        Returns
        -------
        (H, W, 3) f4, 1.0 = full scale; H and W are the frame's only for textures.

        Raises
        ------
        GsvcError
            The image cannot be read, or is too large.
        """
        if self.color is not None:
            return np.broadcast_to(np.array(self.color, np.float32), (canvas.height, canvas.width, 3)).copy()
        if self.photograph is not None:
            return photograph(self.photograph)
        if (path := self.path(folder)) is not None:
            return _read_image(path)
        texture = self.gradient or self.checker or self.noise
        assert texture is not None
        return texture.picture(canvas, seed)


def _read_image(path: Path) -> F4:
    from gsvc_ref.video.images import read_image

    image = read_image(path, str(path))
    height, width, _ = image.frame.shape
    if height * width > MAX_IMAGE_PIXELS:
        raise GsvcError(
            "limit", f"{path} has {width}x{height} pixels; a scene takes at most {MAX_IMAGE_PIXELS:,}: scale it down"
        )
    return np.asarray(image.frame, np.float32) / np.float32(2**image.bit_depth - 1)


def _mix(first: Color, second: Color, share: NDArray[np.float64]) -> F4:
    part = share[..., None]
    return np.asarray((1 - part) * np.array(first) + part * np.array(second), np.float32)


def _stripes(place: NDArray[np.float64], side: float) -> NDArray[np.float64]:
    """1 in the stripe around 0, -1 in its neighbours and so on; the mean over a pixel, which is 1/side wide."""

    def integral(at: NDArray[np.float64]) -> NDArray[np.float64]:
        """The integral of a wave of period 2 that is 1 for -1/2..1/2 and -1 for 1/2..3/2."""
        phase = (at + 0.5) % 2
        return np.where(phase < 1, phase, 2 - phase)

    half = 0.5 / side
    return (integral(place + half) - integral(place - half)) / (2 * half)
