"""How long an encode will still take, from its first frame on.

I-frames take longer than P-frames, so that the time of the first frame, which is one, says little about the rest.
Until a P-frame has been seen it is taken to cost a fixed part of an I-frame; then the mean of those that were seen
counts. The time before the first frame begins is that of reading and of cuts, and is not taken to come again.
"""

from typing import Final

INTER_SHARE: Final = 0.4
"""Time of a P-frame over that of its I-frame, by which it is guessed: 0.3 to 1.0, mostly 0.4, for six scenes of
176x144 with 200 and 600 splats, preset ``quick``."""

MIN_DONE: Final = 0.15
"""A frame of which less is done says nothing about its time."""

FRAME_DECAY: Final = 0.9
"""What a frame's time counts, against that of the frame after it."""


class TimeLeft:
    """The time left for the frames of an encode, as it goes on from frame to frame, the first of them an I-frame."""

    def __init__(self) -> None:
        self._begin: float | None = None  # of the first frame
        self._first = self._frame = 0
        self._frame_begin = 0.0
        self._intra: float | None = None
        self._weight = self._inter = 0.0
        self.rate = 0.0  # frames per second since the first one began; 0 before one is done

    def update(self, frame: int, share: float, elapsed_s: float, frame_count: int | None) -> float | None:
        """The seconds left while a share, 0..1, of a frame is done; None while nothing is known of them."""
        if self._begin is None or frame < self._frame:  # also where another pass begins
            self._begin, self._first, self._frame, self._frame_begin = elapsed_s, frame, frame, elapsed_s
            self._weight = self._inter = 0.0
        elif frame > self._frame:
            self._ended((elapsed_s - self._frame_begin) / (frame - self._frame), first=self._frame == self._first)
            self._frame, self._frame_begin = frame, elapsed_s
        if elapsed_s > self._begin:
            self.rate = (frame - self._first) / (elapsed_s - self._begin)
        if frame_count is None:
            return None
        spent = elapsed_s - self._frame_begin
        if frame == self._first:
            if share < MIN_DONE:
                return None
            intra = spent / share
            return intra - spent + INTER_SHARE * intra * (frame_count - frame - 1)
        each = self._inter / self._weight if self._weight else INTER_SHARE * (self._intra or 0.0)
        return max(each * (frame_count - frame) - spent, 0.0)

    def _ended(self, seconds: float, *, first: bool) -> None:
        """Note what a frame took."""
        if first:
            self._intra = seconds
        else:
            self._weight = FRAME_DECAY * self._weight + 1
            self._inter = FRAME_DECAY * self._inter + seconds


class GroupsTimeLeft:
    """The same where groups of pictures are encoded side by side, from the number of frames that are done.

    The processes take half a second to start, and compile or load kernels; so the pace counts from the first frames on.
    """

    def __init__(self) -> None:
        self._first = 0, 0.0
        self._done = 0
        self.rate = 0.0

    def update(self, done: int, elapsed_s: float, frame_count: int | None) -> float | None:
        """The seconds left when `done` frames are done, or None while nothing is known of them.

        Frames that were kept by another encode are among neither `done` nor `frame_count`.
        """
        if self._done == 0 or done < self._done:
            self._first = done, elapsed_s
        self._done = done
        frames, seconds = done - self._first[0], elapsed_s - self._first[1]
        if frames > 0 and seconds > 0:
            self.rate = frames / seconds
        else:  # the first: with all that came before it
            self.rate = done / elapsed_s if elapsed_s > 0 else 0.0
        if frame_count is None or self.rate == 0:
            return None
        return max(frame_count - done, 0) / self.rate
