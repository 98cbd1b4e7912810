"""Encoding time against quality: more iterations with the same number of splats."""

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from gsvc_base.cli.text import plural
from gsvc_base.processors import processors
from gsvc_lab.clips import Clip, packaged_clip
from gsvc_lab.experiments.encodes import Say, encoded, excerpt, held
from gsvc_lab.experiments.experiment import Experiment, Holds, Result, Run, Table, Verdict
from gsvc_lab.experiments.figures import COLORS, MARKERS, new_figure, save_figure
from gsvc_lab.experiments.material import given_clips
from gsvc_ref.encoder import Settings

PAPER_SECONDS: Final = (197.58, 221.45)
"""Seconds per frame of 1920x1080 at the lowest and the highest rate on a V100 (paper, section 4.2)."""

PAPER_RATES: Final = (0.2103, 1.0715)
"""Bits per pixel there."""

NOTICED: Final = 0.05
"""dB: a smaller change of PSNR from one number of iterations to the next is none."""


@dataclass(frozen=True)
class Plan:
    """The size of the experiment."""

    size: tuple[int, int] | None  # width and height; None: those of each clip
    frames: int  # number of frames of each clip
    splats: int  # n
    quick: tuple[int, ...]  # Iterations of an I-frame's fit, by preset
    paper: tuple[int, ...]


SMALL: Final = Plan((160, 96), 5, 384, (25, 50, 100, 150, 300, 600), (200, 800, 3200))
FULL: Final = Plan(None, 10, 10_000, (25, 50, 100, 150, 300, 600, 1200), (200, 800, 3200, 12_800, 50_000))


