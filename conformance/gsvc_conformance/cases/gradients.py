"""Gradients of the sum for every parameter (spec.md section 10.3)."""

import math

import numpy as np
from numpy.typing import NDArray

from gsvc_base.constants import LN_255, SMALLEST_NORMAL
from gsvc_base.draws import Draws
from gsvc_base.portable import exp
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.rendering import SIZES
from gsvc_conformance.cases.splat_sets import population, splat, splats
from gsvc_conformance.cases.unusual_splats import (
    DEGENERATE,
    HOW_LARGE,
    INFINITE,
    LARGE,
    NEEDLES,
    SLOPES,
    WHAT_IS_EXTREME,
)

F4 = NDArray[np.float32]
ALL_GROUPS = ((0, 2), (2, 5), (5, 8))


def noise(rng: Draws, width: int, height: int) -> F4:
    """A residual without structure: (H, W, 3) f4."""
    return rng.normal(0, 1, (height, width, 3)).astype(np.float32)


def slope(width: int, height: int) -> F4:
    """A residual that is positive and grows to the lower right by the same factors everywhere: (H, W, 3) f4."""
    i, j = np.arange(width), np.arange(height)[:, None]
    return np.asarray(exp(0.15 * i + 0.1 * j)[..., None] / 100 * [1.0, 0.5, 0.75], np.float32)


def hot_pixel(x: int, y: int, width: int, height: int) -> F4:
    """A residual that is zero but for one pixel: (H, W, 3) f4."""
    residual = np.zeros((height, width, 3), np.float32)
    residual[y, x] = 2.0, -1.0, 0.5
    return residual


SINGLE = {
    "round": (10.2, 7.3, 2.5, 0.75, 2.5),
    "leaning": (10.2, 7.3, 2.0, 3.0, 1.5),
    "leaning_back": (10.6, 7.8, 3.0, -2.5, 1.25),
    "wide": (9.7, 7.1, 4.5, 0.5, 1.0),
    "high": (9.7, 7.1, 1.0, -1.0, 3.5),
}


@case("core", "render_gradients", flags=["off-diagonal", "shear", "pixel-centre"], each=SINGLE)
def one_splat(value: tuple[float, float, float, float, float]) -> Inputs:
    """One splat, {key}, with eight gradients that all differ; l21 is not zero.

    Counting the off-diagonal of dL/dSigma = G twice adds 2 G12 l21 to the gradient of l11 and 2 G12 l11 to that of l21,
    where 2 G12 l11 = dL/dl21 - dL/dl22 l21/l22.
    """
    parameters = splat(*value)
    expected = yield {"parameters": parameters, "residual": slope(21, 15)}
    gradient, bound = expected["gradients"].value[0], expected["gradients"].bound[0]
    apart = abs(gradient[:, None] - gradient)[np.triu_indices(8, 1)]
    assert apart.min() > 100 * bound.max()
    l11, l21, l22 = parameters[0, 2:5].astype(np.float64)
    twice = gradient[3] - gradient[4] * l21 / l22
    assert abs(twice) > 100 * bound[3]
    assert abs(twice * l21 / l11) > 100 * bound[2]


@case("core", "render_gradients", flags=["factor", "off-diagonal"], each={"a": (5, 3), "b": (3, 4), "c": (5, 4)})
def one_hot_pixel(value: tuple[int, int]) -> Inputs:
    """A residual of one pixel: every gradient is a single product, and its bound below 3 in 100,000."""
    x, y, l11, l21, l22 = 4.3, 3.7, 0.9, 0.5, 0.7
    expected = yield {"parameters": splat(x, y, l11, l21, l22), "residual": hot_pixel(*value, 9, 7)}
    gradient, bound = expected["gradients"].value[0], expected["gradients"].bound[0]
    L = np.array([[l11, 0], [l21, l22]], np.float32).astype(np.float64)
    d = np.array(value) + 0.5 - np.array([x, y], np.float32).astype(np.float64)
    u = np.linalg.solve(L, d)
    v = np.linalg.solve(L.T, u)
    g = np.exp(-u @ u / 2)
    q = g * (2 * 0.75 + 0.375 + 0.5 * 1.125)
    by_hand = [q * v[0], q * v[1], q * v[0] * u[0], q * v[1] * u[0], q * v[1] * u[1], 2 * g, -g, 0.5 * g]
    np.testing.assert_allclose(gradient, by_hand, rtol=1e-12)
    assert np.all(bound < 3e-5 * abs(gradient))


