"""Constant quality: searches for the cheapest frame that reaches a PSNR, in both profiles."""

from collections.abc import Callable
from typing import Final, Protocol, TypeVar

from gsvc_ref.portable import log2, power

ENOUGH: Final = 0.1
"""A frame with at most so many dB more than asked for is not made coarser."""

I_TRIES: Final = 5
"""The most numbers of splats that are tried for an I-frame."""

DB_PER_DOUBLING, LEAST_SLOPE, MOST_SLOPE = 4.5, 2.0, 12.0
"""First guess of what twice the splats gain in an I-frame, in dB, and limits of later ones."""

MOST_DOUBLINGS: Final = 3.0
"""By how much the number of splats changes at most between two tries."""


class Judged(Protocol):
    """What is tried: its decoded frame has a PSNR in dB."""

    @property
    def psnr(self) -> float:
        """PSNR of the decoded frame in dB."""
        ...


JudgedT = TypeVar("JudgedT", bound=Judged)


def fewest_splats(make: Callable[[int], JudgedT], first: int, most: int, goal: float) -> tuple[int, JudgedT]:
    """The frame with the fewest splats, of the numbers that are tried, that reaches a PSNR; otherwise the best.

    The number follows from the last two by a line over its logarithm.

    Parameters
    ----------
    make
        Makes a frame of a number of splats.
    first, most
        The number that is tried first, and the largest allowed.
    goal
        PSNR in dB. The search ends with at most ENOUGH above it, or after I_TRIES.

    Returns
    -------
    number
        The number of splats asked for.
    frame
        What `make` made of it.
    """
    tried: dict[int, JudgedT] = {}
    number, slope = first, DB_PER_DOUBLING
    for _ in range(I_TRIES):
        made = tried[number] = make(number)
        excess = made.psnr - goal
        if 0 <= excess <= ENOUGH:
            break
        enough = min((n for n, found in tried.items() if found.psnr >= goal), default=most + 1)
        short = max((n for n, found in tried.items() if found.psnr < goal and n < enough), default=0)
        doublings = min(max((ENOUGH / 2 - excess) / slope, -MOST_DOUBLINGS), MOST_DOUBLINGS)
        following = min(max(round(number * float(power(2.0, doublings))), short + 1), enough - 1)
        if following in tried or not 1 <= following <= most:
            break
        if short and enough <= most:
            rise = tried[enough].psnr - tried[short].psnr
            slope = min(max(rise / float(log2(enough / short)), LEAST_SLOPE), MOST_SLOPE)
        number = following
    reaching = [n for n, found in tried.items() if found.psnr >= goal]
    number = min(reaching) if reaching else max(tried, key=lambda n: tried[n].psnr)
    return number, tried[number]


def most_spared(make: Callable[[int], JudgedT], whole: JudgedT, count: int, goal: float) -> JudgedT:
    """The frame without as many of its `count` splats as it can spare for a PSNR that it has, found by bisection.

    Parameters
    ----------
    make
        Makes the frame without a number of splats, from 1 to `count` - 1.
    whole
        The frame with all of them.
    count
        Their number.
    goal
        PSNR in dB.
    """
    best, spared, needed = whole, 0, count
    while needed - spared > 1:
        fewer = (spared + needed) // 2
        made = make(fewer)
        if made.psnr >= goal:
            best, spared = made, fewer
        else:
            needed = fewer
    return best
