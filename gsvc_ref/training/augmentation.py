"""The paper's random splats: Gaussian Splat Augmentation, and the start of I-frames. Sizes are in pixels."""

from typing import Final

import numpy as np
from numpy.random import Generator

from gsvc_base.arrays import F4
from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_base.splats import PARAMETERS_PER_SPLAT, Splats

NEW_WEIGHT: Final = float(np.float32(0.01))
"""Initial w of random splats, of I-frames and of GSA (10-27); the authors' value. The paper has "close to zero"."""

KEPT_WEIGHT: Final = 1.0
"""Initial w of the splats that a P-frame takes over (paper section 3.5)."""

RANDOM_CHOLESKY_OFFSET: Final = np.array([0.5, 0.0, 0.5], np.float32)
"""Added to uniform numbers in [0, 1) for (l11, l21, l22) in pixels; the authors' value. The paper is silent."""


# twin of spec.augment
@door
def augment(values: F4, uniforms: F4, width: int, height: int) -> F4:
    """New splats of small weight after the old ones, uniformly over the frame (R-10.8-1).

    Parameters
    ----------
    values
        (N, 9) f4, the splats in training.
    uniforms
        (n, 8) f4 in [0, 1), eight numbers for each new splat, such as `uniform_numbers` draws.
    width, height
        The frame's size in pixels.

    Returns
    -------
    F4
        (N + n, 9).

    Raises
    ------
    UsageError
        As for `random_splats`.
    """
    new = random_splats(uniforms, width, height).to_array()
    weights = np.full((len(new), 1), NEW_WEIGHT, np.float32)
    return np.concatenate([values, np.concatenate([new, weights], axis=1)])


def uniform_numbers(count: int, rng: Generator) -> F4:
    """Uniform numbers (count, 8) f4: all positions are drawn first, then all Cholesky factors, then all colours."""
    if count < 0:
        raise UsageError(f"cannot place {count} splats; give at least 0")
    return np.concatenate([rng.random((count, columns), np.float32) for columns in (2, 3, 3)], axis=1)


def random_splats(
    uniforms: F4,  # (n, 8) f4 in [0, 1), in the columns of `Splats.to_array`
    width: int,
    height: int,
) -> Splats:
    """Splats uniformly over the frame, from uniform numbers: the start of an I-frame, and what GSA adds (10-26).

    The caller chooses their weight (`NEW_WEIGHT`).
    """
    if uniforms.ndim != 2 or uniforms.shape[1] != PARAMETERS_PER_SPLAT:
        raise UsageError(f"the uniform numbers have shape {uniforms.shape}; give (n, {PARAMETERS_PER_SPLAT})")
    if width < 1 or height < 1:
        raise UsageError(f"cannot place splats on {width}x{height} pixels; give at least 1x1")
    positions = uniforms[:, :2] * np.array([width, height], np.float32)
    cholesky = uniforms[:, 2:5] + RANDOM_CHOLESKY_OFFSET  # (10-26)
    return Splats(positions, cholesky, uniforms[:, 5:])  # (10-27)
