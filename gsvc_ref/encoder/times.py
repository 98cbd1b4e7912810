"""The time stamps of a source, on their way into the stream: chunks ``t`` (spec.md section 6.11).

A frame is written with its chunks `t` before it, and how long it is shown is only known when the next one has been
read. So frames are read ahead, a few at a time, and each few have a chunk. How many they are depends on the size of a
frame alone: the bytes of a stream must not depend on how far the encoder happens to be.
"""

from collections import deque
from collections.abc import Iterator
from fractions import Fraction
from itertools import groupby, islice, pairwise, takewhile
from typing import Final

from gsvc_base.arrays import Frame
from gsvc_ref.bitstream.coder import UV_LIMIT
from gsvc_ref.bitstream.times import write_times
from gsvc_ref.video import VideoReader

MAX_AHEAD: Final = 64
"""Maximum number of frames that a chunk is about: beside its runs the other 13 bytes or so are few."""

TIMES_BYTES_AHEAD: Final = 1 << 26
"""Bytes of frames that are read ahead, at most, if they are several."""

USUAL_TICKS: Final = 90_000
"""Ticks of a second where the source tells no unit; other times are rounded to it, each for itself."""


class SourceTimes:
    """The frames of a source, and the chunks that say when they are shown; none if they are evenly spaced."""

    def __init__(
        self,
        reader: VideoReader,
        start: int,  # of a half-open range of frames
        stop: int | None,
        *,
        least_delay: bool,  # read one frame ahead, no more
    ) -> None:
        self._reader, self._range = reader, (start, stop)
        video = reader.format
        size = video.width * video.height * 3 * video.dtype.itemsize
        self._ahead = 1 if least_delay else max(1, min(MAX_AHEAD, TIMES_BYTES_AHEAD // size))
        self._usual = 1 / video.frame_rate
        self._chunks: dict[int, bytes] = {}
        self._begin: Fraction | None = None
        self._ticks = reader.time_base.denominator if reader.time_base else USUAL_TICKS
        if self._ticks >= UV_LIMIT:
            self._ticks = USUAL_TICKS

    def frames(self) -> Iterator[Frame]:
        """The frames; what `before` says of one is known when it comes."""
        start, stop = self._range
        count = None if stop is None else stop - start
        source = islice(self._reader, start, None)
        if count == 0 or (first := next(source, None)) is None:
            return
        if self._reader.frame_time is not None:
            yield from self._read_ahead(first, source, count)
            return
        yield first
        yield from source if count is None else islice(source, count - 1)

    def _read_ahead(self, first: Frame, source: Iterator[Frame], count: int | None) -> Iterator[Frame]:
        """The frames, `count` at most, while some after it are already read.

        Of a range that ends early one frame more is read, whose time says how long the last one is shown.
        """
        ahead, times = deque([first]), [self._reader.frame_time]
        number, is_over, fault = 0, False, None
        while ahead and (count is None or number < count):
            while len(ahead) <= self._ahead and not is_over:
                try:
                    frame = next(source, None)
                except Exception as error:  # those before it are encoded
                    fault, is_over = error, True
                    break
                is_over = frame is None
                times.append(self._reader.end_time if frame is None else self._reader.frame_time)
                if frame is not None:
                    ahead.append(frame)
            given = len(ahead) - (not is_over)
            if count is not None:
                given = min(given, count - number)
            self._keep(number, times[: given + 1])
            for _ in range(given):
                yield ahead.popleft()
            number += given
            del times[:given]
        if fault is not None and (count is None or number < count):
            raise fault

    def _keep(self, first: int, times: list[Fraction | None]) -> None:
        """Make the chunk about frames from `first` on, given their times and that of the frame after them."""
        known = [time for time in takewhile(lambda time: time is not None, times) if time is not None]
        if self._begin is None:
            self._begin = known[0]
        begin = self._begin
        ticks = [b - a for a, b in pairwise(round((time - begin) * self._ticks) for time in known)]
        usual = self._usual * self._ticks
        if all(value == usual for value in ticks) or not all(0 < value < UV_LIMIT for value in ticks):
            return
        runs = [(len([*group]), value) for value, group in groupby(ticks)]
        self._chunks[first] = write_times(self._ticks, first, runs)

    def before(self, number: int) -> bytes | None:
        """The payload of the chunk `t` that stands before a frame, or None; asked for once."""
        return self._chunks.pop(number, None)
