"""Finding the I-frame that a frame is decoded from, by hopping from chunk to chunk (spec.md section 12.6).

The index is not read (R-6.7-3): hopping is fast enough, and cannot be deceived. In a stream of 100,000 frames (30 MB,
an I-frame every 100) frame 99,900 comes after 30 ms; looked up in the index it came after 1.3 ms. To measure it:
python -m timeit -s "import gsvc_ref; s = gsvc_ref.open('long.gsvc')" "next(s.frames(99900))"
"""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.errors import GsvcError
from gsvc_ref._jit import kernel
from gsvc_ref.bitstream import chunks
from gsvc_ref.stream.chunk_decoder import CRC_SIZE, ChunkDecoder, Place
from gsvc_ref.stream.whole_chunks import payload_end

SEARCH_SIZE: Final = 1 << 16
"""Bytes that are read at once in search of the heads of chunks."""


def read_end(decoder: ChunkDecoder) -> int | None:
    """`frame_count` of the end chunk, if the last bytes of a seekable source are one."""
    size = decoder.source.size
    if size is None or size < decoder.first.offset + chunks.END_CHUNK_SIZE:
        return None
    try:
        chunk_type, p = decoder.chunk_at(size - chunks.END_CHUNK_SIZE)
        return chunks.end(p)[0] if chunk_type == chunks.END_TYPE else None
    except GsvcError:
        return None


def find_frame(decoder: ChunkDecoder, number: int) -> Place:
    """The last I-frame at or before frame `number`, or the end chunk if there are fewer frames (R-12.6-6).

    Its state is that of a decoder which has read nothing but the sequence header (R-12.6-4). Frame 0, and any frame of
    a pipe, is decoded from the start (R-12.6-3). A chunk before it that breaks a rule which a hop checks raises a
    GsvcError (R-12.6-1, R-12.6-7).
    """
    place = here = decoder.first
    if number == 0 or not decoder.source.seekable:
        return place
    while here.next_number <= number:
        i_frame, after = hop_over_window(decoder, here, number)
        if after.offset == here.offset:  # anything but frames and ancillary chunks, or a fault
            chunk_type, after = decoder.hop(here)
            if chunk_type == chunks.END_TYPE:
                return here
            i_frame = here if chunk_type == chunks.I_TYPE else None
        if i_frame is not None:
            place = replace(i_frame, index_length=0, pace=None)  # the sums of a second are not known
        here = after  # frames up to `number` may lie in the next window
    return place


def find_whole_frame(decoder: ChunkDecoder, number: int) -> Place:
    """The place that `find_frame` finds in a damaged file if a whole I-frame of its number is there, else the first."""
    try:
        place = find_frame(decoder, number)
        chunk_type, p = decoder.chunk_at(place.offset)
        if chunk_type == chunks.I_TYPE and p.uv("frame_number") == place.next_number:
            return place
    except GsvcError:
        pass
    return decoder.first


def hop_over_window(decoder: ChunkDecoder, here: Place, number: int, *, stop_at: int = 0) -> tuple[Place | None, Place]:
    """The last I-frame in a window, and the place after all chunks whose heads are in it, or after frame `number`.

    The place is in front of the first ancillary chunk of the type `stop_at`, if there is one.
    """
    source = decoder.source
    with source.lock:
        source.seek(here.offset)
        rest = source.current_size() - here.offset
        data = np.frombuffer(source.read(SEARCH_SIZE), np.uint8)
    at, next_number, index_length, i_at, i_number = _hop(
        data, rest, decoder.header.limits.payload, here.next_number, number, stop_at
    )
    i_frame = replace(here, offset=here.offset + i_at, next_number=i_number) if i_at >= 0 else None
    return i_frame, replace(here, offset=here.offset + at, next_number=next_number, index_length=index_length)


@kernel()
def _hop(
    data: NDArray[np.uint8], rest: int, longest: int, next_number: int, number: int, stop_at: int
) -> tuple[int, int, int, int, int]:
    """Hop over ancillary chunks and frames `next_number` to `number`, or up to the first other chunk.

    `data` begins with a chunk, and the source has `rest` bytes from there; `longest` is the most of a payload.
    `stop_at` is a type of ancillary chunks that are not hopped over; 0: none. Returns offset in `data` and number of
    what comes next, and the bytes of the chunk before it if that is an index, else 0; offset and number of the last
    I-frame, with offset -1 if there was none.
    """
    at, index_length, i_at, i_number = 0, 0, -1, 0
    while next_number <= number and at < len(data):
        chunk_type = data[at]
        predicted = chunk_type in (chunks.P_TYPE, chunks.R_TYPE)
        ancillary = 0x61 <= chunk_type <= 0x7A and chunk_type != stop_at
        end = payload_end(data, at, longest)
        if end < 0 or end + CRC_SIZE > rest or not (predicted or ancillary or chunk_type == chunks.I_TYPE):
            break
        if predicted and next_number == 0:  # R-6.4-2
            break
        if chunk_type == chunks.I_TYPE:
            i_at, i_number = at, next_number
        next_number += not ancillary  # R-12.6-2
        index_length = end + CRC_SIZE - at if chunk_type == chunks.INDEX_TYPE else 0
        at = end + CRC_SIZE
    return at, next_number, index_length, i_at, i_number
