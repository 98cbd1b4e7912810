"""The gain of each mechanism: P-frames alone, with pruning (GSP), with augmentation (GSA), with key frames (DKS)."""

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from gsvc_lab.clips import Clip, packaged_clip
from gsvc_lab.experiments.change import Change
from gsvc_lab.experiments.encodes import (
    PAPER_ITERATIONS,
    PAPER_RATE,
    NowAndThen,
    Say,
    decoded_ms_ssim,
    encoded,
    excerpt,
    fitted_frames,
    held,
    shortened,
)  # fmt: skip
from gsvc_lab.experiments.experiment import Experiment, Holds, Result, Run, Table, Verdict
from gsvc_lab.experiments.figures import COLORS, MARKERS, new_figure, save_figure
from gsvc_lab.experiments.fitting import scales_missing
from gsvc_lab.experiments.key_frames import detect
from gsvc_lab.experiments.material import given_clips
from gsvc_ref.encoder import Settings
from gsvc_ref.encoder.effects import Effects
from gsvc_ref.encoder.settings import PaperSettings
from gsvc_ref.training import FitSettings

VARIANTS: Final = ("P only", "+ GSP", "+ GSA", "+ DKS")
"""Each has what those before it have."""

WEIGHTS: Final = "P only, weights"
"""P-frames only, and the weights w that GSP prunes by are learnt, but nothing is pruned."""

METRICS: Final = {"psnr": "PSNR, dB", "ms_ssim": "MS-SSIM"}

CUT: Final = 30
"""The first frame after the first cut of the clip `bikes`."""


@dataclass(frozen=True)
class Plan:
    """The size of the experiment."""

    size: tuple[int, int]  # width and height
    frames: int  # number of frames of each clip
    splats: tuple[int, ...]  # the values of N; every variant ends with 0.9 N in each frame
    decoded: int  # the value of N whose streams are made too, with the first seed
    seeds: int  # number of seeds
    # Iterations of the fits: the paper's 50,000 at 1e-3 shortened to these (`encodes.shortened`)
    iterations: int
    rate: float


SMALL: Final = Plan((96, 64), 6, (100, 300), 300, 3, 800, 1e-2)
FULL: Final = Plan((480, 270), 20, (500, 1000, 2000, 4000), 2000, 3, 3000, 1e-2)


def variant(name: str, settings: PaperSettings, keys: tuple[int, ...]) -> PaperSettings:
    """The settings of a variant, all of which end with as many splats in every frame.

    Without GSP, frames have 0.9 N splats from the start. Without GSA no P-frame gets new splats, and none is pruned.
    """
    text = {"P only": "all,gsp=off,gsa=off", WEIGHTS: "all,gsa=off", "+ GSP": "all,gsa=off"}.get(name, "all")
    settings = replace(settings, effects=Effects.parse(text), key_frames=keys if name == "+ DKS" else (0,))
    if name in ("P only", WEIGHTS):
        fit = settings.intra.fit
        assert isinstance(fit, FitSettings)
        assert fit.pruning is not None
        assert settings.splats is not None
        none = replace(fit, pruning=replace(fit.pruning, fraction=0.0))
        left = round((1 - fit.pruning.fraction) * settings.splats)
        settings = replace(settings, splats=left, intra=replace(settings.intra, fit=none))
    return settings


def measure(clips: Sequence[Clip], plan: Plan, threads: int | None, say: Say) -> dict[str, Any]:
    """All numbers of excerpts: by clip, N and variant the mean scores of each seed."""
    numbers: dict[str, Any] = {"clips": {}}
    for clip in clips:
        quick = Settings.quick(splats=max(plan.splats), threads=threads, profile="paper")
        found = detect(clip, quick, say, f"{clip.name}: DKS")
        keys = tuple(found["found"]["robust"])
        counts = {
            str(splats): of_variants(clip, splats, keys, plan, threads, say, decode=splats == plan.decoded)
            for splats in plan.splats
        }
        numbers["clips"][clip.name] = {"about": clip.about, "keys": keys, "counts": counts}
    return numbers


def of_variants(
    clip: Clip, splats: int, keys: tuple[int, ...], plan: Plan, threads: int | None, say: Say, *, decode: bool
) -> dict[str, list[dict[str, Any]]]:
    """Mean scores of each variant and seed; a variant whose settings are those of the one before has its scores."""
    made: dict[str, list[dict[str, Any]]] = {name: [] for name in (VARIANTS[0], WEIGHTS, *VARIANTS[1:])}
    begin, now_and_then = time.perf_counter(), NowAndThen(say)
    for seed in range(plan.seeds):
        base = shortened(PaperSettings.paper(splats=splats, seed=seed, threads=threads), plan.iterations, plan.rate)
        before: tuple[Settings, dict[str, Any]] | None = None
        for name in (VARIANTS[0], WEIGHTS, *VARIANTS[1:]):
            settings = variant(name, base, keys)
            if before is None or settings != before[0]:
                what = f"{clip.name}, N = {splats}, seed {seed}, {name}"
                before = settings, scores(clip, settings, now_and_then, what, decode=decode and seed == 0)
            made[name].append(before[1])
    fits = ", ".join(f"{name} {mean(runs, 'psnr'):.2f}" for name, runs in made.items())
    say(f"{clip.name}, N = {splats}, {plan.seeds} seeds, {time.perf_counter() - begin:.1f} s: {fits} dB")
    return made


