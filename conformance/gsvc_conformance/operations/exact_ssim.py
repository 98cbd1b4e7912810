"""MS-SSIM of two frames, rounded once: (11-6) and (11-7) by `expansions`."""

from fractions import Fraction
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.exact.distinct import distinct
from gsvc_base.exact.expansions import Expansion, exact, joined, rational, settled
from gsvc_base.rendering.definition import added
from gsvc_conformance.elementary import exp, power

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

SCALE_WEIGHTS: Final = tuple(Fraction(text) for text in ("0.0448", "0.2856", "0.3001", "0.2363", "0.1333"))
TAPS: Final = 11
VARIANCE: Final = Fraction("2.25")
"""Variance of the window, in samples squared."""


def ms_ssim_and_condition(a: NDArray[np.unsignedinteger], b: NDArray[np.unsignedinteger], peak: int) -> tuple[F8, F8]:
    """MS-SSIM of two frames, rounded once, and its condition, both () f8: the means over the channels."""
    planes = [np.moveaxis(frame, -1, 0).astype(np.float64) for frame in (a, b)]
    first, inverse, _ = distinct(*planes)
    conditions: list[F8] = []

    def evaluate(most: int, _: I8) -> tuple[Expansion]:
        channels = [_of_channels(planes[0][c], planes[1][c], peak, most) for c in first]
        conditions[:] = [condition for _, condition in channels]
        similarities = joined(*(similarity.reshape(1) for similarity, _ in channels))
        return ((similarities[inverse].total() / exact(3.0)).reshape(1),)

    (similarity,) = settled(evaluate, 1)
    return np.asarray(similarity[0]), np.asarray(added(np.array(conditions)[inverse]) / 3)


def _of_channels(x: F8, y: F8, peak: int, most: int) -> tuple[Expansion, F8]:
    """MS-SSIM of two channels (H, W) f8, and its condition."""
    side, scales = min(x.shape), 1
    while scales < len(SCALE_WEIGHTS) and (side := -(-side // 2)) >= TAPS:
        scales += 1
    product, relative = exact(1.0, most), np.zeros(())
    for scale in range(scales):
        if scale:
            x, y = _halved(x), _halved(y)
        weight = SCALE_WEIGHTS[scale] / sum(SCALE_WEIGHTS[:scales])
        luminance, structure, condition = _similarities(x, y, peak, most)
        places = (luminance * structure if scale == scales - 1 else structure).reshape(-1)
        factor = places.total() / exact(float(places.shape[0]))
        if not factor.sign() > 0:  # one of independent samples is never so close to 0 that this is open
            return exact(0.0, most), np.zeros(())
        product = product * power(factor, rational(weight, most))
        relative = relative + float(weight) * added(condition) / condition.size / factor.near
    return product, np.asarray(relative * product.near)


def _similarities(x: F8, y: F8, peak: int, most: int) -> tuple[Expansion, Expansion, F8]:
    """The terms l and cs of all places of the window, and the condition of cs."""
    c1, c2 = (rational((Fraction(share, 100) * peak) ** 2, most) for share in (1, 3))
    mean_x, mean_y = _windowed(x, most), _windowed(y, most)
    of_squares, of_products = _windowed(x * x + y * y, most), _windowed(x * y, most)
    squares, products = mean_x * mean_x + mean_y * mean_y, mean_x * mean_y
    variances = of_squares - squares + c2
    luminance = (products.scaled(1) + c1) / (squares + c1)
    structure = ((of_products - products).scaled(1) + c2) / variances
    return luminance, structure, of_squares.near / variances.near


def _windowed(plane: F8, most: int) -> Expansion:
    """The means under the window (rows, columns) of a plane (H, W), whose numbers have few bits: axis by axis."""
    columns = _along_rows(exact(plane, most), most)
    both = _along_rows(Expansion(columns.parts.swapaxes(1, 2), columns.radius.T, most), most)
    return Expansion(both.parts.swapaxes(1, 2), both.radius.T, most)


def _along_rows(plane: Expansion, most: int) -> Expansion:
    """The means under the window along the first axis; taps at equal distance from the middle are equal."""
    size = plane.shape[0]
    window = _window(min(TAPS, size), most)
    count, places = window.shape[0], size - window.shape[0] + 1
    terms = [plane[t : t + places] + plane[count - 1 - t : count - 1 - t + places] for t in range(count // 2)]
    if count % 2:
        terms.append(plane[count // 2 : count // 2 + places])
    return joined(*((term * window[t])[None] for t, term in enumerate(terms))).total()


@cache
def _window(taps: int, most: int) -> Expansion:
    """The taps of the window, which add up to 1."""
    offsets = [Fraction(2 * i - taps + 1, 2) for i in range(taps)]
    weights = exp(joined(*(rational(-(o**2) / (2 * VARIANCE), most).reshape(1) for o in offsets)))
    return weights / weights.total()


def _halved(plane: F8) -> F8:
    """The means of 2 x 2 samples, without an error; the last row or column of an odd size counts twice."""
    rows, columns = (np.minimum(np.arange(size + size % 2), size - 1) for size in plane.shape)
    even = plane[np.ix_(rows, columns)]
    return np.asarray((even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]) / 4)
