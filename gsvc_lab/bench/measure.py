"""One point of a rate-distortion curve: a clip coded in one way, its bits, quality and seconds."""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Final

import numpy as np

import gsvc_ref
from gsvc_base.arrays import Frame
from gsvc_lab.bench import codecs
from gsvc_lab.bench.codecs import Codec, Variant
from gsvc_lab.bench.coders import Coder
from gsvc_lab.bench.ffmpeg import FfmpegError
from gsvc_lab.bench.planes import PlanarClip, from_frames
from gsvc_ref.bitstream.coder import RUN_PARTS
from gsvc_ref.encoder.report import FrameReport
from gsvc_ref.metrics import compare_frames, psnr_from_mse
from gsvc_ref.video import ColorDescription, VideoFormat, to_planes, to_rgb
from gsvc_ref.video.color import Plane

METRICS: Final = {
    "psnr": "PSNR of R′G′B′, dB",
    "psnr_y": "PSNR of Y′, dB",
    "ms_ssim": "MS-SSIM, −10 log₁₀(1 − MS-SSIM), dB",
    "vmaf": "VMAF",
}
"""The metrics that are compared, by the name of the attribute of `Point`."""

PEAK: Final = 255

WARM_UP: Final = VideoFormat(64, 48, Fraction(25), 8, "420", ColorDescription(1, 1, 1, False, 0))
"""The format of a clip of noise that is coded before all others."""

COUNTED_BITS: Final = {"I": 112, "P": 88}
"""Bits of a frame that the design of `main` counts for container, header and end of the coder, beside symbols."""


@dataclass(frozen=True)
class CodeLength:
    """The bits that a file of profile `main` would have if nothing were rounded up."""

    # Code lengths of all symbols by the distributions that a decoder has, a part of a frame rounded down to bits
    symbols: int
    densities: int  # bits of the densities, which the frames send
    counted: int  # COUNTED_BITS of all frames

    @property
    def bits(self) -> int:
        """All of them: what the design calls the ideal code length."""
        return self.symbols + self.densities + self.counted


def code_length(frames: Iterable[FrameReport]) -> CodeLength:
    """The code length of the frames of a stream of profile `main`."""
    symbols = densities = counted = 0
    for frame in frames:
        symbols += sum(frame.bits.get(part, 0) for part in RUN_PARTS)
        densities += frame.bits.get("densities", 0)
        counted += COUNTED_BITS.get(frame.type, 0)
    return CodeLength(symbols, densities, counted)


@dataclass(frozen=True)
class Point:
    """A clip coded in one way."""

    setting: str  # such as ``CRF 30`` or ``N 500``
    bytes: int  # size of all frames
    bits_per_pixel: float  # bits for each pixel of all frames
    psnr: float  # Means over frames in dB; infinite if a frame is equal
    psnr_y: float
    ms_ssim: float  # mean over frames, 0..1
    vmaf: float | None  # mean over frames, or None where it cannot be had
    encoding_seconds: float  # encoding_seconds, encoding_cpu_seconds, decoding_seconds: A frame
    encoding_cpu_seconds: float
    decoding_seconds: float
    splats: int | None = None  # n of GSVC; None for codecs
    # Bits of GSVC's profile `main` that nothing is rounded up in; None for all else
    code_length: CodeLength | None = None

    def quality(self, metric: str) -> float:
        """The value of a metric as curves show it: MS-SSIM in dB; NaN where there is none."""
        value = getattr(self, metric)
        if value is None:
            return math.nan
        if metric == "ms_ssim":
            return -10 * math.log10(1 - value) if value < 1 else math.inf
        return float(value)


@dataclass(frozen=True)
class Curve:
    """The points of one coder on one clip."""

    coder: str  # its name with its variant
    clip: str  # the title of the clip
    points: tuple[Point, ...]  # points from coarse to fine
    notes: tuple[str, ...] = ()  # sentences that a reader must know
    missing: str | None = None  # reason for the absence of points; None where there are some

    def pairs(self, metric: str) -> list[tuple[float, float]]:
        """Rate and quality of each point."""
        return [(point.bits_per_pixel, point.quality(metric)) for point in self.points]


@dataclass
class Scores:
    """The quality of the frames."""

    psnr: float
    psnr_y: float
    ms_ssim: float
    vmaf: float | None
    notes: tuple[str, ...] = field(default_factory=tuple)


def scores(clip: PlanarClip, decoded: Iterable[tuple[Frame, Plane]]) -> Scores:
    """Compare decoded frames, R'G'B' with their luma plane, with a clip."""
    luma: list[float] = []

    def frames() -> Iterator[Frame]:
        for (frame, plane), source in zip(decoded, clip.planes(), strict=True):
            difference = plane.astype(np.int64) - source[0]
            luma.append(psnr_from_mse(float(np.mean(difference * difference)), PEAK))
            yield frame

    found = compare_frames(clip.frames(), frames(), PEAK, frame_rate=clip.format.frame_rate, with_vmaf=True)
    vmaf = found.vmaf.mean if found.vmaf is not None else None
    return Scores(found.mean_psnr, math.fsum(luma) / len(luma), found.mean_ms_ssim, vmaf, found.notes)


def point(clip: PlanarClip, setting: str, size: int, found: Scores, *seconds: float) -> Point:
    """A point from the bytes of a clip, its scores, and its seconds in all in the order of `Point`."""
    encoding, cpu, decoding = (part / clip.frame_count for part in seconds)
    quality = found.psnr, found.psnr_y, found.ms_ssim, found.vmaf
    return Point(setting, size, 8 * size / clip.pixels, *quality, encoding, cpu, decoding)


