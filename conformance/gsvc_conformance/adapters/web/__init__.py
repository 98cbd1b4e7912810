"""A decoder in JavaScript, with rendering in WebGPU or WebGL2, judged inside a headless Chromium.

The page for people, viewer/index.html, has the same scripts. Judge them with `gsvc-conformance run --module
gsvc_conformance.adapters.web`, which needs Playwright (`pip install playwright`) and a Chromium: that of `playwright
install chromium`, one in PATH, or the one that GSVC_WEB_BROWSER names. GSVC_WEB_RENDERER is `webgpu`, `webgl2` or
`auto` (the default). GSVC_WEB_ARGUMENTS takes the place of the arguments that let Chromium draw without a GPU, for
machines that have one.

It is a decoder: bitstream, reconstruction, rendering and deterministic rendering, nothing of training. The functions
below only carry arrays to the page and back; GSVC.operations of operations.js has what they call.
"""

from importlib.metadata import version
from typing import Any

from gsvc_conformance.adapters.web.browser import ask, described

Values = dict[str, Any]


def environment() -> dict[str, str]:
    """The browser, the renderer, its adapter, and the version of Playwright."""
    return {**described(), "playwright": version("playwright")}


def read_stream(stream: bytes) -> Values:
    """The contents of a stream's bytes (spec.md section 12.4)."""
    return ask("read_stream", stream=stream)


def decode_plane(data: Any, count: int, alphabet: int, entropy_precision: int, lane_count: int) -> Values:
    """The symbols of one plane (sections 6.6 and 7)."""
    return ask(
        "decode_plane",
        data=data,
        count=count,
        alphabet=alphabet,
        entropy_precision=entropy_precision,
        lane_count=lane_count,
    )


def encode_plane(symbols: Any, frequencies: Any, entropy_precision: int, lane_count: int) -> Values:
    """Lane states and words of symbols (7-2)."""
    return ask(
        "encode_plane",
        symbols=symbols,
        frequencies=frequencies,
        entropy_precision=entropy_precision,
        lane_count=lane_count,
    )


def reconstruct_stream(stream: bytes) -> Values:
    """The splats of all complete frames, and the first fault (section 12)."""
    return ask("reconstruct_stream", stream=stream)


def seek(stream: bytes, first: int, last: int) -> Values:
    """The splats of some frames, decoded from the last I-frame at or before them (section 12.6)."""
    return ask("seek", stream=stream, first=first, last=last)


def decode_stream(stream: bytes) -> Values:
    """The frames of a stream, drawn by the GPU."""
    return ask("decode_stream", stream=stream)


def decode_stream_deterministic(stream: bytes) -> Values:
    """The frames of a stream by section 9.3, in JavaScript."""
    return ask("decode_stream_deterministic", stream=stream)


def from_half(bits: Any) -> Values:
    """The values of binary16 patterns (8-5)."""
    return ask("from_half", bits=bits)


def to_half(values: Any) -> Values:
    """The binary16 patterns nearest to values (8-6)."""
    return ask("to_half", values=values)


def reconstruct_intra(**codes: Any) -> Values:
    """The splats of an intra block (8-1) to (8-4)."""
    return ask("reconstruct_intra", **codes)


def reconstruct_inter(**codes: Any) -> Values:
    """The survivors after an inter block (8-1) to (8-4)."""
    return ask("reconstruct_inter", **codes)


def parameter_checksum(parameters: Any) -> Values:
    """The checksum of a frame's parameters (R-6.4-3)."""
    return ask("parameter_checksum", parameters=parameters)


def rendering_work(parameters: Any, width: int, height: int) -> Values:
    """The number of pixels in the boxes of splats (5-1)."""
    return ask("rendering_work", parameters=parameters, width=width, height=height)


def render_sum(parameters: Any, width: int, height: int) -> Values:
    """The sum of splats (9-2), by the GPU."""
    return ask("render_sum", parameters=parameters, width=width, height=height)


def render_sum_deterministic(parameters: Any, width: int, height: int) -> Values:
    """The sum of splats (9-6), in JavaScript."""
    return ask("render_sum_deterministic", parameters=parameters, width=width, height=height)


def to_frame(sum: Any, bit_depth: int) -> Values:
    """Clamp, scale and round (R-9.1-1)."""
    return ask("to_frame", sum=sum, bit_depth=bit_depth)


def to_frame_deterministic(sum: Any, bit_depth: int) -> Values:
    """Clamp, scale and round (9-7)."""
    return ask("to_frame_deterministic", sum=sum, bit_depth=bit_depth)


