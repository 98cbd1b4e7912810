"""How well the frame before predicts a frame, block by block: what says where there is something to do.

The error of a block after prediction is compared with the error that was left in it when its splats were last
optimised. Noise changes every pixel and neither error; whatever moves, appears or changes its light raises the first.
Since the error left stays what it was while a block rests, slow changes add up until they count.
"""

import time
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.encoder.decisions import Decision, decision
from gsvc_ref.encoder.motion import estimated_motion
from gsvc_ref.encoder.rate import add_where_wrong, make_room
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.encoder.static import at_rest, changed_pixels
from gsvc_ref.rendering import Objective
from gsvc_ref.splats import F4, Splats
from gsvc_ref.training import (
    KEPT_WEIGHT,
    NEW_WEIGHT,
    FitSettings,
    Population,
    psnr_of_loss,
    random_splats,
    uniform_numbers,
)

F8 = NDArray[np.float64]

BLOCK: Final = 16
"""Side of a block in pixels."""

REST_RATIO: Final = 1.05
"""A block whose error after prediction is at most this many times the error left has not changed: 0.2 dB."""

NEW_RATIO: Final = 1.25
"""A block whose error after prediction exceeds the error left by this factor shows something new: 1 dB."""

URGENT_RATIO: Final = 5.0
"""Blocks that exceed the error left by more than this get new splats in proportion to the excess."""

MAX_ERROR: Final = 0.009486832980505138  # 3 * 10^-2.5
"""Error per pixel, summed over the channels, beyond which a block counts as left with no more: 25 dB. A block that is
worse is never good enough to be left alone, whatever it was before."""

SAME_RATIO: Final = 1.05
"""A frame whose error after prediction is at most this many times the error left gets fewer iterations."""

MIN_ERROR: Final = 1e-6
"""Error per pixel, summed over the channels, that is too small to count: rounding to 8 bits leaves four times that."""


def block_errors(residual: F4) -> F8:
    """The sum of squares of a residual (H, W, 3) f4 over each block, (rows, columns) f8."""
    squares = np.square(residual, dtype=np.float64).sum(axis=2)
    rows = np.add.reduceat(squares, np.arange(0, squares.shape[0], BLOCK), axis=0)
    return np.asarray(np.add.reduceat(rows, np.arange(0, squares.shape[1], BLOCK), axis=1))


def errors_left(residual: F4) -> F8:
    """The errors of the blocks that a frame leaves for the next ones to be compared with, (rows, columns) f8."""
    height, width = residual.shape[:2]
    rows, columns = (np.minimum(BLOCK, side - np.arange(0, side, BLOCK)) for side in (height, width))
    return np.minimum(block_errors(residual), MAX_ERROR * np.outer(rows, columns))


def worse_blocks(now: F8, left: F8, ratio: float) -> NDArray[np.bool_]:
    """Which blocks have an error above `ratio` times the error left, (rows, columns) bool."""
    return np.asarray(now > ratio * left + MIN_ERROR * BLOCK * BLOCK)


def block_pixels(blocks: NDArray[np.bool_], height: int, width: int) -> NDArray[np.bool_]:
    """The pixels of the blocks (rows, columns), (H, W) bool."""
    return np.asarray(blocks.repeat(BLOCK, axis=0)[:height].repeat(BLOCK, axis=1)[:, :width])


@dataclass(frozen=True)
class Past:
    """What is known of the frame before.

    Attributes
    ----------
    picture
        The source, (H, W, 3) f4.
    left
        The error of each block when its splats were last optimised, as of `errors_left`.
    """

    picture: F4
    left: F8


