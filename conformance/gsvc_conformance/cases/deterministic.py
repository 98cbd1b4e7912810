"""Deterministic rendering to the bit (spec.md section 9.3)."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gsvc_base.constants import LN_255
from gsvc_base.draws import Draws
from gsvc_base.portable import cos, sin
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.rendering import SIZES
from gsvc_conformance.cases.splat_sets import population, splat, splats
from gsvc_conformance.cases.unusual_splats import DEGENERATE, EXTREME, WHAT_IS_EXTREME, WHY_DEGENERATE
from gsvc_ref.rendering import render_sum_deterministic

K = np.float32(float.fromhex("0x1.62a41p+3"))


@case("core", "render_sum_deterministic", flags=["empty"])
def no_splats() -> Inputs:
    """Without splats every bit is zero."""
    expected = yield {"parameters": splats(), "width": 7, "height": 5}
    assert not expected["sum"].value.any()


@case("core", "render_sum_deterministic", flags=["odd-size", "transposed"], each=SIZES)
def size(value: tuple[int, int], rng: Draws) -> Inputs:
    """A frame of {key} pixels."""
    width, height = value
    parameters = population(rng, 11, width, height, radius=4.0)
    expected = yield {"parameters": parameters, "width": width, "height": height}
    assert expected["sum"].value.any()


@case("core", "render_sum_deterministic", flags=["order", "division", "odd-size"])
def many_splats(rng: Draws) -> Inputs:
    """307 splats of natural sizes over a frame of several tiles."""
    expected = yield {"parameters": population(rng, 307, 61, 47), "width": 61, "height": 47}
    assert expected["sum"].value.any()


@case("core", "render_sum_deterministic", flags=["order", "many"])
def ascending_order(rng: Draws) -> Inputs:
    """300 splats with large colours of both signs on a few pixels: each order of adding has sums of its own."""
    parameters = np.repeat(splat(4.4, 3.7, 2.0, 1.0, 1.5), 300, axis=0)
    parameters[:, 5:] = rng.normal(0, 100, (300, 3))
    expected = yield {"parameters": parameters, "width": 9, "height": 7}
    assert not np.array_equal(expected["sum"].value, render_sum_deterministic(parameters[::-1], 9, 7))


@case("core", "render_sum_deterministic", flags=["exponential"])
def weights_from_one_to_the_edge() -> Inputs:
    """Rows of pixels with all weights from 1 down to 1/255: another polynomial, or another order of it, differs."""
    rows = [splat(0.5, j + 0.5, 15.0 + j / 7, 0.0, 0.125, (1, 1, 1)) for j in range(5)]
    expected = yield {"parameters": splats(*rows), "width": 53, "height": 5}
    C = expected["sum"].value[..., 0]
    assert np.all(C[:, 0] == 1)
    assert np.all(np.diff(C[:, :50], axis=1) < 0)
    assert 1 / 255 < C[0, 49] < 0.005


@case("core", "render_sum_deterministic", flags=["exponential", "fused"])
def any_place_in_a_pixel(rng: Draws) -> Inputs:
    """Splats as small as a pixel, each seen by one: the weight itself, to the last bit, 15 x 11 times."""
    grid = np.stack(np.meshgrid(np.arange(15), np.arange(11)), axis=-1).reshape(-1, 2) + 0.5
    parameters = np.repeat(splat(0, 0, 0.2, 0.0, 0.2, (1, 1, 1)), len(grid), axis=0)
    parameters[:, :2] = grid + rng.uniform(-0.33, 0.33, grid.shape)
    parameters[:, 3] = rng.uniform(-0.05, 0.05, len(grid))
    expected = yield {"parameters": parameters, "width": 15, "height": 11}
    assert np.count_nonzero(expected["sum"].value[..., 0]) > 140


def _m(dx: np.float32, dy: np.float32) -> np.float32:
    return np.float32(dx * dx + dy * dy)


def _with_m(
    rng: Draws, m: np.float32, pixel: tuple[int, int] = (3, 3), before: tuple[int, int] = (1, 1)
) -> Iterator[tuple[float, float]]:
    """Places (x, y) of round splats with L = 1 whose m at a pixel's centre is the given number.

    `before` is 1 for splats to the left of the pixel, or above it, and -1 for those to the right, or below it.
    """
    i, j = (np.float32(number + 0.5) for number in pixel)
    across, down = (np.float32(side) for side in before)
    while True:
        x = i - across * np.float32(rng.uniform(0.5, 3.2))
        y = j - down * np.float32(np.sqrt(np.float64(m) - np.float64(i - x) ** 2))
        if _m(i - x, j - y) == m:
            yield float(x), float(y)


@case(
    "core",
    "render_sum_deterministic",
    flags=["support"],
    rules=["R-9.1-3"],
    each={"at": 0, "one_step_inside": -1, "one_step_outside": 1},
    said={"at": "exactly K", "one_step_inside": "one step below K", "one_step_outside": "one step above K"},
)
def the_edge(value: int, rng: Draws) -> Inputs:
    """Eight splats, one after the other in a corner, whose m is {key}: up to K itself they cover the pixel."""
    m = np.nextafter(K, np.float32(np.sign(value) * 100)) if value else K
    places = _with_m(rng, m)
    rows = [splat(*next(places), 1.0, 0.0, 1.0, (1, 0, 0)) for _ in range(8)]
    expected = yield {"parameters": splats(*rows), "width": 4, "height": 4}
    assert (expected["sum"].value[3, 3, 0] > 8 / 256) == (value <= 0)


@case("core", "render_sum_deterministic", flags=["overflow"], equations=["9-8"], rules=["R-9.4-1"])
def scaled_beyond_binary32() -> Inputs:
    """What (9-8) may leave: an infinite x, y or l21, which makes u1 or u2 infinite or NaN, covers nothing."""
    infinite = [(np.inf, 4, 2, 1, 2), (-np.inf, 4, 2, 0, 0.5), (6, np.inf, 2, 1, 2), (6, -np.inf, 2, 0, 0.5),
                (6.5, 4.5, 2, np.inf, 2), (6.5, 4.5, 2, -np.inf, 0.5), (6.5, np.inf, 2, np.inf, 2)]  # fmt: skip
    alone = splat(6.5, 4.5, 2, 1, 2)
    rows = [alone, *(splat(*row) for row in infinite)]
    expected = yield {"parameters": splats(*rows), "width": 12, "height": 9}
    assert np.array_equal(expected["sum"].value, render_sum_deterministic(alone, 12, 9))


@case("core", "render_sum_deterministic", flags=["support", "tile-edge"], rules=["R-9.1-3"])
def the_edge_in_corners_of_tiles(rng: Draws) -> Inputs:
    """Four splats, each with m exactly K at the corner of a 16x16 tile, the only pixel of it that the splat covers.

    A tile's list that asks for less than K at the nearest pixel loses them.
    """
    corners = {(16, 16): (1, 1), (15, 16): (-1, 1), (16, 15): (1, -1), (15, 15): (-1, -1)}
    rows = [
        splat(*next(_with_m(rng, K, pixel, before)), 1.0, 0.0, 1.0, np.eye(4, 3)[k] + (k == 3))
        for k, (pixel, before) in enumerate(corners.items())
    ]
    expected = yield {"parameters": splats(*rows), "width": 18, "height": 18}
    for pixel, row in zip(corners, rows, strict=True):
        alone = render_sum_deterministic(row, 18, 18)
        assert np.argwhere(alone.any(axis=2) & _in_tile_of(pixel)).tolist() == [[pixel[1], pixel[0]]]
    assert expected["sum"].value[15:17, 15:17].any(axis=2).all()


def _in_tile_of(pixel: tuple[int, int]) -> NDArray[np.bool_]:
    """Which of 18x18 pixels are in the tile of 16x16 pixels that a pixel is in: (18, 18) bool."""
    tile = np.arange(18) // 16
    inside: NDArray[np.bool_] = (tile == pixel[0] // 16) & (tile[:, None] == pixel[1] // 16)
    return inside


BESIDE_THE_BOX = {
    "column_12": (-28770230.0, 8642196.0, 12),
    "column_24": (-84582496.0, 25407458.0, 24),
    "column_25": (-50126248.0, 15057262.0, 25),
}


@case("stress", "render_sum_deterministic", flags=["support"], rules=["R-9.1-3"], each=BESIDE_THE_BOX)
def beside_the_box(value: tuple[float, float, int]) -> Inputs:
    """A huge splat far to the left covers {key}, where m rounds to K, though a box of rho l11 ends before it.

    Which pixels a splat can cover is bounded by rho' = rho (1 + 2^-17), and not by rho.
    """
    x, l11, last = value
    expected = yield {"parameters": splat(x, 1.5, l11, 0.0, 1.0, (1, 1, 1)), "width": last + 3, "height": 3}
    assert np.ceil(x + np.sqrt(2 * LN_255) * l11) <= last
    assert expected["sum"].value[1, last, 0] > 0


@case("core", "render_sum_deterministic", flags=["support", "fused", "division"], rules=["R-9.1-3"])
def edges_within_rounding(rng: Draws) -> Inputs:
    """Sheared splats whose edge passes a pixel as near as binary32 can tell: each rounding decides some of them."""
    rows = []
    for j in range(12):
        for i in range(12):
            l11, l21, l22 = rng.uniform([0.1, -0.04, 0.1], [0.15, 0.04, 0.15])
            angle = rng.uniform(0, 2 * np.pi)
            u1, u2 = np.sqrt(2 * LN_255) * np.array([cos(angle), sin(angle)])
            rows.append(splat(i + 0.5 - l11 * u1, j + 0.5 - (l21 * u1 + l22 * u2), l11, l21, l22, (1, 1, 1)))
    expected = yield {"parameters": splats(*rows), "width": 12, "height": 12}
    assert 40 < np.count_nonzero(expected["sum"].value[..., 0] > 0) <= 144


SHEARED = {
    "one": 1.0,
    "one_step_above_one": float(np.nextafter(np.float32(1), np.float32(2))),
    "one_step_below_one": float(np.nextafter(np.float32(1), np.float32(0))),
    "three": 3.0,
    "a_third": 1 / 3,
}


@case("core", "render_sum_deterministic", flags=["shear", "division"], each=SHEARED,
      said={"one": "1", "one_step_above_one": "one step above 1", "one_step_below_one": "one step below 1",
            "three": "3", "a_third": "1/3"})  # fmt: skip
def l22(value: float) -> Inputs:
    """Sheared splats whose l22 is {key}: up to 1 the shear is (l21 u1) / l22, above it (l21 / l22) u1."""
    rows = [splat(4.3, 4.6, 1.7, 2.3, value), splat(8.1, 5.2, 2.3, -1.1, value), splat(6.6, 4.9, 1.3, 0.7, value)]
    expected = yield {"parameters": splats(*rows), "width": 13, "height": 11}
    assert np.count_nonzero(expected["sum"].value[..., 0]) > 30


@case("core", "render_sum_deterministic", flags=["degenerate"], rules=["R-9.1-2"], each=DEGENERATE, said=WHY_DEGENERATE)
def degenerate(value: tuple[float, float]) -> Inputs:
    """A degenerate splat on a pixel centre: {key}, and so it covers nothing."""
    expected = yield {"parameters": splat(4.5, 3.5, value[0], 0.0, value[1]), "width": 9, "height": 7}
    assert not expected["sum"].value.any()


@case("core", "render_sum_deterministic", flags=["subnormal"])
def subnormal_colours() -> Inputs:
    """Colours below 2^-126: subnormal numbers are kept."""
    color = (1e-39, -1e-39, 2.0**-149)
    expected = yield {"parameters": splat(5.5, 4.5, 3.0, 0.0, 3.0, color), "width": 11, "height": 9}
    assert expected["sum"].value[4, 5].tolist() == np.array(color, np.float32).tolist()


@case("core", "render_sum_deterministic", flags=["subnormal", "many"])
def small_products() -> Inputs:
    """Colours just above 2^-126 whose products with weights are subnormal, added to each other."""
    rows = [splat(5.2 + 0.1 * k, 4.4, 2.0, 0.5, 1.5, (2e-38, -1.3e-38, 3e-38)) for k in range(4)]
    expected = yield {"parameters": splats(*rows), "width": 11, "height": 9}
    some = expected["sum"].value[expected["sum"].value != 0]
    assert np.count_nonzero(abs(some) < 2.0**-126) > 10


@case("core", "render_sum_deterministic", flags=["clamp"])
def above_one_and_below_zero() -> Inputs:
    """Sums of 3 - 2.5 + 0.3 and less than 0: the sum is not clamped on the way."""
    colors = [(3.1, -2.5, 0.1), (-2.5, 3.3, -0.2), (0.3, 0.7, -0.4)]
    parameters = splats(*(splat(4.5, 3.5, 2.0, 0.4, 1.5, color) for color in colors))
    expected = yield {"parameters": parameters, "width": 9, "height": 7}
    assert expected["sum"].value[3, 4, 0] == np.float32(3.1) + np.float32(-2.5) + np.float32(0.3)


@case("uncommon", "render_sum_deterministic", flags=["needle"])
def needles() -> Inputs:
    """Thin splats at several angles through pixel centres."""
    factors = [(4.0, 0.0, 4e-4), (4e-4, 0.0, 4.0), (4.0, 4.0, 8e-4), (4.0, -2.0, 4e-4), (3000.0, 1500.0, 0.3)]
    rows = [splat(10.5, 9.5, *f, (0.1 * k, 0.3, 0.7)) for k, f in enumerate(factors, 1)]
    expected = yield {"parameters": splats(*rows), "width": 21, "height": 19}
    assert expected["sum"].value[9, 10, 0] > 1.4


@case("uncommon", "render_sum_deterministic", flags=["fused"])
def far_from_the_origin() -> Inputs:
    """Centres with many bits, in a wide frame: each difference from a pixel centre is rounded once."""
    rows = [splat(0.123456789 + k / 3, 1.7, 90.0, 3.0 - k, 2.5, (0.3, 0.1 * k, 0.7)) for k in range(5)]
    expected = yield {"parameters": splats(*rows), "width": 199, "height": 3}
    assert expected["sum"].value[1].all()


@case("uncommon", "render_sum_deterministic", flags=["degenerate"], rules=["R-9.1-2"])
def degenerate_among_others(rng: Draws) -> Inputs:
    """Every third splat is degenerate."""
    parameters = population(rng, 30, 17, 13)
    parameters[::3, 4] = -1
    expected = yield {"parameters": parameters, "width": 17, "height": 13}
    assert expected["sum"].value.any()


SPECIAL = {
    "subnormal_reciprocals": (3e38, 5.5, 3e38, 0.0, 3e38),
    "a_subnormal_reciprocal": (5.5, 3e38, 2.0, 0.0, 3e38),
    "a_subnormal_shear": (5.5, 4.5, 3.0, 2e-38, 1.2e-38),
    "infinity_minus_infinity": (4.5, 3e38, 1.0, 3e38, 0.5),
    "a_product_that_would_overflow": (4.5, 3e38, 1.0, 3e38, 2.0),
    **EXTREME,
}
WHAT_IS_SPECIAL = {
    "subnormal_reciprocals": "Both reciprocals are subnormal",
    "a_subnormal_reciprocal": "One reciprocal is subnormal",
    "a_subnormal_shear": "The shear is next to subnormal numbers",
    "infinity_minus_infinity": "u2 is infinity minus infinity",
    "a_product_that_would_overflow": "l21 u1 would overflow",
}
"""Words in titles for those that are not in WHAT_IS_EXTREME."""


@case("stress", "render_sum_deterministic", flags=["subnormal", "overflow", "nan"], each=SPECIAL,
      said={**WHAT_IS_EXTREME, **WHAT_IS_SPECIAL})  # fmt: skip
def extreme(value: tuple[float, float, float, float, float]) -> Inputs:
    """{key}: a pixel is covered where m is at most K, and not where m is a NaN."""
    expected = yield {"parameters": splat(*value), "width": 11, "height": 9}
    assert np.isfinite(expected["sum"].value).all()


@case("stress", "render_sum_deterministic", flags=["overflow"])
def a_sum_beyond_binary32() -> Inputs:
    """Colours whose sum is infinite, of both signs."""
    rows = np.repeat(splat(4.5, 3.5, 2.0, 0.5, 1.5, (3e38, -3e38, 1.0)), 2, axis=0)
    expected = yield {"parameters": rows, "width": 9, "height": 7}
    assert expected["sum"].value[3, 4].tolist() == [np.inf, -np.inf, 2.0]
