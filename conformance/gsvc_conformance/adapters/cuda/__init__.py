"""GSVC in CUDA C++: rendering, its gradients and the steps of training, on an NVIDIA GPU or, without one, as fibers.

    gsvc-conformance run --module gsvc_conformance.adapters.cuda
    GSVC_CUDA=fibers gsvc-conformance run --module gsvc_conformance.adapters.cuda

The first line needs a GPU, its driver and CuPy (pip install 'gsvc-conformance[cuda]'); CUDA_VISIBLE_DEVICES chooses a
GPU. The second needs a C++ compiler (g++, or the one that CXX names) and no GPU: the same files of kernels are compiled
with fibers.h, where every thread is a fiber. It is for tests: slow, and it sees few races and nothing of what NVIDIA's
compiler does. Both keep what they have compiled in the folder gsvc-cuda of the user's cache.

The kernels are in `kernels/`, to be read in this order: common.cuh, splats.cuh, lists.cu, tiles.cuh, sums.cuh,
rendering.cu, gradients.cu; then training.cu and quantization.cu. A frame is two launches: a warp for each splat sets
its bit in the lists of the regions that it touches, and a warp for each tile of 8 x 16 pixels (8 x 32 for gradients)
adds up the splats of its list. Nothing is sorted, a list is in the order of the splats, and a pixel is written once.
`rendering.Scene` and `evaluation.Evaluation` are the same for callers whose pictures and gradients stay on the device.
`fitting.Evaluator` is what ``gsvc encode --device cuda`` asks for losses and gradients.

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