@case("core", "render_gradients", flags=["empty"])
def no_splats() -> Inputs:
    """No splats, no gradients."""
    expected = yield {"parameters": splats(), "residual": slope(7, 5)}
    assert expected["gradients"].value.shape == (0, 8)


@case("core", "render_gradients", flags=["empty"])
def no_residual(rng: Draws) -> Inputs:
    """A residual of zero."""
    expected = yield {"parameters": population(rng, 7, 13, 11), "residual": np.zeros((11, 13, 3), np.float32)}
    assert not expected["gradients"].value.any()
    assert expected["gradients"].bound.max() < 1e-30


@case("core", "render_gradients", flags=["support"])
def outside_of_the_frame() -> Inputs:
    """Splats that reach no pixel have gradients of zero."""
    centers = [(-8, 4), (20, 4), (6, -8), (6, 17), (300, -200)]
    expected = yield {"parameters": splats(*(splat(x, y, 2.0, 0.5, 2.0) for x, y in centers)), "residual": slope(12, 9)}
    assert not expected["gradients"].value.any()
    assert expected["gradients"].bound.max() < 1e-30


@case("core", "render_gradients", flags=["degenerate"])
def degenerate_splats() -> Inputs:
    """Degenerate splats on pixel centres have gradients of exactly zero; those between them have their own."""
    rows = [splat(4.5, 3.5, l11, 0.25, l22) for l11, l22 in DEGENERATE.values()]
    rows[3], rows[7] = splat(4.2, 3.7, 1.5, 0.5, 1.0), splat(5.1, 2.8, 1.0, -0.5, 1.5)
    expected = yield {"parameters": splats(*rows), "residual": slope(9, 7)}
    drawn = np.any(expected["gradients"].value != 0, axis=1)
    assert np.flatnonzero(drawn).tolist() == [3, 7]
    assert not expected["gradients"].bound[~drawn].any()


@case("core", "render_gradients", flags=["support", "tile-edge"])
def over_the_edges_of_the_frame(rng: Draws) -> Inputs:
    """Splats with centres outside of each side and corner: only the pixels of the frame count."""
    centers = [(-2, 6.7), (20.2, 5.1), (9.4, -2.5), (8.7, 16.2), (-1, -1.5), (19.3, -1), (-1.2, 15), (19, 15.4)]
    rows = [splat(x, y, 1.5, 0.4 - 0.1 * k, 1.75) for k, (x, y) in enumerate(centers)]
    expected = yield {"parameters": splats(*rows), "residual": noise(rng, 18, 14)}
    assert np.all(expected["gradients"].value)


@case("core", "render_gradients", flags=["support"])
def the_edge_of_the_support() -> Inputs:
    """Large residuals just inside and just outside of sigma = ln 255: the first counts, the second does not."""
    l11, l22 = 10 / np.sqrt(2 * 5.543), 10 / np.sqrt(2 * 5.539)
    residual = np.zeros((25, 27, 3), np.float32)
    residual[12, 3], residual[2, 13] = 1000.0, 100.0
    expected = yield {"parameters": splat(13.5, 12.5, l11, 0.0, l22), "residual": residual}
    gradient = expected["gradients"].value[0]
    assert gradient[0] == gradient[2] == 0
    np.testing.assert_allclose(gradient[5:], 100 * np.exp(-5.539), rtol=1e-5)


@case("uncommon", "render_gradients", flags=["support"])
def the_edge_within_rounding() -> Inputs:
    """A pixel at sigma = ln 255 as far as binary32 can tell: counted or not, both are right."""
    l11 = 4 / math.sqrt(2 * LN_255)
    expected = yield {"parameters": splat(10.5, 3.5, l11, 0.0, 0.5), "residual": np.ones((7, 21, 3), np.float32)}
    assert expected["gradients"].bound[0, 5] > 1 / 256
    assert not expected["gradients"].groups


@case("core", "render_gradients", flags=["channel-order"], each={"red": 0, "green": 1, "blue": 2})
def one_channel(value: int, rng: Draws) -> Inputs:
    """A residual in {key} only."""
    residual = noise(rng, 13, 11)
    residual[..., [k for k in range(3) if k != value]] = 0
    expected = yield {"parameters": population(rng, 5, 13, 11), "residual": residual}
    of_color = expected["gradients"].value[:, 5:]
    assert np.all(of_color.any(axis=0) == (np.arange(3) == value))


