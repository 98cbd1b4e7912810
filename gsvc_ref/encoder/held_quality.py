"""Constant quality: searches for the cheapest frame that reaches a PSNR, in both profiles."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final, Protocol, TypeVar

import numpy as np

from gsvc_base.portable import log2, power
from gsvc_base.splats import F4
from gsvc_ref.main.tables import QUANTIZERS

ENOUGH: Final = 0.1
"""A frame at most this many dB above the goal is not made coarser."""

I_TRIES, MAX_TRIES = 5, 10
"""Maximum number of tries for an I-frame, once one has reached the goal and as long as none has."""

FIRST_DB, MIN_DB, MAX_DB = 4.5, 2.0, 12.0
"""First guess of what twice the splats gain in an I-frame, in dB, and limits of later ones."""

MAX_COUNT_DOUBLINGS: Final = 3.0
"""By how much the number of splats changes at most between two tries."""

SCALE_TRIES: Final = 5
"""The most thresholds of what a change must be worth that are tried for a P-frame."""

MAX_WORTH_OCTAVES: Final = 16.0
"""No change is worth 2 to this power times as much as the settings ask of it."""

MAX_DROP: Final = 1.0
"""Where I-frames miss the goal, a P-frame may be this many dB below the last I-frame."""

DB_PER_STEP: Final = 0.4
"""First guess of the PSNR in dB that a frame loses by a D an eighth of an octave coarser."""

BEST: Final = 100.0
"""Stands for the PSNR of frames that are better, such as those equal to their source."""


class Judged(Protocol):
    """What is tried: its decoded frame has a PSNR in dB."""

    @property
    def psnr(self) -> float:
        """PSNR of the decoded frame in dB."""
        ...


JudgedT = TypeVar("JudgedT", bound=Judged)


class Coded(Judged, Protocol):
    """What is tried with several steps D: it has a number of bits as well."""

    @property
    def bits(self) -> float:
        """Bits of the frame."""
        ...


CodedT = TypeVar("CodedT", bound=Coded)


def search_splat_count(
    make: Callable[[int], JudgedT],  # makes a frame of a number of splats
    first: int,  # the number tried first
    most: int,  # the largest number allowed
    goal: float,  # PSNR in dB
) -> tuple[int, JudgedT]:
    """The frame with the fewest splats, of the numbers that are tried, that reaches a PSNR; otherwise the best.

    The next number follows from the last two by a line over its logarithm. The search ends with at most ENOUGH above
    the PSNR, or after I_TRIES, later if none reaches it. Returns the number asked for, and what `make` made of it.
    """
    tried: dict[int, JudgedT] = {}
    number, last, slope = first, first, FIRST_DB
    for attempt in range(MAX_TRIES):
        made = tried[number] = make(number)
        excess = made.psnr - goal
        if 0 <= excess <= ENOUGH:
            break
        enough = min((n for n, found in tried.items() if found.psnr >= goal), default=most + 1)
        short = max((n for n, found in tried.items() if found.psnr < goal and n < enough), default=0)
        if len(tried) > 1:
            low, high = (short, enough) if short and enough <= most else sorted((number, last))
            rise = (min(tried[high].psnr, BEST) - min(tried[low].psnr, BEST)) / float(log2(high / low))
            slope = min(max(rise, MIN_DB), MAX_DB)
        doublings = min(max((ENOUGH / 2 - excess) / slope, -MAX_COUNT_DOUBLINGS), MAX_COUNT_DOUBLINGS)
        following = min(max(round(number * float(power(2.0, doublings))), short + 1), enough - 1)
        if following in tried or not 1 <= following <= most or (attempt >= I_TRIES - 1 and enough <= most):
            break
        last = number
        number = following
    reaching = [n for n, found in tried.items() if found.psnr >= goal]
    number = min(reaching) if reaching else max(tried, key=lambda n: tried[n].psnr)
    return number, tried[number]


def search_removals(
    make: Callable[[int], JudgedT],  # makes the frame without 1 to count - 1 of its splats
    whole: JudgedT,  # the frame with all of them
    count: int,
    goal: float,  # PSNR in dB
) -> JudgedT:
    """The frame without as many of its `count` splats as it can spare for a PSNR that it has, found by bisection."""
    best, spared, needed = whole, 0, count
    while needed - spared > 1:
        fewer = (spared + needed) // 2
        made = make(fewer)
        if made.psnr >= goal:
            best, spared = made, fewer
        else:
            needed = fewer
    return best


def search_threshold(
    make: Callable[[float], JudgedT],  # makes the frame in which a change must be worth this many times as much
    frame: JudgedT,
    goal: float,  # PSNR in dB
) -> JudgedT:
    """The frame with the fewest changes, of those that are tried, that reaches a PSNR; one that misses it stays."""
    if frame.psnr < goal:
        return frame
    best, low, high, step = frame, 0.0, math.inf, 1.0  # octaves of the factor
    for _ in range(SCALE_TRIES):
        if best.psnr - goal <= ENOUGH or low == MAX_WORTH_OCTAVES:
            break
        at = min(low + step, MAX_WORTH_OCTAVES) if math.isinf(high) else (low + high) / 2
        made = make(float(power(2.0, at)))
        if made.psnr >= goal:
            low, step = at, 2 * step
            best = made if made.psnr <= best.psnr else best
        else:
            high = at
    return best


def is_missed(psnr: float, goal: float, intra_psnr: float) -> bool:
    """Whether a P-frame misses a goal so that an I-frame, of which the last one had `intra_psnr`, takes its place."""
    return psnr < (goal if intra_psnr >= goal else intra_psnr - MAX_DROP)


def search_quantizer(
    make: Callable[[int], CodedT],  # makes a frame with a quantizer, 0..79
    first: int,  # the quantizer tried first
    goal: float,  # PSNR in dB
    tries: int,  # at most
    most_bits: float = math.inf,  # while no frame reaches the goal, one with more bits than this ends the search
    tried: Mapping[int, CodedT] = MappingProxyType({}),  # frames by their quantizer
) -> CodedT:
    """The frame with the coarsest step D, of those that are tried, that reaches a PSNR; otherwise the best.

    The search ends with at most ENOUGH above the PSNR.
    """
    found, quantizer, leap = dict(tried), first, 1
    for _ in range(tries):
        if quantizer in found or not 0 <= quantizer < QUANTIZERS:
            break
        coded = found[quantizer] = make(quantizer)
        if 0 <= coded.psnr - goal <= ENOUGH:
            break
        fine = max((q for q, one in found.items() if one.psnr >= goal), default=-1)
        coarse = min((q for q, one in found.items() if one.psnr < goal and q > fine), default=QUANTIZERS)
        low, high = min(found), max(found)
        slope = DB_PER_STEP
        if low < high:
            slope = max((found[low].psnr - found[high].psnr) / (high - low), DB_PER_STEP / 4)
        steps = round((coded.psnr - goal) / slope)
        if fine < 0:  # a finer D gains little until new splats are worth their bits
            if coded.bits > most_bits:
                break
            leap *= 2
            steps = min(steps, -leap)
        quantizer = min(max(quantizer + steps, fine + 1), coarse - 1)
    reaching = [q for q, one in found.items() if one.psnr >= goal]
    return found[max(reaching)] if reaching else max(found.values(), key=lambda one: one.psnr)


def visibility(parameters: F4) -> F4:
    """The squared error that removing each splat adds at a minimum of the loss, up to a constant factor, (N,) f4.

    Removing c' g from the picture adds -2 <e, c' g> + |c' g|^2; the first term is zero where dL/dc' is, and the second,
    summed over all pixels, is |c'|^2 pi l11 l22.
    """
    strength = np.square(parameters[:, 5:8]).sum(axis=1)
    area = np.maximum(parameters[:, 2], 0) * np.maximum(parameters[:, 4], 0)
    return np.asarray(strength * area, np.float32)