def measure(clips: Sequence[Clip], plan: Plan, threads: int | None, say: Say) -> dict[str, Any]:
    """Seconds per frame, PSNR and bits of the decoded stream by clip and preset, for each number of iterations."""
    numbers: dict[str, Any] = {}
    for clip in clips:
        pixels = clip.format.width * clip.format.height
        splats = min(plan.splats, pixels // 10)
        presets = {"quick": (Settings.quick, plan.quick), "paper": (Settings.paper, plan.paper)}
        numbers[clip.name] = {"about": clip.about, "splats": splats, "presets": {}}
        for preset, (make, counts) in presets.items():
            settings = make(splats=splats, threads=threads, key_frames=(0,), profile="paper")
            first = replace(settings, frames=(0, 2)).with_(iterations=2)
            say(f"{clip.name}, {preset}: compiling first, so that no row waits for that")
            encoded(clip, first, lambda _: None, "")
            numbers[clip.name]["presets"][preset] = [
                row(clip, settings.with_(iterations=count), count, say, f"{clip.name}, {preset}, {count} iterations")
                for count in counts
            ]
    return numbers


def row(clip: Clip, settings: Settings, count: int, say: Say, what: str) -> dict[str, float]:
    """One encode."""
    made = encoded(clip, settings, say, what)
    frames = len(made.report.frames)
    return {
        "iterations": count,
        "made": sum(frame.iterations for frame in made.report.frames) / frames,
        "seconds": made.report.seconds / frames,
        "psnr": made.report.mean_psnr,
        "bits_per_pixel": sum(made.bits) / (frames * clip.format.width * clip.format.height),
    }


def rises(rows: Sequence[dict[str, float]]) -> list[float]:
    """The gain in dB by each step to more iterations."""
    return [after["psnr"] - before["psnr"] for before, after in pairwise(rows)]


def verdict(numbers: dict[str, Any]) -> Verdict:
    """Whether PSNR rises with the iterations at the same N, and how much of it is left at the end."""
    curves = [(clip, preset, rows) for clip, part in numbers.items() for preset, rows in part["presets"].items()]
    falls = [(clip, preset, min(rises(rows))) for clip, preset, rows in curves if min(rises(rows)) < -NOTICED]
    gains = [rows[-1]["psnr"] - rows[0]["psnr"] for _, _, rows in curves]
    texts = []
    for preset in ("quick", "paper"):
        ends = [(rows[0], rows[-1], rows[-2]) for _, other, rows in curves if other == preset]
        whole = statistics.fmean(last["psnr"] - first["psnr"] for first, last, _ in ends)
        longer = statistics.fmean(last["seconds"] / first["seconds"] for first, last, _ in ends)
        end = statistics.fmean(
            (last["psnr"] - before["psnr"]) / math.log2(last["iterations"] / before["iterations"])
            for _, last, before in ends
        )
        more = statistics.fmean(last["bits_per_pixel"] / first["bits_per_pixel"] - 1 for first, last, _ in ends)
        texts.append(
            f"{preset} gains {whole:.2f} dB from {ends[0][0]['iterations']} to {ends[0][1]['iterations']} iterations, "
            f"in {longer:.1f} times the seconds, at the end {end:+.2f} dB for twice as many, bits {more:+.0%}"
        )
    fall = (
        "PSNR falls at no step" if not falls
        else "PSNR falls by up to " + ", ".join(f"{-least:.2f} dB ({clip}, {preset})" for clip, preset, least in falls)
    )  # fmt: skip
    holds: Holds = "yes" if not falls and min(gains) > NOTICED else "partly" if statistics.fmean(gains) > 0 else "no"
    sentence = f"At the same N, in the mean over clips, {'; '.join(texts)}. {fall}. {compared(numbers)}"
    return Verdict(holds, sentence)


def compared(numbers: dict[str, Any]) -> str:
    """The seconds measured beside the paper's."""
    rows = [row for part in numbers.values() for rows in part["presets"].values() for row in rows]
    least, most = min(row["seconds"] for row in rows), max(row["seconds"] for row in rows)
    return (
        f"Seconds per frame here are {least:.2f} to {most:.1f}, of frames and on a machine that the paper's "
        f"{PAPER_SECONDS[0]:.0f} to {PAPER_SECONDS[1]:.0f} s (1920x1080, V100) cannot be compared with."
    )


def tables(numbers: dict[str, Any]) -> tuple[Table, ...]:
    """All rows, and the paper's."""
    rows = [
        (clip, preset, f"{row['iterations']:,}", f"{row['made']:,.0f}", f"{row['seconds']:.3f}", f"{row['psnr']:.2f}",
         f"{row['bits_per_pixel']:.3f}")
        for clip, part in numbers.items()
        for preset, found in part["presets"].items()
        for row in found
    ]  # fmt: skip
    rows += [
        ("UVG, the paper's own number", "paper", "50,000 or converged", "–", f"{seconds:.2f}", "–", f"{rate} *")
        for seconds, rate in zip(PAPER_SECONDS, PAPER_RATES, strict=True)
    ]
    columns = ("clip", "preset", "iterations asked for", "made per frame", "s/frame", "PSNR, dB", "bits/pixel")
    return (Table("Iterations, time and quality (* no rate that can be decoded)", columns, tuple(rows)),)


def draw(numbers: dict[str, Any], folder: Path) -> dict[str, str]:
    """PSNR and bits over seconds per frame."""
    figure, axes = new_figure(9.6, 3.8, 1, 2)
    for number, (clip, preset, rows) in enumerate(
        (clip, preset, rows) for clip, part in numbers.items() for preset, rows in part["presets"].items()
    ):
        seconds = [row["seconds"] for row in rows]
        style: dict[str, Any] = {
            "color": COLORS[number // 2 % 8], "marker": MARKERS[number % 8],
            "linestyle": "-" if preset == "quick" else "--",
        }  # fmt: skip
        axes[0][0].plot(seconds, [row["psnr"] for row in rows], label=f"{clip}, {preset}", **style)
        axes[0][1].plot(seconds, [row["bits_per_pixel"] for row in rows], **style)
        for row in rows if number < 2 else ():
            axes[0][0].annotate(f"{row['iterations']}", (row["seconds"], row["psnr"]), (3, -9),
                                textcoords="offset points", fontsize=6.5, color="#5b6570")  # fmt: skip
    for axis, label in zip(axes[0], ("PSNR, dB", "bits per pixel"), strict=True):
        axis.set(xscale="log", xlabel="seconds per frame", ylabel=label)
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return {
        save_figure(figure, folder, "time-quality"): "PSNR and bits over encoding time; small numbers: iterations of "
        "an I-frame's fit, of the first clip."
    }


def chosen(run: Run, plan: Plan) -> list[Clip]:
    """The clips that the user gave, or a talking head and a cartoon."""
    clips = given_clips(run) or [packaged_clip(name) for name in ("carphone_pristine", "bigbuckbunny")]
    sizes = [plan.size or (clip.format.width, clip.format.height) for clip in clips]
    return [held(excerpt(clip, 0, plan.frames, *size)) for clip, size in zip(clips, sizes, strict=True)]


def run(run: Run) -> Result:
    """Make it."""
    plan = FULL if run.full else SMALL
    clips = chosen(run, plan)
    numbers = measure(clips, plan, run.threads, run.say)
    sizes = sorted({f"{clip.format.width}x{clip.format.height}" for clip in clips})
    counts = sorted({part["splats"] for part in numbers.values()})
    setting = (
        f"{'; '.join(part['about'] for part in numbers.values())}; at {', '.join(sizes)}; N = "
        f"{', '.join(map(str, counts))}, seed 0, {plural(run.threads or processors(), 'thread')}, one key frame. "
        f"Iterations are those asked for of an I-frame's fit; fine-tuning and P-frames follow in proportion, by the "
        f"presets' own schedules and rates. Seconds are those of the encoder on the wall clock; bits are those of the "
        f"frames' chunks. The paper's rates are, by the authors' code, sums of sizes in memory, with P-frames as "
        f"differences to parameters that a decoder does not have."
    )
    conclusion = verdict(numbers).about(
        run,
        f"{', '.join(f'{count:,}' for count in counts)} splats on {', '.join(sizes)} and {plan.frames} frames",
        "--full --uvg DIR takes 10,000 splats on whole pictures and up to the paper's 50,000 iterations",
    )
    return Result(setting, numbers, tables(numbers), draw(numbers, run.folder), conclusion)


EXPERIMENT: Final = Experiment(
    "time",
    "Encoding time against quality",
    "PSNR can be raised without more splats at the cost of encoding time, which the number of iterations sets "
    "(sections 4.2 and 5). Encoding takes 197.58 to 221.45 s per frame of 1920x1080 on a V100 as the rate rises from "
    "0.2103 to 1.0715 bits per pixel.",
    run,
    small_threads=1,
)
