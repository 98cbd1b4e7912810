"""Profile `paper`: codes, quantisers, and exact reconstruction (spec.md sections 8, 10.5 and 10.6).

Values become codes and back by binary16 (`half`), LSQ+ (`lsq`) and residual vector quantisation (`rvq`). `reconstruct`
makes splats of a frame's codes and the splats of the frame before, bit for bit. Decoder and encoder share it: an
encoder that predicts from what it returns cannot drift from its decoders.
"""

from gsvc_ref.paper import lsq, lsq_parameters, rvq, rvq_training
from gsvc_ref.paper.codebook_update import RvqUpdate, rvq_update
from gsvc_ref.paper.codes import BlockKind, Codebooks, FrameCodes, FrameType, Quantizer, SplatBlock
from gsvc_ref.paper.half import coarsen_half, from_half, half_is_finite, to_half
from gsvc_ref.paper.lsq import lsq_dequantize, lsq_gradients, lsq_quantize
from gsvc_ref.paper.lsq_parameters import LsqParameters
from gsvc_ref.paper.reconstruct import Kept, State, reconstruct, reconstruct_inter, reconstruct_intra
from gsvc_ref.paper.rvq import Commitment, commitment, rvq_assign
from gsvc_ref.paper.rvq_training import RvqSettings, RvqState

__all__ = [
    "BlockKind",
    "Codebooks",
    "Commitment",
    "FrameCodes",
    "FrameType",
    "Kept",
    "LsqParameters",
    "Quantizer",
    "RvqSettings",
    "RvqState",
    "RvqUpdate",
    "SplatBlock",
    "State",
    "coarsen_half",
    "commitment",
    "from_half",
    "half_is_finite",
    "lsq",
    "lsq_dequantize",
    "lsq_gradients",
    "lsq_parameters",
    "lsq_quantize",
    "reconstruct",
    "reconstruct_inter",
    "reconstruct_intra",
    "rvq",
    "rvq_assign",
    "rvq_training",
    "rvq_update",
    "to_half",
]
