"""When the frames of a file are shown, found by hopping from chunk to chunk: no frame is decoded for it."""

from typing import Final

from gsvc_base.errors import GsvcError
from gsvc_ref.bitstream import chunks
from gsvc_ref.bitstream.times import TIMES, FrameTimes
from gsvc_ref.stream.chunk_decoder import ChunkDecoder
from gsvc_ref.stream.formats import video_format
from gsvc_ref.stream.seeking import hop_over_window

BEYOND: Final = 1 << 40
"""The number of a frame that no stream has."""


def no_times(decoder: ChunkDecoder) -> FrameTimes:
    """Times of frames of which no chunk `t` tells anything yet."""
    return FrameTimes(video_format(decoder.header).frame_rate)


def find_times(decoder: ChunkDecoder) -> FrameTimes:
    """What the chunks `t` of a file say, up to its end or to the first fault of a chunk (spec.md section 6.11)."""
    found = no_times(decoder)
    here = decoder.first
    try:
        while True:
            _, after = hop_over_window(decoder, here, BEYOND, stop_at=ord(TIMES))
            if after.offset == here.offset:
                chunk_type, after = decoder.hop(here)
                if chunk_type == chunks.END_TYPE:
                    return found
                if chunk_type == ord(TIMES):
                    _, p = decoder.chunk_at(here.offset)
                    found.add(p.raw("payload", p.bytes_left), here.next_number)
            here = after
    except GsvcError:
        return found
