"""Whole streams: spec.md's parser on the host, PyTorch after it."""

from gsvc_conformance.adapters import host
from gsvc_conformance.adapters.pytorch.deterministic import render_sum_deterministic, to_frame_deterministic
from gsvc_conformance.adapters.pytorch.device import Arrays
from gsvc_conformance.adapters.pytorch.main_profile import state_parameters
from gsvc_conformance.adapters.pytorch.reconstruction import (
    parameter_checksum,
    reconstruct_inter,
    reconstruct_intra,
    rendering_work,
)
from gsvc_conformance.adapters.pytorch.rendering import render_frame

_OPERATIONS = host.stream_operations(
    {
        "reconstruct_intra": reconstruct_intra,
        "reconstruct_inter": reconstruct_inter,
        "state_parameters": state_parameters,
        "parameter_checksum": parameter_checksum,
        "rendering_work": rendering_work,
        "render_frame": render_frame,
        "render_sum_deterministic": render_sum_deterministic,
        "to_frame_deterministic": to_frame_deterministic,
    }
)


def reconstruct_stream(stream: bytes) -> Arrays:
    """Operation: the splats of all complete frames, and what is wrong with the stream."""
    return _OPERATIONS["reconstruct_stream"](stream)


def decode_layers(stream: bytes, layer: int) -> Arrays:
    """Operation: the frames in the quality of a layer, in `bounded` rendering."""
    return _OPERATIONS["decode_layers"](stream, layer)


def decode_stream(stream: bytes) -> Arrays:
    """Operation: the frames, in `bounded` rendering."""
    return _OPERATIONS["decode_stream"](stream)


def decode_stream_deterministic(stream: bytes) -> Arrays:
    """Operation: the frames, in `deterministic` rendering."""
    return _OPERATIONS["decode_stream_deterministic"](stream)