def gsvc_point(clip: PlanarClip, settings: gsvc_ref.Settings, folder: Path) -> tuple[Point, tuple[str, ...]]:
    """Code a clip by GSVC: the point, and what a reader must know of it."""
    path = folder / "clip.gsvc"
    start, cpu = time.perf_counter(), time.process_time()
    report = gsvc_ref.encode((clip.frames(), clip.format), path, settings)
    if report.interrupted:  # the file has only the frames so far, so it is not a point of the curve
        raise KeyboardInterrupt
    encoding, cpu = time.perf_counter() - start, time.process_time() - cpu
    start = time.perf_counter()
    for _ in gsvc_ref.decode(path, threads=settings.threads):
        pass
    decoding = time.perf_counter() - start
    video = clip.format
    decoded = ((frame, to_planes(frame, video)[0]) for frame in gsvc_ref.decode(path, threads=settings.threads))
    found = scores(clip, decoded)
    splats = settings.splat_count(video.width, video.height)
    made = point(clip, f"N {splats}", report.file_bytes, found, encoding, cpu, decoding)
    length = code_length(report.frames) if settings.profile == "main" else None
    return replace(made, splats=splats, code_length=length), found.notes


def warm_up(coders: Iterable[Coder], folder: Path) -> None:
    """Compile what GSVC and the metrics need, so that no point waits for the compiler."""
    noise = np.random.default_rng(0).integers(0, 256, (3, 48, 64, 3), np.uint8)
    clip = from_frames(noise, "", "", folder / "warm-up.yuv", WARM_UP)
    for coder in coders:
        steps = {} if coder.overrides.get("profile") == "main" else {"iterations": 2}
        gsvc_point(clip, coder.settings(splats=20, **steps), folder)


def gsvc_curves(
    clip: PlanarClip,
    coders: Sequence[Coder],
    folder: Path,
    say: Callable[[str], None],
    threads: int | None,
    counts: Sequence[int] | None = None,
) -> list[Curve]:
    """GSVC's curves over numbers of splats, those of a coder or `counts`; `say` gets a sentence for each point.

    Coders take turns at each N, so that what else the machine does falls on all of them.
    """
    points: dict[str, list[Point]] = {coder.name: [] for coder in coders}
    notes: dict[str, dict[str, None]] = {coder.name: {} for coder in coders}
    asked = {coder.name: counts or coder.counts(clip) for coder in coders}
    for count in sorted(set().union(*asked.values())):
        for coder in (coder for coder in coders if count in asked[coder.name]):
            made, found = gsvc_point(clip, coder.settings(splats=count, threads=threads), folder)
            points[coder.name].append(made)
            notes[coder.name] |= dict.fromkeys(found)
            say(
                f"{clip.title}: {coder.name}, {made.setting}, {made.bits_per_pixel:.3f} bits/pixel, {made.psnr:.2f} dB,"
                f" {made.encoding_seconds:.3f} s/frame"
            )
    return [Curve(coder.name, clip.title, tuple(points[coder.name]), tuple(notes[coder.name])) for coder in coders]


def codec_point(
    clip: PlanarClip, codec: Codec, variant: Variant, value: int, folder: Path, threads: int | None
) -> tuple[Point, codecs.Coded]:
    """Code a clip by a codec of ffmpeg.

    An FfmpegError says that the codec is missing or fails.
    """
    coded = codecs.encode(clip, codec, variant, value, folder, threads)
    decoding = codecs.decoding_seconds(coded, codec)
    decoded = ((to_rgb(planes, clip.format), planes[0]) for planes in codecs.decode(coded, codec, clip))
    found = scores(clip, decoded)
    setting = f"{codec.quality[1]} {value}"
    return point(clip, setting, coded.bytes, found, coded.seconds, coded.cpu_seconds, decoding), coded


def codec_curves(
    clip: PlanarClip, codec: Codec, folder: Path, threads: int | None, values: tuple[int, ...] | None = None
) -> Iterator[Curve]:
    """A curve for each variant of a codec; what the first already is by its own report becomes a note of it."""
    first, *others = codec.variants
    for number, variant in enumerate(codec.variants):
        name = codec.label(number)
        points: list[Point] = []
        notes: list[str] = []
        done: list[Variant] = []
        try:
            for value in values or codec.values:
                made, coded = codec_point(clip, codec, variant, value, folder, threads)
                if not points:
                    notes += point_notes(codec, variant, coded)
                    done = [other for other in others if coded.shows(other)]
                points.append(made)
        except FfmpegError as error:
            yield Curve(name, clip.title, (), missing=str(error))
            return
        if variant is not first:
            yield Curve(name, clip.title, tuple(points), tuple(notes))
            continue
        notes += [f"by its own report this is its {other.name}, too" for other in done]
        others = [other for other in others if other not in done]
        yield Curve(name, clip.title, tuple(points), tuple(notes))
        if not others:
            return


def point_notes(codec: Codec, variant: Variant, coded: codecs.Coded) -> list[str]:
    """Sentences from the first point of a curve."""
    notes = coded.quoted(codec)
    if not coded.shows(variant):
        notes.append(f"the report of {codec.library} does not show whether {variant.name} took effect")
    if coded.removed_bytes:
        notes.append(f"{coded.removed_bytes} bytes that pictures do not need are not counted")
    return notes
