"""Sums of splats within the error bound (spec.md sections 9.1 and 9.2)."""

import math

import numpy as np
from numpy.typing import NDArray

from gsvc_base.constants import LN_255
from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.splat_sets import COLOR, MIN_GUARDS, population, splat, splats
from gsvc_conformance.operations.rendering import edge_margins

SMALLEST = 2.0**-126
FAINT = 2.0**-11 * (1 - 2.0**-10)
"""Less than half of the last place of 1 in binary16."""


@case("core", "render_sum", flags=["empty"])
def no_splats() -> Inputs:
    """Without splats the sum is zero: the background is black."""
    expected = yield {"parameters": splats(), "width": 7, "height": 5}
    assert expected["sum"].value.shape == (5, 7, 3)
    assert not expected["sum"].value.any()


@case("core", "render_sum", flags=["pixel-centre"])
def a_splat_in_the_middle() -> Inputs:
    """A splat in the middle of the frame: the picture is symmetric, and its middle pixel has the colour itself.

    With pixel centres at integers it moves by half a pixel.
    """
    expected = yield {"parameters": splat(10.5, 7.5, 3.0, 0.0, 2.0), "width": 21, "height": 15}
    C = expected["sum"].value
    assert np.array_equal(C, C[::-1, ::-1])
    assert C[7, 10].tolist() == list(COLOR)


@case("core", "render_sum", flags=["pixel-centre", "transposed"])
def a_splat_off_the_middle() -> Inputs:
    """A splat far from the middle and from the diagonal: x counts columns from the left, y rows from the top."""
    expected = yield {"parameters": splat(15.3, 3.8, 2.0, 0.5, 1.5), "width": 19, "height": 13}
    assert np.argmax(expected["sum"].value[..., 0]) == 3 * 19 + 15


@case("core", "render_sum", flags=["shear"], each={"positive": 3.0, "negative": -3.0})
def shear(value: float) -> Inputs:
    """A splat with a {key} l21: it leans to the lower right if l21 is positive.

    The other sign mirrors it; the upper triangle of L has another covariance.
    """
    expected = yield {"parameters": splat(11.2, 8.4, 3.0, value, 1.25), "width": 23, "height": 17}
    C = expected["sum"].value[..., 0]
    assert (C[12, 15] > 0 == C[4, 15]) if value > 0 else (C[4, 15] > 0 == C[12, 15])


@case("core", "render_sum", flags=["shear", "transposed"], each={"l11": (5.0, 1.25), "l22": (1.25, 5.0)})
def long_axis(value: tuple[float, float]) -> Inputs:
    """A splat that is long along one axis, by its {key}."""
    l11, l22 = value
    expected = yield {"parameters": splat(12.1, 8.3, l11, 0.0, l22), "width": 23, "height": 17}
    assert (expected["sum"].value[8, 22, 0] > 0) == (l11 > l22) == (expected["sum"].value[16, 12, 0] == 0)


@case("core", "render_sum", flags=["channel-order"])
def channels_apart() -> Inputs:
    """Three splats beside each other, each of another colour."""
    rows = [splat(2.5 + 4 * k, 2.5, 0.75, 0.0, 0.75, (k == 0, k == 1, k == 2)) for k in range(3)]
    expected = yield {"parameters": splats(*rows), "width": 13, "height": 5}
    assert [int(np.argmax(expected["sum"].value[2, 2 + 4 * k])) for k in range(3)] == [0, 1, 2]


@case("core", "render_sum", flags=["support"], rules=["R-9.1-3"])
def the_edge_of_the_support() -> Inputs:
    """Pixels just inside and just outside of sigma = ln 255.

    In the row of the centre a pixel has sigma 5.543, between ln 255 and ln 256: it is not covered. In its column one
    has 5.539: it is covered, though beyond three standard deviations. The corners of a square around the splat are not
    covered, however it is found.
    """
    l11, l22 = 10 / np.sqrt(2 * 5.543), 10 / np.sqrt(2 * 5.539)
    expected = yield {"parameters": splat(13.5, 12.5, l11, 0.0, l22), "width": 27, "height": 25}
    C = expected["sum"].value[..., 0]
    assert C[12, 3] == C[12, 23] == C[4, 5] == 0 < C[2, 13] < 1 / 255
    assert expected["sum"].bound.max() < 1e-5


