"""What the tests of scenes share."""

import math

import numpy as np

from gsvc_lab.scenes import Scene
from gsvc_ref.video import encode_png

WAVES_SIZE = (96, 64)


def scene(base, *effects, size=(48, 32), frames=6, **rest) -> Scene:
    """A scene from tables, as they would stand in a file."""
    return Scene.from_dict(
        {"title": "A test", "size": size, "frames": frames, "base": base, "effects": effects, **rest}
    )


def waves(x, y):
    """A smooth picture of any points, in units of a 96x64 picture: (..., 3) f8."""
    grey = 0.5 + 0.2 * np.sin(2 * math.pi * x / 24) + 0.2 * np.cos(2 * math.pi * y / 16 + x / 30)
    return np.stack([grey, 1 - grey, grey**2], axis=-1)


def waves_file(folder):
    """`waves` as a PNG file of 16 bits; its name."""
    width, height = WAVES_SIZE
    x, y = np.arange(width)[None, :] + 0.5, np.arange(height)[:, None] + 0.5
    picture = np.rint(waves(*np.broadcast_arrays(x, y)) * 65535).astype(np.uint16)
    (folder / "waves.png").write_bytes(encode_png(picture, 16))
    return "waves.png"
