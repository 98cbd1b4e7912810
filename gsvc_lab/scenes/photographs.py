"""The photographs inside the scikit-image package: real pixels without a download."""

from typing import Final

import numpy as np

from gsvc_base.arrays import F4
from gsvc_base.errors import UsageError

PHOTOGRAPHS: Final = ("astronaut", "chelsea", "coffee")
"""RGB photographs that every scikit-image wheel holds as PNG files, so that they read the same everywhere."""


def photograph(name: str) -> F4:
    """A photograph of scikit-image as an (H, W, 3) f4 picture, 1.0 = full scale.

    Raises
    ------
    UsageError
        The name is not one of `PHOTOGRAPHS`.
    """
    if name not in PHOTOGRAPHS:
        raise UsageError(f"there is no photograph {name!r}; there are {', '.join(PHOTOGRAPHS)}")
    import skimage.data

    samples = getattr(skimage.data, name)()  # (H, W, 3) u1
    return np.asarray(samples, np.float32) / np.float32(255)
