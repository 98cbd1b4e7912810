"""Whether pruning moves splats to detail: the paper's figure of splat centres with and without GSP."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.splats import Splats
from gsvc_lab.clips import PAPER_SEQUENCES
from gsvc_lab.experiments.change import Change
from gsvc_lab.experiments.detail import BINS, Places, detail, places, ranks, spacing
from gsvc_lab.experiments.experiment import Experiment, Result, Run, Table, Verdict
from gsvc_lab.experiments.figures import line, new_figure, save_figure, show_centers, show_picture
from gsvc_lab.experiments.fitting import Picture, Quality, fitted, pruned_to, scales_missing
from gsvc_lab.experiments.material import Still, stills
from gsvc_ref.encoder.settings import PaperSettings
from gsvc_ref.encoder.settings.paper import FrameSettings
from gsvc_ref.metrics import psnr_from_mse
from gsvc_ref.training import KEPT_WEIGHT, NEW_WEIGHT, FitSettings, PruningSchedule

SIZE: Final = (160, 96)
"""Size of the small version in pixels."""

PAPER_COUNT: Final = 45_000
"""Splats of the paper's figure after pruning, on 1920x1080."""

ITERATIONS: Final = 5000
"""Iterations of the small version: as many as the authors' pruning schedule needs."""

SEEDS: Final = {False: (0, 1, 2), True: (0,)}
"""Random starts of the small and of the large version."""

WAYS: Final = {"without": "without GSP", "weights": "weights w, but no pruning", "with": "with GSP"}
"""All end with the same number of splats; ``weights`` tells what comes from w and its small start alone."""

MAX_DETAIL: Final = 0.75
"""Pixels of a higher rank are the most detailed quarter."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of one fit: its splats, where they are, and the quality of all and of the most detailed quarter."""

    name: str
    seed: int
    iterations: int
    splats: Splats
    places: Places
    quality: Quality
    detail_psnr: float
    frame: Frame


Outcomes = dict[str, list[Outcome]]
"""By way, in the same order of pictures and seeds."""


def way_settings(way: str, iterations: int) -> FrameSettings:
    """The paper's settings of an I-frame, with or without its weights and pruning."""
    intra = PaperSettings.paper().intra
    assert isinstance(intra.fit, FitSettings)
    fit = intra.fit.with_(iterations=iterations)
    if way == "without":
        fit = replace(fit, pruning=None)
    elif way == "weights":
        fit = replace(fit, pruning=PruningSchedule(fraction=0.0))
    return replace(intra, fit=fit)


def measure(pictures: Sequence[Still], iterations: int, seeds: Sequence[int], run: Run) -> Outcomes:
    """All fits."""
    found: Outcomes = {way: [] for way in WAYS}
    for still in pictures:
        picture = Picture(still.frame, run.threads)
        count = splat_count(*still.size)
        rank = ranks(detail(picture.samples, spacing(*still.size, count) / 2))
        for way in WAYS:
            settings = way_settings(way, iterations)
            for seed in seeds:
                found[way].append(one_fit(still, picture, rank, settings, count, seed))
            mean = np.mean([one.places.mean_rank for one in found[way][-len(seeds) :]])
            run.say(f"{still.name}, {count:,} splats, {WAYS[way]}: centres have the mean rank of detail {mean:.3f}")
    return found


def one_fit(still: Still, picture: Picture, rank: Any, settings: FrameSettings, count: int, seed: int) -> Outcome:
    """Fit so that `count` splats are left, and see where they are."""
    assert isinstance(settings.fit, FitSettings)
    weight = NEW_WEIGHT if settings.fit.pruning else KEPT_WEIGHT
    population, done = fitted(picture, settings, pruned_to(count, settings), seed, weight=weight)
    splats = population.splats()
    decoded = picture.rendered(splats)
    difference = (decoded.astype(np.float64) - still.frame)[rank > MAX_DETAIL]
    worst = psnr_from_mse(float((difference**2).mean()), 255)
    return Outcome(
        still.name, seed, done, splats, places(splats.positions, rank), picture.quality(splats), worst, decoded
    )


