"""The functions that gsvc_ref has for the operations of spec.md: the table that ``run --reference`` answers by.

An operation whose name and arguments gsvc_ref has too is a `Twin`, or `OfSplats`: its answer is that function's, as it
stands. Any other is `Other`, with what gsvc_ref has instead and why; `conformance.operations` translates it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

import gsvc_ref
from gsvc_ref.splats import Splats


@dataclass(frozen=True)
class Twin:
    """gsvc_ref has a function with the operation's name, argument names and meaning.

    It is an attribute of gsvc_ref. It returns the one output, or a named tuple of all; a `Splats` is an array of its
    parameters. It may have further arguments by keyword.
    """


@dataclass(frozen=True)
class OfSplats(Twin):
    """A twin that has ``splats``, a `Splats`, in place of the array ``parameters``."""


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


TWIN: Final = Twin()
OF_SPLATS: Final = OfSplats()

PAIRS: Final[Mapping[str, Twin | Other]] = {
    "read_stream": TWIN,
    "decode_plane": TWIN,
    "encode_plane": TWIN,
    "reconstruct_stream": TWIN,
    "decode_stream": TWIN,
    "decode_stream_deterministic": TWIN,
    "from_half": TWIN,
    "to_half": TWIN,
    "reconstruct_intra": TWIN,
    "reconstruct_inter": TWIN,
    "parameter_checksum": TWIN,
    "rendering_work": TWIN,
    "render_sum": OF_SPLATS,
    "render_sum_deterministic": Other("gsvc_ref.rendering:render_sum", "the precision is an argument"),
    "to_frame": TWIN,
    "to_frame_deterministic": TWIN,
    "render_frame": OF_SPLATS,
    "render_gradients": OF_SPLATS,
    "scale_parameters": TWIN,
    "loss": TWIN,
    "weighted_parameters": TWIN,
    "weighted_gradients": TWIN,
    "learning_rates": Other("gsvc_ref.training.schedule:StepDecay", "a schedule is an object, asked once an iteration"),
    "adan_step": Other("gsvc_ref.training.adan:Adan.step", "the optimizer keeps its state, and moves rows in place"),
    "pruning_plan": TWIN,
    "prune": TWIN,
    "compact": TWIN,
    "augment": TWIN,
    "select_key_frames": TWIN,
    "converged": Other("gsvc_ref.training.convergence:Convergence", "losses come one at a time, as training goes on"),
    "lsq_quantize": TWIN,
    "lsq_dequantize": TWIN,
    "lsq_gradients": TWIN,
    "rvq_assign": TWIN,
    "rvq_update": TWIN,
    "commitment": TWIN,
    "planes_to_frame": TWIN,
    "frame_to_planes": TWIN,
    "metrics": Other("gsvc_ref.metrics:psnr", "mse, psnr and ms_ssim are functions of a module of this name"),
}
"""By name of the operation, in the order of spec.md section 4.3."""


def twin(name: str) -> Callable[..., Any]:
    """gsvc_ref's function of an operation that is a `Twin`."""
    function: Callable[..., Any] = getattr(gsvc_ref, name)
    return function


def answer(name: str, outputs: Mapping[str, str], inputs: Mapping[str, Any]) -> dict[str, Any]:
    """The outputs of an operation that is a `Twin`; `outputs` are their names and types."""
    given = dict(inputs)
    if isinstance(PAIRS[name], OfSplats):
        given["splats"] = Splats.from_array(given.pop("parameters"))
    found = twin(name)(**given)
    values = found._asdict() if hasattr(found, "_asdict") else dict(zip(outputs, [found], strict=True))
    return {
        name: value if isinstance(value, np.ndarray | str) else np.asarray(value, outputs[name])
        for name, value in values.items()
    }