@case("uncommon", "render_sum", flags=["support"], rules=["R-9.1-3"])
def the_edge_within_rounding() -> Inputs:
    """A pixel at sigma = ln 255 as far as binary32 can tell: covered or not, both are right."""
    l11 = 4 / math.sqrt(2 * LN_255)
    expected = yield {"parameters": splat(10.5, 3.5, l11, 0.0, 0.5, (1, 1, 1)), "width": 21, "height": 7}
    wide = expected["sum"].bound[..., 0] > 1 / 256
    assert np.argwhere(wide).tolist() == [[3, 6], [3, 14]]


@case("core", "render_sum", flags=["support"], rules=["R-9.1-3"])
def just_beyond_the_edge(rng: Draws) -> Inputs:
    """36 splats, each with a pixel so little beyond sigma = ln 255 that it only just must not be covered.

    A constant that is 20 units in the last place too high, by far less than any formula is wrong, covers some of them.
    """
    rows: list[NDArray[np.float32]] = []
    while len(rows) < 36:
        i, j = len(rows) % 2 * 6 + 2, len(rows) % 9  # right or left of a pixel of that column and row
        l11 = np.float32(rng.uniform(1.0, 3.0))
        d = float(np.float32(math.sqrt(2 * LN_255 + 1.8e-5) * l11)) * (1 if i == 2 else -1)
        one = splat(i + 0.5 + d, j + 0.5, float(l11), 0.0, 0.125, (1, 1, 1))
        beyond = ((i + 0.5 - np.float64(one[0, 0])) / np.float64(l11)) ** 2 / 2 - LN_255
        if beyond > 0 and 1 < edge_margins(one, 11, 9)[0] < 1.05:
            rows.append(one)
    expected = yield {"parameters": splats(*rows), "width": 11, "height": 9}
    assert expected["sum"].bound.max() < 1 / 512


@case("core", "render_sum", flags=["exponential"])
def weights_from_one_to_the_edge() -> Inputs:
    """A long row of pixels with weights from 1 down to 1/255: the exponential over all of its range."""
    expected = yield {"parameters": splat(0.5, 0.5, 15.0, 0.0, 1.0, (1, 1, 1)), "width": 53, "height": 1}
    C, bound = expected["sum"].value[0, :, 0], expected["sum"].bound[0, :, 0]
    assert C[0] == 1
    assert 1 / 255 < C[49] < 0.005
    assert C[50] == 0
    assert np.all(bound[:50] < 1e-5 * C[:50])


@case("core", "render_sum", flags=["tile-edge"])
def corners_of_tiles() -> Inputs:
    """Splats on the corners of tiles of 8, 16 and 32 pixels, each over four of them."""
    centers = [(16, 16), (32, 16), (16, 32), (8, 24), (31.9, 32.1)]
    rows = [splat(x, y, 2.1 + 0.2 * k, 1.0 - 0.5 * k, 1.9) for k, (x, y) in enumerate(centers)]
    expected = yield {"parameters": splats(*rows), "width": 37, "height": 35}
    C = expected["sum"].value[..., 0]
    assert all(C[int(y) + v, int(x) + u] > 0 for x, y in centers for u in (-1, 0) for v in (-1, 0))