def splat_count(width: int, height: int) -> int:
    """The number of splats with as many for each pixel as the paper's figure has."""
    return round(PAPER_COUNT * width * height / (1920 * 1080))


def changes(found: Outcomes, way: str = "without") -> dict[str, Change]:
    """The change by GSP against another way, over pairs of equal picture and seed."""
    pairs: dict[str, Callable[[Outcome], float]] = {
        "mean_rank": lambda one: one.places.mean_rank,
        "psnr": lambda one: one.quality.psnr,
        "detail_psnr": lambda one: one.detail_psnr,
    }
    return {
        name: Change.of([value(one) for one in found[way]], [value(one) for one in found["with"]])
        for name, value in pairs.items()
    }


def verdict(change: dict[str, Change], against_weights: Change) -> Verdict:
    """Whether GSP moves centres to detail, and whether the picture gains from it; no word if chance may be all."""
    judged = change["mean_rank"], change["detail_psnr"]
    moved, gained = (one.raises for one in judged)
    numbers = (
        f"the mean rank of the detail at splat centres changes by {change['mean_rank'].text(4)}, PSNR by "
        f"{change['psnr'].text(2, ' dB')}, that of the most detailed quarter by {change['detail_psnr'].text(2, ' dB')} "
        f"(mean and standard error over {change['psnr'].pairs} pairs of equal picture and seed; clear is what "
        f"exceeds two of them). Against the same weights w without pruning, the rank changes by "
        f"{against_weights.text(4)}"
    )
    if moved and gained:
        return Verdict("yes", f"With GSP centres lie on more detail and detail comes out better: {numbers}.")
    if moved:
        return Verdict("partly", f"With GSP centres lie on more detail, but detail is not clearly better: {numbers}.")
    if gained:
        return Verdict("partly", f"With GSP detail comes out better, but centres do not clearly move to it: {numbers}.")
    if any(one.lowers for one in judged):
        return Verdict("no", f"With GSP neither do centres lie on more detail nor does it come out better: {numbers}.")
    return Verdict(
        "cannot be compared",
        f"What GSP changes may be chance, in the places of centres and in quality: {numbers}.",
    )


def draw(pictures: Sequence[Still], found: Outcomes, run: Run) -> dict[str, str]:
    """The figures, with captions."""
    shown = {way: [next(one for one in found[way] if one.name == still.name) for still in pictures] for way in WAYS}
    tall = 1.75 * len(pictures)
    figure, axes = new_figure(6.2, tall, len(pictures), 2)
    for row, still in enumerate(pictures):
        for place, way in zip(axes[row], ("without", "with"), strict=True):
            one = shown[way][row]
            title = f"{still.name}, {WAYS[way]}: mean rank {one.places.mean_rank:.3f}"
            show_centers(place, one.splats.positions, *still.size, title)
    centers = save_figure(figure, run.folder, "pruning-centers")
    figure, axes = new_figure(9, tall, len(pictures), 3)
    for row, still in enumerate(pictures):
        show_picture(axes[row, 0], still.frame, still.name)
        for place, way in zip(axes[row, 1:], ("without", "with"), strict=True):
            one = shown[way][row]
            show_picture(place, one.frame, f"{WAYS[way]}: {one.quality.psnr:.2f} dB")
    frames = save_figure(figure, run.folder, "pruning-pictures")
    figure, axes = new_figure(6.2, 3.2)
    middles = [100 * (number + 0.5) / BINS for number in range(BINS)]
    for number, (way, label) in enumerate(WAYS.items()):
        line(axes[0, 0], middles, np.mean([one.places.density for one in found[way]], axis=0).tolist(), number, label)
    axes[0, 0].set(xlabel="pixels by detail, percentile", ylabel="centres, in units of the mean density", xlim=(0, 100))
    axes[0, 0].legend()
    return {
        centers: "Centres of as many splats without GSP and with it, from the first random start.",
        frames: "The pictures, and what these splats make of them.",
        save_figure(figure, run.folder, "pruning-density"): "Density of centres against the detail around them, mean "
        "over pictures and random starts; even everywhere would be 1.",
    }