@case("core", "render_gradients", flags=["clamp"], each={"black": 0.0, "negative": -1.0, "bright": 5.0})
def colours(value: float, rng: Draws) -> Inputs:
    """Splats whose colours are {key}; black ones have gradients for their colours only."""
    parameters = population(rng, 5, 13, 11)
    parameters[:, 5:] = value * abs(parameters[:, 5:])
    expected = yield {"parameters": parameters, "residual": noise(rng, 13, 11)}
    assert expected["gradients"].value[:, :5].any() == (value != 0)
    assert expected["gradients"].value[:, 5:].all()


@case("core", "render_gradients", flags=["needle", "cancellation", "off-diagonal"], each=NEEDLES, said=SLOPES)
def needle(value: tuple[float, float, float], rng: Draws) -> Inputs:
    """A splat ten thousand times longer than it is thick, {key} through pixel centres."""
    expected = yield {"parameters": splat(12.5, 11.5, *value), "residual": noise(rng, 25, 23)}
    gradient, bound = expected["gradients"].value[0], expected["gradients"].bound[0]
    assert np.all(bound[5:] < 0.2)
    assert gradient[5:].all()


@case("core", "render_gradients", flags=["needle", "off-diagonal"])
def thin_splats(rng: Draws) -> Inputs:
    """Splats 20 to 100 times longer than they are thick, between pixel centres."""
    factors = [(6.0, 9.0, 0.3), (8.0, -5.0, 0.25), (0.3, 2.0, 7.0), (12.0, 12.0, 0.4), (5.0, 30.0, 0.6)]
    rows = [splat(12.1 + 0.3 * k, 11.4 - 0.2 * k, *f) for k, f in enumerate(factors)]
    expected = yield {"parameters": splats(*rows), "residual": noise(rng, 25, 23)}
    assert np.all(expected["gradients"].bound < 0.1 * abs(expected["gradients"].value).max(axis=1, keepdims=True))


@case("core", "render_gradients", flags=["support"], each=LARGE, said=HOW_LARGE)
def larger_than_the_frame(value: tuple[float, float, float, float, float], rng: Draws) -> Inputs:
    """A splat much larger than the frame, {key}."""
    expected = yield {"parameters": splat(*value), "residual": noise(rng, 17, 13)}
    assert expected["gradients"].value.all()


@case("core", "render_gradients", flags=["many"])
def splats_on_one_pixel(rng: Draws) -> Inputs:
    """600 splats over the same 16x16 pixels: the last ones have gradients, too."""
    parameters = population(rng, 600, 16, 16, radius=3.0)
    parameters[:, :2] = 8 + (parameters[:, :2] - 8) / 4
    expected = yield {"parameters": parameters, "residual": noise(rng, 16, 16)}
    assert expected["gradients"].value[256:].all()


@case("core", "render_gradients", flags=["odd-size", "transposed"], each=SIZES)
def size(value: tuple[int, int], rng: Draws) -> Inputs:
    """A frame of {key} pixels."""
    width, height = value
    parameters = population(rng, 11, width, height, radius=4.0)
    expected = yield {"parameters": parameters, "residual": noise(rng, width, height)}
    assert expected["gradients"].value.any()


@case("core", "render_gradients", flags=["factor", "odd-size"], each={"101": (101, 33, 29), "211": (211, 47, 35)})
def many_small_splats(value: tuple[int, int, int], rng: Draws) -> Inputs:
    """{key} splats of a few pixels each, a residual without structure: judged together, too."""
    count, width, height = value
    parameters = population(rng, count, width, height, radius=0.8)
    expected = yield {"parameters": parameters, "residual": noise(rng, width, height)}
    assert expected["gradients"].groups == ALL_GROUPS


@case("core", "render_gradients", flags=["factor", "off-diagonal"])
def gradients_of_one_sign(rng: Draws) -> Inputs:
    """A residual that grows by the same factors everywhere: most gradients are positive, and a wrong factor shows.

    One of 1 + 1e-5 is outside of the signed bias of each group.
    """
    parameters = population(rng, 79, 24, 20, radius=1.25)
    parameters[:, [3, 5, 6, 7]] = abs(parameters[:, [3, 5, 6, 7]])
    expected = yield {"parameters": parameters, "residual": slope(24, 20)}
    gradients = expected["gradients"]
    assert gradients.groups == ALL_GROUPS
    for first, end in ALL_GROUPS:
        assert np.sum(gradients.value[:, first:end]) > 0.3 * np.sum(abs(gradients.value[:, first:end]))


