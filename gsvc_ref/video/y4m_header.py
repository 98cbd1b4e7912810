"""The header of YUV4MPEG2 (.y4m): a line of text about the video.

What the header cannot say by its common tags (primaries, transfer, matrix, siting) goes into a vendor tag of ours,
``XGSVC_COLOR=primaries:transfer:matrix:full_range:chroma_location``, which other readers skip.
"""

import re
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final, Literal, cast

from gsvc_base.errors import GsvcError
from gsvc_ref.video.format import (
    MAX_RATIO_TERM,
    ChromaFormat,
    ColorDescription,
    VideoFormat,
    assumed_matrix,
    check_size,
    complete_color,
)

Y4M_SIGNATURE: Final = b"YUV4MPEG2"

SITING_BY_TAG: Final = {"jpeg": 1, "mpeg2": 0, "paldv": 2, "": 1}
"""ChromaLocType of C420xxx; C420 alone has always meant C420jpeg."""
TAG_BY_SITING: Final = {0: "mpeg2", 1: "jpeg", 2: "paldv"}

INTERLACING: Final = {"t": "top field first", "b": "bottom field first", "m": "mixed"}


@dataclass(frozen=True)
class Header:
    """A parsed stream header."""

    format: VideoFormat  # complete
    mono: bool  # no chroma planes
    notes: list[str]  # sentences about what was assumed


def malformed(name: str, problem: str) -> GsvcError:
    """The error for data that break the format."""
    return GsvcError("malformed", f"{name} is not a valid y4m file: {problem}; write it again, for example with ffmpeg")


def _ratio(name: str, tag: str, text: str) -> Fraction | None:
    """A ratio such as ``30000:1001``; None for the "unknown" 0:0."""
    match = re.fullmatch(r"(\d{1,10}):(\d{1,10})", text)
    if match is None:
        raise malformed(name, f"{tag}{text} is not a ratio such as {tag}30:1")
    numerator, denominator = int(match[1]), int(match[2])
    if numerator == denominator == 0:
        return None
    if not (0 < numerator <= MAX_RATIO_TERM and 0 < denominator <= MAX_RATIO_TERM):
        raise malformed(name, f"both terms of {tag}{text} must be 1 to {MAX_RATIO_TERM}")
    return Fraction(numerator, denominator)


def _color_space(name: str, text: str) -> tuple[ChromaFormat, int, int | None, bool]:
    """Split the C tag: chroma format, bit depth, ChromaLocType if stated, mono."""
    match = re.fullmatch(
        r"mono(?P<mono>\d+)?|(?P<chroma>420|422|444)(?:p(?P<depth>\d+)|(?P<site>jpeg|mpeg2|paldv))?", text
    )
    depth = int((match["mono"] or match["depth"] or "8")[:3]) if match else 0
    if match is None or not 8 <= depth <= 16 or (match["site"] and match["chroma"] != "420"):
        raise GsvcError(
            "unsupported",
            f"{name} has the y4m colour space C{text}; supported are 420, 420jpeg, 420mpeg2, 420paldv, 422, 444 and "
            f"mono with 8 bits, and 420pN, 422pN, 444pN, monoN with N = 9 to 16: convert it, for example with ffmpeg",
        )
    chroma = cast(ChromaFormat, match["chroma"] or "420")
    siting = SITING_BY_TAG[match["site"] or ""] if chroma == "420" and match["depth"] is None else None
    return chroma, depth, 0 if match["chroma"] is None else siting, match["chroma"] is None


def _vendor_color(name: str, text: str) -> ColorDescription:
    match = re.fullmatch(r"(\d{1,3}):(\d{1,3}):(\d{1,3}):([01]):([0-5])", text)
    if match is None or max(int(match[i]) for i in (1, 2, 3)) > 255:
        raise malformed(name, f"XGSVC_COLOR={text} is not primaries:transfer:matrix:full_range:chroma_location")
    return ColorDescription(int(match[1]), int(match[2]), int(match[3]), match[4] == "1", int(match[5]))


