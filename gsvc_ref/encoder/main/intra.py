"""I-frames of profile `main`: from a picture to the codes of its splats.

Four stages share one metric (`coordinates`) and one optimizer (`descent`). Initialization (`fitter.fit`) adds splats
where the picture is worst. Rate-constrained refinement (`refine`) goes on with a term for their bits, and removes the
weakest. Sequential rounding (`round_sequentially`) makes codes part by part: after each part the others, which are
still free, compensate for its rounding errors. Last, the densities of the codes are chosen by their length.

`quantizer` is 0..79, `step` is D in 1/16, and `D` is in units of 8 bits.
"""

import math
from functools import partial
from typing import Final

import numpy as np
from numpy.random import Generator

from gsvc_base.arrays import F4, F8, I8
from gsvc_base.portable import power
from gsvc_ref._jit import kernel
from gsvc_ref.encoder.main.codes import nearest_codes
from gsvc_ref.encoder.main.coordinates import log_kernel, squared_energies, squared_energy, to_parameters
from gsvc_ref.encoder.main.densities import choose_densities
from gsvc_ref.encoder.main.descent import Walk
from gsvc_ref.encoder.main.fitter import descend, fit
from gsvc_ref.encoder.main.settings import IntraSettings
from gsvc_ref.encoder.main.target import Target
from gsvc_ref.main.cells import cell_order
from gsvc_ref.main.codes import IntraCodes, MainCodes
from gsvc_ref.main.reconstruct import intra_state
from gsvc_ref.main.state import parameters_of
from gsvc_ref.main.tables import QUANTIZERS, step_of

MEDIAN_ENERGY: Final = 7.0  # median energy of fitted splats in D, `quantizer_for`; measured
MIDDLE_QUANTIZER: Final = 40  # the quantizer of no splats

LAYER_COARSER: Final = 7
"""By how many steps of an eighth of an octave D of a layer is greater than `quantizer_for` its splats; measured.

What a base leaves of a picture is faint, and so are the splats fitted to it. The D that suits is about that of a whole
picture of the same PSNR: a layer of 300 splats on a base of 200 took 15.9 kbit in all for 33.2 dB with 4 more steps
than its own rule has, and 18.3 for 33.7 with none, where one layer takes 13.8 and 15.0.
"""

BITS_WEIGHT: Final = 1.5
"""W in the term of the bits, W D^2 / 2 ln(E^2 + D^2) of each splat.

Five codes of geometry and one or two of color take log2 E bits each, and at a step D a bit is worth about 0.12 D^2.
"""

STEPS_PER_DOUBLING: Final = 7.0
"""By how many eighths of an octave D falls with twice the splats; measured on four pictures, 5 to 11."""

SURPLUS: Final = 1.2  # splats that are fitted for each one that is asked for
REMOVALS: Final = (0.6, 0.8, 0.95)  # at which shares of the refinement weak splats are removed, beside its end
REMOVED_ENERGY: Final = 1.5  # of a weak splat at most, in D
MOVED_SHARE: Final = 0.04  # where splats move, at least this share of all does
PARTS: Final = (0.3, 0.25, 0.2, 0.15, 0.1)  # the shares of the splats that are rounded one after the other

CLOSE_QUANTIZER: Final = 2  # a quantizer of the rule that is as close as this to the one asked for is not improved
SPLAT_TRIES: Final = 3  # most fits of the splat-count search


def encode_intra(
    target: Target, splats: int, rng: Generator, quantizer: int | None, settings: IntraSettings
) -> MainCodes:
    """The codes of an I-frame, or of a layer, of about `splats` >= 1 splats, and at most SURPLUS times as many.

    The quantizer is 0..79; None: `quantizer_for` chooses it. `rng` draws the places of splats, and which are rounded
    first.
    """
    z = initial_splats(target, splats, rng, settings)
    if quantizer is None:
        quantizer = min(quantizer_for(z) + (LAYER_COARSER if target.base_count else 0), QUANTIZERS - 1)
    step = step_of(quantizer)
    z = refine(target, z, step / 16, rng, settings)
    return ordered(quantizer, round_sequentially(target, z, step, rng, settings), target.width, target.height)


def ordered(quantizer: int, codes: IntraCodes, width: int, height: int) -> MainCodes:
    """The I-frame of codes in any order, without those that have no color."""
    codes = codes.take(coded_order(codes, width, height))
    densities = choose_densities(codes, step_of(quantizer), width, height) if len(codes) else None
    return MainCodes(quantizer, type="I", densities=densities, new=codes)


def coded_order(codes: IntraCodes, width: int, height: int) -> I8:
    """The indices of codes that have a color, in the order of their cells."""
    colored = np.flatnonzero((codes.colors != 0).any(axis=1))
    return colored[cell_order(codes.cells[colored], width, height)]


