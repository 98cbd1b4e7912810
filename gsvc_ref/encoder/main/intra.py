"""I-frames of profile `main`: from a picture to the codes of its splats.

Three stages share one metric (`coordinates`) and one optimiser (`descent`). `grow` adds splats where the picture is
worst, on a smaller picture as long as they are few. `weigh` goes on with a term for their bits, and removes the
weakest. `settle` rounds them to codes part by part: after each part the others, which are still free, make good for its
rounding errors. Last, the densities of the codes are chosen by their length.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref._jit import kernel
from gsvc_ref.encoder.main.density_choice import choose_densities
from gsvc_ref.encoder.main.rounding import MOST_SHEAR, Rounded, codes_of, rounded
from gsvc_ref.encoder.main.settings import IntraSettings
from gsvc_ref.encoder.main.target import OnEvaluation, Target
from gsvc_ref.main.cells import cell_order
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.tables import QUANTIZERS, step_of
from gsvc_ref.rendering import Precision
from gsvc_ref.training.coordinates import (
    HALF,
    log_kernel,
    moved,
    to_parameters,
)
from gsvc_ref.training.descent import LBFGS

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


def grow(target: Target, total: int, rng: Generator, settings: IntraSettings) -> F8:
    """Coordinates (N, 8) of splats that are close to a picture, without rounding and whatever their bits.

    As long as splats are added, a picture with many pixels for each is evaluated at half or a quarter of its size.

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
        if target.resize(len(z) if i <= max(plan, default=0) else None):
            best = None
            descent.append(0)
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
    target.resize()
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
    order = np.argsort(rng.random(len(z)), kind="stable")
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
