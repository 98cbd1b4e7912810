"""Fitting the frame after the circle's jump, with and without GSA."""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, Frame
from gsvc_base.splats import Splats
from gsvc_lab.experiments.experiment import Run
from gsvc_lab.experiments.fitting import Picture, fitted, pruned_to
from gsvc_lab.scenes import Base, Clip, Scene, truth
from gsvc_ref.encoder.settings import PaperSettings
from gsvc_ref.encoder.settings.paper import FrameSettings
from gsvc_ref.metrics import psnr
from gsvc_ref.training import KEPT_WEIGHT, FitSettings, Population, fit, uniform_numbers

SCENE: Final = "jumping-circle"

JUMP: Final = 12
"""The first frame with the circle on the right."""

CASES: Final = {
    "light": "light background",
    "black": "black background",
    "gone": "black background, only splats at the circle kept",
}
"""``gone`` keeps of the fitted splats of ``black`` only those within a diameter of the circle's centre."""

WAYS: Final = {"without": "without GSA", "with": "with GSA"}


@dataclass(frozen=True)
class Size:
    """The size of the experiment."""

    width: int  # Size of the frame in pixels
    height: int
    splats: int  # number of splats of the frame before the jump
    intra: int  # Iterations of that frame, and of the frames after the jump that are compared
    inter: tuple[int, ...]
    seeds: tuple[int, ...]  # seeds of random starts


@dataclass(frozen=True)
class Outcome:
    """The outcome of a P-frame."""

    case: str  # The case, the way, and the number of iterations and the seed of the fit
    way: str
    iterations: int
    seed: int
    psnr: float  # PSNR in dB, against the frame with the circle on the right
    # Fractions of the pixels inside the circle's new and old outline whose colour is nearer to the
    # circle's than to the background's
    coverage: float
    ghost: float
    splats: Splats  # The splats, and the decoded picture
    frame: Frame


class Jump:
    """The two frames around the jump, and the circle in each.

    `before` and `after`: the frames as pictures to fit.
    """

    def __init__(self, width: int, height: int, threads: int | None, *, black: bool) -> None:
        scene = Scene.named(SCENE).resized(width=width, height=height)
        clip = Clip(replace(scene, base=Base(color=(0.0, 0.0, 0.0))) if black else scene)
        self.before, self.after = (Picture(clip.frame(number), threads) for number in (JUMP - 1, JUMP))
        masks = [truth(clip, number)["shape-1.mask"] for number in (JUMP - 1, JUMP)]
        # The pixels of the circle in each, (2, H, W) bool
        self.inside = np.stack([mask > 0.5 for mask in masks])  # (2, H, W) bool
        rows, columns = np.nonzero(self.inside[0])
        # Place of the circle before the jump, in pixels
        self.center = np.array([columns.mean() + 0.5, rows.mean() + 0.5])
        self.radius = float(np.sqrt(self.inside[0].sum() / np.pi))
        self.color = self._mean(self.before.samples, masks[0] == 1)  # its edge is mixed with the background
        self.background = self._mean(self.before.samples, self.inside[1])

    @staticmethod
    def _mean(picture: F4, where: NDArray[np.bool_]) -> Any:
        return picture[where].mean(axis=0, dtype=np.float64)

    def covered(self, frame: Frame) -> tuple[float, float]:
        """Coverage and ghost of a frame (H, W, 3) u1."""
        picture = frame / 255
        near = np.linalg.norm(picture - self.color, axis=2) < np.linalg.norm(picture - self.background, axis=2)
        return float(near[self.inside[1]].mean()), float(near[self.inside[0]].mean())

    def at_circle(self, splats: Splats) -> Splats:
        """Only the splats within a diameter of the circle's centre before the jump."""
        distance = np.linalg.norm(splats.positions - self.center, axis=1)
        return Splats.from_array(splats.to_array()[distance <= 2 * self.radius])

    def outcome(self, case: str, way: str, done: int, seed: int, splats: Splats) -> Outcome:
        """The outcome of splats as the frame after the jump."""
        frame = self.after.rendered(splats)
        quality = psnr(self.after.frame, frame, 255)
        return Outcome(case, way, done, seed, quality, *self.covered(frame), splats, frame)


def paper_inter(jump: Jump, reference: Splats, total: int, iterations: int, seed: int, *, gsa: bool) -> Splats:
    """A P-frame by the paper's schedule: with GSA and GSP, or from the reference's splats alone."""
    settings = PaperSettings.paper().inter
    assert isinstance(settings.fit, FitSettings)
    schedule = settings.fit.with_(iterations=iterations)
    if not gsa:
        schedule = replace(schedule, pruning=None)
    rng = np.random.default_rng([seed, 1])
    population = Population(reference, KEPT_WEIGHT, np.arange(len(reference)), schedule.optimizer)
    if gsa:
        uniforms = uniform_numbers(round(settings.new_fraction * total), rng)
        population.augment(uniforms, jump.after.width, jump.after.height)
    fit(population, jump.after.objective, schedule)
    return population.splats()


def intra(jump: Jump, settings: FrameSettings, count: int, seed: int) -> Splats:
    """The splats of the frame before the jump."""
    population, _ = fitted(jump.before, settings, count, seed)
    return population.splats()


def measure(size: Size, run: Run) -> list[Outcome]:
    """All P-frames, by the paper's schedule."""
    found = []
    paper = PaperSettings.paper().intra
    paper = replace(paper, fit=paper.fit.with_(iterations=size.intra))
    total = pruned_to(size.splats, paper)  # the paper's N; pruning leaves 90 % of it
    for background in ("light", "black"):
        jump = Jump(size.width, size.height, run.threads, black=background == "black")
        for seed in size.seeds:
            reference = intra(jump, paper, total, seed)
            starts = {background: reference}
            if background == "black":
                starts["gone"] = jump.at_circle(reference)
            for case, start in starts.items():
                for way in WAYS:
                    for iterations in size.inter:
                        splats = paper_inter(jump, start, total, iterations, seed, gsa=way == "with")
                        found.append(jump.outcome(case, way, iterations, seed, splats))
            run.say(f"{CASES[background]}, random start {seed}: {len(found)} P-frames so far")
    return found
