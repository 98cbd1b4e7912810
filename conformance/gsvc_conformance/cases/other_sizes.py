"""Splats at other sizes (spec.md section 9.4)."""

from typing import Any

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.splat_sets import anywhere, splat, splats


@case("core", "scale_parameters", flags=["order"], each={"double": (16, 9, 32, 18), "down": (48, 27, 16, 9)},
      said={"double": "twice as large", "down": "a third as large"})  # fmt: skip
def same_shape(value: tuple[int, int, int, int], rng: Draws) -> Inputs:
    """To a frame of the same shape, {key}."""
    width, height, wider, higher = value
    parameters = anywhere(rng, 13, width, height, 5.0)
    expected = yield {
        "parameters": parameters, "width": width, "height": height, "new_width": wider, "new_height": higher,
    }  # fmt: skip
    ratio = np.float32(wider / width)
    assert np.array_equal(expected["parameters"].value[:, :5], parameters[:, :5] * ratio)


OTHER_SHAPES = {"wider": (7, 5, 61, 6), "higher": (30, 20, 31, 47), "to_1x1": (19, 23, 1, 1), "from_1x1": (1, 1, 10, 3),
                "720p": (1920, 1080, 1280, 720), "largest": (3, 7, 65535, 65534),
                "widest": (4, 9, 65535, 1)}  # fmt: skip


@case("core", "scale_parameters", flags=["transposed", "division"], rules=["R-9.4-2"], each=OTHER_SHAPES,
      said={key: "From {}x{} to {}x{} pixels".format(*sizes) for key, sizes in OTHER_SHAPES.items()})  # fmt: skip
def other_shape(value: tuple[int, int, int, int], rng: Draws) -> Inputs:
    """{key}: l11 goes with the width, l21 and l22 with the height."""
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


@case("core", "scale_parameters", flags=["overflow"])
def beyond_binary32() -> Inputs:
    """Four times as wide and twice as high, of numbers of 3e38 each one is infinite; the colours stay what they are."""
    large = splat(3e38, -3e38, 3e38, -3e38, 3e38)
    each = np.repeat(splat(9, 4, 2, 1, 2, (3e38, -3e38, 1)), 5, axis=0)
    np.fill_diagonal(each, large[0])
    expected = yield {
        "parameters": splats(large, each), "width": 12, "height": 9, "new_width": 48, "new_height": 18,
    }  # fmt: skip
    scaled = expected["parameters"].value
    assert np.isinf(scaled[0, :5]).all()
    assert np.array_equal(np.isinf(scaled[1:]), np.eye(5, 8))
    assert np.array_equal(np.signbit(scaled[0, :5]), [False, True, False, True, False])


@case("uncommon", "scale_parameters", flags=["empty"])
def nothing_to_scale() -> Inputs:
    """No splats."""
    expected = yield {"parameters": splats(), "width": 9, "height": 5, "new_width": 4, "new_height": 2}
    assert expected["parameters"].value.shape == (0, 8)


# --- Filtered by the area of the new pixels --------------------------------------------------------------------------

SMALLER = {"half": (48, 26, 24, 13), "a_tenth": (160, 90, 16, 9), "one_column_less": (1920, 9, 1919, 9),
           "as_wide": (31, 46, 31, 17), "wider_and_lower": (12, 40, 50, 9), "narrower_and_higher": (40, 12, 9, 50),
           "720p": (1920, 1080, 1280, 720), "to_1x1": (65535, 65534, 1, 1)}  # fmt: skip


def covariances(rows: Any) -> Any:
    """L L^T of splats, (N, 3) f8: along x, along both, along y."""
    l11, l21, l22 = np.asarray(rows)[:, 2:5].astype(np.float64).T
    return np.stack([l11 * l11, l11 * l21, l21 * l21 + l22 * l22], axis=1)


def filtered(parameters: Any, width: int, height: int, new_width: int, new_height: int) -> Any:
    """The expected parameters, (N, 8) f8, once covariances and sums are those of a filter by the new pixels' area."""
    expected = yield {
        "parameters": parameters, "width": width, "height": height, "new_width": new_width, "new_height": new_height,
    }  # fmt: skip
    value = expected["parameters"].value
    a, e = new_width / width, new_height / height
    added = [max(0, (1 / scale**2 - 1) / 12) for scale in (a, e)]  # in the pixels of before
    wanted = (covariances(parameters) + np.array([added[0], 0, added[1]])) * np.array([a * a, a * e, e * e])
    np.testing.assert_allclose(covariances(value), wanted, rtol=1e-9)
    given = parameters.astype(np.float64)
    sums = [rows[:, 5:] * (rows[:, 2] * rows[:, 4])[:, None] for rows in (given, value)]
    np.testing.assert_allclose(sums[1], sums[0] * (a * e), rtol=1e-9)
    return expected


