"""Streams of profile `main` as large as life: long groups, large frames, many splats, and the limits of levels."""

from dataclasses import replace
from typing import Any, Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.building import Array, on, result
from gsvc_conformance.cases.long_streams import BEYOND_16_BITS
from gsvc_conformance.cases.main_layers import LayerPlan, covering, with_layers
from gsvc_conformance.cases.main_streams import (
    MAIN_HEADER,
    READ,
    Plan,
    codes_of,
    crowd,
    densities_for,
    frame_of,
    main_stream,
)
from gsvc_conformance.cases.pace import LEVEL
from gsvc_ref.bitstream import LEVELS, SequenceHeader
from gsvc_ref.bitstream.header import LANE_EXPONENTS
from gsvc_ref.main.cells import cell_counts, cell_order
from gsvc_ref.main.codes import IntraCodes, MainCodes
from gsvc_ref.main.densities import Density
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.testing import write_stream

NARROW: Final = (Density(1, 0, 64), Density(1, 0, 8), Density(0, 0, -120), Density(0, 0, 144), Density(0, 0, 0),
                 Density(0, 0, 0))  # fmt: skip
"""Densities by which the splats of a `crowd` take next to no bits."""

REPEATED: Final = MainCodes.repeated_frame()


def many(header: SequenceHeader, count: int) -> MainCodes:
    """An I-frame of equal splats in the first cell, by as many lanes as the header allows."""
    codes = crowd(header, (25, 0), count)
    return replace(codes, densities=densities_for(header, NARROW), lane_exponent=header.max_lane_exponent)


def changed(count: int, *, last: int = -1) -> MainCodes:
    """A P-frame in which every 251st splat moves, and the shape of the one at `last` changes."""
    modes, differences = np.zeros(count, np.int64), np.zeros((count, 8), np.int64)
    modes[::251], differences[::251, 0] = 1, 2
    modes[last], differences[last] = 2, (0, 0, 3, 0, 0, 0, 0, 0)
    return MainCodes(type="P", quantizer=24, modes=modes, differences=differences)


# --- Many frames -----------------------------------------------------------------------------------------------------


@on("core", *READ, flags=["prediction", CAPACITY], rules=["R-6.4-1"])
def main_group_of_300_frames(rng: Draws) -> Inputs:
    """A group of 300 frames: models adapt 266 times, and what the I-frame keeps is kept to the end."""
    plans = [Plan("R") if n % 9 == 8 else Plan("P", int(n % 100 == 50), None, n % 3, motion_cell=n % 4, own=False)
             for n in range(1, 300)]  # fmt: skip
    expected = yield {"stream": main_stream(rng, Plan("I", 4), *plans)}
    assert len(result(expected, "counts")) == 300
    assert result(expected, "counts").min() > 0


@case("core", "reconstruct_stream", flags=[CAPACITY], rules=["R-6.4-1"])
def main_frames_beyond_14_bits(rng: Draws) -> Inputs:
    """16,400 frames, an I-frame among the last ones: frame numbers, and a step of the index, take three bytes."""
    first, other = codes_of(MAIN_HEADER, [Plan("I", 1), Plan("I", 2)], rng)
    expected = yield {"stream": write_stream(MAIN_HEADER, [first, *[REPEATED] * 16_389, other, *[REPEATED] * 9])}
    counts = result(expected, "counts")
    assert (len(counts), counts[:16_390].max(), counts[16_390:].min()) == (16_400, 1, 2)


@case("core", "reconstruct_stream", flags=[CAPACITY], rules=["R-6.4-1"])
def main_frames_beyond_16_bits(rng: Draws) -> Inputs:
    """65,600 frames, all but the last two without splats: frame numbers take more than 16 bits."""
    first, other = codes_of(MAIN_HEADER, [Plan("I"), Plan("I", 1)], rng)
    expected = yield {"stream": write_stream(MAIN_HEADER, [first, *[REPEATED] * 65_597, other, REPEATED])}
    assert np.flatnonzero(result(expected, "counts")).tolist() == [65_598, 65_599]


# --- Many splats -----------------------------------------------------------------------------------------------------


@on("core", *READ, flags=["limit", "many", CAPACITY], rules=["R-5-2"])
def main_as_many_splats_as_allowed() -> Inputs:
    """An I-frame of 2^14 splats, the most that level 1 allows, and a P-frame that changes the last one."""
    header, most = replace(MAIN_HEADER, width=5, height=3), LEVEL.splats
    expected = yield {"stream": write_stream(header, [many(header, most), changed(most)], index=False)}
    assert result(expected, "counts").tolist() == [most, most]


