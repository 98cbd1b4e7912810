"""GSVC in PyTorch: forward functions of tensors, whose gradients autograd finds; on a CPU, or with CUDA if it is there.

    gsvc-conformance run --module gsvc_conformance.adapters.pytorch

needs PyTorch: pip install torch, or the command of pytorch.org for a GPU (ROCm's calls itself CUDA, too).
`GSVC_TORCH_DEVICE=cpu` or `cuda:1` chooses a device; it must have binary64, which Apple's MPS has not. Start at
`rendering.render`, which can be put into any loss as it is, and `training.loss_of`. Streams are parsed by the code of
spec.md on the host, so `read_stream`, `decode_plane`, `encode_plane` and `seek` are not here. Of
profile `main` the host has the passes of the entropy coder, too (`read_main_stream`, `reconstruct_layers`,
`encode_run`, `half_frequencies`); what is done to all splats, contexts or bins at once is in `main_profile`.
"""

import platform

import torch

from gsvc_conformance.adapters import nvidia
from gsvc_conformance.adapters.pytorch.color import frame_to_planes, planes_to_frame
from gsvc_conformance.adapters.pytorch.decisions import converged, pruning_plan, select_key_frames
from gsvc_conformance.adapters.pytorch.deterministic import (
    render_sum_deterministic,
    scale_parameters,
    to_frame_deterministic,
)
from gsvc_conformance.adapters.pytorch.device import DEVICE
from gsvc_conformance.adapters.pytorch.main_profile import (
    adapt_model,
    cells_of_halves,
    codes_of_classes,
    density_frequencies,
    field_vectors,
    main_inter,
    main_intra,
    main_work,
    mode_contexts,
    model_frequencies,
    motion_of_splats,
    splat_classes,
    state_parameters,
    window_frequencies,
)
from gsvc_conformance.adapters.pytorch.metrics import metrics
from gsvc_conformance.adapters.pytorch.quantization import (
    commitment,
    lsq_gradients,
    lsq_quantize,
    rvq_assign,
    rvq_update,
)
from gsvc_conformance.adapters.pytorch.reconstruction import (
    from_half,
    lsq_dequantize,
    parameter_checksum,
    reconstruct_inter,
    reconstruct_intra,
    rendering_work,
    to_half,
)
from gsvc_conformance.adapters.pytorch.rendering import (
    render_frame,
    render_gradients,
    render_sum,
    scale_parameters_filtered,
    to_frame,
)
from gsvc_conformance.adapters.pytorch.streams import (
    decode_layers,
    decode_stream,
    decode_stream_deterministic,
    reconstruct_stream,
)
from gsvc_conformance.adapters.pytorch.training import (
    adan_step,
    augment,
    compact,
    learning_rates,
    loss,
    prune,
    weighted_gradients,
    weighted_parameters,
)


def environment() -> dict[str, str]:
    """The device, versions and settings that results may depend on."""
    return {
        **_device(),
        "vectors": torch.backends.cpu.get_cpu_capability(),
        "threads": str(torch.get_num_threads()),
        "float32 matmul precision": torch.get_float32_matmul_precision(),
        "PyTorch": torch.__version__,
        "Python": platform.python_version(),
    }


def _device() -> dict[str, str]:
    if DEVICE.type != "cuda":
        return {"device": f"{DEVICE.type} ({platform.machine()})", "CUDA": "not used"}
    return {
        "device": torch.cuda.get_device_name(DEVICE),
        **nvidia.driver(),
        "compute capability": "{}.{}".format(*torch.cuda.get_device_capability(DEVICE)),
        "CUDA": torch.version.cuda or f"ROCm {torch.version.hip}",
    }
