"""Time stamps of the frames that an editor keeps, with the numbers that these have in the result (R-6.11-4)."""

from collections.abc import Iterable, Iterator

from gsvc_ref.bitstream import chunks
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.header import SequenceHeader
from gsvc_ref.bitstream.times import TIMES, FrameTimes, Run, read_times, write_times
from gsvc_ref.stream.formats import video_format


class Retiming:
    """The chunks `t` of the parts of a result, one part after the other."""

    def __init__(self, header: SequenceHeader) -> None:
        self._frame_rate = video_format(header).frame_rate
        self._ticks: int | None = None
        self.lost = 0  # chunks that could not be kept, since a part before has other ticks

    def of_part(
        self, all_chunks: Iterable[tuple[int, Reader]], start: int, stop: int | None, first: int
    ) -> Iterator[tuple[int, Reader]]:
        """All chunks of a part, those of time stamps made anew for its frames `start` to `stop` - 1 (None: to the end).

        Frame `start` of the part gets the number `first` in the result.
        """
        times = FrameTimes(self._frame_rate)
        number = 0
        for chunk_type, p in all_chunks:
            number += chunk_type in chunks.FRAMES
            if chunk_type != ord(TIMES):
                yield chunk_type, p
            elif times.add(p.rest, number) and (found := read_times(p.rest)) is not None:  # others say nothing
                ticks, begin, runs = found
                first_inside, runs_inside = _within(begin, runs, start, stop)
                if runs_inside and self._ticks in (None, ticks):
                    self._ticks = ticks
                    yield chunk_type, Reader(write_times(ticks, first_inside - start + first, runs_inside))
                elif runs_inside:
                    self.lost += 1


def _within(begin: int, runs: list[Run], start: int, stop: int | None) -> tuple[int, list[Run]]:
    """The runs of frames `start` to `stop` - 1 alone, and the first frame of the first one."""
    runs_inside = []
    first = max(begin, start)
    for frames, ticks in runs:
        end = begin + frames
        inside = (end if stop is None else min(end, stop)) - max(begin, start)
        if inside > 0:
            runs_inside.append((inside, ticks))
        begin = end
    return first, runs_inside
