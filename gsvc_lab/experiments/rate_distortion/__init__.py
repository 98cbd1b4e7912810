"""Rate and distortion of GSVC against every frame on its own, and against AVC, HEVC, AV1 and VVC of one ffmpeg."""

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, replace
from fractions import Fraction
from pathlib import Path
from typing import Final

import numpy as np

from gsvc_lab.experiments.experiment import Experiment, Result, Run
from gsvc_lab.experiments.rate_distortion import ffmpeg
from gsvc_lab.experiments.rate_distortion.bd_rate import check_bd_rates
from gsvc_lab.experiments.rate_distortion.codecs import CODECS, Codec
from gsvc_lab.experiments.rate_distortion.compare import (
    ALONE,
    ALONE_PAPER,
    GSVC,
    GSVC_PAPER,
    compared,
    default_of,
    ratios,
    verdict,
)
from gsvc_lab.experiments.rate_distortion.figures import draw_clip, draw_seconds
from gsvc_lab.experiments.rate_distortion.measure import Curve, codec_curves, gsvc_curve, gsvc_point
from gsvc_lab.experiments.rate_distortion.plan import LARGE_FRAMES, PAPER_FRAMES, PIXELS_PER_SPLAT, Job, jobs
from gsvc_lab.experiments.rate_distortion.planes import PlanarClip, from_frames
from gsvc_lab.experiments.rate_distortion.tables import (
    anchor_table,
    bd_table,
    decisions_table,
    points_table,
    published_table,
)
from gsvc_ref.cli.text import plural
from gsvc_ref.encoder import Settings
from gsvc_ref.video import ColorDescription, VideoFormat

WARM_UP: Final = VideoFormat(64, 48, Fraction(25), 8, "420", ColorDescription(1, 1, 1, False, 0))


def curves_of(job: Job, clip: PlanarClip, codecs: Sequence[Codec], run: Run, folder: Path) -> list[Curve]:
    """All curves of one clip."""
    found = []
    makers = [(GSVC, Settings.quick, {}), (ALONE, Settings.quick, {"key_frames": 1})]
    if job.paper:
        makers += [(GSVC_PAPER, Settings.paper, {}), (ALONE_PAPER, Settings.paper, {"key_frames": 1})]
    for name, make, overrides in makers:
        counts = job.splats(clip)
        curve = gsvc_curve(clip, name, make, counts, folder, run.say, threads=run.threads, decisions=False, **overrides)
        found.append(curve)
    for codec in codecs:
        for curve in codec_curves(clip, codec, folder, run.threads):
            found.append(curve)
            run.say(f"{clip.title}: {summary(curve)}")
    return found


def summary(curve: Curve) -> str:
    """A curve in words."""
    if not curve.points:
        return f"{curve.coder} could not be run: {curve.missing}"
    first, last = curve.points[0], curve.points[-1]
    return (
        f"{curve.coder}, {first.bits_per_pixel:.3f} to {last.bits_per_pixel:.3f} bits/pixel, {first.psnr:.1f} to "
        f"{last.psnr:.1f} dB, {first.encoding_seconds:.3f} to {last.encoding_seconds:.3f} s/frame"
    )


def warm_up(folder: Path) -> None:
    """Compile what GSVC and the metrics need, so that no row waits for the compiler."""
    noise = np.random.default_rng(0).integers(0, 256, (3, 48, 64, 3), np.uint8)
    clip = from_frames(noise, "", "", folder / "warm-up.yuv", WARM_UP)
    for key_frames in ("auto", 1):
        gsvc_point(clip, Settings.quick(splats=20, iterations=2, key_frames=key_frames), folder)


def run(settings: Run, codecs: Sequence[Codec] = CODECS) -> Result:
    """Code each clip with every coder, compare and draw."""
    check_bd_rates()
    with tempfile.TemporaryDirectory(prefix="gsvc-rate-distortion-") as name:
        folder = Path(name)
        settings.say("compiling kernels")
        warm_up(folder)
        clips: list[PlanarClip] = []
        curves: list[Curve] = []
        for job in jobs(settings):
            clip = named(job.load(folder / "clip.yuv"), clips)
            clips.append(clip)
            curves += curves_of(job, clip, codecs, settings, folder)
    return result(clips, curves, settings)