def scores(clip: Clip, settings: PaperSettings, say: Say, what: str, *, decode: bool) -> dict[str, Any]:
    """Mean scores of a clip's frames as splats without quantisation, and of the decoded stream."""
    keys = settings.key_frames
    assert isinstance(keys, tuple)
    frames = []
    for frame in fitted_frames(clip.frames(), settings, keys):
        frames.append(frame)
        say(f"{what}: {len(frames)} of {clip.format.frame_count} frames")
    made: dict[str, Any] = {
        "psnr": statistics.fmean(frame.quality.psnr for frame in frames),
        "ms_ssim": statistics.fmean(frame.quality.ms_ssim for frame in frames),
        "splats": sorted({len(frame.splats) for frame in frames}),
        "psnr_by_frame": [frame.quality.psnr for frame in frames],
    }
    if decode:
        encode = encoded(clip, settings, say, f"{what}, decoded")
        made["decoded"] = {
            "psnr": encode.report.mean_psnr,
            "ms_ssim": statistics.fmean(decoded_ms_ssim(clip.frames(), encode.stream, settings.threads)),
            "bits_per_pixel": encode.report.bits_per_pixel,
            "splats": sorted({frame.splats for frame in encode.report.frames}),
        }
    return made


def mean(runs: Sequence[dict[str, Any]], metric: str) -> float:
    """The mean of a score over seeds."""
    return statistics.fmean(run[metric] for run in runs)


def gains(
    numbers: dict[str, Any],
    metric: str,
    clips: Sequence[str] | None = None,
    steps: Sequence[tuple[str, str]] = tuple(pairwise(VARIANTS)),
) -> dict[str, Change]:
    """The gain in a score by each step from a variant to another, over pairs of equal clip, N and seed."""
    chosen = [part for clip, part in numbers["clips"].items() if clips is None or clip in clips]
    counts = [made for part in chosen for made in part["counts"].values()]
    return {
        name: Change.of(*([run[metric] for made in counts for run in made[way]] for way in (before, name)))
        for before, name in steps
    }


def verdict(numbers: dict[str, Any]) -> Verdict:
    """Whether GSP adds most, then GSA, then DKS, and each something; no if GSP adds nothing."""
    gained = gains(numbers, "psnr")
    order = sorted(gained, key=lambda name: -gained[name].mean)
    useful = [name for name, gain in gained.items() if gain.raises]
    cuts = [clip for clip, part in numbers["clips"].items() if len(part["keys"]) > 1]
    texts = ", ".join(f"{name[2:]} {gain.text(2, ' dB')}" for name, gain in gained.items())
    weights = gains(numbers, "psnr", steps=[("P only", WEIGHTS)])[WEIGHTS]
    similar = ", ".join(f"{name[2:]} {gain.mean:+.4f}" for name, gain in gains(numbers, "ms_ssim").items())
    sentence = (
        f"Added in the mean over {gained['+ GSP'].pairs} pairs of equal clip, N and seed: {texts} (standard errors); "
        f"MS-SSIM {similar}. Of that of GSP, {weights.mean:+.2f} dB come with learning the weights w alone, without "
        f"pruning"
    )
    if cuts:
        steady = [clip for clip in numbers["clips"] if clip not in cuts]
        with_cut, without = gains(numbers, "psnr", cuts), gains(numbers, "psnr", steady) if steady else None
        parts = ", ".join(f"{name[2:]} {gain.mean:+.2f}" for name, gain in with_cut.items())
        sentence += f"; with a cut ({', '.join(cuts)}): {parts} dB"
        if without:
            sentence += f", without: {', '.join(f'{name[2:]} {gain.mean:+.2f}' for name, gain in without.items())} dB"
    sentence += f". The order here is {', '.join(name[2:] for name in order)}; the paper's is GSP, GSA, DKS."
    as_told = tuple(order) == VARIANTS[1:] and len(useful) == len(order)
    holds: Holds = "yes" if as_told else "partly" if "+ GSP" in useful else "no"
    return Verdict(holds, sentence)


