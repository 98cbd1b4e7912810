"""Cases of the entropy coding of profile `main`: runs, densities, halves, models and contexts (spec.md section 15)."""

from typing import Any, Final

import numpy as np

from gsvc_base import spec
from gsvc_base.draws import Draws
from gsvc_base.portable import power
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.building import Array, result
from gsvc_conformance.cases.lanes import MIN_STATE, TOTAL, encoded, random_raw, random_symbols, run_of
from gsvc_conformance.cases.states import ints, painted, state

# --- Runs ------------------------------------------------------------------------------------------------------------


@case("core", "encode_run")
def one_symbol() -> Inputs:
    """One lane that begins at 2^16, c = 3000 and f = 1000: 65 · 2^14 + 536 + 3000, and no word."""
    expected = yield run_of([[3000, 1000]], 1)
    assert result(expected, "lane_states").tolist() == [65 * 2**14 + 536 + 3000]
    assert len(result(expected, "words")) == 0


@case("core", "encode_run", flags=["empty"])
def run_without_symbols() -> Inputs:
    """No symbols: each of 4 lanes is at 2^16, and there are no words and no raw bits."""
    expected = yield run_of([], 4)
    assert result(expected, "lane_states").tolist() == [MIN_STATE] * 4
    assert len(result(expected, "words")) == len(result(expected, "tail")) == 0


@case("core", "encode_run", flags=["ties"])
def run_at_the_bound() -> Inputs:
    """The state equals f(s) 2^18 before a symbol is encoded: a word is emitted first."""
    expected = yield run_of([[0, 1], [0, 4096]], 1)
    assert result(expected, "words").tolist() == [0]
    assert result(expected, "lane_states").tolist() == [MIN_STATE]


@case("core", "encode_run")
def certain_symbols() -> Inputs:
    """A frequency of 2^14 changes nothing: a symbol that is certain costs no bits."""
    expected = yield run_of([[0, TOTAL], [5, 7], [0, TOTAL], [0, TOTAL]], 2, [0, 0, 1, 0])
    assert len(result(expected, "words")) == 0
    assert result(expected, "lane_states")[1] == MIN_STATE


@case("core", "encode_run", flags=["lanes"], each={str(lanes): lanes for lanes in (1, 2, 8, 64)})
def runs_of_lanes(value: int, rng: Draws) -> Inputs:
    """Three passes of 150, 3 and 70 symbols, lanes: {key}. Each pass starts with lane 0."""
    lanes = np.concatenate([np.arange(count) % value for count in (150, 3, 70)])
    yield from encoded(run_of(random_symbols(rng, len(lanes)), value, lanes))


