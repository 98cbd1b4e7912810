"""AVC, HEVC, AV1 and VVC as ffmpeg has them: how they are asked, what is counted, and what they say they did."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from gsvc_lab.bench import ffmpeg
from gsvc_lab.bench.ffmpeg import FfmpegError
from gsvc_lab.bench.planes import PlanarClip
from gsvc_ref.video.color import Plane

_X264: Final = r"subme=8 psy=0 .*chroma_qp_offset={chroma} .*bframes={b} .*aq=\d:0\.00"
"""What x264 says of preset slow, tuned for PSNR."""

SCAN: Final = 8192
"""Bytes at the start of a stream in which x264 and x265 state their options."""


@dataclass(frozen=True)
class Variant:
    """One way to ask a codec."""

    name: str  # name for tables
    options: tuple[str, ...]  # options of ffmpeg
    evidence: str  # a regular expression that the codec's own report matches if they took effect


@dataclass(frozen=True)
class Codec:
    """A codec of ffmpeg."""

    standard: str  # Its names
    library: str
    container: str  # ffmpeg's name of the bare stream
    quality: tuple[str, str]  # the option that sets the quality, as ffmpeg and as tables call it
    values: tuple[int, ...]  # values of that option, from coarse to fine
    # Types of units that are taken out before the bytes are counted, since pictures do not need them
    removed_units: str | None
    bit_depth: int  # bits of a sample of the coded pictures
    thread_option: tuple[str, str]  # options that set the number of threads; ``{}`` stands for it
    # Regular expressions of what is worth quoting from the codec's report: its version, its preset
    facts: tuple[str, ...]
    variants: tuple[Variant, ...]  # the one that verdicts are about first

    def label(self, variant: int = 0) -> str:
        """The name of a variant in tables."""
        return f"{self.standard} ({self.library}), {self.variants[variant].name}"


CODECS: Final = (
    Codec(
        standard="AVC",
        library="libx264",
        container="h264",
        quality=("-crf", "CRF"),
        values=(40, 34, 28, 22, 16, 10),
        removed_units="6",  # SEI
        bit_depth=8,
        thread_option=("-threads", "{}"),
        facts=(r"x264 - core \d+",),
        variants=(
            Variant("slow", ("-preset", "slow", "-tune", "psnr"), _X264.format(chroma=0, b=3)),
            Variant(
                "slow, I and P only", ("-preset", "slow", "-tune", "psnr", "-bf", "0"), _X264.format(chroma=0, b=0)
            ),
            Variant(
                "slow, I and P only, chroma QP −5",
                ("-preset", "slow", "-tune", "psnr", "-bf", "0", "-x264-params", "chroma-qp-offset=-5"),
                _X264.format(chroma=-5, b=0),
            ),
            Variant("slow, psychovisual", ("-preset", "slow"), r"subme=8 psy=1 .*bframes=3 .*aq=1:1\.00"),
        ),
    ),
    Codec(
        standard="HEVC",
        library="libx265",
        container="hevc",
        quality=("-crf", "CRF"),
        values=(40, 34, 28, 22, 16, 10),
        removed_units="39",  # SEI
        bit_depth=8,
        thread_option=("-x265-params", "pools={}"),
        facts=(r"x265 \(build \d+\) - [^:\s]+",),
        variants=(Variant("slow", ("-preset", "slow", "-tune", "psnr"), r" rect .*psy-rd=0\.00 .*aq-strength=0\.00"),),
    ),
    Codec(
        standard="AV1",
        library="libsvtav1",
        container="obu",
        quality=("-crf", "CRF"),
        values=(60, 50, 40, 30, 20, 10),
        removed_units=None,
        bit_depth=8,
        thread_option=("-svtav1-params", "lp={}"),
        facts=(r"SVT-AV1 Encoder Lib \S+", r"preset / tune / pred struct\s*: .+", r"gop size / mini-gop size.*"),
        variants=(
            Variant(
                "preset 4", ("-preset", "4", "-svtav1-params", "tune=1"), r"preset / tune / pred struct\s*: 4 / PSNR"
            ),
        ),
    ),
    Codec(
        standard="VVC",
        library="libvvenc",
        container="vvc",
        quality=("-qp", "QP"),
        values=(43, 38, 33, 28, 23, 18),
        removed_units="20",  # access unit delimiters
        bit_depth=10,
        thread_option=("-threads", "{}"),
        facts=(r"libvvenc version: \S+", r"Intra period \(keyframe\)\s*: \d+"),
        variants=(Variant("medium", ("-qpa", "0", "-period", "60"), r"Perceptual optimization\s*: Disabled"),),
    ),
)
"""All are tuned for PSNR but one, and all have hierarchies of B-frames and look ahead but two.