def table(found: Outcomes) -> Table:
    """Means over random starts for each picture, and over all."""
    rows = []
    for name in [*dict.fromkeys(one.name for one in found["with"]), None]:
        for way, label in WAYS.items():
            some = [one for one in found[way] if name in (None, one.name)]
            means = [
                (4, [one.places.mean_rank for one in some]),
                (2, [one.places.density[-1] for one in some]),
                (4, [one.places.divergence for one in some]),
                (2, [one.quality.psnr for one in some]),
                (2, [one.detail_psnr for one in some]),
                (4, [one.quality.ms_ssim for one in some]),
            ]
            rows.append((name or "all", label, *(f"{np.mean(values):.{digits}f}" for digits, values in means)))
    columns = ("picture", "fitted", "mean rank of detail", "density in the most detailed tenth", "divergence, bits",
               "PSNR, dB", "PSNR of the most detailed quarter, dB", "MS-SSIM")  # fmt: skip
    return Table("Centres and quality, means over random starts", columns, tuple(rows))


def run(settings: Run) -> Result:
    """Fit each picture in the three ways."""
    pictures = stills(settings, ("astronaut", "chelsea", "coffee"), *SIZE)
    in_paper = [still for still in pictures if still.name in PAPER_SEQUENCES]
    pictures = in_paper or pictures
    iterations = PaperSettings.paper().intra.fit.iterations if settings.full else ITERATIONS
    seeds = SEEDS[settings.full]
    found = measure(pictures, iterations, seeds, settings)
    change, against_weights = changes(found), changes(found, "weights")
    numbers = {
        "changes": change,
        "changes against weights without pruning": against_weights,
        "fits": {
            way: [
                {"picture": one.name, "seed": one.seed, "iterations": one.iterations, "splats": len(one.splats),
                 "places": one.places, "quality": one.quality, "detail_psnr": one.detail_psnr}
                for one in row
            ]
            for way, row in found.items()
        },
    }  # fmt: skip
    setting = (
        f"On {'; '.join(still.about for still in pictures)}. {len(found['with'][0].splats):,} splats at the end, as "
        f"many for each pixel as in the paper's figure, of a ninth more with GSP; {len(seeds)} random starts; the "
        f"paper's start and schedule with {iterations:,} iterations or until they converge; before quantisation. "
        f"Detail is the gradient's root mean square under a Gaussian of half the mean distance between splats; its "
        f"rank is 0 for the least detailed pixel and 1 for the most. Without GSP splats have no weight w; a third way "
        f"learns w from the same small start without pruning.{scales_missing(*(still.size for still in pictures))}"
    )
    sizes = " and ".join(sorted({"{}x{}".format(*still.size) for still in pictures}))
    conclusion = verdict(change, against_weights["mean_rank"]).about(
        settings,
        f"{len(found['with'][0].splats):,} splats on pictures of {sizes} and up to {iterations:,} iterations",
        f"--full --uvg DIR takes the paper's {PAPER_COUNT:,} on its frames and up to 50,000",
    )
    return Result(setting, numbers, (table(found),), draw(pictures, found, settings), conclusion)


EXPERIMENT: Final = Experiment(
    "pruning",
    "Pruning moves splats to detail",
    "Figure 3 shows the centres of 45,000 splats on the first frames of Beauty, HoneyBee and Jockey, optimised without "
    "pruning, and left by GSP of 50,000. The text says that with GSP they are more concentrated where the picture has "
    "detail, and so capture the details. No measure is given.",
    run,
)
