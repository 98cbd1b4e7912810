"""A virtual camera over a picture: pan, zoom and roll by fractions of a pixel, without aliasing."""

import math
from dataclasses import dataclass

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.errors import UsageError
from gsvc_base.portable import cos, sin
from gsvc_lab.scenes.canvas import centres
from gsvc_lab.scenes.sampling import read_at, read_grid, smoothed, spline_coefficients


@dataclass(frozen=True)
class Camera:
    """The part of the picture that fills the frame.

    Attributes
    ----------
    x, y
        The point of the picture in the middle of the frame, as fractions of the picture's width and height.
    span
        Size of the part seen, as a fraction of the largest upright part with the frame's aspect ratio; positive.
    roll
        Rotation of the camera in radians, clockwise as seen.
    """

    x: float
    y: float
    span: float
    roll: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.x) and math.isfinite(self.y) and math.isfinite(self.roll)):
            raise UsageError(f"the camera stands at ({self.x}, {self.y}) with roll {self.roll}; all must be finite")
        if not (math.isfinite(self.span) and self.span > 0):
            raise UsageError(f"the camera's span is {self.span}; it must be positive, 1 for the largest part that fits")


@dataclass(frozen=True)
class Sizes:
    """The sizes of a picture and of the frame that shows a part of it, in pixels."""

    picture_width: int
    picture_height: int
    width: int
    height: int

    def step(self, camera: Camera) -> float:
        """Picture pixels per frame pixel."""
        return camera.span * min(self.picture_width / self.width, self.picture_height / self.height)

    def to_picture(self, camera: Camera, x: F8, y: F8) -> tuple[F8, F8]:
        """The points of the picture that the camera shows at points (x, y) of the frame, all in pixels.

        (0.5, 0.5) is the centre of the first pixel, of the frame as of the picture.
        """
        step = self.step(camera)
        across, down = (x - self.width / 2) * step, (y - self.height / 2) * step
        cosine, sine = cos(camera.roll), sin(camera.roll)
        return (
            camera.x * self.picture_width + across * cosine - down * sine,
            camera.y * self.picture_height + across * sine + down * cosine,
        )

    def to_frame(self, camera: Camera, x: F8, y: F8) -> tuple[F8, F8]:
        """The points of the frame that show points (x, y) of the picture: the inverse of `to_picture`."""
        step = self.step(camera)
        across, down = (x - camera.x * self.picture_width) / step, (y - camera.y * self.picture_height) / step
        cosine, sine = cos(camera.roll), sin(camera.roll)
        return self.width / 2 + across * cosine + down * sine, self.height / 2 - across * sine + down * cosine


class View:
    """A picture to look at again and again: what depends on the span alone is computed once while it stays the same.

    `picture`: (H, W, 3) f4, 1.0 = full scale. `width` and `height`: size of the frame in pixels. A UsageError says that
    the frame has no pixels.
    """

    def __init__(self, picture: F4, width: int, height: int) -> None:
        if width < 1 or height < 1:
            raise UsageError(f"the frame is {width}x{height}; it must have at least one pixel")
        self._picture = picture
        self.sizes = Sizes(picture.shape[1], picture.shape[0], width, height)
        self._step = math.nan  # that of the coefficients
        self._coefficients: F8 = np.zeros((0, 0, 3))
        self._seen: tuple[Camera, F4] | None = None

    def see(self, camera: Camera, displacement: tuple[F8, F8] | None = None) -> F4:
        """The view of the camera, a (height, width, 3) f4 picture; beyond the picture's edges its mirror image.

        The picture is low-passed to the frame's resolution by a Gaussian, then read with cubic splines. The same array
        again for the same camera, so it must not be changed.

        `camera`: place of the camera. `displacement`: distances right and below of itself at which each pixel reads, in
        frame pixels, (height, width) f8 each.
        """
        if displacement is None and self._seen is not None and self._seen[0] == camera:
            return self._seen[1]
        self._prepare(self.sizes.step(camera))
        seen: F4 = np.clip(self._read(camera, displacement), 0, 1)
        seen.flags.writeable = False
        if displacement is None:
            self._seen = camera, seen
        return seen

    def _read(self, camera: Camera, displacement: tuple[F8, F8] | None) -> F4:
        """The splines' values where the pixels read."""
        x, y = centres(self.sizes.width, self.sizes.height)
        if displacement is not None:
            x, y = x + displacement[0], y + displacement[1]
        columns, rows = self.sizes.to_picture(camera, x, y)
        if displacement is None and camera.roll == 0:  # each row of pixels reads along a row: many times as fast
            return read_grid(self._coefficients, rows[:, 0] - 0.5, columns[0] - 0.5).astype(np.float32)
        return read_at(self._coefficients, rows - 0.5, columns - 0.5).astype(np.float32)

    def _prepare(self, step: float) -> None:
        """Low-pass the picture for a step, and find the coefficients of its splines."""
        if step == self._step:
            return
        # A pixel of the frame gathers light like a Gaussian of half its pitch; the picture's own pixel is part of that.
        blur = 0.5 * math.sqrt(max(step * step - 1, 0))
        self._coefficients = spline_coefficients(smoothed(self._picture, blur) if blur > 0 else self._picture)
        self._step = step


def view(picture: F4, camera: Camera, width: int, height: int) -> F4:
    """The view of the camera over a picture, once; see `View`."""
    return View(picture, width, height).see(camera)
