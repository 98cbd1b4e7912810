"""Finding an I-frame: through the index, or hopping from chunk to chunk (spec.md sections 4 and 6.7)."""

from dataclasses import replace

import numpy as np

from gsvc_ref.arrays import I8
from gsvc_ref.bitstream import chunks
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.errors import GsvcError
from gsvc_ref.stream.chunk_decoder import ChunkDecoder, Place
from gsvc_ref.stream.source import SourceReader

I_TYPE = ord("I")


def find_frame(decoder: ChunkDecoder, number: int) -> Place:
    """A place at or before frame `number` from which it can be decoded."""
    if number == 0 or not decoder.source.seekable:
        return decoder.first
    return find_by_index(decoder, number) or find_by_hopping(decoder, number)


def read_end(decoder: ChunkDecoder) -> tuple[int, int] | None:
    """`frame_count` and `index_length`, if the last bytes of a seekable source are an end chunk."""
    size = decoder.source.size
    if size is None or size < decoder.first.offset + chunks.END_CHUNK_SIZE:
        return None
    try:
        chunk_type, p = decoder.chunk_at(size - chunks.END_CHUNK_SIZE)
        return chunks.end(p) if chunk_type == chunks.END_TYPE else None
    except GsvcError:
        return None


def find_by_index(decoder: ChunkDecoder, number: int) -> Place | None:
    """The last I-frame at or before a frame that the index names; None without an index that is right."""
    ending, size = read_end(decoder), decoder.source.size
    if ending is None or size is None:
        return None
    index_offset = size - chunks.END_CHUNK_SIZE - ending[1]
    if not decoder.first.offset <= index_offset < size - chunks.END_CHUNK_SIZE:
        return None
    try:
        chunk_type, p = decoder.chunk_at(index_offset)
        if chunk_type != chunks.INDEX_TYPE:
            return None
        frame_number, offset = last_entry(p, index_offset, number)
        if offset < decoder.first.offset:
            return None
        chunk_type, p = decoder.chunk_at(offset)
        if chunk_type != I_TYPE or p.uv("frame_number") != frame_number:
            return None
    except GsvcError:
        return None
    return replace(decoder.first, offset=offset, next_number=frame_number)


def last_entry(p: Reader, index_offset: int, number: int) -> tuple[int, int]:
    """Frame number and offset of the last I-frame at or before a frame that an index names; an offset of -1 if none."""
    found = 0, -1

    def look(entries: I8) -> None:
        nonlocal found
        before = int(np.searchsorted(entries[:, 0], number, side="right"))
        if before > 0:
            found = int(entries[before - 1, 0]), int(entries[before - 1, 1])

    chunks.index(p, index_offset, visit=look)
    return found


def find_by_hopping(decoder: ChunkDecoder, number: int) -> Place:
    """The last I-frame at or before a frame, found from the heads of the chunks.

    A fault on the way ends the search: decoding from the I-frame before it will come to the fault and report it.
    """
    place, next_number, offset = decoder.first, 0, decoder.first.offset
    try:
        while next_number <= number:
            with decoder.source.lock:
                decoder.source.seek(offset)
                s = SourceReader(decoder.source)
                chunk_type, chunk_length = chunks.chunk_head(s, decoder.longest_payload)
            chunks.check_known(s, chunk_type)
            if chunk_type in (chunks.HEADER_TYPE, chunks.END_TYPE):
                break
            if chunk_type == I_TYPE:
                place = replace(decoder.first, offset=offset, next_number=next_number)
            next_number += chunk_type in chunks.FRAMES
            offset = (s.position + chunks.CRC_BITS) // 8 + chunk_length
    except GsvcError:
        pass
    return place
