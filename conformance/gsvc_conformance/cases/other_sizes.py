"""Splats at other sizes (spec.md section 9.4)."""

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
