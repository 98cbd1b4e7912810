"""What a rung can choose: a renderer, a quantiser or a way of training, each with what it does and how it is judged."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final, Literal, Protocol

import numpy as np

from gsvc_lab.accuracy.measure import Errors
from gsvc_lab.accuracy.oracle import F8, NOTHING_SIGMA, cut_sum
from gsvc_lab.accuracy.variants import Variant, render_variant
from gsvc_ref.encoder.quantizer_choice import frame_bytes
from gsvc_ref.encoder.settings import PIXELS_PER_SPLAT, Settings
from gsvc_ref.reconstruction import FrameCodes, State
from gsvc_ref.rendering import Objective, Precision, render_sum
from gsvc_ref.splats import F4, Splats
from gsvc_ref.training import (
    KEPT_WEIGHT,
    NEW,
    NEW_WEIGHT,
    FitSettings,
    FrameQuantizer,
    OnIteration,
    Population,
    fine_tune,
    fit,
    image_start,
    random_splats,
    uniform_numbers,
)

QUICK_FIT: Final[FitSettings] = Settings.quick().intra.fit

CHECK: Final = Variant(degree=9, bits=64)
"""Judges what is coded and trained: within 1e-11 of a step of the exact sum, and fifty times as fast."""


@dataclass(frozen=True)
class Judgement:
    """What came of a run: errors against the group's reference, PSNR in dB against the source, and bytes if coded."""

    errors: Errors
    source_psnr: float
    bytes: int | None = None


class Subject:
    """A picture, and what all rungs share: its splats as the preset quick fits them, and their exact pictures.

    Parameters
    ----------
    picture
        (H, W, 3) f4.
    on_iteration
        Called while the splats are fitted.
    """

    def __init__(self, picture: F4, on_iteration: OnIteration | None = None) -> None:
        self.picture = picture
        self.height, self.width = picture.shape[:2]
        self._on_iteration = on_iteration

    @cached_property
    def objective(self) -> Objective:
        """The loss against the picture."""
        return Objective(self.picture)

    @cached_property
    def population(self) -> Population:
        """The fitted splats."""
        return Training().fitted(self, 0, self._on_iteration)

    @cached_property
    def splats(self) -> Splats:
        """The fitted splats."""
        return self.population.splats()

    @cached_property
    def exact(self) -> F8:
        """Their exact sum, (H, W, 3) f8, not clamped."""
        return cut_sum(self.splats, self.width, self.height)

    @cached_property
    def uncut(self) -> F8:
        """Their exact sum without a cut-off, (H, W, 3) f8."""
        return cut_sum(self.splats, self.width, self.height, NOTHING_SIGMA)

    def source_psnr(self, picture: Any) -> float:
        """PSNR in dB of a sum (H, W, 3), clamped but not rounded, against the picture."""
        return Errors.between(np.clip(picture, 0, 1), self.picture).psnr


class Choice(Protocol):
    """One rung's choice."""

    def run(self, subject: Subject, seed: int) -> Any:
        """The work that is timed."""
        ...

    def judge(self, subject: Subject, outcome: Any) -> Judgement:
        """How good the outcome of the work is."""
        ...


@dataclass(frozen=True)
class Reference:
    """Render with the package's own renderer at one of its precisions."""

    precision: Precision

    def run(self, subject: Subject, seed: int) -> Any:
        """The sum, on one thread."""
        return render_sum(subject.splats, subject.width, subject.height, precision=self.precision, threads=1)

    def judge(self, subject: Subject, outcome: Any) -> Judgement:
        """Against the exact sum."""
        return Judgement(Errors.between(outcome, subject.exact), subject.source_psnr(outcome))


@dataclass(frozen=True)
class Rendering:
    """Render with a variant; `uncut` judges against the sum without a cut-off."""

    variant: Variant
    uncut: bool = False

    def run(self, subject: Subject, seed: int) -> Any:
        """The sum, on one thread."""
        return render_variant(subject.splats, subject.width, subject.height, self.variant)

    def judge(self, subject: Subject, outcome: Any) -> Judgement:
        """Against the exact sum."""
        reference = subject.uncut if self.uncut else subject.exact
        return Judgement(Errors.between(outcome, reference), subject.source_psnr(outcome))


