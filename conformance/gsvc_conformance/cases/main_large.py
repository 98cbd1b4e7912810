"""Vectors of profile `main` of 70,001 rows: what kernels, grids and counters of up to 65,536 leave out.

Rows come again with a period of 251, as in `large_rows`.
"""

from typing import Any, Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.building import Array, result
from gsvc_conformance.cases.lanes import random_symbols, run_of
from gsvc_conformance.cases.large_rows import EDGES, FLAGS, PERIOD, repeated
from gsvc_conformance.cases.main_states import place_bits, predicted, random_codes
from gsvc_conformance.cases.states import Q, painted

CELLS: Final = 4096
"""Most rows or columns of a motion field."""
SOME: Final = np.append(np.arange(0, CELLS, 7), CELLS - 1)
"""Cells that have a splat."""


def many_states(rng: Draws) -> Array:
    """States of 70,001 splats, none of them zero; those at the borders of blocks are unlike all others."""
    rows = painted(rng, PERIOD)
    rows[rows == 0] = 1
    rows = repeated(rows)
    rows[EDGES] = 77777, -5555, 999, -999, 333, 30000, -20000, 10000
    return rows


@case("stress", "splat_classes", flags=FLAGS)
def classes_of_many(rng: Draws) -> Inputs:
    """70,001 splats."""
    rows = many_states(rng)
    rows[:, 5] += 300
    expected = yield {"state": rows, "quantizer": Q}
    assert result(expected, "classes")[EDGES].all()


@case("stress", "main_intra", flags=FLAGS)
def intra_codes_of_many(rng: Draws) -> Inputs:
    """70,001 splats; those at the borders of blocks are brighter than all others."""
    inputs: dict[str, Any] = {name: value if name == "quantizer" else repeated(value)
              for name, value in random_codes(rng, Q, PERIOD).items()}  # fmt: skip
    inputs["colors"][EDGES] = 900, -800, 700
    inputs["shapes"][EDGES] = 1000, -500, 300
    inputs["places"] = np.minimum(inputs["places"], (1 << place_bits(Q, inputs["colors"], inputs["shapes"])) - 1)
    expected = yield inputs
    assert (result(expected, "state")[EDGES, 5] == 900 * 64).all()


@case("stress", "main_inter", flags=FLAGS)
def differences_of_many(rng: Draws) -> Inputs:
    """70,001 splats, all of which change."""
    differences, motion = (repeated(rng.integers(1, 9, (PERIOD, columns))) for columns in (8, 2))
    rows = many_states(rng)
    expected = yield predicted(rows, differences, motion)
    assert (result(expected, "state") != rows).any(axis=1).all()


@case("stress", "motion_of_splats", flags=FLAGS)
def motion_of_many(rng: Draws) -> Inputs:
    """70,001 splats, all of which move."""
    expected = yield {"state": many_states(rng), "vectors": rng.integers(3, 60, (5, 6, 2)), "motion_cell": 1}
    assert result(expected, "motion").all()


@case("stress", "motion_of_splats", flags=FLAGS, each={"rows": (CELLS, 1), "columns": (1, CELLS)})
def longest_fields(value: tuple[int, int], rng: Draws) -> Inputs:
    """A field of 4,096 {key}, and a splat in every seventh cell, in the first one and in the last one."""
    vectors = repeated(rng.integers(3, 60, (PERIOD, 2)), CELLS).reshape(*value, 2)
    rows = np.zeros((len(SOME), 8), np.int64)
    rows[:, 0 if value[0] == 1 else 1] = 4096 * SOME + 2048
    expected = yield {"state": rows, "vectors": vectors, "motion_cell": 3}
    assert result(expected, "motion").all()


@case("stress", "main_work", flags=FLAGS)
def work_of_many(rng: Draws) -> Inputs:
    """70,001 splats in a frame of 400x300 pixels; those at the borders of blocks are larger than all others."""
    rows = many_states(rng)
    rows[:, 2:5] %= 1024
    rows[EDGES, 2:4] = 4096
    expected = yield {"state": rows, "width": 400, "height": 300, "halvings": 0}
    assert result(expected, "work") > len(rows)


@case("stress", "state_parameters", flags=FLAGS)
def parameters_of_many(rng: Draws) -> Inputs:
    """70,001 splats."""
    expected = yield {"state": many_states(rng)}
    assert result(expected, "parameters")[EDGES].all()


