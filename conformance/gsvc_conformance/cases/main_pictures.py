"""Streams of profile `main` drawn to pixels (spec.md sections 9.1 and 9.3); those with layers are in `main_layers`."""

from dataclasses import replace
from typing import Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.building import on, result
from gsvc_conformance.cases.main_layers import BASE, LAYERS, with_layers
from gsvc_conformance.cases.main_streams import (
    MAIN_HEADER,
    Plan,
    crowd,
    densities_for,
    main_stream,
    one,
)
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.main.cells import cell_counts, cell_order
from gsvc_ref.main.codes import IntraCodes, MainCodes
from gsvc_ref.main.densities import Density
from gsvc_ref.testing import write_stream

FRAMES: Final = ("decode_stream", "decode_stream_deterministic")


@on("core", *FRAMES)
def main_picture_of_one_splat() -> Inputs:
    """A P-frame moves the splat of an I-frame by 2 pixels to the right, and an R-frame shows it again."""
    vectors = np.full((1, 1, 2), (8, 0), np.int64)
    moved = MainCodes(type="P", quantizer=24, motion_cell=1, vectors=vectors, modes=np.zeros(1, np.int64),
                      differences=np.zeros((1, 8), np.int64))  # fmt: skip
    stream = write_stream(MAIN_HEADER, [one(), moved, MainCodes.repeated_frame()], index=False)
    expected = yield {"stream": stream}
    first, second, third = result(expected, "frames")
    assert np.array_equal(first[:, :-2], second[:, 2:])
    assert np.array_equal(second, third)


@on("core", *FRAMES, flags=["bit-depth"], each={str(depth): depth for depth in range(8, 17)})
def main_bit_depth(value: int) -> Inputs:
    """Frames I and P of {key} bits a sample; the splats are the same at all depths."""
    plans = Plan("I", 12, 56), Plan("P", 2, 56, motion_cell=3)
    expected = yield {"stream": main_stream(Draws(8), *plans, bit_depth=value, width=23, height=17)}
    assert result(expected, "frames").max() > 2 ** (value - 1)


@on("core", *FRAMES, flags=["empty"])
def main_pictures_without_splats(rng: Draws) -> Inputs:
    """Frames I, P and R without splats are black, and then a P-frame has some."""
    expected = yield {"stream": main_stream(rng, Plan("I"), Plan("P"), Plan("R"), Plan("P", 20, 40))}
    assert result(expected, "frames").any(axis=(1, 2, 3)).tolist() == [False, False, False, True]


@on("core", *FRAMES, flags=["prediction"], each={"64_pixels": 1, "32_pixels": 2, "16_pixels": 3})
def main_pictures_that_move(value: int, rng: Draws) -> Inputs:
    """Frames I and P of 70x50 pixels, with cells of motion of {key}."""
    plans = Plan("I", 30, 56), Plan("P", 2, 56, motion_cell=value)
    expected = yield {"stream": main_stream(rng, *plans, width=70, height=50)}
    first, second = result(expected, "frames")
    assert (first != second).any()


@on("core", *FRAMES, flags=["survivors"])
def main_pictures_of_a_group(rng: Draws) -> Inputs:
    """Frames I P P R I P: splats change, go and come, and nothing of the first group is left in the second."""
    p = Plan("P", 4, None, kind="any", own=False)
    expected = yield {"stream": main_stream(rng, Plan("I", 9, 56), p, p, Plan("R"), Plan("I", 9, 56), p)}
    frames = result(expected, "frames")
    assert np.array_equal(frames[2], frames[3])
    assert (frames[3] != frames[4]).any()


@on("core", *FRAMES, flags=["odd-size"], each={"1x1": (1, 1), "1x200": (1, 200), "200x1": (200, 1), "17x33": (17, 33)})
def main_pictures_of_sizes(value: tuple[int, int], rng: Draws) -> Inputs:
    """A frame of {key} pixels."""
    expected = yield {"stream": main_stream(rng, Plan("I", 25, 56), width=value[0], height=value[1])}
    assert result(expected, "frames").any()


@on("core", *FRAMES, flags=["clamp"], each={"bright": 40, "dark": -40})
def main_pictures_that_are_clamped(value: int) -> Inputs:
    """Splats of the first cell whose sum is {key}er than a sample can be, and one beside them."""
    header = replace(MAIN_HEADER, width=9, height=6)
    codes = replace(crowd(header, (22, 0), 30, value), quantizer=40, densities=densities_for(header, EVEN))
    expected = yield {"stream": write_stream(header, [codes], index=False)}
    assert result(expected, "frames")[0, 0, 0, 0] == (255 if value > 0 else 0)


EVEN: Final = (Density(0, 31, 0), Density(0, 31, 0), Density(0, 31, 0), Density(0, 24, 144), Density(0, 21, 0),
               Density(0, 24, 0))  # fmt: skip