def parse_header(line: bytes, name: str) -> Header:
    """Parse the first line of a stream, without its newline.

    A GsvcError is ``malformed``, ``unsupported`` (a colour space) or ``limit`` (the size).
    """
    first, *words = line.split(b" ")
    if first != Y4M_SIGNATURE:
        raise malformed(name, f"it does not begin with {Y4M_SIGNATURE.decode()}")
    tags: dict[str, str] = {}
    vendor: dict[str, str] = {}
    for word in filter(None, words):
        text = word.decode("ascii", "backslashreplace")
        if text[0] == "X":
            key, _, value = text[1:].partition("=")
            vendor[key] = value
        elif text[0] in tags:
            raise malformed(name, f"the tag {text[0]} stands twice in its header")
        else:
            tags[text[0]] = text[1:]
    sides = [tags.get(tag, "") for tag in "WH"]
    if not all(re.fullmatch(r"\d{1,9}", side) for side in sides):
        raise malformed(name, f"its header must state the size as W and H with whole numbers, found {sides}")
    width, height = int(sides[0]), int(sides[1])
    check_size(width, height, name)

    notes = []
    interlacing = tags.get("I", "?")
    if interlacing in INTERLACING:
        notes.append(f"{name} is interlaced ({INTERLACING[interlacing]}); its frames are read as if progressive")
    elif interlacing not in ("p", "?"):
        raise malformed(name, f"I{interlacing} is not one of Ip, It, Ib, Im, I?")
    chroma_format, bit_depth, siting, mono = _color_space(name, tags.get("C", "420"))
    if mono:
        notes.append(f"{name} is monochrome; its frames are read as grey")
    full_range = {"FULL": True, "LIMITED": False}.get(vendor.get("COLORRANGE", ""))
    if "GSVC_COLOR" in vendor:
        stated = _vendor_color(name, vendor["GSVC_COLOR"])
        color, assumed = complete_color(name, height, chroma_format, **vars(stated))
    else:
        color, assumed = complete_color(
            name, height, chroma_format, full_range=full_range, chroma_location=siting, matrix=6 if mono else 2
        )
    frame_rate = _ratio(name, "F", tags.get("F", "0:0"))
    if frame_rate is None:
        notes.append(f"frame rate not stated by {name}, so assumed: 25 per second")
    aspect = _ratio(name, "A", tags.get("A", "0:0")) or Fraction(1)
    video = VideoFormat(width, height, frame_rate or Fraction(25), bit_depth, chroma_format, color, aspect)
    return Header(video, mono, notes + assumed)


def planar_format(video: VideoFormat) -> VideoFormat:
    """The format that y4m carries instead of ``rgb``: 4:4:4, limited range, the matrix of `assumed_matrix`.

    Limited range and that matrix are what other programs take when they have to guess. A format with planes, and with
    a stated matrix, is returned as it is.
    """
    matrix: int = assumed_matrix(video.height)
    if video.chroma_format == "rgb":
        color = replace(video.color, matrix=matrix, full_range=False)
        return replace(video, chroma_format="444", color=color)
    if video.color.matrix == 2:
        return replace(video, color=replace(video.color, matrix=matrix))
    return video


def format_header(video: VideoFormat) -> bytes:
    """The stream header of a format that is not ``rgb``, with its newline."""
    chroma, color = video.chroma_format, video.color
    if video.bit_depth > 8:
        space = f"{chroma}p{video.bit_depth}"
    else:
        space = chroma + (TAG_BY_SITING.get(color.chroma_location, "") if chroma == "420" else "")
    rate, aspect = video.frame_rate, video.sample_aspect_ratio
    span: Literal["FULL", "LIMITED"] = "FULL" if color.full_range else "LIMITED"
    codes = f"{color.primaries}:{color.transfer}:{color.matrix}:{color.full_range:d}:{color.chroma_location}"
    return (
        f"{Y4M_SIGNATURE.decode()} W{video.width} H{video.height} F{rate.numerator}:{rate.denominator} Ip "
        f"A{aspect.numerator}:{aspect.denominator} C{space} XCOLORRANGE={span} XGSVC_COLOR={codes}\n"
    ).encode()
