"""Splats are taken out of a frame that is coded already; the codes of the others stay as they are."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.paper import FrameCodes, SplatBlock


def thinned(codes: FrameCodes, kept: NDArray[np.bool_]) -> FrameCodes:
    """The codes of a frame of some of its splats, kept (N,) bool, in the order in which it is reconstructed.

    Quantisers that no splat is left to need go as well.
    """
    stay = codes.survivor_count
    intra = _taken(codes.intra, kept[stay:])
    if codes.survivors is None:
        return FrameCodes.intra_frame(intra)
    survivors = codes.survivors.copy()
    survivors[survivors] = kept[:stay]
    return FrameCodes.predicted_frame(survivors, _taken(codes.inter, kept[:stay]), intra)


def _taken(block: SplatBlock | None, kept: NDArray[np.bool_]) -> SplatBlock | None:
    """A block of some of its splats; None without any."""
    if block is None or not kept.any():
        return None
    parts = {name: getattr(block, name) for name in ("positions", "cholesky", "colors")}
    return replace(block, **{name: None if part is None else part[kept] for name, part in parts.items()})