def intra_evaluations(settings: IntraSettings) -> int:
    """How many evaluations an I-frame takes, about."""
    return settings.initialization + settings.refinement + settings.rounding * len(PARTS)


def initial_splats(target: Target, splats: int, rng: Generator, settings: IntraSettings) -> F8:
    """The coordinates (N, 8) of fitted splats, SURPLUS times as many as are asked for: some will go."""
    return fit(target, max(1, round(SURPLUS * splats)), rng, settings.initialization)


def quantizer_for(z: F8) -> int:
    """The quantizer that goes with splats (N, 8) that a fit of the error alone has found: the one rule for N and D.

    A bit is best spent either on a splat more or on finer steps of all. Both give the same where the median of the
    splats' energies E, before any is removed for its bits, is MEDIAN_ENERGY times D: then some 10 to 30 % of them turn
    out not to be worth their bits, for any picture and PSNR. A finer D is waste on splats too few, a coarser one
    removes more of them. Where the quality gives D, N is what is searched (`splats_for`).
    """
    if len(z) == 0:
        return MIDDLE_QUANTIZER
    median = math.sqrt(float(np.sort(squared_energies(z))[len(z) // 2]))
    steps = np.array([step_of(quantizer) for quantizer in range(QUANTIZERS)])
    return int(np.argmin(np.abs(steps - 16 * median / MEDIAN_ENERGY)))


def splats_for(
    target: Target, quantizer: int, rng: Generator, settings: IntraSettings, splats: int, most_splats: int
) -> int:
    """The number of splats for which `quantizer_for` gives about this quantizer, found by fits from `splats` on."""
    count = min(splats, most_splats)
    for attempt in rng.spawn(SPLAT_TRIES):
        missing = quantizer_for(initial_splats(target, count, attempt, settings)) - quantizer
        following = min(max(1, round(count * float(power(2.0, missing / STEPS_PER_DOUBLING)))), most_splats)
        if abs(missing) <= CLOSE_QUANTIZER or following == count:
            break
        count = following
    return count


def refine(target: Target, z: F8, D: float, rng: Generator, settings: IntraSettings) -> F8:
    """Coordinates (N, 8) after descent from z (N, 8) with the term of the bits at a step D; the weakest move or go."""
    least = REMOVED_ENERGY * REMOVED_ENERGY * D * D
    done, walk = 0, Walk(len(z), D)
    for share in sorted({*settings.moves, *REMOVALS, 1.0}):
        stop = int(settings.refinement * share)
        z = descend(target, z, walk, stop - done, partial(add_bits, D, BITS_WEIGHT))
        done = stop
        weak, total = int(np.count_nonzero(squared_energies(z) <= least)), len(z)
        moves = share in settings.moves
        count = max(weak, int(MOVED_SHARE * total)) if moves else weak
        kept = np.sort(np.argsort(squared_energies(z), kind="stable")[count:])
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
    D, rounded, held, done = step / 16, list[IntraCodes](), list[F4](), list[I8]()
    parts = drawn_parts(len(z), rng)
    z = descend(target, z, Walk(len(z), D), settings.rounding, partial(add_bits, D, BITS_WEIGHT))
    for part, free in parts:
        done.append(part)
        rounded.append(nearest_codes(z[part], step, target.width, target.height))
        if len(free):
            held.append(parameters_of(intra_state(rounded[-1], step)))
            target.hold(np.concatenate(held))
            z[free] = descend(target, z[free], Walk(len(free), D), settings.rounding, partial(add_bits, D, BITS_WEIGHT))
    target.hold(np.zeros((0, 8), np.float32))
    return IntraCodes.joined(rounded).take(np.argsort(np.concatenate(done), kind="stable"))


def drawn_parts(count: int, rng: Generator) -> list[tuple[I8, I8]]:
    """The parts in which `count` splats are rounded: the indices of each, and of those that are free after it."""
    order = np.argsort(rng.random(count), kind="stable")
    ends = np.minimum(np.cumsum(np.round(np.array(PARTS) * count).astype(np.int64)), count)
    ends[-1] = count
    return [(order[first:end], order[end:]) for first, end in zip((0, *ends[:-1]), ends, strict=True)]


@kernel()
def add_bits(D: float, weight: float, z: F8, gradient: F8) -> float:
    """The term of the bits, W D^2 / 2 ln((E^2 + D^2) / D^2) of all splats; its gradient is added to another (N, 8)."""
    d2, total = D * D, 0.0
    for i in range(len(z)):
        e2 = squared_energy(z[i])
        for k in range(5, 8):
            gradient[i, k] += weight * d2 / (e2 + d2) * z[i, k]
        total += log_kernel((e2 + d2) / d2)
    return total * (0.5 * weight * d2)
