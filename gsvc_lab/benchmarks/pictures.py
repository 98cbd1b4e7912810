"""Pictures to measure on: photographs of scikit-image, native mosaics of them, and a next frame of each."""

from typing import Final

import numpy as np
import skimage.data

from gsvc_base.arrays import F4
from gsvc_lab.scenes.camera import Camera, view

SIZES: Final = {"176x144": (176, 144, 1000), "352x288": (352, 288, 2000), "1920x1080": (1920, 1080, 10_000)}
"""Width, height and N."""

PHOTOGRAPHS: Final = ("astronaut", "chelsea", "coffee", "rocket", "motorcycle", "retina")
"""Photographs inside every scikit-image wheel, and the pieces of the pictures of 1920x1080."""

PIECE: Final = (320, 270)
"""Width and height of a piece: 6 x 4 of them at native resolution make a picture of 1920x1080."""

PAN: Final = (1.3, -0.6)
"""Motion of the camera from the first frame to the next, in pixels."""

ROLL: Final = 0.002
"""Rotation between the two frames, in radians about the middle."""

NOISE: Final = 1 / 255
"""Standard deviation of the sensor's noise, drawn anew for each frame."""


def pictures(size: str, name: str) -> tuple[F4, F4]:
    """A picture and the next one, (H, W, 3) f4 each, rounded to 8 bits."""
    width, height, _ = SIZES[size]
    rng = np.random.default_rng([PHOTOGRAPHS.index(name), width])
    source = mosaic(rng) if size == "1920x1080" else read(name)
    tall, wide = source.shape[:2]
    # 24 pixels of margin for the motion; mosaics are never scaled.
    span = 1 - 24 / wide if size != "1920x1080" else 1 / min(wide / width, tall / height)
    step = span * min(wide / width, tall / height)
    shift = (PAN[0] * step / wide / 2, PAN[1] * step / tall / 2)
    frames = []
    for side in (-1, 1):
        seen = view(source, Camera(0.5 + side * shift[0], 0.5 + side * shift[1], span, side * ROLL / 2), width, height)
        noisy = seen + rng.normal(0, NOISE, seen.shape)
        frames.append((np.clip(np.rint(noisy * 255), 0, 255) / 255).astype(np.float32))
    return frames[0], frames[1]


def read(name: str) -> F4:
    """A photograph (H, W, 3) f4."""
    samples = getattr(skimage.data, "stereo_motorcycle" if name == "motorcycle" else name)()
    samples = samples[0] if name == "motorcycle" else samples
    return np.asarray(samples, np.float32) / np.float32(255)


def mosaic(rng: np.random.Generator) -> F4:
    """Pieces of all photographs at native resolution, 7 x 5 of them, cut to 1944x1104: room for the motion."""
    photographs = [read(name) for name in PHOTOGRAPHS]
    wide, tall = PIECE

    def piece() -> F4:
        source = photographs[rng.integers(len(photographs))]
        y, x = (rng.integers(side - part + 1) for side, part in zip(source.shape[:2], (tall, wide), strict=True))
        return source[y : y + tall, x : x + wide]

    rows = [np.concatenate([piece() for _ in range(7)], axis=1) for _ in range(5)]
    return np.concatenate(rows)[:1104, :1944]
