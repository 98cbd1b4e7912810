"""The format of a video: size, rate, bit depth, chroma format and colour description (ITU-T H.273)."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final, Literal, get_args

import numpy as np

from gsvc_base.arrays import Frame as Frame
from gsvc_base.checks import check_unmasked, check_whole
from gsvc_base.errors import GsvcError, UsageError

ChromaFormat = Literal["rgb", "420", "422", "444"]

MAX_DIMENSION: Final = 65535
MAX_PIXELS: Final = 2**28
"""Largest width x height that is read (16384 x 16384), so that a forged header cannot claim gigabytes."""
MAX_RATIO_TERM: Final = 2**31 - 1
"""Largest numerator and denominator of a frame rate or sample aspect ratio."""

UNSPECIFIED: Final = 2
"""H.273 code point "unspecified" of primaries, transfer and matrix."""

MATRIX_NAMES: Final = {
    0: "identity (R'G'B')",
    1: "BT.709",
    4: "FCC",
    5: "BT.601",
    6: "BT.601",
    7: "SMPTE 240M",
    8: "YCgCo",
    9: "BT.2020 non-constant luminance",
}
"""Matrix code points that can be converted (H.273 table 4)."""

SITING_NAMES: Final = ("left", "centre", "top left", "top", "bottom left", "bottom")
"""H.273 ChromaLocType 0 to 5."""


@dataclass(frozen=True)
class ColorDescription:
    """The colours that numbers stand for: code points of ITU-T H.273."""

    primaries: int  # ColourPrimaries, 0 to 255; 2 is "unspecified" for all three
    transfer: int  # TransferCharacteristics
    matrix: int  # MatrixCoefficients
    full_range: bool  # VideoFullRangeFlag
    chroma_location: int  # ChromaLocType, 0 to 5; only its horizontal part counts for 4:2:2, nothing for 4:4:4, R'G'B'

    def __post_init__(self) -> None:
        for name in ("primaries", "transfer", "matrix"):
            if not 0 <= getattr(self, name) <= 255:
                raise UsageError(f"{name} is {getattr(self, name)}; an H.273 code point is 0 to 255")
        if not 0 <= self.chroma_location <= 5:
            raise UsageError(f"chroma_location is {self.chroma_location}; an H.273 ChromaLocType is 0 to 5")


@dataclass(frozen=True)
class VideoFormat:
    """The format of a source, or the one that a writer is to produce; frames themselves are always R'G'B'."""

    width: int  # 1 to 65535 pixels, as height
    height: int
    frame_rate: Fraction
    bit_depth: int  # 8 to 16
    chroma_format: ChromaFormat  # ``rgb`` has no Y'CbCr planes at all
    color: ColorDescription  # of the planes
    sample_aspect_ratio: Fraction = Fraction(1)  # width of a pixel divided by its height
    frame_count: int | None = None  # that the file states: a hint for progress displays, which reading may contradict

    def __post_init__(self) -> None:
        if not (1 <= self.width <= MAX_DIMENSION and 1 <= self.height <= MAX_DIMENSION):
            raise UsageError(f"the size is {self.width}x{self.height}; width and height must be 1 to {MAX_DIMENSION}")
        if not 8 <= self.bit_depth <= 16:
            raise UsageError(f"bit_depth is {self.bit_depth}; it must be 8 to 16")
        if self.frame_count is not None and self.frame_count < 0:
            raise UsageError(f"frame_count is {self.frame_count}; it must be None (unknown), 0 or more")
        if self.chroma_format not in get_args(ChromaFormat):
            raise UsageError(f"chroma_format is {self.chroma_format!r}; it must be one of {get_args(ChromaFormat)}")
        for name in ("frame_rate", "sample_aspect_ratio"):
            ratio: Fraction = getattr(self, name)
            if ratio <= 0 or max(ratio.numerator, ratio.denominator) > MAX_RATIO_TERM:
                raise UsageError(f"{name} is {ratio}; it must be a positive Fraction with terms up to {MAX_RATIO_TERM}")
        if self.color.matrix == 0 and self.chroma_format in ("420", "422"):
            raise UsageError("matrix 0 (identity) has no chroma to subsample; use chroma_format 'rgb' or '444'")

    @property
    def peak(self) -> int:
        """The largest sample value, 2^bit_depth - 1."""
        return (1 << self.bit_depth) - 1

    @property
    def dtype(self) -> np.dtype[np.unsignedinteger[Any]]:
        """u1 for 8 bits, else u2."""
        return np.dtype(np.uint8 if self.bit_depth == 8 else np.uint16)

    @property
    def plane_shapes(self) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
        """(rows, columns) of the Y', Cb and Cr planes; a subsampled side is half, rounded up."""
        rows = (self.height + 1) // 2 if self.chroma_format == "420" else self.height
        columns = (self.width + 1) // 2 if self.chroma_format in ("420", "422") else self.width
        return (self.height, self.width), (rows, columns), (rows, columns)


