"""Streams: bytes in and frames out, and back (spec.md sections 6 and 12).

In reading order: `source` has the bytes of a file or a pipe, `chunk_decoder` decodes one chunk after the other, and
`reader` leads it through a stream, with `seeking` from any frame on, with `salvage` through what damage has left, whose
`whole_chunks` it finds. The results are in `decoded`. `decoder` renders pictures of them, with the video's format from
`formats`, and `whole_streams` gives all codes, splats or frames of a stream at once. `writer` is the way back.
"""

from typing import TYPE_CHECKING, Final

from gsvc_ref._lazy import lazily

if TYPE_CHECKING:
    from gsvc_ref.stream.decoded import DecodedFrame, FrameSummary, Gap, StreamSummary
    from gsvc_ref.stream.decoder import Stream, decode, scaled_size
    from gsvc_ref.stream.formats import video_format
    from gsvc_ref.stream.reader import StreamReader
    from gsvc_ref.stream.whole_streams import (
        decode_stream,
        decode_stream_deterministic,
        read_main_stream,
        read_stream,
        reconstruct_layers,
        reconstruct_stream,
        seek,
    )
    from gsvc_ref.stream.writer import StreamWriter

__all__ = [
    "DecodedFrame",
    "FrameSummary",
    "Gap",
    "Stream",
    "StreamReader",
    "StreamSummary",
    "StreamWriter",
    "decode",
    "decode_stream",
    "decode_stream_deterministic",
    "read_main_stream",
    "read_stream",
    "reconstruct_layers",
    "reconstruct_stream",
    "scaled_size",
    "seek",
    "video_format",
]

_HOMES: Final = {
    "DecodedFrame": "decoded",
    "FrameSummary": "decoded",
    "Gap": "decoded",
    "Stream": "decoder",
    "StreamReader": "reader",
    "StreamSummary": "decoded",
    "StreamWriter": "writer",
    "decode": "decoder",
    "decode_stream": "whole_streams",
    "decode_stream_deterministic": "whole_streams",
    "read_main_stream": "whole_streams",
    "read_stream": "whole_streams",
    "reconstruct_layers": "whole_streams",
    "reconstruct_stream": "whole_streams",
    "scaled_size": "decoder",
    "seek": "whole_streams",
    "video_format": "formats",
}
"""The module of each name."""

__getattr__, __dir__ = lazily(__name__, _HOMES)
