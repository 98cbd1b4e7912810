"""Fitting the splats of one frame to its picture: the inner loop of the paper's algorithm 1."""

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.checks import check_types
from gsvc_ref.errors import UsageError
from gsvc_ref.rendering import Objective
from gsvc_ref.splats import F4, PARAMETERS_PER_SPLAT, Splats
from gsvc_ref.training.adan import Adan, AdanSettings
from gsvc_ref.training.augmentation import augment, residual_splats
from gsvc_ref.training.convergence import Convergence
from gsvc_ref.training.pruning import PruningSchedule, compact, prune
from gsvc_ref.training.schedule import PAPER_SCHEDULE, Schedule
from gsvc_ref.training.weighting import weighted_gradients, weighted_parameters

MIN_FACTOR: Final = np.float32(0.25)
"""Least l11 and l22 in pixels: a smaller splat can lie between all pixel centres and then gets no gradient."""

LARGEST_RATE: Final = 1e6
"""Of a learning rate: far beyond any use, and finite in binary32 after every factor on it."""

STEP_SIZES: Final = (0.3, 4.0)
"""Limits in pixels of the step factor of a splat, half its mean radius sqrt(l11 l22), where steps are relative."""

MAX_ITERATIONS: Final = 10_000_000
"""Of one fit; the paper has 50,000."""

NEW_SIZE: Final = 0.165
"""Deviation of a splat that is added where the residual is, in units of the mean distance between splats; measured."""

GEOMETRY: Final = np.arange(PARAMETERS_PER_SPLAT + 1) < 5
"""The columns that steps relative to a splat's size apply to: position and Cholesky factor, (9,) bool."""

NEW: Final = -1
"""Origin of a splat that the reference frame does not have."""

OnIteration = Callable[[int, int, float], None]
"""Called with the iteration, the number of iterations, and the loss."""


@dataclass(frozen=True)
class Rates:
    """Learning rates of the attributes in learned units (`FitSettings.learn_pixels`); the paper has 1e-3 for all."""

    position: float = 1e-3
    cholesky: float = 1e-3
    color: float = 1e-3
    weight: float = 1e-3

    def __post_init__(self) -> None:
        check_types(self)
        if not all(0 <= rate <= LARGEST_RATE for rate in (self.position, self.cholesky, self.color, self.weight)):
            raise UsageError(f"learning rates must be in 0..{LARGEST_RATE:g}; they are {self}")

    def columns(self) -> F4:
        """The rate of each of the nine columns of `Population.values`, (9,) f4."""
        return np.array([self.position] * 2 + [self.cholesky] * 3 + [self.color] * 3 + [self.weight], np.float32)


@dataclass(frozen=True)
class Growth:
    """Beginning with a part of the splats and adding the others where the residual is (ours, not the paper's).

    Attributes
    ----------
    first
        Fraction of the splats that the first iteration has.
    additions
        How many times splats are added, in equal numbers.
    begin, end
        The fractions of the iterations at which the first and the last addition come.
    """

    first: float = 0.1
    additions: int = 15
    begin: float = 0.04
    end: float = 0.6

    def __post_init__(self) -> None:
        check_types(self)
        if not (0 < self.first <= 1 and 1 <= self.additions <= 1000 and 0 <= self.begin <= self.end < 1):
            raise UsageError(f"{self}: it must have 0 < first <= 1, additions in 1..1000 and 0 <= begin <= end < 1")

    def counts(self, total: int, iterations: int) -> dict[int, int]:
        """Iteration (from 0) -> number of splats after its addition; the last entry is the total."""
        start = self.start(total)
        plan = {}
        for j in range(self.additions):
            at = self.begin + (self.end - self.begin) * j / max(1, self.additions - 1)
            plan[int(iterations * at)] = start + round((total - start) * (j + 1) / self.additions)
        return plan

    def start(self, total: int) -> int:
        """The number of splats at the beginning, at least 1."""
        return max(1, round(total * self.first))


