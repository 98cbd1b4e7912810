"""Sums of splats that are degenerate, thin, small, large or far away (spec.md sections 9.1 and 9.2)."""

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.splat_sets import COLOR, population, splat, splats

SMALLEST = 2.0**-126


DEGENERATE = {
    "l11_zero": (0.0, 3.0),
    "l22_zero": (3.0, 0.0),
    "l11_negative": (-3.0, 3.0),
    "l22_negative": (3.0, -3.0),
    "both_negative": (-3.0, -3.0),
    "l11_subnormal": (5.88e-39, 3.0),
    "l22_subnormal": (3.0, 5.88e-39),
    "l11_one_step_below": (float(np.nextafter(np.float32(SMALLEST), np.float32(0))), 3.0),
    "l22_one_step_below": (3.0, float(np.nextafter(np.float32(SMALLEST), np.float32(0)))),
    "l22_minus_zero": (3.0, -0.0),
}
WHY_DEGENERATE = {
    **{key: key.replace("_", " is ", 1) for key in DEGENERATE},
    "both_negative": "l11 and l22 are negative",
    "l11_one_step_below": "l11 is one step below 2^-126",
    "l22_one_step_below": "l22 is one step below 2^-126",
    "l22_minus_zero": "l22 is minus zero",
}
"""Words for them in titles."""


@case("core", "render_sum", flags=["degenerate"], rules=["R-9.1-2"], each=DEGENERATE, said=WHY_DEGENERATE)
def degenerate(value: tuple[float, float]) -> Inputs:
    """A degenerate splat on a pixel centre: {key}, and so it covers nothing.

    The test is against 2^-126: a comparison with zero draws subnormal factors, where u is 0 at the centre.
    """
    expected = yield {"parameters": splat(4.5, 3.5, value[0], 0.0, value[1]), "width": 9, "height": 7}
    assert not expected["sum"].value.any()
    assert not expected["sum"].bound.any()


@case("core", "render_sum", flags=["degenerate"], rules=["R-9.1-2"])
def degenerate_among_others(rng: Draws) -> Inputs:
    """Every other splat is degenerate: the others keep their own parameters."""
    parameters = population(rng, 22, 17, 13)
    parameters[::2, 2:5:2] *= np.array([[-1, 1], [0, 1]] * 5 + [[1, -1]], np.float32)
    expected = yield {"parameters": parameters, "width": 17, "height": 13}
    assert np.count_nonzero(np.any(parameters[:, [2, 4]] <= 0, axis=1)) == 11
    assert expected["sum"].value.any()


@case("core", "render_sum", flags=["many"])
def smaller_than_a_pixel() -> Inputs:
    """Splats between pixel centres, seen by one pixel, by four, or by none."""
    rows = [
        splat(2.53, 2.46, 0.2, 0.1, 0.15),
        splat(6.0, 2.0, 0.3, 0.0, 0.3),
        splat(9.0, 3.0, 0.125, 0.0, 0.125, (9, 9, 9)),
        splat(2.8, 6.2, 0.35, 0.1, 0.3),
        splat(7.5, 6.5, 0.01, 0.0, 0.01),
    ]
    expected = yield {"parameters": splats(*rows), "width": 11, "height": 9}
    C = expected["sum"].value[..., 0]
    assert np.argwhere(C[:5]).tolist() == [[1, 5], [1, 6], [2, 2], [2, 5], [2, 6]]
    assert C[6, 7] == COLOR[0]


NEEDLES = {
    "across": (4.0, 0.0, 4e-4),
    "down": (4e-4, 0.0, 4.0),
    "slope_1": (4.0, 4.0, 8e-4),
    "slope_minus_half": (4.0, -2.0, 4e-4),
    "slope_2": (2.0, 4.0, 8e-4),
    "slope_third": (6.0, 2.0, 6e-4),
}
SLOPES = {
    "slope_1": "of slope 1",
    "slope_minus_half": "of slope -1/2",
    "slope_2": "of slope 2",
    "slope_third": "of slope 1/3",
}
SLOPES |= {"across": "horizontally", "down": "vertically"}
"""Words for them in titles."""


@case("core", "render_sum", flags=["needle", "cancellation", "shear"], each=NEEDLES, said=SLOPES)
def needle(value: tuple[float, float, float]) -> Inputs:
    """A splat ten thousand times longer than it is thick, {key} through pixel centres.

    Its inverse covariance, or a determinant that is a difference, loses it in binary32.
    """
    l11, l21, l22 = value
    expected = yield {"parameters": splat(12.5, 11.5, l11, l21, l22), "width": 25, "height": 23}
    assert np.count_nonzero(expected["sum"].value[..., 0]) >= 9
    assert np.linalg.cond([[l11, 0], [l21, l22]]) > 5000