@case("core", "render_sum", flags=["tile-edge", "support"], rules=["R-9.1-3"])
def over_the_edges_of_the_frame() -> Inputs:
    """Splats with centres outside of each side and corner, all reaching in."""
    centers = [(-2, 6.7), (20.2, 5.1), (9.4, -2.5), (8.7, 16.2), (-1, -1.5), (19.3, -1), (-1.2, 15), (19, 15.4)]
    rows = [splat(x, y, 1.5, 0.4 - 0.1 * k, 1.75) for k, (x, y) in enumerate(centers)]
    expected = yield {"parameters": splats(*rows), "width": 18, "height": 14}
    C = abs(expected["sum"].value).max(axis=2)
    assert all(C[j, i] > 0 for j, i in [(6, 0), (5, 17), (0, 9), (13, 8), (0, 0), (0, 17), (13, 0), (13, 17)])


@case("core", "render_sum")
def outside_of_the_frame() -> Inputs:
    """Splats that end before they reach the frame: nothing is drawn, nothing wraps around."""
    centers = [(-8, 4), (20, 4), (6, -8), (6, 17), (-7, -7), (300, -200)]
    rows = [splat(x, y, 2.0, 0.5, 2.0) for x, y in centers]
    expected = yield {"parameters": splats(*rows), "width": 12, "height": 9}
    assert not expected["sum"].value.any()
    assert not expected["sum"].bound.any()


@case("core", "render_sum", flags=["many"], each={"257": 257, "600": 600})
def splats_on_one_pixel(value: int, rng: Draws) -> Inputs:
    """{key} splats over the same 16x16 pixels, all seen: a tile that keeps 256 loses the others."""
    parameters = population(rng, value, 16, 16, radius=6.0)
    parameters[:, :2] = 8 + (parameters[:, :2] - 8) / 4
    parameters[:, 5:] = abs(parameters[:, 5:]) / 128
    parameters[256, [0, 1, 5, 6, 7]] = 8.5, 8.5, 1, 1, 1
    expected = yield {"parameters": parameters, "width": 16, "height": 16}
    assert np.sum(parameters[:256, 5:], axis=0).max() < 1 < expected["sum"].value[8, 8].min()


@case("core", "render_sum", flags=["many"])
def splats_side_by_side_in_a_tile() -> Inputs:
    """289 splats, each on a pixel of its own: none is left out though they are more than 256."""
    rows = [splat(i + 0.5, j + 0.5, 0.125, 0.0, 0.125, (1 + i, 1 + j, 1)) for j in range(17) for i in range(17)]
    expected = yield {"parameters": splats(*rows), "width": 17, "height": 17}
    assert np.array_equal(expected["sum"].value[16, :, 0], np.arange(1, 18))


@case("core", "render_sum", flags=["many"])
def the_last_of_many(rng: Draws) -> Inputs:
    """300 splats outside of the frame, then one inside."""
    outside = population(rng, 300, 16, 16, radius=2.0) + np.eye(1, 8, dtype=np.float32) * 100
    expected = yield {"parameters": splats(outside, splat(6.4, 4.2, 2.0, 1.0, 1.5)), "width": 13, "height": 9}
    assert expected["sum"].value[4, 6, 2] > 1


@case("core", "render_sum", flags=["clamp"])
def above_one_and_below_zero() -> Inputs:
    """Sums of 3 and of -2.5: nothing is clamped before the sum is complete."""
    rows = [splat(3.5, 3.5, 1.5, 0.0, 1.5, (3.0, 3.0, 3.0)), splat(9.5, 3.5, 1.5, 0.0, 1.5, (-2.5, -2.5, -2.5))]
    both = [splat(6.5, 3.5, 1.5, 0.0, 1.5, (3.0, -2.5, 0.0)), splat(6.5, 3.5, 1.5, 0.0, 1.5, (-2.5, 3.0, 0.0))]
    expected = yield {"parameters": splats(*rows, *both), "width": 13, "height": 7}
    assert expected["sum"].value[3, 3].min() > 2.5
    assert expected["sum"].value[3, 9].max() < -2


