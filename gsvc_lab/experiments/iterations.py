"""A picture after more and more iterations: the paper's second figure."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final

from gsvc_base.arrays import Frame
from gsvc_base.splats import Splats
from gsvc_lab.experiments.experiment import Experiment, Result, Run, Table, Verdict
from gsvc_lab.experiments.figures import line, log_axis, new_figure, save_figure, show_picture
from gsvc_lab.experiments.fitting import Picture, Quality, fitted, pruned_to, quickly_fitted, scales_missing
from gsvc_lab.experiments.material import Still, preferred, stills
from gsvc_ref.encoder.settings import PaperSettings
from gsvc_ref.encoder.settings.paper import FrameSettings
from gsvc_ref.training import ConvergenceTest, FitSettings, Population

TIMES: Final = (200, 800, 3200, 12_800)
"""Iterations t of the paper's figure."""

QUICK_TIMES: Final = (12, 50, 200, 800)
"""Iterations that quick is asked for, each time from its start."""

SIZE: Final = (288, 162)
"""Size of the small version in pixels."""

SPLATS: Final = 1000
"""Splats of the small version; the paper's figure has PAPER_SPLATS on 1920x1080."""

PAPER_SPLATS: Final = 10_000


@dataclass(frozen=True)
class Moment:
    """The state of a fit: iterations, splats, the quality, and the decoded picture."""

    iterations: int
    splats: int
    quality: Quality
    frame: Frame


class PaperRun:
    """One long fit with the paper's start and schedule, looked at on its way."""

    def __init__(self, picture: Picture, settings: FrameSettings, count: int, times: Sequence[int], run: Run) -> None:
        self.picture, self.times, self.run = picture, times, run
        self.moments: list[Moment] = []  # at the iterations asked for
        self.converged: int | None = None  # the iteration at which the paper's rule would have ended it, or None
        schedule, start = settings.fit.with_(iterations=times[-1]), pruned_to(count, settings)
        assert isinstance(schedule, FitSettings)
        assert schedule.convergence is not None  # the paper's settings have the rule
        assert schedule.pruning is not None
        self.rule: ConvergenceTest = schedule.convergence.start()
        self.pruned = max(schedule.pruning.counts(start, times[-1]), default=0)  # the rule ends nothing before
        fitted(picture, replace(settings, fit=replace(schedule, convergence=None)), start, 0, self.step)

    def step(self, done: int, loss: float, population: Population) -> None:
        """After each iteration."""
        if self.converged is None and self.rule.update(loss) and done >= self.pruned:
            self.converged = done
        if done in self.times:
            self.moments.append(moment(self.picture, population.splats(), done, "the paper's schedule", self.run))


def moment(picture: Picture, splats: Splats, done: int, schedule: str, run: Run) -> Moment:
    """The state of a fit."""
    quality = picture.quality(splats)
    run.say(f"{done:,} iterations, {schedule}: {quality.psnr:.2f} dB")
    return Moment(done, len(splats), quality, picture.rendered(splats))


def quick_moments(picture: Picture, count: int, times: Sequence[int], run: Run) -> list[Moment]:
    """The ends of quick's fits with these numbers of iterations."""
    return [moment(picture, *quickly_fitted(picture, count, time, 0), "quick", run) for time in times]


def verdict(paper: Sequence[Moment], quick: Sequence[Moment]) -> Verdict:
    """Whether more iterations of the paper's schedule raise PSNR and MS-SSIM each time."""
    psnr = all(b.quality.psnr > a.quality.psnr for a, b in pairwise(paper))
    ms_ssim = all(b.quality.ms_ssim > a.quality.ms_ssim for a, b in pairwise(paper))
    path = ", ".join(f"{m.quality.psnr:.1f} dB (MS-SSIM {m.quality.ms_ssim:.3f}) after {m.iterations:,}" for m in paper)
    end = paper[-1].quality.psnr
    sooner = next((m for m in quick if m.quality.psnr >= end), None)
    beside = (
        f"quick's start and schedule are as good after {sooner.iterations:,} iterations ({sooner.quality.psnr:.1f} dB)"
        if sooner
        else f"quick's start and schedule stay below that, at {max(m.quality.psnr for m in quick):.1f} dB"
    )
    if psnr and ms_ssim:
        return Verdict("yes", f"The picture comes nearer each time: {path}. Beside it, {beside}.")
    if psnr or ms_ssim:
        only = "PSNR" if psnr else "MS-SSIM"
        return Verdict("partly", f"Only {only} rises each time: {path}. Beside it, {beside}.")
    return Verdict("no", f"Neither measure rises each time: {path}. Beside it, {beside}.")