@on("core", *READ, flags=["lanes", "many", CAPACITY], rules=["R-5-2"])
def main_splats_beyond_16_bits() -> Inputs:
    """65,613 splats by 64 lanes; in a P-frame some change, the last one among them, and indices take 17 bits."""
    header = replace(MAIN_HEADER, level=3, width=8, height=4, max_lane_exponent=6)
    frames = [many(header, BEYOND_16_BITS), replace(changed(BEYOND_16_BITS), lane_exponent=6)]
    expected = yield {"stream": write_stream(header, frames, index=False)}
    if "modes" in expected:
        assert result(expected, "modes")[-1] == 2
        assert len(result(expected, "symbols")) > 4 * BEYOND_16_BITS


@on("core", *READ, flags=["survivors", CAPACITY], rules=["R-5-2"])
def main_survivors_beyond_16_bits() -> Inputs:
    """Of 65,613 splats the last 90, which are unlike the others, stay, and one comes: their indices take 17 bits."""
    header = replace(MAIN_HEADER, level=3, width=8, height=4)
    count, stay = BEYOND_16_BITS, 90
    modes = np.where(np.arange(count) < count - stay, 8, 2)
    differences = np.zeros((count, 8), np.int64)
    differences[-stay:, 2] = np.arange(stay) % 9 + 1
    first = many(header, count)
    first.new.colors[-stay:, 2] = np.arange(stay) % 3 + 1
    new = replace(crowd(header, (25, 0), 1), type="P", modes=modes, differences=differences)
    expected = yield {"stream": write_stream(header, [first, new], index=False)}
    assert result(expected, "counts").tolist() == [count, stay + 1]


@on("core", *READ, flags=["many", "lanes", CAPACITY], each={"1_lane": 0, "64_lanes": 6})
def main_parts_beyond_a_workgroup(value: int, rng: Draws) -> Inputs:
    """2,600 splats, nearly each in its own cell of 7,500, by {key}: the last halvings have more than 2,048 parts."""
    header = replace(MAIN_HEADER, width=400, height=300, max_lane_exponent=value)
    expected = yield {"stream": write_stream(header, [scattered(rng, header, 2600, value)], index=False)}
    if "symbols" in expected:
        halvings = result(expected, "symbols")[:, 2]
        assert np.count_nonzero(halvings == 2 * 7 - 1) > 1024
    assert len(np.unique(places_of(expected), axis=0)) > 2048


def scattered(rng: Draws, header: SequenceHeader, count: int, lane_exponent: int) -> MainCodes:
    """An I-frame of `count` splats in random cells; their codes have a period of 13."""
    cells = np.stack([rng.integers(0, side, (count,)) for side in cell_counts(header.width, header.height)], axis=1)
    n = np.arange(count) % 13
    nothing = np.zeros((count, 1), np.int64)
    return MainCodes(
        type="I",
        quantizer=24,
        lane_exponent=lane_exponent,
        densities=densities_for(header),
        new=IntraCodes(
            cells=cells[cell_order(cells, header.width, header.height)],
            colors=np.stack([n - 4, n % 3 - 1, n % 2], axis=1),
            shapes=np.hstack([nothing, nothing, n[:, None] % 2]),
            places=np.hstack([nothing, nothing]),
        ),
    )


def places_of(expected: Any) -> Array:
    """X and Y of all splats, in states or parameters."""
    name = "states" if "states" in expected else "parameters"
    places: Array = result(expected, name)[:, :2]
    return places


@on("core", *READ, flags=["lanes"])
def main_64_lanes_of_one_splat(rng: Draws) -> Inputs:
    """64 lanes and one splat: each pass has a symbol in one lane, or in none."""
    plans = Plan("I", 1, lane_exponent=6), Plan("P", lane_exponent=6), Plan("P", 1, lane_exponent=6, own=False)
    expected = yield {"stream": main_stream(rng, *plans, max_lane_exponent=6)}
    assert result(expected, "counts")[0] == 1


@on("core", *READ, flags=["limit", "overflow"], rules=["R-5-4"])
def main_as_much_work_as_allowed() -> Inputs:
    """512 splats that cover 256x256 pixels: 2^25 pairs, the most that level 1 allows."""
    header = replace(MAIN_HEADER, width=256, height=256)
    expected = yield {"stream": write_stream(header, [covering(512)], index=False)}
    assert int(result(expected, "counts")[0]) << 16 == LEVEL.work


# --- Large frames ----------------------------------------------------------------------------------------------------


@on("core", *READ, flags=["large-frame"],
    each={"wide": (8192, 16), "high": (16, 2160), "most_pixels": (512, 256)},
    said={"wide": "8192x16 pixels", "high": "16x2160 pixels",
          "most_pixels": "512x256 pixels, the most of level 1"})  # fmt: skip
