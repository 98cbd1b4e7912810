"""Layers of profile `main`: what two and three of them take more than a single one at the same quality."""

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import gsvc_ref
from gsvc_lab.bench.bd_rate import mean_ratio, rate_at
from gsvc_lab.bench.coders import MAIN
from gsvc_lab.bench.measure import warm_up
from gsvc_lab.bench.planes import PlanarClip
from gsvc_lab.bench.tables import percent
from gsvc_lab.experiments.experiment import Experiment, Holds, Result, Run, Table, Verdict
from gsvc_lab.experiments.rate_distortion import named
from gsvc_lab.experiments.rate_distortion.goals import Goal
from gsvc_lab.experiments.rate_distortion.plan import jobs
from gsvc_ref.encoder import EncodeReport

SINGLE: Final = (0.125, 0.25, 0.5, 1.0, 1.5)
"""N of a single layer for the points of its curve, in N of all layers together."""

LAYERED: Final = ((0.5, 1.0), (0.25, 0.5, 1.0))
"""N up to each layer, in N of all together: of two layers, the default, and of three."""

PIXELS_PER_SPLAT: Final = 25
"""Pixels of the picture for each of N."""

CLAIMED: Final = 0.03
"""What layers take more than a single one, by the project page of P-GSVC: less than this."""


@dataclass(frozen=True)
class Quality:
    """One quality of a clip in layers: the base with the layers up to one."""

    psnr: float  # in dB, the mean over frames
    bits: int  # of the file without the layers above
    single_bits: float | None  # of a single layer of that PSNR, read off its curve; None where it does not reach it

    @property
    def ratio(self) -> float | None:
        """Its bits over those of the single layer."""
        return None if self.single_bits is None else self.bits / self.single_bits


@dataclass(frozen=True)
class Layered:
    """A clip in layers."""

    clip: str  # title of the clip
    splats: tuple[int, ...]  # N of a frame with the base, with layer 1, ..., growing
    qualities: tuple[Quality, ...]  # from the base alone to all layers
    carried: tuple[int, ...]  # the frames in which a layer moves with the base, or repeats, of each above the base


Curve = Sequence[tuple[float, float]]
"""Bits of files of a single layer, and their PSNR."""


def layered(clip: str, splats: tuple[int, ...], report: EncodeReport, single: Curve) -> Layered:
    """What an encode in layers came to, set against the curve of a single layer."""
    qualities = []
    for quality in range(len(splats)):
        above = sum(sum(layer.bits.values()) for frame in report.frames for layer in frame.layers[quality + 1 :])
        bits = 8 * report.file_bytes - above
        psnr = sum(frame.layers[quality].psnr for frame in report.frames) / len(report.frames)
        qualities.append(Quality(psnr, bits, rate_at(single, psnr)))
    carried = tuple(
        sum(not frame.layers[layer].bits for frame in report.frames) for layer in range(1, len(splats))
    )  # fmt: skip
    return Layered(clip, splats, tuple(qualities), carried)


def measured(clip: PlanarClip, run: Run, folder: Path) -> tuple[Curve, list[Layered]]:
    """The curve of single layers of a clip, and the clip in layers."""

    def encoded(**settings: object) -> EncodeReport:
        settings["threads"] = run.threads
        report = gsvc_ref.encode((clip.frames(), clip.format), folder / "clip.gsvc", MAIN.settings(**settings))
        if report.interrupted:  # the file has only the frames so far, so it is not a point of the curve
            raise KeyboardInterrupt
        return report

    total = clip.format.width * clip.format.height // PIXELS_PER_SPLAT
    single = []
    for share in SINGLE:
        report = encoded(splats=max(1, int(share * total)))
        single.append((8.0 * report.file_bytes, report.mean_psnr))
        run.say(f"{clip.title}: one layer, {single[-1][0]:,.0f} bits, {single[-1][1]:.2f} dB")
    found = []
    for shares in LAYERED:
        splats = tuple(max(k + 1, int(share * total)) for k, share in enumerate(shares))
        found.append(layered(clip.title, splats, encoded(layer_splats=splats), single))
        run.say(f"{clip.title}: {len(splats)} layers, {said(found[-1].qualities[-1])}")
    return single, found


def said(quality: Quality) -> str:
    """A quality in words."""
    more = "which a single layer does not reach" if quality.ratio is None else f"{percent(quality.ratio)} bits"
    return f"{quality.bits:,} bits, {quality.psnr:.2f} dB: {more}"


