"""Cases of rendering work: how many pixels the boxes of splats hold, in binary64 and exactly, and in integers."""

from typing import Any, Final

import numpy as np

from gsvc_base import spec
from gsvc_base.constants import LN_255
from gsvc_base.draws import Draws
from gsvc_base.portable import exp
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.building import Array, result
from gsvc_conformance.cases.states import ints, painted, state

RADIUS: Final = 3.3290429691304455 * (1 + 2.0**-17)
"""ρ′ of section 5."""


def splats(*rows: tuple[float, float, float, float, float]) -> Array:
    """Parameters (N, 8) f4 of x, y, l11, l21, l22; the colours play no part."""
    return np.array([(*row, 1, 1, 1) for row in rows], np.float32)


BOXES: Final[dict[str, tuple[Any, int]]] = {
    "inside": ((10, 8, 1, 0, 1), 8 * 8),
    "sheared": ((10.5, 8.5, 1, 0.5, 1), 7 * 11),
    "sheared_the_other_way": ((10.5, 8.5, 1, -0.5, 1), 7 * 11),
    "at_the_left": ((0, 8, 1, 0, 1), 4 * 8),
    "at_the_bottom": ((10, 17, 1, 0, 1), 8 * 4),
    "in_the_corner": ((24, 17, 1, 0, 1), 4 * 4),
    "beyond_the_left": ((-3.5, 8, 1, 0, 1), 0),
    "just_not_beyond": ((-3.25, 8, 1, 0, 1), 1 * 8),
    "far_away": ((3e38, -3e38, 1, 0, 1), 0),
    "as_large_as_the_frame": ((12, 8, 3e38, 0, 3e38), 24 * 17),
    "sheared_to_infinity": ((12, 8, 1, 3e38, 3e38), 8 * 17),
}
"""Splats on a frame of 24 by 17 pixels, and the pixels of their boxes."""


@case("core", "rendering_work", each=BOXES,
      said={"inside": "inside the frame", "beyond_the_left": "beyond the left side", "at_the_left": "at the left side",
            "just_not_beyond": "just not beyond the left side"})  # fmt: skip
def box(value: tuple[Any, int]) -> Inputs:
    """The box of a splat {key}, clipped to the frame."""
    expected = yield {"parameters": splats(value[0]), "width": 24, "height": 17}
    assert result(expected, "work") == value[1]


@case("core", "rendering_work", flags=["limit", "clamp"], each={"beyond": 3e9, "below": -3e9})
def box_31_bits(value: float) -> Inputs:
    """Splats so far {key} the frame that the edges of their boxes fit no signed 32-bit integer: not a pixel."""
    parameters = splats((value, 8, 1e3, 0, 1e3), (12, value, 1e3, 0, 1e3))
    expected = yield {"parameters": parameters, "width": 24, "height": 17}
    assert result(expected, "work") == 0


SMALLEST: Final = 2.0**-126
NO_BOX: Final = {
    "l11_zero": (0, 0, 1),
    "l22_zero": (1, 0, 0),
    "l11_subnormal": (SMALLEST / 2, 0, 1),
    "l22_negative": (1, 0, -1),
    "l11_negative": (-1, 0, 1),
}


@case(
    "core",
    "rendering_work",
    flags=["degenerate"],
    rules=["R-9.1-2"],
    each=NO_BOX,
    said={key: key.replace("_", " is ") for key in NO_BOX},
)
def degenerate(value: tuple[float, float, float]) -> Inputs:
    """A degenerate splat has no box: {key}."""
    l11, _, l22 = value
    expected = yield {"parameters": splats((4.5, 4.5, *value), (4.5, 4.5, l11, 2, l22)), "width": 9, "height": 9}
    assert result(expected, "work") == 0


@case("core", "rendering_work", flags=["degenerate"], rules=["R-9.1-2"])
def smallest_factor() -> Inputs:
    """l11 and l22 of 2^-126 are not degenerate: between pixel edges the box is one pixel, on an edge none."""
    expected = yield {"parameters": splats((4.5, 4.5, SMALLEST, 0, SMALLEST), (4, 4, SMALLEST, 0, SMALLEST)),
                      "width": 9, "height": 9}  # fmt: skip
    assert result(expected, "work") == 1


@case("core", "rendering_work")
def no_splats() -> Inputs:
    """No splats, no work."""
    expected = yield {"parameters": splats().reshape(0, 8), "width": 9, "height": 9}
    assert result(expected, "work") == 0