def draw(still: Still, paper: Sequence[Moment], quick: Sequence[Moment], run: Run) -> dict[str, str]:
    """The figures, with captions."""
    figure, axes = new_figure(6.2, 4.1, 2, 2)
    for place, at in zip(axes.flat, paper, strict=False):
        show_picture(place, at.frame, f"{at.iterations:,} iterations, {at.quality.psnr:.1f} dB")
    pictures = save_figure(figure, run.folder, "iterations-pictures")
    figure, axes = new_figure(6.2, 3.2)
    for number, (name, row) in enumerate((("paper", paper), ("quick", quick))):
        line(axes[0, 0], [m.iterations for m in row], [m.quality.psnr for m in row], number, name)
    log_axis(axes[0, 0], [m.iterations for m in (*paper, *quick)])
    axes[0, 0].set(xlabel="iterations", ylabel="PSNR, dB")
    axes[0, 0].legend()
    curve = save_figure(figure, run.folder, "iterations-curve")
    return {
        pictures: f"{still.name} after more and more iterations of the paper's schedule.",
        curve: "PSNR against iterations. paper: one fit, measured at several iterations; quick: each point is a "
        "separate fit.",
    }


def table(paper: Sequence[Moment], quick: Sequence[Moment]) -> Table:
    """All moments."""
    rows = [
        (name, f"{m.iterations:,}", f"{m.splats:,}", f"{m.quality.psnr:.2f}", f"{m.quality.ms_ssim:.4f}")
        for name, row in (("the paper's start and schedule", paper), ("start and schedule of quick", quick))
        for m in row
    ]
    columns = ("fitted with", "iterations", "splats", "PSNR, dB", "MS-SSIM")
    return Table("Iterations and quality", columns, tuple(rows))


def run(settings: Run) -> Result:
    """Fit one picture, and look at it on the way."""
    still = preferred(stills(settings, ("coffee",), *SIZE), "Jockey")
    count = min(PAPER_SPLATS if settings.full else SPLATS, still.size[0] * still.size[1] // 2)
    picture = Picture(still.frame, settings.threads)
    long = PaperRun(picture, PaperSettings.paper().intra, count, TIMES, settings)
    quick = quick_moments(picture, count, QUICK_TIMES, settings)
    numbers: dict[str, Any] = {
        name: [{"iterations": m.iterations, "splats": m.splats, "quality": m.quality} for m in row]
        for name, row in (("paper", long.moments), ("quick", quick))
    }
    stop = (
        f"its convergence rule, switched off here, would have ended it after {long.converged:,}"
        if long.converged
        else "its convergence rule would not have ended it before"
    )
    setting = (
        f"On {still.about}; one random start; before quantisation. The paper's schedule (random start, "
        f"Adan at 1e-3, GSP) begins with {pruned_to(count, PaperSettings.paper().intra):,} splats, of which pruning "
        f"leaves {count:,} by iteration 4,000; {stop}. The paper's figure has {PAPER_SPLATS:,} splats on 1920x1080. "
        f"quick is the L-BFGS of profile main, with an evaluation more for each of its 15 additions of splats."
        f"{scales_missing(still.size)}"
    )
    numbers["converged"] = long.converged
    figures = draw(still, long.moments, quick, settings)
    conclusion = verdict(long.moments, quick).about(
        settings,
        f"{count:,} splats on one picture of {picture.width}x{picture.height}",
        f"--full --uvg DIR takes the paper's {PAPER_SPLATS:,} on its frame",
    )
    return Result(setting, numbers, (table(long.moments, quick),), figures, conclusion)


EXPERIMENT: Final = Experiment(
    "iterations",
    "Iterations and quality",
    "Figure 2 shows 10,000 splats on a frame of UVG's Jockey after 200, 800, 3,200 and 12,800 iterations: training "
    "moves them until they fit the picture. No numbers are given.",
    run,
)
