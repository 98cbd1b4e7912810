"""I-frames of profile `main`: from a picture to the codes of its splats.

Three stages share one metric (`coordinates`) and one optimiser (`descent`). `grow` adds splats where the picture is
worst. `weigh` goes on with a term for their bits, and removes the weakest. `settle` rounds them to codes part by part:
after each part the others, which are still free, make good for its rounding errors. Last, the densities of the codes
are chosen by their length.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator

from gsvc_ref._jit import kernel
from gsvc_ref.arrays import F4, F8, I8
from gsvc_ref.checks import check_types
from gsvc_ref.errors import UsageError
from gsvc_ref.main_encoder.density_choice import choose_densities
from gsvc_ref.main_encoder.rounding import MOST_SHEAR, Rounded, codes_of, rounded
from gsvc_ref.main_profile.cells import cell_order
from gsvc_ref.main_profile.codes import MainCodes
from gsvc_ref.main_profile.tables import QUANTIZERS, step_of
from gsvc_ref.portable import log10
from gsvc_ref.rendering import Objective, Precision
from gsvc_ref.training.augmentation import image_start
from gsvc_ref.training.coordinates import (
    HALF,
    gradient_by_coordinates,
    log_kernel,
    moved,
    to_coordinates,
    to_parameters,
)
from gsvc_ref.training.descent import LBFGS
from gsvc_ref.training.edges import Edges
from gsvc_ref.training.settings import Growth

LEAST_SIZE: Final = 0.27
"""Smallest l11 and l22 in pixels: a smaller splat can lie between all pixel centres."""
MOST_SIZE: Final = 400.0

RISE: Final = 1.01
"""L-BFGS goes back to its best point where the error is this many times as large."""

MEDIAN_ENERGY: Final = 7.0
"""Median energy of grown splats in D, `quantizer_for`; measured."""

GROWTH_QUANTIZER: Final = 16.0
"""D for the metric of growth, where it only bounds steps of the faintest splats."""

LAYER_COARSER: Final = 7
"""By how many steps of an eighth of an octave D of a layer is greater than `quantizer_for` its splats; measured.

What a base leaves of a picture is faint, and so are the splats fitted to it. The D that suits is about that of a whole
picture of the same quality: a layer of 300 splats on a base of 200 took 15.9 kbit in all for 33.2 dB with 4 more steps
than its own rule has, and 18.3 for 33.7 with none, where one layer takes 13.8 and 15.0.
"""

BITS_WEIGHT: Final = 1.5
"""W in the term of the bits, W D^2 / 2 ln(E^2 + D^2) of each splat.