@case("core", "rendering_work", flags=["limit"])
def sums_in_binary64() -> Inputs:
    """The edge x - e_x is a hair beyond an integer, which binary32 does not see: a column more."""
    l11 = np.float32(2 / RADIUS)
    reach = RADIUS * float(l11)
    assert np.float32(reach) == 2
    assert reach != 2
    expected = yield {"parameters": splats((6, 6, float(l11), 0, 1)), "width": 12, "height": 12}
    assert result(expected, "work") == (4 if reach < 2 else 6) * 8


@case("core", "rendering_work", flags=["limit"])
def sums_of_rows_in_binary64() -> Inputs:
    """The edge y - e_y is a hair below an integer, which e_y in binary32 does not see: a row more."""
    parameters = splats((8, 2048.75, 1, 36.132515, 127.20147))
    _, _, _, l21, l22, *_ = parameters[0].tolist()
    narrow = float(np.float32(RADIUS) * np.float32(l21 + l22))
    assert np.floor(2048.75 - RADIUS * (l21 + l22)) == np.floor(2048.75 - narrow) - 1
    expected = yield {"parameters": parameters, "width": 16, "height": 4096}
    assert result(expected, "work") == 8 * 1089


@case("core", "rendering_work", flags=["many"])
def many_boxes(rng: Draws) -> Inputs:
    """A hundred splats of all sizes, on the frame and around it."""
    places = rng.uniform(-20, 60, (97, 2))
    factors = exp(rng.uniform(-3, 3, (97, 3))) * [1, -1, 1]
    parameters = np.column_stack([places, factors, np.ones((97, 3))]).astype(np.float32)
    expected = yield {"parameters": parameters, "width": 40, "height": 27}
    assert 0 < result(expected, "work") < 97 * 40 * 27


@case("stress", "rendering_work", flags=["overflow", "limit"])
def beyond_32_bits() -> Inputs:
    """Nine splats that cover 2^29 pixels: the work exceeds 32 bits."""
    expected = yield {"parameters": splats(*[(0, 0, 3e38, -3e38, 3e38)] * 9), "width": 32768, "height": 16384}
    assert result(expected, "work") == 9 << 29


ROUNDED_ONCE: Final = {
    "of_the_radius": (("0x1.9bc3aep+5", "0x1.cea5f6p+11", "0x1.c8e2b6p+11"), 24541),
    "of_the_sum": (("0x1.1152d4p+8", "0x1.c9437ep+11", "0x1.396f7p+11"), 20799),
}


@case("stress", "rendering_work", flags=["limit"], each=ROUNDED_ONCE,
      said={"of_the_radius": "with rho' in binary32", "of_the_sum": "with |l21| + l22 in binary32"})  # fmt: skip
def binary64_far_down(value: tuple[tuple[str, str, str], int]) -> Inputs:
    """The lower edge of a box, tens of thousands of rows down, ends just before the next row; {key} it reaches it."""
    y, l21, l22 = (float.fromhex(number) for number in value[0])
    expected = yield {"parameters": splats((0.5, y, 0.125, l21, l22)), "width": 1, "height": 32768}
    assert result(expected, "work") == value[1]


@case("stress", "rendering_work", flags=["limit"])
def covered_by_rounding() -> Inputs:
    """A splat 10^9 pixels away and as large: its support ends 8 pixels before the frame, and (9-4) covers all of it."""
    x, l11 = -1.5 * 2.0**29, 241903264.0
    assert -8 < x + 3.3290429691304455 * l11 < -7
    u1 = (np.float32(23.5) - np.float32(x)) * (np.float32(1) / np.float32(l11))
    assert u1 * u1 <= np.float32(2 * LN_255)
    expected = yield {"parameters": splats((x, 8, l11, 0, 1e6)), "width": 24, "height": 17}
    assert result(expected, "work") == 24 * 17


# --- Of states, by (5-2) ---------------------------------------------------------------------------------------------


def pairs(rows: Array, width: int = 24, height: int = 17, halvings: int = 0) -> dict[str, Any]:
    """Inputs of main_work."""
    return {"state": rows, "width": width, "height": height, "halvings": halvings}


def middle(x: float, y: float, **others: int) -> dict[str, int]:
    """A state by its place in pixels."""
    return {"X": round(256 * x), "Y": round(256 * y), **others}


