"""The contents of a report as plain data; whatever can be derived is derived here, so that no two numbers disagree."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.arrays import Frame
from gsvc_ref.errors import UsageError

FrameType = Literal["I", "P", "R"]

FRAME_TYPES: Final[tuple[FrameType, ...]] = get_args(FrameType)


@dataclass(frozen=True)
class Figure:
    """One more key number for the top of the page.

    Attributes
    ----------
    label
        Name of the number.
    value
        The number as text.
    unit
        Its unit, or nothing.
    note
        One short line below it, or nothing.
    """

    label: str
    value: str
    unit: str = ""
    note: str = ""


@dataclass(frozen=True)
class Choice:
    """The decision about one effect of a frame.

    Attributes
    ----------
    effect
        Its name.
    state
        ``done``, ``skipped`` (all or part of it was left out), or ``off``.
    reason
        Why.
    """

    effect: str
    state: Literal["done", "skipped", "off"]
    reason: str


@dataclass(frozen=True)
class FrameRecord:
    """The cost of one frame, and its quality.

    Attributes
    ----------
    number
        Frame number from 0.
    type
        ``I`` (on its own), ``P`` (predicted) or ``R`` (repeat).
    psnr
        dB of the decoded frame; infinite when it is identical to the original.
    bits_by_attribute
        Bits of the frame's unit in the file by what they describe, headers included.
    splats
        Splats that the frame is rendered from.
    iterations
        Optimisation steps spent on it.
    seconds
        Wall time of its encoding.
    reason
        Reason for the type of the frame; may be empty.
    choices
        Decisions about each effect; the same effects in the same order for all frames, or none.
    """

    number: int
    type: FrameType
    psnr: float
    bits_by_attribute: Mapping[str, int]
    splats: int
    iterations: int
    seconds: float
    reason: str = ""
    choices: Sequence[Choice] = ()

    def __post_init__(self) -> None:
        if self.type not in FRAME_TYPES:
            raise UsageError(f"frame {self.number} has type {self.type!r}; the types are {', '.join(FRAME_TYPES)}")
        if math.isnan(self.psnr):
            raise UsageError(f"the PSNR of frame {self.number} is NaN; it must be a number of dB or infinite")
        if any(bits < 0 for bits in self.bits_by_attribute.values()):
            raise UsageError(f"frame {self.number} has a negative number of bits")

    @property
    def bits(self) -> int:
        """Bits of the frame's unit in the file."""
        return sum(self.bits_by_attribute.values())


@dataclass(frozen=True, eq=False)
class PictureRow:
    """One frame to look at.

    Attributes
    ----------
    number
        Frame number from 0.
    original, decoded
        (H, W, 3) u1 or u2 frames of one size.
    positions
        (N, 2) f4, centres of the decoded splats in pixels.
    cholesky
        (N, 3) f4, their (l11, l21, l22) in pixels; None draws no ellipses.
    caption
        Reason for showing this frame; may be empty.
    """

    number: int
    original: Frame
    decoded: Frame
    positions: NDArray[np.float32]
    cholesky: NDArray[np.float32] | None = None
    caption: str = ""

    def __post_init__(self) -> None:
        if self.original.shape != self.decoded.shape:
            raise UsageError(
                f"frame {self.number} is {self.original.shape} before and {self.decoded.shape} after coding; "
                "the report shows frames of one size"
            )


@dataclass(frozen=True, eq=False)
class ReportData:
    """All that a report tells about one encoding.

    Attributes
    ----------
    title
        Heading of the page.
    command
        The command line that made the file.
    introduction
        A paragraph on what was coded.
    width, height
        Size in pixels.
    frame_rate
        Frames per second.
    bit_depth
        Bits per sample.
    preset
        Name of the encoder's settings.
    file_bytes
        Size of the file.
    bits_by_attribute
        Every bit of the file by what it describes; adds up to 8 `file_bytes`.
    stages
        Seconds of wall time by what they were spent on, in order.
    frames
        One record per frame, in order.
    ms_ssim, vmaf
        Means over the frames, or None when they were not measured.
    figures
        More key numbers.
    pictures
        Frames to look at.
    preview_original, preview_decoded
        Equally many frames for the animation; none for no animation.
    savings
        A sentence on what the encoder left out; may be empty.
    notes
        Sentences that a reader must know.
    environment
        Names and values that describe the machine.
    """

    title: str
    command: str
    introduction: str
    width: int
    height: int
    frame_rate: Fraction
    bit_depth: int
    preset: str
    file_bytes: int
    bits_by_attribute: Mapping[str, int]
    stages: Mapping[str, float]
    frames: Sequence[FrameRecord]
    ms_ssim: float | None = None
    vmaf: float | None = None
    figures: Sequence[Figure] = ()
    pictures: Sequence[PictureRow] = ()
    preview_original: Sequence[Frame] = ()
    preview_decoded: Sequence[Frame] = ()
    savings: str = ""
    notes: Sequence[str] = ()
    environment: Mapping[str, str] = field(default_factory=dict)

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
        if len(self.preview_original) != len(self.preview_decoded):
            raise UsageError(
                f"the preview has {len(self.preview_original)} original and {len(self.preview_decoded)} decoded "
                "frames; there must be equally many"
            )

    @property
    def peak(self) -> int:
        """Largest sample value."""
        return (1 << self.bit_depth) - 1

    @property
    def bits_per_pixel(self) -> float:
        """Bits of the whole file per pixel of the video."""
        return 8 * self.file_bytes / (self.width * self.height * len(self.frames))

    @property
    def bits_per_second(self) -> float:
        """Bits of the whole file per second of the video."""
        return 8 * self.file_bytes * float(self.frame_rate) / len(self.frames)

    @property
    def mean_psnr(self) -> float:
        """Mean of the frames' PSNR in dB; infinite as soon as one frame is identical."""
        return math.fsum(frame.psnr for frame in self.frames) / len(self.frames)

    @property
    def compression(self) -> float:
        """Size of the unpacked R'G'B' samples over the size of the file."""
        raw_bits = self.width * self.height * 3 * self.bit_depth * len(self.frames)
        return raw_bits / (8 * self.file_bytes)
