"""GSVC in CUDA C++, for NVIDIA GPUs; without one, the same kernels as fibers on the CPU.

    gsvc-conformance run --module gsvc_conformance.adapters.cuda
    GSVC_CUDA=fibers gsvc-conformance run --module gsvc_conformance.adapters.cuda

The second line needs no GPU.
"""

from gsvc_conformance.adapters.cuda.device import environment
from gsvc_conformance.adapters.cuda.quantization import (
    commitment,
    lsq_dequantize,
    lsq_gradients,
    lsq_quantize,
    rvq_assign,
    rvq_update,
)
from gsvc_conformance.adapters.cuda.rendering import (
    render_frame,
    render_gradients,
    render_sum,
    render_sum_deterministic,
    scale_parameters,
    scale_parameters_filtered,
    to_frame,
    to_frame_deterministic,
)
from gsvc_conformance.adapters.cuda.training import (
    adan_step,
    augment,
    compact,
    loss,
    prune,
    weighted_gradients,
    weighted_parameters,
)

__all__ = [
    "adan_step",
    "augment",
    "commitment",
    "compact",
    "environment",
    "loss",
    "lsq_dequantize",
    "lsq_gradients",
    "lsq_quantize",
    "prune",
    "render_frame",
    "render_gradients",
    "render_sum",
    "render_sum_deterministic",
    "rvq_assign",
    "rvq_update",
    "scale_parameters",
    "scale_parameters_filtered",
    "to_frame",
    "to_frame_deterministic",
    "weighted_gradients",
    "weighted_parameters",
]