def main_large(value: tuple[int, int], rng: Draws) -> Inputs:
    """A frame of {key}, and a field of the smallest cells."""
    plans = Plan("I", 60), Plan("P", 2, motion_cell=3)
    expected = yield {"stream": main_stream(rng, *plans, width=value[0], height=value[1])}
    assert result(expected, "counts")[0] == 60


@on("core", *READ, flags=["large-frame", CAPACITY], rules=["R-5-1"])
def main_largest_field(rng: Draws) -> Inputs:
    """A frame of 8192x2160 pixels, of level 5, with a field of 69,120 vectors; two of them are unlike all others."""
    header = replace(MAIN_HEADER, width=8192, height=2160, level=5)
    first, _ = frame_of(header, Plan("I", 50), MainState.initial(8192, 2160), rng)
    vectors = np.full((135, 512, 2), (3, -2), np.int64)
    vectors[67, 300], vectors[-1, -1] = (50, 40), (-30, 70)
    moved = MainCodes(type="P", quantizer=24, motion_cell=3, vectors=vectors, modes=np.zeros(50, np.int64),
                      differences=np.zeros((50, 8), np.int64))  # fmt: skip
    expected = yield {"stream": write_stream(header, [first, moved], index=False)}
    if "fields" in expected:
        assert len(result(expected, "fields")) == 69_120


@on("stress", *READ, flags=["large-frame"],
    each={"columns": (65_535, 1, 1), "rows": (1, 65_535, 1), "of_both": (65_535, 1024, 5)},
    said={"columns": "65,535 columns", "rows": "65,535 rows",
          "of_both": "65,535 columns and 1,024 rows, of level 5"})  # fmt: skip
def main_most_halvings(value: tuple[int, int, int], rng: Draws) -> Inputs:
    """A frame of {key} is halved 28 times, as often as there can be halvings."""
    width, height, level = value
    plans = Plan("I", 50), Plan("P", 3)
    expected = yield {"stream": main_stream(rng, *plans, width=width, height=height, level=level)}
    assert places_of(expected).max() > 2**15
    if "symbols" in expected:
        assert set(range(1, 27, 2)) <= set(result(expected, "symbols")[:, 2].tolist()) or width == 1


@on("core", *READ, flags=["lanes", "limit"], rules=["R-5-11"], each={str(level): level for level in LEVELS})
def main_levels(value: int, rng: Draws) -> Inputs:
    """A small stream of level {key}, with as many lanes as it allows."""
    plans = Plan("I", 20, lane_exponent=LANE_EXPONENTS[value]), Plan("P", 2)
    expected = yield {"stream": main_stream(rng, *plans, level=value, max_lane_exponent=LANE_EXPONENTS[value])}
    assert len(result(expected, "counts")) == 2


# --- Layers ----------------------------------------------------------------------------------------------------------


@case("core", "reconstruct_layers", flags=["many", CAPACITY], rules=["R-5-2"])
def layers_beyond_16_bits() -> Inputs:
    """65,613 splats in four qualities, the last one in layer 3: no layer has more than 30,000."""
    header = replace(MAIN_HEADER, level=3, width=5, height=3)
    counts = 30_000, 20_000, 15_000, BEYOND_16_BITS - 65_000
    base, *layers = (many(header, count) for count in counts)
    behind = [LayerPlan(0, layer, codes) for layer, codes in enumerate(layers, 1)]
    behind += [LayerPlan(1, 1, Plan("R")), LayerPlan(1, 3, changed(counts[3]))]
    stream = with_layers(Draws(0), [base, Plan("R")], behind, level=3, width=5, height=3)
    expected = yield {"stream": stream, "layer": 3}
    assert result(expected, "error") == ""
    assert result(expected, "counts").tolist() == [BEYOND_16_BITS] * 2


@case("core", "reconstruct_layers", flags=["kept", CAPACITY], rules=["R-15.13-2", "R-15.13-4"])
def layers_of_300_frames() -> Inputs:
    """A group of 300 frames with a layer that is coded or repeated in every seventh, and carried in the others."""
    plans = [Plan("R") if n % 5 == 4 else Plan("P", motion_cell=n % 4) for n in range(1, 300)]
    layers = [LayerPlan(0, 1, Plan("I", 3))]
    layers += [LayerPlan(n, 1, Plan("R") if n % 3 == 0 else Plan("P", int(n == 70))) for n in range(7, 300, 7)]
    stream = with_layers(Draws(71), [Plan("I", 2), *plans], layers)
    expected = yield {"stream": stream, "layer": 1}
    assert result(expected, "error") == ""
    assert result(expected, "counts").shape == (300,)
    assert result(expected, "counts").min() > 2
