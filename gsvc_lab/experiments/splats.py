"""A picture made of more and more splats: the paper's first figure."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

from gsvc_base.arrays import Frame
from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_lab.experiments.experiment import Experiment, Result, Run, Table, Verdict
from gsvc_lab.experiments.figures import line, log_axis, new_figure, save_figure, show_picture
from gsvc_lab.experiments.fitting import Picture, Quality, fitted, pruned_to, quickly_fitted, scales_missing
from gsvc_lab.experiments.material import Still, preferred, stills
from gsvc_ref.encoder.settings import PaperSettings
from gsvc_ref.training import FitSettings

COUNTS: Final = (10, 100, 1000, 10_000)
"""N, as in the paper's figure."""

SIZE: Final = (288, 162)
"""Size of the small version in pixels; the least 16:9 frame on which MS-SSIM has all its five scales."""

ITERATIONS: Final = 2000
"""Iterations of the paper's schedule in the small version."""

SCHEDULES: Final = {"paper": "the paper's start and schedule", "quick": "start and schedule of quick"}


@dataclass(frozen=True)
class Fit:
    """One fit: N, splats left and iterations made, the quality, and the decoded picture."""

    count: int
    left: int
    iterations: int
    quality: Quality
    frame: Frame


def measure(still: Still, counts: Sequence[int], iterations: int, run: Run) -> dict[str, list[Fit]]:
    """The fits by schedule, in the order of the counts."""
    picture = Picture(still.frame, run.threads)
    paper, quick = PaperSettings.paper().intra, PaperSettings.quick().intra
    paper = paper.with_(fit=paper.fit.with_(iterations=iterations))

    def by_paper(count: int) -> tuple[Splats, int]:
        population, done = fitted(picture, paper, pruned_to(count, paper), 0)
        return population.splats(), done

    def by_quick(count: int) -> tuple[Splats, int]:
        return quickly_fitted(picture, count, quick.fit.iterations, 0)

    return {
        name: [one_fit(picture, count, way, SCHEDULES[name], run) for count in counts]
        for name, way in (("paper", by_paper), ("quick", by_quick))
    }


def one_fit(picture: Picture, count: int, way: Callable[[int], tuple[Splats, int]], schedule: str, run: Run) -> Fit:
    """Fit with N splats at the end."""
    splats, done = way(count)
    quality = picture.quality(splats)
    run.say(f"{count:,} splats, {schedule}: {done:,} iterations, {quality.psnr:.2f} dB")
    return Fit(count, len(splats), done, quality, picture.rendered(splats))


def verdict(fits: dict[str, list[Fit]]) -> Verdict:
    """Whether each step to more splats raises PSNR and MS-SSIM, with either schedule."""
    rising = {name: all(better(a, b) for a, b in pairwise(row)) for name, row in fits.items()}
    ranges = "; ".join(
        f"with {SCHEDULES[name]} PSNR goes {' – '.join(f'{fit.quality.psnr:.1f}' for fit in row)} dB and MS-SSIM "
        f"{' – '.join(f'{fit.quality.ms_ssim:.3f}' for fit in row)}"
        for name, row in fits.items()
    )
    if all(rising.values()):
        return Verdict("yes", f"Every step to more splats raises both PSNR and MS-SSIM: {ranges}.")
    if any(rising.values()):
        which = next(SCHEDULES[name] for name, good in rising.items() if good)
        return Verdict("partly", f"Every step to more splats raises both measures only with {which}: {ranges}.")
    return Verdict("no", f"There are steps to more splats that do not raise both measures: {ranges}.")


def better(fewer: Fit, more: Fit) -> bool:
    """Whether both measures are higher."""
    return more.quality.psnr > fewer.quality.psnr and more.quality.ms_ssim > fewer.quality.ms_ssim


