"""What x264 needs for the PSNR that a file has, on its first frames."""

import math
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Final

from gsvc_base.arrays import Frame
from gsvc_base.errors import UsageError
from gsvc_lab.bench import codecs
from gsvc_lab.bench.codecs import CODECS, Variant
from gsvc_lab.bench.planes import PlanarClip, from_any
from gsvc_ref.metrics import psnr
from gsvc_ref.video import open_video, to_rgb
from gsvc_ref.video.alpha import Background

X264: Final = CODECS[0]
VARIANTS: Final = (1, 0)
"""The variants of x264 that are asked: I- and P-frames only, and as its preset has it."""

CRF: Final = (1, 51)
"""The finest and the coarsest quality that is tried; 0 is without loss."""

START: Final = 28
SLOPE: Final = 0.85
"""Decibels that a step of the CRF costs, roughly: where to try next."""

MAX_PIXELS: Final = 40_000_000
MIN_FRAMES: Final = 16
MAX_CLIP_FRAMES: Final = 250
"""Pixels of all frames that x264 gets, about, and how many frames that may be."""

Say = Callable[[str], None]


@dataclass(frozen=True)
class Peer:
    """A coder at the PSNR of the file."""

    name: str  # its name with its variant
    # Bits for all frames, between those of the two settings on both sides in the logarithm; None if it does not come to
    # that PSNR
    bits: float | None
    settings: str  # these two settings with their PSNR, in words


def sample_frames(width: int, height: int, count: int) -> int:
    """The number of frames that x264 gets of a clip of `count` frames."""
    most = min(max(MAX_PIXELS // (width * height), MIN_FRAMES), MAX_CLIP_FRAMES)
    return min(most, count)


def x264_at(
    source: str, start: int, frames: int, goal: float, say: Say, background: Background | None = None
) -> tuple[list[Peer], str]:
    """Bits of x264 for frames of a source at a PSNR, and a sentence on the planes that it got.

    `source`: anything that `open_video` reads, of 8 bits. `start` and `frames`: the first frame, and how many. `goal`:
    mean PSNR of R'G'B' in dB that it has to reach. `say`: called with what is done. An FfmpegError says that there is
    no ffmpeg, or it fails. A UsageError or GsvcError says that the source cannot be read again, or has fewer frames.
    `background` is what is behind transparent pictures.
    """
    with tempfile.TemporaryDirectory(prefix="gsvc-report-") as name:
        folder = Path(name)
        say("frames for x264")
        with open_video(source, background=background) as reader:
            even = (reader.format.width // 2 * 2, reader.format.height // 2 * 2)
        clip = from_any(source, folder / "clip.yuv", frames, start=start, background=background)
        if (clip.format.width, clip.format.height) != even or clip.frame_count != frames:
            raise UsageError("ffmpeg reads frames of another size or number than gsvc_ref does")
        found = []
        for number in VARIANTS:
            variant = X264.variants[number]

            def measure(crf: int, variant: Variant = variant) -> tuple[int, float]:
                say(f"x264 {variant.name}, CRF {crf}")
                return _coded(clip, lambda: _originals(source, start, background), variant, crf, folder)

            found.append(_at(X264.label(number), goal, measure))
        return found, clip.note


def _coded(
    clip: PlanarClip, originals: Callable[[], Iterator[Frame]], variant: Variant, crf: int, folder: Path
) -> tuple[int, float]:
    """Bits, and mean PSNR against the source in dB."""
    coded = codecs.encode(clip, X264, variant, crf, folder, None)
    height, width = clip.format.height, clip.format.width
    levels = [
        psnr(original[:height, :width], to_rgb(planes, clip.format), 255)
        for original, planes in zip(originals(), codecs.decode(coded, X264, clip), strict=False)
    ]
    return 8 * coded.bytes, math.fsum(levels) / len(levels)


def _originals(source: str, start: int, background: Background | None) -> Iterator[Frame]:
    with open_video(source, background=background) as reader:
        yield from islice(reader, start, None)


def _at(name: str, goal: float, measure: Callable[[int], tuple[int, float]]) -> Peer:
    """Bits at a PSNR between two neighbouring settings, which are found by stepping towards it."""
    known: dict[int, tuple[int, float]] = {}

    def level(crf: int) -> float:
        if crf not in known:
            known[crf] = measure(crf)
        return known[crf][1]

    fine, coarse = CRF
    value = START
    while coarse - fine > 1:
        reached = level(value)
        fine, coarse = (value, coarse) if reached >= goal else (fine, value)
        guess = value + round((reached - goal) / SLOPE)
        value = min(max(guess, fine + 1), coarse - 1)
    if level(fine) < goal:
        return Peer(name, None, f"CRF {fine}: {level(fine):.2f} dB, which is less")
    if level(coarse) >= goal:
        return Peer(name, known[coarse][0], f"CRF {coarse}: {level(coarse):.2f} dB, its coarsest")
    (bits, upper), (fewer, lower) = known[fine], known[coarse]
    share = (goal - lower) / (upper - lower)
    between = math.exp(math.log(fewer) + share * (math.log(bits) - math.log(fewer)))
    return Peer(name, between, f"between CRF {coarse} ({lower:.2f} dB) and {fine} ({upper:.2f} dB)")