@case("core", "scale_parameters_filtered", flags=["transposed", "division"], rules=["R-9.4-2"], each=SMALLER,
      said={key: "From {}x{} to {}x{} pixels".format(*sizes) for key, sizes in SMALLER.items()})  # fmt: skip
def smaller(value: tuple[int, int, int, int], rng: Draws) -> Inputs:
    """{key}: the variances of a mean of 1/a pixels are added, and the colours keep the sums of the splats."""
    width, height = value[:2]
    expected = yield from filtered(anywhere(rng, 41, width, height, 2.0), *value)
    assert np.isfinite(expected["parameters"].bound).all()


@case("core", "scale_parameters_filtered", flags=["order"], each={"double": (16, 9, 32, 18), "same": (16, 9, 16, 9)},
      said={"double": "twice as large", "same": "of the same size"})  # fmt: skip
def not_smaller(value: tuple[int, int, int, int], rng: Draws) -> Inputs:
    """To a frame {key}: nothing is filtered."""
    parameters = anywhere(rng, 13, 16, 9, 2.0)
    expected = yield from filtered(parameters, *value)
    ratio = value[2] / 16
    assert np.array_equal(expected["parameters"].value[:, :5], parameters[:, :5].astype(np.float64) * ratio)


@case("core", "scale_parameters_filtered", flags=["needle", "cancellation"])
def needles_to_a_smaller_frame(rng: Draws) -> Inputs:
    """Thin, tilted splats, scaled to a frame that is hardly smaller: m22 must not be a difference of squares.

    A difference of squares in binary32 loses all digits of it.
    """
    rows = anywhere(rng, 24, 1000, 1000, 100.0)
    rows[:, 4] = np.geomspace(1e-4, 1e-1, 24)
    expected = yield from filtered(rows, 1000, 1000, 999, 999)
    assert np.all(expected["parameters"].bound[:, 4] < 1e-5 * expected["parameters"].value[:, 4])


@case("stress", "scale_parameters_filtered", flags=["subnormal", "overflow"],
      each={"wide": (10, 10, 10, 5), "high": (10, 10, 5, 10)})  # fmt: skip
def beyond_squares(value: tuple[int, int, int, int]) -> Inputs:
    """Deviations whose squares leave the range of binary32, to a frame half as {key}."""
    sizes = [2.0**-100, 2.0**-64, 1.5, 2.0**64, 2.0**120]
    rows = [splat(3, 4, across, shear, down) for across in sizes for down in sizes for shear in (0, -1, 2.0**-70)]
    rows += [splat(3, 4, 2.0**70, -(2.0**80), 1), splat(3, 4, 2.0**-70, 2.0**80, 2.0**-70)]
    expected = yield from filtered(splats(*rows), *value)
    assert np.isfinite(expected["parameters"].value).all()


@case("core", "scale_parameters_filtered", flags=["degenerate", "signed-zero"])
def degenerate_stays_degenerate() -> Inputs:
    """A splat that covers nothing gets no width: l11 or l22 is zero, negative or subnormal, and stays so.

    A filter makes a splat of l11 = -2 wide, and visible.
    """
    values = [0.0, -2.0, 2.0**-127, 2.0**-126, 3.0]
    rows = splats(*(splat(4, 3, across, 1, down) for across in values for down in values))
    expected = yield {"parameters": rows, "width": 16, "height": 12, "new_width": 8, "new_height": 6}
    value = expected["parameters"].value
    drawn = (rows[:, [2, 4]] >= 2.0**-126).all(axis=1)
    assert np.array_equal(value[~drawn, 2:5], rows[~drawn, 2:5].astype(np.float64) / 2)
    assert np.array_equal(value[~drawn, 5:], rows[~drawn, 5:])
    assert np.all(value[drawn, 2] >= np.sqrt(1 / 16))
    assert np.count_nonzero(drawn) == 4


@case("uncommon", "scale_parameters_filtered", flags=["empty"])
def nothing_to_filter() -> Inputs:
    """No splats."""
    expected = yield {"parameters": splats(), "width": 9, "height": 5, "new_width": 4, "new_height": 2}
    assert expected["parameters"].value.shape == (0, 8)
