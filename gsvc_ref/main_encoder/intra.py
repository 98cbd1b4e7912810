"""I-frames of profile `main`: from a picture to the codes of its splats.

Three stages share one metric (`coordinates`) and one optimiser (`descent`). `fit` grows splats where the picture is
worst, then weighs their bits and removes the weakest. `settle` rounds them to codes part by part: after each part the
others, which are still free, make good for its rounding errors. Last, the codes' densities are chosen by code length.
"""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import codec
import numpy as np
from numpy.random import Generator

from gsvc_ref._jit import kernel
from gsvc_ref.arrays import F4, F8, I8
from gsvc_ref.checks import check_types
from gsvc_ref.errors import UsageError
from gsvc_ref.main_encoder.coordinates import (
    HALF,
    gradient_by_coordinates,
    log_kernel,
    moved,
    to_coordinates,
    to_parameters,
)
from gsvc_ref.main_encoder.density_choice import Density, choose_alphas, choose_densities
from gsvc_ref.main_encoder.descent import LBFGS
from gsvc_ref.main_encoder.new_splats import Edges
from gsvc_ref.main_encoder.rounding import MOST_SHEAR, Rounded, codes_of, rounded
from gsvc_ref.rendering import Objective, Precision
from gsvc_ref.training.augmentation import image_start
from gsvc_ref.training.settings import Growth

LEAST_SIZE: Final = 0.27
"""Smallest l11 and l22 in pixels: a smaller splat can lie between all pixel centres."""
MOST_SIZE: Final = 400.0

RISE: Final = 1.01
"""L-BFGS goes back to its best point where the error is this many times as large."""

