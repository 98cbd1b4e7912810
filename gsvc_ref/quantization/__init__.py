"""Values <-> codes: binary16 (`half`), LSQ+ (`lsq`), residual vector quantisation (`rvq`), and how these are learned.

What a decoder needs is `from_half_bits`, `lsq.dequantize` and `rvq.dequantize`; everything else is an encoder's.
"""

from gsvc_ref.quantization import lsq, lsq_parameters, rvq, rvq_training
from gsvc_ref.quantization.half import coarsen_half, from_half_bits, half_is_finite, to_half_bits
from gsvc_ref.quantization.lsq_parameters import LsqParameters
from gsvc_ref.quantization.rvq_training import RvqSettings, RvqState

__all__ = [
    "LsqParameters",
    "RvqSettings",
    "RvqState",
    "coarsen_half",
    "from_half_bits",
    "half_is_finite",
    "lsq",
    "lsq_parameters",
    "rvq",
    "rvq_training",
    "to_half_bits",
]
