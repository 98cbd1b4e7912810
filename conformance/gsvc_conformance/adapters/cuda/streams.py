"""Whole streams (spec.md 12.4 to 12.6, 15.12 and 15.13): the container is read by the code inside spec.md."""

from typing import Any, Final

import numpy as np

from gsvc_conformance import spec
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


def stream_functions() -> dict[str, Any]:
    """The names of the code of spec.md, with functions of the device in the place of its own."""
    names: dict[str, Any] = {}

    def decode_symbols(
        count: int, frequencies: list[int], precision: int, states: list[int], words: list[int], word_bit: int
    ) -> tuple[Any, int]:
        symbols, states[:], needed = decode_lanes(count, frequencies, precision, states, words)
        if needed > len(words):
            raise names["Fault"]("R-7-1", word_bit)
        return symbols, needed

    own = (
        decode_symbols, parameter_checksum, reconstruct_inter, reconstruct_intra, rendering_work, render_frame,
        render_sum_deterministic, to_frame_deterministic,
    )  # fmt: skip
    functions = {function.__name__: function for function in own} | body_functions(names)
    names.update(spec.namespace(functions=functions))
    return names


NAMES: Final = stream_functions()


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
        values: Values = NAMES[operation](stream)
        return values
    return {"frames": np.stack([picture.samples() for picture in decoder.pictures()])}