@case("core", "render_sum")
def grey_of_large_colours() -> Inputs:
    """Colours of 10000 and -10000 that cancel to grey: binary32 keeps about three digits of it."""
    rows = [splat(6.4, 5.6, 2.5, 0.7, 2.0, (c, c, c)) for c in (1e4, -1e4, 0.5)]
    expected = yield {"parameters": splats(*rows), "width": 13, "height": 11}
    C, bound = expected["sum"].value, expected["sum"].bound
    assert 0.4 < C.max() < 0.5
    assert bound.max() < 0.1


SIZES = {"1x1": (1, 1), "1x17": (1, 17), "19x1": (19, 1), "16x16": (16, 16), "17x33": (17, 33), "31x8": (31, 8),
         "5x67": (5, 67)}  # fmt: skip


@case("core", "render_sum", flags=["odd-size", "transposed"], each=SIZES)
def size(value: tuple[int, int], rng: Draws) -> Inputs:
    """A frame of {key} pixels."""
    width, height = value
    parameters = population(rng, 11, width, height, radius=4.0)
    expected = yield {"parameters": parameters, "width": width, "height": height}
    assert expected["sum"].value.shape == (height, width, 3)
    assert expected["sum"].value.any()


@case("core", "render_sum", flags=["odd-size"], each={"101": (101, 43, 31), "400": (400, 64, 48)})
def many_splats(value: tuple[int, int, int], rng: Draws) -> Inputs:
    """{key} splats of natural sizes all over a frame, about ten on a pixel."""
    count, width, height = value
    expected = yield {"parameters": population(rng, count, width, height), "width": width, "height": height}
    assert np.median(expected["sum"].bound) < 1e-5


@case("core", "render_sum", flags=["clamp"])
def negative_colours(rng: Draws) -> Inputs:
    """Colours that are all negative."""
    parameters = population(rng, 13, 15, 11)
    parameters[:, 5:] = -abs(parameters[:, 5:])
    expected = yield {"parameters": parameters, "width": 15, "height": 11}
    assert expected["sum"].value.min() < -0.1
    assert expected["sum"].value.max() <= 0


@case("uncommon", "render_sum", flags=["many"])
def the_same_splat_again_and_again() -> Inputs:
    """One splat a hundred times."""
    expected = yield {"parameters": np.repeat(splat(5.2, 4.4, 1.5, 0.6, 1.25), 100, axis=0), "width": 11, "height": 9}
    assert expected["sum"].value[4, 5, 0] > 70


@case("core", "render_sum", flags=["many"])
def faint_after_bright() -> Inputs:
    """A bright splat before fifteen so faint that sums in binary16 lose each of them."""
    bright, faint = splat(8.5, 8.5, 4.0, 0.0, 4.0, (1, 1, 1)), splat(8.5, 8.5, 4.0, 0.0, 4.0, (FAINT, FAINT, FAINT))
    expected = yield {"parameters": splats(bright, *[faint] * 15), "width": 17, "height": 17}
    assert expected["sum"].value[8, 8, 0] == 1 + 15 * FAINT


@case("core", "render_sum", flags=["cancellation", "shear"])
def small_leaning_splats_far_down(rng: Draws) -> Inputs:
    """Small splats that lean, a thousand rows down a narrow frame.

    (j + 1/2) - (y + l21 u1) rounds l21 u1 to the steps of y; d_y - l21 u1 does not.
    """
    width, height, count = 3, 1201, 31
    rows: list[NDArray[np.float32]] = []
    while len(rows) < count:
        x, y = rng.uniform(0.2, 2.8), rng.uniform(1024, height)
        one = splat(x, y, rng.uniform(0.4, 0.6), rng.uniform(0.6, 0.9), rng.uniform(0.6, 0.9))
        if edge_margins(one, width, height)[0] > MIN_GUARDS:
            rows.append(one)
    parameters = splats(*rows)
    expected = yield {"parameters": parameters, "width": width, "height": height}
    reached = expected["sum"].value.any(axis=(1, 2))
    assert not reached[:1000].any()
    assert reached[1024:].mean() > 0.3
