"""I-frames of profile `main`: from a picture to the codes of its splats.

Three stages share one metric (`coordinates`). `fit` grows splats and descends by L-BFGS without rounding. `tune`
descends through the rounding that a decoder will see, with momentum in the metric, a term for the bits, and weak
splats moved to where the picture is worst. Then the codes' densities are chosen by code length.
"""

import math
from collections.abc import Callable
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
    LEAST_ENERGY,
    ROOT,
    exp_kernel,
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

MOMENTUM: Final = 0.9
MOST_STEP: Final = 1.5
"""Longest step of a coordinate while tuning, in units of the metric; that of position and shape is at most SHAPE."""
MOST_SHAPE_STEP: Final = 0.4
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
    fit
        Evaluations of the fit without rounding, beside one for each addition of splats.
    tune
        Iterations through the rounding.
    growth
        How splats come during the fit.
    surplus
        Splats of the fit for each splat that is asked for; the weakest go while tuning.
    rate
        Step of tuning at its begin, as a share of the Newton step that each splat alone would make.
    last_rate
        The same at its end, as a share of `rate`; a cosine lies between.
    moves
        At which parts of tuning the weakest splats move to where the picture is worst.
    moved_share
        How many move each time, as a share of all.
    removals
        At which parts of tuning splats whose energy is below D go.
    """

    fit: int = 80
    tune: int = 100
    growth: Growth = Growth(end=0.45)
    surplus: float = 1.2
    rate: float = 0.2
    last_rate: float = 0.05
    moves: tuple[float, ...] = (0.125, 0.2, 0.333)
    moved_share: float = 0.08
    removals: tuple[float, ...] = (0.02, 0.25, 0.5, 0.7)

    def __post_init__(self) -> None:
        check_types(self)
        if self.fit < 1 or self.tune < 4 or self.surplus < 1:
            raise UsageError(f"{self}: fit must be at least 1, tune at least 4 and surplus at least 1")

    @classmethod
    def quick(cls) -> "IntraSettings":
        """As fast as the I-frames of profile `paper`."""
        return cls()

    @classmethod
    def slow(cls) -> "IntraSettings":
        """Ten times the time of `quick`."""
        return cls(fit=400, tune=1200)


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
    best = tune(target, z, step, rng, settings)
    return coded(best, step, target.width, target.height)


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

    def evaluate(self, parameters: F4) -> tuple[float, F8]:
        """The squared error of splats (N, 8) f4, and its gradient (N, 8) f8 by (u, v, m, r, s, n0, n1, n2)."""
        loss, gradient = self.objective.evaluate(parameters)
        return loss * self._scale, gradient_by_coordinates(parameters, gradient * np.float32(self._scale))

    def new_splats(self, count: int, total: int, rng: Generator) -> F8:
        """Coordinates (count, 8) of splats where the splats evaluated last, of `total`, leave the most."""
        return to_coordinates(self.edges.new_splats(-self.objective.residual(), count, total, rng))


def fit(target: Target, total: int, quantizer: float, rng: Generator, settings: IntraSettings) -> F8:
    """Coordinates (N, 8) of splats that are close to a picture, without rounding.

    Parameters
    ----------
    target
        The picture.
    total
        N.
    quantizer
        D; splats with less energy than LEAST_ENERGY of it make shorter steps.
    rng, settings
        As in `encode_intra`.
    """
    z = to_coordinates(image_start(target.picture, settings.growth.start(total), rng).to_array())
    plan = settings.growth.counts(total, settings.fit)
    descent = LBFGS(len(z), quantizer)
    best: tuple[float, F8, F8] | None = None  # the error, the coordinates, and the gradient there
    for i in range(settings.fit):
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


def tune(
    target: Target, z: F8, quantizer: int, rng: Generator, settings: IntraSettings,
    on_iteration: Callable[[int, float], None] | None = None,
) -> Rounded:  # fmt: skip
    """The best rounded splats that descent through the rounding finds in its last quarter.

    The error of rounded splats and its gradient stand for those of the splats before rounding (straight through). The
    step is that of momentum in the metric: v <- 0.9 v - rate * (2 metric)^-1 gradient.

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
    on_iteration
        Called with the number of each iteration and its squared error.
    """
    d = quantizer / 16
    iterations = settings.tune
    moves = {int(iterations * part) for part in settings.moves}
    removals = {int(iterations * part) for part in settings.removals}
    rates = _cosine(settings.rate, settings.rate * settings.last_rate, iterations)
    velocity = np.zeros_like(z)
    best: tuple[float, Rounded] | None = None
    for i in range(iterations):
        keep_inside(z, target.width, target.height)
        if i in removals:
            kept = np.flatnonzero(_energies(z) > d * d)
            z, velocity = z[kept], velocity[kept]
        result = rounded(z, quantizer, target.width, target.height)
        error, gradient = target.evaluate(result.parameters)
        if on_iteration:
            on_iteration(i, error)
        if 4 * i >= 3 * iterations and (best is None or error < best[0]):
            best = error, result
        if i in moves and (count := int(settings.moved_share * len(z))):
            kept = np.sort(np.argsort(_energies(z), kind="stable")[count:])
            new = target.new_splats(count, len(z), rng)
            step_kernel(z, velocity, gradient, d, BITS_WEIGHT, rates[i])
            z, velocity = np.concatenate([z[kept], new]), np.concatenate([velocity[kept], np.zeros_like(new)])
        else:
            step_kernel(z, velocity, gradient, d, BITS_WEIGHT, rates[i])
    assert best is not None
    return best[1]


def _cosine(first: float, last: float, count: int) -> list[float]:
    """Numbers from `first` to `last` along half a period of a cosine."""
    from gsvc_ref.portable import cos

    return [last + (first - last) * (1 + float(cos(math.pi * i / count))) / 2 for i in range(count)]


def _energies(z: F8) -> F8:
    """E^2 of each splat."""
    return np.asarray((z[:, 5] * z[:, 5] + z[:, 6] * z[:, 6]) + z[:, 7] * z[:, 7])


@kernel()
def step_kernel(z: F8, velocity: F8, gradient: F8, quantizer: float, weight: float, rate: float) -> None:
    """One step of `tune`, in place; `gradient` is that of the error alone."""
    d2 = quantizer * quantizer
    for i in range(len(z)):
        energy = (z[i, 5] * z[i, 5] + z[i, 6] * z[i, 6]) + z[i, 7] * z[i, 7]
        relative = 1 / math.sqrt(max(energy, LEAST_ENERGY * LEAST_ENERGY * d2))
        bits = weight * d2 / (energy + d2)
        for k in range(8):
            unit = 1.0 if k > 4 else (2 * relative if k == 4 else ROOT * relative)  # for D = 1
            slope = gradient[i, k] + (bits * z[i, k] if k > 4 else 0.0)
            v = MOMENTUM * velocity[i, k] - rate * 0.5 * unit * unit * slope
            most = MOST_STEP * unit * quantizer
            if k < 5:
                most = min(most, MOST_SHAPE_STEP)
            velocity[i, k] = min(max(v, -most), most)
        l11, l22 = exp_kernel((z[i, 2] + z[i, 3]) * HALF), exp_kernel((z[i, 2] - z[i, 3]) * HALF)
        v = velocity[i]
        z[i, 0] += l11 * v[0]
        z[i, 1] += z[i, 4] * l22 * v[0] + l22 * v[1]
        z[i, 4] = z[i, 4] * exp_kernel(ROOT * v[3]) + v[4]
        for k in (2, 3, 5, 6, 7):
            z[i, k] += v[k]


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
