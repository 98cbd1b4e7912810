"""The limits of a second, which a paced stream keeps (spec.md section 5)."""

from dataclasses import astuple, dataclass, replace
from typing import Final

from gsvc_ref.bitstream.header import I_FRAME_SECONDS, LEVELS, PER_SECOND, Level, Limits, SequenceHeader, halved_size
from gsvc_ref.paper import FrameType

NOTHING: Final = Level(0, 0, 0, 0)
"""The sums of a second that has no frame yet."""

AMOUNTS: Final = ("pixels", "splats", "pairs of rendering work", "bytes")
"""What a `Level` limits in a second; the payload stands for the bytes of whole chunks."""


@dataclass(frozen=True)
class Pace:
    """What the frames of a second so far have of its limits; nothing is known once a frame was missed."""

    limits: Limits  # of the quality that is decoded
    next_number: int = 0  # of the frame that comes next
    used: Level = NOTHING  # the sums of the second so far
    own: Level = NOTHING  # the same at the size of the quality's operating point
    last_i_frame: int = 0  # its number

    def after(
        self, header: SequenceHeader, frame_type: FrameType, splats: int, work: tuple[int, int], size: int
    ) -> "Pace":
        """The pace after the next frame, of `work` pairs, at the coded size and at that of the operating point.

        `size` is the bytes of its chunk and of the ancillary chunks directly before it. Its layers are `added`.
        """
        begins = self.next_number % header.frames_of_second == 0  # a second is k frames, counted from frame 0
        used, own = (NOTHING, NOTHING) if begins else (self.used, self.own)
        number = self.next_number
        last = number if frame_type == "I" else self.last_i_frame
        quality = self.limits.quality
        columns, rows = halved_size(header.width, header.height, quality.halvings if quality else 0)
        used = replace(used, pixels=used.pixels + header.width * header.height)
        own = replace(own, pixels=own.pixels + columns * rows)
        return Pace(self.limits, number + 1, used, own, last).added(splats, work, size)

    def added(self, splats: int, work: tuple[int, int], size: int) -> "Pace":
        """The pace after a layer of the frame before, or after bytes that count with it."""
        used, own = self.used, self.own
        return replace(
            self,
            used=Level(used.pixels, used.splats + splats, used.work + work[0], used.payload + size),
            own=Level(own.pixels, own.splats + splats, own.work + work[1], own.payload + size),
        )

    def fault(self, header: SequenceHeader) -> tuple[str, str] | None:
        """The rule that the last frame has broken, R-5-7, R-5-9 or R-5-8, and a sentence; None if it kept them."""
        number = self.next_number - 1
        second = number // header.frames_of_second
        point = self.limits.quality
        sums = [("R-5-7", self.used, self.limits.level), *([("R-5-9", self.own, point.level)] if point else [])]
        for rule, so_far, level in sums:
            for what, used, most in zip(AMOUNTS, astuple(so_far), astuple(second_limits(level)), strict=True):
                if used > most:
                    message = f"with frame {number}, second {second} has {used} {what}; level {level} allows {most}"
                    by = ", that of the quality's operating point," if rule == "R-5-9" else ""
                    return rule, f"{message}{by} in a second of a paced stream"
        distance, longest = number - self.last_i_frame, I_FRAME_SECONDS * header.frames_of_second
        if distance >= longest:
            message = f"frame {number} follows the last I-frame by {distance} frames"
            return "R-5-8", f"{message}; in this paced stream each {longest}th must be an I-frame, at least"
        return None


def second_limits(level: int) -> Level:
    """The limits of a second of a level; the payload stands for the bytes of whole chunks."""
    limits = LEVELS[level]
    return Level(
        PER_SECOND.pixels * limits.pixels,
        PER_SECOND.splats * limits.splats,
        PER_SECOND.work * limits.work,
        PER_SECOND.payload * limits.payload,
    )