def draw(still: Still, fits: dict[str, list[Fit]], run: Run) -> dict[str, str]:
    """The figures, with captions."""
    captions = {}
    for name, row in fits.items():
        figure, axes = new_figure(9, 4.1, 2, 3)
        show_picture(axes.flat[0], still.frame, still.name)
        for place, fit in zip(axes.flat[1:], row, strict=False):
            show_picture(place, fit.frame, f"{fit.left:,} splats, {fit.quality.psnr:.1f} dB")
        curve(axes.flat[-1], fits)
        caption = (
            f"{still.name} and what {SCHEDULES[name]} make of it with more and more splats; PSNR of both schedules."
        )
        captions[save_figure(figure, run.folder, f"splats-{name}")] = caption
    return captions


def curve(axes: Any, fits: dict[str, list[Fit]]) -> None:
    """PSNR against splats."""
    for number, (name, row) in enumerate(fits.items()):
        line(axes, [fit.left for fit in row], [fit.quality.psnr for fit in row], number, name)
    log_axis(axes, [fit.left for row in fits.values() for fit in row])
    axes.set(xlabel="splats", ylabel="PSNR, dB")
    axes.legend()


def table(fits: dict[str, list[Fit]]) -> Table:
    """All fits."""
    rows = [
        (
            SCHEDULES[name],
            f"{fit.left:,}",
            f"{fit.iterations:,}",
            f"{fit.quality.psnr:.2f}",
            f"{fit.quality.ms_ssim:.4f}",
        )
        for name, row in fits.items()
        for fit in row
    ]
    return Table("Splats and quality", ("fitted with", "splats", "iterations", "PSNR, dB", "MS-SSIM"), tuple(rows))


def reach(iterations: int) -> float:
    """The distance in pixels that steps of the learning rate lead in a number of iterations of the paper's schedule."""
    fit = PaperSettings.paper().intra.fit
    assert isinstance(fit, FitSettings)
    return sum(fit.rates.cholesky * fit.schedule(iteration) for iteration in range(iterations))


def run(settings: Run) -> Result:
    """Fit one picture with each number of splats."""
    still = preferred(stills(settings, ("coffee",), *SIZE), "Jockey")
    iterations = PaperSettings.paper().intra.fit.iterations if settings.full else ITERATIONS
    width, height = still.size
    counts = [count for count in COUNTS if count * 2 <= width * height]
    if len(counts) < 2:
        raise UsageError(f"{still.name} has {width}x{height} pixels, too few for 100 splats; give a larger picture")
    fits = measure(still, counts, iterations, settings)
    numbers = {
        name: [{"count": f.count, "splats": f.left, "iterations": f.iterations, "quality": f.quality} for f in row]
        for name, row in fits.items()
    }
    setting = (
        f"On {still.about}; one random start; before quantisation. The paper's schedule (random start, Adan at "
        f"1e-3, GSP) begins with N/0.9 splats, of which pruning leaves N, and runs {iterations:,} iterations or until "
        f"it converges; the paper's pictures are of 1920x1080, after a number of iterations that it does not state. "
        f"Steps of about 1e-3 pixels let a splat grow by about {reach(iterations):.0f} pixels in that time, so few "
        f"splats cannot cover the frame. quick starts from the picture and makes "
        f"{PaperSettings.quick().intra.fit.iterations} iterations.{scales_missing(still.size)}"
    )
    conclusion = verdict(fits).about(
        settings,
        f"one picture of {width}x{height} and up to {iterations:,} iterations of the paper's schedule",
        "--full --uvg DIR takes the paper's frame and up to 50,000",
    )
    return Result(setting, numbers, (table(fits),), draw(still, fits, settings), conclusion)


EXPERIMENT: Final = Experiment(
    "splats",
    "Splats and quality",
    "Figure 1 shows a frame of UVG's Jockey made of 10, 100, 1,000 and 10,000 splats: the more splats, the nearer they "
    "come to the picture. No numbers are given.",
    run,
)