"""Densities under which all codes of the splats here have a frequency."""


@on("stress", *FRAMES, flags=["overflow", "clamp", "needle"], each={"any": "any", "first": "first", "last": "last"})
def main_pictures_of_extremes(value: str, rng: Draws) -> Inputs:
    """Frames whose symbols are {key}: needles, splats far larger than the frame, outside of it, and far too bright."""
    p = Plan("P", 2, 30, motion_cell=3, kind=value)  # type: ignore[arg-type]  # a Kind
    expected = yield {"stream": main_stream(rng, replace(p, type="I", count=9, motion_cell=0), p, p)}
    assert len(result(expected, "frames")) == 3


@on("core", *FRAMES, flags=["many"])
def main_more_than_1024_splats_on_a_tile() -> Inputs:
    """An I-frame of 1,040 faint splats at one place and then a bright one: a tile that keeps 1,024 loses it."""
    header = replace(MAIN_HEADER, width=5, height=3)
    codes = replace(crowd(header, (12, 0), 1041, 0), quantizer=40, densities=densities_for(header, EVEN))
    codes.new.colors[:-1], codes.new.colors[-1] = (0, 1, 0), (20, 0, 0)
    expected = yield {"stream": write_stream(header, [codes], index=False)}
    assert result(expected, "frames")[0, ..., 1].max() > 30


@on("core", *FRAMES)
def main_picture_of_the_base() -> Inputs:
    """A stream of three layers: who decodes a stream draws its base."""
    expected = yield {"stream": with_layers(Draws(19), BASE, LAYERS)}
    assert result(expected, "frames").any()


@on("core", *FRAMES, flags=[CAPACITY])
def main_pictures_beyond_8_bits(rng: Draws) -> Inputs:
    """A group of 270 frames of 3 by 2 pixels, black up to the last one."""
    plans = [Plan("I"), *[Plan("R"), Plan("P")] * 134, Plan("P", 9, 40)]
    expected = yield {"stream": main_stream(rng, *plans, width=3, height=2)}
    assert result(expected, "frames").any(axis=(1, 2, 3)).tolist() == [False] * 269 + [True]


# --- Large frames ----------------------------------------------------------------------------------------------------


def beads(header: SequenceHeader, count: int) -> MainCodes:
    """An I-frame of splats from the left upper to the right lower corner, with colours of a period of 3."""
    n = np.arange(count)
    cells = np.stack([n * (side - 1) // (count - 1) for side in cell_counts(header.width, header.height)], axis=1)
    nothing = np.zeros((count, 1), np.int64)
    return MainCodes(
        type="I",
        quantizer=40,
        densities=densities_for(header, EVEN),
        new=IntraCodes(
            cells=cells[cell_order(cells, header.width, header.height)],
            colors=np.stack([4 + n % 3, n % 3 - 1, n % 2], axis=1),
            shapes=np.hstack([nothing + 10, nothing, nothing]),
            places=np.hstack([nothing, nothing]),
        ),
    )


@on("core", *FRAMES, flags=["large-frame"], each={"wide": (8192, 2), "high": (2, 2160)},
    said={"wide": "8,192 columns", "high": "2,160 rows"})  # fmt: skip
def main_large_pictures(value: tuple[int, int]) -> Inputs:
    """A frame of {key}; splats all along it."""
    header = replace(MAIN_HEADER, width=value[0], height=value[1])
    expected = yield {"stream": write_stream(header, [beads(header, 65)], index=False)}
    drawn = result(expected, "frames").any(axis=(0, 3))
    assert drawn[-1, -9:].any()
    assert drawn[0, :9].any()


@on("stress", *FRAMES, flags=["large-frame", CAPACITY], each={"wide": (35_003, 1), "high": (1, 35_003)},
    said={"wide": "35,003 columns", "high": "35,003 rows"})  # fmt: skip
def main_longest(value: tuple[int, int]) -> Inputs:
    """A frame of {key}, more than 2^15; splats all along it."""
    header = replace(MAIN_HEADER, width=value[0], height=value[1])
    expected = yield {"stream": write_stream(header, [beads(header, 97)], index=False)}
    assert result(expected, "frames").reshape(-1, 3)[2**15 :].any()


@on("core", *FRAMES, flags=["large-frame", CAPACITY])
def main_more_than_2_20_pixels() -> Inputs:
    """A frame of 1,031x1,021 pixels, of level 3, with 8 splats."""
    header = replace(MAIN_HEADER, width=1031, height=1021, level=3)
    expected = yield {"stream": write_stream(header, [beads(header, 8)], index=False)}
    assert result(expected, "frames").reshape(-1, 3)[2**20 :].any()