def tables(numbers: dict[str, Any]) -> tuple[Table, ...]:
    """Scores of the fits, and of the streams."""
    fits, streams = [], []
    for clip, part in numbers["clips"].items():
        for splats, made in part["counts"].items():
            for name, runs in made.items():
                count = " or ".join(str(n) for n in sorted({n for run in runs for n in run["splats"]}))
                spreads = [deviation([run[metric] for run in runs]) for metric in METRICS]
                fits.append((
                    clip, splats, name, count, f"{mean(runs, 'psnr'):.2f} ± {spreads[0]:.2f}",
                    f"{mean(runs, 'ms_ssim'):.4f} ± {spreads[1]:.4f}",
                ))  # fmt: skip
                decoded = [run["decoded"] for run in runs if "decoded" in run]
                if decoded:
                    streams.append((
                        clip, splats, name, f"{mean(decoded, 'psnr'):.2f}", f"{mean(decoded, 'ms_ssim'):.4f}",
                        f"{mean(decoded, 'bits_per_pixel'):.3f}",
                    ))  # fmt: skip
    return (
        Table(
            "Without quantisation: mean and standard deviation over seeds",
            ("clip", "N", "variant", "splats of a frame", "PSNR, dB", "MS-SSIM"),
            tuple(fits),
        ),
        Table(
            "Decoded streams, first seed",
            ("clip", "N", "variant", "PSNR, dB", "MS-SSIM", "bits/pixel"),
            tuple(streams),
        ),
    )


def deviation(values: Sequence[float]) -> float:
    """The standard deviation; 0 of one value."""
    return statistics.stdev(values) if len(values) > 1 else 0.0


def draw(numbers: dict[str, Any], folder: Path) -> dict[str, str]:
    """Scores over N, a column for each clip."""
    clips = numbers["clips"]
    figure, axes = new_figure(4.6 * len(clips), 5.6, 2, len(clips), sharex=True)
    for column, (clip, part) in enumerate(clips.items()):
        counts = [int(splats) for splats in part["counts"]]
        for row, (metric, label) in enumerate(METRICS.items()):
            axis = axes[row][column]
            for number, name in enumerate((*VARIANTS, WEIGHTS)):
                runs = [[run[metric] for run in made[name]] for made in part["counts"].values()]
                axis.errorbar(
                    [count * (1 + 0.012 * (number - 2)) for count in counts],  # beside each other
                    [statistics.fmean(values) for values in runs],
                    [deviation(values) for values in runs],
                    color=COLORS[number], marker=MARKERS[number], elinewidth=1, label=name,
                    linestyle=":" if name == WEIGHTS else "-",
                )  # fmt: skip
            axis.set(xscale="log", xticks=counts, xticklabels=counts, ylabel=label if column == 0 else None)
            axis.minorticks_off()
        axes[0][column].set_title(f"{clip}, {'a cut' if len(part['keys']) > 1 else 'no cut'}")
        axes[1][column].set_xlabel("N")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=len(VARIANTS) + 1)
    name = save_figure(figure, folder, "ablation-scores")
    return {name: "Mean scores of the frames without quantisation; bars: standard deviation over seeds."}


def chosen(run: Run, plan: Plan) -> list[Clip]:
    """The clips that the user gave, or a talking head without and a street with a cut."""
    given = given_clips(run)
    if given:
        return [held(excerpt(clip, 0, plan.frames, *plan.size)) for clip in given]
    around = CUT - plan.frames // 2
    return [
        held(excerpt(packaged_clip(name), first, plan.frames, *plan.size))
        for name, first in (("carphone_pristine", 0), ("bikes", around))
    ]


def run(run: Run) -> Result:
    """Make it."""
    plan = FULL if run.full else SMALL
    numbers = measure(chosen(run, plan), plan, run.threads, run.say)
    clips = "; ".join(part["about"] for part in numbers["clips"].values())
    setting = (
        f"{clips}; at {plan.size[0]}x{plan.size[1]}. Preset paper with {plan.iterations} iterations a frame at the "
        f"rate {plan.rate:g} in place of {PAPER_ITERATIONS} at {PAPER_RATE:g}; {plan.seeds} seeds. All variants have "
        f"0.9 N splats at the end of every frame: P only from the start, with the weights w fixed at 1; with GSP "
        f"I-frames begin with N and w = 0.01, which is learnt, and lose a tenth, and P-frames, which get no new "
        f"splats, lose none; with GSA P-frames get N/10 and lose as many. DKS: the key frames that quick's "
        f"pre-training and the robust rule find; where there are none but the first, + DKS is + GSA. Streams are made "
        f"for N = {plan.decoded} with the first seed.{scales_missing(plan.size)}"
    )
    conclusion = verdict(numbers).about(
        run,
        f"{plan.frames} frames of {plan.size[0]}x{plan.size[1]} of each clip and {plan.iterations} iterations a frame "
        f"at {plan.rate / PAPER_RATE:g} times the paper's rate",
        f"--full takes {FULL.frames} frames of {FULL.size[0]}x{FULL.size[1]} and {FULL.iterations} iterations, which "
        f"is still far from the paper's 600 of 1920x1080 and {PAPER_ITERATIONS}",
    )
    return Result(setting, numbers, tables(numbers), draw(numbers, run.folder), conclusion)


EXPERIMENT: Final = Experiment(
    "ablation",
    "What pruning, augmentation and key frames add",
    "On UVG, PSNR and MS-SSIM over the number of splats rise from P-frames only to + GSP, + GSA and + DKS: GSP adds "
    "most, then GSA, then DKS, which adds little in MS-SSIM, likely because the videos have no scene change (section "
    "4.3 and its figure; no numbers are printed).",
    run,
    small_threads=1,
)
