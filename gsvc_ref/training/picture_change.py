"""What changes of splats do to the picture, to second order and for each splat alone."""

import math

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8

Active = NDArray[np.bool_]
"""(n, 3) bool: whether position, Cholesky factor and colour of a splat may differ from the reference."""


def picture_change(values: F4, reference: F4) -> F4:
    """What changes from `reference` to `values` do to the picture, (n, 3) f4: by position, Cholesky factor, colour.

    That is a sum of squared differences over all pixels, to second order and for one splat alone: with A = pi l11 l22
    (the sum of g^2), the change (du, dv) = L^-1 dmu and the relative changes p = dl11/l11, q = dl22/l22,
    s = (dl21 - l21 p)/l22, it is |c'|^2 A (du^2 + dv^2) / 2 for the position;
    |c'|^2 A (3 p^2 + 3 q^2 + 2 p q + s^2) / 4 for the Cholesky factor; |dc'|^2 A for the colour.
    """
    difference = values - reference
    l11, l21, l22 = values[:, 2], values[:, 3], values[:, 4]
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):  # of needles, whose effects are not finite
        area = math.pi * l11 * l22
        seen = np.square(values[:, 5:8]).sum(axis=1) * area
        du = difference[:, 0] / l11
        dv = (difference[:, 1] - l21 * du) / l22
        p, q = difference[:, 2] / l11, difference[:, 4] / l22
        s = (difference[:, 3] - l21 * p) / l22
        shape = (3 * p * p + 3 * q * q + 2 * p * q + s * s) / 4
        color = np.square(difference[:, 5:8]).sum(axis=1) * area
        return np.stack([seen * (du * du + dv * dv) / 2, seen * shape, color], axis=1)


def shape_weights(values: F4) -> F8:
    """What the square of an error of each Cholesky factor counts in `picture_change`, over pi / 4, (n, 3) f8."""
    l11, l21, l22 = values[:, 2:5].astype(np.float64).T
    seen = np.square(values[:, 5:8].astype(np.float64)).sum(axis=1) * (l11 * l22)
    slant = (l21 / l22) * (l21 / l22)
    weights = seen[:, None] * np.stack([(3 + slant) / (l11 * l11), 1 / (l22 * l22), 3 / (l22 * l22)], axis=1)
    return np.asarray(weights, np.float64)
