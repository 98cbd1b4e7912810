"""What ``gsvc encode`` says: settings, which frame it is at, and the result in lines or as JSON."""

from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import decibel, duration, plural, to_json
from gsvc_ref.cli.files import display_name

if TYPE_CHECKING:
    from gsvc_ref import Settings
    from gsvc_ref.encoder import EncodeReport, Progress
    from gsvc_ref.encoder.log import Decision
    from gsvc_ref.video import VideoFormat

GOAL_TEXT: Final = {
    "bitrate": "{:,.0f} bit/s",
    "size": "{:,} bytes",
    "mean_psnr": "a mean PSNR of {:g} dB",
    "vmaf": "a mean VMAF of {:g}",
}
"""The goals of a whole clip in words."""


def describe_settings(settings: "Settings", width: int, height: int) -> str:
    """The settings that matter most, in one line."""
    from gsvc_ref.encoder.settings import MainSettings

    splats = plural(settings.most_splats(width, height), "splat")
    about = "about " if settings.profile == "main" else ""
    if isinstance(settings, MainSettings) and settings.layer_count > 1:
        goals = [f"{goal:g} dB" for goal in settings.layer_goals] or [
            plural(goal, "splat") for goal in settings.layer_splats
        ]
        alone = plural(settings.splat_count(width, height), "splat")
        what = f"of {', '.join(goals)}" if goals else f"about as good as one of {alone}"
        rate = f"{settings.layer_count} layers {what}"
    elif settings.goal is not None:
        goal = GOAL_TEXT[settings.goal].format(getattr(settings, settings.goal))
        rate = f"{goal} with at most {about}{splats} a frame"
    elif settings.psnr is not None:
        rate = f"at least {settings.psnr:g} dB with at most {about}{splats} a frame"
    elif isinstance(settings, MainSettings) and settings.quality is not None:
        most = f"{'at most ' if settings.splats is None else ''}{about}"
        rate = f"quality {settings.quality} with {most}{splats} a frame"
    else:
        rate = f"{about}{splats} a frame"
    keys = settings.key_frames
    if keys == "auto":
        chosen = "found from the past alone" if settings.low_latency else "found automatically"
    elif isinstance(keys, int):
        chosen = f"every {plural(keys, 'frame')}"
    else:
        chosen = "listed"
    return (
        f"profile {settings.profile}, preset {settings.preset}, {rate}, I-frames {chosen}, effects {settings.effects}, "
        f"seed {settings.seed}"
    )


def frame_progress(display: ProgressDisplay) -> "Callable[[Progress], None]":
    """The function that shows which frame is being encoded."""

    def show(progress: "Progress") -> None:
        of_all = f"/{progress.frame_count}" if progress.frame_count else ""
        display.update(f"frame {progress.frame + 1}{of_all}", progress.frame, progress.frame_count)

    return show


def summary(
    output: str, report: "EncodeReport", *, compiled: bool, source_bytes: int | None = None, verbose: bool = False
) -> list[str]:
    """The result of an encode in lines; `compiled`: kernels were compiled in its time."""
    frames = report.frames
    counts = Counter[str](frame.type for frame in frames)
    types = ", ".join(f"{counts[kind]} {kind}" for kind in "IPR" if counts[kind])
    splats = max(sum(layer.splats for layer in frame.layers) or frame.splats for frame in frames)
    stages = sorted(report.seconds_by_stage.items(), key=lambda item: -item[1])
    total = max(report.seconds, sum(report.seconds_by_stage.values()))  # several processes spend more than passes
    shares = ", ".join(f"{stage} {seconds / total:.0%}" for stage, seconds in stages[:4] if total)
    of_source = f" ({report.file_bytes / source_bytes:.2g} times its source)" if source_bytes else ""
    rate = speed = ""
    if len(frames) > 1:
        rate = f"{kilobits_per_second(report):.1f} kbit/s, "
        real_time = float(len(frames) / report.header.frame_rate) / max(report.seconds, 1e-9)
        speed = f", {report.seconds / len(frames):.2g} s/frame, {real_time:.2g} times real time"
    lines = [
        f"{display_name(output, 'standard output')}: {plural(report.file_bytes, 'byte')}{of_source}, "
        f"{report.bits_per_pixel:.4f} bits/pixel, {rate}"
        f"mean PSNR {decibel(report.mean_psnr, 'infinite (identical frames)')}",
        f"  {plural(len(frames), 'frame')}: {types}; at most {plural(splats, 'splat')} in one",
        *layer_lines(report),
        f"  {duration(report.seconds)}{speed}" + (" with the compilation of kernels" if compiled else ""),
    ]
    if verbose:
        effects = effects_line([frame.decisions for frame in frames], [frame.type for frame in frames])
        lines += [f"  effects: {effects}", f"  time: {shares}"]
    return lines


def effects_line(decisions: "Sequence[Sequence[Decision]]", types: Sequence[str]) -> str:
    """One line that counts what was done and what was left out."""
    predicted = types.count("P")

    def done(effect: str, kinds: str) -> int:
        pairs = zip(decisions, types, strict=True)
        return sum(one.done for frame, kind in pairs if kind in kinds for one in frame if one.effect == effect)

    parts = [f"{plural(types.count('R'), 'frame')} repeated"] if "R" in types else []
    parts.append(f"DKS pre-trained {done('dks', 'IPR')} of {plural(len(types), 'frame')}")
    if predicted:
        whole = done("regions", "P")
        parts.append(f"GSA in {done('gsa', 'P')} of {plural(predicted, 'P-frame')}")
        parts.append(f"static splats in {predicted - whole}")
        parts.append(f"motion in {done('motion', 'P')}")
    parts.append(f"pruning in {done('gsp', 'IP')}")
    saved = sum(one.saved for frame in decisions for one in frame)
    return ", ".join(parts) + (f"; {plural(saved, 'iteration')} saved" if saved else "")


def layer_lines(report: "EncodeReport") -> list[str]:
    """A line for the base and for each layer: its rate, and the PSNR with it."""
    count = report.header.layer_count
    if count == 1:
        return []
    lines = []
    for layer in range(count):
        parts = [frame.layers[layer] for frame in report.frames]
        bits = sum(sum(part.bits.values()) for part in parts)
        rate = float(bits * report.header.frame_rate / len(parts) / 1000)
        psnr = sum(part.psnr for part in parts) / len(parts)
        name = f"layer {layer}" if layer else "base"
        lines.append(f"  {name}: {rate:.1f} kbit/s, mean PSNR {decibel(psnr, 'infinite')}")
    return lines


def kilobits_per_second(report: "EncodeReport") -> float:
    """The rate of the whole file in 1000 bits per second."""
    return float(8 * report.file_bytes * report.header.frame_rate / len(report.frames) / 1000)


def report_object(arguments: Namespace, report: "EncodeReport", video: "VideoFormat") -> dict[str, Any]:
    """The report for ``--json``."""
    return {
        "input": arguments.input,
        "output": arguments.output,
        "format": video,
        "file_bytes": report.file_bytes,
        "bits_per_pixel": report.bits_per_pixel,
        "kilobits_per_second": kilobits_per_second(report),
        "mean_psnr": report.mean_psnr,
        "seconds": report.seconds,
        "seconds_by_stage": report.seconds_by_stage,
        "interrupted": report.interrupted,
        "fault": report.fault,
        "header": report.header.arguments,
        "frames": report.frames,
        "notes": report.notes,
        "settings": to_json(report.settings),
    }
