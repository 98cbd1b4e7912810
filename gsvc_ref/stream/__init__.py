"""Streams, bytes in and frames out and back (spec.md sections 6 and 12).

`Stream` and `decode` give pictures. Below them, `StreamReader` gives the parameters of one frame after another, from
files and pipes (`source`), from any frame on (`seeking`) and from what damage has left (`salvage`); `StreamWriter`
writes them. `whole_streams` has a stream's codes, splats and frames as arrays.
"""

from gsvc_ref.stream.decode import Stream, decode, scaled_size
from gsvc_ref.stream.decoded import DecodedFrame, FrameSummary, Gap, StreamSummary
from gsvc_ref.stream.formats import video_format
from gsvc_ref.stream.reader import StreamReader
from gsvc_ref.stream.whole_streams import decode_stream, decode_stream_deterministic, read_stream, reconstruct_stream
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
    "read_stream",
    "reconstruct_stream",
    "scaled_size",
    "video_format",
]
