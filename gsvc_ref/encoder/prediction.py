"""The start of a P-frame: the decoded splats of the frame before, with what the scene calls for done to them.

Block by block, the error after prediction is compared with the error that was left when the block's splats were last
optimised. Noise changes every pixel and neither error; whatever moves, appears or changes its light raises the first.
The error left stays what it was while a block is static, so slow changes add up until they count.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8
from gsvc_base.splats import Splats
from gsvc_ref.encoder.blocks import MIN_ERROR, block_errors, block_pixels, worse_blocks
from gsvc_ref.encoder.effects import Mode
from gsvc_ref.encoder.log import OFF, FrameLog, percent
from gsvc_ref.encoder.rate import add_where_wrong, make_room
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.encoder.static import changed_pixels, static_splats
from gsvc_ref.rendering import Objective
from gsvc_ref.training import (
    KEPT_WEIGHT,
    NEW_WEIGHT,
    AnyFit,
    Population,
    psnr_of_loss,
    random_splats,
    uniform_numbers,
)
from gsvc_ref.training.coarse import Sizes
from gsvc_ref.training.motion import estimated_motion

STATIC_RATIO: Final = 1.05
"""A block whose error after prediction is at most this many times the error left is static: 0.2 dB."""

NEW_RATIO: Final = 1.25
"""A block whose error after prediction exceeds the error left by this factor shows something new: 1 dB."""

URGENT_RATIO: Final = 5.0
"""Blocks that exceed the error left by more than this get new splats in proportion to the excess."""

RENEWAL_RATIO: Final = 2.0
"""A frame gets more new splats once its error after prediction exceeds that of the last I-frame by more than this, in
proportion. With 1 in place of 2 `carphone` took 4 % more bytes for 0.1 dB less; `bikes` stayed the same."""

MOST_NEW: Final = 3.0
"""A frame gets at most this many times the setting's new splats."""

SAME_RATIO: Final = 1.05
"""A frame whose error after prediction is at most this many times the error left gets fewer iterations."""


@dataclass(frozen=True)
class Past:
    """The frame before, as far as its successor needs it.

    Attributes
    ----------
    picture
        The source, (H, W, 3) f4.
    left
        The error of each block when its splats were last optimised, by `errors_left`.
    level
        The sum of the errors that the last I-frame left, which P-frames are to keep to.
    is_catching_up
        Whether the frame is worse than that and was still becoming better, so that another pass over it is worth it.
    """

    picture: F4
    left: F8
    level: float
    is_catching_up: bool = False


@dataclass(frozen=True)
class PFrame:
    """A P-frame before anything of it is decided.

    Attributes
    ----------
    settings
        All settings.
    picture
        The frame's source, (H, W, 3) f4.
    objective
        The objective of this picture.
    reference
        The decoded splats of the frame before.
    past
        The source and the errors of the frame before.
    total, most
        N, the number of splats that the frame is meant to have, and the maximum that it may get.
    rng
        Draws new splats.
    sizes
        The picture's sizes, of which the objective is the full one.
    """

    settings: Settings
    picture: F4
    objective: Objective
    reference: Splats
    past: Past
    total: int
    most: int
    rng: np.random.Generator
    sizes: Sizes


@dataclass(frozen=True)
class Prediction:
    """The splats that a P-frame begins with.

    Attributes
    ----------
    population
        The splats to fit.
    fit
        The settings of their fit.
    worse
        The blocks that are not as good as they were left, (rows, columns) bool.
    error
        The error after prediction.
    error_ratio
        The same over the error left.
    """

    population: Population
    fit: AnyFit
    worse: NDArray[np.bool_]
    error: float
    error_ratio: float

    @property
    def is_static(self) -> bool:
        """Whether all splats are static, so that the frame before can be repeated."""
        return bool(len(self.population) and self.population.frozen.all())


def predict(frame: PFrame, log: FrameLog) -> Prediction:
    """Begin a P-frame with the splats of the frame before: freeze static ones, move the others, add and remove some."""
    past, objective = frame.past, frame.objective
    population = Population(frame.reference, KEPT_WEIGHT, np.arange(len(frame.reference)), frame.settings.inter.fit)
    loss = objective.loss(population.parameters())
    errors = block_errors(objective.residual())
    worse = worse_blocks(errors, past.left, STATIC_RATIO)
    if past.is_catching_up:
        worse |= errors > past.level / errors.size
    with log.timed("regions"):
        changed = _freeze_static(frame, population, worse, log)
    with log.timed("motion"):
        if _move(frame, population, worse, loss, log):
            errors = block_errors(objective.residual())
    with log.timed("gsa"):
        fit = _augment(frame, population, changed, errors, log)
    error = float(errors.sum())
    error_ratio = error / max(float(past.left.sum()), MIN_ERROR * frame.picture[..., 0].size)
    return Prediction(population, fit, worse, error, error_ratio)


def _freeze_static(frame: PFrame, population: Population, worse: NDArray[np.bool_], log: FrameLog) -> NDArray[np.bool_]:
    """Freeze the splats over regions that did not change; the pixels that may need other splats, (H, W) bool."""
    height, width = frame.picture.shape[:2]
    if frame.settings.effects.regions == "all" or frame.settings.psnr is not None:
        asked = frame.settings.effects.regions == "all"
        log.add("regions", "asked for" if asked else "a quality to hold: every splat is optimised", done=True)
        return np.ones((height, width), np.bool_)
    changed = block_pixels(worse, height, width)
    if not frame.past.is_catching_up:
        changed = changed & changed_pixels(frame.past.picture, frame.picture)
    population.frozen = static_splats(population.parameters(), changed)
    if population.frozen.any():
        share = percent(float(population.frozen.mean()))
        log.add("regions", f"{share} of the splats are static: nothing changed under them", done=False)
    else:
        log.add("regions", "something changed under every splat", done=True)
    return changed


