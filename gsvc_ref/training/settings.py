"""The settings of training: how splats are fitted and fine-tuned, and how they are quantised meanwhile."""

import math
from dataclasses import dataclass, field, replace
from typing import Any, Final, Self

import numpy as np

from gsvc_base.arrays import F4
from gsvc_base.checks import check_types
from gsvc_base.errors import UsageError
from gsvc_ref.paper import RvqSettings
from gsvc_ref.training.adan import AdanSettings
from gsvc_ref.training.convergence import Convergence
from gsvc_ref.training.pruning import PruningSchedule
from gsvc_ref.training.schedule import PAPER_SCHEDULE, Cosine, Schedule

MAX_RATE: Final = 1e6
"""Largest learning rate: far beyond any use, and finite in binary32 after every factor on it."""

MAX_THRESHOLD: Final = 1e6
"""Largest `static_threshold`."""

MAX_ITERATIONS: Final = 10_000_000
"""Maximum number of iterations of one fit; the paper has 50,000."""


@dataclass(frozen=True)
class Rates:
    """Learning rates of the attributes in learned units (`FitSettings.learn_pixels`); the paper has 1e-3 for all."""

    position: float = 1e-3
    cholesky: float = 1e-3
    color: float = 1e-3
    weight: float = 1e-3

    def __post_init__(self) -> None:
        check_types(self)
        if not all(0 <= rate <= MAX_RATE for rate in (self.position, self.cholesky, self.color, self.weight)):
            raise UsageError(f"learning rates must be in 0..{MAX_RATE:g}; they are {self}")

    def columns(self) -> F4:
        """The rate of each of the nine columns of `Population.values`, (9,) f4."""
        return np.array([self.position] * 2 + [self.cholesky] * 3 + [self.color] * 3 + [self.weight], np.float32)


@dataclass(frozen=True)
class FitSettings:
    """How a frame is fitted or fine-tuned; the defaults are the paper's for the fit of an I-frame."""

    iterations: int = 50_000
    rates: Rates = Rates()
    schedule: Schedule = PAPER_SCHEDULE
    optimizer: AdanSettings = field(default_factory=AdanSettings)
    # Learn positions in pixels. False learns them normalised to -1..1, so that a rate means the same fraction of any
    # frame, as in the authors' code.
    learn_pixels: bool = False
    # Multiply the steps of positions and Cholesky factors by half the splat's mean radius, within STEP_SIZES
    relative_steps: bool = False
    convergence: Convergence | None = field(default_factory=Convergence)  # when to stop early
    # When GSP removes how many splats, which also makes the weights w learnable; None: neither
    pruning: PruningSchedule | None = field(default_factory=PruningSchedule.intra)

    def __post_init__(self) -> None:
        check_types(self)
        if not 0 <= self.iterations <= MAX_ITERATIONS:
            raise UsageError(f"iterations is {self.iterations}; it must be in 0..{MAX_ITERATIONS}")

    def with_(self, **changes: Any) -> Self:
        """A copy with other fields by name; over other `iterations` a cosine that is not replaced is stretched."""
        if "iterations" in changes and isinstance(self.schedule, Cosine):
            changes.setdefault("schedule", replace(self.schedule, steps=changes["iterations"]))
        return replace(self, **changes)

    def pruning_of(self, fraction: float) -> Self:
        """A copy whose pruning removes this fraction of the splats."""
        assert self.pruning is not None
        return replace(self, pruning=replace(self.pruning, fraction=fraction))


@dataclass(frozen=True)
class BlockSettings:
    """The quantisers of a block; the defaults are those of the paper and, where it is silent, of its public code."""

    # Positions are rounded to multiples of a power of two, at most this many pixels, before binary16, so that their low
    # bits cost nothing; None keeps all bits of binary16
    position_step: float | None = None
    cholesky_bits: int = 6  # b
    # A fixed scale in pixels around an exact zero, for differences; None learns scale and offset
    cholesky_step: float | None = None
    colors: RvqSettings = field(default_factory=RvqSettings)
    # Let a colour count by the square root of its splat's area, since a large splat shows its error on more pixels
    weigh_by_area: bool = False
    commitment: float = 1.0  # weight of its loss
    # Learning rate of scale (as a fraction of itself) and offset (as a fraction of the scale)
    quantizer_rate: float = 1e-3
    # P-frames: an attribute of a splat whose change alters the picture by less than this fraction of a splat's mean
    # share of the squared error is left as it is in the reference; 0 codes every change, as in the paper
    static_threshold: float = 0.0
    # Begin with the scale and offset of Cholesky factors by which the picture changes least (`shape_weights`), not the
    # factors themselves: one long needle then does not make the steps of all splats coarse
    weigh_factors: bool = False

    def __post_init__(self) -> None:
        check_types(self)
        if not 1 <= self.cholesky_bits <= 12:
            raise UsageError(f"cholesky_bits is {self.cholesky_bits}; it must be 1..12")
        steps = (self.position_step, self.cholesky_step)
        if any(step is not None and not 0 < step < math.inf for step in steps):
            raise UsageError(f"position_step and cholesky_step are {steps}; they must be None or above 0 pixels")
        if not (0 <= self.commitment < math.inf and 0 <= self.quantizer_rate < 1):
            raise UsageError(f"{self}: commitment must be at least 0 and quantizer_rate in [0, 1)")
        if not 0 <= self.static_threshold <= MAX_THRESHOLD:
            raise UsageError(f"static_threshold is {self.static_threshold}; it must be in 0..1e6")
        if len(self.colors.codewords) > 8:
            raise UsageError(f"color_stages is {len(self.colors.codewords)}; it must be 1..8")
        if max(self.colors.codewords) > 1024:
            raise UsageError(f"color_codewords is {max(self.colors.codewords)}; it must be 1..1024")

    def with_(self, **changes: Any) -> Self:
        """A copy with other fields by name, or with `color_stages` stages of `color_codewords` codewords each.

        If only one of these two is given, the other stays that of the first stage.
        """
        if "color_stages" in changes or "color_codewords" in changes:
            colors = changes.get("colors", self.colors)
            stages = changes.pop("color_stages", len(colors.codewords))
            codewords = changes.pop("color_codewords", colors.codewords[0])
            changes["colors"] = replace(colors, codewords=(codewords,) * stages)
        return replace(self, **changes)
