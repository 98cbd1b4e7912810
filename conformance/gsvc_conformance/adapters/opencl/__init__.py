"""GSVC in OpenCL C: a decoder's back end and the steps of training, for whatever device has an OpenCL 1.2 driver.

    gsvc-conformance run --module gsvc_conformance.adapters.opencl

needs pyopencl (pip install 'gsvc-conformance[adapters]') and a driver: that of a GPU, or PoCL for CPUs
(pocl-opencl-icd in Debian). PYOPENCL_CTX=0:1 chooses a device, as everywhere in pyopencl; without it, it is the first
GPU, or the first device of all. Drivers are found by the files in /etc/OpenCL/vendors, and containers with NVIDIA's
library may lack nvidia.icd there, a line with the path of libnvidia-opencl.so.1. A device without binary64 has all
operations but `rendering_work`; one without subnormal numbers, or with neither binary64 nor correctly rounded
quotients, has no exact ones but those of profile `main`, which are made of integers. A frame is one buffer, and so are
its splats: each may be as large as CL_DEVICE_MAX_MEM_ALLOC_SIZE says, often a quarter of the memory.

The kernels are in `kernels/`, to be read in this order: splats.cl, lists.cl, render.cl, gradients.cl; then
reconstruct.cl, checks.cl, training.cl, pruning.cl, quantization.cl, codebooks.cl; and for profile `main`
main_entropy.cl, whose lanes decode a pass at once, and main_splats.cl. They are compiled twice: for speed, and for
identical bytes. The Python around them allocates, uploads, launches and downloads, operation by operation.

Streams are parsed by the decoder inside spec.md, through `gsvc_conformance.adapters.host`, which also finds the
rendering work of frames: so a device without binary64 decodes, too. Not here: `read_stream`, `seek` and the planes,
which are the parser's; colour conversion and metrics; and the decisions of training that the host makes from a few
numbers (`learning_rates`, `converged`, `pruning_plan`, `select_key_frames`).
"""

from collections.abc import Callable
from typing import Any

from gsvc_conformance.adapters import host
from gsvc_conformance.adapters.host import Operations
from gsvc_conformance.adapters.opencl.device import environment
from gsvc_conformance.adapters.opencl.main_profile import MAIN
from gsvc_conformance.adapters.opencl.quantization import (
    commitment,
    lsq_dequantize,
    lsq_gradients,
    lsq_quantize,
    rvq_assign,
    rvq_update,
)
from gsvc_conformance.adapters.opencl.reconstruction import (
    from_half,
    parameter_checksum,
    reconstruct_inter,
    reconstruct_intra,
    rendering_work,
    to_half,
)
from gsvc_conformance.adapters.opencl.rendering import (
    render_frame,
    render_gradients,
    render_sum,
    render_sum_deterministic,
    scale_parameters,
    scale_parameters_filtered,
    to_frame,
    to_frame_deterministic,
)
from gsvc_conformance.adapters.opencl.training import (
    adan_step,
    augment,
    compact,
    loss,
    prune,
    weighted_gradients,
    weighted_parameters,
)

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

_back_end: dict[str, Callable[..., dict[str, Any]]] = {
    "reconstruct_intra": reconstruct_intra,
    "reconstruct_inter": reconstruct_inter,
    "parameter_checksum": parameter_checksum,
    "render_frame": render_frame,
    "render_sum_deterministic": render_sum_deterministic,
    "to_frame_deterministic": to_frame_deterministic,
}
_streams: Operations = host.stream_operations(_back_end, main_profile=MAIN)
read_main_stream = _streams["read_main_stream"]
reconstruct_layers = _streams["reconstruct_layers"]
reconstruct_stream = _streams["reconstruct_stream"]
decode_layers = _streams["decode_layers"]
decode_stream = _streams["decode_stream"]
decode_stream_deterministic = _streams["decode_stream_deterministic"]
