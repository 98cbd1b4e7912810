"""Hard cases of sums and frames: `tests/hard_cases` measures them against 60 digits."""

import numpy as np

from gsvc_base.draws import Draws
from gsvc_base.portable import exp
from gsvc_conformance.case import FULL, Inputs, case
from gsvc_conformance.cases.building import on
from gsvc_conformance.cases.hard_shapes import (
    HEIGHT,
    NOT_QUITE,
    SHAPES,
    TARGETS,
    WIDTH,
    Shape,
    at_the_edge,
    in_channels,
    odd_numbers,
)
from gsvc_conformance.cases.splat_sets import splat, splats

SIZE = {"width": WIDTH, "height": HEIGHT}

BOTH = ("render_sum", "render_sum_deterministic")
"""The operations of sums."""

WHAT_THEY_ARE = {
    "needles_that_lie": "needles of aspect 10000 at 0.001, 20 and 45 degrees to the rows",
    "needles_that_stand": "needles of aspect 10000 at 70, 89.999 and 120 degrees to the rows",
    "specks": "splats of a millionth to a hundredth of a pixel, a deviation or so off a pixel's centre",
    "thousands_of_frames": "a thousand, a hundred thousand and a million times as large as the frame",
    "leaning_bands": "bands of one or two pixels that lean, a thousand to a million frames long",
    "shear_of_1e6_to_1e30": "l21 of 1e6, 5e17 and 1e30",
    "smallest_l11_or_l22": "l11 or l22 is the smallest normal number, or both are 2^-62",
    "a_million_pixels_away": "their centres a million pixels away, their edge or flank in the frame",
    "a_line_from_a_million_pixels_away": "narrow splats through the frame with centres a million pixels away",
}
"""Words for them in titles."""

SIDES = {"on": 0, "inside": -1, "outside": 1}
WHERE = {
    "on": "as near to ln 255 as binary32 positions allow",
    "inside": "the nearest below ln 255 that is certain in binary32",
    "outside": "the nearest above ln 255 that is certain in binary32",
}
"""Words for the sides in titles."""


TO_THE_BIT = (
    "needles_that_lie",
    "specks",
    "leaning_bands",
    "shear_of_1e6_to_1e30",
    "a_line_from_a_million_pixels_away",
)
"""Those that are vectors of deterministic rendering as well."""


@case("stress", "render_sum", flags=["hard", "needle", "cancellation"], each=SHAPES, said=WHAT_THEY_ARE)
@case("stress", "render_sum_deterministic", flags=["hard", "needle", "cancellation"],
      each={key: SHAPES[key] for key in TO_THE_BIT}, said=WHAT_THEY_ARE)  # fmt: skip
def hard(value: tuple[Shape, Shape, Shape]) -> Inputs:
    """Three splats, one in each channel: {key}."""
    expected = yield {"parameters": in_channels(value), **SIZE}
    assert expected["sum"].value.any(axis=(0, 1)).all()


@case("stress", "render_sum", flags=["hard", "support"])
def hard_ends_before_the_frame() -> Inputs:
    """Splats a million pixels away that end before the frame, by less than a thousandth of their size: nothing."""
    rows = [splat(*shape, (1e3, 1e3, 1e3)) for shape in NOT_QUITE]
    expected = yield {"parameters": splats(*rows), **SIZE}
    assert not expected["sum"].value.any()


@on("stress", *BOTH, flags=["hard", "support"], each=SIDES, said=WHERE)
def hard_coverage(value: int) -> Inputs:
    """Three splats, round, leaning and thin, each with a pixel whose sigma is {key}."""
    expected = yield {"parameters": at_the_edge(value), **SIZE}
    covered = [expected["sum"].value[j, i, k] != 0 for k, (i, j) in enumerate(TARGETS)]
    assert value == 0 or covered == [value < 0] * 3


@on("stress", *BOTH, flags=["hard", "subnormal", "signed-zero", "degenerate"])
def hard_parameters() -> Inputs:
    """Each parameter in turn is minus zero, subnormal, negative and subnormal; such an l11 or l22 is degenerate."""
    expected = yield {"parameters": odd_numbers(), "width": 2, "height": 2}
    assert np.isfinite(expected["sum"].value).all()


@case("stress", "render_sum", flags=["hard", "many"], each={"1024": 1024})
@case(FULL, "render_sum", flags=["hard", "many"], each={"2048": 2048})
def hard_splats_on_a_pixel(value: int, rng: Draws) -> Inputs:
    """{key} splats on a frame of one pixel, of both signs and of sizes from 1 to 1e-5: all of them are seen."""
    parameters = np.tile(splat(0.5, 0.5, 1.0, 0.0, 1.0), (value, 1))
    parameters[:, :5] += rng.uniform(-0.5, 0.5, (value, 5))
    parameters[:, 5:] = rng.normal(0, 1, (value, 3)) * exp(rng.uniform(-11.5, 0, (value, 1)))
    expected = yield {"parameters": parameters, "width": 1, "height": 1}
    assert np.all(expected["sum"].bound < 0.1)


@on("stress", *BOTH, flags=["hard", "cancellation"])
def hard_grey_of_colours_of_10000(rng: Draws) -> Inputs:
    """Twenty splats with colours of 10000 and -10000 in pairs, and one that is grey: grey is what is left."""
    rows = []
    for _ in range(10):
        one = splat(3.5 + rng.uniform(-1, 1), 2.5 + rng.uniform(-1, 1), 2.5, rng.uniform(-1, 1), 2.0, (1e4,) * 3)
        rows += [one, one * np.array([1, 1, 1, 1, 1, -1, -1, -1], np.float32)]
    parameters = splats(*rows)[rng.permutation(20)]
    expected = yield {"parameters": splats(parameters, splat(3.5, 2.5, 1e3, 0.0, 1e3, (0.5, 0.5, 0.5))), **SIZE}
    assert abs(expected["sum"].value - 0.5).max() < 0.1


TIES = {"8_bits": 8, "16_bits": 16}


@on(
    "stress", "to_frame", "to_frame_deterministic", flags=["hard", "ties", "bit-depth"], each=TIES,
    said={"8_bits": "8 bits", "16_bits": "16 bits"},
)  # fmt: skip
def hard_ties(value: int) -> Inputs:
    """Samples of {key} on the tie at 1/2 and a step to its sides, nearest to other halves, and at the ends."""
    peak = 2**value - 1
    halves = ((np.array([0, 1, 2, peak // 2, peak - 2, peak - 1]) + 0.5) / peak).astype(np.float32)
    ends = np.array([0.5, 0.0, -0.0, 1.0, 2.0**-149, -(2.0**-149), 3e38, -3e38, 0.25 / peak], np.float32)
    numbers = np.concatenate([halves, ends])
    steps = [np.nextafter(numbers, np.float32(end)) for end in (-np.inf, np.inf)]
    expected = yield {"sum": np.stack([steps[0], numbers, steps[1]])[..., None].repeat(3, axis=2), "bit_depth": value}
    assert expected["frame"].value[1, 6, 0] == 2 ** (value - 1)
