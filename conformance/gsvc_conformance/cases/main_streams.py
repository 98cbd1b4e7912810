"""Streams of profile `main`: frames of all types, fields, lanes and densities (spec.md section 15)."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from gsvc_base import spec
from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs
from gsvc_conformance.cases.building import Chunks, frames_of, on, operated, result
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.main.cells import halving_count
from gsvc_ref.main.codes import IntraCodes, MainCodes
from gsvc_ref.main.densities import PLANES, Densities, Density
from gsvc_ref.main.frames import code_run
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.paper import FrameType
from gsvc_ref.testing import write_stream
from gsvc_ref.testing.random_main_streams import Kind, RandomRun

MAIN_HEADER: Final = SequenceHeader(profile=1, level=1, width=43, height=29, max_lane_exponent=2)
"""The header of most streams: a size that is no multiple of anything."""
READ: Final = ("read_main_stream", "reconstruct_stream")
"""The operations that most streams are cases of."""

PLAUSIBLE: Final = Densities(
    (Density(0, 8, 90), Density(1, 6, 10, 6), Density(1, 5, 8, 5), Density(0, 20, 20, -8), Density(1, 21, 2, 1),
     Density(0, 24, -3)),
    (),
)  # fmt: skip
"""Densities of luma, both chromas, size, aspect and shear, such as a fit has them."""


def densities_for(header: SequenceHeader, planes: tuple[Density, ...] = PLAUSIBLE.planes) -> Densities:
    """Densities of these planes; the shapes of the halves go through all that there are."""
    return Densities(planes, tuple(3 * i % 8 for i in range(halving_count(header.width, header.height))))


@dataclass(frozen=True)
class Plan:
    """What a frame is to have: its type, new splats, elements, and the kind of its symbols.

    Attributes
    ----------
    quantizer
        None: that of the frame before, which the frame does not say again.
    own
        Whether it has densities of its own.
    planes
        The densities that it then has.
    """

    type: FrameType
    count: int = 0
    quantizer: int | None = 24
    lane_exponent: int = 0
    motion_cell: int = 0
    own: bool = True
    kind: Kind = "likely"
    planes: tuple[Density, ...] = PLAUSIBLE.planes


def codes_of(header: SequenceHeader, plans: Iterable[Plan], rng: Draws) -> list[MainCodes]:
    """Frames as planned, whose symbols are random."""
    state, found = MainState.initial(header.width, header.height), []
    for plan in plans:
        codes, state = frame_of(header, plan, state, rng)
        found.append(codes)
    return found


def frame_of(header: SequenceHeader, plan: Plan, state: MainState, rng: Draws) -> tuple[MainCodes, MainState]:
    """A frame as planned after a state, and the state after it."""
    if plan.type == "R":
        return MainCodes.repeated_frame(), state
    before = MainState.initial(header.width, header.height) if plan.type == "I" else state
    codes = MainCodes(
        type=plan.type,
        quantizer=before.quantizer if plan.quantizer is None else plan.quantizer,
        quantizer_present=plan.quantizer is not None,
        lane_exponent=plan.lane_exponent,
        densities=densities_for(header, plan.planes) if plan.own and plan.count else None,
        motion_cell=plan.motion_cell if len(before.values) else 0,
    )
    before = replace(before, densities=codes.densities or before.densities, quantizer=codes.quantizer)
    if plan.count + len(before.values) == 0:
        return codes, before
    after, codes = code_run(RandomRun(rng, plan.kind), before, codes, plan.count)
    return codes, after


def main_stream(rng: Draws, *plans: Plan, index: bool = False, **header: Any) -> bytes:
    """A stream of frames as planned."""
    made = replace(MAIN_HEADER, **header)
    return write_stream(made, codes_of(made, plans, rng), index=index)


def one() -> MainCodes:
    """An I-frame of one splat of class 2 in the second cell of the first row."""
    new = IntraCodes(cells=_rows(1, 0), colors=_rows(4, -1, 0), shapes=_rows(0, 0, 1), places=_rows(1, 0))
    return MainCodes(type="I", quantizer=24, densities=densities_for(MAIN_HEADER), new=new)


def _rows(*row: int) -> Any:
    return np.array([row], np.int64)


def crowd(header: SequenceHeader, sizes: Any, count: int, luma: int = 4) -> MainCodes:
    """An I-frame of splats in the first cell, of class 2 with this `luma`; `sizes` are the codes of size and aspect."""
    planes = (*PLAUSIBLE.planes[:3], Density(0, 20, 144), *PLAUSIBLE.planes[4:])
    new = IntraCodes(*(np.repeat(_rows(*row), count, axis=0) for row in ((0, 0), (luma, -1, 0), (*sizes, 0), (0, 0))))
    return MainCodes(type="I", quantizer=24, densities=densities_for(header, planes), new=new)


# --- Frames ----------------------------------------------------------------------------------------------------------


@on("core", *READ)
def main_one_splat() -> Inputs:
    """An I-frame of one splat, one lane: n = (4, -1, 0) D, class 2, a step of its place is half a pixel."""
    stream = write_stream(MAIN_HEADER, [one()], index=False)
    expected = yield {"stream": stream}
    if "states" in expected:
        assert result(expected, "states").tolist() == [[1024 + 128 + 64, 64, 0, 0, 512, 256, -64, 0]]


@on("core", *READ, rules=["R-15.5-3"], flags=["empty"])
def main_without_splats(rng: Draws) -> Inputs:
    """Frames I, P and R without splats: nothing follows the counts."""
    expected = yield {"stream": main_stream(rng, Plan("I"), Plan("P"), Plan("R"))}
    assert result(expected, "counts").tolist() == [0, 0, 0]


@on("core", *READ)
def main_i_p_r(rng: Draws) -> Inputs:
    """Frames I, P, R and P of 12 splats, some of which change, move or are removed."""
    plans = Plan("I", 12), Plan("P", 2, motion_cell=3), Plan("R"), Plan("P", motion_cell=2)
    expected = yield {"stream": main_stream(rng, *plans)}
    assert len(result(expected, "counts")) == 4


@on("core", *READ, each={"none": 0, "64_pixels": 1, "32_pixels": 2, "16_pixels": 3})
def main_motion_cells(value: int, rng: Draws) -> Inputs:
    """Two P-frames with cells of motion: {key}."""
    plans = Plan("I", 30), Plan("P", motion_cell=value), Plan("P", motion_cell=value, kind="any")
    expected = yield {"stream": main_stream(rng, *plans, width=150, height=70)}
    assert len(result(expected, "counts")) == 3


@on("core", *READ, flags=["kept"])
def main_quantizer_kept(rng: Draws) -> Inputs:
    """P-frames without a quantizer have that of the last I- or P-frame, also after an R-frame."""
    plans = [Plan("I", 12, 30), Plan("P", 3, None, kind="any"), Plan("P", 2, 17, kind="any"), Plan("R"),
             Plan("P", 2, None, kind="any"), Plan("I", 4, 40), Plan("P", 4, None, kind="any")]  # fmt: skip
    expected = yield {"stream": main_stream(rng, *plans)}
    if "bodies" in expected:
        assert result(expected, "bodies")[:, 1].tolist() == [30, 30, 17, 17, 40, 40]


@on("core", *READ, flags=["lanes"], each={"32": 5, "64": 6, "256": 8})
def main_groups_of_lanes(value: int, rng: Draws) -> Inputs:
    """Passes of up to six symbols a lane in groups of 32 lanes, lanes: {key}; each has its own list of words."""
    plans = [Plan("I", 2 << value, lane_exponent=value), Plan("P", 90, lane_exponent=value, kind="any")]
    expected = yield {"stream": main_stream(rng, *plans, level=2, max_lane_exponent=8)}
    assert len(result(expected, "counts")) == 2


@on("core", *READ)
def main_late_bits_in_few_lanes(rng: Draws) -> Inputs:
    """Four lanes and far more late bits than they carry, at any first bit in the string after the early ones."""
    plans = [Plan("I", 21, 8, lane_exponent=2), *[Plan("P", n, 8, lane_exponent=2, kind="any") for n in range(1, 6)]]
    expected = yield {"stream": main_stream(rng, *plans)}
    assert len(result(expected, "counts")) == 6


@on("uncommon", *READ, flags=["lanes"])
def main_most_lanes(rng: Draws) -> Inputs:
    """4,096 lanes, as many as there can be, most of which have neither symbols nor late bits."""
    expected = yield {"stream": main_stream(rng, Plan("I", 30, lane_exponent=12), level=4, max_lane_exponent=12)}
    assert len(result(expected, "counts")) == 1


@on("core", *READ, flags=["lanes"], each={"1": 0, "2": 1, "64": 6}, said={"1": "1 lane"})
def main_lanes(value: int, rng: Draws) -> Inputs:
    """All passes by lanes, in number: {key}; many passes have fewer symbols than there are lanes."""
    plans = [Plan("I", 40, lane_exponent=value), Plan("P", 3, lane_exponent=value, motion_cell=3)] * 2
    expected = yield {"stream": main_stream(rng, *plans, max_lane_exponent=6)}
    assert len(result(expected, "counts")) == 4


@on("core", *READ, flags=["lanes"])
def main_lanes_by_frame(rng: Draws) -> Inputs:
    """Each frame has a number of lanes of its own, up to that of the header."""
    plans = [Plan("I", 9, lane_exponent=2), *(Plan("P", lane_exponent=e, kind="any") for e in (0, 1, 2))]
    expected = yield {"stream": main_stream(rng, *plans)}
    assert len(result(expected, "counts")) == 4


@on("core", *READ, flags=["kept"])
def main_densities_kept(rng: Draws) -> Inputs:
    """New splats by the densities of the I-frame, by those of a P-frame, and by these again; an I-frame has its own."""
    other = tuple(Density(1 - d.family, 31 - d.scale_code, -d.centre, -d.slope) for d in PLAUSIBLE.planes)
    plans = [Plan("I", 9), Plan("P", 4, own=False), Plan("P", 4, planes=other), Plan("R"), Plan("P", 4, own=False),
             Plan("I", 3), Plan("P", 3, own=False)]  # fmt: skip
    expected = yield {"stream": main_stream(rng, *plans)}
    assert len(result(expected, "counts")) == 7


@on("core", *READ)
def main_least_numbers(rng: Draws) -> Inputs:
    """`max_lane_exponent` is 0, and `splat_number` is 0 in a P-frame with one new splat that has no densities."""
    plans = [Plan("I", 1, 0), Plan("P", 1, 0, own=False)]
    expected = yield {"stream": main_stream(rng, *plans, max_lane_exponent=0)}
    assert len(result(expected, "counts")) == 2


@on("core", *READ, rules=["R-15.5-4"], flags=["kept"])
def main_densities_behind_an_empty_i_frame(rng: Draws) -> Inputs:
    """An I-frame without splats, and a P-frame with new ones, which has densities."""
    expected = yield {"stream": main_stream(rng, Plan("I", 5), Plan("I"), Plan("P", 5), Plan("P", 2, own=False))}
    assert result(expected, "counts")[1] == 0


@on("core", *READ, flags=["kept"])
def main_models_adapt(rng: Draws) -> Inputs:
    """Models adapt after each P-frame, not after R-frames, and start again after an I-frame."""
    p = Plan("P", motion_cell=3, kind="any")
    plans = [Plan("I", 25), p, p, Plan("R"), p, Plan("I", 25), p, p]
    expected = yield {"stream": main_stream(rng, *plans)}
    assert len(result(expected, "counts")) == 8


@on("core", *READ, flags=["survivors"])
def main_removed(rng: Draws) -> Inputs:
    """All splats are removed, the next frame has none, and the one after it new ones."""
    state = MainState.initial(43, 29)
    first, state = frame_of(MAIN_HEADER, Plan("I", 5), state, rng)
    gone = MainCodes(type="P", quantizer=24, modes=np.full(5, 8), differences=np.zeros((5, 8), np.int64))
    none = MainCodes(type="P", quantizer=3)
    last = frame_of(MAIN_HEADER, Plan("P", 3), replace(state, values=state.values[:0], past=state.past[:0]), rng)[0]
    expected = yield {"stream": write_stream(MAIN_HEADER, [first, gone, none, last], index=False)}
    assert result(expected, "counts").tolist() == [5, 0, 0, 3]


@on("core", *READ, flags=["prediction"])
def main_nothing_changes(rng: Draws) -> Inputs:
    """A P-frame whose modes are all 0: the splats are those of the frame before, to the bit."""
    first, _ = frame_of(MAIN_HEADER, Plan("I", 9), MainState.initial(43, 29), rng)
    same = MainCodes(type="P", quantizer=40, modes=np.zeros(9, np.int64), differences=np.zeros((9, 8), np.int64))
    expected = yield {"stream": write_stream(MAIN_HEADER, [first, same, same], index=False)}
    if "parameters" in expected:
        a, b, c = frames_of(expected)
        assert np.array_equal(a, b)
        assert np.array_equal(b, c)


@on("core", *READ, flags=["survivors"])
def main_past_of_splats(rng: Draws) -> Inputs:
    """New splats, those that changed and those that did not have modes of other contexts; some are removed."""
    p = Plan("P", 6, kind="any", own=False)
    expected = yield {"stream": main_stream(rng, Plan("I", 30), p, replace(p, count=0), p, Plan("R"), p)}
    assert len(result(expected, "counts")) == 6


@on("core", *READ, rules=["R-6.4-3"])
def main_checksums(rng: Draws) -> Inputs:
    """Frames I, P and R with checksums of their parameters."""
    stream = main_stream(rng, Plan("I", 7), Plan("P", 1), Plan("R"), parameter_checksum_flag=True)
    expected = yield {"stream": stream}
    assert len(result(expected, "counts")) == 3


@on("core", *READ, flags=["odd-size"], each={"1x1": (1, 1), "3x300": (3, 300), "300x3": (300, 3), "129x4": (129, 4)})
def main_sizes(value: tuple[int, int], rng: Draws) -> Inputs:
    """A frame of {key} pixels: parts outside of it are not asked, and the second half of some is cut."""
    plans = Plan("I", 40), Plan("P", 3, motion_cell=3)
    expected = yield {"stream": main_stream(rng, *plans, width=value[0], height=value[1])}
    assert len(result(expected, "counts")) == 2


@on("core", "decode_stream", "decode_stream_deterministic", equations=["15-5"], rules=["R-15.4-2"])
def main_rendered(rng: Draws) -> Inputs:
    """Frames I, P, R and P with motion, rendered."""
    plans = Plan("I", 40, 40), Plan("P", 3, 40, motion_cell=3), Plan("R"), Plan("P", 0, 40)
    expected = yield {"stream": main_stream(rng, *plans)}
    assert result(expected, "frames").any()


@on("core", *READ, equations=["15-12"], flags=["prediction"], each={"64_pixels": 1, "32_pixels": 2, "16_pixels": 3})
def main_smooth_motion(value: int, rng: Draws) -> Inputs:
    """A camera that turns and comes closer, twice: the field is smooth, and its cells are {key}."""
    width, height, side = 240, 160, spec.SIDES[value]
    header = replace(MAIN_HEADER, width=width, height=height)
    first, state = frame_of(header, Plan("I", 60), MainState.initial(width, height), rng)
    x, y = np.meshgrid(np.arange(side // 2, width + side // 2, side), np.arange(side // 2, height + side // 2, side))
    vectors = np.stack([12 + (x - 120) // 20 - (y - 80) // 10, -5 + (x - 120) // 10 + (y - 80) // 20], axis=2)
    moved = MainCodes(type="P", quantizer=24, motion_cell=value, vectors=vectors.astype(np.int64),
                      modes=np.zeros(60, np.int64), differences=np.zeros((60, 8), np.int64))  # fmt: skip
    expected = yield {"stream": write_stream(header, [first, moved, moved], index=False)}
    if "fields" in expected:
        assert len(np.unique(result(expected, "states").reshape(3, 60, 8)[1, :, 0] - state.values[:, 0])) > 10


@on("core", *READ, flags=["many"])
def main_three_frames_of_a_clip(rng: Draws) -> Inputs:
    """Frames I, P and P of 176x144 as an encoder writes them: 90 splats, most of which stay as they are."""
    plans = Plan("I", 90, 30, 2), Plan("P", 4, 30, 2, 2), Plan("P", 3, 30, 2, 2, own=False)
    expected = yield {"stream": main_stream(rng, *plans, width=176, height=144, parameter_checksum_flag=True)}
    assert len(result(expected, "counts")) == 3


@on("core", *READ, flags=["clamp"], each={"512": (512, 0b1), "1024": (1024, 0b11)})
def main_more_than_there_are(value: tuple[int, int]) -> Inputs:
    """Raw low bits say that the first half has more than all {key} splats: it has them all."""
    count, low_bits = value
    splats = crowd(MAIN_HEADER, (25, 0), count)

    def edit(chunks: Chunks) -> Chunks:
        header, (kind, payload), end = chunks
        return [header, (kind, payload[:-1] + bytes([payload[-1] | low_bits])), end]

    sound = write_stream(MAIN_HEADER, [splats], index=False)
    stream = operated(edit, sound)
    assert stream != sound
    expected = yield {"stream": stream}
    assert result(expected, "counts").tolist() == [count]


@on("core", "reconstruct_stream", equations=["15-2", "15-5"])
def main_every_power_of_two() -> Inputs:
    """512 splats of class 10, whose steps of size are 1/1024 octave: l11 and l22 have all the numbers of EXP2."""
    planes = (*PLAUSIBLE.planes[:3], Density(0, 8, 0), Density(0, 0, -4), PLAUSIBLE.planes[5])
    codes = np.arange(-256, 256)
    cells, colors, shapes = np.zeros((512, 2), np.int64), np.zeros((512, 3), np.int64), np.zeros((512, 3), np.int64)
    colors[:, 0], shapes[:, 0], shapes[:, 1] = 800, codes, -256
    new = IntraCodes(cells=cells, colors=colors, shapes=shapes, places=np.full((512, 2), 31))
    frame = MainCodes(type="I", quantizer=24, densities=densities_for(MAIN_HEADER, planes), new=new)
    expected = yield {"stream": write_stream(MAIN_HEADER, [frame], index=False)}
    sides = result(expected, "parameters")[:, [2, 4]]
    assert len(np.unique(np.where(sides < 1, 2 * sides, sides))) == 1024


@on("core", *READ, flags=["overflow"])
def main_counts_of_modes_beyond_17_bits() -> Inputs:
    """1,200 splats of which each frame removes every ninth: from the third P-frame on counts are shifted."""
    splats = crowd(MAIN_HEADER, (25, 0), 1200)
    plans, count = [splats], 1200
    for _ in range(4):
        modes = np.where(np.arange(count) % 9 == 4, spec.REMOVED, 0)
        plans.append(MainCodes(type="P", quantizer=24, modes=modes, differences=np.zeros((count, 8), np.int64)))
        count = int(np.count_nonzero(modes == 0))
    expected = yield {"stream": write_stream(MAIN_HEADER, plans, index=False)}
    assert result(expected, "counts")[-1] == count


@on("core", *READ, flags=["overflow"], each={"positions": (0, (7, 5)), "colors": (5, (6, 4, 9))})
def main_counts_of_differences_beyond_17_bits(value: tuple[int, tuple[int, ...]]) -> Inputs:
    """900 splats of which all {key} change in five P-frames by differences of several magnitudes."""
    first, ends = value
    differences = np.zeros((900, 8), np.int64)
    for c, end in enumerate(ends, first):
        differences[:, c] = 1 + np.arange(900) % end
    changed = MainCodes(type="P", quantizer=24, modes=np.full(900, 1 if first == 0 else 4), differences=differences)
    splats = crowd(MAIN_HEADER, (25, 0), 900)
    expected = yield {"stream": write_stream(MAIN_HEADER, [splats, *[changed] * 5], index=False)}
    assert result(expected, "counts").tolist() == [900] * 6


@on("core", "reconstruct_stream", flags=["overflow"])
def main_counts_of_vectors_beyond_17_bits() -> Inputs:
    """1,125 vectors in steps of 0 to 6 in five P-frames."""
    header = replace(MAIN_HEADER, level=2, width=720, height=400)
    steps = np.arange(1125).reshape(25, 45)
    vectors = np.cumsum(np.stack([steps % 7, steps % 5], axis=2), axis=1)
    moved = MainCodes(type="P", quantizer=24, motion_cell=3, vectors=vectors,
                      modes=np.zeros(1, np.int64), differences=np.zeros((1, 8), np.int64))  # fmt: skip
    splat = crowd(header, (25, 0), 1)
    expected = yield {"stream": write_stream(header, [splat, *[moved] * 5], index=False)}
    assert result(expected, "counts").tolist() == [1] * 6


# --- Rare and extreme ------------------------------------------------------------------------------------------------


@on("uncommon", *READ, each={str(q): q for q in (0, 1, 63, 79)})
def main_quantizers(value: int, rng: Draws) -> Inputs:
    """Quantizer {key} in an I-frame and in a P-frame."""
    expected = yield {"stream": main_stream(rng, Plan("I", 20, value), Plan("P", 3, value, motion_cell=1))}
    assert len(result(expected, "counts")) == 2


@on("uncommon", *READ, flags=["index"])
def main_index_and_layers(rng: Draws) -> Inputs:
    """An index, and a layer_count of 4 without any chunk of a layer."""
    plans = Plan("I", 5), Plan("P", 1), Plan("I", 3)
    expected = yield {"stream": main_stream(rng, *plans, index=True, layer_count=4, bit_depth=10)}
    assert len(result(expected, "counts")) == 3


@on("uncommon", *READ, flags=["many"])
def main_many_in_a_cell(rng: Draws) -> Inputs:
    """1200 splats in 2 x 1 cells: numbers of halves have raw low bits."""
    expected = yield {"stream": main_stream(rng, Plan("I", 1200, 60, 2), width=8, height=4)}
    assert result(expected, "counts").tolist() == [1200]


@on("stress", *READ, flags=["clamp", "overflow"], each={kind: kind for kind in ("any", "first", "last")})
def main_symbols(value: Kind, rng: Draws) -> Inputs:
    """Symbols of each pass: {key}. Magnitudes have up to 18 raw bits, states reach their ends, vectors wrap around."""
    p = Plan("P", 4, 30, 1, 3, kind=value)
    plans = Plan("I", 20, 0, kind=value), p, replace(p, quantizer=79), replace(p, count=0, quantizer=0), p
    expected = yield {"stream": main_stream(rng, *plans)}
    assert len(result(expected, "counts")) == 5


@on("stress", *READ, flags=["overflow"])
def main_vectors_wrap_around(rng: Draws) -> Inputs:
    """63 vectors, each 4095 less than the one to its left: the sums are reduced to 16 bits."""
    plans = Plan("I", 3), Plan("P", motion_cell=3, kind="last")
    expected = yield {"stream": main_stream(rng, *plans, width=1000, height=5)}
    if "fields" in expected:
        assert result(expected, "fields")[:, 0].max() > 2**14


EXTREMES: Final = {
    "narrow": tuple(Density(1, 0, -512, -128 if plane in spec.SLOPED else 0) for plane in PLANES),
    "wide": tuple(Density(0, 31, 511, 127 if plane in spec.SLOPED else 0) for plane in PLANES),
    "crossed": tuple(Density(1, 17, -512, 127 if plane in spec.SLOPED else 0) for plane in PLANES),
}


@on("stress", *READ, flags=["clamp"], each=EXTREMES)
def main_extreme_densities(value: tuple[Density, ...], rng: Draws) -> Inputs:
    """Densities that are {key}: the ends of their centres, slopes and scales."""
    plans = Plan("I", 40, 50, planes=value), Plan("P", 9, 50, planes=value, kind="any")
    expected = yield {"stream": main_stream(rng, *plans)}
    assert len(result(expected, "counts")) == 2


@on("stress", *READ, equations=["15-6", "15-9"], flags=["overflow"])
def main_edges_far_from_the_centre(rng: Draws) -> Inputs:
    """500 splats of 17 cells in a row, all of them in the last one: 2 m - e of (15-6) is close to 2^16."""
    centre = 500 * (256 * 16 // 17) // 4
    assert 2**16 - 2**13 < 2 * centre - 64 < 2**16
    planes = tuple(Density(d.family, 31, d.centre, d.slope) for d in PLAUSIBLE.planes)
    expected = yield {"stream": main_stream(rng, Plan("I", 500, 50, planes=planes, kind="first"), width=68, height=4)}
    if "states" in expected:
        assert (result(expected, "states")[:, 0] >> 10 == 16).all()
