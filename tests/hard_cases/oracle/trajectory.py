"""Training of one number over very many steps: in 60 digits, and how far binary32 may come off on the way.

`decimal` in place of mpmath: as precise, and ten times faster over a hundred thousand steps.
"""

from collections.abc import Iterator
from decimal import Decimal, localcontext
from math import sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.training.adan import AdanSettings

F4 = NDArray[np.float32]

DIGITS: Final = 60
U: Final = 2.0**-24
"""Error of an operation of binary32 to nearest, relative."""
ETA: Final = 2.0**-149
"""Error of an operation that underflows, absolute."""


def parameter(gradients: F4, rate: float, settings: AdanSettings) -> Decimal:
    """Where a number that begins at 0 is after a step of Adan for each gradient, by (10-13) and (10-14)."""
    with localcontext(prec=DIGITS):
        b1, b2, b3 = (Decimal(b) for b in (settings.beta1, settings.beta2, settings.beta3))
        epsilon, step = Decimal(settings.epsilon), Decimal(rate)
        theta = m = v = n = Decimal(0)
        p1 = p2 = p3 = Decimal(1)
        p: Decimal | None = None
        for number in gradients.tolist():
            g = Decimal(number)
            d = Decimal(0) if p is None else g - p
            m, v = b1 * m + (1 - b1) * g, b2 * v + (1 - b2) * d
            ahead = g + b2 * d
            n = b3 * n + (1 - b3) * ahead * ahead
            p1, p2, p3 = p1 * b1, p2 * b2, p3 * b3
            theta -= step * (m / (1 - p1) + b2 * v / (1 - p2)) / ((n / (1 - p3)).sqrt() + epsilon)
            p = g
        return theta


class Known(NamedTuple):
    """A number and the error that binary32 may have made in it."""

    value: float
    error: float


def average(b: float, old: Known, new: Known) -> Known:
    """fl(fl(b old) + fl((1 - b) new)), b and 1 - b rounded once."""
    kept, added = b * old.value, (1 - b) * new.value
    error = (1 + 4 * U) * (b * old.error + (1 - b) * new.error) + 3 * U * (abs(kept) + abs(added)) + 3 * ETA
    return Known(kept + added, error)


def errors(gradients: F4, rate: float, settings: AdanSettings) -> Iterator[Known]:
    """The parameter after each step, by running error analysis of `adan_step_plain`."""
    b1, b2, b3 = settings.beta1, settings.beta2, settings.beta3
    m = v = n = theta = Known(0.0, 0.0)
    p = float(gradients[0])
    p1 = p2 = p3 = 1.0
    for g in gradients.tolist():
        d = Known(g - p, U * abs(g - p))
        m, v = average(b1, m, Known(g, 0.0)), average(b2, v, d)
        ahead = g + b2 * d.value
        of_ahead = b2 * d.error + 2 * U * abs(b2 * d.value) + U * abs(ahead) + ETA
        n = average(b3, n, Known(ahead * ahead, (2 * abs(ahead) + of_ahead) * of_ahead + U * ahead * ahead + ETA))
        p1, p2, p3 = p1 * b1, p2 * b2, p3 * b3
        over_m, over_v, over_n = 1 / (1 - p1), b2 / (1 - p2), 1 / sqrt(1 - p3)
        above = over_m * m.value + over_v * v.value
        magnitude = abs(over_m * m.value) + abs(over_v * v.value)
        of_above = over_m * m.error + over_v * v.error + 3 * U * magnitude + ETA
        root = sqrt(n.value)
        of_root = max(sqrt(n.value + n.error) - root, root - sqrt(max(n.value - n.error, 0.0)))
        below = over_n * root + settings.epsilon
        of_below = over_n * of_root + 4 * U * below
        update = above / below
        of_update = (of_above + abs(update) * of_below) / (below - of_below) + U * abs(update) + ETA
        moved = theta.value - rate * update
        theta = Known(moved, theta.error + rate * (of_update + U * abs(update)) + U * (abs(moved) + theta.error))
        yield theta
        p = g