@case("core", "render_gradients", flags=["many", "odd-size"])
def splats_of_natural_size(rng: Draws) -> Inputs:
    """149 splats of natural sizes over a frame, a residual as a loss over its pixels gives it."""
    parameters, residual = population(rng, 149, 43, 31), noise(rng, 43, 31)
    expected = yield {"parameters": parameters, "residual": residual * np.float32(0.2 / (43 * 31))}
    assert np.all(np.median(expected["gradients"].bound, axis=0) < 1e-6)


@case("uncommon", "render_gradients", flags=["overflow", "subnormal"], each={"1e6": 1e6, "1e-9": 1e-9})
def residual_of_another_order(value: float, rng: Draws) -> Inputs:
    """A residual of the order of {key}."""
    residual = noise(rng, 13, 11) * np.float32(value)
    expected = yield {"parameters": population(rng, 7, 13, 11), "residual": residual}
    assert expected["gradients"].value.any()


EXTREME = {
    "far_away": (3e9, -2e12, 4.0, 1.0, 4.0),
    "further_than_any_integer": (1e38, -3e38, 5.0, 0.0, 5.0),
    "larger_than_any_integer": (10.0, 7.0, 1e30, 0.0, 1e32),
    "largest_factors": (10.0, 7.0, 3e38, 0.0, 3e38),
    "smallest_factors_on_a_centre": (5.5, 4.5, 2.0**-126, 0.0, 2.0**-126),
    "smallest_factors_off_the_centres": (5.25, 4.75, 2.0**-126, 0.0, 2.0**-126),
    "a_vertical_line": (5.5, 4.0, 1e-20, 5.0, 3.0),
    "a_horizontal_line": (5.0, 4.5, 4.0, 0.0, 1e-30),
    "minus_zero": (-0.0, -0.0, 3.0, -0.0, 3.0),
}


@case("stress", "render_gradients", flags=["overflow", "nan"], each=EXTREME, said=WHAT_IS_EXTREME)
def extreme(value: tuple[float, float, float, float, float], rng: Draws) -> Inputs:
    """{key}: no gradient is NaN, also where u is infinite."""
    expected = yield {"parameters": splat(*value), "residual": noise(rng, 11, 9) / 4}
    largest = abs(expected["gradients"].value) + expected["gradients"].bound
    assert np.all(largest < np.finfo(np.float32).max)


@case("stress", "render_gradients", flags=["subnormal"])
def terms_that_underflow() -> Inputs:
    """A splat of 2^60 pixels: each term q v1, q v2 of (10-7) is subnormal, their sums and all moments are not.

    Who takes subnormal numbers for zero has to add moments, as (13-12) does: terms would leave nothing.
    """
    residual = np.full((29, 37, 3), 2.0**-12, np.float32)
    expected = yield {"parameters": splat(-8.0, -8.0, 2.0**60, 0.0, 2.0**60), "residual": residual}
    gradient, bound = abs(expected["gradients"].value[0]), expected["gradients"].bound[0]
    assert np.all(gradient[:2] > 100 * bound[:2])
    assert np.all(gradient[:2] < 29 * 37 * SMALLEST_NORMAL)


@case("stress", "render_gradients", flags=["subnormal"])
def moments_that_underflow() -> Inputs:
    """A residual of 2^-100 and colours of 2^-30: q is subnormal, and what is left of q may be zero; colours may not."""
    color = (2.0**-30, 2.0**-31, 2.0**-32)
    residual = np.full((29, 37, 3), 2.0**-100, np.float32)
    expected = yield {"parameters": splat(15.2, 10.9, 8.0, 2.0, 7.0, color), "residual": residual}
    gradient, bound = abs(expected["gradients"].value[0]), expected["gradients"].bound[0]
    assert np.all((gradient[:5] > 0) & (gradient[:5] <= bound[:5]))
    assert np.all(gradient[5:] > 1000 * bound[5:])


@case("stress", "render_gradients", flags=["degenerate", "overflow"])
def infinite_factors() -> Inputs:
    """Splats whose l11 or l22 is infinite, or both, are degenerate: their gradients are zero, not NaN."""
    expected = yield {"parameters": splats(*INFINITE, splat(4.3, 2.2, 1.5, 0.5, 1.25)), "residual": slope(9, 5)}
    assert expected["gradients"].value.any(axis=1).tolist() == [False] * 3 + [True]
    assert not expected["gradients"].bound[:3].any()
