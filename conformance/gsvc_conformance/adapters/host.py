"""The host's half of a decoder whose other half runs on an accelerator.

Parsing is sequential and full of decisions, so a GPU decoder does it on the CPU. Here the parser inside spec.md does,
and calls the back end for everything that is arithmetic on many elements.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from gsvc_conformance import spec

Operations = dict[str, Callable[..., dict[str, Any]]]

LaneDecoder = Callable[[int, Sequence[int], int, Sequence[int], Sequence[int]], tuple[Any, list[int], int]]
"""(count, frequencies, precision, states, words) to symbols u2 (count,), final states, and how many words it takes."""

STREAM_OPERATIONS: Final = ("reconstruct_stream", "decode_stream", "decode_stream_deterministic")
"""The operations of spec.md that call the back end."""

PLANE_OPERATIONS: Final = ("read_stream", "decode_plane")
"""The further operations of spec.md that decode planes."""


def stream_operations(
    back_end: Mapping[str, Callable[..., Any]], decode_lanes: LaneDecoder | None = None
) -> Operations:
    """The operations of whole streams, by name, with functions of a back end in the place of spec.md's own.

    Parameters
    ----------
    back_end
        By the names of spec.md: ``reconstruct_intra`` and ``reconstruct_inter``, and for pictures ``render_frame``,
        ``render_sum_deterministic`` and ``to_frame_deterministic``; they take keyword or positional arguments in the
        order of spec.md and return dicts, as the operations of these names do.
    decode_lanes
        The function that decodes the symbols of coded planes (7-1); with it come the operations ``read_stream`` and
        ``decode_plane``. Where words are missing it may take any number for them.
    """
    if decode_lanes is None:
        names = spec.namespace(functions=back_end)
        return {name: names[name] for name in STREAM_OPERATIONS}

    def decode_symbols(
        count: int, frequencies: list[int], precision: int, states: list[int], words: list[int], word_bit: int
    ) -> tuple[Any, int]:
        symbols, states[:], needed = decode_lanes(count, frequencies, precision, states, words)
        if needed > len(words):
            raise names["Fault"]("R-7-1", word_bit)
        return symbols, needed

    names = spec.namespace(functions={**back_end, "decode_symbols": decode_symbols})
    return {name: names[name] for name in (*STREAM_OPERATIONS, *PLANE_OPERATIONS)}