FrameRate = Fraction | int | float | str
"""Frames per second; a decimal number is taken as it is written, a text as ``30000/1001`` or ``29.97``."""


def exact_frame_rate(value: FrameRate) -> Fraction:
    """A frame rate above 0 as the ratio that it is written as."""
    try:
        rate = value if isinstance(value, Fraction) else Fraction(str(value))
    except (ValueError, ZeroDivisionError):
        rate = Fraction(0)
    if rate <= 0 or isinstance(value, bool):
        raise UsageError(f"frame_rate is {value!r}; it must be a number above 0, such as 25 or Fraction(30000, 1001)")
    return rate


def array_format(width: int, height: int, frame_rate: FrameRate, bit_depth: int) -> VideoFormat:
    """The format of an array, of which only these numbers are known: R'G'B' at full range, of unspecified colours."""
    for name, value in (("width", width), ("height", height), ("bit_depth", bit_depth)):
        check_whole(name, value)
    color = ColorDescription(UNSPECIFIED, UNSPECIFIED, 0, full_range=True, chroma_location=0)
    return VideoFormat(int(width), int(height), exact_frame_rate(frame_rate), int(bit_depth), "rgb", color)


def check_frame(frame: Frame, video: VideoFormat) -> None:
    """Refuse an array that is not a frame of this format, or has a sample above the peak."""
    check_unmasked("the frame", frame)
    expected = (video.height, video.width, 3)
    if frame.shape != expected or frame.dtype != video.dtype:
        raise UsageError(
            f"the frame is {frame.dtype} of shape {frame.shape}; {video.bit_depth}-bit video of this size takes "
            f"{video.dtype} of shape {expected}"
        )
    if 8 < video.bit_depth < 16 and int(frame.max()) > video.peak:
        raise UsageError(f"the frame holds the sample {int(frame.max())}; {video.bit_depth} bits end at {video.peak}")


def check_size(width: int, height: int, name: str) -> None:
    """Refuse sizes before anything is allocated.

    A GsvcError is ``malformed`` for a side of 0, ``limit`` for more than 65535 on a side or 2^28 pixels.
    """
    if width < 1 or height < 1:
        raise GsvcError("malformed", f"{name} states the size {width}x{height}; both must be at least 1")
    if max(width, height) > MAX_DIMENSION or width * height > MAX_PIXELS:
        raise GsvcError(
            "limit",
            f"{name} states the size {width}x{height}; at most {MAX_DIMENSION} on a side and {MAX_PIXELS} pixels in "
            f"all are read: scale the video down first",
        )


def assumed_matrix(height: int) -> int:
    """The matrix that is taken when none is stated: BT.601 (6) up to 576 rows, else BT.709 (1)."""
    return 6 if height <= 576 else 1


def complete_color(
    name: str,
    height: int,
    chroma_format: ChromaFormat,
    *,
    primaries: int = UNSPECIFIED,
    transfer: int = UNSPECIFIED,
    matrix: int = UNSPECIFIED,
    full_range: bool | None = None,
    chroma_location: int | None = None,
) -> tuple[ColorDescription, list[str]]:
    """Fill in what a file leaves open, and say so: the description, and a list of no or one sentence.

    Unstated primaries and transfer stay unstated, since no conversion here depends on them. A GsvcError is
    ``unsupported`` if the stated matrix is none of MATRIX_NAMES, ``invalid`` if it is identity with subsampling.
    """
    assumed = []
    if matrix == UNSPECIFIED:
        matrix = assumed_matrix(height)
        rule = "at most 576 rows" if matrix == 6 else "more than 576 rows"
        assumed.append(f"matrix {MATRIX_NAMES[matrix]} ({rule})")
    if matrix not in MATRIX_NAMES:
        raise GsvcError(
            "unsupported",
            f"{name} has the colour matrix {matrix} of ITU-T H.273; {sorted(MATRIX_NAMES)} are supported: convert the "
            f"video to BT.709 or BT.2020 non-constant luminance first",
        )
    if matrix == 0 and chroma_format in ("420", "422"):
        raise GsvcError(
            "invalid",
            f"{name} states the identity matrix for {chroma_format} planes, but R'G'B' cannot be subsampled: correct "
            f"the colour tags of the file",
        )
    if full_range is None:
        full_range = False
        assumed.append("limited range")
    if chroma_location is None:
        chroma_location = 0
        if chroma_format in ("420", "422"):
            assumed.append("chroma siting left")
    notes = [f"colour not stated by {name}, so assumed: {', '.join(assumed)}"] if assumed else []
    return ColorDescription(primaries, transfer, matrix, full_range, chroma_location), notes