Five codes of geometry and one or two of colour take log2 E bits each, and at a step D a bit is worth about 0.12 D^2.
"""

OnEvaluation = Callable[[float], None]
"""Called with the loss, as in `Objective`."""


@dataclass(frozen=True)
class IntraSettings:
    """How long an I-frame is searched for.

    Attributes
    ----------
    grow
        Evaluations while splats are added, beside one for each addition, and until they have found their places.
    weigh
        Evaluations after that, with the term of the bits.
    growth
        How splats come in the first of these.
    surplus
        Splats of the fit for each splat that is asked for.
    moves
        At which parts of the second the weakest splats move to where the picture is worst.
    moved_share
        How many of them move each time, at least, as a share of all.
    removals
        At which parts of the second splats go whose energy is below `least_energy` D; they do at its end as well.
    least_energy
        In D.
    parts
        The shares of the splats that are rounded one after the other.
    settle
        Evaluations before the first part is rounded and after each but the last.
    """

    grow: int = 100
    weigh: int = 80
    growth: Growth = field(default_factory=lambda: Growth(end=0.45))
    surplus: float = 1.2
    moves: tuple[float, ...] = ()
    moved_share: float = 0.04
    removals: tuple[float, ...] = (0.6, 0.8, 0.95)
    least_energy: float = 1.5
    parts: tuple[float, ...] = (0.3, 0.25, 0.2, 0.15, 0.1)
    settle: int = 8

    def __post_init__(self) -> None:
        check_types(self)
        if self.grow < 1 or self.weigh < 0 or self.settle < 1 or self.surplus < 1 or not self.parts:
            raise UsageError(f"{self}: grow and settle must be at least 1, weigh 0 and surplus 1, and parts be given")
        if not all(0 <= share <= 1 for share in (*self.parts, *self.moves, *self.removals, self.moved_share)):
            raise UsageError(f"{self}: parts, moves, removals and moved_share must be shares, in 0..1")

    @property
    def evaluations(self) -> int:
        """How many evaluations an I-frame takes, about."""
        return self.grow + self.weigh + self.settle * len(self.parts)

    @classmethod
    def quick(cls) -> "IntraSettings":
        """As fast as the I-frames of profile `paper`."""
        return cls()

    @classmethod
    def slow(cls) -> "IntraSettings":
        """Five times the time of `quick`, for about a tenth fewer bits."""
        return cls(grow=300, weigh=700, settle=25, moves=(0.1, 0.2, 0.3, 0.4, 0.5))


class IntraFrame(NamedTuple):
    """An I-frame to be written.

    Attributes
    ----------
    codes
        Its codes.
    state, parameters
        (N, 8) i8 and f4 in their order: what a decoder has.
    """

    codes: MainCodes
    state: I8
    parameters: F4


def encode_intra(
    picture: F4,
    splats: int,
    rng: Generator,
    quantizer: int | None = None,
    settings: IntraSettings | None = None,
    *,
    base: F4 | None = None,
    threads: int | None = None,
    precision: Precision = "fast",
    on_evaluation: OnEvaluation | None = None,
) -> IntraFrame:
    """The codes of an I-frame, or of a layer.

    Parameters
    ----------
    picture
        (H, W, 3) f4, R'G'B' with 1.0 = full scale.
    splats
        About how many splats there shall be, at least 1; the frame has at most `settings.surplus` times as many.
    rng
        Draws the places of splats, and which are rounded first.
    quantizer
        0..79, for D = 2^(quantizer / 8) / 2; None: `quantizer_for` chooses it.
    settings
        None: `IntraSettings.quick()`.
    base
        (B, 8) f4, the decoded splats of the layers below.
    threads, precision
        As in `Objective`; the result does not depend on the threads, and with ``deterministic`` not on the CPU.
    on_evaluation
        Called after each evaluation of splats.
    """
    settings = settings or IntraSettings.quick()
    target = Target(picture, base, threads, precision, on_evaluation)
    z = grow(target, max(1, round(settings.surplus * splats)), rng, settings)
    if quantizer is None:
        above = base is not None and len(base) > 0
        quantizer = min(quantizer_for(z) + (LAYER_COARSER if above else 0), QUANTIZERS - 1)
    step = step_of(quantizer)
    z = weigh(target, z, step / 16, rng, settings)
    return coded(settle(target, z, step, rng, settings), quantizer, target.width, target.height)


def quantizer_for(z: F8) -> int:
    """The quantiser that goes with splats that a fit of the error alone has found: the one rule for N and D.

    A bit is best spent either on a splat more or on finer steps of all. Both give the same where the median of the
    splats' energies E, before any is removed for its bits, is MEDIAN_ENERGY times D: then some 10 to 30 % of them turn
    out not to be worth their bits, whatever the picture and its quality. A finer D is waste on splats too few, a
    coarser one removes more of them. For a quality that is asked for, N is what is searched.

    Parameters
    ----------
    z
        (N, 8) f8, coordinates.

    Returns
    -------
    int
        0..79; the middle quantiser of no splats is 40.
    """
    if len(z) == 0:
        return 40
    median = math.sqrt(float(np.sort(_energies(z))[len(z) // 2]))
    steps = np.array([step_of(quantizer) for quantizer in range(QUANTIZERS)])
    return int(np.argmin(np.abs(steps - 16 * median / MEDIAN_ENERGY)))


def coded(result: Rounded, quantizer: int, width: int, height: int) -> IntraFrame:
    """Rounded splats in the order of cells, with the densities of their codes; splats without colour are left out."""
    result = result.take(np.flatnonzero((result.k != 0).any(axis=1)))
    result = result.take(cell_order(result.cell, width, height))
    codes = codes_of(result)
    densities = choose_densities(codes, step_of(quantizer), width, height) if len(codes) else None
    return IntraFrame(MainCodes(quantizer, type="I", densities=densities, new=codes), result.state, result.parameters)


class Target:
    """A picture to be described, with the squared error of splats in units of 8 bits.

    Parameters
    ----------
    picture
        (H, W, 3) f4.
    base
        (B, 8) f4, splats that are in every picture, such as those of a lower layer.
    threads, precision
        As in `Objective`.
    on_evaluation
        Called after each evaluation.
    """

    def __init__(
        self,
        picture: F4,
        base: F4 | None = None,
        threads: int | None = None,
        precision: Precision = "fast",
        on_evaluation: OnEvaluation | None = None,
    ) -> None:
        self._on_evaluation = on_evaluation
        self.height, self.width = picture.shape[:2]
        self._picture, self._objective = picture, Objective(picture, threads, precision=precision)
        self._edges = Edges(picture)
        self._scale = self.height * self.width * 255.0 * 255.0
        self._base = np.zeros((0, 8), np.float32) if base is None else base
        self.hold(self._base[:0])

    def start(self, count: int, rng: Generator) -> F8:
        """Coordinates (count, 8) of splats to begin with."""
        if len(self._base):
            self._objective.loss(self._base[:0])
            return self.new_splats(count, count + len(self._base), rng)
        return to_coordinates(image_start(self._picture, count, rng).to_array())

    def new_splats(self, count: int, total: int, rng: Generator) -> F8:
        """Coordinates (count, 8) of splats where the splats evaluated last, of `total`, leave the most."""
        return to_coordinates(self._edges.new_splats(-self._objective.residual(), count, total, rng))

    def hold(self, parameters: F4) -> None:
        """From now on splats (n, 8) f4 are in every picture, beside the base and those that are evaluated."""
        self._objective.hold(np.concatenate([self._base, parameters]))

    def evaluate(self, parameters: F4) -> tuple[float, F8]:
        """The squared error of splats (N, 8) f4, and its gradient (N, 8) f8 by (u, v, m, r, s, n0, n1, n2)."""
        loss, gradient = self._objective.evaluate(parameters)
        if self._on_evaluation:
            self._on_evaluation(loss)
        return loss * self._scale, gradient_by_coordinates(parameters, gradient * np.float32(self._scale))

    def psnr(self, parameters: F4) -> float:
        """The PSNR in dB of the picture of the base and splats (N, 8) f4."""
        self.hold(parameters)
        error = self._objective.loss(parameters[:0])
        return 10 * float(log10(3 / max(error, 1e-12)))


def grow(target: Target, total: int, rng: Generator, settings: IntraSettings) -> F8:
    """Coordinates (N, 8) of splats that are close to a picture, without rounding and whatever their bits.

    Parameters
    ----------
    target
        The picture.
    total
        How many splats there are in the end.
    rng, settings
        As in `encode_intra`.
    """
    z = target.start(settings.growth.start(total), rng)
    plan = settings.growth.counts(total, settings.grow)
    descent = LBFGS(len(z), GROWTH_QUANTIZER)
    best: tuple[float, F8, F8] | None = None  # the error, the coordinates, and the gradient there
    for i in range(settings.grow):
        keep_inside(z, target.width, target.height)
        error, gradient = target.evaluate(to_parameters(z))
        new = plan.get(i, 0) - len(z)
        if best is None or error < best[0]:
            best = error, z, gradient
        elif error > RISE * best[0] and new <= 0:
            error, z, gradient = best
            descent.restart()
        step = descent.step(z, error, gradient)
        if new > 0:
            descent.append(new)
            z = np.concatenate([z, target.new_splats(new, plan[i], rng)])
            error, gradient = target.evaluate(to_parameters(z))
            best = error, z, gradient
            step = descent.step(z, error, gradient)
        z = moved(z, step)
    return z if best is None else best[1]


def weigh(target: Target, z: F8, quantizer: float, rng: Generator, settings: IntraSettings) -> F8:
    """Coordinates (N, 8) after descent with the term of the bits, at a step D; the weakest splats move or go.

    Parameters
    ----------
    target
        The picture.
    z
        (N, 8) f8, `grow`.
    quantizer
        D, which says what a bit is worth.
    rng, settings
        As in `encode_intra`.
    """
    least = settings.least_energy * settings.least_energy * quantizer * quantizer
    done, descent = 0, LBFGS(len(z), quantizer)
    for part in sorted({*settings.moves, *settings.removals, 1.0}):
        stop = int(settings.weigh * part)
        z = _descended(target, z, descent, stop - done)
        done = stop
        weak = int(np.count_nonzero(_energies(z) <= least))
        moved_away = part in settings.moves
        count = max(weak, int(settings.moved_share * len(z))) if moved_away else weak
        total = len(z)
        kept = np.sort(np.argsort(_energies(z), kind="stable")[count:])
        z = z[kept]
        descent.take(kept)
        if moved_away and count:
            target.evaluate(to_parameters(z))
            z = np.concatenate([z, target.new_splats(count, total, rng)])
            descent.append(count)
    return z


def _descended(target: Target, z: F8, descent: LBFGS, evaluations: int) -> F8:
    """Descend the error of splats with the term of the bits; those that the objective holds are not in z."""
    best: tuple[float, F8, F8] | None = None
    for _ in range(evaluations):
        keep_inside(z, target.width, target.height)
        error, gradient = target.evaluate(to_parameters(z))
        error += add_bits(z, descent.quantizer, BITS_WEIGHT, gradient)
        if best is None or error < best[0]:
            best = error, z, gradient
        elif error > RISE * best[0]:
            error, z, gradient = best
            descent.restart()
        z = moved(z, descent.step(z, error, gradient))
    return z if best is None else best[1]


def settle(target: Target, z: F8, quantizer: int, rng: Generator, settings: IntraSettings) -> Rounded:
    """The codes of splats, rounded part by part.

    Splats of a part are rounded, and held; the others go on descending, and make good for what rounding did. Which
    splats are in a part is drawn at random, so that neighbours mostly are in different parts. The error that is left is
    mostly that of the last parts.

    Parameters
    ----------
    target
        The picture.
    z
        (N, 8) f8, where to begin.
    quantizer
        D in 1/16.
    rng, settings
        As in `encode_intra`.
    """
    order = rng.permutation(len(z))
    sizes = np.round(np.array(settings.parts) * len(z)).astype(np.int64)
    ends = np.minimum(np.cumsum(sizes), len(z))
    ends[-1] = len(z)
    z = _descended(target, z, LBFGS(len(z), quantizer / 16), settings.settle)
    result = rounded(z, quantizer, target.width, target.height)
    for first, end in zip((0, *ends[:-1]), ends, strict=True):
        part, free = order[first:end], order[end:]
        result.put(part, rounded(z[part], quantizer, target.width, target.height))
        if len(free):
            target.hold(result.parameters[order[:end]])
            z[free] = _descended(target, z[free], LBFGS(len(free), quantizer / 16), settings.settle)
    target.hold(result.parameters[:0])
    return result


def _energies(z: F8) -> F8:
    """E^2 of each splat."""
    return np.asarray((z[:, 5] * z[:, 5] + z[:, 6] * z[:, 6]) + z[:, 7] * z[:, 7])


@kernel()
def add_bits(z: F8, quantizer: float, weight: float, gradient: F8) -> float:
    """The term of the bits, W D^2 / 2 ln((E^2 + D^2) / D^2) of all splats; its gradient is added to the other."""
    d2 = quantizer * quantizer
    total = 0.0
    for i in range(len(z)):
        energy = (z[i, 5] * z[i, 5] + z[i, 6] * z[i, 6]) + z[i, 7] * z[i, 7]
        for k in range(5, 8):
            gradient[i, k] += weight * d2 / (energy + d2) * z[i, k]
        total += log_kernel((energy + d2) / d2)
    return total * (0.5 * weight * d2)


@kernel()
def keep_inside(z: F8, width: int, height: int) -> None:
    """Move coordinates, in place, to where an I-frame can have them: inside, neither too small nor too slanted."""
    low, high, shear = log_kernel(LEAST_SIZE), log_kernel(MOST_SIZE), MOST_SHEAR / 1024
    for i in range(len(z)):
        a = min(max((z[i, 2] + z[i, 3]) * HALF, low), high)
        b = min(max((z[i, 2] - z[i, 3]) * HALF, low), high)
        z[i, 2], z[i, 3] = (a + b) * HALF, (a - b) * HALF
        z[i, 4] = min(max(z[i, 4], -shear), shear)
        z[i, 0] = min(max(z[i, 0], 0.01), width - 0.01)
        z[i, 1] = min(max(z[i, 1], 0.01), height - 0.01)
