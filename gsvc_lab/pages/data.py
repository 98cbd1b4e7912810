"""The contents of a report as plain data; whatever can be derived is derived here, so that no two numbers disagree."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import Frame
from gsvc_base.errors import UsageError
from gsvc_base.pages.page import Figure
from gsvc_base.pages.tables import Table

FrameType = Literal["I", "P", "R"]

FRAME_TYPES: Final[tuple[FrameType, ...]] = get_args(FrameType)


STATE_WORDS: Final = {"done": "done", "skipped": "left out", "off": "switched off"}
"""The states of a `Choice` in words."""


@dataclass(frozen=True)
class Choice:
    """The decision about one effect of a frame."""

    effect: str  # its name
    state: Literal["done", "skipped", "off"]  # ``done``, ``skipped`` (all or part of it was left out), or ``off``
    reason: str  # why


@dataclass(frozen=True)
class FrameRecord:
    """The cost of one frame, and its quality."""

    number: int  # frame number from 0
    type: FrameType  # ``I`` (on its own), ``P`` (predicted) or ``R`` (repeat)
    # dB of the decoded frame; infinite when it is identical to the original, None when that is not known
    psnr: float | None
    bits_by_attribute: Mapping[str, int]  # bits of the frame's unit in the file by what they describe, headers included
    splats: int  # splats that the frame is rendered from
    iterations: int | None = None  # optimisation steps spent on it, or None
    seconds: float | None = None  # wall time of its encoding, or None
    reason: str = ""  # reason for the type of the frame; may be empty
    # Decisions about each effect; the same effects in the same order for all frames, or none
    choices: Sequence[Choice] = ()
    # The last frame, if the record is the mean of several, see `condensed`; None if it is not
    through: int | None = None

    def __post_init__(self) -> None:
        if self.type not in FRAME_TYPES:
            raise UsageError(f"frame {self.number} has type {self.type!r}; the types are {', '.join(FRAME_TYPES)}")
        if self.psnr is not None and math.isnan(self.psnr):
            raise UsageError(f"the PSNR of frame {self.number} is NaN; it must be a number of dB or infinite")
        if any(bits < 0 for bits in self.bits_by_attribute.values()):
            raise UsageError(f"frame {self.number} has a negative number of bits")

    @property
    def bits(self) -> int:
        """Bits of the frame's unit in the file."""
        return sum(self.bits_by_attribute.values())

    @property
    def last(self) -> int:
        """Number of the last frame that the record is about."""
        return self.number if self.through is None else self.through


MAX_MARKS: Final = 480
"""Frames that a chart has room for; of more, several share a mark."""


