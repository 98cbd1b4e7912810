"""Whole streams (spec.md 12.4 to 12.6, 15.12 and 15.13): the code inside spec.md reads the container.

`decode_stream` and `decode_stream_deterministic` of profile `main` go through `Decoder`, which does not wait; all other
operations ask the device frame by frame.
"""

from typing import Final

import numpy as np

from gsvc_conformance.adapters.cuda.decoder import Decoder
from gsvc_conformance.adapters.cuda.device import Array, Values
from gsvc_conformance.adapters.cuda.main_profile import body_functions
from gsvc_conformance.adapters.cuda.reconstruction import (
    decode_lanes,
    parameter_checksum,
    reconstruct_inter,
    reconstruct_intra,
    rendering_work,
)
from gsvc_conformance.adapters.cuda.rendering import render_frame, render_sum_deterministic, to_frame_deterministic
from gsvc_conformance.adapters.host import Operations, stream_operations

_BACK_END: Final = (
    parameter_checksum,
    reconstruct_inter,
    reconstruct_intra,
    render_frame,
    render_sum_deterministic,
    rendering_work,
    to_frame_deterministic,
)
STREAMS: Final[Operations] = stream_operations(
    {function.__name__: function for function in _BACK_END}, decode_lanes, main_reader=body_functions
)


def decode_stream(stream: Array) -> Values:
    """The frames of a stream, (T, H, W, 3) u1 or u2: R-13-4."""
    return _decoded("decode_stream", stream, exact=False)


def decode_stream_deterministic(stream: Array) -> Values:
    """The frames of a stream, (T, H, W, 3) u1 or u2, by the operations of 9.3."""
    return _decoded("decode_stream_deterministic", stream, exact=True)


def _decoded(operation: str, stream: Array, exact: bool) -> Values:
    try:
        decoder = Decoder(bytes(stream), exact=exact)
    except ValueError:  # of profile paper
        return STREAMS[operation](stream)
    return {"frames": np.stack([picture.samples() for picture in decoder.pictures()])}
