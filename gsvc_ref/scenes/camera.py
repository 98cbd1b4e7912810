"""A virtual camera over a picture: pan, zoom and roll by fractions of a pixel, without aliasing."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from gsvc_ref.errors import UsageError

F4 = NDArray[np.float32]


@dataclass(frozen=True)
class Camera:
    """What part of the picture fills the frame.

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


def view(picture: F4, camera: Camera, width: int, height: int) -> F4:
    """What the camera sees, as a (height, width, 3) f4 picture; beyond the picture's edges its mirror image.

    The picture is low-passed to the frame's resolution by a Gaussian, then read with cubic splines.

    Parameters
    ----------
    picture
        (H, W, 3) f4, 1.0 = full scale.
    camera
        Where the camera stands.
    width, height
        Size of the frame in pixels.

    Raises
    ------
    UsageError
        The frame has no pixels.
    """
    if width < 1 or height < 1:
        raise UsageError(f"the frame is {width}x{height}; it must have at least one pixel")
    picture_height, picture_width = picture.shape[:2]
    step = camera.span * min(picture_width / width, picture_height / height)  # picture pixels per frame pixel
    # A pixel of the frame gathers light like a Gaussian of half its pitch; the picture's own pixel is part of that.
    blur = 0.5 * math.sqrt(max(step**2 - 1, 0))
    smooth = gaussian_filter(picture, (blur, blur, 0), mode="reflect") if blur > 0 else picture
    across = (np.arange(width) - (width - 1) / 2) * step  # (W,) f8
    down = ((np.arange(height) - (height - 1) / 2) * step)[:, None]  # (H, 1) f8
    cosine, sine = math.cos(camera.roll), math.sin(camera.roll)
    rows = camera.y * picture_height - 0.5 + across * sine + down * cosine  # (H, W) f8
    columns = camera.x * picture_width - 0.5 + across * cosine - down * sine  # (H, W) f8
    channels = [
        map_coordinates(smooth[..., channel], (rows, columns), order=3, mode="reflect", output=np.float32)
        for channel in range(3)
    ]
    return np.asarray(np.clip(np.stack(channels, axis=-1), 0, 1), np.float32)
