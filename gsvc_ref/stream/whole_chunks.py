"""Finding whole chunks in a damaged file, in time that grows with its size, not with what its bytes claim."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref._jit import kernel
from gsvc_ref.bitstream.chunks import HEADER_TYPE
from gsvc_ref.bitstream.crc import ZERO_TABLES, crc32c_of_part, registers
from gsvc_ref.bitstream.header import LONGEST_HEADER
from gsvc_ref.stream.chunk_decoder import CRC_SIZE
from gsvc_ref.stream.source import READ_AT_ONCE, Source

LONGEST_FRAME: Final = 1 + 5 + CRC_SIZE
"""Maximum number of bytes of a chunk around its payload."""


@kernel()
def payload_end(data: NDArray[np.uint8], at: int, longest: int) -> int:
    """Where the payload of the chunk at `at` ends, be it beyond `data`; -1 without a letter and a legal length."""
    letter = data[at] | 0x20
    if letter < 0x61 or letter > 0x7A:
        return -1
    length = 0
    shift, body = 0, at + 1
    while body < len(data) and data[body] >= 0x80 and shift < 28:
        length |= int(data[body] & 0x7F) << shift
        shift += 7
        body += 1
    if body >= len(data) or data[body] >= 0x80 or (data[body] == 0 and shift > 0):  # R-3.1-1
        return -1
    length |= int(data[body]) << shift
    if length > (LONGEST_HEADER if data[at] == HEADER_TYPE else longest):
        return -1
    return body + 1 + length


@kernel()
def _first_whole(
    data: NDArray[np.uint8],
    kept: NDArray[np.uint32],
    zero_tables: NDArray[np.uint32],
    first: int,
    stop: int,
    longest: int,
) -> tuple[int, int]:
    """Offset and size of the first whole chunk that begins in first..stop-1; -1 and 0 if there is none."""
    for at in range(first, stop):
        end = payload_end(data, at, longest)
        if end < 0 or end + CRC_SIZE > len(data):  # most bytes fail by type or length, at no cost
            continue
        stated = 0
        for byte in range(CRC_SIZE):
            stated |= int(data[end + byte]) << (8 * byte)  # little-endian
        if stated == crc32c_of_part(data, kept, at, end, zero_tables):
            return at, end + CRC_SIZE - at
    return -1, 0


class WholeChunks:
    """The chunks of a file that have a legal length and the right checksum; ask with growing offsets.

    A byte is checksummed once for each window that it lies in, and a chunk's checksum follows from two positions of
    a window, so that nothing a hostile file claims about its lengths costs more. Windows overlap where chunks may.
    """

    MAX_CHECKSUMMED: Final = 6

    def __init__(self, source: Source, longest: int) -> None:
        self._source = source
        self.end = source.size or 0  # offset of the end of the file
        self._longest = longest
        self._reach = max(longest, LONGEST_HEADER) + LONGEST_FRAME  # bytes of the longest chunk
        self._step = max(READ_AT_ONCE, longest // 2)
        self._first = 0  # offset of the window in the file
        self._data = np.empty(0, np.uint8)
        self._kept = np.empty(1, np.uint32)
        self.checksummed = 0  # bytes of all windows so far: at most `MAX_CHECKSUMMED` times the file's

    def size_at(self, offset: int) -> int | None:
        """The size in bytes of the chunk at an offset; None if there is no whole one."""
        self._cover(offset, self._reach)
        at, size = self._search(offset, offset + 1)
        return size if at == offset else None

    def after_damaged(self, offset: int, end: int | None) -> int:
        """The offset after the chunk at `offset`, which is not whole; the file's size if nothing whole follows.

        It is `end`, where the chunk ends by its length, if a whole chunk or the file's end is there; else the next byte
        at which a whole chunk begins.
        """
        self._cover(offset, 2 * self._reach)
        if end == self.end or (end is not None and self._search(end, end + 1)[0] == end):
            return end
        offset += 1
        while offset < self.end:
            self._cover(offset, self._reach)
            stop = self._covered() - self._reach + 1 if self._covered() < self.end else self.end
            at, _ = self._search(offset, stop)
            if at >= 0:
                return at
            offset = stop
        return self.end

    def _covered(self) -> int:
        return self._first + len(self._data)

    def _search(self, first: int, stop: int) -> tuple[int, int]:
        """Offset and size of the first whole chunk that begins in first..stop-1; a negative offset if there is none."""
        stop = min(stop, self._covered())
        arrays = self._data, self._kept, ZERO_TABLES
        at, size = _first_whole(*arrays, first - self._first, stop - self._first, self._longest)
        return (self._first + at if at >= 0 else -1), size

    def _cover(self, offset: int, size: int) -> None:
        """Make the window reach from `offset` for `size` bytes, or to the end of the file."""
        if self._first <= offset and min(offset + size, self.end) <= self._covered():
            return
        self._data = np.empty(0, np.uint8)  # the old window goes before the new one comes
        data = np.empty(min(2 * self._reach + self._step, self.end - offset), np.uint8)
        expected, filled = len(data), 0
        with self._source.lock:
            self._source.seek(offset)
            while filled < expected and (piece := self._source.read(min(READ_AT_ONCE, expected - filled))):
                data[filled : filled + len(piece)] = np.frombuffer(piece, np.uint8)
                filled += len(piece)
        data = data[:filled]
        data.setflags(write=False)
        if filled < expected:  # the file has become shorter
            self.end = offset + filled
        self._first, self._data, self._kept = offset, data, registers(data)
        self.checksummed += filled
