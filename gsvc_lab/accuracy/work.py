"""Work that is timed: rendering, coding and training with one setting, and how good its outcome is."""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from io import BytesIO
from typing import Any, Final, Literal, Protocol

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.splats import Splats
from gsvc_lab.accuracy.cutoff import cut_sum
from gsvc_lab.accuracy.measure import Errors
from gsvc_ref.bitstream import LEVELS, SequenceHeader
from gsvc_ref.encoder.initialization import Growth, image_start, residual_splats
from gsvc_ref.encoder.main.edges import NEW_SIZE
from gsvc_ref.encoder.settings import PIXELS_PER_SPLAT, PaperSettings
from gsvc_ref.paper import FrameCodes, State
from gsvc_ref.rendering import Objective, Precision, render_sum
from gsvc_ref.stream import StreamWriter
from gsvc_ref.training import (
    KEPT_WEIGHT,
    NEW,
    NEW_WEIGHT,
    AdanSettings,
    Cosine,
    FitSettings,
    FrameQuantizer,
    OnIteration,
    Population,
    Rates,
    Schedule,
    fine_tune,
    fit,
    random_splats,
    uniform_numbers,
)

QUICK_FIT: Final = FitSettings(
    iterations=150, rates=Rates(1.0, 0.5, 0.05, 0.05), schedule=Cosine(steps=150, final=0.02),
    optimizer=AdanSettings(beta1=0.9, beta2=0.92, beta3=0.99), learn_pixels=True, relative_steps=True,
    convergence=None, pruning=None,
)  # fmt: skip
"""Adan with few and well-sized steps, in which splats are added: what preset quick was before it took L-BFGS."""

GROWTH: Final = Growth()

QUICK_TUNE: Final = QUICK_FIT.with_(iterations=60, rates=Rates(0.1, 0.05, 0.01), schedule=Cosine(steps=60, final=0.05))
"""Its fine-tuning, by any quantisers."""

ASSESSED_WITH: Final[Precision] = "deterministic"
"""Precision that renders what was coded or trained: 1e-4 of a step from the exact sum, the same on every machine."""


@dataclass(frozen=True)
class Quality:
    """The quality of an outcome."""

    errors: Errors  # errors against the reference of the group
    source_psnr: float  # PSNR in dB against the source
    bytes: int | None = None  # size of the coded frame, or None


class SourcePicture:
    """A picture, its splats as the preset quick fits them, and their exact pictures, each made when it is first used.

    `on_iteration`: called while the splats are fitted.
    """

    def __init__(self, picture: F4, on_iteration: OnIteration | None = None) -> None:
        self.picture = picture  # (H, W, 3) f4
        self.height, self.width = picture.shape[:2]
        self._on_iteration = on_iteration
        self._objectives: dict[Precision, Objective] = {}

    def objective(self, precision: Precision = "fast") -> Objective:
        """The loss against the picture."""
        if precision not in self._objectives:
            self._objectives[precision] = Objective(self.picture, precision=precision)
        return self._objectives[precision]

    @cached_property
    def population(self) -> Population:
        """The fitted splats, as training has them."""
        return Training().fitted(self, 0, self._on_iteration)

    @cached_property
    def splats(self) -> Splats:
        """The fitted splats."""
        return self.population.splats()

    @cached_property
    def exact(self) -> F8:
        """Their exact sum, (H, W, 3) f8, not clamped."""
        return np.asarray(render_sum(self.splats, self.width, self.height, precision="exact"), np.float64)

    @cached_property
    def uncut(self) -> F8:
        """Their exact sum without a cut-off, (H, W, 3) f8."""
        return cut_sum(self.splats, self.width, self.height, 0)

    def source_psnr(self, picture: Any) -> float:
        """PSNR in dB of a sum (H, W, 3), clamped but not rounded, against the picture."""
        return Errors.between(np.clip(picture, 0, 1), self.picture).psnr


class Work(Protocol):
    """Work with one setting."""

    def run(self, picture: SourcePicture, seed: int) -> Any:
        """Do what is timed."""
        ...

    def assess(self, picture: SourcePicture, outcome: Any) -> Quality:
        """Return how good the outcome of `run` is."""
        ...


@dataclass(frozen=True)
class Rendering:
    """Render with the codec's renderer; the error is that against the exact sum."""

    precision: Precision = "fast"
    threads: int = 1

    def run(self, picture: SourcePicture, seed: int) -> Any:
        """Return the sum (H, W, 3)."""
        size = picture.width, picture.height
        return render_sum(picture.splats, *size, precision=self.precision, threads=self.threads)

    def assess(self, picture: SourcePicture, outcome: Any) -> Quality:
        """Compare with the exact sum."""
        return Quality(Errors.between(outcome, picture.exact), picture.source_psnr(outcome))


@dataclass(frozen=True)
class CutOff:
    """Sum by the definition in binary64 with another support; the error is that against the sum without a cut-off."""

    cutoff: float

    def run(self, picture: SourcePicture, seed: int) -> Any:
        """Return the sum (H, W, 3) f8."""
        return cut_sum(picture.splats, picture.width, picture.height, self.cutoff)

    def assess(self, picture: SourcePicture, outcome: Any) -> Quality:
        """Compare with the exact sum without a cut-off."""
        return Quality(Errors.between(outcome, picture.uncut), picture.source_psnr(outcome))


