"""gsvc_ref: the readable CPU reference of GSVC, video as sums of 2D Gaussian splats.

    import gsvc_ref

    report = gsvc_ref.encode("clip.y4m", "clip.gsvc")           # or an array (T, H, W, 3), u1 or u2
    for frame in gsvc_ref.decode("clip.gsvc"):                  # (H, W, 3) u1, one at a time
        ...
    with gsvc_ref.open("clip.gsvc") as stream:
        for frame in stream.frames(30, 60):                     # starts decoding at the nearest I-frame
            frame.splats.positions, frame.bits
    for frame in gsvc_ref.decode("damaged.gsvc", on_gap=print): # all that is left, and what is missing
        ...
    gsvc_ref.concat(["morning.gsvc", "noon.gsvc"], "day.gsvc")  # one stream, without decoding a splat
    gsvc_ref.write("mine.gsvc", [parameters], 320, 240)         # splats of any trainer, an (N, 8) array for each frame

spec.md says what the bytes mean, `spec` is the code in it, and `bitstream`, `stream`, `main`, `paper` and `rendering`
do what it says; `training` has the paper's algorithms, `encoder` leads them from frame to frame, and
`testing` has Hypothesis strategies for those who test an implementation of their own.

The operations of spec.md are here by their names, as fast functions with the arguments of section 4.3; `spec` has
their plain forms. Each takes and gives NumPy arrays, and a `Splats` is an array of its parameters:

    frames = gsvc_ref.decode_stream(data)                       # (T, H, W, 3) u1, all at once
    codes = gsvc_ref.read_stream(data)                          # what the bytes say, as flat arrays
    gsvc_ref.lsq_quantize(x, scale, offset, bits=6)             # the codes of spec.lsq_quantize(...)["codes"]
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from gsvc_base import spec as spec
    from gsvc_base.errors import GsvcError as GsvcError
    from gsvc_base.errors import UsageError as UsageError
    from gsvc_base.splats import Splats as Splats
    from gsvc_base.splats import scale_parameters as scale_parameters
    from gsvc_ref.bitstream.crc import parameter_checksum as parameter_checksum
    from gsvc_ref.bitstream.planes import decode_plane as decode_plane
    from gsvc_ref.bitstream.rans import encode_plane as encode_plane
    from gsvc_ref.encoder import IncompleteEncodeError as IncompleteEncodeError
    from gsvc_ref.encoder import Settings as Settings
    from gsvc_ref.encoder import encode as encode
    from gsvc_ref.encoder import write as write
    from gsvc_ref.encoder.key_frames import select_key_frames as select_key_frames
    from gsvc_ref.main.operations import adapt_model as adapt_model
    from gsvc_ref.main.operations import density_frequencies as density_frequencies
    from gsvc_ref.main.operations import half_frequencies as half_frequencies
    from gsvc_ref.main.operations import main_inter as main_inter
    from gsvc_ref.main.operations import main_intra as main_intra
    from gsvc_ref.main.operations import mode_contexts as mode_contexts
    from gsvc_ref.main.operations import model_frequencies as model_frequencies
    from gsvc_ref.main.operations import motion_of_splats as motion_of_splats
    from gsvc_ref.main.operations import splat_classes as splat_classes
    from gsvc_ref.main.operations import state_parameters as state_parameters
    from gsvc_ref.main.passes import encode_run as encode_run
    from gsvc_ref.paper import commitment as commitment
    from gsvc_ref.paper import from_half as from_half
    from gsvc_ref.paper import lsq_dequantize as lsq_dequantize
    from gsvc_ref.paper import lsq_gradients as lsq_gradients
    from gsvc_ref.paper import lsq_quantize as lsq_quantize
    from gsvc_ref.paper import reconstruct_inter as reconstruct_inter
    from gsvc_ref.paper import reconstruct_intra as reconstruct_intra
    from gsvc_ref.paper import rvq_assign as rvq_assign
    from gsvc_ref.paper import rvq_update as rvq_update
    from gsvc_ref.paper import to_half as to_half
    from gsvc_ref.rendering import exact_gradients_with_bound as exact_gradients_with_bound
    from gsvc_ref.rendering import loss as loss
    from gsvc_ref.rendering import render as render
    from gsvc_ref.rendering import render_exact_with_bound as render_exact_with_bound
    from gsvc_ref.rendering import render_frame as render_frame
    from gsvc_ref.rendering import render_gradients as render_gradients
    from gsvc_ref.rendering import render_sum as render_sum
    from gsvc_ref.rendering import render_sum_deterministic as render_sum_deterministic
    from gsvc_ref.rendering import rendering_work as rendering_work
    from gsvc_ref.rendering import to_frame as to_frame
    from gsvc_ref.rendering import to_frame_deterministic as to_frame_deterministic
    from gsvc_ref.stream import Gap as Gap
    from gsvc_ref.stream import Stream as open  # noqa: N813
    from gsvc_ref.stream import decode as decode
    from gsvc_ref.stream import decode_stream as decode_stream
    from gsvc_ref.stream import decode_stream_deterministic as decode_stream_deterministic
    from gsvc_ref.stream import read_main_stream as read_main_stream
    from gsvc_ref.stream import read_stream as read_stream
    from gsvc_ref.stream import reconstruct_layers as reconstruct_layers
    from gsvc_ref.stream import reconstruct_stream as reconstruct_stream
    from gsvc_ref.stream import seek as seek
    from gsvc_ref.training.augmentation import augment as augment
    from gsvc_ref.training.operations import adan_step as adan_step
    from gsvc_ref.training.operations import converged as converged
    from gsvc_ref.training.operations import learning_rates as learning_rates
    from gsvc_ref.training.pruning import compact as compact
    from gsvc_ref.training.pruning import prune as prune
    from gsvc_ref.training.pruning import pruning_plan as pruning_plan
    from gsvc_ref.training.weighting import weighted_gradients as weighted_gradients
    from gsvc_ref.training.weighting import weighted_parameters as weighted_parameters
    from gsvc_ref.video.color import frame_to_planes as frame_to_planes
    from gsvc_ref.video.color import planes_to_frame as planes_to_frame
    from gsvc_tools.editing import concat as concat
    from gsvc_tools.editing import cut as cut

__version__ = "0.1.0"

_HOMES: Final = {
    "Gap": "gsvc_ref.stream",
    "GsvcError": "gsvc_base.errors",
    "IncompleteEncodeError": "gsvc_ref.encoder",
    "Settings": "gsvc_ref.encoder",
    "Splats": "gsvc_base.splats",
    "UsageError": "gsvc_base.errors",
    "adan_step": "gsvc_ref.training.operations",
    "adapt_model": "gsvc_ref.main.operations",
    "augment": "gsvc_ref.training.augmentation",
    "commitment": "gsvc_ref.paper",
    "compact": "gsvc_ref.training.pruning",
    "converged": "gsvc_ref.training.operations",
    "decode": "gsvc_ref.stream",
    "decode_plane": "gsvc_ref.bitstream.planes",
    "decode_stream": "gsvc_ref.stream",
    "decode_stream_deterministic": "gsvc_ref.stream",
    "density_frequencies": "gsvc_ref.main.operations",
    "encode": "gsvc_ref.encoder",
    "encode_plane": "gsvc_ref.bitstream.rans",
    "encode_run": "gsvc_ref.main.passes",
    "exact_gradients_with_bound": "gsvc_ref.rendering",
    "frame_to_planes": "gsvc_ref.video.color",
    "from_half": "gsvc_ref.paper",
    "half_frequencies": "gsvc_ref.main.operations",
    "learning_rates": "gsvc_ref.training.operations",
    "loss": "gsvc_ref.rendering",
    "lsq_dequantize": "gsvc_ref.paper",
    "lsq_gradients": "gsvc_ref.paper",
    "lsq_quantize": "gsvc_ref.paper",
    "main_inter": "gsvc_ref.main.operations",
    "main_intra": "gsvc_ref.main.operations",
    "mode_contexts": "gsvc_ref.main.operations",
    "model_frequencies": "gsvc_ref.main.operations",
    "motion_of_splats": "gsvc_ref.main.operations",
    "open": "gsvc_ref.stream",
    "parameter_checksum": "gsvc_ref.bitstream.crc",
    "planes_to_frame": "gsvc_ref.video.color",
    "prune": "gsvc_ref.training.pruning",
    "pruning_plan": "gsvc_ref.training.pruning",
    "read_main_stream": "gsvc_ref.stream",
    "read_stream": "gsvc_ref.stream",
    "reconstruct_inter": "gsvc_ref.paper",
    "reconstruct_intra": "gsvc_ref.paper",
    "reconstruct_layers": "gsvc_ref.stream",
    "reconstruct_stream": "gsvc_ref.stream",
    "render": "gsvc_ref.rendering",
    "render_exact_with_bound": "gsvc_ref.rendering",
    "render_frame": "gsvc_ref.rendering",
    "render_gradients": "gsvc_ref.rendering",
    "render_sum": "gsvc_ref.rendering",
    "render_sum_deterministic": "gsvc_ref.rendering",
    "rendering_work": "gsvc_ref.rendering",
    "rvq_assign": "gsvc_ref.paper",
    "rvq_update": "gsvc_ref.paper",
    "scale_parameters": "gsvc_base.splats",
    "seek": "gsvc_ref.stream",
    "select_key_frames": "gsvc_ref.encoder.key_frames",
    "splat_classes": "gsvc_ref.main.operations",
    "state_parameters": "gsvc_ref.main.operations",
    "to_frame": "gsvc_ref.rendering",
    "to_frame_deterministic": "gsvc_ref.rendering",
    "to_half": "gsvc_ref.paper",
    "weighted_gradients": "gsvc_ref.training.weighting",
    "weighted_parameters": "gsvc_ref.training.weighting",
    "write": "gsvc_ref.encoder",
}
"""The module of each public name. It is loaded on first use, so that `gsvc --help` does not wait for the compiler."""

_OFFERED: Final = ("concat", "cut")
"""The names that the plug-in gsvc_tools offers (`gsvc_ref.plugins.add_names`)."""

__all__ = [
    "Gap",
    "GsvcError",
    "IncompleteEncodeError",
    "Settings",
    "Splats",
    "UsageError",
    "adan_step",
    "adapt_model",
    "augment",
    "commitment",
    "compact",
    "concat",
    "converged",
    "cut",
    "decode",
    "decode_plane",
    "decode_stream",
    "decode_stream_deterministic",
    "density_frequencies",
    "encode",
    "encode_plane",
    "encode_run",
    "exact_gradients_with_bound",
    "frame_to_planes",
    "from_half",
    "half_frequencies",
    "learning_rates",
    "loss",
    "lsq_dequantize",
    "lsq_gradients",
    "lsq_quantize",
    "main_inter",
    "main_intra",
    "mode_contexts",
    "model_frequencies",
    "motion_of_splats",
    "open",
    "parameter_checksum",
    "planes_to_frame",
    "prune",
    "pruning_plan",
    "read_main_stream",
    "read_stream",
    "reconstruct_inter",
    "reconstruct_intra",
    "reconstruct_layers",
    "reconstruct_stream",
    "render",
    "render_exact_with_bound",
    "render_frame",
    "render_gradients",
    "render_sum",
    "render_sum_deterministic",
    "rendering_work",
    "rvq_assign",
    "rvq_update",
    "scale_parameters",
    "seek",
    "select_key_frames",
    "splat_classes",
    "state_parameters",
    "to_frame",
    "to_frame_deterministic",
    "to_half",
    "weighted_gradients",
    "weighted_parameters",
    "write",
]


def __getattr__(name: str) -> Any:
    if name == "spec":
        return import_module("gsvc_base.spec")
    if name in _OFFERED:
        from gsvc_ref import plugins

        value = plugins.offered(name)
    elif name in _HOMES:
        value = getattr(import_module(_HOMES[name]), "Stream" if name == "open" else name)
    else:
        raise AttributeError(f"module 'gsvc_ref' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
