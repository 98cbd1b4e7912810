"""The bytes of the stream that is looked at: of a file, of one that an encoder is writing, or of a pipe."""

import os
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Final, Protocol

from gsvc_base.errors import GsvcError
from gsvc_base.files import try_lock
from gsvc_ref.bitstream.chunks import CRC_BITS, END_CHUNK_SIZE, END_TYPE, chunk_head, chunk_rest, magic, version
from gsvc_ref.bitstream.crc import crc32c
from gsvc_ref.bitstream.header import HIGHEST_LEVEL, LEVELS
from gsvc_ref.stream.source import Source, SourceReader

SENT_AT_ONCE: Final = 1 << 16
"""Bytes that are handed on at a time."""
MAX_PIPED_BYTES: Final = 4 << 30
"""Bytes of a pipe that are kept, by default."""
QUIET_S: Final = 3.0
"""Seconds without growth after which a file that nobody holds the lock of is taken for ended."""


class StreamBytes(Protocol):
    """Bytes that can be read at any place, some of which may be yet to come."""

    live: bool  # whether more may come
    fault: OSError | None  # why further bytes cannot be kept
    is_full: bool  # whether more bytes came than may be kept

    def size(self) -> int:
        """How many bytes there are by now."""

    def read(self, first: int, count: int) -> bytes:
        """At most `count` bytes from an offset on; none: they have not come, or never will."""

    def ended(self) -> bool:
        """Whether no more will come."""

    def close(self) -> None:
        """Release what is held."""


class WholeFile:
    """A file as it is."""

    live = False
    fault: OSError | None = None
    is_full = False

    def __init__(self, path: Path) -> None:
        self.path = path

    def size(self) -> int:
        """Its size in bytes."""
        return self.path.stat().st_size

    def read(self, first: int, count: int) -> bytes:
        """Bytes from an offset on."""
        with self.path.open("rb") as file:
            file.seek(first)
            return file.read(count)

    def ended(self) -> bool:
        """Nothing is added to it."""
        return True

    def close(self) -> None:
        """Nothing is held."""


class GrowingFile(WholeFile):
    """A file that ``gsvc encode --live`` writes, or will write: it need not be there yet.

    It has ended when its last bytes are an end chunk, or it has not grown for `quiet` seconds; and its encoder, which
    holds its lock, is gone.
    """

    live = True

    def __init__(self, path: Path, quiet: float = QUIET_S) -> None:
        super().__init__(path)
        self._quiet = quiet
        self._last_size = 0
        self._last_growth = time.monotonic()

    def size(self) -> int:
        """Its size in bytes; 0 before it is there."""
        try:
            return super().size()
        except FileNotFoundError:
            return 0

    def read(self, first: int, count: int) -> bytes:
        """Bytes from an offset on."""
        try:
            return super().read(first, count)
        except FileNotFoundError:
            return b""

    def ended(self) -> bool:
        """Whether its encoder has ended."""
        size = self.size()
        if size != self._last_size:
            self._last_size, self._last_growth = size, time.monotonic()
        complete = is_end(self.read(max(size - END_CHUNK_SIZE, 0), END_CHUNK_SIZE))
        if size == 0 or not (complete or time.monotonic() - self._last_growth >= self._quiet):
            return False
        with suppress(OSError), self.path.open("rb") as file:
            locked = try_lock(file)
            return locked is True or (complete and locked is None)  # None: nothing is known of an encoder here
        return False


def is_end(tail: bytes) -> bool:
    """Whether bytes are an end chunk with the right checksum."""
    return (
        len(tail) == END_CHUNK_SIZE
        and tail[0] == END_TYPE
        and tail[1] == END_CHUNK_SIZE - 6
        and crc32c(tail[:-4]) == int.from_bytes(tail[-4:], "little")
    )


class Pipe:
    """The bytes of a pipe up to the end chunk, kept in a temporary file, since a page may be loaded again.

    Beyond `most` bytes nothing is read.
    """

    live = True

    def __init__(self, pipe: BinaryIO, most: int = MAX_PIPED_BYTES) -> None:
        self._pipe, self._most = pipe, most
        self._file = tempfile.TemporaryFile()  # noqa: SIM115  (for as long as the object lives)
        self._size, self._ended = 0, False
        self._lock = threading.Lock()
        self.fault: OSError | None = None
        self.is_full = False
        threading.Thread(target=self._take, name="pipe", daemon=True).start()

    def _take(self) -> None:
        try:
            try:
                read_to_end_chunk(Source(_Pieces(self._next)))  # type: ignore[arg-type]
            except GsvcError as error:  # of a damaged or cut stream, the page shows all that comes
                while error.rule != "R-6.1-1" and self._next():  # no stream at all
                    pass
            self._stop()
        except OSError as error:  # the disk is full: what came before stays
            self.fault = error
        except ValueError:  # all is closed
            pass
        self._ended = True

    def _next(self) -> bytes:
        """Bytes that have just come and are kept; none after the last."""
        if self.is_full:
            return b""
        come: bytes = self._pipe.read1(SENT_AT_ONCE)  # type: ignore[attr-defined]
        piece = come[: self._most - self._size]
        with self._lock:
            self._file.seek(self._size)
            self._file.write(piece)
            self._size += len(piece)
        self.is_full = len(piece) < len(come)
        return piece

    def _stop(self) -> None:
        """Close the pipe, so that its writer ends; its number stays in use, since a browser may inherit it."""
        with suppress(OSError), open(os.devnull, "rb") as nothing:  # not every pipe of a test has a number
            os.dup2(nothing.fileno(), self._pipe.fileno())

    def size(self) -> int:
        """How many bytes have come."""
        return self._size

    def read(self, first: int, count: int) -> bytes:
        """Bytes from an offset on."""
        with self._lock:
            self._file.seek(first)
            return self._file.read(min(count, max(self._size - first, 0)))

    def ended(self) -> bool:
        """Whether nothing more is read."""
        return self._ended

    def close(self) -> None:
        """Forget what has come."""
        with self._lock:
            self._file.close()


class _Pieces:
    """A binary file whose bytes a function gives, some at a time, and none at their end."""

    def __init__(self, give: Callable[[], bytes]) -> None:
        self._give, self._left = give, b""

    def read(self, size: int) -> bytes:
        """At most `size` bytes."""
        self._left = self._left or self._give()
        piece, self._left = self._left[:size], self._left[size:]
        return piece


def read_to_end_chunk(source: Source) -> None:
    """Skip from chunk to chunk to the end of the end chunk; a GsvcError says that no sound one can be reached."""

    def longest(chunk_type: int) -> int:
        return END_CHUNK_SIZE - 6 if chunk_type == END_TYPE else LEVELS[HIGHEST_LEVEL].payload

    s = SourceReader(source)
    magic(s)
    version(s)
    while (head := chunk_head(s, longest))[0] != END_TYPE:
        source.seek(source.offset + head[1] + CRC_BITS // 8)
        s = SourceReader(source)
    chunk_rest(s, *head)
