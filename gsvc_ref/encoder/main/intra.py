"""I-frames of profile `main`: from a picture to the codes of its splats.

Four stages share one metric (`coordinates`) and one optimizer (`descent`). Initialization (`fitter.fit`) adds splats
where the picture is worst. Rate-constrained refinement (`refine`) goes on with a term for their bits, and removes the
weakest. Sequential rounding (`round_sequentially`) makes codes part by part: after each part the others, which are
still free, compensate for its rounding errors. Last, the densities of the codes are chosen by their length.

`quantizer` is 0..79, `step` is D in 1/16, and `D` is in units of 8 bits.
"""

import math
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator

from gsvc_base.arrays import F4, F8, I8
from gsvc_base.portable import power
from gsvc_ref._jit import kernel
from gsvc_ref.encoder.main.codes import nearest_codes
from gsvc_ref.encoder.main.coordinates import energies, energy, log_kernel, to_parameters
from gsvc_ref.encoder.main.densities import choose_densities
from gsvc_ref.encoder.main.descent import Walk
from gsvc_ref.encoder.main.fitter import descend, fit
from gsvc_ref.encoder.main.settings import IntraSettings
from gsvc_ref.encoder.main.target import OnEvaluation, Target
from gsvc_ref.main.cells import cell_order
from gsvc_ref.main.codes import IntraCodes, MainCodes
from gsvc_ref.main.reconstruct import intra_state
from gsvc_ref.main.state import parameters_of
from gsvc_ref.main.tables import QUANTIZERS, step_of
from gsvc_ref.rendering import Precision

MEDIAN_ENERGY: Final = 7.0  # median energy of fitted splats in D, `quantizer_for`; measured
MIDDLE_QUANTIZER: Final = 40  # the quantizer of no splats

LAYER_COARSER: Final = 7
"""By how many steps of an eighth of an octave D of a layer is greater than `quantizer_for` its splats; measured.

What a base leaves of a picture is faint, and so are the splats fitted to it. The D that suits is about that of a whole
picture of the same quality: a layer of 300 splats on a base of 200 took 15.9 kbit in all for 33.2 dB with 4 more steps
than its own rule has, and 18.3 for 33.7 with none, where one layer takes 13.8 and 15.0.
"""

BITS_WEIGHT: Final = 1.5
"""W in the term of the bits, W D^2 / 2 ln(E^2 + D^2) of each splat.

Five codes of geometry and one or two of color take log2 E bits each, and at a step D a bit is worth about 0.12 D^2.
"""

STEPS_PER_DOUBLING: Final = 7.0
"""By how many eighths of an octave D falls with twice the splats; measured on four pictures, 5 to 11."""

CLOSE_QUANTIZER: Final = 2  # A quantizer of the rule that is as close as this to the one asked for is not improved
SPLAT_TRIES: Final = 3  # most fits of the splat-count search


class IntraFrame(NamedTuple):
    """An I-frame to be written: its codes, and what a decoder makes of them, `state` and `parameters` (N, 8)."""

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
    z = fit(target, settings.fitted_splats(splats), rng, settings.initialization, settings.growth)
    if quantizer is None:
        above = base is not None and len(base) > 0
        quantizer = min(quantizer_for(z) + (LAYER_COARSER if above else 0), QUANTIZERS - 1)
    step = step_of(quantizer)
    z = refine(target, z, step / 16, rng, settings)
    return coded(round_sequentially(target, z, step, rng, settings), quantizer, target)


