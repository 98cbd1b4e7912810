"""How long profile `main` searches for a frame: settings of I- and of P-frames, whose defaults are preset `quick`."""

from dataclasses import dataclass, fields

from gsvc_base.checks import check_types
from gsvc_base.errors import UsageError
from gsvc_ref.main.codes import SIDES


@dataclass(frozen=True)
class IntraSettings:
    """How long an I-frame is searched for: its stages are counted in evaluations."""

    initialization: int = 100
    """Evaluations while splats are added, beside one for each addition, and until they have found their places."""
    refinement: int = 80
    """Evaluations after that, with the term of the bits."""
    rounding: int = 8
    """Evaluations before the first part of the splats is rounded and after each but the last."""
    moves: tuple[float, ...] = ()
    """At which shares of the refinement, in 0..1, the weakest splats move to where the picture is worst."""

    def __post_init__(self) -> None:
        check_types(self)
        if self.initialization < 1 or self.rounding < 1 or self.refinement < 0:
            raise UsageError(f"{self}: initialization and rounding must be at least 1, and refinement 0")
        if not all(0 <= share <= 1 for share in self.moves):
            raise UsageError(f"{self}: moves must be shares, in 0..1")

    @classmethod
    def slow(cls) -> "IntraSettings":
        """Five times the time of `quick`, for about a tenth fewer bits."""
        return cls(initialization=300, refinement=700, rounding=25, moves=(0.1, 0.2, 0.3, 0.4, 0.5))


@dataclass(frozen=True)
class InterSettings:
    """How a P-frame is encoded."""

    cells: tuple[int, ...] = (64, 32, 16)
    """The sides of the motion field's cells to choose from, in pixels, from large to small."""
    motion_steps: int = 3
    """Gauss-Newton steps for each of them."""
    motion_rounds: int = 4
    """How often the vectors of each are chosen by error and bits."""
    cell_gain: float = 2.4
    """Bits that a splat is worth each time that the squared error halves, when cells are compared."""
    iterations: int = 30
    """Of the proximal descent, at least."""
    rounded_iterations: int = 12
    """Of the descent with rounding."""
    progress: float = 0.02
    """Proximal descent goes on as long as LOOK iterations take this share off the squared error. Splats that overlap
    need more of them: on 6 frames of `bikes`, 256x176, 108 in place of 50 gave 1.4 dB and took 10 % off the bits."""
    new_share: float = 0.1
    """Most new splats of a frame, as a share of those of an I-frame."""
    fall: float = 1.5
    """Constant rate: D becomes finer once a P-frame has this many dB less than the first one after its I-frame. What is
    not worth its bits adds up: without this, the last third of the 22 frames before the demo clip's cut was 2.1 dB
    below the first. 200 leaves D as it is."""

    def __post_init__(self) -> None:
        check_types(self)
        sides = all(cell in SIDES[1:] for cell in self.cells) and tuple(sorted(self.cells, reverse=True)) == self.cells
        numbers = [getattr(self, field.name) for field in fields(self) if field.name != "cells"]
        if not sides or min(numbers) < 0 or min(self.motion_rounds, self.iterations, self.rounded_iterations) < 1:
            raise UsageError(
                f"{self}: cells must be of 64, 32 and 16 in this order, the others at least 0, and motion_rounds, "
                "iterations and rounded_iterations at least 1"
            )

    @property
    def evaluations(self) -> int:
        """How many evaluations a P-frame takes at least, beside those of the field."""
        return self.iterations + self.rounded_iterations

    @classmethod
    def slow(cls) -> "InterSettings":
        """About one and a half times the time of `quick` for a frame."""
        return cls(motion_steps=4, motion_rounds=6, iterations=80, rounded_iterations=30, progress=0.01)
