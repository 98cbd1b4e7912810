"""Chroma siting and the two filters that follow from it (ITU-T H.273, ChromaLocType).

On a subsampled side, chroma sample k lies at luma coordinate 2k + phi with phi = 0 (on the first of two luma samples),
1/2 (between them) or 1 (on the second). From that one number follow both directions:

- *up*: linear interpolation between the two neighbouring chroma samples;
- *down*: the mean over the cell of chroma sample k, which is two pixels long and centred on its site: weights
  (1, 2, 1)/4 around a luma sample, (1, 1)/2 between two.

Beyond an edge the outermost sample is repeated. Down after up gives back exactly constant chroma and, away from the
edges, linear chroma. All weights are whole quarters, so that filtered integers are exact sixteenths.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref.video.format import VideoFormat

PHASE_OF_COLUMNS: Final = (0, 1, 0, 1, 0, 1)
PHASE_OF_ROWS: Final = (1, 1, 0, 0, 2, 2)
"""2 phi, by ChromaLocType 0 to 5: where it puts the sample on each axis."""


@dataclass(frozen=True, eq=False)
class Taps:
    """A one-dimensional filter: output n is the sum over t of weights[n, t] * input[indices[n, t]], in quarters."""

    indices: I8  # (outputs, taps), within the input
    weights: I8  # (outputs, taps), quarters; each row sums to 4


def up_taps(size: int, phase: int | None) -> Taps:
    """Taps from chroma to the `size` luma samples of one side, `phase` 2 phi; None is a side without subsampling."""
    luma = np.arange(size)
    if phase is None:
        return Taps(np.stack([luma, luma], axis=1), np.tile([4, 0], (size, 1)))
    quarters = 2 * luma - phase  # (i - phi) / 2, the position in chroma samples, times 4
    lower = quarters // 4  # (size,) i8
    upper_weight = quarters - 4 * lower
    last = (size + 1) // 2 - 1
    indices = np.clip(np.stack([lower, lower + 1], axis=1), 0, last)  # (size, 2) i8
    return Taps(indices, np.stack([4 - upper_weight, upper_weight], axis=1))  # (11-4)


def down_taps(size: int, phase: int | None) -> Taps:
    """Taps from `size` luma samples of one side to its chroma samples; phase None is a side without subsampling."""
    if phase is None:
        luma = np.arange(size)
        return Taps(np.stack([luma, luma, luma], axis=1), np.tile([0, 4, 0], (size, 1)))
    offsets, weights = (([-1, 0, 1], [1, 2, 1]), ([0, 1, 1], [2, 2, 0]), ([0, 1, 2], [1, 2, 1]))[phase]
    chroma = np.arange((size + 1) // 2)
    indices = np.clip(2 * chroma[:, None] + np.array(offsets), 0, size - 1)  # (chroma, 3) i8
    return Taps(indices, np.tile(weights, (len(chroma), 1)))  # (11-4)


def phases(video: VideoFormat) -> tuple[int | None, int | None]:
    """2 phi of rows and of columns, None on a side without subsampling."""
    location = video.color.chroma_location
    rows = PHASE_OF_ROWS[location] if video.chroma_format == "420" else None
    columns = PHASE_OF_COLUMNS[location] if video.chroma_format in ("420", "422") else None
    return rows, columns
