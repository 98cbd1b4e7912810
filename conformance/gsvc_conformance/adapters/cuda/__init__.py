"""GSVC in CUDA C++, for NVIDIA GPUs; without one, the same kernels as fibers on the CPU.

    gsvc-conformance run --module gsvc_conformance.adapters.cuda
    GSVC_CUDA=fibers gsvc-conformance run --module gsvc_conformance.adapters.cuda

The second line needs no GPU.
"""

from gsvc_conformance.adapters.cuda.device import environment
from gsvc_conformance.adapters.cuda.main_profile import MAIN
from gsvc_conformance.adapters.cuda.reconstruction import (
    from_half,
    parameter_checksum,
    reconstruct_inter,
    reconstruct_intra,
    rendering_work,
    to_half,
)
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
from gsvc_conformance.adapters.cuda.streams import NAMES, decode_stream, decode_stream_deterministic
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

adapt_model = MAIN.adapt_model
cells_of_halves = MAIN.cells_of_halves
codes_of_classes = MAIN.codes_of_classes
density_frequencies = MAIN.density_frequencies
encode_run = MAIN.encode_run
field_vectors = MAIN.field_vectors
half_frequencies = MAIN.half_frequencies
main_inter = MAIN.main_inter
main_intra = MAIN.main_intra
main_work = MAIN.main_work
mode_contexts = MAIN.mode_contexts
model_frequencies = MAIN.model_frequencies
motion_of_splats = MAIN.motion_of_splats
splat_classes = MAIN.splat_classes
state_parameters = MAIN.state_parameters
window_frequencies = MAIN.window_frequencies

read_main_stream = NAMES["read_main_stream"]
reconstruct_layers = NAMES["reconstruct_layers"]
reconstruct_stream = NAMES["reconstruct_stream"]
decode_layers = NAMES["decode_layers"]
read_stream = NAMES["read_stream"]
decode_plane = NAMES["decode_plane"]
seek = NAMES["seek"]
