"""When frames are shown: the chunk ``t`` of spec.md section 6.11, and what all of a stream's chunks say together.

No picture depends on any of this. A chunk that breaks a rule is ignored (R-6.11-3).
"""

from array import array
from bisect import bisect_right
from collections.abc import Sequence
from fractions import Fraction
from typing import Final

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.coder import UV_LIMIT, Bytes, Coder

TIMES: Final = "t"
"""The ancillary chunk of time stamps."""

FRAME_NUMBERS: Final = 1 << 32
"""Frames of a stream are numbered below this."""

MAX_TIME_RUNS: Final = 1 << 12
"""Maximum number of runs of a chunk (R-6.11-1)."""

MAX_TIME_RUNS_KEPT: Final = 1 << 22
"""Runs of a stream that are kept, 160 MiB at most, so that a hostile stream cannot fill the memory: those of 38 hours
of 30 frames a second that are all different. Chunks beyond are ignored."""

Run = tuple[int, int]
"""A number of frames, and the ticks for which each of them is shown."""


def times(
    s: Coder, ticks_per_second: int = 0, first_frame: int = 0, runs: Sequence[Run] = ()
) -> tuple[int, int, list[Run]]:
    """The elements of a chunk `t`; the values that a Reader finds, of which R-6.11-1 is checked."""
    ticks_per_second = s.uv("ticks_per_second", ticks_per_second)
    first_frame = s.uv("first_frame", first_frame)
    run_count = s.uv("run_count", len(runs))
    if not (ticks_per_second and run_count <= MAX_TIME_RUNS):
        s.fail("R-6.11-1", "`ticks_per_second` must be at least 1, and `run_count` at most 4096")
    found, end = [], first_frame
    for number in range(run_count):
        frames, ticks = runs[number] if runs else (0, 0)
        frames, ticks = s.uv("frame_run", frames), s.uv("frame_ticks", ticks)
        end += frames
        if not frames or not ticks or end > FRAME_NUMBERS:
            s.fail(
                "R-6.11-1", "`frame_run` and `frame_ticks` must be at least 1, and no frame be numbered 2^32 or more"
            )
        found.append((frames, ticks))
    return ticks_per_second, first_frame, found


def read_times(payload: Bytes) -> tuple[int, int, list[Run]] | None:
    """The elements of the payload of a chunk `t`; None if it breaks R-6.11-1."""
    p = Reader(payload)
    try:
        found = times(p)
    except GsvcError:
        return None
    return None if p.bits_left else found


def write_times(ticks_per_second: int, first_frame: int, runs: Sequence[Run]) -> bytes:
    """The payload of a chunk `t`; a UsageError says that the values break R-6.11-1."""
    least = min((min(run) for run in runs), default=1)
    most = max((max(run) for run in runs), default=1)
    end = first_frame + sum(frames for frames, _ in runs)
    fits = 0 < ticks_per_second < UV_LIMIT and 0 <= first_frame < UV_LIMIT and least > 0 and most < UV_LIMIT
    if not fits or len(runs) > MAX_TIME_RUNS or end > FRAME_NUMBERS:
        raise UsageError(f"runs of frames {first_frame} to {end - 1} at {ticks_per_second} ticks break R-6.11-1")
    p = Writer(0)
    times(p, ticks_per_second, first_frame, runs)
    return p.getvalue()


class FrameTimes:
    """When the frames of a stream are shown; those that no run has, by the frame rate."""

    def __init__(self, frame_rate: Fraction) -> None:
        self._usual = 1 / frame_rate
        self.ticks_per_second: int | None = None  # None while no run is known
        # Of each run its first frame, the frame after it, and the ticks of each; of all runs before, frames and ticks.
        self._firsts, self._ends, self._ticks = array("Q"), array("Q"), array("Q")
        self._frames_before, self._ticks_before = array("Q"), array("Q")

    def __eq__(self, other: object) -> bool:
        """Whether both say the same by the same runs."""
        if not isinstance(other, FrameTimes):
            return NotImplemented
        return self._runs() == other._runs()

    __hash__ = None  # type: ignore[assignment]

    def _runs(self) -> tuple[object, ...]:
        return self._usual, self.ticks_per_second, self._firsts, self._ends, self._ticks

    @property
    def is_even(self) -> bool:
        """Whether no run is known: all frames are shown equally long."""
        return not self._firsts

    def add(self, payload: Bytes, next_frame: int) -> bool:
        """Take a chunk `t` that stands before the frame `next_frame`; False if it is ignored (R-6.11-2, R-6.11-3)."""
        if len(self._firsts) >= MAX_TIME_RUNS_KEPT or (found := read_times(payload)) is None:
            return False
        ticks_per_second, first, runs = found
        if first < max(next_frame, self._ends[-1] if self._ends else 0):
            return False
        if self.ticks_per_second not in (None, ticks_per_second):
            return False
        self.ticks_per_second = ticks_per_second
        for frames, ticks in runs:
            self._frames_before.append(self._covered(len(self._firsts)))
            self._ticks_before.append(self._passed(len(self._firsts)))
            self._firsts.append(first)
            self._ends.append(first + frames)
            self._ticks.append(ticks)
            first += frames
        return True

    def _covered(self, count: int) -> int:
        """Frames of the first `count` runs."""
        i = count - 1
        return self._frames_before[i] + self._ends[i] - self._firsts[i] if count else 0

    def _passed(self, count: int) -> int:
        """Ticks of the first `count` runs."""
        i = count - 1
        return self._ticks_before[i] + (self._ends[i] - self._firsts[i]) * self._ticks[i] if count else 0

    def time_of(self, frame: int) -> Fraction:
        """When a frame is shown, in seconds from the first one; also of one that follows the last."""
        if self.ticks_per_second is None:
            return frame * self._usual
        i = bisect_right(self._firsts, frame) - 1
        if i < 0:
            return frame * self._usual
        inside = min(frame, self._ends[i]) - self._firsts[i]
        covered = self._frames_before[i] + inside
        ticks = self._ticks_before[i] + inside * self._ticks[i]
        return Fraction(ticks, self.ticks_per_second) + (frame - covered) * self._usual

    def duration_of(self, frame: int) -> Fraction:
        """How long a frame is shown, in seconds."""
        i = bisect_right(self._firsts, frame) - 1
        if self.ticks_per_second is None or i < 0 or frame >= self._ends[i]:
            return self._usual
        return Fraction(self._ticks[i], self.ticks_per_second)
