"""The frames of the source that a stream was made of, in any order, of a reader that gives them in theirs."""

import tempfile
import threading
from functools import partial
from typing import BinaryIO, Final

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.errors import GsvcError
from gsvc_ref.video import VideoFormat, VideoReader, open_video
from gsvc_tools.video.resampling import VideoOpener

MAX_VIEWED_BYTES: Final = 1 << 30
"""Bytes of frames that are kept in a temporary file: 172 frames of 1920 × 1080, so that going back reads no video."""


class SourceFrames:
    """Frames of a source by their number, from its frame `first` on; any thread may ask.

    `most_kept` bytes of frames are kept on disk; those after them are read again when someone goes back. Where
    `opened` is given, it opens the source, and `name` is shown only.
    """

    def __init__(
        self, name: str, first: int = 0, most_kept: int = MAX_VIEWED_BYTES, opened: VideoOpener | None = None
    ) -> None:
        self.name, self._first = name, first
        self._open = opened or partial(open_video, name)
        self._reader: VideoReader = self._open()
        self.format: VideoFormat = self._reader.format
        self._frame_bytes = 3 * self.format.width * self.format.height * (1 if self.format.bit_depth == 8 else 2)
        self._room = most_kept // self._frame_bytes
        self._file: BinaryIO = tempfile.TemporaryFile()  # noqa: SIM115  (until `close`)
        self._frame_count = 0
        self._next = 0  # the number of the frame that the reader gives next
        self._fault: GsvcError | None = None  # what the reader gives in its place
        self._lock = threading.Lock()

    def samples(self, number: int) -> bytes | None:
        """The samples of a frame, row by row R, G, B: a byte each for 8 bits, else two, the lower one first.

        None: the source has no such frame. A GsvcError says that the source cannot be read so far.
        """
        number += self._first
        with self._lock:
            if number < self._frame_count:
                self._file.seek(number * self._frame_bytes)
                return self._file.read(self._frame_bytes)
            if number < self._next:
                self._reader.close()
                self._reader, self._next, self._fault = self._open(), 0, None
            data = None
            while self._next <= number:
                frame = self._read()
                if frame is None:
                    return None
                if self._next == number or self._fits_next():
                    data = _bytes(frame)
                    self._keep(data)
                self._next += 1
            return data

    def _read(self) -> Frame | None:
        """The next frame of the reader, which tells a fault once only."""
        if self._fault is not None:
            raise self._fault
        try:
            return next(self._reader, None)
        except GsvcError as error:
            self._fault = error
            raise

    def _fits_next(self) -> bool:
        return self._next == self._frame_count < self._room

    def _keep(self, data: bytes) -> None:
        if not self._fits_next():
            return
        try:
            self._file.seek(self._next * self._frame_bytes)
            self._file.write(data)
        except OSError:  # the disk is full
            self._room = self._frame_count
        else:
            self._frame_count += 1

    def close(self) -> None:
        """Release the source."""
        with self._lock:
            self._reader.close()
            self._file.close()


def _bytes(frame: Frame) -> bytes:
    return np.ascontiguousarray(frame, "<u1" if frame.dtype == np.uint8 else "<u2").tobytes()