def named(clip: PlanarClip, others: Sequence[PlanarClip]) -> PlanarClip:
    """The clip with a title that tells its size and length and that no other one has."""
    video = clip.format
    title = f"{clip.title}, {video.width}x{video.height}, {plural(clip.frame_count, 'frame')}"
    same = sum(other.title.startswith(title) for other in others)
    return replace(clip, title=f"{title} ({same + 1})" if same else title)


def result(clips: Sequence[PlanarClip], curves: Sequence[Curve], settings: Run) -> Result:
    """The verdict on the curves."""
    against = compared(curves, GSVC)
    short = {curve.clip for curve in curves if curve.coder == GSVC_PAPER}  # too few frames for means beside long clips
    long = [one for one in against if one.clip not in short] or against
    found = ratios(long)
    tables = [bd_table("BD-rate of GSVC, quick: bits that it takes more at equal quality", against, found)]
    if longer := compared(curves, GSVC_PAPER):
        tables.append(bd_table("BD-rate of GSVC, the paper's settings, on few frames", longer, ratios(longer)))
    anchor = default_of("AVC", found)
    if anchor is not None:
        versus = compared(curves, GSVC, anchor)
        means = ratios([one for one in versus if one.clip not in short] or versus, by_anchor=False)
        tables.append(anchor_table(f"BD-rate of each coder against {anchor}, means over the clips", means))
    notes = [f"{clip.title}: {clip.note}" for clip in clips]
    tables += [points_table(curves), published_table(), decisions_table(curves, notes, *ffmpeg.description())]
    figures: dict[str, str] = {}
    for number, clip in enumerate(clips, 1):
        figures |= draw_clip([c for c in curves if c.clip == clip.title], clip.title, number, settings.folder)
    figures |= draw_seconds(curves, [clip.title for clip in clips], settings)
    numbers = {"curves": [asdict(curve) for curve in curves], "gsvc_against": against, "means": found}
    conclusion = verdict(found, len({one.clip for one in long})).about(settings, *extent(clips))
    return Result(setting(clips, settings), numbers, tuple(tables), figures, conclusion)


def extent(clips: Sequence[PlanarClip]) -> tuple[str, str]:
    """The material that the verdict is about, and that of the large version."""
    sizes = ", ".join(dict.fromkeys(f"{clip.format.width}x{clip.format.height}" for clip in clips))
    frames = max(clip.frame_count for clip in clips)
    return (
        f"the preset quick, pictures of {sizes} and at most {frames} frames",
        f"--full --uvg DIR takes the paper's sequences whole, {LARGE_FRAMES} frames by quick and {PAPER_FRAMES} with "
        f"the paper's settings",
    )


def setting(clips: Sequence[PlanarClip], settings: Run) -> str:
    """Sentences about what was measured."""
    titles = "; ".join(clip.title for clip in clips)
    densities = ", ".join(map(str, PIXELS_PER_SPLAT))
    small = (
        ""
        if settings.full
        else " The small version has few frames and small pictures, so that I-frames and headers weigh more than in a "
        "long clip; --full takes whole pictures and more frames."
    )
    return (
        f"{titles}. GSVC is the preset quick with {densities} pixels a splat (the paper has 207 to 41; whole pictures "
        f"of UVG get its 10,000 to 50,000 splats), seed 0; every frame alone is the same with key_frames=1: images of "
        f"their own, as in GaussianImage. The last table says how the comparison was made.{small}"
    )


EXPERIMENT: Final = Experiment(
    "rate_distortion",
    "Rate and distortion against other codecs",
    "Section 4 and its figure of rate-distortion curves: on UVG (Beauty, HoneyBee, Jockey at 1920x1080) GSVC with N"
    " = 10,000 to 50,000 is significantly better than GaussianImage on every frame alone, and better than or "
    "comparable with AVC, HEVC and AV1 in MS-SSIM and VMAF, not with VVC; its PSNR is lower in certain scenarios. "
    "It takes 0.20 to 1.04 bits per pixel at 33.92 to 37.72 dB and 197.58 to 221.45 s a frame on a V100. By the "
    "authors' public code those rates cannot be decoded: no file is written, and P-frames are predicted from "
    "parameters that a decoder does not have.",
    run,
)
