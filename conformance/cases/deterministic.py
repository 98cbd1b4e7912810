"""Deterministic rendering to the bit, and splats at other sizes (spec.md sections 9.3 and 9.4)."""

from collections.abc import Iterator

import numpy as np

from conformance.case import Inputs, case
from conformance.cases.rendering import SIZES
from conformance.cases.splat_sets import anywhere, population, splat, splats
from conformance.cases.unusual_splats import DEGENERATE, EXTREME
from conformance.stages.rendering import render_sum_deterministic

K = np.float32(float.fromhex("0x1.62a41p+3"))


@case("core", "render_sum_deterministic", flags=["empty"])
def no_splats() -> Inputs:
    """Without splats every bit is zero."""
    expected = yield {"parameters": splats(), "width": 7, "height": 5}
    assert not expected["sum"].value.any()


@case("core", "render_sum_deterministic", flags=["odd-size", "transposed"], each=SIZES)
def size(value: tuple[int, int], rng: np.random.Generator) -> Inputs:
    """A frame of {key} pixels."""
    width, height = value
    parameters = population(rng, 11, width, height, radius=4.0)
    expected = yield {"parameters": parameters, "width": width, "height": height}
    assert expected["sum"].value.any()


@case("core", "render_sum_deterministic", flags=["order", "division", "odd-size"])
def many_splats(rng: np.random.Generator) -> Inputs:
    """307 splats of natural sizes over a frame of several tiles."""
    expected = yield {"parameters": population(rng, 307, 61, 47), "width": 61, "height": 47}
    assert expected["sum"].value.any()


@case("core", "render_sum_deterministic", flags=["order", "many"])
def ascending_order(rng: np.random.Generator) -> Inputs:
    """300 splats with large colours of both signs on a few pixels: each order of adding has sums of its own."""
    parameters = np.repeat(splat(4.4, 3.7, 2.0, 1.0, 1.5), 300, axis=0)
    parameters[:, 5:] = rng.normal(0, 100, (300, 3))
    expected = yield {"parameters": parameters, "width": 9, "height": 7}
    assert not np.array_equal(expected["sum"].value, render_sum_deterministic(parameters[::-1], 9, 7)["sum"])


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
def any_place_in_a_pixel(rng: np.random.Generator) -> Inputs:
    """Splats as small as a pixel, each seen by one: the weight itself, to the last bit, 15 x 11 times."""
    grid = np.stack(np.meshgrid(np.arange(15), np.arange(11)), axis=-1).reshape(-1, 2) + 0.5
    parameters = np.repeat(splat(0, 0, 0.2, 0.0, 0.2, (1, 1, 1)), len(grid), axis=0)
    parameters[:, :2] = grid + rng.uniform(-0.33, 0.33, grid.shape)
    parameters[:, 3] = rng.uniform(-0.05, 0.05, len(grid))
    expected = yield {"parameters": parameters, "width": 15, "height": 11}
    assert np.count_nonzero(expected["sum"].value[..., 0]) > 140


def _m(dx: np.float32, dy: np.float32) -> np.float32:
    return np.float32(dx * dx + dy * dy)


def _with_m(rng: np.random.Generator, m: np.float32) -> Iterator[tuple[float, float]]:
    """Places (x, y) of round splats with L = 1 whose m at the centre (3.5, 3.5) is the given number."""
    center = np.float32(3.5)
    while True:
        x = center - np.float32(rng.uniform(0.5, 3.2))
        y = center - np.float32(np.sqrt(np.float64(m) - np.float64(center - x) ** 2))
        if _m(center - x, center - y) == m:
            yield float(x), float(y)


@case(
    "core", "render_sum_deterministic", flags=["support"], each={"at": 0, "one_step_inside": -1, "one_step_outside": 1}
)
def the_edge(value: int, rng: np.random.Generator) -> Inputs:
    """Eight splats, one after the other in a corner, whose m is {key} of K: up to K itself they cover the pixel."""
    m = np.nextafter(K, np.float32(np.sign(value) * 100)) if value else K
    places = _with_m(rng, m)
    rows = [splat(*next(places), 1.0, 0.0, 1.0, (1, 0, 0)) for _ in range(8)]
    expected = yield {"parameters": splats(*rows), "width": 4, "height": 4}
    assert (expected["sum"].value[3, 3, 0] > 8 / 256) == (value <= 0)


@case("core", "render_sum_deterministic", flags=["support", "fused", "division"])
def edges_within_rounding(rng: np.random.Generator) -> Inputs:
    """Sheared splats whose edge passes a pixel as near as binary32 can tell: each rounding decides some of them."""
    rows = []
    for j in range(12):
        for i in range(12):
            l11, l21, l22 = rng.uniform([0.1, -0.04, 0.1], [0.15, 0.04, 0.15])
            angle = rng.uniform(0, 2 * np.pi)
            u1, u2 = np.sqrt(2 * np.log(255)) * np.array([np.cos(angle), np.sin(angle)])
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