def goals(found: Sequence[Layered], count: int) -> list[Goal]:
    """What so many layers have to reach."""
    made = [one for one in found if len(one.splats) == count]
    full = {one.clip: one.qualities[-1].ratio for one in made}
    base = {one.clip: one.qualities[0].ratio for one in made}
    name, worst_must = {2: ("two layers", 1.15), 3: ("three layers", 1.26)}[count]
    about = f"{name} against one, at full quality"
    goals = [_mean(f"{about}, geometric mean", 1.08, full), _worst(f"{about}, the worst clip", worst_must, full)]
    about = f"the base of {name} against a single layer of its PSNR"
    must = 1.25 if count == 2 else None
    return [*goals, _mean(f"{about}, geometric mean", must, base), _worst(f"{about}, the worst clip", None, base)]


def _mean(about: str, must: float | None, ratios: dict[str, float | None]) -> Goal:
    known = [ratio for ratio in ratios.values() if ratio is not None]
    complete = len(known) == len(ratios)
    return Goal(about, must, 1 + CLAIMED, mean_ratio(known), f"{len(known)} of {len(ratios)} clips", complete=complete)


def _worst(about: str, must: float | None, ratios: dict[str, float | None]) -> Goal:
    known = {clip: ratio for clip, ratio in ratios.items() if ratio is not None}
    clip = max(known, key=lambda one: known[one], default="–")
    return Goal(about, must, 1 + CLAIMED, known.get(clip), clip, complete=len(known) == len(ratios))


def clips_table(found: Sequence[Layered]) -> Table:
    """Each clip in layers."""
    rows = [
        (
            one.clip, ", ".join(map(str, one.splats)), *_cells(one.qualities[-1]), *_cells(one.qualities[0]),
            ", ".join(map(str, one.carried)),
        )
        for one in found
    ]  # fmt: skip
    columns = (
        "clip", "N up to each layer", "PSNR, dB", "bits", "than one layer", "PSNR of the base, dB", "bits",
        "than one layer", "frames in which a layer is carried",
    )  # fmt: skip
    return Table("Two and three layers, and their base alone, against a single layer of the same PSNR", columns, rows)


def _cells(quality: Quality) -> tuple[str, str, str]:
    more = "–" if quality.ratio is None else percent(quality.ratio)
    return f"{quality.psnr:.2f}", f"{quality.bits:,}", more


def verdict(found: Sequence[Layered]) -> Verdict:
    """Whether layers take as little as P-GSVC says."""
    sentences, means = [], []
    for count, name in ((2, "Two layers"), (3, "three")):
        full = {one.clip: one.qualities[-1].ratio for one in found if len(one.splats) == count}
        mean, worst = mean_ratio(list(full.values())), max((r for r in full.values() if r is not None), default=None)
        if mean is None or worst is None:
            return Verdict("cannot be compared", "A single layer does not reach the quality of the layers.")
        means.append(mean)
        sentences.append(f"{name} take {percent(mean)} bits in the mean over clips and {percent(worst)} on the worst")
    holds: Holds = "yes" if max(means) < 1 + CLAIMED else "partly" if min(means) < 1 + CLAIMED else "no"
    return Verdict(holds, f"{', '.join(sentences)}, at the PSNR that all layers have together.")


def run(settings: Run) -> Result:
    """Code each clip in one, two and three layers, and compare."""
    clips: list[PlanarClip] = []
    curves: dict[str, Curve] = {}
    found: list[Layered] = []
    with tempfile.TemporaryDirectory(prefix="gsvc-layers-") as name:
        folder = Path(name)
        settings.say("compiling kernels")
        warm_up((MAIN,), folder)
        for job in jobs(settings):
            clips.append(named(job.load(folder / "clip.yuv"), clips))
            curves[clips[-1].title], made = measured(clips[-1], settings, folder)
            found += made
    reached = [goal for count in (2, 3) for goal in goals(found, count)]
    columns = ("layers of profile main", "must", "aim", "measured", "reached", "from")
    tables = (
        Table("What layers have to reach (at most), and what they reach", columns, [goal.row() for goal in reached]),
        clips_table(found),
    )
    numbers = {"single": curves, "layered": [asdict(one) for one in found], "goals": reached}
    setting = (
        f"{'; '.join(clip.title for clip in clips)}. Sizes are those of files; that of a base is the file's without "
        f"the chunks of the layers above. Single layers of {', '.join(f'{share:g}' for share in SINGLE)} N, where N "
        f"is one splat for {PIXELS_PER_SPLAT} pixels, give the curve of a clip, over the logarithm of the rate; the "
        "layers have N together, and half as many (and a quarter) without the topmost (two). The rate of the base is "
        "what the layers above it gain from: --layers-base weighs one against the other."
    )
    return Result(setting, numbers, tables, verdict=verdict(found))


EXPERIMENT: Final = Experiment(
    "layers",
    "Layers against a single one",
    "The authors' next paper, P-GSVC (arXiv:2603.10551), fits the layers of a scalable video together: up to 1.9 dB "
    "more for video, and 2.6 dB for images, than layers fitted one after the other. Its project page says that this "
    "takes less than 3 % more than what is not scalable, without the measure.",
    run,
)