@case("stress", "mode_contexts", flags=FLAGS)
def contexts_of_many(rng: Draws) -> Inputs:
    """70,001 splats; none of them has the context 0."""
    rows = many_states(rng)
    past = repeated(rng.integers(1, 3, (PERIOD,)))
    motion = repeated(rng.integers(-30, 30, (PERIOD, 2)))
    vectors = rng.integers(-9, 9, (18, 22, 2))
    expected = yield {"width": 352, "height": 288, "state": rows, "past": past, "motion": motion, "vectors": vectors,
                      "motion_cell": 3}  # fmt: skip
    assert result(expected, "contexts").all()


@case("stress", "mode_contexts", flags=FLAGS, each={"rows": (CELLS, 1), "columns": (1, CELLS)})
def contexts_of_the_longest_fields(value: tuple[int, int], rng: Draws) -> Inputs:
    """A field of 4,096 {key}, and a splat in every seventh cell, in the first one and in the last one."""
    height, width = (min(16 * side, 65_535) for side in value)
    vectors = repeated(rng.integers(-9, 9, (PERIOD, 2)), CELLS).reshape(*value, 2)
    rows = np.zeros((len(SOME), 8), np.int64)
    rows[:, 0 if value[0] == 1 else 1] = 4096 * SOME + 2048
    nothing = np.zeros((len(SOME), 2), np.int64)
    expected = yield {"width": width, "height": height, "state": rows, "past": np.zeros(len(SOME), np.int64),
                      "motion": nothing, "vectors": vectors, "motion_cell": 3}  # fmt: skip
    assert {1, 2} <= set(result(expected, "contexts").tolist())


@case("stress", "field_vectors", flags=FLAGS, each={"rows": (CELLS, 1), "columns": (1, CELLS)})
def sums_of_the_longest_fields(value: tuple[int, int], rng: Draws) -> Inputs:
    """A field of 4,096 {key}."""
    expected = yield {"differences": repeated(rng.integers(-3, 60, (PERIOD, 2)), CELLS).reshape(*value, 2)}
    assert len(np.unique(result(expected, "vectors"))) > CELLS


@case("stress", "codes_of_classes", flags=FLAGS)
def codes_of_many(rng: Draws) -> Inputs:
    """70,001 codes, none of which is 0."""
    columns = [repeated(rng.integers(first, end, (PERIOD,))) for first, end in ((4, 40), (0, 2), (0, 2))]
    expected = yield dict(zip(("classes", "low", "negative"), columns, strict=True))
    assert result(expected, "codes").all()


@case("stress", "cells_of_halves", flags=FLAGS)
def cells_of_many() -> Inputs:
    """70,001 splats of 2x2 cells."""
    numbers = np.array([40_000, 30_000, 20_000])
    expected = yield {"width": 8, "height": 8, "count": 70_001, "first_halves": numbers}
    assert result(expected, "cells")[[29_999, 30_000, 40_000, 70_000]].tolist() == [[0, 0], [0, 1], [1, 0], [1, 1]]


@case("stress", "cells_of_halves", flags=FLAGS)
def cells_of_many_parts() -> Inputs:
    """A splat in each of 4,096 cells in a row: each part has half of its splats in its first half, or all of them."""
    many = 1 << np.arange(CELLS.bit_length() - 1)  # parts of each halving in x
    numbers = [number for n in many for number in ([CELLS // n // 2] * n + [CELLS // n // 2] * (2 * n))]
    expected = yield {"width": 4 * CELLS, "height": 4, "count": CELLS, "first_halves": np.array(numbers)}
    assert np.array_equal(result(expected, "cells")[:, 0], np.arange(CELLS))


@case("stress", "encode_run", flags=FLAGS)
def run_of_many(rng: Draws) -> Inputs:
    """90,001 symbols of 14 bits each, by 64 lanes in two groups: some 78,000 words."""
    symbols = np.stack([repeated(rng.integers(0, 2**14, (PERIOD,)), 90_001), np.ones(90_001, np.int64)], axis=1)
    symbols[EDGES] = random_symbols(rng, len(EDGES)) // [2**14, 1] + [7, 0]
    symbols[EDGES, 1] = 1
    expected = yield run_of(symbols, 64)
    assert len(result(expected, "words")) > 2**16