@dataclass(frozen=True)
class Coding:
    """Quantise the fitted splats, fine-tune them and code them as an I-frame, as preset quick once did (QUICK_TUNE)."""

    # Positions are multiples of 2^(1 - position_bits) of half the frame's longer side; None keeps binary16
    position_bits: int | None = None
    cholesky_bits: int = 8  # bits b of a Cholesky factor
    stages: int = 3  # stages, codewords: M and B of the colours
    codewords: int = 16

    def settings(self, width: int, height: int) -> PaperSettings:
        """The preset quick with these settings instead of its own."""
        settings = PaperSettings.quick(cholesky_bits=self.cholesky_bits)
        step = None if self.position_bits is None else max(width, height) / 2 * 2.0 ** (1 - self.position_bits)
        block = settings.intra.quantizer.with_(
            position_step=step, color_stages=self.stages, color_codewords=self.codewords
        )
        return settings.with_(intra=settings.intra.with_(quantizer=block))

    def run(self, picture: SourcePicture, seed: int) -> tuple[FrameCodes, State, int]:
        """Return the codes, the state of a decoder after them, and the bytes of the frame."""
        settings, before = self.settings(picture.width, picture.height), State.initial(picture.width, picture.height)
        rng = np.random.default_rng(seed)
        blocks = settings.intra.quantizer, settings.inter.quantizer
        quantizer = FrameQuantizer(picture.population, picture.objective(), *blocks, before, rng)
        values = picture.population.parameters()
        codes, state, _ = fine_tune(values, quantizer, picture.objective(), QUICK_TUNE)
        elements = settings.quantizer_elements()
        header = SequenceHeader(level=max(LEVELS), width=before.width, height=before.height, **elements)
        return codes, state, StreamWriter(BytesIO(), header).write_frame(codes).size

    def assess(self, picture: SourcePicture, outcome: tuple[FrameCodes, State, int]) -> Quality:
        """Compare with the exact picture of the splats before they were coded, both clamped."""
        decoded = render_sum(outcome[1].splats, picture.width, picture.height, precision=ASSESSED_WITH)
        errors = Errors.between(np.clip(decoded, 0, 1), np.clip(picture.exact, 0, 1))
        return Quality(errors, picture.source_psnr(decoded), outcome[2])


@dataclass(frozen=True)
class _Later:
    """A schedule from an iteration on."""

    schedule: Schedule
    begin: int

    def __call__(self, iteration: int) -> float:
        """The factor of an iteration."""
        return self.schedule(self.begin + iteration)


@dataclass(frozen=True)
class Training:
    """Fit splats to the picture; the defaults are those that preset quick once had for an I-frame (QUICK_FIT)."""

    pixels_per_splat: int = PIXELS_PER_SPLAT  # number of pixels for each splat
    # ``image``, or ``random`` as in the paper, with its weight w folded into the colours
    start: Literal["image", "random"] = "image"
    fit: FitSettings = field(default=QUICK_FIT)  # settings of the fit
    growth: Growth | None = GROWTH  # begin with few splats, and add the others where the residual is; None: all at once
    precision: Precision = "fast"  # precision of the loss and its gradient: ``fast`` or ``deterministic``

    def fitted(self, picture: SourcePicture, seed: int, on_iteration: OnIteration | None = None) -> Population:
        """The splats at the end."""
        rng = np.random.default_rng([seed, 0])
        total = max(1, picture.width * picture.height // self.pixels_per_splat)
        count = self.growth.start(total) if self.growth else total
        if self.start == "image":
            splats = image_start(picture.picture, count, rng)
        else:
            drawn = random_splats(uniform_numbers(count, rng), picture.width, picture.height)
            splats = Splats(drawn.positions, drawn.cholesky, drawn.colors * np.float32(NEW_WEIGHT))
        population = Population(splats, KEPT_WEIGHT, np.full(count, NEW, np.int64), self.fit.optimizer)
        objective, done = picture.objective(self.precision), 0
        for iteration, splats_then in (self.growth.counts(total, self.fit.iterations) if self.growth else {}).items():
            self._fit(population, objective, done, iteration, on_iteration)
            objective.loss(population.parameters())
            added, done = splats_then - len(population), iteration
            size = NEW_SIZE * math.sqrt(objective.width * objective.height / splats_then)
            population.append(residual_splats(-objective.residual(), added, size, rng), KEPT_WEIGHT)
        self._fit(population, objective, done, self.fit.iterations, on_iteration)
        return population

    def _fit(
        self, population: Population, objective: Objective, begin: int, end: int, on_iteration: OnIteration | None
    ) -> None:
        """The iterations from `begin` to `end` of the whole fit."""
        settings = replace(self.fit, iterations=end - begin, schedule=_Later(self.fit.schedule, begin))
        fit(population, objective, settings, on_iteration)

    def run(self, picture: SourcePicture, seed: int) -> Population:
        """Start and fit."""
        return self.fitted(picture, seed)

    def assess(self, picture: SourcePicture, outcome: Population) -> Quality:
        """Compare with the source, clamped."""
        rendered = render_sum(outcome.splats(), picture.width, picture.height, precision=ASSESSED_WITH)
        errors = Errors.between(np.clip(rendered, 0, 1), picture.picture)
        return Quality(errors, errors.psnr)
