"""Hard because they last: ten thousand predicted frames."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from tests.hard_cases.catalogue import Entry, LongRun
from tests.hard_cases.long_sequence import (
    CHOLESKY,
    SCALE,
    accumulated,
    attribute,
    closed_loop,
    decoded,
    is_repeated,
    open_loop,
    source,
)
from tests.hard_cases.measuring import Measurement, Worst

STEP: Final = float(SCALE[0]) * (0.5 + 2.0**-14) + 2.0**-20
"""Pixels: half a step of the codes; t is off by 2^-22 of up to 63, and five roundings of numbers below 5 follow."""


def _largest(difference: NDArray[np.floating]) -> float:
    return float(abs(difference).max())


def drift(naive: NDArray[np.floating]) -> Measurement:
    """Reader and writer against each other, and another decoder against the writer."""
    wide = closed_loop().parameters.astype(np.float64)
    return Measurement(
        {"gsvc_ref": Worst(_largest(decoded()[0] - wide), 0.0)}, Worst(_largest(naive.astype(np.float64) - wide), 0.0)
    )


def following() -> Measurement:
    """The distance of Cholesky factors from the source, after frames that have them."""
    # From frame 100 on differences are within the range of codes.
    coded = [n for n in range(100, len(source())) if attribute(n) == CHOLESKY and not is_repeated(n)]
    ours, naive = (
        _largest((found.astype(np.float64) - source())[coded][..., 2:5]) for found in (decoded()[0], open_loop())
    )
    return Measurement({"gsvc_ref": Worst(ours, STEP)}, Worst(naive, STEP))


CASES: Final[tuple[Entry, ...]] = (
    LongRun(
        "ten_thousand_frames_without_drift",
        "reconstruct_stream",
        "A decoder with more accurate sums is no longer where the encoder predicts from, and never comes back.",
        "None: the definition is in binary32 operations, so that encoder and decoder have the same bits.",
        "sums in binary64",
        lambda: drift(accumulated(np.float64, fused=False)),
    ),
    LongRun(
        "ten_thousand_frames_and_fused_products",
        "reconstruct_stream",
        "A compiler fuses products with sums, and each frame adds a rounding that the encoder has not made.",
        "None: the definition is in binary32 operations, so that encoder and decoder have the same bits.",
        "fused products",
        lambda: drift(accumulated(np.float32, fused=True)),
    ),
    LongRun(
        "ten_thousand_frames_of_feedback",
        "reconstruct_stream",
        "Quantisation errors of differences of the source add up from frame to frame.",
        "Half a step of the codes, however many frames there are, since every difference is one to what is decoded.",
        "open loop",
        following,
    ),
)
