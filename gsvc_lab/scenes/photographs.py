"""The photographs inside the scikit-image package: real pixels without a download."""

import numpy as np
import skimage.data
from numpy.typing import NDArray

from gsvc_lab.scenes.base import PHOTOGRAPHS
from gsvc_ref.errors import UsageError

F4 = NDArray[np.float32]


def photograph(name: str) -> F4:
    """A photograph of scikit-image as an (H, W, 3) f4 picture, 1.0 = full scale.

    Raises
    ------
    UsageError
        The name is not one of `PHOTOGRAPHS`.
    """
    if name not in PHOTOGRAPHS:
        raise UsageError(f"there is no photograph {name!r}; there are {', '.join(PHOTOGRAPHS)}")
    samples = getattr(skimage.data, name)()  # (H, W, 3) u1
    return np.asarray(samples, np.float32) / np.float32(255)
