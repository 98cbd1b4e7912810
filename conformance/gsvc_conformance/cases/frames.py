"""Frames of sums, and of splats (R-9.1-1)."""

import numpy as np
from numpy.typing import NDArray

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.splat_sets import population, splat, splats
from gsvc_conformance.cases.unusual_splats import DEGENERATE

F4 = NDArray[np.float32]

DEPTHS = {f"{bits}_bits": bits for bits in (8, 9, 10, 12, 16)}


def as_sum(values: NDArray[np.float64] | list[float], width: int = 16) -> F4:
    """Values in the three channels of a picture (H, width, 3) f4: in order, backwards, and moved on by one."""
    count = -(-len(values) // width) * width
    red = np.resize(np.asarray(values, np.float64), count)
    return np.stack([red, red[::-1], np.roll(red, 1)], axis=-1).reshape(-1, width, 3).astype(np.float32)


@case("core", "to_frame", flags=["bit-depth"], each=DEPTHS)
def codes(value: int) -> Inputs:
    """Every code of 8 bits, and as many spread over other depths, scaled to 0..1: each comes back ({key})."""
    peak = 2**value - 1
    wanted = np.rint(np.linspace(0, peak, 256))
    expected = yield {"sum": as_sum(wanted / peak), "bit_depth": value}
    frame = expected["frame"].value
    assert np.array_equal(frame, as_sum(wanted))
    assert frame.dtype == (np.uint8 if value == 8 else np.uint16)
    assert np.array_equal(expected["frame"].alternative, frame)


@case("core", "to_frame", flags=["ties", "bit-depth"], each=DEPTHS)
def near_half_steps(value: int) -> Inputs:
    """Values a hundredth of a step below and above half steps: they are rounded, not cut off ({key})."""
    peak = 2**value - 1
    steps = np.unique(np.rint(np.geomspace(1, peak - 1, 48)))
    below, above = steps - 0.51, steps - 0.49
    expected = yield {"sum": as_sum(np.stack([below, above], axis=1).ravel() / peak), "bit_depth": value}
    frame = expected["frame"].value[..., 0].ravel()
    assert np.array_equal(frame[: 2 * len(steps)], np.stack([steps - 1, steps], axis=1).ravel())
    if value < 16:
        assert expected["frame"].margin > 4 * expected["frame"].guard


@case("core", "to_frame", flags=["ties"], each=DEPTHS)
def the_half(value: int) -> Inputs:
    """One half is the only half step that is exact, and its even neighbour is above ({key})."""
    expected = yield {"sum": np.full((1, 1, 3), 0.5, np.float32), "bit_depth": value}
    assert expected["frame"].value.tolist() == [[[2 ** (value - 1)] * 3]]
    assert expected["frame"].alternative.tolist() == expected["frame"].value.tolist()


@case("uncommon", "to_frame", flags=["ties"])
def within_rounding_of_half_steps() -> Inputs:
    """Values as near to half steps as binary32 gets: with the rounding of the product, either neighbour is right."""
    expected = yield {"sum": as_sum((np.arange(255) + 0.5) / 255), "bit_depth": 8}
    differ = expected["frame"].alternative != expected["frame"].value
    assert np.count_nonzero(differ[..., 0]) >= 250


@case("core", "to_frame", flags=["clamp", "signed-zero"])
def outside_of_the_range() -> Inputs:
    """Values below 0 and above 1 are clamped: nothing wraps around."""
    values = [-0.0, -1e-30, -0.4, -1.0, -2.5, -300.0, -3e38, 1.0, 1.001, 1.5, 2.0, 257.0, 1e10, 3e38, 0.25, 0.75]
    expected = yield {"sum": as_sum(values), "bit_depth": 8}
    assert expected["frame"].value[0, :, 0].tolist() == [0] * 7 + [255] * 7 + [64, 191]


@case("stress", "to_frame", flags=["clamp", "subnormal"])
def small_and_large_numbers() -> Inputs:
    """Subnormal numbers and infinity, at 16 bits."""
    values = [2.0**-149, 1e-39, 2.0**-126, 1e-10, np.inf, -np.inf, 7.6e-6, 7.7e-6]
    expected = yield {"sum": as_sum(values, 8), "bit_depth": 16}
    assert expected["frame"].value[0, :, 0].tolist() == [0, 0, 0, 0, 65535, 0, 0, 1]


@case("core", "to_frame_deterministic", flags=["bit-depth"], each=DEPTHS)
def each_code(value: int) -> Inputs:
    """Every code of 8 bits, and as many spread over other depths: each comes back ({key})."""
    wanted = np.rint(np.linspace(0, 2**value - 1, 256))
    expected = yield {"sum": as_sum(wanted / (2**value - 1), 17), "bit_depth": value}
    assert np.array_equal(expected["frame"].value, as_sum(wanted, 17))


def _ties(bit_depth: int) -> F4:
    """Binary32 numbers whose product with the peak is a half step only once it is rounded, beyond it and before it.

    Of even half steps those whose exact product is above, of odd ones those below: rounded to even after the rounding
    of the product, they go the other way than by the exact product.
    """
    peak = 2**bit_depth - 1
    found = []
    for k in np.unique(np.rint(np.geomspace(1, peak - 1, 200))):
        near = np.float32((k + 0.5) / peak)
        for v in (np.nextafter(near, np.float32(0)), near, np.nextafter(near, np.float32(1))):
            exact = float(v) * peak
            if v * np.float32(peak) == k + 0.5 and (exact > k + 0.5 if k % 2 == 0 else exact < k + 0.5):
                found.append(v)
    return np.array(found, np.float32)


@case("core", "to_frame_deterministic", flags=["ties", "bit-depth"], each=DEPTHS)
def ties(value: int) -> Inputs:
    """Products that are half steps in binary32 and not before that rounding; they go to the even neighbour ({key})."""
    peak = 2**value - 1
    values = _ties(value)
    expected = yield {"sum": as_sum(values.astype(np.float64), 11), "bit_depth": value}
    frame = expected["frame"].value[..., 0].ravel()[: len(values)]
    assert len(values) > 8
    assert np.all(frame % 2 == 0)
    assert np.all(frame != np.rint(values.astype(np.float64) * peak))
    assert len(np.unique(np.floor(values * np.float32(peak) + 0.5) == frame)) == 2


@case("core", "to_frame_deterministic", flags=["clamp", "nan", "signed-zero"])
def what_is_no_colour() -> Inputs:
    """NaN is black, and so is -0 and all below it; infinity is white."""
    values = [np.nan, -np.nan, -0.0, 0.0, -1e-39, -0.4, -np.inf, -3e38, 1.0, 1.001, 2.0, 257.0, 3e38, np.inf, 0.25, 0.5]
    expected = yield {"sum": as_sum(values), "bit_depth": 8}
    assert expected["frame"].value[0, :, 0].tolist() == [0] * 8 + [255] * 6 + [64, 128]


@case("core", "to_frame_deterministic", flags=["ties", "subnormal"])
def next_to_steps() -> Inputs:
    """The numbers next to 0, to the first half step and to 1: a half added before cutting off rounds up one of them."""
    half = np.float32(0.5 / 255)
    values = [2.0**-149, 2.0**-126, np.nextafter(half, np.float32(0)), half, np.nextafter(half, np.float32(1))]
    values += [float(np.nextafter(np.float32(1), np.float32(0))), 254.5 / 255]
    expected = yield {"sum": as_sum([float(v) for v in values], 7), "bit_depth": 8}
    assert expected["frame"].value[0, :2, 0].tolist() == [0, 0]


@case("core", "render_frame", flags=["empty", "bit-depth"], each=DEPTHS)
def no_splats(value: int) -> Inputs:
    """A frame without splats is black ({key})."""
    expected = yield {"parameters": splats(), "width": 5, "height": 3, "bit_depth": value}
    assert not expected["frame"].highest.any()


@case("core", "render_frame", flags=["clamp"])
def clamped_at_the_end() -> Inputs:
    """Splats of 3 and then of -2.5 at one place: 0.5, since nothing is clamped before the sum is complete."""
    colors = [(3.0, -2.5, 0.5), (-2.5, 3.0, 0.0)]
    parameters = splats(*(splat(6.5, 4.5, 2.0, 0.5, 1.5, color) for color in colors))
    expected = yield {"parameters": parameters, "width": 13, "height": 9, "bit_depth": 8}
    frame = expected["frame"]
    assert set(frame.lowest[4, 6]) | set(frame.highest[4, 6]) <= {127, 128}


@case("core", "render_frame", flags=["clamp"])
def beyond_black_and_white() -> Inputs:
    """Sums far below 0 and far above 1."""
    colors = [(9.0, 1.5, -0.5), (-9.0, -0.25, 2.0)]
    parameters = splats(*(splat(4.5 + 7 * k, 4.5, 1.5, 0.3, 1.5, color) for k, color in enumerate(colors)))
    expected = yield {"parameters": parameters, "width": 16, "height": 9, "bit_depth": 8}
    assert expected["frame"].lowest[4, 4].tolist() == expected["frame"].highest[4, 4].tolist() == [255, 255, 0]
    assert expected["frame"].lowest[4, 11].tolist() == expected["frame"].highest[4, 11].tolist() == [0, 0, 255]


@case("core", "render_frame", flags=["channel-order", "transposed", "pixel-centre"])
def where_and_which() -> Inputs:
    """Three splats in three corners of a frame that is not square, in three colours."""
    places = [(2.5, 1.5, (1.0, 0.25, 0.0)), (16.5, 1.5, (0.0, 1.0, 0.25)), (2.5, 8.5, (0.25, 0.0, 1.0))]
    parameters = splats(*(splat(x, y, 0.9, 0.2, 0.8, color) for x, y, color in places))
    expected = yield {"parameters": parameters, "width": 19, "height": 11, "bit_depth": 8}
    frame = expected["frame"].value
    assert frame[1, 2].tolist() == [255, 64, 0]
    assert frame[1, 16].tolist() == [0, 255, 64]
    assert frame[8, 2].tolist() == [64, 0, 255]


@case("core", "render_frame", flags=["bit-depth", "odd-size"], each=DEPTHS)
def depth(value: int, rng: Draws) -> Inputs:
    """A small frame of {key}."""
    expected = yield {"parameters": population(rng, 23, 25, 18), "width": 25, "height": 18, "bit_depth": value}
    frame = expected["frame"]
    exact = frame.lowest == frame.highest
    assert np.mean(exact) > (0.9 if value < 16 else 0.2)
    assert np.all(frame.highest[~exact] - frame.lowest[~exact] <= (1 if value < 16 else 3))


@case("core", "render_frame", flags=["many", "odd-size"])
def a_frame(rng: Draws) -> Inputs:
    """A frame of 307 splats, several tiles of any size in use."""
    expected = yield {"parameters": population(rng, 307, 61, 47), "width": 61, "height": 47, "bit_depth": 8}
    assert np.mean(expected["frame"].lowest == expected["frame"].highest) > 0.99


@case("core", "render_frame", flags=["support"])
def the_edge_of_a_bright_splat() -> Inputs:
    """A splat of colour 40 ends at a sum of 0.157: one sees where, and that it ends."""
    parameters = splat(12.5, 9.5, 3.0, 1.0, 2.5, (40.0, 40.0, 40.0))
    expected = yield {"parameters": parameters, "width": 25, "height": 19, "bit_depth": 8}
    frame = expected["frame"].value
    assert not np.any((frame > 0) & (frame < 40))


@case("core", "render_frame", flags=["degenerate"], rules=["R-9.1-2"])
def degenerate_splats() -> Inputs:
    """Degenerate splats of all kinds on pixel centres: the frame stays black."""
    rows = [splat(k + 0.5, 2.5, l11, 0.0, l22, (1, 1, 1)) for k, (l11, l22) in enumerate(DEGENERATE.values())]
    expected = yield {"parameters": splats(*rows), "width": len(rows), "height": 5, "bit_depth": 8}
    assert not expected["frame"].highest.any()


@case("core", "render_frame", flags=["many"])
def splats_on_one_tile(rng: Draws) -> Inputs:
    """300 splats over the same 16x16 pixels: first 256 dark ones, then 44 bright ones."""
    parameters = population(rng, 300, 16, 16, radius=4.0)
    parameters[:, :2] = 8 + (parameters[:, :2] - 8) / 4
    parameters[:, 5:] = np.where(np.arange(300) < 256, 1 / 2048, 1 / 64)[:, None]
    expected = yield {"parameters": parameters, "width": 16, "height": 16, "bit_depth": 8}
    assert expected["frame"].value[8, 8, 0] > 64


@case("uncommon", "render_frame", flags=["degenerate", "needle"], rules=["R-9.1-2"])
def among_degenerate_splats(rng: Draws) -> Inputs:
    """Needles and degenerate splats among others, at 10 bits."""
    parameters = population(rng, 17, 21, 16)
    parameters[3::4, 4] = 0.02
    parameters[5::6, 2] = 0
    expected = yield {"parameters": parameters, "width": 21, "height": 16, "bit_depth": 10}
    assert np.mean(expected["frame"].lowest == expected["frame"].highest) > 0.9


@case("uncommon", "render_frame", flags=["odd-size"], each={"1x1": (1, 1), "1x13": (1, 13), "37x1": (37, 1)})
def narrow(value: tuple[int, int], rng: Draws) -> Inputs:
    """A frame of {key} pixels."""
    width, height = value
    parameters = population(rng, 7, width, height, radius=4.0)
    expected = yield {"parameters": parameters, "width": width, "height": height, "bit_depth": 8}
    assert expected["frame"].value.shape == (height, width, 3)


@case("stress", "render_frame", flags=["overflow"])
def extreme_splats() -> Inputs:
    """Centres, factors and colours at the ends of binary32: every pixel is a number."""
    rows = [
        splat(3e9, -2e12, 4.0, 1.0, 4.0),
        splat(1e38, -3e38, 5.0, 0.0, 5.0),
        splat(10.0, 10.0, 1e30, 0.0, 1e32, (0.25, 0.25, 0.25)),
        splat(5.5, 4.5, 2.0**-126, 0.0, 2.0**-126),
        splat(5.5, 4.0, 1e-20, 5.0, 4.0, (1e30, -1e30, 1e-39)),
        splat(5.0, 3.5, 4.0, 0.0, 1e-30),
    ]
    expected = yield {"parameters": splats(*rows), "width": 11, "height": 9, "bit_depth": 12}
    assert expected["frame"].value[0, 0].tolist() == [1024, 1024, 1024]
    assert expected["frame"].highest[0, 5].tolist() == [4095, 0, 1024]