@case("core", "encode_run", flags=["lanes"])
def one_list_of_words(rng: Draws) -> Inputs:
    """4 lanes take words from one list, in the order in which symbols are decoded, not lane by lane."""
    inputs = run_of(random_symbols(rng, 40) // [1, 64] * [1, 1] + [0, 1], 4)
    yield from encoded(inputs)


@case("core", "encode_run", flags=["lanes"], each={str(lanes): lanes for lanes in (32, 64, 128)})
def words_of_groups(value: int, rng: Draws) -> Inputs:
    """400 rare symbols, lanes: {key}; every 32 lanes are a group, whose words are stored together."""
    inputs = run_of(random_symbols(rng, 400) // [1, 64] * [1, 1] + [0, 1], value)
    expected = yield from encoded(inputs)
    assert len(result(expected, "word_counts")) == value // 32


@case("core", "encode_run")
def early_raw_values(rng: Draws) -> Inputs:
    """50 early raw values of 0 to 28 bits, stored from the end of the payload backwards, bit 0 of each byte first."""
    yield from encoded(run_of(random_symbols(rng, 30), 2, early=random_raw(rng, 50)))


@case("core", "encode_run", flags=["lanes"],
      each={"15": 15, "16": 16, "31": 31, "63": 63, "64": 64, "80": 80, "87": 87})  # fmt: skip
def late_raw_bits(value: int, rng: Draws) -> Inputs:
    """4 lanes and {key} late bits: whole 16s of them are what lanes end with, up to 64, the rest is in the string."""
    late = np.stack([rng.integers(0, 2, (value,)), np.ones(value, np.int64)], axis=1)
    yield from encoded(run_of(random_symbols(rng, 30), 4, early=[[5, 3]], late=late))


@case("core", "encode_run")
def late_values_across_lanes() -> Inputs:
    """Late values of 12 bits: the second one has 4 in lane 0 and 8 in lane 1; the sixth is in the string but for 4."""
    late = [[0xABC, 12], [0xDEF, 12], [0x123, 12], [0x456, 12], [0x789, 12], [0xFED, 12]]
    yield from encoded(run_of([[5, 7], [9, 200], [0, 3]], 4, late=late))


@case("core", "encode_run", flags=["lanes"])
def late_bits_of_lanes_without_symbols() -> Inputs:
    """8 lanes for 3 symbols: the states of the five others are 2^16 and 16 late bits each."""
    expected = yield from encoded(run_of([[5, 7], [9, 200], [0, 3]], 8, late=[[k, 16] for k in range(8)]))
    assert result(expected, "lane_states")[3:].tolist() == [MIN_STATE + k for k in range(3, 8)]


@case("uncommon", "encode_run", flags=["lanes"])
def lanes_that_are_not_used(rng: Draws) -> Inputs:
    """64 lanes for 5 symbols: the states of the other lanes are 2^16."""
    inputs = run_of(random_symbols(rng, 5), 64)
    expected = yield inputs
    assert (result(expected, "lane_states")[5:] == MIN_STATE).all()
    assert (result(expected, "lane_states")[:5] > MIN_STATE).all()


@case("stress", "encode_run", flags=["overflow"])
def largest_state_of_a_run() -> Inputs:
    """A lane that ends in a state of 2^32 - 1: numbers are not signed."""
    expected = yield run_of([[TOTAL - 1, 1], [12286, 4098], [3, 16377]], 1)
    assert result(expected, "lane_states").tolist() == [2**32 - 1]
    assert len(result(expected, "words")) == 0


# --- Densities -------------------------------------------------------------------------------------------------------


def density(edges: Any, centre: int = 0, family: int = 0, scale_code: int = 0, unit_bits: int = 0) -> dict[str, Any]:
    """Inputs of density_frequencies."""
    return {"edges": ints(edges).reshape(-1), "centre": centre, "density_family": family, "scale_code": scale_code,
            "unit_bits": unit_bits}  # fmt: skip


FAMILIES: Final = {"logistic": 0, "laplace": 1}


@case("core", "density_frequencies", flags=["empty"])
def one_bin() -> Inputs:
    """Without inner edges one bin has everything."""
    expected = yield density([])
    assert result(expected, "cumulative").tolist() == [0, TOTAL]


@case("core", "density_frequencies", each=FAMILIES)
def two_equal_bins(value: int) -> Inputs:
    """An edge at the centre of the {key} density: both bins have half."""
    expected = yield density([84], 42, value, 9, 2)
    assert result(expected, "cumulative").tolist() == [0, TOTAL // 2, TOTAL]


@case("core", "density_frequencies", each=FAMILIES)
def classes_of_magnitudes(value: int) -> Inputs:
    """The {key} density of 40 classes of magnitudes, centre 7.5 classes, scale 2^(10/4) quarters of one."""
    expected = yield density(16 * (2 * np.arange(1, 40) - 1), 120, value, 10, 2)
    cumulative = result(expected, "cumulative")
    assert (np.diff(cumulative) >= 1).all()
    assert np.diff(cumulative).argmax() in (7, 8)


@case("core", "density_frequencies", flags=["region"], each=FAMILIES)
def negative_centres(value: int) -> Inputs:
    """Edges on both sides of a negative centre of the {key} density: >> rounds down below it as well."""
    expected = yield density(np.arange(-4001, 1002, 72), -777, value, 17, 4)
    assert (np.diff(result(expected, "cumulative")) >= 1).all()


@case("core", "density_frequencies", each={str(code): code for code in (0, 1, 2, 3, 4, 5, 17, 31)})
def scales(value: int) -> Inputs:
    """scale_code {key}: a scale is 2^(scale_code / 4) units, of a mantissa of EXP2 and a shift that is rounded up."""
    unit = power(2.0, value / 4)
    edges = np.unique(np.rint(np.arange(-9, 10) * unit * 4).astype(np.int64) * 2 + 1)
    expected = yield density(edges[abs(edges) < 2**16], 3, 0, value, 3)
    assert len(np.unique(np.diff(result(expected, "cumulative")))) > 3


@case("core", "density_frequencies", flags=["clamp"], each=FAMILIES)
def bins_beyond_eight_scales(value: int) -> Inputs:
    """Edges of more than 8 scales from the centre of the {key} density: such bins have a frequency of 1."""
    expected = yield density(np.arange(-200, 201, 10), 0, value, 0, 3)
    frequencies = np.diff(result(expected, "cumulative"))
    assert (frequencies[1:8] == 1).all()
    assert (frequencies[-8:-1] == 1).all()


@case("core", "density_frequencies", flags=["ties"], each=FAMILIES)
def between_places_of_the_table(value: int) -> Inputs:
    """Edges at, just before and just after places of the {key} table: between them it is a line, rounded down."""
    steps = np.array([step * 16 + shift for step in range(-100, 101, 9) for shift in (-1, 0, 1, 7)])
    expected = yield density(2 * steps, 0, value, 0, 4)
    assert (np.diff(result(expected, "cumulative")) >= 1).all()


@case("uncommon", "density_frequencies", each=FAMILIES)
def widest_window(value: int) -> Inputs:
    """512 bins, as many as a window has, of the {key} density."""
    expected = yield density(127 * (2 * np.arange(-255, 256) - 1), -333, value, 31, 4)
    assert len(result(expected, "cumulative")) == 513


@case("stress", "density_frequencies", flags=["overflow"], each={"narrow": (0, 0), "wide": (63, 4)})
def farthest_edges(value: tuple[int, int]) -> Inputs:
    """The most edges that there can be, up to 2^16 from twice the centre on either side, and the {key}est scale."""
    edges = 2 * -777 + np.linspace(-65535, 65535, 1024).astype(np.int64) // 2 * 2
    expected = yield density(edges, -777, 0, *value)
    assert len(result(expected, "cumulative")) == 1026


# --- Windows ---------------------------------------------------------------------------------------------------------


def window(centre: int, step: int, family: int = 0, scale_code: int = 20) -> dict[str, Any]:
    """Inputs of window_frequencies."""
    return {"centre": centre, "step": step, "density_family": family, "scale_code": scale_code}


@case("core", "window_frequencies", each={str(j): j for j in range(11)})
def windows_of_classes(value: int) -> Inputs:
    """The window of size in class {key}, h = 1477 >> {key}: from 8 scales below the centre to 8 scales above it."""
    expected = yield window(64 * 20 - 128 * value, 1477 >> value)
    cumulative = result(expected, "cumulative")
    assert cumulative[-1] == TOTAL
    assert len(cumulative) <= 515


@case("core", "window_frequencies", flags=["region"], each=FAMILIES)
def windows_of_negative_codes(value: int) -> Inputs:
    """A window on both sides of 0 of the {key} density: its ends are rounded outward below 0 as well."""
    expected = yield window(-333, 92, value, 13)
    assert result(expected, "first") < 0


@case("core", "window_frequencies", flags=["ties"], each={"below": (7, 0), "at": (8, 0), "above": (9, 1)})
def windows_of_512_bins(value: tuple[int, int]) -> Inputs:
    """16 scales {key} the bound of 512 codes, beyond which a low bit is raw."""
    expected = yield window(0, 2, 0, value[0])
    assert result(expected, "low_bits") == value[1]


@case("uncommon", "window_frequencies", each={"31": 31, "30": 30})
def widest_windows(value: int) -> Inputs:
    """scale_code {key} with a step of 1: 16 scales are tens of thousands of codes, of which 7 bits are raw."""
    expected = yield window(511 * 64, 1, 1, value)
    assert result(expected, "low_bits") == 7


@case("stress", "window_frequencies", flags=["overflow"],
      each={f"{end}_{size}": (centre, scale_code) for size, scale_code in (("narrow", 0), ("wide", 31))
            for end, centre in (("least", 1 - 2**16), ("greatest", 2**16 - 1))})  # fmt: skip
def farthest_windows(value: tuple[int, int]) -> Inputs:
    """The {key} window: the outermost centre with the coarsest step, and the smallest or largest scale."""
    centre, scale_code = value
    expected = yield window(centre, 2048, 1, scale_code)
    assert len(result(expected, "cumulative")) >= 2
    assert result(expected, "cumulative")[-1] == TOTAL


# --- Halves ----------------------------------------------------------------------------------------------------------


def half(count: int, first_half: int = 8, second_half: int = 8, alpha: int = 4) -> dict[str, int]:
    """Inputs of half_frequencies."""
    return {"count": count, "first_half": first_half, "second_half": second_half, "alpha": alpha}


@case("core", "half_frequencies", each={str(n): n for n in range(1, 17)})
def equal_halves(value: int) -> Inputs:
    """Equal halves, number of splats: {key}. Up to 15 a beta-binomial distribution, from 16 on a density."""
    expected = yield half(value)
    cumulative = result(expected, "cumulative")
    assert len(cumulative) == value + 2
    assert result(expected, "low_bits") == 0
    assert abs(np.diff(cumulative) - np.diff(cumulative)[::-1]).max() < TOTAL // 20


@case("core", "half_frequencies", each={str(alpha): alpha for alpha in spec.ALPHAS})
def shapes_of_halves(value: int) -> Inputs:
    """12 splats with an alpha of {key}: 1 gives all numbers alike, more gathers them in the middle."""
    expected = yield half(12, alpha=value)
    frequencies = np.diff(result(expected, "cumulative"))
    assert (frequencies.argmax() in (5, 6, 7)) or value == 1


@case("core", "half_frequencies", each={str(alpha): alpha for alpha in spec.ALPHAS})
def shapes_of_many(value: int) -> Inputs:
    """300 splats with an alpha of {key}: the density is the narrower, the larger alpha is."""
    expected = yield half(300, alpha=value)
    assert len(result(expected, "cumulative")) == 302


@case("core", "half_frequencies", each={"1_of_16": (16, 1), "9_of_16": (16, 9), "3_of_4": (4, 3), "1_of_2": (2, 1),
                                        "15_of_16": (16, 15)})  # fmt: skip
def unequal_halves(value: tuple[int, int]) -> Inputs:
    """7 splats where the second half is cut by the border, cells of it that are left: {key}; a density, no table."""
    expected = yield half(7, *value)
    frequencies = np.diff(result(expected, "cumulative"))
    assert abs(frequencies.argmax() - 7 * value[0] / sum(value)) < 0.5


@case("core", "half_frequencies", flags=["ties"], each={"3_of_3": (3, 3), "5_of_20": (5, 20), "13_of_2": (13, 2)},
      said={"3_of_3": "3 splats, alpha 3", "5_of_20": "5 splats, alpha 20",
            "13_of_2": "13 splats, alpha 2"})  # fmt: skip
def weights_round_down(value: tuple[int, int]) -> Inputs:
    """Each weight is rounded down before the next one is made of it: {key}."""
    expected = yield half(value[0], alpha=value[1])
    assert result(expected, "cumulative")[-1] == TOTAL


@case("core", "half_frequencies")
def one_splat_in_unequal_halves() -> Inputs:
    """One splat: w is 0 or 1, so e is 0 and has no second term."""
    expected = yield half(1, 2, 1, 1)
    cumulative = result(expected, "cumulative")
    assert len(cumulative) == 3
    assert cumulative[1] > 1


@case("core", "half_frequencies", flags=["ties"],
      each={"172_of_8_and_1": (172, 8, 1, 10), "1_of_128_and_1": (1, 128, 1, 1), "395_of_4_and_1": (395, 4, 1, 10)},
      said={"172_of_8_and_1": "172 splats in 8 and 1 cells", "1_of_128_and_1": "1 splat in 128 and 1 cells",
            "395_of_4_and_1": "395 splats in 4 and 1 cells"})  # fmt: skip
def widths_round_down(value: tuple[int, int, int, int]) -> Inputs:
    """M b (256 - b) >> 9, the division of t and the last shift of (15-9) round down each: {key}."""
    expected = yield half(*value)
    assert result(expected, "cumulative")[-1] == TOTAL


@case("core", "half_frequencies", each={str(n): n for n in (511, 512, 513, 1023, 1024)})
def low_bits_of_halves(value: int) -> Inputs:
    """Splats at the border of another raw low bit, number: {key}."""
    expected = yield half(value)
    assert result(expected, "low_bits") == (value >= 512) + (value >= 1024)
    assert len(result(expected, "cumulative")) == (value >> int(result(expected, "low_bits"))) + 2


@case("stress", "half_frequencies", flags=["overflow"],
      each={"even": (8192, 8192, 1), "uneven": (8192, 1, 100), "gathered": (8192, 8191, 100),
            "spread": (1, 1, 1)})  # fmt: skip
def largest_halves(value: tuple[int, int, int]) -> Inputs:
    """2^21 splats, {key} halves: 13 low bits are raw, and no product exceeds 32 bits."""
    expected = yield half(2**21, *value)
    assert result(expected, "low_bits") == 13


def numbers_in_halves(rng: Draws, width: int, height: int, count: int) -> Array:
    """The numbers of `cells_of_halves` for random halves; those of parts that are not asked are out of the question."""
    parts, numbers = [((0, 0), count)], list[int]()
    for axis, size, inside in spec.halvings(width, height):
        own = [int(rng.integers(0, n + 1)) if origin[axis] + size < inside else 99 * n + 5 for origin, n in parts]
        parts = spec.parts_halved(parts, axis, size, inside, own)
        numbers += own
    return ints(numbers)


def cells(first_halves: Any, count: int, width: int, height: int) -> dict[str, Any]:
    """Inputs of cells_of_halves."""
    return {"width": width, "height": height, "count": count, "first_halves": ints(first_halves).reshape(-1)}


@case("core", "cells_of_halves", flags=["order", "transposed"])
def four_cells() -> Inputs:
    """Left and right first, then each of them into upper and lower: 2 splats in each of 2x2 cells."""
    expected = yield cells([4, 2, 2], 8, 8, 8)
    assert result(expected, "cells")[::2].tolist() == [[0, 0], [0, 1], [1, 0], [1, 1]]


@case("core", "cells_of_halves", flags=["order"])
def one_in_the_second_half() -> Inputs:
    """The number is that of the first half: of 3 splats one is on the left, and all are below."""
    expected = yield cells([1, 0, 0], 3, 8, 8)
    assert result(expected, "cells").tolist() == [[0, 1], [1, 1], [1, 1]]


@case("core", "cells_of_halves", flags=["empty"])
def one_cell() -> Inputs:
    """A frame of one cell is not halved."""
    expected = yield cells([], 5, 3, 4)
    assert result(expected, "cells").tolist() == [[0, 0]] * 5


@case("core", "cells_of_halves", flags=["clamp"])
def more_than_a_part_has() -> Inputs:
    """A number above that of the part stands for all of its splats."""
    expected = yield cells([7, 9], 5, 8, 8)
    assert result(expected, "cells").tolist() == [[0, 0]] * 5


@case("core", "cells_of_halves", flags=["odd-size"], each={
    "43x29": (43, 29), "300x3": (300, 3), "3x300": (3, 300), "64x64": (64, 64), "65x17": (65, 17),
    "352x288": (352, 288),
})  # fmt: skip
def cells_of_a_frame(value: tuple[int, int], rng: Draws) -> Inputs:
    """100 splats of a frame of {key} pixels; a part whose second half is outside has all splats in its first one."""
    width, height = value
    expected = yield cells(numbers_in_halves(rng, width, height, 100), 100, width, height)
    assert (result(expected, "cells") * 4 < [width, height]).all()
    assert len(np.unique(result(expected, "cells"), axis=0)) > 5


# --- Classes of magnitudes -------------------------------------------------------------------------------------------


def classes(rows: Any) -> dict[str, Any]:
    """Inputs of codes_of_classes, from rows of class, low bits and sign."""
    q, low, negative = (column.copy() for column in ints(rows).reshape(-1, 3).T)
    return {"classes": q, "low": low, "negative": negative}


@case("core", "codes_of_classes", flags=["ties"])
def every_class() -> Inputs:
    """The least and the greatest magnitude of each class: together they leave no number out."""
    ends = [(q, low, 0) for q in range(40) for low in (0, (1 << int(spec.low_bits(q))) - 1)]
    expected = yield classes(ends)
    least, greatest = result(expected, "codes").reshape(-1, 2).T
    assert least.tolist() == [0, *(greatest[:-1] + 1)]
    assert greatest[-1] == 2**20 - 1


@case("core", "codes_of_classes", each={"positive": 0, "negative": 1})
def codes_of_one_sign(value: int, rng: Draws) -> Inputs:
    """Codes that are all {key}, or 0."""
    q = rng.integers(0, 40, (50,))
    low = rng.integers(np.zeros(50, np.int64), np.int64(1) << spec.low_bits(q))
    expected = yield classes(np.stack([q, low, np.full(50, value)], axis=1))
    assert (result(expected, "codes") * (1 - 2 * value) >= 0).all()


@case("core", "codes_of_classes")
def small_codes() -> Inputs:
    """Classes 0 to 3 are the magnitudes; 4 and 5 have one low bit, 6 and 7 two."""
    expected = yield classes([[0, 0, 0], [0, 0, 1], [3, 0, 1], [4, 0, 0], [4, 1, 1], [5, 1, 0], [6, 3, 1], [7, 0, 0]])
    assert result(expected, "codes").tolist() == [0, 0, -3, 4, -5, 7, -11, 12]


@case("core", "codes_of_classes", flags=["empty"])
def codes_of_nothing() -> Inputs:
    """No codes."""
    expected = yield classes([])
    assert result(expected, "codes").shape == (0,)


# --- Motion fields ---------------------------------------------------------------------------------------------------


@case("core", "field_vectors", flags=["order"])
def left_and_above() -> Inputs:
    """Each difference is to the vector on the left, in the first column to the one above, and the first one to none."""
    expected = yield {"differences": ints([[[5, -7], [1, 2]], [[10, 20], [-3, 4]], [[0, 1], [0, 0]]])}
    assert result(expected, "vectors").tolist() == [[[5, -7], [6, -5]], [[15, 13], [12, 17]], [[15, 14], [15, 14]]]


@case("core", "field_vectors", flags=["transposed"], each={"one_row": (1, 9), "one_column": (9, 1), "5x7": (7, 5)})
def fields_of_sizes(value: tuple[int, int], rng: Draws) -> Inputs:
    """A field of {key}."""
    expected = yield {"differences": rng.integers(-40, 41, (*value, 2))}
    assert len(np.unique(result(expected, "vectors"))) > 8


@case("core", "field_vectors", flags=["empty"])
def still_field() -> Inputs:
    """All differences are 0."""
    expected = yield {"differences": np.zeros((3, 4, 2), np.int64)}
    assert not result(expected, "vectors").any()


@case("stress", "field_vectors", flags=["overflow"], each={"above": 4095, "below": -4095})
def sums_beyond_16_bits(value: int) -> Inputs:
    """Sums of differences of {key} the range are reduced to -2^15 to 2^15 - 1 by multiples of 2^16."""
    expected = yield {"differences": np.full((9, 20, 2), value)}
    assert result(expected, "vectors").min() < -(2**14)
    assert result(expected, "vectors").max() > 2**14


# --- Models ----------------------------------------------------------------------------------------------------------

STARTS: Final = {name: model["counts"] for name, model in spec.new_models().items()}


@case("core", "model_frequencies", each={name: name for name in STARTS})
def models_at_the_start(value: str) -> Inputs:
    """All contexts of the model `{key}` as an I-frame leaves them."""
    expected = yield {"counts": STARTS[value]}
    assert (np.diff(result(expected, "cumulative")) >= 1).all()


@case("core", "model_frequencies", flags=["ties"])
def rest_of_the_first_largest() -> Inputs:
    """What rounding leaves over belongs to the first symbol of the greatest frequency, not to the last one."""
    expected = yield {"counts": ints([[5, 7, 7, 3], [1, 1, 1, 1], [9, 2, 2, 9]])}
    frequencies = np.diff(result(expected, "cumulative"))
    assert (frequencies[[0, 2], [1, 0]] > frequencies[[0, 2], [2, 3]]).all()
    assert frequencies[1].tolist() == [TOTAL // 4] * 4


@case("core", "model_frequencies")
def symbols_that_were_never_seen() -> Inputs:
    """A count of 0 has a frequency of 1."""
    expected = yield {"counts": ints([[0, 0, 5, 0], [1, 0, 0, 0]])}
    assert np.diff(result(expected, "cumulative")).tolist() == [[1, 1, TOTAL - 3, 1], [TOTAL - 3, 1, 1, 1]]


@case("core", "model_frequencies", flags=["ties"])
def counts_are_shifted_from_17_bits_on() -> Inputs:
    """Counts that add up to 2^17 - 1 stay; of 2^17 on they lose bits, each on its own, and small ones become 0."""
    rows = [[2**16, 2**16 - 2, 1], [2**16, 2**16 - 1, 1], [2**18 - 5, 3, 2], [2**19 - 1, 7, 8]]
    expected = yield {"counts": ints(rows)}
    assert (np.diff(result(expected, "cumulative")) >= 1).all()


@case("core", "model_frequencies", flags=["ties"], each={str(bits): bits for bits in (18, 22, 32)})
def divided_by_the_sum_of_shifted_counts(value: int) -> Inputs:
    """Counts of {key} bits together that are all odd: what each of them loses is missing in their sum, too."""
    counts = np.stack([np.full(24, (1 << value) // 24 - 1 | 1), np.arange(1, 48, 2) * ((1 << value) // 1000 | 1)])
    expected = yield {"counts": counts}
    assert int(np.sum(counts[0])).bit_length() == int(np.sum(counts[1])).bit_length() == value
    assert (np.diff(result(expected, "cumulative")) >= 1).all()


@case("core", "model_frequencies", flags=["ties"])
def rest_of_the_first_of_equal_frequencies() -> Inputs:
    """Counts of 2^17, 2^17 + 1 and 2^17 are equal once they are shifted: the first one gets the rest."""
    expected = yield {"counts": ints([[2**17, 2**17 + 1, 2**17]])}
    assert np.diff(result(expected, "cumulative")).tolist() == [[5462, 5461, 5461]]


@case("core", "model_frequencies")
def two_symbols() -> Inputs:
    """Models of two symbols."""
    expected = yield {"counts": ints([[1, 2], [2, 1], [1000, 1]])}
    assert result(expected, "cumulative").shape == (3, 3)


@case("core", "model_frequencies")
def models_of_a_stream(rng: Draws) -> Inputs:
    """Counts as they are after some frames."""
    counts = STARTS["shape"]
    for _ in range(5):
        counts = spec.adapt_model(counts, rng.integers(0, 300, counts.shape) // (1 + np.arange(24)))["counts"]
    expected = yield {"counts": counts}
    assert result(expected, "cumulative").shape == (7, 25)


@case("stress", "model_frequencies", flags=["overflow"])
def largest_counts() -> Inputs:
    """Counts that add up to almost 2^32: they are shifted by 15 before they are multiplied."""
    rows = np.stack([np.full(24, 2**32 // 24), np.eye(24, dtype=np.int64)[3] * (2**32 - 25) + 1, np.arange(24) * 2**23])
    expected = yield {"counts": rows.astype(np.int64)}
    assert (np.diff(result(expected, "cumulative")) >= 1).all()


@case("core", "adapt_model", flags=["kept"])
def contexts_that_were_used() -> Inputs:
    """7/8 of each count and 64 for each symbol that was decoded; a context without symbols keeps its counts."""
    counts, seen = ints([[800, 16, 8], [800, 16, 8]]), ints([[2, 0, 1], [0, 0, 0]])
    expected = yield {"counts": counts, "seen": seen}
    assert result(expected, "counts").tolist() == [[828, 14, 71], [800, 16, 8]]


@case("core", "adapt_model", flags=["ties"])
def counts_round_down() -> Inputs:
    """7 c >> 3 of small counts: 1 becomes 0, 2 becomes 1, 9 becomes 7."""
    expected = yield {"counts": ints([[1, 2, 3, 7, 8, 9, 15, 16]]), "seen": ints([[1, 0, 0, 0, 0, 0, 0, 0]])}
    assert result(expected, "counts").tolist() == [[64, 1, 2, 6, 7, 7, 13, 14]]


@case("core", "adapt_model", each={name: name for name in STARTS})
def models_behind_a_frame(value: str, rng: Draws) -> Inputs:
    """The model `{key}` after the first P-frame; some contexts were not used."""
    counts = STARTS[value]
    seen = rng.integers(0, 40, counts.shape) * (np.arange(len(counts)) % 3 != 1)[:, None]
    expected = yield {"counts": counts, "seen": seen}
    assert (result(expected, "counts")[0] != counts[0]).any()


@case("stress", "adapt_model", flags=["overflow"])
def most_symbols() -> Inputs:
    """4,194,303 symbols of one kind: 64 times as many is 2^28, beside a count that is near 2^32."""
    counts, seen = ints([[2**32 - 24, *[1] * 22], [2**31, *[2**26] * 22]]), np.zeros((2, 23), np.int64)
    seen[:, 5] = 2**22 - 1
    expected = yield {"counts": counts, "seen": seen}
    assert result(expected, "counts")[0, 5] == 64 * (2**22 - 1)


# --- Contexts of modes -----------------------------------------------------------------------------------------------


def contexts(rows: Array, past: Any, motion: Any = None, vectors: Any = None, cell: int = 0, width: int = 64,
             height: int = 48) -> dict[str, Any]:  # fmt: skip
    """Inputs of mode_contexts."""
    return {"width": width, "height": height, "state": rows, "past": ints(past),
            "motion": ints(np.zeros((len(rows), 2)) if motion is None else motion).reshape(-1, 2),
            "vectors": np.zeros((0, 0, 2), np.int64) if vectors is None else ints(vectors),
            "motion_cell": cell}  # fmt: skip


@case("core", "mode_contexts")
def contexts_without_a_field() -> Inputs:
    """Without a field only the past counts: 0, 3 and 6."""
    expected = yield contexts(state({}, {"X": 5}, {"Y": 9}), [0, 1, 2])
    assert result(expected, "contexts").tolist() == [0, 3, 6]


@case("core", "mode_contexts", flags=["odd-size"])
def splats_that_leave_the_frame() -> Inputs:
    """Outside is below 0 and from 256 W or 256 H on, after the motion; the frame has 61x37 pixels."""
    right, lower = 256 * 61, 256 * 37
    rows = state({}, {}, {}, {"X": right - 1, "Y": lower - 1}, {"X": right - 1}, {"Y": lower - 1}, {"X": right},
                 {"X": -7, "Y": lower + 5})  # fmt: skip
    motion = [[0, 0], [-1, 0], [0, -1], [0, 0], [1, 0], [0, 1], [-1, 0], [7, -6]]
    expected = yield contexts(rows, [1] * 8, motion, width=61, height=37)
    assert result(expected, "contexts").tolist() == [3, 9, 9, 3, 9, 9, 3, 3]


@case("core", "mode_contexts", flags=["ties"], each={"x": (1, 0), "y": (0, 1), "both": (1, 1)},
      said={"x": "in x", "y": "in y", "both": "in x and y"})  # fmt: skip
def unrest_at_its_thresholds(value: tuple[int, int]) -> Inputs:
    """A vector that differs from its neighbours by 2, 3, 7 and 8 {key}: |dVx| + |dVy| counts."""
    steps = [0, 2, 3, 7, 8, 100]
    x, y = value
    vectors = np.zeros((1, 12, 2), np.int64)
    vectors[0, 1::2] = [[s * x if x and not y else s // 2 * x, -s * y if y and not x else -(s - s // 2) * y]
                        for s in steps]  # fmt: skip
    rows = state(*({"X": 256 * (16 * (2 * i + 1) + 8), "Y": 256 * 3} for i in range(6)))
    expected = yield contexts(rows, [2] * 6, None, vectors, 3, width=192, height=16)
    assert result(expected, "contexts").tolist() == [6, 6, 7, 7, 8, 8]


@case("core", "mode_contexts", flags=["transposed"])
def four_neighbours() -> Inputs:
    """The cells left, right, above and below one that differs are uneasy; those that only touch its corner are not."""
    vectors = np.zeros((5, 5, 2), np.int64)
    vectors[2, 2] = 9, -9
    rows = state(*({"X": 256 * (16 * c + 5), "Y": 256 * (16 * r + 11)} for r in range(5) for c in range(5)))
    expected = yield contexts(rows, [0] * 25, None, vectors, 3, width=80, height=80)
    found = result(expected, "contexts").reshape(5, 5)
    assert np.argwhere(found == 2).tolist() == [[1, 2], [2, 1], [2, 2], [2, 3], [3, 2]]


@case("core", "mode_contexts")
def greatest_of_the_neighbours() -> Inputs:
    """Neighbours that differ by 2 each are not unrest: the greatest counts, not the sum."""
    vectors = ints([[[0, 0], [2, 0], [0, 0]], [[0, 2], [0, 0], [2, 0]], [[0, 0], [0, 2], [0, 0]]])
    rows = state({"X": 256 * 24, "Y": 256 * 24})
    expected = yield contexts(rows, [0], None, vectors, 3, width=48, height=48)
    assert result(expected, "contexts").tolist() == [0]


@case("core", "mode_contexts", flags=["order"])
def cell_before_it_moves() -> Inputs:
    """The unrest is that of the cell that the splat was in, not of the one that it moves to."""
    vectors = ints([[[0, 0], [0, 0], [0, 0], [50, 0]]])
    rows = state({"X": 256 * 8}, {"X": 256 * 40})
    expected = yield contexts(rows, [0, 0], [[256 * 40, 0], [-256 * 30, 0]], vectors, 3, width=64, height=16)
    assert result(expected, "contexts").tolist() == [0, 2]


@case("core", "mode_contexts", flags=["clamp"])
def cells_of_splats_outside() -> Inputs:
    """A splat that was outside of the frame was in the nearest cell; 60x20 pixels are 4x2 cells of 16."""
    vectors = np.zeros((2, 4, 2), np.int64)
    vectors[0, 0], vectors[1, 3] = 20, -5
    rows = state({"X": -300, "Y": -1}, {"X": 256 * 60 + 9}, {"X": 256 * 70, "Y": 256 * 40}, {"Y": 256 * 90}, {"X": -9})
    back = [[300, 1], [-10, 0], [-256 * 11, -256 * 21], [0, -256 * 80], [9, 0]]
    expected = yield contexts(rows, [0] * 5, back, vectors, 3, width=60, height=20)
    assert result(expected, "contexts").tolist() == [2, 2, 2, 2, 2]


@case("core", "mode_contexts", each={"64_pixels": 1, "32_pixels": 2, "16_pixels": 3})
def contexts_of_a_frame(value: int, rng: Draws) -> Inputs:
    """300 splats of a frame of 352x288 with cells of {key}."""
    side = spec.SIDES[value]
    vectors = rng.integers(-3, 4, (-(-288 // side), -(-352 // side), 2))
    rows = painted(rng, 300)
    motion = spec.field_motion(rows, vectors, side)
    expected = yield contexts(rows, rng.integers(0, 3, (300,)), motion, vectors, value, 352, 288)
    assert len(set(result(expected, "contexts").tolist())) > 6


@case("core", "mode_contexts", flags=["empty"])
def contexts_of_nothing() -> Inputs:
    """No splats."""
    expected = yield contexts(state(), [])
    assert result(expected, "contexts").shape == (0,)


@case("stress", "mode_contexts", flags=["overflow"])
def vectors_far_apart() -> Inputs:
    """Vectors of -2^15 and 2^15 - 1 differ by 2 · 65535, and splats are 2^16 pixels away."""
    vectors = ints([[[-(2**15), 2**15 - 1], [2**15 - 1, -(2**15)]], [[-(2**15)] * 2, [-(2**15)] * 2]])
    rows = state({}, {"X": 2**24, "Y": 2**24}, {"X": -(2**24)}, {"Y": 256 * 20})
    motion = [[0, 0], [-(2**21), 2**21], [2**21, 0], [0, 0]]
    expected = yield contexts(rows, [1, 2, 0, 2], motion, vectors, 3, width=17, height=32)
    assert result(expected, "contexts").tolist() == [5, 9, 9, 8]
