"""WebGPU from Python: all arithmetic in WGSL, which wgpu-py runs on Vulkan, Metal or Direct3D 12.

    gsvc-conformance run --module gsvc_conformance.adapters.webgpu

needs wgpu (pip install 'gsvc-conformance[adapters]') and a driver: that of a GPU, or Mesa's lavapipe for CPUs
(mesa-vulkan-drivers in Debian). WGPUPY_WGPU_ADAPTER_NAME chooses a device by a part of its name; without it, it is the
fastest.

It has a whole decoder (entropy coding, reconstruction, bounded and deterministic rendering), the entropy encoder, and
gradients; the shader of bounded rendering is that of the browser page, ../web/render.wgsl.js. Streams are parsed by
the code inside spec.md. Missing are the rest of training and quantisation, colour, metrics, and what a decoder asks of
a frame on the host before it renders it: its checksum and its rendering work.

Of profile `main` it has every operation. A frame is one submission: the host hands over the elements of the body, the
run, and reads back what R-15.6-2 asks for; passes, raw values, models and states stay on the device. The
docstring of `gsvc_conformance.adapters.main_frames` maps the passes of spec.md 15.1 to dispatches; main_passes.wgsl
has the lanes.
"""

from collections.abc import Callable
from typing import Final

import numpy as np
import wgpu

from gsvc_conformance.adapters.host import stream_operations
from gsvc_conformance.adapters.webgpu import reconstruction, rendering, training
from gsvc_conformance.adapters.webgpu.entropy import decode_symbols, encode_symbols
from gsvc_conformance.adapters.webgpu.gpu import Array, device
from gsvc_conformance.adapters.webgpu.main_profile import MAIN

Outputs = dict[str, Array]


def environment() -> dict[str, str]:
    """The device that the operations run on; Metal, for one, does not name its driver."""
    info = device().adapter.info
    told = {
        "device": info["device"],
        "driver": info["description"],
        "back end": f"{info['backend_type']} ({info['adapter_type']})",
        "wgpu": wgpu.__version__,
    }
    return {name: text for name, text in told.items() if text}


def encode_plane(symbols: Array, frequencies: Array, entropy_precision: int, lane_count: int) -> Outputs:
    """The states u4 (lanes,) and words u2 (n,) of a plane's symbols: (7-2)."""
    lane_states, words = encode_symbols(symbols, frequencies, entropy_precision, lane_count)
    return {"lane_states": lane_states, "words": words}


def from_half(bits: Array) -> Outputs:
    """The values of binary16 patterns, f4 (N,): (8-5)."""
    return {"values": reconstruction.each_value("from_halves", bits).view(np.float32)}


def to_half(values: Array) -> Outputs:
    """The binary16 patterns nearest to values, u2 (N,): (8-6)."""
    return {"bits": reconstruction.each_value("to_halves", values).astype(np.uint16)}


def lsq_dequantize(codes: Array, scale: Array, offset: Array) -> Outputs:
    """The values of LSQ+ codes, f4 (N, C): (10-17)."""
    quantizers = np.stack([scale, offset], axis=1)
    return {"values": reconstruction.each_value("dequantize", codes, quantizers=quantizers).view(np.float32)}


def reconstruct_intra(width: int, height: int, positions: Array, **codes: Array) -> Outputs:
    """The splats of an intra block, f4 (N, 8): the left column of (8-1) to (8-4)."""
    return {"parameters": reconstruction.block("intra", (width, height), len(positions), positions, **codes)}


def reconstruct_inter(width: int, height: int, reference: Array, survivors: Array, **codes: Array) -> Outputs:
    """The survivors after an inter block, f4 (n, 8): the right column of (8-1) to (8-4)."""
    numbers = np.flatnonzero(survivors)
    size, count = (width, height), len(numbers)
    parameters = reconstruction.block("inter", size, count, reference=reference, survivors=numbers, **codes)
    return {"parameters": parameters}


def render_sum(parameters: Array, width: int, height: int) -> Outputs:
    """The sum of the splats over a frame, f4 (H, W, 3): (9-2)."""
    return {"sum": rendering.read_sums(rendering.rendered(parameters, width, height)).reshape(height, width, 3)}


def render_sum_deterministic(parameters: Array, width: int, height: int) -> Outputs:
    """The sum by the operations of (9-3) to (9-6), f4 (H, W, 3): the same bytes everywhere."""
    bands = rendering.rendered(parameters, width, height, exact=True)
    return {"sum": rendering.read_sums(bands).reshape(height, width, 3)}


def to_frame(sum: Array, bit_depth: int) -> Outputs:
    """The samples of a sum, u1 or u2 (H, W, 3): R-9.1-1."""
    return {"frame": rendering.read_frame(rendering.uploaded(sum, bit_depth), bit_depth).reshape(sum.shape)}


def to_frame_deterministic(sum: Array, bit_depth: int) -> Outputs:
    """The samples of a sum, u1 or u2 (H, W, 3): (9-7)."""
    return {"frame": rendering.read_frame(rendering.uploaded(sum, bit_depth), bit_depth, exact=True).reshape(sum.shape)}


def render_frame(parameters: Array, width: int, height: int, bit_depth: int) -> Outputs:
    """The frame of splats, u1 or u2 (H, W, 3): R-9.1-1 of (9-2); the sums stay on the device."""
    bands = rendering.rendered(parameters, width, height, bit_depth)
    return {"frame": rendering.read_frame(bands, bit_depth).reshape(height, width, 3)}


def scale_parameters(parameters: Array, width: int, height: int, new_width: int, new_height: int) -> Outputs:
    """The splats for a frame of another size, f4 (N, 8): (9-8)."""
    sizes = (width, height, new_width, new_height)
    return {"parameters": reconstruction.each_value("scale", parameters, sizes).view(np.float32)}


def scale_parameters_filtered(parameters: Array, width: int, height: int, new_width: int, new_height: int) -> Outputs:
    """The splats for a smaller frame, filtered by the area of its pixels, f4 (N, 8): (9-9)."""
    sizes = (width, height, new_width, new_height)
    return {"parameters": reconstruction.each_value("filtered", parameters, sizes).view(np.float32)}


def render_gradients(parameters: Array, residual: Array) -> Outputs:
    """dL/dparameters, f4 (N, 8), of the residual dL/dC: (10-7) to (10-9)."""
    return {"gradients": training.gradients(parameters, residual)}


_BACK_END: Final[dict[str, Callable[..., Outputs]]] = {
    "reconstruct_intra": reconstruct_intra,
    "reconstruct_inter": reconstruct_inter,
    "render_frame": render_frame,
    "render_sum_deterministic": render_sum_deterministic,
    "to_frame_deterministic": to_frame_deterministic,
}
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

_STREAMS: Final = stream_operations(_BACK_END, decode_symbols, MAIN)
read_stream = _STREAMS["read_stream"]
decode_plane = _STREAMS["decode_plane"]
reconstruct_stream = _STREAMS["reconstruct_stream"]
decode_stream = _STREAMS["decode_stream"]
decode_stream_deterministic = _STREAMS["decode_stream_deterministic"]
read_main_stream = _STREAMS["read_main_stream"]
decode_layers = _STREAMS["decode_layers"]
reconstruct_layers = _STREAMS["reconstruct_layers"]