def _move(frame: PFrame, population: Population, worse: NDArray[np.bool_], loss: float, log: FrameLog) -> bool:
    """Move the splats by the estimated motion if that makes the loss smaller than `loss`; whether it did."""
    if frame.settings.effects.motion == "off":
        log.add("motion", OFF, done=False)
        return False
    if not worse.any():
        log.add("motion", "nothing moves", done=False)
        return False
    motion = estimated_motion(frame.past.picture, frame.picture, population.values[:, :2])
    motion[population.frozen] = 0
    parameters = population.parameters()
    parameters[:, :2] += motion
    moved = frame.objective.loss(parameters)
    if moved >= loss:
        log.add("motion", "moving splats along the flow would not bring the prediction closer", done=True)
        return False
    population.values[:, :2] += motion
    gain = min(psnr_of_loss(moved), 100) - psnr_of_loss(loss)
    log.add("motion", f"moved splats bring the prediction {max(gain, 0):.1f} dB closer", done=True)
    return True


def _augment(frame: PFrame, population: Population, changed: NDArray[np.bool_], errors: F8, log: FrameLog) -> AnyFit:
    """Add splats (GSA), and make room for them if the rate asks for it (GSP); how to fit them all."""
    settings, effects, left = frame.settings, frame.settings.effects, frame.past.left
    where, share, need = changed, 1.0, 1.0
    if effects.gsa == "auto":
        new_blocks = worse_blocks(errors, left, NEW_RATIO)
        if frame.past.is_catching_up:
            new_blocks |= errors > frame.past.level / errors.size
        where = changed & block_pixels(new_blocks, *changed.shape)
        share = float(where.mean())
        need = min(1.0, share * _urgency(errors[new_blocks], left[new_blocks]))
        if frame.settings.psnr is None:
            need *= _renewal(errors, frame.past.level)
    new = 0 if effects.gsa == "off" else round(settings.inter.new_fraction * frame.total * need)
    if effects.gsp == "off":
        new = min(new, max(0, frame.most - len(population)))
    before = len(population)
    if effects.gsp == "auto":
        new = make_room(population, frame.objective, new, frame.total)
    removed = before - len(population)
    fit = settings.pruned(settings.inter.fit)
    if new and effects.gsa == "all" and not settings.inter.new_from_residual:
        _append_random(population, new, frame, learn_weights=fit.pruning is not None)
    elif new:
        sizes = frame.sizes if settings.inter.new_from_residual else None
        add_where_wrong(population, frame.objective, new, frame.rng, where, sizes)
    log.add("gsa", _gsa_reason(effects.gsa, new, share), done=new > 0)
    log.add("gsp", _gsp_reason(effects.gsp, new, removed), done=(new if effects.gsp == "all" else removed) > 0)
    return pruning_as_many(fit, new, len(population)) if effects.gsp == "all" else fit


def _urgency(errors: F8, left: F8) -> float:
    """The factor, at least 1, by which blocks call for more new splats than their share of the picture."""
    return max(1.0, float(errors.sum()) / max(float(left.sum()), MIN_ERROR) / URGENT_RATIO)


def _renewal(errors: F8, level: float) -> float:
    """The factor, from 1 to MOST_NEW, by which a frame needs more new splats since it fell behind the last I-frame."""
    return min(max(1.0, float(errors.sum()) / max(RENEWAL_RATIO * level, MIN_ERROR)), MOST_NEW)


def _append_random(population: Population, count: int, frame: PFrame, *, learn_weights: bool) -> None:
    """Add nearly invisible splats anywhere, as in the paper; where w is not learnt, their colours are faint."""
    height, width = frame.picture.shape[:2]
    uniforms = uniform_numbers(count, frame.rng)
    if learn_weights:
        population.augment(uniforms, width, height)
    else:
        splats = random_splats(uniforms, width, height)
        faint = Splats(splats.positions, splats.cholesky, splats.colors * np.float32(NEW_WEIGHT))
        population.append(faint, KEPT_WEIGHT)


def _gsa_reason(mode: Mode, new: int, share: float) -> str:
    if mode == "off":
        return OFF
    if mode == "all":
        return "asked for" if new else "no room for more splats without pruning"
    if share == 0:
        return "no part of the picture is predicted worse than the frame before was left"
    worse = f"{percent(share)} of the picture is predicted worse"
    return f"{worse} than the frame before was left" if new else f"{worse}, for which not even one splat is added"


def _gsp_reason(mode: Mode, new: int, removed: int) -> str:
    if mode == "off":
        return OFF
    if mode == "all":
        return f"as many splats as were added: {new:,}"
    return f"{removed:,} splats make room for new ones" if removed else "the rate has room for all splats"


def pruning_as_many(settings: AnyFit, count: int, splats: int) -> AnyFit:
    """The settings of a fit of `splats` splats that removes `count` of them, as many as were added."""
    if settings.pruning is None or not 0 < count < splats:
        return replace(settings, pruning=None)
    return replace(settings, pruning=replace(settings.pruning, fraction=count / splats))