@case("core", "render_sum", flags=["needle", "cancellation"])
def a_determinant_that_cancels() -> Inputs:
    """L = (1, 50, 0.01), whose determinant as a c - b b is zero in binary32: it is drawn all the same."""
    l11, l21, l22 = np.array([1, 50, 0.01], np.float32)
    expected = yield {"parameters": splat(10.5, 9.5, l11, l21, l22), "width": 21, "height": 19}
    assert (l11 * l11) * (l21 * l21 + l22 * l22) - (l11 * l21) * (l11 * l21) == 0
    assert expected["sum"].value[9, 10].tolist() == list(COLOR)


LARGE = {
    "wide": (6.0, 4.0, 1000.0, -300.0, 800.0),
    "centre_far_outside": (-5000.0, 3000.0, 4000.0, -1000.0, 2500.0),
    "a_thin_line": (5.5, 4.5, 3000.0, 1500.0, 0.3),
}
HOW_LARGE = {"wide": "in both directions", "centre_far_outside": "its centre far outside"}
"""Words for them in titles."""


@case("core", "render_sum", flags=["support", "needle"], each=LARGE, said=HOW_LARGE)
def larger_than_the_frame(value: tuple[float, float, float, float, float]) -> Inputs:
    """A splat much larger than the frame, {key}."""
    expected = yield {"parameters": splat(*value), "width": 17, "height": 13}
    assert np.count_nonzero(expected["sum"].value[..., 0]) >= 20


EXTREME = {
    "far_away": (3e9, -2e12, 4.0, 1.0, 4.0),
    "further_than_any_integer": (1e38, -3e38, 5.0, 0.0, 5.0),
    "larger_than_any_integer": (10.0, 7.0, 1e30, 0.0, 1e32),
    "largest_factors": (10.0, 7.0, 3e38, -3e38, 3e38),
    "smallest_factors_on_a_centre": (5.5, 4.5, SMALLEST, 0.0, SMALLEST),
    "smallest_factors_off_the_centres": (5.25, 4.75, SMALLEST, 0.0, SMALLEST),
    "a_vertical_line": (5.5, 4.0, 1e-20, 5.0, 3.0),
    "a_horizontal_line": (5.0, 4.5, 4.0, 0.0, 1e-30),
    "minus_zero": (-0.0, -0.0, 3.0, -0.0, 3.0),
    "steep": (5.5, 4.5, 1.0, 1e30, 1.0),
}
WHAT_IS_EXTREME = {
    "far_away": "A splat is far away",
    "further_than_any_integer": "A splat is further away than any integer",
    "larger_than_any_integer": "A splat is larger than any integer",
    "largest_factors": "The factors are the largest",
    "smallest_factors_on_a_centre": "The factors are the smallest, on a pixel centre",
    "smallest_factors_off_the_centres": "The factors are the smallest, off the pixel centres",
    "a_vertical_line": "A splat is a vertical line",
    "a_horizontal_line": "A splat is a horizontal line",
    "minus_zero": "The centre and l21 are minus zero",
    "steep": "l21 is 1e30",
}
"""Words for them in titles."""


@case("stress", "render_sum", flags=["overflow", "degenerate"], rules=["R-9.1-2"], each=EXTREME, said=WHAT_IS_EXTREME)
def extreme(value: tuple[float, float, float, float, float]) -> Inputs:
    """{key}: the sum is finite, and right where it can be."""
    expected = yield {"parameters": splat(*value), "width": 11, "height": 9}
    assert np.isfinite(expected["sum"].value).all()
    assert np.isfinite(expected["sum"].bound).all()


@case("stress", "render_sum", flags=["overflow", "subnormal"], each={"huge": 1e30, "subnormal": 1e-39},
      said={"huge": "1e30", "subnormal": "1e-39, which is subnormal"})  # fmt: skip
def colours_of_another_order(value: float) -> Inputs:
    """Colours of the order of {key}: the bound goes with them."""
    color = (value, -value, value / 3)
    expected = yield {"parameters": splat(5.2, 4.4, 1.5, 0.6, 1.25, color), "width": 11, "height": 9}
    assert expected["sum"].bound.max() < 1e-5 * value + 1e-36


INFINITE = tuple(splat(4.5, 2.5, *factors) for factors in ((np.inf, 0, 1.5), (1.5, 0, np.inf), (np.inf, 1, np.inf)))
"""Splats with an infinite l11, l22, or both, as (9-8) may make them."""


@case("stress", "render_sum", flags=["degenerate", "overflow"], rules=["R-9.1-2"])
@case("stress", "render_sum_deterministic", flags=["degenerate", "overflow"], rules=["R-9.1-2"])
def infinite_factors() -> Inputs:
    """Splats whose l11 or l22 is infinite, or both, are degenerate, though u would be zero; one beside is drawn."""
    ordinary = splat(4.3, 2.2, 1.5, 0.5, 1.25)
    expected = yield {"parameters": splats(*INFINITE, ordinary), "width": 9, "height": 5}
    assert np.isfinite(expected["sum"].value).all()
    assert 0 < expected["sum"].value[2, 4, 0] < COLOR[0]
