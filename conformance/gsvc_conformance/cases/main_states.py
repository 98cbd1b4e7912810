"""Cases of profile `main` from codes to parameters: classes, I-frames, motion, P-frames (spec.md section 15)."""

from typing import Any, Final

import numpy as np

from gsvc_base import spec
from gsvc_base.draws import Draws
from gsvc_base.portable import power
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.building import Array, result
from gsvc_conformance.cases.states import CLASSES, D, Q, color_of_class, column, ints, painted, state

H: Final = [1477 >> j for j in range(CLASSES)]
"""The step of A and B, by class."""
QUANTIZERS: Final = {"0": 0, "2": 2, "7": 7, "8": 8, "41": 41, "79": 79}


# --- Classes ---------------------------------------------------------------------------------------------------------


@case("core", "splat_classes", flags=["ties"])
def classes_at_their_thresholds() -> Inputs:
    """k0² + k1² + k2² = 2^(2j - 1) is the least of class j, for all j; the next smaller sum is of the class below."""
    at = [(1 << (j - 1), 1 << (j - 1), 0) for j in range(1, CLASSES)]
    below = [(a, b - 1, 0) for a, b, _ in at]
    n = ints([*at, *below]) * D
    rows = np.concatenate([np.zeros((len(n), 5), np.int64), n], axis=1)
    expected = yield {"state": rows, "quantizer": Q}
    assert result(expected, "classes").tolist() == [*range(1, CLASSES), *range(CLASSES - 1)]


@case("core", "splat_classes", flags=["ties"], each={"even": Q, "odd": 2}, said={"even": "even D", "odd": "odd D"})
def classes_round_their_colors(value: int) -> Inputs:
    """|n| is divided by an {key} after D div 2 was added, and a sign does not count."""
    step = spec.step_of(value)
    half = step - step // 2
    n = [[half - 1, half - 1, 0], [half, half, 0], [-half, half, 0], [1 - half, -half, half - 1], [0, -half, -half]]
    rows = np.concatenate([np.zeros((len(n), 5), np.int64), ints(n)], axis=1)
    expected = yield {"state": rows, "quantizer": value}
    assert result(expected, "classes").tolist() == [0, 1, 1, 0, 1]


@case("core", "splat_classes", each=QUANTIZERS)
def classes_of_quantizer(value: int, rng: Draws) -> Inputs:
    """Splats of all classes with a quantizer of {key}: D grows by an octave for every 8."""
    step = spec.step_of(value)
    n = rng.normal(0, 1, (40, 3)) * step * np.ldexp(1.0, np.arange(40) % 12 - 1)[:, None]
    rows = np.concatenate([np.zeros((40, 5), np.int64), n.astype(np.int64)], axis=1)
    expected = yield {"state": rows, "quantizer": value}
    assert len(set(result(expected, "classes").tolist())) > 8


@case("core", "splat_classes", flags=["empty"])
def classes_of_nothing() -> Inputs:
    """No splats."""
    expected = yield {"state": state(), "quantizer": Q}
    assert result(expected, "classes").shape == (0,)


@case("stress", "splat_classes", flags=["overflow"])
def classes_of_the_brightest() -> Inputs:
    """N of 2^28 and D of 8: k is 1024 at most, so that squares fit into 32 bits."""
    most = spec.N_MOST
    rows = state({"n0": most}, {"n0": -most, "n1": most, "n2": -most}, {"n2": 1024 * 8 - 5}, {"n1": 724 * 8})
    expected = yield {"state": rows, "quantizer": 0}
    assert result(expected, "classes").tolist() == [10, 10, 10, 9]


# --- I-frames --------------------------------------------------------------------------------------------------------


def codes(quantizer: int, cells: Any, colors: Any, shapes: Any, places: Any) -> dict[str, Any]:
    """Inputs of main_intra."""
    return {"quantizer": quantizer, "cells": ints(cells).reshape(-1, 2), "colors": ints(colors).reshape(-1, 3),
            "shapes": ints(shapes).reshape(-1, 3), "places": ints(places).reshape(-1, 2)}  # fmt: skip


def place_bits(quantizer: int, colors: Array, shapes: Array) -> Array:
    """How many bits x and y of the place of each splat have, (N, 2)."""
    step = spec.step_of(quantizer)
    j = spec.classes(spec.coded_colors(colors, step), step)
    return np.stack([2 - spec.place_step(shapes.T, j, sign) for sign in (1, -1)], axis=1)


@case("core", "main_intra")
def one_splat() -> Inputs:
    """A splat of class 0 and size 1: a step of its place is 2 pixels, and it is in the middle of one."""
    expected = yield codes(Q, [[1, 2]], [[1, 0, 0]], [[0, 0, 0]], [[0, 1]])
    assert result(expected, "state").tolist() == [[1024 + 256, 2 * 1024 + 512 + 256, 0, 0, 0, D, 0, 0]]


