"""Rate control: what a constant number of splats does to the bits, and how well a PSNR asked for is held."""

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from gsvc_lab.clips import Clip, packaged_clip, scene_clip
from gsvc_lab.experiments.ablation import CUT
from gsvc_lab.experiments.encodes import (
    PAPER_ITERATIONS,
    PAPER_RATE,
    Encoded,
    Say,
    encoded,
    excerpt,
    held,
    shortened,
)
from gsvc_lab.experiments.experiment import Experiment, Holds, Result, Run, Table, Verdict
from gsvc_lab.experiments.figures import COLORS, MARKERS, new_figure, save_figure
from gsvc_lab.experiments.material import given_clips
from gsvc_ref.encoder import Settings
from gsvc_ref.encoder.settings import MIN_PIXELS_PER_SPLAT, PaperSettings

EVEN: Final = 0.1
"""Bits of P-frames count as constant if the most and the least differ by at most this fraction of their mean."""

NEAR: Final = 1.0
"""Mean excess in dB up to which frames hold a PSNR closely."""


SCENES: Final = ("static", "noise")
"""A picture that stays, and one with the noise of a sensor."""


@dataclass(frozen=True)
class Plan:
    """The size of the experiment."""

    size: tuple[int, int]  # width and height
    frames: int  # number of frames of each clip
    splats: int  # n at constant rate
    goals: tuple[float, ...]  # PSNR in dB at constant quality
    # Iterations of preset `paper`: its 50,000 at 1e-3 shortened to these (`encodes.shortened`)
    iterations: int
    rate: float


SMALL: Final = Plan((128, 96), 12, 300, (28.0, 32.0, 36.0), 400, 2e-2)
FULL: Final = Plan((480, 270), 60, 3000, (28.0, 30.0, 32.0, 34.0, 36.0, 38.0), 3000, 1e-2)


def measure(clips: Sequence[Clip], plan: Plan, threads: int | None, say: Say) -> dict[str, Any]:
    """All numbers of excerpts, frame by frame: at constant rate by clip and preset, else by clip and PSNR."""
    numbers: dict[str, Any] = {"splats": plan.splats, "clips": {}, "rate": {}, "quality": {}}
    for clip in clips:
        quick = Settings.quick(splats=plan.splats, threads=threads, profile="paper")
        made = encoded(clip, quick, say, f"{clip.name}, N = {plan.splats}, quick")
        paper = shortened(
            PaperSettings.paper(splats=plan.splats, threads=threads, key_frames=made.key_frames),
            plan.iterations,
            plan.rate,
        )
        numbers["clips"][clip.name] = clip.about
        numbers["rate"][clip.name] = {
            "paper": by_frame(encoded(clip, paper, say, f"{clip.name}, N = {plan.splats}, paper")),
            "quick": by_frame(made),
        }
        numbers["quality"][clip.name] = {
            f"{goal:g}": by_frame(
                encoded(clip, replace(quick, splats=None, psnr=goal), say, f"{clip.name}, {goal:g} dB asked for")
            )
            for goal in plan.goals
        }
    return numbers


def by_frame(made: Encoded) -> dict[str, Any]:
    """The numbers of an encode that the verdict needs."""
    return {
        "types": made.types,
        "bits": made.bits,
        "psnr": made.psnr,
        "splats": [frame.splats for frame in made.report.frames],
    }


def of_type(made: dict[str, Any], letter: str) -> list[int]:
    """The bits of the frames of a type."""
    return [bits for bits, kind in zip(made["bits"], made["types"], strict=True) if kind == letter]


def unevenness(bits: Sequence[int]) -> float:
    """The distance of the most and the least as a fraction of the mean; 0 of none."""
    return (max(bits) - min(bits)) / statistics.fmean(bits) if bits else 0.0


def share_of_inter(numbers: dict[str, Any], preset: str) -> float:
    """The bits of a P- or R-frame as a fraction of those of an I-frame, in the mean over clips."""
    found = []
    for made in numbers["rate"].values():
        intra = of_type(made[preset], "I")
        others = [*of_type(made[preset], "P"), *of_type(made[preset], "R")]
        if others:
            found.append(statistics.fmean(others) / statistics.fmean(intra))
    return statistics.fmean(found) if found else math.nan


