"""Plain pictures, as trainers with a sigmoid make them: colours from 0 to 1, no sum above 1, no needle."""

from collections.abc import Callable
from typing import Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.gradients import noise
from gsvc_conformance.cases.splat_sets import F4, population, splat, splats

Picture = tuple[F4, int, int]
"""The splats of a picture, (N, 8) f4, its width and its height."""
PASTEL: Final = (0.625, 0.25, 0.75)


def turned(cosine: int, sine: int, whole: int, x: float = 10.3, y: float = 8.6) -> F4:
    """A splat of the scales 4 and 1.5, turned by the angle of cosine / whole and sine / whole."""
    c, s = cosine / whole, sine / whole
    a, b, d = 16 * c * c + 2.25 * s * s, (16 - 2.25) * c * s, 16 * s * s + 2.25 * c * c
    l11 = np.sqrt(a)
    return splat(x, y, float(l11), float(b / l11), float(np.sqrt(d - (b / l11) ** 2)), PASTEL)


def scattered(rng: Draws, count: int, width: int, height: int, radius: float, most: float = 0.5) -> Picture:
    """Splats all over a frame, drawn with colours up to `most`."""
    rows = population(rng, count, width, height, radius)
    rows[:, 5:] = rng.uniform(0.02, most, (count, 3))
    return rows, width, height


def at(*places: tuple[float, float]) -> F4:
    """Splats at some places, each of other colours and another shape."""
    rows = [
        splat(x, y, 1.75 + k % 3 / 2, 0.5 - k % 4 / 4, 2.25 - k % 2 / 2, (0.1 + k % 5 / 8, 0.7 - k % 3 / 4, 0.4))
        for k, (x, y) in enumerate(places)
    ]
    return splats(*rows)


def _of_one(rows: F4) -> Callable[[Draws], Picture]:
    return lambda _: (rows, 21, 17)


PICTURES: Final[dict[str, Callable[[Draws], Picture]]] = {
    "a_round_splat": _of_one(splat(10.5, 8.5, 2.5, 0, 2.5, PASTEL)),
    "a_wide_splat": _of_one(splat(9.75, 8.25, 4, 0, 1.5, PASTEL)),
    "a_high_splat": _of_one(splat(11.25, 7.75, 1.5, 0, 4, PASTEL)),
    "a_white_splat": _of_one(splat(10.25, 8.5, 2, 0.5, 2, (1, 1, 1))),
    "a_splat_turned_by_23_degrees": _of_one(turned(12, 5, 13)),
    "a_splat_turned_by_37_degrees": _of_one(turned(4, 3, 5)),
    "a_splat_turned_by_53_degrees": _of_one(turned(3, 4, 5)),
    "a_splat_turned_by_67_degrees": _of_one(turned(5, 12, 13)),
    "a_splat_turned_by_127_degrees": _of_one(turned(-3, 4, 5)),
    "a_splat_turned_by_157_degrees": _of_one(turned(-12, 5, 13)),
    "two_splats_apart": _of_one(at((5.5, 6.25), (16.25, 11.5))),
    "two_splats_over_each_other": _of_one(at((9.5, 8.25), (11.75, 9.5))),
    "splats_on_the_borders": _of_one(at((0, 8), (21, 7), (10, 0), (9, 17))),
    "splats_in_the_corners": _of_one(at((1, 1), (20, 1), (1, 16), (20, 16))),
    "red_green_and_blue": _of_one(
        splats(*(splat(4.5 + 6 * k, 8.5, 1.75, 0.25, 1.75, np.eye(3)[k].tolist()) for k in range(3)))
    ),
    "16x16_pixels": lambda rng: scattered(rng, 9, 16, 16, 1.5),
    "24x16_pixels": lambda rng: scattered(rng, 12, 24, 16, 1.5),
    "17x23_pixels": lambda rng: scattered(rng, 12, 17, 23, 1.5),
    "32x32_pixels": lambda rng: scattered(rng, 20, 32, 32, 2.0),
    "40_splats": lambda rng: scattered(rng, 40, 24, 20, 2.0, 0.3),
    "100_splats": lambda rng: scattered(rng, 100, 24, 20, 2.0, 0.1),
    "300_splats": lambda rng: scattered(rng, 300, 24, 20, 2.0, 0.04),
    "30_small_splats": lambda rng: scattered(rng, 30, 24, 20, 0.75),
    "8_large_splats": lambda rng: scattered(rng, 8, 24, 20, 8.0, 0.4),
}  # fmt: skip
"""Pictures by what is on them."""


@case("core", "render_sum", each=PICTURES)
def plain(value: Callable[[Draws], Picture], rng: Draws) -> Inputs:
    """A plain picture of {key}: colours and sums are 0 to 1, so that code that clamps them can be asked, too."""
    parameters, width, height = value(rng)
    expected = yield {"parameters": parameters, "width": width, "height": height}
    assert parameters[:, 5:].min() >= 0
    assert 0.2 < expected["sum"].value.max() <= 1


@case("core", "render_frame", each={key: PICTURES[key] for key in list(PICTURES)[4::4]})
def plain_frame(value: Callable[[Draws], Picture], rng: Draws) -> Inputs:
    """A plain picture of {key}, in 8 bits."""
    parameters, width, height = value(rng)
    expected = yield {"parameters": parameters, "width": width, "height": height, "bit_depth": 8}
    assert 50 < expected["frame"].value.max() <= 255


@case("core", "render_gradients", each=PICTURES)
def gradients_of_a_plain_picture(value: Callable[[Draws], Picture], rng: Draws) -> Inputs:
    """Gradients of a plain picture of {key}, whose colours and sums are 0 to 1."""
    parameters, width, height = value(rng)
    expected = yield {"parameters": parameters, "residual": noise(rng, width, height)}
    assert expected["gradients"].value.any()
