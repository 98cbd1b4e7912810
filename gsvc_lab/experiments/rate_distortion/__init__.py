"""Rate and distortion of GSVC against every frame on its own, and against AVC, HEVC, AV1 and VVC of one ffmpeg."""

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final

from gsvc_base.cli.text import plural
from gsvc_lab.bench import ffmpeg
from gsvc_lab.bench.codecs import CODECS, Codec
from gsvc_lab.bench.coders import ALONE, CODERS, LONG, LONG_RUNS, MAIN, OWN, PAPER, SLOW
from gsvc_lab.bench.compare import Comparison, Ratios, compared, first_of, ratios
from gsvc_lab.bench.measure import Curve, codec_curves, gsvc_curves, warm_up
from gsvc_lab.bench.planes import PlanarClip
from gsvc_lab.bench.tables import anchor_table, bd_table, points_table
from gsvc_lab.experiments.experiment import Experiment, Result, Run
from gsvc_lab.experiments.rate_distortion.claim import verdict
from gsvc_lab.experiments.rate_distortion.figures import draw_clip, draw_seconds
from gsvc_lab.experiments.rate_distortion.goals import X264_IP, goals_of, goals_table, summary
from gsvc_lab.experiments.rate_distortion.plan import LARGE_FRAMES, PAPER_FRAMES, Job, jobs
from gsvc_lab.experiments.rate_distortion.speed import SPLATS, Seconds, in_turns
from gsvc_lab.experiments.rate_distortion.tables import (
    decisions_table,
    main_table,
    published_table,
    why_table,
)

MORE: Final = "bits that it takes more at equal quality"


def curves_of(job: Job, clip: PlanarClip, codecs: Sequence[Codec], run: Run, folder: Path) -> list[Curve]:
    """All curves of one clip."""
    coders = (*CODERS, *(LONG_RUNS if job.paper else ()))
    found = gsvc_curves(clip, coders, folder, run.say, run.threads, job.counts)
    for codec in codecs:
        for curve in codec_curves(clip, codec, folder, run.threads):
            found.append(curve)
            run.say(f"{clip.title}: {said(curve)}")
    return found


def said(curve: Curve) -> str:
    """A curve in words."""
    if not curve.points:
        return f"{curve.coder} could not be run: {curve.missing}"
    first, last = curve.points[0], curve.points[-1]
    return (
        f"{curve.coder}, {first.bits_per_pixel:.3f} to {last.bits_per_pixel:.3f} bits/pixel, {first.psnr:.1f} to "
        f"{last.psnr:.1f} dB, {first.encoding_seconds:.3f} to {last.encoding_seconds:.3f} s/frame"
    )


@dataclass(frozen=True)
class Measured:
    """All that was measured."""

    clips: Sequence[PlanarClip]  # the clips
    curves: Sequence[Curve]  # the curves of all coders on all clips
    seconds: Seconds | None = None  # seconds of the first clip, in turns; None if it is too small


def run(settings: Run, codecs: Sequence[Codec] = CODECS) -> Result:
    """Code each clip with every coder, compare and draw."""
    with tempfile.TemporaryDirectory(prefix="gsvc-rate-distortion-") as name:
        folder = Path(name)
        settings.say("compiling kernels")
        warm_up((PAPER, MAIN, ALONE), folder)
        clips: list[PlanarClip] = []
        curves: list[Curve] = []
        seconds = None
        for job in jobs(settings):
            clip = named(job.load(folder / "clip.yuv"), clips)
            if not clips and clip.format.width * clip.format.height > SPLATS:
                seconds = in_turns(clip, folder, settings.threads)
            clips.append(clip)
            curves += curves_of(job, clip, codecs, settings, folder)
    return result(Measured(clips, curves, seconds), settings)


def named(clip: PlanarClip, others: Sequence[PlanarClip]) -> PlanarClip:
    """The clip with a title that tells its size and length and that no other one has."""
    video = clip.format
    title = f"{clip.title}, {video.width}x{video.height}, {plural(clip.frame_count, 'frame')}"
    same = sum(other.title.startswith(title) for other in others)
    return replace(clip, title=f"{title} ({same + 1})" if same else title)


def result(measured: Measured, settings: Run) -> Result:
    """The verdict on the curves."""
    clips, curves = measured.clips, measured.curves
    short = {curve.clip for curve in curves if curve.coder == OWN.name}  # too few frames for means beside long clips

    def means(against: Sequence[Comparison], *, by_anchor: bool = True) -> Ratios:
        return ratios([one for one in against if one.clip not in short] or against, by_anchor=by_anchor)

    against = {coder.name: compared(curves, coder.name) for coder in (*CODERS, OWN)}
    main = against[MAIN.name]
    reached = goals_of([one for one in main if one.clip not in short] or main, curves, measured.seconds)
    tables = [goals_table(reached), bd_table(f"BD-rate of {MAIN.name}: {MORE}", main, means(main)), why_table()]
    if slow := against.get(SLOW.name):
        tables.append(bd_table(f"BD-rate of {SLOW.name}: {MORE}", slow, means(slow)))
    for name in (PAPER.name, OWN.name):
        if found := against[name]:
            tables.append(
                bd_table(f"BD-rate of {name}: {MORE}, means over the clips", found, means(found), clips=False)
            )
    anchor = first_of("AVC", means(main))
    if anchor is not None:
        versus = compared(curves, MAIN.name, anchor)
        tables.append(
            anchor_table(
                f"BD-rate of each coder against {anchor}, means over the clips", versus, means(versus, by_anchor=False)
            )
        )
    for coder in (MAIN, SLOW):
        if coder.name in against:
            tables.append(main_table(curves, coder.name, (PAPER.name, LONG.name, X264_IP, CODECS[0].label())))
    notes = [f"{clip.title}: {clip.note}" for clip in clips]
    tables += [points_table(curves), published_table(), decisions_table(curves, notes, *ffmpeg.description())]
    figures: dict[str, str] = {}
    for number, clip in enumerate(clips, 1):
        figures |= draw_clip([c for c in curves if c.clip == clip.title], clip.title, number, settings.folder)
    figures |= draw_seconds(curves, [clip.title for clip in clips], settings)
    numbers = {
        "curves": [asdict(curve) for curve in curves],
        "gsvc_against": [one for found in against.values() for one in found],
        "goals": reached,
        "seconds": measured.seconds,
        "means": means(main),
    }
    paper = against[PAPER.name]
    judged = verdict(means(paper), len({one.clip for one in paper} - short) or len(clips))
    sentence = f"{summary([one for one in main if one.clip not in short] or main)} {judged.sentence}"
    conclusion = replace(judged, sentence=sentence).about(settings, *extent(clips))
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
    small = (
        ""
        if settings.full
        else " The small version has few frames and small pictures, so that I-frames and headers weigh more than in a "
        "long clip; --full takes whole pictures and more frames."
    )
    return (
        f"{titles}. Every size is that of a real file. The paper's claim is about profile paper (spec.md sections 6 to "
        f"8); profile main (section 15) is ours. Every frame alone is profile paper with key_frames=1: images of their "
        f"own, as in GaussianImage. BD-rates are percentages of bits that a coder takes more at equal quality. The "
        f"last table says how the comparison was made, and by which fixed rule N was chosen.{small}"
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