BITS_WEIGHT: Final = 1.5
"""W in the term of the bits, W D^2 / 2 ln(E^2 + D^2) of each splat.

Five codes of geometry and one or two of colour take log2 E bits each, and at a step D a bit is worth about 0.12 D^2.
"""


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
    removals
        At which parts of the second splats go whose energy is below `least_energy` D.
    parts
        The shares of the splats that are rounded one after the other.
    settle
        Evaluations before the first part is rounded and after each but the last.
    """

    grow: int = 100
    weigh: int = 80
    growth: Growth = Growth(end=0.45)
    surplus: float = 1.2
    removals: tuple[float, ...] = (0.6, 0.8, 0.95)
    least_energy: float = 1.5
    parts: tuple[float, ...] = (0.3, 0.25, 0.2, 0.15, 0.1)
    settle: int = 8

    def __post_init__(self) -> None:
        check_types(self)
        if self.grow < 1 or self.weigh < 0 or self.settle < 1 or self.surplus < 1 or not self.parts:
            raise UsageError(f"{self}: grow and settle must be at least 1, weigh 0 and surplus 1, and parts be given")

    @classmethod
    def quick(cls) -> "IntraSettings":
        """As fast as the I-frames of profile `paper`."""
        return cls()

    @classmethod
    def slow(cls) -> "IntraSettings":
        """Several times the time of `quick`."""
        return cls(grow=400, weigh=600, settle=30)


class IntraFrame(NamedTuple):
    """An I-frame to be written.

    Attributes
    ----------
    codes
        cx, cy, k, g, px, py in the order of cells, as `codec.code_splats` takes them.
    densities, alphas
        As `choose_densities` and `choose_alphas` give them; densities are empty where there is no splat.
    state, parameters
        (N, 8) i8 and f4 in the same order: what a decoder has.
    """

    codes: dict[str, I8]
    densities: dict[str, Density]
    alphas: list[int]
    state: I8
    parameters: F4


def encode_intra(
    picture: F4,
    splats: int,
    quantizer: int,
    rng: Generator,
    settings: IntraSettings | None = None,
    *,
    threads: int | None = None,
    precision: Precision = "fast",
) -> IntraFrame:
    """The codes of an I-frame.

    Parameters
    ----------
    picture
        (H, W, 3) f4, R'G'B' with 1.0 = full scale.
    splats
        About how many splats there shall be, at least 1; the frame has at most `settings.surplus` times as many.
    quantizer
        0..79, for D = 2^(quantizer / 8) / 2.
    rng
        Draws the places of splats.
    settings
        None: `IntraSettings.quick()`.
    threads, precision
        As in `Objective`; the result does not depend on the threads, and with ``deterministic`` not on the CPU.
    """
    settings = settings or IntraSettings.quick()
    target = Target(picture, threads, precision)
    step = codec.step_D(quantizer)
    z = fit(target, max(1, round(settings.surplus * splats)), step / 16, rng, settings)
    return coded(settle(target, z, step, rng, settings), step, target.width, target.height)


def coded(result: Rounded, step: int, width: int, height: int) -> IntraFrame:
    """Rounded splats in the order of cells, with the densities of their codes; splats without colour are left out."""
    live = np.flatnonzero((result.k != 0).any(axis=1))
    result = Rounded(*(part[live] for part in result))
    columns, rows = -(-width // 4), -(-height // 4)
    cells = codec.morton(result.cell[:, 0], result.cell[:, 1], columns, rows)
    order = np.argsort(cells, kind="stable")
    result = Rounded(*(part[order] for part in result))
    densities = choose_densities(result.k, result.g, step) if len(order) else {}
    alphas = choose_alphas(cells[order], columns, rows)
    return IntraFrame(codes_of(result), densities, alphas, result.state, result.parameters)


class Target:
    """A picture to be described, with the squared error of splats in units of 8 bits."""

    def __init__(self, picture: F4, threads: int | None = None, precision: Precision = "fast") -> None:
        self.objective = Objective(picture, threads, precision=precision)
        self.picture = np.ascontiguousarray(picture, np.float32)  # (H, W, 3) f4
        self.height, self.width = self.picture.shape[:2]
        self.edges = Edges(self.picture)
        self._scale = self.height * self.width * 255.0**2
        self._held, self._frozen = np.zeros((0, 8), np.float32), 0

    def hold(self, parameters: F4) -> None:
        """From now on splats (n, 8) f4 are in every picture, beside those that are evaluated."""
        self._held = parameters

    def evaluate(self, parameters: F4) -> tuple[float, F8]:
        """The squared error of splats (N, 8) f4, and its gradient (N, 8) f8 by (u, v, m, r, s, n0, n1, n2)."""
        held = len(self._held)
        every = np.concatenate([self._held, parameters]) if held else parameters
        if held != self._frozen:
            self.objective.freeze(every, np.arange(len(every)) < held)
            self._frozen = held
        loss, gradient = self.objective.evaluate(every)
        return loss * self._scale, gradient_by_coordinates(parameters, gradient[held:] * np.float32(self._scale))

    def new_splats(self, count: int, total: int, rng: Generator) -> F8:
        """Coordinates (count, 8) of splats where the splats evaluated last, of `total`, leave the most."""
        return to_coordinates(self.edges.new_splats(-self.objective.residual(), count, total, rng))


def fit(target: Target, total: int, quantizer: float, rng: Generator, settings: IntraSettings) -> F8:
    """Coordinates (N, 8) of splats that are close to a picture and will take few bits, without rounding.

    Parameters
    ----------
    target
        The picture.
    total
        How many splats there are before the weakest are removed.
    quantizer
        D, which says what a bit is worth.
    rng, settings
        As in `encode_intra`.
    """
    z = to_coordinates(image_start(target.picture, settings.growth.start(total), rng).to_array())
    z = _grown(target, z, quantizer, rng, settings.growth.counts(total, settings.grow), settings.grow)
    done = 0
    for stop in (*(int(settings.weigh * part) for part in settings.removals), settings.weigh):
        z = _descended(target, z, quantizer, stop - done)
        z = z[_energies(z) > (settings.least_energy * quantizer) ** 2] if stop < settings.weigh else z
        done = stop
    return z


def _grown(target: Target, z: F8, quantizer: float, rng: Generator, plan: dict[int, int], evaluations: int) -> F8:
    """Descend the error alone; `plan` says to how many the splats are brought at which evaluation."""
    descent = LBFGS(len(z), quantizer)
    best: tuple[float, F8, F8] | None = None  # the error, the coordinates, and the gradient there
    for i in range(evaluations):
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
            descent.take(np.arange(len(z)), new)
            z = np.concatenate([z, target.new_splats(new, plan[i], rng)])
            keep_inside(z, target.width, target.height)
            error, gradient = target.evaluate(to_parameters(z))
            best = error, z, gradient
            step = descent.step(z, error, gradient)
        z = moved(z, step)
    return z if best is None else best[1]


def _descended(target: Target, z: F8, quantizer: float, evaluations: int) -> F8:
    """Descend the error of splats with the term of the bits; those that the objective holds are not in z."""
    descent = LBFGS(len(z), quantizer)
    best: tuple[float, F8, F8] | None = None
    for _ in range(evaluations):
        keep_inside(z, target.width, target.height)
        error, gradient = target.evaluate(to_parameters(z))
        error += add_bits(z, quantizer, BITS_WEIGHT, gradient)
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
    ends = np.cumsum(np.round(np.array(settings.parts) * len(z)).astype(np.int64))
    ends[-1] = len(z)
    z = _descended(target, z, quantizer / 16, settings.settle)
    result = rounded(z, quantizer, target.width, target.height)
    for first, end in zip((0, *ends[:-1]), ends, strict=True):
        part, free = order[first:end], order[end:]
        for whole, now in zip(result, rounded(z[part], quantizer, target.width, target.height), strict=True):
            whole[part] = now
        if len(free):
            target.hold(result.parameters[order[:end]])
            z[free] = _descended(target, z[free], quantizer / 16, settings.settle)
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
    """Move coordinates, in place, to where an I-frame can have them: inside the frame, neither too small nor too slanted."""
    low, high, shear = log_kernel(LEAST_SIZE), log_kernel(MOST_SIZE), MOST_SHEAR / 1024
    for i in range(len(z)):
        a = min(max((z[i, 2] + z[i, 3]) * HALF, low), high)
        b = min(max((z[i, 2] - z[i, 3]) * HALF, low), high)
        z[i, 2], z[i, 3] = (a + b) * HALF, (a - b) * HALF
        z[i, 4] = min(max(z[i, 4], -shear), shear)
        z[i, 0] = min(max(z[i, 0], 0.01), width - 0.01)
        z[i, 1] = min(max(z[i, 1], 0.01), height - 0.01)
