"""What gsvc_ref has for each operation of spec.md: the table that ``run --reference`` answers by.

An operation whose name and arguments gsvc_ref has too is a `Twin`, or `OfSplats`: its answer is that function's, as it
stands. Any other is `Other`, with what gsvc_ref has instead and why; `conformance.operations` translates it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any, Final

import numpy as np

from gsvc_ref.splats import Splats


@dataclass(frozen=True)
class Twin:
    """gsvc_ref has a function with the operation's name, argument names and meaning.

    Attributes
    ----------
    module
        Where it is. It returns the one output, or a named tuple of all; it may have further arguments by keyword.
    """

    module: str


@dataclass(frozen=True)
class OfSplats(Twin):
    """A twin that has ``splats``, a `Splats`, in place of the array ``parameters``."""


@dataclass(frozen=True)
class Other:
    """gsvc_ref has something else.

    Attributes
    ----------
    name
        What it has, and where: ``module:name``.
    reason
        Why that has another name or other arguments.
    """

    name: str
    reason: str


ONE_BY_ONE: Final = "frames come one at a time, so that a stream of any length can be read"
CODES: Final = "codes of a frame come as one FrameCodes, and what they refer to as State"
BOOKS: Final = "codebooks are a sequence with an array for each stage"
VIDEO: Final = "the color of a video is described by one VideoFormat"

PAIRS: Final[Mapping[str, Twin | Other]] = {
    "read_stream": Other("gsvc_ref.bitstream:StreamReader", ONE_BY_ONE),
    "decode_plane": Other("gsvc_ref.bitstream.planes:plane", "a plane is read in its place in a stream"),
    "encode_plane": Twin("gsvc_ref.bitstream.rans"),
    "reconstruct_stream": Other("gsvc_ref.bitstream:StreamReader", ONE_BY_ONE),
    "decode_stream": Other("gsvc_ref:decode", ONE_BY_ONE),
    "decode_stream_deterministic": Other("gsvc_ref:decode", ONE_BY_ONE),
    "from_half": Twin("gsvc_ref.quantization"),
    "to_half": Twin("gsvc_ref.quantization"),
    "reconstruct_intra": Other("gsvc_ref.reconstruction:reconstruct", CODES),
    "reconstruct_inter": Other("gsvc_ref.reconstruction:reconstruct", CODES),
    "parameter_checksum": OfSplats("gsvc_ref.bitstream.crc"),
    "rendering_work": OfSplats("gsvc_ref.reconstruction.work"),
    "render_sum": OfSplats("gsvc_ref.rendering"),
    "render_sum_deterministic": Other("gsvc_ref.rendering:render_sum", "the precision is an argument"),
    "to_frame": Twin("gsvc_ref.rendering"),
    "to_frame_deterministic": Twin("gsvc_ref.rendering"),
    "render_frame": OfSplats("gsvc_ref.rendering"),
    "render_gradients": OfSplats("gsvc_ref.rendering"),
    "scale_parameters": Other("gsvc_ref:Splats.scaled", "splats are scaled by factors, whatever the sizes are"),
    "loss": Twin("gsvc_ref.rendering"),
    "weighted_parameters": Twin("gsvc_ref.training.weighting"),
    "weighted_gradients": Twin("gsvc_ref.training.weighting"),
    "learning_rates": Other("gsvc_ref.training.schedule:StepDecay", "a schedule is an object, asked once an iteration"),
    "adan_step": Other("gsvc_ref.training.adan:Adan.step", "the optimizer keeps its state, and moves rows in place"),
    "pruning_plan": Twin("gsvc_ref.training.pruning"),
    "prune": Twin("gsvc_ref.training.pruning"),
    "compact": Twin("gsvc_ref.training.pruning"),
    "augment": Twin("gsvc_ref.training.augmentation"),
    "select_key_frames": Twin("gsvc_ref.encoder.key_frames"),
    "converged": Other("gsvc_ref.training.convergence:Convergence", "losses come one at a time, as training goes on"),
    "lsq_quantize": Twin("gsvc_ref.quantization"),
    "lsq_dequantize": Twin("gsvc_ref.quantization"),
    "lsq_gradients": Twin("gsvc_ref.quantization"),
    "rvq_assign": Other("gsvc_ref.quantization.rvq:assign", BOOKS),
    "rvq_update": Twin("gsvc_ref.quantization"),
    "commitment": Other("gsvc_ref.quantization.rvq:commitment", BOOKS),
    "planes_to_frame": Other("gsvc_ref.video.color:planes_to_frame", VIDEO),
    "frame_to_planes": Other("gsvc_ref.video.color:frame_to_planes", VIDEO),
    "metrics": Other("gsvc_ref.metrics:psnr", "mse, psnr and ms_ssim are functions of their own"),
}
"""By name of the operation, in the order of spec.md section 4.3."""


@cache
def twin(name: str) -> Callable[..., Any]:
    """gsvc_ref's function of an operation that is a `Twin`."""
    pair = PAIRS[name]
    assert isinstance(pair, Twin)
    function: Callable[..., Any] = getattr(import_module(pair.module), name)
    return function


def answer(name: str, outputs: Mapping[str, str], inputs: Mapping[str, Any]) -> dict[str, Any]:
    """The outputs of an operation that is a `Twin`; `outputs` are their names and types."""
    given = dict(inputs)
    if isinstance(PAIRS[name], OfSplats):
        given["splats"] = Splats.from_array(given.pop("parameters"))
    found = twin(name)(**given)
    values = found._asdict() if hasattr(found, "_asdict") else dict(zip(outputs, [found], strict=True))
    return {
        name: value if isinstance(value, np.ndarray) else np.asarray(value, outputs[name])
        for name, value in values.items()
    }
