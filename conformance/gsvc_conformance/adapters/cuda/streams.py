"""Whole streams (spec.md 12.4 to 12.6, 15.12 and 15.13): the container is read by the code inside spec.md."""

from typing import Any

from gsvc_conformance import spec
from gsvc_conformance.adapters.cuda.main_profile import body_functions
from gsvc_conformance.adapters.cuda.reconstruction import (
    decode_lanes,
    parameter_checksum,
    reconstruct_inter,
    reconstruct_intra,
    rendering_work,
)


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

    own = (decode_symbols, parameter_checksum, reconstruct_inter, reconstruct_intra, rendering_work)
    functions = {function.__name__: function for function in own} | body_functions(names)
    names.update(spec.namespace(functions=functions))
    return names


OPERATIONS = stream_functions()
