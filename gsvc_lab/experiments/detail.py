"""The detail of a picture by place, which the places of splats are compared with."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter

from gsvc_base.arrays import F4, F8

BINS: Final = 10
"""Equal parts of the frame, from the least detailed pixels to the most detailed."""


def detail(picture: F4, scale: float) -> F8:
    """The detail around each pixel, (H, W) f8: root mean square of the gradient under a Gaussian of `scale` pixels.

    `picture`: (H, W, 3) f4; the squared gradient is summed over the channels. `scale`: standard deviation in pixels.
    """
    down, across = np.gradient(np.asarray(picture, np.float64), axis=(0, 1))
    return np.asarray(np.sqrt(gaussian_filter((down**2 + across**2).sum(axis=2), scale)))


def spacing(width: int, height: int, count: int) -> float:
    """The mean distance between splats in pixels."""
    return math.sqrt(width * height / max(count, 1))


@dataclass(frozen=True)
class Places:
    """The places of centres by the rank of the detail there among all pixels: 0 the least, 1 the most."""

    mean_rank: float  # 1/2 where detail does not matter
    # (BINS,) centres per pixel in each tenth of the frame by rank, in units of the mean over the frame
    density: tuple[float, ...]
    # Kullback-Leibler divergence of the shares of these tenths from equal ones, in bits; 0 where they are equal
    divergence: float
    outside: float  # the fraction of all centres that lie outside of the frame


def ranks(values: F8) -> F8:
    """The rank of each value among all, (H, W) f8 in 0..1; the first of equal ones comes first."""
    order = np.empty(values.size)
    order[np.argsort(values, axis=None, kind="stable")] = np.arange(values.size)
    return np.asarray((order / max(values.size - 1, 1)).reshape(values.shape))


def places(positions: F4, rank: F8) -> Places:
    """The places of centres (N, 2) f4 in pixels among the ranks (H, W) f8 of the detail."""
    height, width = rank.shape
    inside = ((positions >= 0) & (positions < [width, height])).all(axis=1)
    x, y = positions[inside].astype(np.int64).T
    found = rank[y, x]
    shares = np.bincount(np.minimum((found * BINS).astype(int), BINS - 1), minlength=BINS) / max(len(found), 1)
    filled = shares[shares > 0]
    divergence = float((filled * np.log2(filled * BINS)).sum())
    density = tuple(float(share * BINS) for share in shares)
    return Places(float(found.mean()) if len(found) else 0.5, density, divergence, float(1 - inside.mean()))