CRF 30 to 10 and QP 28 to 18 are about the paper's. Coarser values are added so that the curves meet GSVC's; AV1's scale
ends at 63, that of the others at 51. By default vvenc would set a key frame each second, the other codecs each 161 to
250 frames; here its period is a minute.
"""


@dataclass(frozen=True)
class Coded:
    """A coded clip."""

    path: Path  # the stream, without the units that are not counted
    bytes: int  # its size
    removed_bytes: int  # size of what was taken out
    seconds: float  # Time of encoding, from the start of ffmpeg to its end
    cpu_seconds: float
    report: str  # the codec's own words about its settings

    def quoted(self, codec: Codec) -> list[str]:
        """The part of the report that is worth quoting, with single spaces."""
        found = (re.search(fact, self.report) for fact in codec.facts)
        return [re.sub(r"\s+", " ", match[0]) for match in found if match]

    def shows(self, variant: Variant) -> bool:
        """Whether the codec's report says that a variant's options are in effect."""
        return re.search(variant.evidence, self.report) is not None


def encode(clip: PlanarClip, codec: Codec, variant: Variant, value: int, folder: Path, threads: int | None) -> Coded:
    """Encode a clip.

    An FfmpegError says that the program lacks the encoder or a filter, or fails.
    """
    if codec.library not in ffmpeg.encoders():
        raise FfmpegError(f"this ffmpeg has no {codec.library}; set IMAGEIO_FFMPEG_EXE to one that has")
    whole, counted = (folder / f"{name}.{codec.container}" for name in ("whole", "counted"))
    options = _merged([*variant.options, *_thread_options(codec, threads), codec.quality[0], str(value)])
    ran = ffmpeg.run(
        [*clip.as_input(), "-c:v", codec.library, *options, "-f", codec.container, ffmpeg.file_url(whole)],
        loglevel="verbose",
    )
    report = ran.log + whole.read_bytes()[:SCAN].decode("latin-1")
    size = whole.stat().st_size
    if codec.removed_units is None:
        whole.replace(counted)
    else:
        taken_out = f"filter_units=remove_types={codec.removed_units}"
        ffmpeg.run(
            [
                "-f", codec.container, "-i", ffmpeg.file_url(whole), "-c", "copy", "-bsf:v", taken_out,
                "-f", codec.container, ffmpeg.file_url(counted),
            ]
        )  # fmt: skip
    kept = counted.stat().st_size
    return Coded(counted, kept, size - kept, ran.seconds, ran.cpu_seconds, report)


def _thread_options(codec: Codec, threads: int | None) -> list[str]:
    if threads is None:
        return []
    option, value = codec.thread_option
    return [option, value.format(threads)]


def _merged(options: list[str]) -> list[str]:
    """Options with those that stand twice, as ``-svtav1-params``, joined by a colon."""
    merged: dict[str, str] = {}
    for option, value in zip(options[::2], options[1::2], strict=True):
        merged[option] = f"{merged[option]}:{value}" if option in merged else value
    return [word for pair in merged.items() for word in pair]


def decoding_seconds(coded: Coded, codec: Codec) -> float:
    """Seconds to decode a clip and throw its pictures away, from the start of ffmpeg to its end."""
    return ffmpeg.run(["-f", codec.container, "-i", ffmpeg.file_url(coded.path), "-f", "null", "-"]).seconds


def decode(coded: Coded, codec: Codec, clip: PlanarClip) -> Iterator[tuple[Plane, Plane, Plane]]:
    """The decoded planes of each frame, u1; what was coded with more bits is rounded to 8.

    An FfmpegError says that it does not decode, or to another number of frames.
    """
    wide = codec.bit_depth > 8
    arguments = ["-f", codec.container, "-i", ffmpeg.file_url(coded.path), "-fps_mode", "passthrough"]
    arguments += ["-pix_fmt", f"yuv420p{codec.bit_depth}le" if wide else "yuv420p", "-f", "rawvideo"]
    count = 0
    for data in ffmpeg.pictures(arguments, clip.frame_bytes * (2 if wide else 1)):
        samples = np.frombuffer(data, "<u2" if wide else "u1")
        if wide:
            shift = codec.bit_depth - 8
            samples = np.minimum((samples + (1 << (shift - 1))) >> shift, 255).astype(np.uint8)
        yield clip.split(samples)
        count += 1
    if count != clip.frame_count:
        raise FfmpegError(f"{codec.library} decodes to {count} frames instead of {clip.frame_count}")