class Prediction:
    """The start of a P-frame: the decoded splats of the frame before, with what the scene calls for done to them.

    Parameters
    ----------
    settings
        All settings.
    objective
        Of the frame's picture.
    picture
        The frame's source, (H, W, 3) f4.
    reference
        The decoded splats of the frame before.
    past
        What is known of it.
    total
        N, the splats that the frame is meant to have.
    most
        The most that it may get.
    rng
        Draws new splats.

    Attributes
    ----------
    population
        The splats to fit.
    fit
        How to fit them.
    worse
        The blocks that are not as good as they were left, (rows, columns) bool.
    decisions
        What was decided on the way.
    """

    def __init__(
        self, settings: Settings, objective: Objective, picture: F4, reference: Splats, past: Past, total: int,
        most: int, rng: np.random.Generator,
    ) -> None:  # fmt: skip
        self.settings, self.objective, self.picture, self.past, self.rng = settings, objective, picture, past, rng
        self.total, self.most = total, most
        self.population = Population(reference, KEPT_WEIGHT, np.arange(len(reference)), settings.inter.fit)
        self.fit = settings.pruned(settings.inter.fit)
        self.decisions: list[Decision] = []
        loss = objective.loss(self.population.parameters())
        self.errors = block_errors(objective.residual())
        self.worse = worse_blocks(self.errors, past.left, REST_RATIO)
        self.changed = self._changed()
        for step in (self._rest, lambda: self._move(loss), self._augment):
            begin = time.perf_counter()
            first, *others = step()
            self.decisions += [replace(first, seconds=time.perf_counter() - begin), *others]

    def _changed(self) -> NDArray[np.bool_]:
        """The pixels that may need other splats than the frame before, (H, W) bool."""
        height, width = self.picture.shape[:2]
        if self.settings.effects.regions == "all" or self.settings.psnr is not None:
            return np.ones((height, width), np.bool_)
        return changed_pixels(self.past.picture, self.picture) & block_pixels(self.worse, height, width)

    def _rest(self) -> tuple[Decision]:
        """Freeze the splats over regions that did not change."""
        if self.settings.effects.regions == "all":
            return (decision("regions", "asked", done=True),)
        if self.settings.psnr is not None:
            return (decision("regions", "quality", done=True),)
        self.population.frozen = at_rest(self.population.parameters(), self.changed)
        resting = float(self.population.frozen.mean()) if len(self.population) else 0.0
        if resting == 0:
            return (decision("regions", "moving", done=True),)
        return (decision("regions", "rest", max(1, 100 * resting), done=False),)

    def _move(self, still: float) -> tuple[Decision]:
        """Move the splats by the estimated motion if that brings the picture closer than a loss of `still`."""
        if self.settings.effects.motion == "off":
            return (decision("motion", "off", done=False),)
        if not self.worse.any():
            return (decision("motion", "still", done=False),)
        motion = estimated_motion(self.past.picture, self.picture, self.population.values[:, :2])
        motion[self.population.frozen] = 0
        parameters = self.population.parameters()
        parameters[:, :2] += motion
        moved = self.objective.loss(parameters)
        if moved >= still:
            return (decision("motion", "no gain", done=True),)
        self.population.values[:, :2] += motion
        self.errors = block_errors(self.objective.residual())
        return (decision("motion", "gain", min(psnr_of_loss(moved), 100) - psnr_of_loss(still), done=True),)

    def _augment(self) -> tuple[Decision, Decision]:
        """Add splats (GSA), and make room for them if the rate asks for it (GSP)."""
        settings, effects = self.settings, self.settings.effects
        where, share, need = self.changed, 1.0, 1.0
        if effects.gsa == "auto":
            new_blocks = worse_blocks(self.errors, self.past.left, NEW_RATIO)
            where = where & block_pixels(new_blocks, *where.shape)
            share = float(where.mean())
            need = min(1.0, share * self._urgency(new_blocks))
        new = 0 if effects.gsa == "off" else round(settings.inter.new_fraction * self.total * need)
        if effects.gsp == "off":
            new = min(new, max(0, self.most - len(self.population)))
        before = len(self.population)
        if effects.gsp == "auto":
            new = make_room(self.population, new, self.total)
        removed = before - len(self.population)
        if new and effects.gsa == "all" and not settings.inter.new_from_residual:
            self._append_random(new, where.shape[1], where.shape[0])
        elif new:
            add_where_wrong(self.population, self.objective, new, self.rng, where)
        if effects.gsp == "all":
            self.fit = pruning_as_many(self.fit, new, len(self.population))
        return self._gsa_decision(new, share), self._gsp_decision(new, removed)

    def _urgency(self, blocks: NDArray[np.bool_]) -> float:
        """By how much more than their share blocks call for new splats, at least 1."""
        left = max(float(self.past.left[blocks].sum()), MIN_ERROR)
        return max(1.0, float(self.errors[blocks].sum()) / left / URGENT_RATIO)

    def _append_random(self, count: int, width: int, height: int) -> None:
        """Add nearly invisible splats anywhere, as in the paper; where w is not learnt, their colours are faint."""
        uniforms = uniform_numbers(count, self.rng)
        if self.fit.pruning is None:
            splats = random_splats(uniforms, width, height)
            faint = Splats(splats.positions, splats.cholesky, splats.colors * np.float32(NEW_WEIGHT))
            self.population.append(faint, KEPT_WEIGHT)
        else:
            self.population.augment(uniforms, width, height)

    def _gsa_decision(self, new: int, share: float) -> Decision:
        mode = self.settings.effects.gsa
        if mode == "off":
            return decision("gsa", "off", done=False)
        if mode == "all":
            return decision("gsa", "asked" if new else "no room", done=bool(new))
        if share == 0:
            return decision("gsa", "nothing new", done=False)
        return decision("gsa", "new" if new else "too little", max(1, 100 * share), done=bool(new))

    def _gsp_decision(self, new: int, removed: int) -> Decision:
        mode = self.settings.effects.gsp
        if mode == "off":
            return decision("gsp", "off", done=False)
        if mode == "all":
            return decision("gsp", "taken back", new, done=bool(new))
        return decision("gsp", "exchanged", removed, done=True) if removed else decision("gsp", "fits", done=False)

    @property
    def is_still(self) -> bool:
        """Whether all splats rest, so that the frame before can be repeated."""
        return bool(len(self.population) and self.population.frozen.all())

    @property
    def growth(self) -> float:
        """How many times the error left is that after prediction."""
        return float(self.errors.sum() / max(self.past.left.sum(), MIN_ERROR * self.picture[..., 0].size))


def pruning_as_many(settings: FitSettings, count: int, splats: int) -> FitSettings:
    """The settings of a fit of so many splats that removes `count` of them, as many as were added."""
    if settings.pruning is None or not 0 < count < splats:
        return replace(settings, pruning=None)
    return replace(settings, pruning=replace(settings.pruning, fraction=count / splats))