def verdict(numbers: dict[str, Any]) -> Verdict:
    """Whether equal numbers of splats make equal bits, and whether every frame has the PSNR asked for, closely.

    In part, if at least the numbers are equal, or most frames have the PSNR.
    """
    worst: dict[str, tuple[float, str]] = {}
    for preset in ("paper", "quick"):
        worst[preset] = max((unevenness(of_type(made[preset], "P")), clip) for clip, made in numbers["rate"].items())
    counts = {
        preset: all(len(set(made[preset]["splats"])) == 1 for made in numbers["rate"].values())
        for preset in ("paper", "quick")
    }
    surplus = [
        (psnr - float(goal), clip)
        for clip, by_goal in numbers["quality"].items()
        for goal, made in by_goal.items()
        for psnr in made["psnr"]
    ]
    held_by = [value for value, _ in surplus if value >= 0]
    missed = [(value, clip) for value, clip in surplus if value < 0]
    rate_holds = worst["paper"][0] <= EVEN and counts["paper"]
    quality_holds = not missed and statistics.fmean(held_by) <= NEAR
    share = {preset: share_of_inter(numbers, preset) for preset in ("paper", "quick")}
    same = {True: "every frame has the same number of splats", False: "the number of splats differs between frames"}
    quality = f"{len(held_by)} of {len(surplus)} frames have the PSNR asked for or more"
    if held_by:
        quality += f", these {statistics.fmean(held_by):.2f} dB more in the mean and at most {max(held_by):.2f} dB"
    if missed:
        quality += f"; the others, of {' and '.join(sorted({clip for _, clip in missed}))}, miss it by up to "
        quality += f"{-min(missed)[0]:.2f} dB"
    sentence = (
        f"Constant rate: with the paper's settings {same[counts['paper']]}, and bits of P-frames differ by "
        f"{worst['paper'][0]:.1%} of their mean on the worst clip ({worst['paper'][1]}); with quick, which codes "
        f"changes only, by {worst['quick'][0]:.0%} ({worst['quick'][1]}). A frame that is no I-frame has "
        f"{share['paper']:.0%} of the bits of an I-frame with the paper's settings and {share['quick']:.0%} with "
        f"quick. Constant quality: {quality}."
    )
    in_part = counts["paper"] or len(held_by) > len(missed)
    holds: Holds = "yes" if rate_holds and quality_holds else "partly" if in_part else "no"
    return Verdict(holds, sentence)


def tables(numbers: dict[str, Any]) -> tuple[Table, ...]:
    """Both modes."""
    rate, quality = [], []
    for clip, presets in numbers["rate"].items():
        for preset, made in presets.items():
            inter, intra = of_type(made, "P"), of_type(made, "I")
            rate.append((
                clip, preset, made["types"], limits(made["splats"], 0), f"{statistics.fmean(intra):,.0f}",
                f"{statistics.fmean(inter):,.0f}" if inter else "–", f"{unevenness(inter):.1%}" if inter else "–",
                limits(made["psnr"], 2),
            ))  # fmt: skip
    for clip, goals in numbers["quality"].items():
        for goal, made in goals.items():
            surplus = [psnr - float(goal) for psnr in made["psnr"]]
            missed = sum(value < 0 for value in surplus)
            quality.append((
                clip, goal, made["types"], str(missed), f"{statistics.fmean(surplus):+.2f}",
                f"{min(surplus):+.2f} to {max(surplus):+.2f}", limits(made["splats"], 0), limits(made["bits"], 0),
            ))  # fmt: skip
    return (
        Table(
            f"Constant rate: N = {numbers['splats']}",
            ("clip", "preset", "frames", "splats", "bits of an I-frame", "bits of a P-frame", "spread of P-frames",
             "PSNR, dB"),
            tuple(rate),
        ),
        Table(
            "Constant quality: preset quick",
            ("clip", "asked for, dB", "frames", "frames below", "mean distance, dB", "distances, dB", "splats", "bits"),
            tuple(quality),
        ),
    )  # fmt: skip


def limits(values: Sequence[float], digits: int) -> str:
    """The least and the most."""
    least, most = f"{min(values):,.{digits}f}", f"{max(values):,.{digits}f}"
    return least if least == most else f"{least} to {most}"


def draw(numbers: dict[str, Any], folder: Path) -> dict[str, str]:
    """All figures."""
    return {
        draw_rate(numbers, folder): "Bits of each frame with a constant number of splats.",
        draw_quality(numbers, folder, "psnr"): "PSNR of each frame where a PSNR is asked for (dashed).",
        draw_quality(numbers, folder, "bits"): "Bits of each frame where a PSNR is asked for.",
    }


