"""GSVC in CUDA C++: decoder, renderer and the steps of training, on an NVIDIA GPU or, without one, as fibers.

    gsvc-conformance run --module gsvc_conformance.adapters.cuda
    GSVC_CUDA=fibers gsvc-conformance run --module gsvc_conformance.adapters.cuda

The first line needs a GPU, its driver and CuPy (pip install 'gsvc-conformance[cuda]'); CUDA_VISIBLE_DEVICES chooses a
GPU. The second needs a C++ compiler (g++, or the one that CXX names) and no GPU: the same files of kernels are compiled
with fibers.h, where every thread is a fiber. It is for tests: slow, and it sees few races and nothing of what NVIDIA's
compiler does. Both keep what they have compiled in the folder gsvc-cuda of the user's cache.

The kernels are in `kernels/`, to be read in this order: common.cuh, splats.cuh, lists.cu, tiles.cuh, sums.cuh,
rendering.cu, gradients.cu; then training.cu and quantization.cu; and for the decoder blocks.cuh, crc.cuh, rans.cuh,
reconstruct.cu, and of profile `main` main_tables.cuh, main_splats.cuh, main_parts.cuh, main_run.cuh, main_body.cu and
main_operations.cu. A frame is two launches: a warp for each splat sets its bit in the lists of the regions that it
touches, and a warp for each tile of 8 x 16 pixels (8 x 32 for gradients) adds up the splats of its list. Nothing is
sorted, a list is in the order of the splats, and a pixel is written once. `rendering.Scene` and `evaluation.Evaluation`
are the same for callers whose pictures and gradients stay on the device. `fitting.Evaluator` is what ``gsvc encode
--device cuda`` asks for losses and gradients.

`decoder.Decoder` makes pictures of the bytes of a stream of profile `main` without waiting for the device: read_body,
one block, reads a frame, from the bits of its head to the states of its splats, and finds its faults; a warp decodes
the symbols of 32 lanes. `python -m gsvc_conformance.adapters.cuda FILE.gsvc` says how fast that is. The container, and
the elements of planes of profile `paper`, are read by the decoder inside spec.md, through
`gsvc_conformance.adapters.host`.

What the kernels assume of the compiler. All are compiled twice. Identical bytes (spec.md 9.3) take --fmad=false,
--ftz=false, --prec-div=true and --prec-sqrt=true, and each operation that decides is written as __fmul_rn, __fadd_rn,
__fsub_rn or __fdiv_rn besides, which no option fuses; -use_fast_math, and the -ftz=true that CuPy's RawKernel and
RawModule add, flush even inside of these, so the host goes to NVRTC itself. The other build fuses, and has the
exponential of the hardware. There are no atomic additions of float, which flush on NVIDIA, and no sum whose order two
runs could change: gradients have the same bytes in every run.

Not here are the decisions of training that a host makes from a few numbers (`learning_rates`, `converged`,
`pruning_plan`, `select_key_frames`), colour conversion and metrics.

Nothing of this package was measured on a GPU yet. What is known of NVIDIA's compiler is what it writes: for sm_90, no
kernel spills registers in a loop over splats.
"""

from gsvc_conformance.adapters.cuda.device import environment
from gsvc_conformance.adapters.cuda.main_profile import MAIN
from gsvc_conformance.adapters.cuda.quantization import (
    commitment,
    lsq_dequantize,
    lsq_gradients,
    lsq_quantize,
    rvq_assign,
    rvq_update,
)
from gsvc_conformance.adapters.cuda.reconstruction import (
    encode_plane,
    from_half,
    parameter_checksum,
    reconstruct_inter,
    reconstruct_intra,
    rendering_work,
    to_half,
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
from gsvc_conformance.adapters.cuda.streams import STREAMS, decode_stream, decode_stream_deterministic
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
    "adapt_model",
    "augment",
    "cells_of_halves",
    "codes_of_classes",
    "commitment",
    "compact",
    "decode_layers",
    "decode_plane",
    "decode_stream",
    "decode_stream_deterministic",
    "density_frequencies",
    "encode_plane",
    "encode_run",
    "environment",
    "field_vectors",
    "from_half",
    "half_frequencies",
    "loss",
    "lsq_dequantize",
    "lsq_gradients",
    "lsq_quantize",
    "main_inter",
    "main_intra",
    "main_work",
    "mode_contexts",
    "model_frequencies",
    "motion_of_splats",
    "parameter_checksum",
    "prune",
    "read_main_stream",
    "read_stream",
    "reconstruct_inter",
    "reconstruct_intra",
    "reconstruct_layers",
    "reconstruct_stream",
    "render_frame",
    "render_gradients",
    "render_sum",
    "render_sum_deterministic",
    "rendering_work",
    "rvq_assign",
    "rvq_update",
    "scale_parameters",
    "scale_parameters_filtered",
    "seek",
    "splat_classes",
    "state_parameters",
    "to_frame",
    "to_frame_deterministic",
    "to_half",
    "weighted_gradients",
    "weighted_parameters",
    "window_frequencies",
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

decode_layers = STREAMS["decode_layers"]
decode_plane = STREAMS["decode_plane"]
read_main_stream = STREAMS["read_main_stream"]
read_stream = STREAMS["read_stream"]
reconstruct_layers = STREAMS["reconstruct_layers"]
reconstruct_stream = STREAMS["reconstruct_stream"]
seek = STREAMS["seek"]