def condensed(frames: Sequence[FrameRecord], most: int = MAX_MARKS) -> list[FrameRecord]:
    """Means over equally many frames in a row, at most `most` of them; the frames themselves if there are no more."""
    size = -(-len(frames) // most)
    if size == 1:
        return list(frames)
    return [_mean(frames[start : start + size]) for start in range(0, len(frames), size)]


def _mean(frames: Sequence[FrameRecord]) -> FrameRecord:
    """Several frames as one: an I-frame if one of them is."""
    first, count = frames[0], len(frames)
    types = {frame.type for frame in frames}
    levels = [frame.psnr for frame in frames if frame.psnr is not None]
    names = dict.fromkeys(name for frame in frames for name in frame.bits_by_attribute)
    choices = []
    for column in zip(*(frame.choices for frame in frames), strict=True):
        ((state, often),) = Counter(choice.state for choice in column).most_common(1)
        choices.append(Choice(column[0].effect, state, f"{STATE_WORDS[state]} in {often} of {count} frames"))
    return replace(
        first,
        type=next(kind for kind in FRAME_TYPES if kind in types),
        psnr=math.fsum(levels) / len(levels) if levels else None,
        bits_by_attribute={
            name: round(sum(frame.bits_by_attribute.get(name, 0) for frame in frames) / count) for name in names
        },
        splats=round(sum(frame.splats for frame in frames) / count),
        choices=choices,
        through=frames[-1].number,
    )


@dataclass(frozen=True, eq=False)
class PictureRow:
    """One frame to look at."""

    number: int  # frame number from 0
    # original, decoded: (H, W, 3) u1 or u2 frames of one size; `original` is None where it is not known
    original: Frame | None
    decoded: Frame
    positions: NDArray[np.float32]  # (N, 2) f4, centres of the decoded splats in pixels of these
    cholesky: NDArray[np.float32] | None = None  # (N, 3) f4, their (l11, l21, l22) in pixels; None draws no ellipses
    caption: str = ""  # reason for showing this frame; may be empty
    # A part of the frame pixel for pixel, where the frame itself is shown smaller than it is; or None
    detail: "Detail | None" = None

    def __post_init__(self) -> None:
        if self.original is not None and self.original.shape != self.decoded.shape:
            raise UsageError(
                f"frame {self.number} is {self.original.shape} before and {self.decoded.shape} after coding; "
                "the report shows frames of one size"
            )


@dataclass(frozen=True, eq=False)
class Detail:
    """A part of a frame, pixel for pixel."""

    left: int  # Its corner in the frame, in pixels
    top: int
    original: Frame | None  # original, decoded: (H, W, 3) u1 or u2; `original` is None where it is not known
    decoded: Frame
    width: int  # Size of the whole frame
    height: int


@dataclass(frozen=True)
class Layer:
    """One quality of a file with layers."""

    name: str  # ``base``, ``layer 1``,
    bits: int  # bits of all chunks of this layer
    splats: tuple[int, int]  # least and most splats of a frame with it and all below it
    psnr: float | None = None  # mean PSNR of the frames decoded up to this layer in dB; None where it is not known


@dataclass(frozen=True, eq=False)
class ReportData:
    """All that a report tells about one encoding."""

    title: str  # heading of the page
    command: str  # the command line that made the file
    introduction: str  # a paragraph on what was coded
    width: int  # Size in pixels
    height: int
    frame_rate: Fraction  # frames per second
    bit_depth: int  # bits per sample
    preset: str  # name of the encoder's settings; empty where it is not known
    file_bytes: int  # size of the file
    bits_by_attribute: Mapping[str, int]  # every bit of the file by what it describes; adds up to 8 `file_bytes`
    stages: Mapping[str, float]  # seconds of wall time by what they were spent on, in order
    frames: Sequence[FrameRecord]  # one record per frame, in order
    ms_ssim: float | None = None  # Means over the frames, or None when they were not measured
    vmaf: float | None = None
    figures: Sequence[Figure] = ()  # more key numbers
    pictures: Sequence[PictureRow] = ()  # frames to look at
    # Equally many frames for the animation; none for no animation. Without an
    # original only decoded ones.
    preview_original: Sequence[Frame] = ()
    preview_decoded: Sequence[Frame] = ()
    savings: str = ""  # a sentence on what the encoder left out; may be empty
    notes: Sequence[str] = ()  # sentences that a reader must know
    environment: Mapping[str, str] = field(default_factory=dict)  # names and values that describe the machine
    preview_note: str = ""  # a sentence on what the animation leaves out; may be empty
    layers: Sequence[Layer] = ()  # the layers of the file from the base up; none of a file of one layer
    damage: Sequence[str] = ()  # sentences on what is damaged; none of a sound file
    # What other codecs need at equal PSNR, and sentences on how that was measured; None and empty
    # without
    peers: Table | None = None
    peers_note: str = ""
    hint: Sequence[str] = ()  # command lines to go on with

    def __post_init__(self) -> None:
        if not self.frames:
            raise UsageError("a report needs at least one frame")
        if self.width < 1 or self.height < 1 or self.frame_rate <= 0 or not 1 <= self.bit_depth <= 16:
            raise UsageError(
                f"a video of {self.width}x{self.height} pixels, {self.frame_rate} frames per second and "
                f"{self.bit_depth} bits cannot be reported; all must be positive, at most 16 bits"
            )
        if (total := sum(self.bits_by_attribute.values())) != 8 * self.file_bytes:
            raise UsageError(f"the parts have {total} bits, the file of {self.file_bytes} bytes {8 * self.file_bytes}")
        for frame in self.frames:
            if strangers := set(frame.bits_by_attribute) - set(self.bits_by_attribute):
                raise UsageError(f"frame {frame.number} has bits of {strangers}, which the file's parts do not name")
        if len({tuple(choice.effect for choice in frame.choices) for frame in self.frames}) > 1:
            raise UsageError("frames have decisions about different effects; the report shows a row for each effect")
        if self.preview_original and len(self.preview_original) != len(self.preview_decoded):
            raise UsageError(
                f"the preview has {len(self.preview_original)} original and {len(self.preview_decoded)} decoded "
                "frames; there must be equally many"
            )

    @property
    def peak(self) -> int:
        """Largest sample value."""
        return (1 << self.bit_depth) - 1

    @property
    def rate_bits(self) -> int:
        """Bits of the whole file; of a damaged one those of the frames that there are."""
        return sum(frame.bits for frame in self.frames) if self.damage else 8 * self.file_bytes

    @property
    def bits_per_pixel(self) -> float:
        """`rate_bits` per pixel of the video."""
        return self.rate_bits / (self.width * self.height * len(self.frames))

    @property
    def bits_per_second(self) -> float:
        """`rate_bits` per second of the video."""
        return self.rate_bits * float(self.frame_rate) / len(self.frames)

    @property
    def levels(self) -> list[float]:
        """The PSNR of each frame that has one, in dB."""
        return [frame.psnr for frame in self.frames if frame.psnr is not None]

    @property
    def mean_psnr(self) -> float | None:
        """Mean of the frames' PSNR in dB; infinite as soon as one frame is identical, None if none is known."""
        return math.fsum(self.levels) / len(self.levels) if self.levels else None

    @property
    def compression(self) -> float:
        """Size of the unpacked R'G'B' samples over `rate_bits`."""
        raw_bits = self.width * self.height * 3 * self.bit_depth * len(self.frames)
        return raw_bits / self.rate_bits