@case("core", "render_sum_deterministic", flags=["shear", "division"], each=SHEARED)
def l22(value: float) -> Inputs:
    """Sheared splats with an l22 of {key}: up to 1 the shear is (l21 u1) / l22, above it (l21 / l22) u1."""
    rows = [splat(4.3, 4.6, 1.7, 2.3, value), splat(8.1, 5.2, 2.3, -1.1, value), splat(6.6, 4.9, 1.3, 0.7, value)]
    expected = yield {"parameters": splats(*rows), "width": 13, "height": 11}
    assert np.count_nonzero(expected["sum"].value[..., 0]) > 30


@case("core", "render_sum_deterministic", flags=["degenerate"], each=DEGENERATE)
def degenerate(value: tuple[float, float]) -> Inputs:
    """A degenerate splat on a pixel centre, {key}: it covers nothing."""
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


@case("uncommon", "render_sum_deterministic", flags=["degenerate"])
def degenerate_among_others(rng: np.random.Generator) -> Inputs:
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


@case("stress", "render_sum_deterministic", flags=["subnormal", "overflow", "nan"], each=SPECIAL)
def extreme(value: tuple[float, float, float, float, float]) -> Inputs:
    """Factors or a centre at the ends of binary32: {key}; a comparison with a NaN does not cover."""
    expected = yield {"parameters": splat(*value), "width": 11, "height": 9}
    assert np.isfinite(expected["sum"].value).all()


@case("stress", "render_sum_deterministic", flags=["overflow"])
def a_sum_beyond_binary32() -> Inputs:
    """Colours whose sum is infinite, of both signs."""
    rows = np.repeat(splat(4.5, 3.5, 2.0, 0.5, 1.5, (3e38, -3e38, 1.0)), 2, axis=0)
    expected = yield {"parameters": rows, "width": 9, "height": 7}
    assert expected["sum"].value[3, 4].tolist() == [np.inf, -np.inf, 2.0]


@case("core", "scale_parameters", flags=["order"], each={"double": (16, 9, 32, 18), "down": (48, 27, 16, 9)})
def same_shape(value: tuple[int, int, int, int], rng: np.random.Generator) -> Inputs:
    """To a frame of the same shape: {key}."""
    width, height, wider, higher = value
    parameters = anywhere(rng, 13, width, height, 5.0)
    expected = yield {
        "parameters": parameters, "width": width, "height": height, "new_width": wider, "new_height": higher,
    }  # fmt: skip
    ratio = np.float32(wider / width)
    assert np.array_equal(expected["parameters"].value[:, :5], parameters[:, :5] * ratio)


OTHER_SHAPES = {"wider": (7, 5, 61, 6), "higher": (30, 20, 31, 47), "to_1x1": (19, 23, 1, 1), "from_1x1": (1, 1, 10, 3),
                "720p": (1920, 1080, 1280, 720), "largest": (3, 7, 65535, 65534)}  # fmt: skip


@case("core", "scale_parameters", flags=["transposed", "division"], each=OTHER_SHAPES)
def other_shape(value: tuple[int, int, int, int], rng: np.random.Generator) -> Inputs:
    """To a frame of another shape: {key}; l11 goes with the width, l21 and l22 with the height."""
    width, height, new_width, new_height = value
    parameters = anywhere(rng, 41, width, height, 5.0)
    expected = yield {
        "parameters": parameters, "width": width, "height": height, "new_width": new_width, "new_height": new_height,
    }  # fmt: skip
    scaled = expected["parameters"].value
    assert np.array_equal(scaled[:, 5:], parameters[:, 5:])
    np.testing.assert_allclose(scaled[:, 3], parameters[:, 3].astype(np.float64) * new_height / height, rtol=2e-7)


@case("stress", "scale_parameters", flags=["signed-zero", "subnormal"])
def zeros_and_subnormal_numbers() -> Inputs:
    """Minus zero keeps its sign; a factor that becomes subnormal is kept, and asked about afterwards."""
    rows = [
        splat(-0.0, 0.0, 2.0**-126, -0.0, 2.0**-126),
        splat(1e-38, -1e-38, 1e-39, 2.0**-149, -3.0, (-0.0, 1e-39, 0)),
    ]
    expected = yield {"parameters": splats(*rows), "width": 9, "height": 5, "new_width": 4, "new_height": 2}
    scaled = expected["parameters"].value
    assert np.signbit(scaled[0, [0, 3]]).all()
    assert 0 < scaled[0, 2] < 2.0**-126


@case("uncommon", "scale_parameters", flags=["empty"])
def nothing_to_scale() -> Inputs:
    """No splats."""
    expected = yield {"parameters": splats(), "width": 9, "height": 5, "new_width": 4, "new_height": 2}
    assert expected["parameters"].value.shape == (0, 8)
