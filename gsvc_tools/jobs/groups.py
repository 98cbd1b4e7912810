"""Groups of pictures, which are encoded independently, segment by segment.

`gsvc_ref.encoder.loop` says what a group is, and why it does not matter where and in which order groups are encoded.

A *segment* is some successive frames of a group, and the coder that the segment before them left: all that another
process needs, or another machine. What comes back are the encoded frames, and the coder for the next segment. Segments
are short, so frames are written soon after they are done, little is lost with a process that dies, and a group may have
any length.
"""

import time
import traceback
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future
from copy import copy
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_ref.encoder.encoded_frame import EncodedFrame
from gsvc_ref.encoder.frame_types import TypedFrame
from gsvc_ref.encoder.loop import GroupCoder, silent
from gsvc_ref.paper import FrameType
from gsvc_tools.jobs.resume import GroupInWork

SEGMENT_S: Final = 0.5
"""Seconds that a segment is meant to take, by the pace of the one before it in its group; the first has one frame.
A coder of 352x288 pixels and 2,000 splats is 1.7 MB, which take 2 ms to pickle and make again, each time it is sent."""

MAX_GROUP_FRAMES: Final = 16
"""Maximum number of frames of a segment of SEGMENT_S, and in proportion of one that is meant to take longer."""

MAX_GROUP_BYTES: Final = 1 << 25
"""Maximum number of bytes of the frames of a segment, unless it is a single frame."""

I_FRAME: Final = 4
"""How many P-frames take as long as an I-frame, about."""


class EncodedSegment(NamedTuple):
    """What became of a segment."""

    frames: list[tuple[EncodedFrame, float]]  # the encoded frames, each with the seconds that it took
    coder: GroupCoder  # the coder for the next segment
    fault: Exception | None = None  # what ended it early, and where that was raised
    place: str = ""


class RemotePlaceError(Exception):
    """The cause of an exception from another process: it says where that was raised."""


def encode_segment(coder: GroupCoder, frames: Sequence[tuple[Frame, FrameType, int]]) -> EncodedSegment:
    """Encode successive frames of a group, given with their types and numbers; this is what a worker is asked to do."""
    encoded: list[tuple[EncodedFrame, float]] = []
    for frame, kind, number in frames:
        begin = time.perf_counter()
        try:
            result = coder.encode(frame, kind, number, silent)
        except Exception as error:
            return EncodedSegment(encoded, coder, _portable(error), traceback.format_exc())
        encoded.append((result, time.perf_counter() - begin))
    return EncodedSegment(encoded, coder)


def _portable(error: Exception) -> Exception:
    """The exception, or another that says the same if it cannot be sent to another process."""
    try:
        copy(error)  # made again from its arguments, as when it is pickled
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


class Done(NamedTuple):
    """A frame that is encoded and not yet written: without its picture, which had `size` bytes."""

    item: TypedFrame[Frame]
    encoded: EncodedFrame
    seconds: float
    size: int


NO_PICTURE: Final[Frame] = np.empty((0, 0, 3), np.uint8)


class Group:
    """A group of pictures in work."""

    def __init__(
        self,
        coder: GroupCoder | None,  # for its next segment; None while the first frame of the stream is not encoded
        resumed: GroupInWork | None = None,  # what keeps it, or has kept it before; None if groups are not kept
        segment_s: float | None = None,
    ) -> None:
        self.coder, self.resumed = coder, resumed
        self.segment_s = SEGMENT_S if segment_s is None else segment_s  # seconds that a segment is meant to take
        # Its frames: those for later segments, those of the segment in work, and those that are encoded and not yet
        # written
        self.waiting: deque[TypedFrame[Frame]] = deque()
        self.segment: list[TypedFrame[Frame]] = []
        self.done: deque[Done] = deque()
        self.task: Future[EncodedSegment] | None = None  # the segment in work
        self.tries = 0  # how often this segment was given out
        self.pace = self.segment_s  # seconds that a frame of the last segment took
        self.is_whole = False  # whether all of its frames are known
        self.fault: Exception | None = None  # what stands in place of its next frame

    @property
    def may_go_on(self) -> bool:
        """Whether its next segment can be given out."""
        return self.task is None and self.fault is None and bool(self.segment or self.waiting)

    @property
    def left(self) -> int:
        """How long its frames will take that are known and not yet encoded, in P-frames."""
        is_unbegun = bool(self.segment or self.waiting) and (self.segment or self.waiting)[0].type == "I"
        return len(self.segment) + len(self.waiting) + is_unbegun * (I_FRAME - 1)

    @property
    def is_written(self) -> bool:
        """Whether nothing of it is left to be done."""
        return self.is_whole and not (self.waiting or self.segment or self.done)

    def take(self, item: TypedFrame[Frame]) -> float | None:
        """Take its next frame from the source; the PSNR of one that was kept, which then is done."""
        found = None if self.resumed is None else self.resumed.take(item.frame)
        if found is None:
            self.waiting.append(item)
            return None
        self.done.append(Done(replace(item, frame=NO_PICTURE), *found, item.frame.nbytes))
        return found[0].psnr

    def end(self, *, is_last: bool) -> None:
        """No frame follows in it, since another group does, or since it is the last one."""
        self.is_whole = True
        if self.resumed is not None:
            self.resumed.end(is_last=is_last)

    def take_segment(self) -> list[tuple[Frame, FrameType, int]]:
        """The frames of the next segment, or again of one that was lost."""
        if not self.segment:
            most = min(
                MAX_GROUP_FRAMES * max(1, round(self.segment_s / SEGMENT_S)),
                MAX_GROUP_BYTES // self.waiting[0].frame.nbytes,
            )
            count = min(max(1, min(int(self.segment_s / self.pace), most)), len(self.waiting))
            self.segment = [self.waiting.popleft() for _ in range(count)]
        return [(item.frame, item.type, item.number) for item in self.segment]

    def keep(self, segment: EncodedSegment) -> None:
        """Keep what became of the frames given."""
        self.tries = 0
        for item, (encoded, seconds) in zip(self.segment, segment.frames, strict=False):
            self.done.append(Done(replace(item, frame=NO_PICTURE), encoded, seconds, item.frame.nbytes))
            self.pace = max(seconds, 1e-6)
            if self.resumed is not None:
                self.resumed.add(encoded, seconds, segment.coder.decided())
        if segment.fault is not None:
            self.fault = segment.fault
            self.fault.__cause__ = RemotePlaceError(segment.place)
        self.segment, self.coder = [], segment.coder