@dataclass(frozen=True)
class FitSettings:
    """How a frame is fitted; the defaults are the paper's for an I-frame.

    Attributes
    ----------
    iterations
        Most iterations.
    rates, schedule, optimizer
        Learning rates, their factor over the iterations, and Adan's other settings.
    learn_pixels
        Learn positions in pixels. False learns them normalised to -1..1, so that a rate means the same fraction of
        any frame, as in the authors' code.
    relative_steps
        Multiply the steps of positions and Cholesky factors by half the splat's mean radius, within STEP_SIZES.
    convergence
        When to stop early, or None.
    pruning
        When GSP removes how many splats, which also makes the weights w learnable; None: neither.
    growth
        Start with few splats and add where the residual is; None: all from the start.
    """

    iterations: int = 50_000
    rates: Rates = Rates()
    schedule: Schedule = PAPER_SCHEDULE
    optimizer: AdanSettings = field(default_factory=AdanSettings)
    learn_pixels: bool = False
    relative_steps: bool = False
    convergence: Convergence | None = field(default_factory=Convergence)
    pruning: PruningSchedule | None = field(default_factory=PruningSchedule.intra)
    growth: Growth | None = None

    def __post_init__(self) -> None:
        check_types(self)
        if not 0 <= self.iterations <= MAX_ITERATIONS:
            raise UsageError(f"iterations is {self.iterations}; it must be in 0..{MAX_ITERATIONS}")


class Population:
    """Splats while they are fitted: parameters, weights w, origins and the optimiser's state, row by row.

    Attributes
    ----------
    values
        (N, 9) f4: the columns of `Splats.to_array`, then w.
    origins
        (N,) i8: the index of the splat in the reference frame, or NEW.
    frozen
        (N,) bool: which splats `fit` leaves as they are, and does not render again and again.
    """

    def __init__(self, splats: Splats, weight: float, origins: NDArray[np.int64], settings: FitSettings) -> None:
        weights = np.full((len(splats), 1), weight, np.float32)
        self.values: F4 = np.concatenate([splats.to_array(), weights], axis=1)  # (N, 9) f4
        self.origins = origins
        self.frozen = np.zeros(len(splats), np.bool_)
        self.optimizer = Adan(len(splats), PARAMETERS_PER_SPLAT + 1, settings.optimizer)

    def __len__(self) -> int:
        return len(self.values)

    @property
    def weights(self) -> F4:
        """The weights w, (N,) f4."""
        return self.values[:, PARAMETERS_PER_SPLAT]

    def parameters(self) -> F4:
        """What is rendered, (N, 8) f4: colours are w c' (paper, the equation of the weighted rendering)."""
        return weighted_parameters(self.values)

    def splats(self) -> Splats:
        """The splats with w c' as their colours: what is coded, and what the next frame starts from."""
        return Splats.from_array(self.parameters())

    def copy(self) -> "Population":
        """A copy that changes of this one do not reach."""
        return copy.deepcopy(self)

    def assign(self, other: "Population") -> None:
        """Become the other population."""
        self.values, self.origins, self.optimizer = other.values, other.origins, other.optimizer
        self.frozen = other.frozen

    def append(self, splats: Splats, weight: float) -> None:
        """Add new splats at the end, with fresh optimiser state."""
        weights = np.full((len(splats), 1), weight, np.float32)
        self._grow(np.concatenate([self.values, np.concatenate([splats.to_array(), weights], axis=1)]))

    def augment(self, uniforms: F4, width: int, height: int) -> None:
        """Add random splats of small weight at the end, with fresh optimiser state; see `augmentation.augment`."""
        self._grow(augment(self.values, uniforms, width, height))

    def _grow(self, values: F4) -> None:
        """Take values that new rows follow."""
        new = len(values) - len(self)
        self.values = values
        self.origins = np.concatenate([self.origins, np.full(new, NEW, np.int64)])
        self.frozen = np.concatenate([self.frozen, np.zeros(new, np.bool_)])
        self.optimizer = self.optimizer.append(new)

    def take(self, indices: NDArray[np.int64]) -> None:
        """Keep the splats of these indices, in this order, with their optimiser state."""
        kept = compact(indices, self.values, *self.optimizer.state)
        self.values, self.optimizer = kept.values, self.optimizer.with_state(*kept[1:])
        self.origins, self.frozen = self.origins[indices], self.frozen[indices]


