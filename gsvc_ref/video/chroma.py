"""Chroma siting and the two filters that follow from it (ITU-T H.273, ChromaLocType).

On a subsampled side, chroma sample k lies at luma coordinate 2k + p with p = 0 (on the first of its two luma samples),
1/2 (between them) or 1 (on the second). From that one number follow both directions:

- *up*: linear interpolation between the two neighbouring chroma samples;
- *down*: the mean over the cell of chroma sample k, which is two pixels long and centred on its site: weights
  (1, 2, 1)/4 around a luma sample, (1, 1)/2 between two.

Beyond an edge the outermost sample is repeated. Down after up gives back exactly constant chroma and, away from the
edges, linear chroma. All weights are whole quarters, so that filtered integers are exact sixteenths.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.video.format import VideoFormat

QUARTER_PHASES: Final = {"first": 0, "between": 2, "second": 4}
"""p in quarters of a luma sample."""

HORIZONTAL_SITE: Final = ("first", "between", "first", "between", "first", "between")
VERTICAL_SITE: Final = ("between", "between", "first", "first", "second", "second")
"""Where ChromaLocType 0 to 5 puts the sample on each axis."""


@dataclass(frozen=True, eq=False)
class Taps:
    """A one-dimensional filter: output n is the sum over t of weights[n, t] * input[indices[n, t]], in quarters.

    Attributes
    ----------
    indices
        (outputs, taps) i8, within the input.
    weights
        (outputs, taps) i8, quarters; each row sums to 4.
    """

    indices: NDArray[np.int64]
    weights: NDArray[np.int64]


def up_taps(size: int, site: str | None) -> Taps:
    """Taps from chroma to the `size` luma samples of one side; site None is a side without subsampling."""
    luma = np.arange(size)
    if site is None:
        return Taps(np.stack([luma, luma], axis=1), np.tile([4, 0], (size, 1)))
    eighths = 4 * luma - QUARTER_PHASES[site]  # position in chroma samples, times 8
    lower = eighths // 8  # (size,) i8
    upper_weight = (eighths - 8 * lower) // 2  # p is a whole half, so no remainder is lost
    last = (size + 1) // 2 - 1
    indices = np.clip(np.stack([lower, lower + 1], axis=1), 0, last)  # (size, 2) i8
    return Taps(indices, np.stack([4 - upper_weight, upper_weight], axis=1))


def down_taps(size: int, site: str | None) -> Taps:
    """Taps from `size` luma samples of one side to its chroma samples; site None is a side without subsampling."""
    if site is None:
        luma = np.arange(size)
        return Taps(np.stack([luma, luma, luma], axis=1), np.tile([0, 4, 0], (size, 1)))
    offsets, weights = {
        "first": ([-1, 0, 1], [1, 2, 1]),
        "between": ([0, 1, 1], [2, 2, 0]),
        "second": ([0, 1, 2], [1, 2, 1]),
    }[site]
    chroma = np.arange((size + 1) // 2)
    indices = np.clip(2 * chroma[:, None] + np.array(offsets), 0, size - 1)  # (chroma, 3) i8
    return Taps(indices, np.tile(weights, (len(chroma), 1)))


def sites(video: VideoFormat) -> tuple[str | None, str | None]:
    """The (vertical, horizontal) site of chroma, None on a side without subsampling."""
    location = video.color.chroma_location
    vertical = VERTICAL_SITE[location] if video.chroma_format == "420" else None
    horizontal = HORIZONTAL_SITE[location] if video.chroma_format in ("420", "422") else None
    return vertical, horizontal


def resample(plane: NDArray[Any], vertical: Taps, horizontal: Taps) -> NDArray[np.int64]:
    """Filter an integer plane along both axes; the result is in sixteenths.

    Parameters
    ----------
    plane
        (rows, columns, ...) of any integer type.

    Returns
    -------
    (vertical outputs, horizontal outputs, ...) i8, 16 times the filtered plane.
    """
    extra = (1,) * (plane.ndim - 1)
    wide = plane.astype(np.int64)
    taps = range(vertical.indices.shape[1])
    columns = sum(vertical.weights[:, t].reshape(-1, *extra) * wide[vertical.indices[:, t]] for t in taps)
    across = np.moveaxis(np.asarray(columns), 1, 0)
    filtered = sum(horizontal.weights[:, t].reshape(-1, *extra) * across[horizontal.indices[:, t]] for t in taps)
    return np.moveaxis(np.asarray(filtered), 0, 1)
