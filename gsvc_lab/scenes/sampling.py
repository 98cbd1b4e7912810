"""Smoothing pictures and reading between their pixels: Gaussians and cubic splines of stated sums, alike everywhere.

Beyond its edges a picture is its mirror image, the outermost sample being repeated.
"""

import math
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F8
from gsvc_base.portable import exp

_POLE: Final = math.sqrt(3) - 2
"""Pole of the recursive filters that find the coefficients of a cubic spline."""
_POWERS: Final = 30
"""The powers of the pole beyond are less than a unit in the last place."""
_AT_ONCE: Final = 1 << 16  # places that are read together: what belongs to them stays in the cache
_SUMS_AT_ONCE: Final = 1 << 14  # sums of neighbours that grow together, for the same reason


def gaussian(deviation: float, reach: int) -> F8:
    """(2 reach + 1,) f8, exp(-d^2 / 2 deviation^2) at whole distances d."""
    half = exp([-(d * d) / (2 * deviation * deviation) for d in range(reach + 1)])
    return np.concatenate([half[:0:-1], half])


def smoothed(samples: NDArray[Any], deviation: float) -> F8:
    """Samples (H, W, ...) low-passed along rows and columns by a Gaussian that ends at four deviations, f8."""
    reach = int(4 * deviation + 0.5)
    taps = gaussian(deviation, reach)
    taps = taps / math.fsum(taps)
    return correlated(correlated(samples, taps, 0, "symmetric"), taps, 1, "symmetric")


def correlated(samples: NDArray[Any], taps: F8, axis: int, beyond: Literal["symmetric", "wrap"]) -> F8:
    """The sum of neighbours along an axis, each times its tap, from the first to the last: f8 of the same shape."""
    reach = len(taps) // 2
    widths = [(reach, reach) if dimension == axis else (0, 0) for dimension in range(samples.ndim)]
    padded = np.pad(samples.astype(np.float64), widths, mode=beyond)
    lines = np.ascontiguousarray(np.moveaxis(padded, axis, 0))
    total = np.zeros((samples.shape[axis], *lines.shape[1:]))
    some = max(1, _SUMS_AT_ONCE // max(1, lines[0].size))
    for begin in range(0, len(total), some):
        sums = total[begin : begin + some]
        product = np.empty_like(sums)
        for k, tap in enumerate(taps, begin):
            np.multiply(lines[k : k + len(sums)], tap, out=product)
            sums += product
    return np.moveaxis(total, 0, axis)


def spline_coefficients(samples: NDArray[Any]) -> F8:
    """The coefficients of the cubic splines through samples (H, W, ...), f8 of the same shape."""
    lines = samples.astype(np.float64)
    for axis in (0, 1):
        lines = np.moveaxis(_filtered(np.moveaxis(lines, axis, 0)), 0, axis)
    return np.ascontiguousarray(lines)


def _filtered(lines: F8) -> F8:
    """The recursive filters there and back along the first axis, on a new array."""
    count = len(lines)
    mirrored = [k % (2 * count) for k in range(_POWERS)]
    values = 6 * lines
    first, power = values[0].copy(), 1.0
    for k in mirrored:  # sample -1 - k is sample k
        power *= _POLE
        first += power * values[min(k, 2 * count - 1 - k)]
    values[0] = first
    for k in range(1, count):
        values[k] += _POLE * values[k - 1]
    values[-1] *= _POLE / (_POLE - 1)
    for k in range(count - 2, -1, -1):
        values[k] = _POLE * (values[k + 1] - values[k])
    return values


def read_grid(coefficients: F8, rows: F8, columns: F8) -> F8:
    """The values of cubic splines where each of some rows meets each of some columns.

    `coefficients`: (P, Q, ...) f8, as `spline_coefficients` finds them. `rows` and `columns`: (H,) and (W,) f8, counted
    from the first coefficient. Returns (H, W, ...) f8.
    """
    some = np.zeros((len(rows), *coefficients.shape[1:]))
    for index, weight in _taps(rows, coefficients.shape[0]):
        some += _times(weight, coefficients.ndim - 1) * coefficients[index]
    values = np.zeros((len(rows), len(columns), *coefficients.shape[2:]))
    for index, weight in _taps(columns, coefficients.shape[1]):
        values += some[:, index] * _times(weight, coefficients.ndim - 2)
    return values


def read_at(coefficients: F8, rows: F8, columns: F8) -> F8:
    """The values of cubic splines at any places: as `read_grid`, but (...) f8 rows and columns of the same shape."""
    flat_rows, flat_columns = rows.ravel(), columns.ravel()
    values = np.zeros((flat_rows.size, *coefficients.shape[2:]))
    for begin in range(0, flat_rows.size, _AT_ONCE):
        some = slice(begin, begin + _AT_ONCE)
        across = _taps(flat_columns[some], coefficients.shape[1])
        for row, weight in _taps(flat_rows[some], coefficients.shape[0]):
            line = np.zeros_like(values[some])
            for column, part in across:
                line += coefficients[row, column] * _times(part, coefficients.ndim - 2)
            values[some] += _times(weight, coefficients.ndim - 2) * line
    return values.reshape(*rows.shape, *coefficients.shape[2:])


def _times(weights: F8, more: int) -> F8:
    """Weights (N,) as a factor of arrays (N, ...) with this number of further dimensions."""
    return weights.reshape(-1, *[1] * more)


def _taps(places: F8, size: int) -> list[tuple[NDArray[np.intp], F8]]:
    """The four coefficients that make the spline's value at each place, and their weights."""
    first = np.floor(places)
    t = places - first
    s = 1 - t
    weights = (s * s * s / 6, (4 - 6 * t * t + 3 * t * t * t) / 6, (4 - 6 * s * s + 3 * s * s * s) / 6, t * t * t / 6)
    mirrored = [(first.astype(np.intp) + shift) % (2 * size) for shift in (-1, 0, 1, 2)]
    return [(np.minimum(at, 2 * size - 1 - at), weight) for at, weight in zip(mirrored, weights, strict=True)]
