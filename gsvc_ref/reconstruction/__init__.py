"""Reconstruction: from a frame's codes and the frame before to its splats, bit for bit (spec.md section 8).

`reconstruct` is the one function that decoder and encoder share: an encoder that predicts from what it returns cannot
drift from its decoders.
"""

from gsvc_ref.reconstruction.codes import BlockKind, Codebooks, FrameCodes, FrameType, Quantizer, SplatBlock
from gsvc_ref.reconstruction.reconstruct import Kept, State, reconstruct, reconstruct_inter, reconstruct_intra

__all__ = [
    "BlockKind",
    "Codebooks",
    "FrameCodes",
    "FrameType",
    "Kept",
    "Quantizer",
    "SplatBlock",
    "State",
    "reconstruct",
    "reconstruct_inter",
    "reconstruct_intra",
]