def render_frame(parameters: Any, width: int, height: int, bit_depth: int) -> Values:
    """The frame of a set of splats, by the GPU."""
    return ask("render_frame", parameters=parameters, width=width, height=height, bit_depth=bit_depth)


def read_main_stream(stream: bytes) -> Values:
    """The contents of a stream of profile `main` (section 15.12)."""
    return ask("read_main_stream", stream=stream)


def decode_layers(stream: bytes, layer: int) -> Values:
    """The frames in the quality of a layer (section 15.13)."""
    return ask("decode_layers", stream=stream, layer=layer)


def reconstruct_layers(stream: bytes, layer: int) -> Values:
    """The splats of all complete frames in the quality of a layer, and the first fault (section 15.13)."""
    return ask("reconstruct_layers", stream=stream, layer=layer)


def encode_run(**inputs: Any) -> Values:
    """Lane states, words and raw bits of the symbols and raw values of a frame (R-15.6-3)."""
    return ask("encode_run", **inputs)


def density_frequencies(edges: Any, centre: int, density_family: int, scale_code: int, unit_bits: int) -> Values:
    """Cumulative frequencies of the bins of a density (15-6)."""
    return ask(
        "density_frequencies",
        edges=edges,
        centre=centre,
        density_family=density_family,
        scale_code=scale_code,
        unit_bits=unit_bits,
    )


def window_frequencies(centre: int, step: int, density_family: int, scale_code: int) -> Values:
    """The window of a plane of shapes (15-7): cumulative frequencies, first bin and low bits."""
    return ask("window_frequencies", centre=centre, step=step, density_family=density_family, scale_code=scale_code)


def codes_of_classes(**inputs: Any) -> Values:
    """Codes of classes of magnitudes, low bits and signs (section 15.7)."""
    return ask("codes_of_classes", **inputs)


def cells_of_halves(**inputs: Any) -> Values:
    """The cells of splats by the numbers in first halves (section 15.8)."""
    return ask("cells_of_halves", **inputs)


def field_vectors(differences: Any) -> Values:
    """The vectors of a motion field by their differences (section 15.10)."""
    return ask("field_vectors", differences=differences)


def half_frequencies(count: int, first_half: int, second_half: int, alpha: int) -> Values:
    """Cumulative frequencies of the splats in the first half of a part (15-8), (15-9)."""
    return ask("half_frequencies", count=count, first_half=first_half, second_half=second_half, alpha=alpha)


def model_frequencies(counts: Any) -> Values:
    """Cumulative frequencies of each context of a model (15-14)."""
    return ask("model_frequencies", counts=counts)


def adapt_model(counts: Any, seen: Any) -> Values:
    """The counts of a model after a P-frame (15-11)."""
    return ask("adapt_model", counts=counts, seen=seen)


def mode_contexts(**inputs: Any) -> Values:
    """The context of the mode of each splat of a P-frame (section 15.11)."""
    return ask("mode_contexts", **inputs)


def splat_classes(state: Any, quantizer: int) -> Values:
    """The class of each splat (15-4)."""
    return ask("splat_classes", state=state, quantizer=quantizer)


def main_intra(**codes: Any) -> Values:
    """The states that the codes of an I-frame stand for (15-10)."""
    return ask("main_intra", **codes)


def motion_of_splats(state: Any, vectors: Any, motion_cell: int) -> Values:
    """By how much each splat moves with the motion field (15-12)."""
    return ask("motion_of_splats", state=state, vectors=vectors, motion_cell=motion_cell)


def main_inter(**codes: Any) -> Values:
    """The states of the splats that stay, after motion and differences (15-13)."""
    return ask("main_inter", **codes)


def state_parameters(state: Any) -> Values:
    """The parameters of splats (15-5)."""
    return ask("state_parameters", state=state)


def main_work(**inputs: Any) -> Values:
    """The rendering work of splats by their states (5-2)."""
    return ask("main_work", **inputs)


def scale_parameters(parameters: Any, width: int, height: int, new_width: int, new_height: int) -> Values:
    """The splats for another size (9-8)."""
    return ask(
        "scale_parameters",
        parameters=parameters,
        width=width,
        height=height,
        new_width=new_width,
        new_height=new_height,
    )


def scale_parameters_filtered(parameters: Any, width: int, height: int, new_width: int, new_height: int) -> Values:
    """The splats for another size, filtered where it is smaller (9-9)."""
    return ask(
        "scale_parameters_filtered",
        parameters=parameters,
        width=width,
        height=height,
        new_width=new_width,
        new_height=new_height,
    )
