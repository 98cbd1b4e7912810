"""The limits of a second, which a paced stream keeps (spec.md section 5)."""

from dataclasses import dataclass
from typing import Final

from gsvc_ref.bitstream.header import I_FRAME_SECONDS, PER_SECOND, Level, SequenceHeader
from gsvc_ref.paper import FrameType

NOTHING: Final = Level(0, 0, 0, 0)
"""The sums of a second that has no frame yet."""


@dataclass(frozen=True)
class Pace:
    """What the frames of a second so far have of its limits; nothing is known once a frame was missed."""

    next_number: int = 0  # of the frame that comes next
    used: Level = NOTHING  # the sums of the second so far; the payload stands for the bytes of whole chunks
    last_i_frame: int = 0  # its number

    def after(self, header: SequenceHeader, frame_type: FrameType, splats: int, work: int, size: int) -> "Pace":
        """The pace after the next frame, of `work` pairs.

        `size` is the bytes of its chunk and of the ancillary chunks directly before it.
        """
        begins = self.next_number % header.frames_of_second == 0
        used = NOTHING if begins else self.used  # a second is k frames, counted from frame 0
        return Pace(
            self.next_number + 1,
            Level(
                used.pixels + header.width * header.height,
                used.splats + splats,
                used.work + work,
                used.payload + size,
            ),
            self.next_number if frame_type == "I" else self.last_i_frame,
        )

    def fault(self, header: SequenceHeader) -> tuple[str, str] | None:
        """The rule that the last frame has broken, R-5-7 or R-5-8, and a sentence; None if it kept both."""
        number = self.next_number - 1
        second = number // header.frames_of_second
        allowed = second_limits(header)
        for what, used, most in (
            ("pixels", self.used.pixels, allowed.pixels),
            ("splats", self.used.splats, allowed.splats),
            ("pairs of rendering work", self.used.work, allowed.work),
            ("bytes", self.used.payload, allowed.payload),
        ):
            if used > most:
                message = f"with frame {number}, second {second} has {used} {what}; level {header.level} allows {most}"
                return "R-5-7", f"{message} in a second of a paced stream"
        distance, longest = number - self.last_i_frame, I_FRAME_SECONDS * header.frames_of_second
        if distance >= longest:
            message = f"frame {number} follows the last I-frame by {distance} frames"
            return "R-5-8", f"{message}; in this paced stream each {longest}th must be an I-frame, at least"
        return None


def second_limits(header: SequenceHeader) -> Level:
    """The limits of a second of a stream's level; the payload stands for the bytes of whole chunks."""
    limits = header.limits
    return Level(
        PER_SECOND.pixels * limits.pixels,
        PER_SECOND.splats * limits.splats,
        PER_SECOND.work * limits.work,
        PER_SECOND.payload * limits.payload,
    )
