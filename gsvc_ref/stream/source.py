"""The source of a stream's bytes: a path, bytes, or any binary file, be it a pipe."""

import threading
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Self

from gsvc_base.errors import UsageError
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.coder import Element

READ_AT_ONCE: Final = 1 << 20
"""Maximum number of bytes asked for at once: a length that a stream claims is never allocated before its bytes came."""


class Source:
    """A binary source that counts offsets from where it stood when it was handed in."""

    def __init__(self, source: str | Path | bytes | bytearray | memoryview | BinaryIO) -> None:
        self._owned = not hasattr(source, "read")
        self._file: BinaryIO
        if isinstance(source, (bytes, bytearray, memoryview)):
            self._file = BytesIO(source)
        elif isinstance(source, (str, Path)):
            self._file = open(source, "rb")  # noqa: SIM115  (closed by `close`)
        elif hasattr(source, "read"):
            self._file = source
        else:
            raise UsageError(
                f"a {type(source).__name__} is not a source; give a path, bytes or a file opened in mode 'rb'"
            )
        self.seekable = hasattr(self._file, "seekable") and self._file.seekable()
        self.offset = 0  # bytes from the start of the stream to what `read` returns next
        self._ahead = b""  # a byte that was peeked at
        self.lock = threading.RLock()  # from a `seek` to the reads that belong to it: threads may share a stream
        self._closed = False
        self.size: int | None = None  # bytes from the start of the stream to the end of the source; None for a pipe
        if self.seekable:
            self._start = self._file.tell()
            self.size = self._file.seek(0, 2) - self._start
            self._file.seek(self._start)

    def read(self, size: int) -> bytes | bytearray:
        """The next `size` bytes; fewer if the source ends before."""
        data: bytes | bytearray = self._piece(size)
        if 0 < len(data) < size:
            data = bytearray(data)  # grows in place: nothing is held twice
            while piece := self._piece(size - len(data)):
                data += piece
        return data

    def _piece(self, size: int) -> bytes:
        """Some of the next `size` bytes; none at the end of the source."""
        piece = self._read_piece(size)
        self.offset += len(piece)
        return piece

    def _read_piece(self, size: int) -> bytes:
        """What `_piece` gives, not yet counted."""
        if size > 0 and self._ahead:
            ahead, self._ahead = self._ahead, b""
            return ahead
        piece = self._file.read(min(size, READ_AT_ONCE)) if size > 0 else b""
        if not isinstance(piece, bytes):
            raise UsageError("the source yields text; open the file in mode 'rb'")
        return piece

    def peek(self) -> int | None:
        """The next byte, which stays there; None at the end of the source."""
        if not self._ahead:
            self._ahead = self._read_piece(1)
        return self._ahead[0] if self._ahead else None

    def seek(self, offset: int) -> None:
        """Go to an offset, which must not be less than the present one if the source cannot go back."""
        if self._closed:
            raise UsageError("this stream was closed; open it again to read more")
        if offset == self.offset:
            return
        if self.seekable:
            self._file.seek(self._start + offset)
            self.offset, self._ahead = offset, b""
        elif offset < self.offset:
            raise UsageError("a pipe can be read only once, from its start; give a file to read it again")
        while self.offset < offset and self.read(min(READ_AT_ONCE, offset - self.offset)):
            pass

    def current_size(self) -> int:
        """Bytes that a seekable source has now; a live file has more than `size`."""
        with self.lock:
            size = self._file.seek(0, 2) - self._start
            self._file.seek(self._start + self.offset)
            self._ahead = b""
            return size

    def close(self) -> None:
        """Close the file, if it was opened here."""
        with self.lock:
            self._closed = True
            if self._owned:
                self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


class SourceReader(Reader):
    """A Reader of what stands outside of payloads; it takes bytes from a source as they are needed, and keeps none."""

    def __init__(
        self, source: Source, trace: Callable[[Element], None] | None = None, *, end_rule: str = "R-6.2-4"
    ) -> None:
        super().__init__(b"", first_bit=8 * source.offset, end_rule=end_rule, trace=trace)
        self._source = source

    def at_end(self) -> bool:
        """Whether no byte follows."""
        if not self.bits_left:
            self._take_from_source(1)
        return not self.bits_left

    def _need(self, bits: int, name: str, start: int | None = None) -> None:
        missing = (bits - self.bits_left + 7) // 8
        if missing > 0:
            self._take_from_source(missing)
        super()._need(bits, name, start)

    def _take_from_source(self, size: int) -> None:
        """Have `size` bytes more; only whole bytes stand outside of payloads."""
        unread = self._data[self._bit >> 3 :]
        self.first_bit, self._bit = self.position, 0
        more = self._source.read(size)
        self._data = memoryview(b"".join((unread, more)) if unread else more).toreadonly()