def fit(
    population: Population,
    objective: Objective,
    settings: FitSettings,
    rng: np.random.Generator,
    *,
    total: int | None = None,
    on_iteration: OnIteration | None = None,
) -> tuple[float, int]:
    """Minimise the loss of one frame over the parameters of a population, which is changed in place.

    Parameters
    ----------
    population
        The splats to begin with.
    objective
        The frame's picture.
    settings
        How to fit.
    rng
        Draws the splats that growth adds.
    total
        The number of splats that growth leads to; needed when `settings.growth` is set.
    on_iteration
        Called after each iteration.

    Returns
    -------
    The loss (paper, the L2 equation) of the parameters at the end, and the number of iterations made.
    """
    height, width = objective.height, objective.width
    unit = learned_unit(settings.learn_pixels, width, height)
    rates = settings.rates.columns()
    grown = settings.growth.counts(total or len(population), settings.iterations) if settings.growth else {}
    splats = max(len(population), *grown.values()) if grown else len(population)
    removed = settings.pruning.counts(splats, settings.iterations) if settings.pruning else {}
    last_change = max([*removed, *(i + 1 for i in grown)], default=0)  # no convergence before it
    convergence = settings.convergence.start() if settings.convergence else None
    objective.freeze(population.parameters(), population.frozen)
    done = 0
    for i in range(settings.iterations):
        loss, gradient = loss_and_gradients(population, objective)
        missing = grown.get(i, 0) - sum(count for at, count in removed.items() if at <= i) - len(population)
        if missing > 0:
            population.append(new_splats(objective, missing, len(population) + missing, rng), 1.0)
            objective.freeze(population.parameters(), population.frozen)
            loss, gradient = loss_and_gradients(population, objective)
        factor = step_factors(population.values) if settings.relative_steps else None
        learned = rates if settings.pruning else np.append(rates[:-1], np.float32(0))
        population.optimizer.step(
            population.values, gradient, learned * settings.schedule(i), units=unit, row_factors=factor,
            row_columns=GEOMETRY,
        )  # fmt: skip
        keep_factors(population.values)
        done = i + 1
        if done in removed:
            population.take(prune(population.weights, removed[done]))
            objective.freeze(population.parameters(), population.frozen)
        if on_iteration:
            on_iteration(done, settings.iterations, loss)
        if convergence and convergence.update(loss) and done >= last_change:
            break
    objective.thaw()
    return objective.loss(population.parameters()), done


def learned_unit(learn_pixels: bool, width: int, height: int) -> F4:
    """Pixels per learned unit of each column, (9,) f4."""
    unit = np.ones(PARAMETERS_PER_SPLAT + 1, np.float32)
    if not learn_pixels:
        unit[0], unit[1] = width / 2, height / 2
    return unit


def loss_and_gradients(population: Population, objective: Objective) -> tuple[float, F4]:
    """The loss, and its gradient by all nine columns, (N, 9) f4, by the chain rule through w c'."""
    loss, gradient = objective.evaluate(population.parameters())
    return loss, weighted_gradients(population.values, gradient)


def step_factors(values: F4) -> F4:
    """The factor of each splat's position and Cholesky steps: half its mean radius within STEP_SIZES, (N,) f4."""
    radius = np.sqrt(np.maximum(values[:, 2] * values[:, 4], 0))
    return np.asarray(np.clip(radius / 2, *STEP_SIZES), np.float32)


def keep_factors(values: F4) -> None:
    """Put l11 and l22 back to at least MIN_FACTOR, in place."""
    np.maximum(values[:, 2], MIN_FACTOR, out=values[:, 2])
    np.maximum(values[:, 4], MIN_FACTOR, out=values[:, 4])


def new_splats(
    objective: Objective, count: int, total: int, rng: np.random.Generator, where: NDArray[np.bool_] | None = None
) -> Splats:
    """Splats where the last evaluated picture differs most from the target, sized for `total` splats in all.

    `where` is (H, W) bool, the pixels to look at; None: all.
    """
    size = NEW_SIZE * math.sqrt(objective.width * objective.height / total)
    missing = -objective.residual()
    return residual_splats(missing if where is None else missing * where[..., None], count, size, rng)
