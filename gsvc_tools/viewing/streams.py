"""The bytes of the stream that is looked at: of a file, of one that an encoder is writing, or of a pipe."""

import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Final, Protocol

from gsvc_base.files import try_lock
from gsvc_ref.bitstream.chunks import END_CHUNK_SIZE, END_TYPE
from gsvc_ref.bitstream.crc import crc32c

SENT_AT_ONCE: Final = 1 << 16
"""Bytes that are handed on at a time."""
QUIET_S: Final = 3.0
"""Seconds without growth after which a file that nobody holds the lock of is taken for ended."""


class StreamBytes(Protocol):
    """Bytes that can be read at any place, some of which may be yet to come."""

    live: bool  # whether more may come
    fault: OSError | None  # why what comes cannot be kept

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
    """What comes through a pipe; it is kept in a temporary file, since a page may be loaded again."""

    live = True

    def __init__(self, pipe: BinaryIO) -> None:
        self._pipe = pipe
        self._file = tempfile.TemporaryFile()  # noqa: SIM115  (for as long as the object lives)
        self._size, self._ended = 0, False
        self._lock = threading.Lock()
        self.fault: OSError | None = None
        threading.Thread(target=self._take, name="pipe", daemon=True).start()

    def _take(self) -> None:
        try:
            while piece := self._pipe.read1(SENT_AT_ONCE):  # type: ignore[attr-defined]
                with self._lock:
                    self._file.seek(self._size)
                    self._file.write(piece)
                    self._size += len(piece)
        except OSError as error:  # the disk is full: what came before stays
            self.fault = error
        except ValueError:  # all is closed
            pass
        self._ended = True

    def size(self) -> int:
        """How many bytes have come."""
        return self._size

    def read(self, first: int, count: int) -> bytes:
        """Bytes from an offset on."""
        with self._lock:
            self._file.seek(first)
            return self._file.read(min(count, max(self._size - first, 0)))

    def ended(self) -> bool:
        """Whether the other end is closed."""
        return self._ended

    def close(self) -> None:
        """Forget what has come."""
        with self._lock:
            self._file.close()
