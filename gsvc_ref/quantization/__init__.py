"""Values <-> codes: binary16 (`half`), LSQ+ (`lsq`), residual vector quantisation (`rvq`), and how these are learned.

A decoder needs `from_half`, `lsq_dequantize` and `rvq.dequantize`; everything else is an encoder's.
"""

from gsvc_ref.quantization import lsq, lsq_parameters, rvq, rvq_training
from gsvc_ref.quantization.codebook_update import RvqUpdate, rvq_update
from gsvc_ref.quantization.half import coarsen_half, from_half, half_is_finite, to_half
from gsvc_ref.quantization.lsq import lsq_dequantize, lsq_gradients, lsq_quantize
from gsvc_ref.quantization.lsq_parameters import LsqParameters
from gsvc_ref.quantization.rvq import Commitment, commitment, rvq_assign
from gsvc_ref.quantization.rvq_training import RvqSettings, RvqState

__all__ = [
    "Commitment",
    "LsqParameters",
    "RvqSettings",
    "RvqState",
    "RvqUpdate",
    "coarsen_half",
    "commitment",
    "from_half",
    "half_is_finite",
    "lsq",
    "lsq_dequantize",
    "lsq_gradients",
    "lsq_parameters",
    "lsq_quantize",
    "rvq",
    "rvq_assign",
    "rvq_training",
    "rvq_update",
    "to_half",
]
