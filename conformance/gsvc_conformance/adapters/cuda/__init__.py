"""GSVC in CUDA C++, for NVIDIA GPUs; without one, the same kernels as fibers on the CPU.

    gsvc-conformance run --module gsvc_conformance.adapters.cuda
    GSVC_CUDA=fibers gsvc-conformance run --module gsvc_conformance.adapters.cuda

The second line needs no GPU.
"""

from gsvc_conformance.adapters.cuda.device import environment
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

__all__ = [
    "environment",
    "render_frame",
    "render_gradients",
    "render_sum",
    "render_sum_deterministic",
    "scale_parameters",
    "scale_parameters_filtered",
    "to_frame",
    "to_frame_deterministic",
]