@case("core", "main_intra", flags=["transposed"])
def size_and_aspect() -> Inputs:
    """A is the sum of the codes of size and aspect, B the difference; a step is 1477/1024 of an octave in class 0."""
    expected = yield codes(Q, [[0, 0]] * 3, [[0, 0, 0]] * 3, [[2, 1, 0], [2, -1, 0], [0, 1, 0]], [[0, 0]] * 3)
    assert column(result(expected, "state"), "A", "B") == [[3 * 1477, 1477, 1477], [1477, 3 * 1477, -1477]]


@case("core", "main_intra")
def steps_by_class() -> Inputs:
    """One splat of each class: a step of size is 1477 >> j, one of shear 2048 >> j."""
    colors = [[color_of_class(j) // D, 0, 0] for j in range(CLASSES)]
    shapes = [[1, 0, -1]] * CLASSES
    expected = yield codes(Q, [[j, 0] for j in range(CLASSES)], colors, shapes, [[0, 0]] * CLASSES)
    A, S = column(result(expected, "state"), "A", "S")
    assert (H, [-(2048 >> j) for j in range(CLASSES)]) == (A, S)


@case("core", "main_intra", flags=["region"])
def places_of_negative_sizes() -> Inputs:
    """A = -1477 is in octave -2: A >> 10 rounds down, also below 0, so that a step of the place is half a pixel."""
    expected = yield codes(Q, [[0, 0]] * 2, [[0, 0, 0]] * 2, [[-1, 0, 0], [0, -1, 0]], [[7, 7], [7, 0]])
    assert column(result(expected, "state"), "X", "Y") == [[7 * 128 + 64, 7 * 128 + 64], [7 * 128 + 64, 512]]


@case("core", "main_intra")
def places_of_all_sizes() -> Inputs:
    """From 0 to 6 bits of a place: the step is 2^g pixels, g being -4 to 2, and is larger for dark splats."""
    sizes = [(0, 4), (0, 1), (0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0), (10, 0), (0, -1)]
    colors = ints([[color_of_class(j) // D, 0, 0] for j, _ in sizes])
    shapes = ints([[k, 0, 0] for _, k in sizes])
    bits = place_bits(Q, colors, shapes)
    assert sorted(set(bits[:, 0].tolist())) == list(range(7))
    expected = yield codes(Q, [[3, 5]] * len(sizes), colors, shapes, (1 << bits) - 1)
    assert (result(expected, "state")[:, :2] // 1024 == [3, 5]).all()


@case("core", "main_intra", each=QUANTIZERS)
def intra_codes_of_quantizer(value: int, rng: Draws) -> Inputs:
    """60 splats with a quantizer of {key}."""
    expected = yield random_codes(rng, value, 60)
    assert len(result(expected, "state")) == 60


def random_codes(rng: Draws, quantizer: int, count: int) -> dict[str, Any]:
    """Codes of an I-frame of 352x288 as an encoder makes them."""
    cells = np.stack([rng.integers(0, 88, (count,)), rng.integers(0, 72, (count,))], axis=1)
    colors = (rng.normal(0, 1, (count, 3)) * power(2.0, rng.uniform(-1, 7, (count, 1))) * [1, 0.3, 0.3]).astype(
        np.int64
    )
    step = spec.step_of(quantizer)
    j = spec.classes(spec.coded_colors(colors, step), step)
    shapes = rng.normal(0, 1, (count, 3)) * [900, 600, 700] / np.array(H)[j][:, None] + [[1, 0, 0]]
    shapes = np.rint(shapes).astype(np.int64)
    places = rng.integers(0, 1 << place_bits(quantizer, colors, shapes))
    return codes(quantizer, cells, colors, shapes, places)


@case("core", "main_intra", flags=["empty"])
def intra_codes_of_nothing() -> Inputs:
    """No splats."""
    expected = yield codes(Q, [], [], [], [])
    assert result(expected, "state").shape == (0, 8)


@case("uncommon", "main_intra", flags=["clamp"])
def shapes_are_clipped() -> Inputs:
    """A and B are clipped to -3072 and 13311 each on its own, S to 32767; the place is that of the clipped ones."""
    shapes = [[8, 3, 0], [8, -3, 0], [-3, -1, 0], [-3, 1, 0], [10, 0, 17], [0, 0, -17]]
    colors = np.zeros((len(shapes), 3), np.int64)
    places = (1 << place_bits(Q, colors, ints(shapes))) - 1
    expected = yield codes(Q, [[0, 0]] * len(shapes), colors, shapes, places)
    A, B, S = column(result(expected, "state"), "A", "B", "S")
    assert A == [13311, 5 * 1477, -3072, -2 * 1477, 13311, 0]
    assert B == [5 * 1477, 13311, -2 * 1477, -3072, 13311, 0]
    assert S == [0, 0, 0, 0, 32767, -32767]


@case("uncommon", "main_intra", flags=["clamp"])
def colors_are_clipped_before_they_are_multiplied() -> Inputs:
    """With D of 7512 a code is clipped to 35735: n is a multiple of D, and its class that of the clipped code."""
    step = spec.step_of(79)
    most = spec.N_MOST // step
    assert (step * (most + 1)) > spec.N_MOST
    colors = [[most, -most, 0], [most + 1, 0, -most - 1], [2**20 - 1, 1 - 2**20, most - 1]]
    expected = yield codes(79, [[0, 0]] * 3, colors, [[0, 0, 0]] * 3, [[63, 63]] * 3)
    n = result(expected, "state")[:, 5:]
    assert n.tolist() == [[most * step, -most * step, 0], [most * step, 0, -most * step],
                          [most * step, -most * step, (most - 1) * step]]  # fmt: skip


@case("stress", "main_intra", flags=["overflow", "clamp"], each={"finest": 0, "coarsest": 79})
def widest_codes(value: int) -> Inputs:
    """The {key} quantizer with the largest codes that a density has in its window, and the last cell of any frame."""
    colors, shapes = [], []
    for j in (0, CLASSES - 1):
        (low, high), (left, right) = _ends(spec.h_size, 128, j), _ends(spec.h_shear, 0, j)
        shapes += [[low, low, left], [low, high, right], [high, low, right], [high, high, left]]
        colors += [[0 if j == 0 else 1 << j, 0, 0]] * 4
    bits = place_bits(value, ints(colors), ints(shapes))
    expected = yield codes(value, [[2**14 - 1, 2**14 - 1]] * len(colors), colors, shapes, (1 << bits) - 1)
    A, B, S = column(result(expected, "state"), "A", "B", "S")
    assert {min(A), max(A), min(B), max(B)} == {-3072, 13311}
    assert {min(S), max(S)} == {-32767, 32767}


def _ends(h: Any, slope: int, j: int) -> tuple[int, int]:
    """The least and the largest code of size, aspect or shear in any window (15-7) of a class."""
    centres = 64 * -512 + 16 * -slope * j, 64 * 511 + 16 * max(slope - 1, 0) * j
    (_, r, first), (bins, _, last) = (spec.window_density(spec.LOGISTIC, 31, centre, h(j)) for centre in centres)
    return int(first << r), int((last + len(bins) - 1 << r) - 1)


# --- Motion ----------------------------------------------------------------------------------------------------------

SIDES: Final = {"64_pixels": 1, "32_pixels": 2, "16_pixels": 3}


@case("core", "motion_of_splats")
def one_vector() -> Inputs:
    """A field of one cell: quarter pixels times 64 are 1/256 pixels, wherever the splat is."""
    rows = state({}, {"X": -5000, "Y": 90000}, {"X": 16 * 256, "Y": 8 * 256})
    expected = yield {"state": rows, "vectors": ints([[[5, -3]]]), "motion_cell": 3}
    assert result(expected, "motion").tolist() == [[320, -192]] * 3


@case("core", "motion_of_splats", each=SIDES)
def between_centres(value: int) -> Inputs:
    """Cells of {key}: at a centre it is that cell's vector, a quarter of the way on a quarter of the next one."""
    side = spec.SIDES[value]
    centre, quarter = 128 * side, 64 * side
    vectors = ints([[[0, 0], [8, 0]], [[0, 16], [8, 16]]])
    rows = state({"X": centre, "Y": centre}, {"X": centre + quarter, "Y": centre}, {"X": centre, "Y": centre + quarter},
                 {"X": centre + 2 * quarter, "Y": centre + 3 * quarter})  # fmt: skip
    expected = yield {"state": rows, "vectors": vectors, "motion_cell": value}
    assert result(expected, "motion").tolist() == [[0, 0], [128, 0], [0, 256], [256, 768]]


@case("core", "motion_of_splats", flags=["clamp"])
def beyond_the_outer_centres() -> Inputs:
    """Left of the first centre and right of the last one the motion is theirs; above and below as well."""
    vectors = ints([[[4, 1], [8, 2]], [[12, 3], [16, 4]]])
    far = 2**24
    rows = state({}, {"X": far}, {"Y": far}, {"X": far, "Y": far}, {"X": -far, "Y": -far}, {"X": 8 * 256 - 1})
    expected = yield {"state": rows, "vectors": vectors, "motion_cell": 3}
    assert result(expected, "motion").tolist() == [[64 * 4, 64], [512, 128], [768, 192], [1024, 256], [256, 64],
                                                   [256, 64]]  # fmt: skip


@case("core", "motion_of_splats", flags=["transposed"], each={"row": (1, 5), "column": (5, 1)})
def field_of_one(value: tuple[int, int]) -> Inputs:
    """A field of one {key}: the other direction has nothing to be between."""
    vectors = ints([[10 * i, 7 - 3 * i] for i in range(5)]).reshape(*value, 2)
    rows = state(*({"X": 900 * i, "Y": 1700 * i} for i in range(13)))
    expected = yield {"state": rows, "vectors": vectors, "motion_cell": 3}
    assert len(np.unique(result(expected, "motion"), axis=0)) > 4


@case("core", "motion_of_splats", flags=["ties"])
def motion_rounds_up_at_halves() -> Inputs:
    """32 is added before >> 6, which rounds down: halves go up, and negative ones, too."""
    vectors = ints([[[1, -1], [2, -2]], [[3, -3], [9, -9]]])
    centre = 8 * 256
    rows = state(*({"X": centre + 64 * i + i, "Y": centre + 64 * 8 * (i % 8)} for i in range(64)))
    expected = yield {"state": rows, "vectors": vectors, "motion_cell": 3}
    assert (result(expected, "motion")[:, 1] < 0).all()
    whole = _halves_of_motion(rows, vectors, 16)
    assert (whole % 64 == 32).any(axis=0).all()


def _halves_of_motion(rows: Array, vectors: Array, side: int) -> Array:
    """What (15-12) shifts, without its 32."""
    i, i1, f = spec.between(rows[:, 0], side, vectors.shape[1])
    j, j1, h = spec.between(rows[:, 1], side, vectors.shape[0])
    f, h = f[:, None], h[:, None]
    upper = (64 - f) * vectors[j, i] + f * vectors[j, i1]
    lower = (64 - f) * vectors[j1, i] + f * vectors[j1, i1]
    found: Array = (64 - h) * upper + h * lower
    return found


@case("core", "motion_of_splats", each=SIDES)
def field_of_a_frame(value: int, rng: Draws) -> Inputs:
    """300 splats of a frame of 352x288 with cells of {key}, a few splats beyond its border."""
    side = spec.SIDES[value]
    vectors = rng.integers(-40, 41, (-(-288 // side), -(-352 // side), 2))
    expected = yield {"state": painted(rng, 300), "vectors": vectors, "motion_cell": value}
    assert len(np.unique(result(expected, "motion"), axis=0)) > 200


@case("core", "motion_of_splats", flags=["empty"])
def motion_of_nothing() -> Inputs:
    """A field and no splats."""
    expected = yield {"state": state(), "vectors": ints([[[5, -3]]]), "motion_cell": 1}
    assert result(expected, "motion").shape == (0, 2)


@case("stress", "motion_of_splats", flags=["overflow"])
def fastest_motion() -> Inputs:
    """Vectors of -2^15 and 2^15 - 1 side by side, and splats between them and 2^17 pixels away."""
    vectors = ints([[[-(2**15), 2**15 - 1], [2**15 - 1, -(2**15)]] * 2] * 3)
    where = [*range(0, 64 * 256, 1023), 2**24, -(2**24), 2**24 - 1]
    rows = state(*({"X": x, "Y": x // 3} for x in where))
    expected = yield {"state": rows, "vectors": vectors, "motion_cell": 3}
    assert abs(result(expected, "motion")).max() == 2**21


# --- P-frames --------------------------------------------------------------------------------------------------------


def predicted(rows: Any, differences: Any, motion: Any = None, quantizer: int = Q) -> dict[str, Any]:
    """Inputs of main_inter; splats do not move unless it is said."""
    moved = np.zeros((len(rows), 2), np.int64) if motion is None else ints(motion)
    return {"quantizer": quantizer, "state": rows, "motion": moved, "differences": ints(differences).reshape(-1, 8)}


def q(**parts: int) -> list[int]:
    """Differences by name, q0 to q7."""
    return [parts.get(f"q{i}", 0) for i in range(8)]


@case("core", "main_inter")
def nothing_changes(rng: Draws) -> Inputs:
    """No motion and no differences: the state stays as it is."""
    rows = painted(rng, 20)
    expected = yield predicted(rows, np.zeros((20, 8)))
    assert np.array_equal(result(expected, "state"), rows)


@case("core", "main_inter", flags=["transposed"])
def motion_alone() -> Inputs:
    """(dX, dY) is added to X and Y."""
    expected = yield predicted(state({"X": 1000, "Y": 2000, "n0": 5}), [q()], [[-70, 33]])
    assert result(expected, "state").tolist() == [[930, 2033, 0, 0, 0, 5, 0, 0]]


@case("core", "main_inter", flags=["transposed"])
def position_in_its_own_axes() -> Inputs:
    """A step of q0 goes along (l11, l21) and one of q1 along (0, l22), each √2 t long: with t = 1, 362/256."""
    wide = {"A": 1024, "B": 0, "S": 512}
    rows = state(wide, wide, wide, {**wide, "S": -512})
    expected = yield predicted(rows, [q(q0=1), q(q1=1), q(q0=-2, q1=3), q(q0=1)])
    X, Y = column(result(expected, "state"), "X", "Y")
    assert X == [724, 0, -1448, 724]
    assert Y == [181, 362, -2 * 181 + 3 * 362, -181]


@case("core", "main_inter")
def position_steps_by_class() -> Inputs:
    """A step of position halves with every class of the reference."""
    rows = state(*({"A": 3072, "B": 2048, "n0": color_of_class(j)} for j in range(CLASSES)))
    expected = yield predicted(rows, [q(q0=1, q1=-1)] * CLASSES)
    X, Y = column(result(expected, "state"), "X", "Y")
    assert [int(spec.exp2(3072 + 512 - 1024 * j, 8)) for j in range(CLASSES)] == X
    assert [-int(spec.exp2(2048 + 512 - 1024 * j, 8)) for j in range(CLASSES)] == Y


@case("core", "main_inter", flags=["region"])
def fractions_of_octaves() -> Inputs:
    """Steps of splats whose A and B are not whole octaves: the mantissa is that of A mod 1024, also below 0."""
    logs = [-3072, -2049, -2048, -1025, -1024, -513, -512, -1, 0, 1, 511, 512, 1023, 1025, 3000, 6001]
    rows = state(*({"A": a, "B": -a if a > -3000 else 77} if abs(a) < 3073 else {"A": a, "B": 5} for a in logs))
    expected = yield predicted(rows, [q(q0=1, q1=1)] * len(logs))
    assert column(result(expected, "state"), "X")[0] == [int(spec.exp2(a + 512, 8)) for a in logs]


@case("core", "main_inter", flags=["clamp"])
def least_and_largest_position_steps() -> Inputs:
    """A step is at least 1/256 pixel and at most 2^17 - 1; so is that of shear, of either sign, at most."""
    tiny = {"A": -3072, "B": -3072, "n0": color_of_class(10), "S": 100}
    huge = {"A": 13311, "B": 13311, "S": 32767}
    rows = state(tiny, tiny, huge, huge, {**huge, "S": -32767})
    expected = yield predicted(rows, [q(q0=1), q(q1=-1), q(q0=1), q(q1=1), q(q0=1)])
    X, Y = column(result(expected, "state"), "X", "Y")
    assert X == [1, 0, 2**17 - 1, 0, 2**17 - 1]
    assert Y == [0, -1, 2**17 - 1, 2**17 - 1, 1 - 2**17]


@case("core", "main_inter", flags=["ties"])
def shear_of_position_is_rounded_to_zero() -> Inputs:
    """|S| g_y >> 10 rounds the magnitude: S of -1 moves nothing where 1 moves nothing, and -512 as much as 512."""
    rows = state({"S": 1}, {"S": -1}, {"S": 3}, {"S": -3}, {"S": 511}, {"S": -511})
    expected = yield predicted(rows, [q(q0=1)] * 6)
    assert column(result(expected, "state"), "Y")[0] == [0, 0, 1, -1, 180, -180]


@case("core", "main_inter", flags=["transposed"])
def size_and_aspect_change() -> Inputs:
    """q2 changes A and B alike; q3 adds to A and takes from B."""
    rows = state({"A": 100, "B": 200}, {"A": 100, "B": 200}, {"A": 100, "B": 200, "n0": color_of_class(3)})
    expected = yield predicted(rows, [q(q2=1), q(q3=1), q(q2=2, q3=-1)])
    A, B = column(result(expected, "state"), "A", "B")
    assert (A, B) == ([1577, 1577, 100 + 184], [1677, 200 - 1477, 200 + 3 * 184])


@case("core", "main_inter", flags=["shear"])
def aspect_keeps_l21_over_l11() -> Inputs:
    """S is multiplied by 2^(v/1024), v being the change of A less that of B; a change of the size alone leaves it."""
    rows = state(*({"S": s, "A": 500, "B": 500, "n0": color_of_class(2)} for s in (600, -600, 600, -600, 600)))
    expected = yield predicted(rows, [q(q3=1), q(q3=1), q(q3=-1), q(q3=-1), q(q2=3)])
    S = column(result(expected, "state"), "S")[0]
    assert S == [988, -988, 364, -364, 600]


@case("core", "main_inter", flags=["ties", "shear"])
def sheared_towards_zero() -> Inputs:
    """The magnitude of S is rounded down, so that both signs shrink alike: 1 and -1 become 0."""
    rows = state(*({"S": s, "n0": color_of_class(10)} for s in (1, -1, 2, -2, 999, -999)))
    expected = yield predicted(rows, [q(q3=-1)] * 6)
    S = column(result(expected, "state"), "S")[0]
    assert S == [0, 0, 1, -1, 997, -997]


@case("core", "main_inter", flags=["shear"])
def shear_changes() -> Inputs:
    """q4 is added to S in steps of 2048 >> j, after what the aspect makes of it."""
    rows = state({"S": 100}, {"S": 100, "n0": color_of_class(4)}, {"S": 100, "n0": color_of_class(4)})
    expected = yield predicted(rows, [q(q4=-1), q(q4=3), q(q3=4, q4=3)])
    S = column(result(expected, "state"), "S")[0]
    assert [100 - 2048, 100 + 384, int(spec.sheared(ints([100]), ints([8 * 92]))[0]) + 384] == S


@case("core", "main_inter")
def colors_change() -> Inputs:
    """q5 to q7 times D is added to n."""
    rows = state({"n0": 1000, "n1": -77, "n2": 12})
    expected = yield predicted(rows, [q(q5=-2, q6=1, q7=5)])
    assert result(expected, "state")[0, 5:].tolist() == [1000 - 2 * D, D - 77, 12 + 5 * D]


@case("core", "main_inter", flags=["order"])
def class_of_the_reference() -> Inputs:
    """The class is that of n before it changes: a dark splat that becomes bright moves by steps of a dark one."""
    rows = state({"n0": 0}, {"n0": color_of_class(5)})
    expected = yield predicted(rows, [q(q0=1, q2=1, q5=40), q(q0=1, q2=1, q5=-24)])
    X, A = column(result(expected, "state"), "X", "A")
    assert ([362, 362 >> 5], [H[0], H[5]]) == (X, A)


@case("core", "main_inter", flags=["order"])
def steps_of_the_reference() -> Inputs:
    """Steps of position are those of A, B and S before they change."""
    rows = state({"A": 1024, "B": 1024, "S": 1024, "n0": color_of_class(1)})
    expected = yield predicted(rows, [q(q0=1, q1=1, q2=2, q3=1, q4=1)])
    assert result(expected, "state")[0, :2].tolist() == [362, 2 * 362]


@case("core", "main_inter", each=QUANTIZERS)
def differences_of_quantizer(value: int, rng: Draws) -> Inputs:
    """200 splats with motion and differences, with a quantizer of {key}."""
    rows = painted(rng, 200, step=spec.step_of(value))
    differences = np.rint(rng.normal(0, 1.5, (200, 8))).astype(np.int64)
    expected = yield predicted(rows, differences, rng.integers(-900, 900, (200, 2)), value)
    assert (result(expected, "state") != rows).any(axis=0).all()


@case("core", "main_inter", flags=["empty"])
def differences_of_nothing() -> Inputs:
    """No splats."""
    expected = yield predicted(state(), [])
    assert result(expected, "state").shape == (0, 8)


@case("uncommon", "main_inter", flags=["clamp"])
def every_range_is_clipped() -> Inputs:
    """A value beyond its range becomes the end of it, at both ends of all ranges."""
    most = {"X": 2**24 - 1, "Y": 2**24 - 1, "A": 13000, "B": 13000, "S": 32000, "n0": 2**28 - 1, "n1": 2**28 - 1,
            "n2": 2**28 - 1}  # fmt: skip
    least = {name: -value for name, value in most.items()} | {"A": -3000, "B": -3000}
    up, down = q(q2=4000, q4=4000, q5=1, q6=1, q7=1), q(q2=-4000, q4=-4000, q5=-1, q6=-1, q7=-1)
    expected = yield predicted(state(most, least), [up, down], [[2, 3], [-2, -3]])
    ends = [2**24, 2**24, 13311, 13311, 32767, 2**28, 2**28, 2**28]
    assert result(expected, "state").tolist() == [ends, [-(2**24), -(2**24), -3072, -3072, -32767, *[-(2**28)] * 3]]


@case("uncommon", "main_inter", flags=["clamp", "order"])
def shear_follows_the_clipped_sizes() -> Inputs:
    """V is what A and B have changed by after they were clipped: none if both stay at their ends."""
    rows = state({"A": 13311, "B": 13311, "S": 500}, {"A": 13311, "B": 0, "S": 500}, {"A": -3072, "B": 0, "S": -500},
                 {"A": 13311, "B": -3072, "S": 700})  # fmt: skip
    expected = yield predicted(rows, [q(q2=5), q(q3=1), q(q3=-1), q(q3=3)])
    S = column(result(expected, "state"), "S")[0]
    stays = spec.sheared(ints([500]), ints([1477])).tolist()[0]
    assert [500, stays, -int(spec.sheared(ints([500]), ints([-1477]))[0]), 700] == S


@case("stress", "main_inter", flags=["overflow", "shear"])
def sheared_by_all_octaves() -> Inputs:
    """V from -32766 to 32766: S becomes 0 or 32767, and no product or shift leaves 64 bits."""
    ends = [(-3072, 13311), (13311, -3072)]
    rows, differences = [], []
    for s in (32767, -32767, 1, -1, 0):
        for a, b in ends:
            sign = 1 if a < b else -1
            for aspect in (1, 2, 5, 9, 12, 4095):
                rows.append({"A": a, "B": b, "S": s})
                differences.append(q(q3=sign * aspect))
    expected = yield predicted(state(*rows), differences)
    S = column(result(expected, "state"), "S")[0]
    assert {0, 32767, -32767} <= set(S)
    assert len(set(S)) > 9


@case("stress", "main_inter", flags=["overflow", "clamp"], each={"finest": 0, "coarsest": 79})
def largest_differences(value: int) -> Inputs:
    """The {key} quantizer, differences of 4095 in all components, and splats at the ends of their ranges."""
    step = spec.step_of(value)
    rows = []
    for sign in (-1, 1):
        for a in (-3072, 0, 13311):
            for n in (0, spec.N_MOST, min(step * 37, spec.N_MOST)):
                rows.append({"X": sign * 2**24, "Y": sign * 2**23, "A": a, "B": -3072 if a else 13311,
                             "S": sign * 32767, "n0": sign * n, "n1": -n})  # fmt: skip
    count = len(rows)
    differences = np.resize([[4095] * 8, [-4095] * 8, [4095, -4095] * 4], (count, 8))
    motion = np.resize([[2**21, -(2**21)], [-(2**21), 2**21]], (count, 2))
    expected = yield predicted(state(*rows), differences, motion, value)
    assert (abs(result(expected, "state")[:, :2]) <= 2**24).all()


# --- Parameters ------------------------------------------------------------------------------------------------------


def nearest(p: int, exponent: int) -> float:
    """P 2^exponent as binary32: NumPy converts integers to the nearest one, ties to even."""
    return float(np.ldexp(np.float32(p), exponent))


@case("core", "state_parameters")
def parameters_of_a_grey_splat() -> Inputs:
    """X / 256, factors of 2^(A/1024), and a colour whose three channels are n0 k0 / √(l11 l22)."""
    expected = yield {"state": state({"X": 896, "Y": -128, "A": 1024, "B": 3072, "S": 512, "n0": 4000})}
    x, y, l11, l21, l22, r, g, b = result(expected, "parameters")[0].tolist()
    assert (x, y, l11, l21, l22) == (3.5, -0.5, 2, 4, 8)
    assert r == g == b == nearest(4000 * 42862, -31)


@case("core", "state_parameters", flags=["channel-order"])
def axes_of_colors() -> Inputs:
    """n1 is red against blue, n2 green against both: each axis alone, of either sign; what is 0 is +0."""
    rows = state(*({name: value} for name in ("n0", "n1", "n2") for value in (16000, -16000)))
    expected = yield {"state": rows}
    r, g, b = result(expected, "parameters")[:, 5:].T
    assert (r[:2] == g[:2]).all()
    assert (r[2:4] == -b[2:4]).all()
    assert (g[2:4].view(np.uint32) == 0).all()
    assert (g[4:] == -2 * r[4:]).all()


@case("core", "state_parameters")
def sizes_of_an_octave(rng: Draws) -> Inputs:
    """2^(A/1024) for numbers all over an octave and in all octaves: binary32 numbers of 16 bits, exactly."""
    A = np.concatenate([np.arange(-3072, 13312, 131), [13311]])
    B = rng.permutation(len(A))
    rows = np.zeros((len(A), 8), np.int64)
    rows[:, 2], rows[:, 3], rows[:, 4], rows[:, 5] = A, A[B], rng.integers(-2000, 2000, (len(A),)), 4096
    expected = yield {"state": rows}
    bits = result(expected, "parameters")[:, 2].view(np.uint32)
    assert (bits & 0xFF == 0).all()


@case("core", "state_parameters", flags=["ties"])
def odd_sums_of_sizes() -> Inputs:
    """-(A + B) >> 1 rounds down: of A + B = 1 it is -1, of A + B = -1 it is 0."""
    rows = state({"A": 1, "n0": 4096}, {"A": -1, "n0": 4096}, {"A": 2, "n0": 4096}, {"B": 1025, "A": -1024, "n0": 4096})
    expected = yield {"state": rows}
    red = result(expected, "parameters")[:, 5]
    whole, one_down = nearest(4096 * 42862, -29), nearest(4096 * 42862 * int(spec.EXP2[1023]) >> 15, -30)
    assert red.tolist() == [one_down, whole, one_down, one_down]


@case("core", "state_parameters", flags=["ties"])
def ties_of_parameters() -> Inputs:
    """L21 and colours half way between two binary32 numbers, of either sign: the even one."""
    odd = np.arange(16385, 32768, 2)
    B = np.arange(1024)
    ties: list[list[dict[str, int]]] = [[], []]
    for S in odd[::97].tolist():
        p = S * spec.EXP2
        e = spec.bits(p) - 24
        for parity in (0, 1):
            found = B[((p & (1 << e) - 1) == 1 << e >> 1) & ((p >> e & 1) == parity)][:2]
            ties[parity] += [{"B": b, "S": sign * S} for b in found.tolist() for sign in (1, -1)]
    n = np.arange(8193, 16384)
    p = n * 42862
    e = spec.bits(p) - 24
    half = (p & (1 << e) - 1) == 1 << e >> 1
    grey = [n[half & ((p >> e & 1) == parity)][:8].tolist() for parity in (0, 1)]
    assert min(map(len, [*ties, *grey])) >= 8
    rows = state(*ties[0][:40], *ties[1][:40], *({"n0": sign * v} for v in grey[0] + grey[1] for sign in (1, -1)))
    expected = yield {"state": rows}
    magnitude = abs(result(expected, "parameters")).view(np.uint32)
    assert (magnitude[:, [3, 5]] & 1 == 0).all()


@case("core", "state_parameters", flags=["order"])
def colors_of_all_magnitudes(rng: Draws) -> Inputs:
    """The largest of n0, n1 and n2, each in turn, has 1 to 29 bits, so that s is 0 to 15."""
    rows = np.repeat(painted(rng, 29 * 6), 1, axis=0)
    most = 1 << np.repeat(np.arange(29), 6)
    share = rng.integers(-(2**10), 2**10, (len(rows), 3)) / 2**12
    share[np.arange(len(rows)), np.arange(len(rows)) % 3] = np.where(np.arange(len(rows)) % 2, -1, 1)
    rows[:, 5:] = share * most[:, None]
    expected = yield {"state": rows}
    s = np.maximum(spec.bits(abs(rows[:, 5:]).max(axis=1)) - 14, 0)
    assert set(s.tolist()) == {*range(16)}
    assert np.isfinite(result(expected, "parameters")).all()


@case("core", "state_parameters", flags=["ties"])
def products_of_colors_round_down() -> Inputs:
    """(n_i k_i) >> s of negative n_i rounds down, with s from n1, which green has not; T is cut off towards 0."""
    rows = state(*({"n0": -value, "n1": 2**20, "n2": -value} for value in (1, 3, 63, 64, 65)),
                 *({"A": 700, "B": 77, "n0": -value} for value in (1, 5, 77)))  # fmt: skip
    expected = yield {"state": rows}
    assert result(expected, "parameters")[1, 6] == nearest((-3 * 42862 >> 7) - 2 * (-3 * 30308 >> 7), 7 - 29)


@case("core", "state_parameters")
def parameters_of_a_frame(rng: Draws) -> Inputs:
    """300 splats of a frame of 352x288."""
    expected = yield {"state": painted(rng, 300)}
    assert np.isfinite(result(expected, "parameters")).all()


@case("core", "state_parameters", flags=["empty"])
def parameters_of_nothing() -> Inputs:
    """No splats."""
    expected = yield {"state": state()}
    assert result(expected, "parameters").shape == (0, 8)


@case("uncommon", "state_parameters", flags=["limit"])
def shifts_of_colors_at_their_bounds() -> Inputs:
    """The largest |n| is 2^(14 + s) or one less, of either sign, for all s."""
    ends = [sign * (2 ** (13 + s) - less) for s in range(16) for less in (0, 1) for sign in (1, -1)]
    rows = state(*({"n0": n, "n1": -n // 3, "n2": n // 5} for n in ends), *({"n2": n, "n0": 1} for n in ends))
    expected = yield {"state": rows}
    assert np.isfinite(result(expected, "parameters")).all()


@case("stress", "state_parameters", flags=["overflow"])
def parameters_at_the_ends() -> Inputs:
    """The ends of all ranges together: all parameters are finite, and no splat is degenerate."""
    most = {"X": 2**24, "Y": -(2**24), "A": 13311, "B": 13311, "S": 32767, "n0": 2**28, "n1": 2**28, "n2": 2**28}
    least = {"X": -(2**24), "A": -3072, "B": -3072, "S": -32767, "n0": 2**28, "n1": -(2**28), "n2": -(2**28)}
    rows = state(most, least, {**most, "A": -3072}, {**least, "A": 13311}, {**least, "n0": -(2**28)})
    expected = yield {"state": rows}
    found = result(expected, "parameters")
    assert np.isfinite(found).all()
    assert (found[:, [2, 4]] > 2.0**-4).all()


@case("stress", "state_parameters", flags=["overflow"])
def largest_sums_of_colors() -> Inputs:
    """All of |n| are 2^14 - 1 or 2^28 - 1: T is just below 2^31, and p just below 2^32."""
    signs = [(1, 1, 1), (-1, -1, -1), (1, -1, 1), (-1, 1, -1), (1, 0, -1), (-1, 0, 1)]
    rows = state(*({"A": A, "B": B, "n0": n * a, "n1": n * b, "n2": n * c} for n in (2**14 - 1, 2**28 - 1)
                   for A, B in ((-1, 0), (1, 0), (13311, 13311), (-3072, -3071)) for a, b, c in signs))  # fmt: skip
    assert 2**31 - 2**28 < (2**14 - 1) * sum(spec.MAIN_K) < 2**31
    expected = yield {"state": rows}
    assert np.isfinite(result(expected, "parameters")).all()
