"""The functions that gsvc_ref has for the operations of spec.md: the table that ``run --reference`` answers by.

An operation whose name and arguments gsvc_ref has too is a `Twin`: its answer is that function's, as it stands. Any
other is `Other`, with what gsvc_ref has instead and why; `gsvc_conformance.operations` translates it. A `Free` one has
no function in the code of spec.md either, because many answers are right.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np


@dataclass(frozen=True)
class Twin:
    """gsvc_ref has a function with the operation's name, argument names and meaning.

    It is an attribute of gsvc_ref. It returns the one output, or a named tuple of all; a `Splats` is an array of its
    parameters. It may have further arguments by keyword.
    """


@dataclass(frozen=True)
class Other:
    """gsvc_ref has something else.

    Attributes
    ----------
    name
        Its place: ``module:name``.
    reason
        The reason of another name or other arguments.
    """

    name: str
    reason: str


@dataclass(frozen=True)
class Free(Other):
    """gsvc_ref has something else, and the code of spec.md has nothing: the reason says why."""


TWIN: Final = Twin()

PAIRS: Final[Mapping[str, Twin | Other]] = {
    "read_stream": TWIN,
    "decode_plane": TWIN,
    "encode_plane": TWIN,
    "reconstruct_stream": TWIN,
    "seek": TWIN,
    "decode_stream": TWIN,
    "decode_stream_deterministic": TWIN,
    "from_half": TWIN,
    "to_half": TWIN,
    "reconstruct_intra": TWIN,
    "reconstruct_inter": TWIN,
    "parameter_checksum": TWIN,
    "rendering_work": TWIN,
    "render_sum": TWIN,
    "render_sum_deterministic": TWIN,
    "to_frame": TWIN,
    "to_frame_deterministic": TWIN,
    "render_frame": TWIN,
    "render_gradients": TWIN,
    "scale_parameters": TWIN,
    "loss": TWIN,
    "weighted_parameters": TWIN,
    "weighted_gradients": TWIN,
    "learning_rates": TWIN,
    "adan_step": TWIN,
    "pruning_plan": TWIN,
    "prune": TWIN,
    "compact": TWIN,
    "augment": TWIN,
    "select_key_frames": TWIN,
    "converged": TWIN,
    "lsq_quantize": TWIN,
    "lsq_dequantize": TWIN,
    "lsq_gradients": TWIN,
    "rvq_assign": TWIN,
    "rvq_update": TWIN,
    "commitment": TWIN,
    "planes_to_frame": TWIN,
    "frame_to_planes": TWIN,
    "metrics": Other("gsvc_ref.metrics:psnr", "mse, psnr and ms_ssim are functions of a module of this name"),
    "read_main_stream": TWIN,
    "reconstruct_layers": TWIN,
    "encode_run": TWIN,
    "density_frequencies": TWIN,
    "half_frequencies": TWIN,
    "model_frequencies": TWIN,
    "adapt_model": TWIN,
    "mode_contexts": TWIN,
    "splat_classes": TWIN,
    "main_intra": TWIN,
    "motion_of_splats": TWIN,
    "main_inter": TWIN,
    "state_parameters": TWIN,
    "encode_video": Free("gsvc_ref.encoder:encode", "an encoder is free: whatever decodes to what was asked is right"),
}
"""By name of the operation, in the order of spec.md section 4.3."""


def twin(name: str) -> Callable[..., Any]:
    """gsvc_ref's function of an operation that is a `Twin`."""
    import gsvc_ref

    function: Callable[..., Any] = getattr(gsvc_ref, name)
    return function


def answer(name: str, outputs: Mapping[str, str], inputs: Mapping[str, Any]) -> dict[str, Any]:
    """The outputs of an operation that is a `Twin`; `outputs` are their names and types."""
    found = twin(name)(**inputs)
    values = found._asdict() if hasattr(found, "_asdict") else dict(zip(outputs, [found], strict=True))
    return {
        name: value if isinstance(value, np.ndarray | str) else np.asarray(value, outputs[name])
        for name, value in values.items()
    }