def quantizer_for(z: F8) -> int:
    """The quantizer that goes with splats (N, 8) that a fit of the error alone has found: the one rule for N and D.

    A bit is best spent either on a splat more or on finer steps of all. Both give the same where the median of the
    splats' energies E, before any is removed for its bits, is MEDIAN_ENERGY times D: then some 10 to 30 % of them turn
    out not to be worth their bits, for any picture and quality. A finer D is waste on splats too few, a coarser one
    removes more of them. For a quality that is asked for, N is what is searched (`splats_for`).
    """
    if len(z) == 0:
        return MIDDLE_QUANTIZER
    median = math.sqrt(float(np.sort(energies(z))[len(z) // 2]))
    steps = np.array([step_of(quantizer) for quantizer in range(QUANTIZERS)])
    return int(np.argmin(np.abs(steps - 16 * median / MEDIAN_ENERGY)))


def splats_for(
    target: Target, quantizer: int, rng: Generator, settings: IntraSettings, *, splats: int, most_splats: int
) -> int:
    """The number of splats for which `quantizer_for` gives about this quantizer, found by fits from `splats` on."""
    count = min(splats, most_splats)
    for attempt in rng.spawn(SPLAT_TRIES):
        z = fit(target, settings.fitted_splats(count), attempt, settings.initialization, settings.growth)
        missing = quantizer_for(z) - quantizer
        following = min(max(1, round(count * float(power(2.0, missing / STEPS_PER_DOUBLING)))), most_splats)
        if abs(missing) <= CLOSE_QUANTIZER or following == count:
            break
        count = following
    return count


def refine(target: Target, z: F8, D: float, rng: Generator, settings: IntraSettings) -> F8:
    """Coordinates (N, 8) after descent from z (N, 8) with the term of the bits at a step D; the weakest move or go."""
    least = settings.least_energy * settings.least_energy * D * D
    done, walk = 0, Walk(len(z), D)
    for part in sorted({*settings.moves, *settings.removals, 1.0}):
        stop = int(settings.refinement * part)
        z = descend(target, z, walk, stop - done, partial(add_bits, D))
        done = stop
        weak, total = int(np.count_nonzero(energies(z) <= least)), len(z)
        moves = part in settings.moves
        count = max(weak, int(settings.moved_share * total)) if moves else weak
        kept = np.sort(np.argsort(energies(z), kind="stable")[count:])
        z = z[kept]
        walk.take(kept)
        if moves and count:
            target.evaluate(to_parameters(z))
            z = np.concatenate([z, target.new_splats(count, total, rng)])
            walk.append(count)
    return z


def round_sequentially(target: Target, z: F8, step: int, rng: Generator, settings: IntraSettings) -> IntraCodes:
    """The codes of splats with the coordinates z (N, 8), rounded part by part.

    Splats of a part are rounded, and held; the others go on descending, and compensate for what rounding did. Which
    splats are in a part is drawn at random, so that neighbors mostly are in different parts. The error that is left is
    mostly that of the last parts.
    """
    order = np.argsort(rng.random(len(z)), kind="stable")
    ends = np.minimum(np.cumsum(np.round(np.array(settings.parts) * len(z)).astype(np.int64)), len(z))
    ends[-1] = len(z)
    D, rounded, held = step / 16, list[IntraCodes](), list[F4]()
    z = descend(target, z, Walk(len(z), D), settings.rounding, partial(add_bits, D))
    for first, end in zip((0, *ends[:-1]), ends, strict=True):
        rounded.append(nearest_codes(z[order[first:end]], step, target.width, target.height))
        free = order[end:]
        if len(free):
            held.append(parameters_of(intra_state(rounded[-1], step)))
            target.hold(np.concatenate(held))
            z[free] = descend(target, z[free], Walk(len(free), D), settings.rounding, partial(add_bits, D))
    target.hold(np.zeros((0, 8), np.float32))
    return IntraCodes.joined(rounded).take(np.argsort(order, kind="stable"))


def coded(found: IntraCodes, quantizer: int, target: Target) -> IntraFrame:
    """Codes in the order of cells, with their densities; splats without color are left out."""
    visible = found.take(np.flatnonzero((found.colors != 0).any(axis=1)))
    codes = visible.take(cell_order(visible.cells, target.width, target.height))
    step = step_of(quantizer)
    densities = choose_densities(codes, step, target.width, target.height) if len(codes) else None
    state = intra_state(codes, step)
    return IntraFrame(MainCodes(quantizer, type="I", densities=densities, new=codes), state, parameters_of(state))


def add_bits(D: float, z: F8, gradient: F8) -> float:
    """The term of the bits, W D^2 / 2 ln((E^2 + D^2) / D^2) of all splats; its gradient is added to another (N, 8)."""
    return _add_bits(z, D, gradient)


@kernel()
def _add_bits(z: F8, D: float, gradient: F8) -> float:
    d2, total = D * D, 0.0
    for i in range(len(z)):
        e2 = energy(z[i])
        for k in range(5, 8):
            gradient[i, k] += BITS_WEIGHT * d2 / (e2 + d2) * z[i, k]
        total += log_kernel((e2 + d2) / d2)
    return total * (0.5 * BITS_WEIGHT * d2)