@dataclass(frozen=True)
class Coding:
    """Quantise the fitted splats, fine-tune them and code them as an I-frame, as the preset quick does.

    Attributes
    ----------
    position_bits
        Positions are multiples of 2^(1 - position_bits) of half the frame's longer side; None keeps binary16.
    cholesky_bits
        b.
    stages, codewords
        M and B of the colours.
    """

    position_bits: int | None = None
    cholesky_bits: int = 8
    stages: int = 3
    codewords: int = 16

    def settings(self, width: int, height: int) -> Settings:
        """The preset quick with these choices instead of its own."""
        settings = Settings.quick(cholesky_bits=self.cholesky_bits)
        step = None if self.position_bits is None else max(width, height) / 2 * 2.0 ** (1 - self.position_bits)
        block = settings.intra.quantizer.with_(
            position_step=step, color_stages=self.stages, color_codewords=self.codewords
        )
        return settings.with_(intra=settings.intra.with_(quantizer=block))

    def run(self, subject: Subject, seed: int) -> tuple[FrameCodes, State, int]:
        """Codes, what a decoder has, and the bytes of the frame."""
        settings, before = self.settings(subject.width, subject.height), State.initial(subject.width, subject.height)
        rng = np.random.default_rng(seed)
        blocks = settings.intra.quantizer, settings.inter.quantizer
        quantizer = FrameQuantizer(subject.population, subject.objective, *blocks, before, rng)
        values = subject.population.parameters()
        codes, state, _ = fine_tune(values, quantizer, subject.objective, settings.intra.tune)
        return codes, state, frame_bytes(codes, settings, before)

    def judge(self, subject: Subject, outcome: tuple[FrameCodes, State, int]) -> Judgement:
        """Against the exact picture of the splats before they were coded, both clamped."""
        decoded = render_variant(outcome[1].splats, subject.width, subject.height, CHECK)
        errors = Errors.between(np.clip(decoded, 0, 1), np.clip(subject.exact, 0, 1))
        return Judgement(errors, subject.source_psnr(decoded), outcome[2])


@dataclass(frozen=True)
class Training:
    """Fit splats to the picture; the defaults are those of the preset quick for an I-frame.

    Attributes
    ----------
    pixels_per_splat
        One splat for so many pixels.
    start
        ``image``, or ``random`` as in the paper, with its weight w folded into the colours.
    fit
        How they are fitted.
    """

    pixels_per_splat: int = PIXELS_PER_SPLAT
    start: Literal["image", "random"] = "image"
    fit: FitSettings = field(default=QUICK_FIT)

    def fitted(self, subject: Subject, seed: int, on_iteration: OnIteration | None = None) -> Population:
        """The splats at the end."""
        rng = np.random.default_rng([seed, 0])
        total = max(1, subject.width * subject.height // self.pixels_per_splat)
        count = self.fit.growth.start(total) if self.fit.growth else total
        if self.start == "image":
            splats = image_start(subject.picture, count, rng)
        else:
            drawn = random_splats(uniform_numbers(count, rng), subject.width, subject.height)
            splats = Splats(drawn.positions, drawn.cholesky, drawn.colors * np.float32(NEW_WEIGHT))
        population = Population(splats, KEPT_WEIGHT, np.full(count, NEW, np.int64), self.fit)
        fit(population, subject.objective, self.fit, rng, total=total, on_iteration=on_iteration)
        return population

    def run(self, subject: Subject, seed: int) -> Population:
        """Start and fit."""
        return self.fitted(subject, seed)

    def judge(self, subject: Subject, outcome: Population) -> Judgement:
        """Against the source, clamped."""
        picture = render_variant(outcome.splats(), subject.width, subject.height, CHECK)
        errors = Errors.between(np.clip(picture, 0, 1), subject.picture)
        return Judgement(errors, errors.psnr)