def draw_rate(numbers: dict[str, Any], folder: Path) -> str:
    """Bits over frames, one line for each clip, one plot for each preset."""
    figure, axes = new_figure(9.6, 3.4, 1, 2, sharey=True)
    for axis, preset in zip(axes[0], ("paper", "quick"), strict=True):
        for number, (clip, made) in enumerate(numbers["rate"].items()):
            kilobits = [bits / 1000 for bits in made[preset]["bits"]]
            axis.plot(kilobits, color=COLORS[number % 8], marker=MARKERS[number % 8], label=clip)
        axis.set(title=f"preset {preset}, N = {numbers['splats']}", xlabel="frame")
    axes[0][0].set(ylabel="kilobits of the frame", ylim=(0, None))
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=len(numbers["rate"]))
    return save_figure(figure, folder, "rate_control-rate")


def draw_quality(numbers: dict[str, Any], folder: Path, what: str) -> str:
    """PSNR or bits over frames, one line for each PSNR asked for, one plot for each clip."""
    clips = numbers["quality"]
    figure, axes = new_figure(2.3 * len(clips) + 0.6, 2.9, 1, len(clips), sharey=True)
    for axis, (clip, goals) in zip(axes[0], clips.items(), strict=True):
        for number, (goal, made) in enumerate(goals.items()):
            color = COLORS[number % 8]
            if what == "psnr":
                axis.axhline(float(goal), color=color, linestyle="--", linewidth=1)
                axis.plot(made["psnr"], color=color, label=f"{goal} dB asked for")
            else:
                axis.plot([bits / 1000 for bits in made["bits"]], color=color, label=f"{goal} dB asked for")
                axis.set_yscale("log")
        axis.set(title=clip, xlabel="frame", xticks=range(0, len(made["psnr"]), max(1, len(made["psnr"]) // 4)))
        axis.minorticks_off()
    axes[0][0].set_ylabel({"psnr": "PSNR, dB", "bits": "kilobits of the frame"}[what])
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=6)
    return save_figure(figure, folder, f"rate_control-quality_{what}")


def chosen(run: Run, plan: Plan) -> list[Clip]:
    """The clips that the user gave, or a talking head, a cut, a still picture, and one with noise."""
    given = given_clips(run)
    if given:
        return [held(excerpt(clip, 0, plan.frames, *plan.size)) for clip in given]
    around = max(0, CUT - plan.frames // 2)
    width, height = plan.size
    real = [(packaged_clip("carphone_pristine"), 0), (packaged_clip("bikes"), around)]
    scenes = [scene_clip(name, width, height, plan.frames) for name in SCENES]
    return [held(excerpt(clip, first, plan.frames, width, height)) for clip, first in real] + list(map(held, scenes))


def run(run: Run) -> Result:
    """Make it."""
    plan = FULL if run.full else SMALL
    numbers = measure(chosen(run, plan), plan, run.threads, run.say)
    setting = (
        f"{'; '.join(numbers['clips'].values())}; at {plan.size[0]}x{plan.size[1]}, seed 0. Constant rate: N = "
        f"{plan.splats}, preset quick as it is, and preset paper with the key frames that quick finds, "
        f"{plan.iterations} iterations a frame at the rate {plan.rate:g} in place of {PAPER_ITERATIONS} at "
        f"{PAPER_RATE:g}, and a tenth of them for fine-tuning. Constant quality: preset quick with --psnr, which adds "
        f"splats where a frame is below, up to one for {MIN_PIXELS_PER_SPLAT} pixels, and removes some where it is "
        f"above. Bits are those of the frames' chunks."
    )
    conclusion = verdict(numbers).about(
        run,
        f"{plan.frames} frames of {plan.size[0]}x{plan.size[1]} of each clip",
        f"--full takes {FULL.frames} frames of {FULL.size[0]}x{FULL.size[1]} and more iterations",
    )
    return Result(setting, numbers, tables(numbers), draw(numbers, run.folder), conclusion)


EXPERIMENT: Final = Experiment(
    "rate_control",
    "Constant rate and constant quality",
    "Constant rate comes from the same number of splats in every frame, with varying quality; constant quality from "
    "removing splats during training while the frame stays above a threshold, with varying rate (section 3.4). The "
    "paper's experiments use constant rate alone and print no bits by frame.",
    run,
    small_threads=1,
)
