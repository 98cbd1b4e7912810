"""How long profile `main` searches for a frame, and what it weighs: settings of I- and of P-frames."""

from dataclasses import dataclass, field, fields

from gsvc_base.checks import check_types
from gsvc_base.errors import UsageError
from gsvc_ref.main.codes import SIDES
from gsvc_ref.training.settings import Growth


@dataclass(frozen=True)
class IntraSettings:
    """How long an I-frame is searched for; shares are in 0..1."""

    initialization: int = 100
    """Evaluations while splats are added, beside one for each addition, and until they have found their places."""
    refinement: int = 80
    """Evaluations after that, with the term of the bits."""
    growth: Growth = field(default_factory=lambda: Growth(end=0.45))
    """How splats come in the first of these."""
    surplus: float = 1.2
    """Splats of the fit for each splat that is asked for."""
    moves: tuple[float, ...] = ()
    """At which parts of the refinement the weakest splats move to where the picture is worst."""
    moved_share: float = 0.04
    """How many of them move each time, at least, as a share of all."""
    removals: tuple[float, ...] = (0.6, 0.8, 0.95)
    """At which parts of it splats go whose energy is below `least_energy`; they do at its end as well."""
    least_energy: float = 1.5
    """In D."""
    parts: tuple[float, ...] = (0.3, 0.25, 0.2, 0.15, 0.1)
    """The shares of the splats that are rounded one after the other."""
    rounding: int = 8
    """Evaluations before the first part is rounded and after each but the last."""

    def __post_init__(self) -> None:
        check_types(self)
        positive = self.initialization >= 1 and self.rounding >= 1 and self.surplus >= 1
        if not positive or self.refinement < 0 or not self.parts:
            raise UsageError(
                f"{self}: initialization, rounding and surplus must be at least 1, refinement 0, and parts be given"
            )
        if not all(0 <= share <= 1 for share in (*self.parts, *self.moves, *self.removals, self.moved_share)):
            raise UsageError(f"{self}: parts, moves, removals and moved_share must be shares, in 0..1")

    def fitted_splats(self, splats: int) -> int:
        """How many splats are fitted where so many are asked for."""
        return max(1, round(self.surplus * splats))

    @property
    def evaluations(self) -> int:
        """How many evaluations an I-frame takes, about."""
        return self.initialization + self.refinement + self.rounding * len(self.parts)

    @classmethod
    def quick(cls) -> "IntraSettings":
        """As fast as the I-frames of profile `paper`."""
        return cls()

    @classmethod
    def slow(cls) -> "IntraSettings":
        """Five times the time of `quick`, for about a tenth fewer bits."""
        return cls(initialization=300, refinement=700, rounding=25, moves=(0.1, 0.2, 0.3, 0.4, 0.5))


@dataclass(frozen=True)
class InterSettings:
    """How a P-frame is encoded; the defaults are preset `slow`."""

    cells: tuple[int, ...] = (64, 32, 16)
    """The sides of the motion field's cells to choose from, in pixels, from large to small."""
    motion_steps: int = 4
    """Gauss-Newton steps for each of them."""
    motion_rounds: int = 6
    """How often the vectors of each are chosen by error and bits."""
    motion_price: float = 1.2
    """Squared error that a bit of the field is worth, in D^2."""
    cell_gain: float = 2.4
    """Bits that a splat is worth each time that the squared error halves, when cells are compared."""
    iterations: int = 80
    rounded_iterations: int = 30
    """Of the proximal descent and of the descent with rounding."""
    progress: float = 0.01
    """Proximal descent goes on as long as LOOK iterations take this share off the squared error. Splats that overlap
    need more of them: on 6 frames of `bikes`, 256x176, 108 in place of 50 gave 1.4 dB and took 10 % off the bits."""
    length: float = 0.5
    """The step of a splat is this over its crowding, within LEAST_LENGTH and MOST_LENGTH."""
    momentum: float = 0.95
    """Of the proximal descent."""
    sparsity: float = 0.4
    """Weight of the L1 term."""
    price: float = 0.9
    """What a group costs, in 2 D^2."""
    new_gain: float = 9.0
    """A new splat must promise to take more than this off the squared error, in D^2."""
    new_energy: float = 4.5
    """New splats with an energy below this many D are dropped."""
    worth: float = 1.0
    """A splat is removed where the squared error does not rise by this many D^2 without it."""
    new_share: float = 0.1
    """Most new splats of a frame, as a share of the clip's number."""
    fall: float = 1.5
    """Constant rate: D becomes finer once a P-frame has so many dB less than the first one after its I-frame. What is
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
    def quick(cls) -> "InterSettings":
        """About as long for a frame as preset `quick` of profile `paper`."""
        return cls(motion_steps=3, motion_rounds=4, iterations=30, rounded_iterations=12, progress=0.02)

    @classmethod
    def slow(cls) -> "InterSettings":
        """About one and a half times as long."""
        return cls()