STATE_BOXES: Final[dict[str, tuple[dict[str, int], int]]] = {
    "inside": (middle(10, 8), 8 * 8),
    "sheared": (middle(10.5, 8.5, S=512), 7 * 11),
    "sheared_the_other_way": (middle(10.5, 8.5, S=-512), 7 * 11),
    "at_the_left": (middle(0, 8), 4 * 8),
    "at_the_bottom": (middle(10, 17), 8 * 4),
    "in_the_corner": (middle(24, 17), 4 * 4),
    "beyond_the_left": (middle(-3.5, 8), 0),
    "just_not_beyond": (middle(-3.25, 8), 1 * 8),
    "wide": (middle(10, 8, A=1024), 14 * 8),
    "high": (middle(10, 8, B=1024), 8 * 14),
    "far_away": ({"X": 2**24, "Y": -(2**24)}, 0),
    "as_large_as_the_frame": (middle(12, 8, A=13311, B=13311), 24 * 17),
}
"""Splats on a frame of 24 by 17 pixels, and the pixels of their boxes."""


@case("core", "main_work", each=STATE_BOXES,
      said={"inside": "inside the frame", "beyond_the_left": "beyond the left side", "at_the_left": "at the left side",
            "just_not_beyond": "just not beyond the left side"})  # fmt: skip
def box_of_state(value: tuple[dict[str, int], int]) -> Inputs:
    """The box of a splat {key}, clipped to the frame."""
    expected = yield pairs(state(value[0]))
    assert result(expected, "work") == value[1]


@case("core", "main_work", flags=["limit"])
def sides_at_a_pixel_edge() -> Inputs:
    """Sides of boxes on an edge of pixels, 1/256 pixel before it and after it: E and the box are rounded outwards."""
    A = ints(range(-3072, 4097, 512))
    reach = spec.main_reach(A)
    rows = [
        {"X": 256 * 200 + sign * int(E) + near, "Y": 256 * 150 + sign * (int(E) + int(E == 0)) + near, "A": a, "B": a}
        for a, E in zip(A.tolist(), reach, strict=True) for sign in (1, -1) for near in (-1, 0, 1)
    ]  # fmt: skip
    expected = yield pairs(state(*rows), 400, 300)
    assert result(expected, "work") > 0


@case("core", "main_work")
def work_of_all_sizes() -> Inputs:
    """Splats of all octaves, sheared by all degrees, in the middle of a large frame."""
    rows = [
        middle(4000, 3000, A=a, B=b, S=s)
        for a, b in zip(range(-3072, 13312, 1001), range(13311, -3073, -1001), strict=False)
        for s in (0, 1, -77, 1024, -32767)
    ]
    expected = yield pairs(state(*rows), 8000, 6000)
    assert result(expected, "work") > 2**20


@case("core", "main_work", each={str(h): h for h in range(4)})
def halved(value: int, rng: Draws) -> Inputs:
    """A frame of 351x287 that is halved {key} times: its sides are rounded up, and boxes get larger by the filter."""
    corner = state(middle(350.9, 286.9, A=-3072, B=-3072), middle(0, 0, A=-3072, B=-3072), middle(175.5, 144))
    expected = yield pairs(np.concatenate([painted(rng, 60), corner]), 351, 287, value)
    assert result(expected, "work") > 0


@case("core", "main_work", flags=["many"])
def many_boxes_of_states(rng: Draws) -> Inputs:
    """300 splats of a frame of 352x288."""
    expected = yield pairs(painted(rng, 300), 352, 288)
    assert result(expected, "work") > 300


@case("core", "main_work", flags=["empty"])
def no_states() -> Inputs:
    """No splats, no work."""
    expected = yield pairs(state())
    assert result(expected, "work") == 0


@case("stress", "main_work", flags=["overflow", "limit"])
def states_beyond_32_bits() -> Inputs:
    """Nine splats that cover 2^29 pixels: the work exceeds 32 bits."""
    rows = state(*[middle(16000, 8000, A=13311, B=13311, S=s) for s in (0, 1, -1, 5000, -5000, 32767, -32767, 9, 99)])
    expected = yield pairs(rows, 32768, 16384)
    assert result(expected, "work") == 9 << 29


@case("stress", "main_work", flags=["overflow", "clamp"], each={"whole": 0, "halved": 3})
def work_at_the_ends(value: int) -> Inputs:
    """The ends of all ranges in the largest frame, {key}: no product exceeds 32 bits, and boxes beyond it are empty."""
    rows = [
        {"X": x, "Y": y, "A": a, "B": b, "S": s}
        for x in (-(2**24), 2**24) for y in (-(2**24), 2**24) for a in (-3072, 13311) for b in (-3072, 13311)
        for s in (-32767, 0, 32767)
    ]  # fmt: skip
    expected = yield pairs(state(*rows), 65535, 65535, value)
    assert result(expected, "work") > 0
