"""Rendering: sums, frames, gradients and other sizes (spec.md sections 9 and 10.3)."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import frame_type
from gsvc_base.constants import LN_255, SMALLEST_NORMAL
from gsvc_base.exact.distinct import distinct
from gsvc_base.exact.expansions import exact
from gsvc_base.exact.running_error import Computed, given, stack, with_bound
from gsvc_base.rendering.bounds import error_footprints, frame_limits
from gsvc_base.rendering.definition import added
from gsvc_base.rendering.error_models import EPS, ETA, ErrorModel
from gsvc_base.splats import Splats
from gsvc_conformance.expectations import Bounded, Decision, Exact, Expectation, Interval
from gsvc_conformance.operation import Values, numbered, paired
from gsvc_conformance.operations.exact_splats import (
    gradient_bounds,
    gradients_with_bound,
    picture_by_model,
    sum_with_bound,
)

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
Expected = Mapping[str, Expectation]

GROUPS: Final = ((0, 2), (2, 5), (5, 8))
"""Columns of gradients that are judged together: positions, Cholesky factors, colours."""

WELL_CONDITIONED: Final = 1e-4
"""Maximum sum of bounds of a group of gradients, relative to them, with which they are judged together."""

MIN_SPLATS: Final = 30
"""Minimum number of splats whose gradients are judged together: errors of random sign need some to cancel."""

SPLATS: Final = "parameters: f4 (N, 8); width: int; height: int"


def _bounded_sum(parameters: F4, width: int, height: int) -> dict[str, Expectation]:
    """(9-2), exact, and the error bound of section 9.2; colours must not leave binary32 in any partial sum."""
    return {"sum": Bounded(*sum_with_bound(parameters, width, height))}


def _sum_by_model(model: ErrorModel, expected: Expected, inputs: Values) -> Expected:
    """The same value, and its bound by another error model."""
    return {"sum": _bounded_anew(expected["sum"], picture_by_model(model, **inputs)[1])}


def _bounded_anew(expected: Expectation, bound: F8) -> Bounded:
    """An expectation with another bound; the limits of groups are those of fp32/1."""
    if not isinstance(expected, Bounded):
        raise TypeError(f"a bound for {expected.check}")
    return Bounded(expected.value, bound, expected.dtype, may_overflow=True)


paired(
    "render_sum",
    "rendering",
    "The sum of the splats over a frame, before the clamp, within the error bound of binary32.",
    inputs=SPLATS,
    outputs="sum: f4 (H, W, 3)",
    equations=("9-1", "9-2", *numbered(13, 1, 11)),
    rules=("R-9.1-4", "R-9.2-1"),
    oracle=_bounded_sum,
    by_model=_sum_by_model,
)


def _plain_sum(parameters: F4, width: int, height: int) -> dict[str, Expectation]:
    """Every operation of section 9.3 by NumPy, which rounds each on its own."""
    from gsvc_ref.rendering.deterministic import sum_plain

    return {"sum": Exact(sum_plain(Splats.from_array(parameters), width, height))}


paired(
    "render_sum_deterministic",
    "deterministic",
    "The sum of the splats over a frame, before the clamp, with the stated operations in the stated order.",
    inputs=SPLATS,
    outputs="sum: f4 (H, W, 3)",
    equations=("9-3", "9-4", "9-5", "9-6"),
    rules=("R-9.1-4", "R-9.3-1"),
    oracle=_plain_sum,
)


def _rounded(sum: F4, bit_depth: int) -> dict[str, Expectation]:
    """R-9.1-1 in binary64, where the product p has no error.

    A product in binary32 may be anything from p (1 - eps) to p (1 + eps), unless p itself is a binary32 number: where
    these two round to different integers, both are legal.
    """
    product = np.clip(sum.astype(np.float64), 0, 1) * (2**bit_depth - 1)  # (H, W, 3) f8
    inexact = product != product.astype(np.float32)
    value, low, high = np.rint(product), np.rint(product * (1 - EPS)), np.rint(product * (1 + EPS))
    other = np.where(inexact, np.where(low != value, low, high), value)
    kind = frame_type(bit_depth)
    margins = abs(product - np.floor(product) - 0.5)[inexact & (other == value)]
    return {
        "frame": Decision(
            value.astype(kind), other.astype(kind), float(margins.min(initial=0.5)), EPS * (2**bit_depth - 1)
        )
    }


paired(
    "to_frame",
    "rendering",
    "Clamp a sum, scale it to the peak and round half to even.",
    inputs="sum: f4 (H, W, 3); bit_depth: int",
    outputs="frame: u1|u2 (H, W, 3)",
    rules=("R-9.1-1",),
    oracle=_rounded,
)


def _rounded_in_binary32(sum: F4, bit_depth: int) -> dict[str, Expectation]:
    """(9-7) operation by operation; a comparison with a NaN fails."""
    v = np.where(sum >= 1, np.float32(1), np.where(sum > 0, sum, np.float32(0)))
    return {"frame": Exact(np.rint(v * np.float32(2**bit_depth - 1)).astype(frame_type(bit_depth)))}


paired(
    "to_frame_deterministic",
    "deterministic",
    "Clamp a sum, scale it to the peak in binary32 and round half to even; what is no number is black.",
    inputs="sum: f4 (H, W, 3); bit_depth: int",
    outputs="frame: u1|u2 (H, W, 3)",
    equations=("9-7",),
    rules=("R-9.1-1", "R-9.3-1"),
    oracle=_rounded_in_binary32,
)


def _frames_of_bounded_sums(parameters: F4, width: int, height: int, bit_depth: int) -> dict[str, Expectation]:
    """R-9.1-1 of the exact sum C, and of all that the bound of section 9.2 allows (`frame_limits`)."""
    C, bound = sum_with_bound(parameters, width, height)
    kind = frame_type(bit_depth)
    value = (exact(np.clip(C, 0, 1)) * exact(float(2**bit_depth - 1))).rint()
    lowest, highest = frame_limits(C, bound, bit_depth)
    return {"frame": Interval(value.astype(kind), lowest.astype(kind), highest.astype(kind))}


def frame_by_model(model: ErrorModel, expected: Expected, inputs: Values) -> Expected:
    """The same frame, and all that the bound by another error model allows."""
    C, bound = picture_by_model(model, inputs["parameters"], inputs["width"], inputs["height"])
    value = np.asarray(expected["frame"].value)
    lowest, highest = frame_limits(C, bound, inputs["bit_depth"])
    return {"frame": Interval(value, lowest.astype(value.dtype), highest.astype(value.dtype))}


paired(
    "render_frame",
    "rendering",
    "The frame of a set of splats: sum, clamp, scale, round.",
    inputs=SPLATS + "; bit_depth: int",
    outputs="frame: u1|u2 (H, W, 3)",
    equations=("9-1", "9-2", *numbered(13, 1, 11), "13-18"),
    rules=("R-9.1-1", "R-9.1-4", "R-9.2-1"),
    oracle=_frames_of_bounded_sums,
    by_model=frame_by_model,
)


def _bounded_gradients(parameters: F4, residual: F4) -> dict[str, Expectation]:
    """The exact derivative of (9-2), its error bounds, and the groups that are judged together.

    The bound b of a gradient adds the errors of D + 30 or more roundings, D the additions a term takes part in, as
    if each were eps = 2^-23 of the sum of magnitudes and all had one sign. To nearest with signs at random, they
    have a root mean square of eps / sqrt(12) each, and together at most b / sqrt(12 (D + 30)) < b / 19. If the b of
    a group have an L2 norm of at most 1e-4 of that of the gradients, the relative L2 error is therefore about 5e-6
    at most, half of what is allowed; over 30 splats or more the signed sum falls by sqrt(30) again, to 1e-6 of the
    L1 norm. (Measured errors are five times below both and more: partial sums rarely reach the sum of magnitudes.)
    Without these conditions, or where a pixel may be covered or not, cancellation or one pixel alone can legally
    exceed the limits.
    """
    gradients, bound = gradients_with_bound(parameters, residual)
    height, width = residual.shape[:2]
    few = parameters[distinct(parameters)[0]]
    clear = bool(np.all(edge_margins(few, width, height) > 1))
    groups = tuple(
        group for group in GROUPS if clear and _together(gradients[:, slice(*group)], bound[:, slice(*group)])
    )
    return {"gradients": Bounded(gradients, bound, groups=groups)}


def _gradients_by_model(model: ErrorModel, expected: Expected, inputs: Values) -> Expected:
    """The same values, and their bounds by another error model."""
    bound = gradient_bounds(model, inputs["parameters"], inputs["residual"])
    return {"gradients": _bounded_anew(expected["gradients"], bound)}


def _together(gradients: F8, bound: F8) -> bool:
    """Whether a group of gradients is conditioned well enough for relative L2 and bias."""
    enough = np.count_nonzero(np.any(gradients != 0, axis=1)) >= MIN_SPLATS
    l1 = added(bound) <= WELL_CONDITIONED * added(abs(gradients))
    l2 = np.sqrt(added(bound * bound)) <= WELL_CONDITIONED * np.sqrt(added(gradients * gradients))
    return bool(enough and l1 and l2)


paired(
    "render_gradients",
    "gradients",
    "The gradient of sum(residual * C) for every parameter of every splat, coverage held fixed.",
    inputs="parameters: f4 (N, 8); residual: f4 (H, W, 3)",
    outputs="gradients: f4 (N, 8)",
    equations=(*numbered(10, 3, 9), *numbered(13, 1, 9), *numbered(13, 12, 16)),
    rules=("R-10.3-1",),
    oracle=_bounded_gradients,
    by_model=_gradients_by_model,
)


paired(
    "scale_parameters",
    "sizes",
    "The splats of a frame for a frame of another size, every factor and product rounded to binary32.",
    inputs="parameters: f4 (N, 8); width: int; height: int; new_width: int; new_height: int",
    outputs="parameters: f4 (N, 8)",
    equations=("9-8",),
    rules=("R-9.4-1",),
)


def _filtered(parameters: F4, width: int, height: int, new_width: int, new_height: int) -> dict[str, Expectation]:
    """(9-9) operation by operation, in the form for binary32; a side that is not made smaller needs nothing."""
    first, inverse, _ = distinct(parameters)
    parameters = parameters[first]
    drawn = np.all(parameters[:, [2, 4]] >= SMALLEST_NORMAL, axis=1)
    rows = np.where(drawn[:, None], parameters, np.float32(1))  # no quotient by 0, of what is not used
    one = given(np.ones(len(rows)))
    sides = [np.full(len(rows), side, np.float64) for side in (width, new_width, height, new_height)]
    a, e = (given(new) / given(old) for old, new in (sides[:2], sides[2:]))
    h_x, h_y = _deviation(*sides[:2]), _deviation(*sides[2:])
    l11, l21, l22 = given(rows[:, 2]) * a, given(rows[:, 3]) * e, given(rows[:, 4]) * e
    m11, m22 = l11, l22
    if new_height < height:
        m22 = _hypotenuse(m22, h_y)
    if new_width < width:
        m11 = _hypotenuse(m11, h_x)
        m22 = _hypotenuse(m22, l21 * (h_x / m11))
    across, down = (one if m is l else l / m for l, m in ((l11, m11), (l22, m22)))
    position = [given(parameters[:, 0]) * a, given(parameters[:, 1]) * e]
    filtered = stack(*position, m11, l21 * across, m22, *(given(rows[:, n]) * (across * down) for n in (5, 6, 7)))
    entries = [given(parameters[:, n]) * factor for n, factor in ((2, a), (3, e), (4, e))]
    unfiltered = stack(*position, *entries, *(given(parameters[:, n]) for n in (5, 6, 7)))
    value, bound = with_bound(filtered.where(np.broadcast_to(drawn, (8, len(rows))), unfiltered))
    bound[np.isnan(bound)] = np.inf  # 0 times infinity: a quotient by what may be 0
    return {"parameters": Bounded(value.T[inverse], bound.T[inverse])}


def _deviation(old: F8, new: F8) -> Computed:
    """The root of v of (9-9) for sides of `old` pixels that get `new`, whose sum and products are rounded."""
    new = np.minimum(old, new)
    return (given(old - new) * given(old + new) / (given(12 * old) * given(old))).sqrt()


def _hypotenuse(p: Computed, q: Computed) -> Computed:
    """The root of p^2 + q^2, p > 0, whose squares would leave the range of binary32."""
    first = p.value >= abs(q.value)
    m, n = p.where(first, q.where(q.value > 0, -q)), q.where(first, p)
    ratio = n / m
    return m * (given(np.ones(len(m.error))) + ratio * ratio).sqrt()


paired(
    "scale_parameters_filtered",
    "sizes",
    "The splats of a frame for a smaller one, filtered by the area of its pixels.",
    inputs="parameters: f4 (N, 8); width: int; height: int; new_width: int; new_height: int",
    outputs="parameters: f4 (N, 8)",
    equations=("9-8", "9-9", "13-17"),
    rules=("R-9.4-3",),
    oracle=_filtered,
)


def edge_margins(parameters: F4, width: int, height: int) -> F8:
    """The distance of each splat's decisions of coverage from their edge, in units of their own rounding error.

    Returns
    -------
    (N,) f8: the least |sigma - ln 255| over its error (`gsvc_base.rendering.bounds`) of any pixel of the frame.
    """
    first, inverse, _ = distinct(parameters)
    margins = np.full(len(first), np.inf)
    for n, _, pixels, errors in error_footprints(parameters[first], width, height):
        error = errors.d_sigma + EPS * LN_255 + ETA
        margins[n] = np.min(abs(pixels.sigma - LN_255) / error)
    return np.asarray(margins[inverse])
