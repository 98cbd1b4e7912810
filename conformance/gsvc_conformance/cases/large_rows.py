"""Vectors of 70,001 rows: what kernels, grids and counters of up to 65,536 leave out.

Rows come again with a period of 251, a prime, so that no block, warp or index of a power of two repeats what another
one has, and files stay small (`gsvc_conformance.runs`). Single rows at the borders of blocks are unlike all others.
"""

from typing import Any, Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.adan import adan_inputs
from gsvc_conformance.cases.building import Array, halves, result
from gsvc_conformance.cases.quantization import random_values
from gsvc_conformance.cases.reconstruction import codes
from gsvc_conformance.cases.selection import state_of
from gsvc_conformance.cases.training import f4, trained_rows

ROWS: Final = 70_001
PERIOD: Final = 251
EDGES: Final = np.array([1023, 1024, 4095, 4096, 32_767, 32_768, 65_535, 65_536, ROWS - 1])
"""Rows on both sides of the borders of blocks and of 16-bit numbers, and the last one, all beyond the first period."""
FLAGS: Final = (CAPACITY,)


def repeated(rows: Array, count: int = ROWS) -> Array:
    """Rows again and again, `count` in all."""
    return np.resize(rows, (count, *rows.shape[1:]))


# --- Reconstruction --------------------------------------------------------------------------------------------------


@case("stress", "from_half", flags=FLAGS)
def many_values(rng: Draws) -> Inputs:
    """70,001 patterns, more than a 16-bit number counts; at the borders of blocks infinity."""
    bits = repeated(rng.integers(1, 0x7C00, PERIOD).astype(np.uint16))
    bits[EDGES] = 0xFC00
    expected = yield {"bits": bits}
    assert np.all(result(expected, "values")[EDGES] == -np.inf)


@case("stress", "to_half", flags=FLAGS)
def many_patterns(rng: Draws) -> Inputs:
    """70,001 numbers, none of them zero; at the borders of blocks the largest that is finite."""
    values = repeated(rng.normal(0, 10, PERIOD).astype(np.float32))
    values[EDGES] = -65_504
    expected = yield {"values": values}
    assert np.all(result(expected, "bits")[EDGES] == 0xFBFF)


BOOKS: Final = (1024,) * 8
"""As many codewords as a block can have."""


def many_codes(rng: Draws, count: int, period: int = PERIOD) -> dict[str, Any]:
    """Codes of `count` splats with eight codebooks of 1,024; the rows at the borders use the last codeword of each."""
    block = codes(period, rng, BOOKS, bits=8)
    for name in ("positions", "cholesky", "color_indices"):
        block[name] = repeated(block[name], count)
    edges = EDGES[count > EDGES]
    block["positions"][edges] = halves([0.75, -0.25])
    block["cholesky"][edges] = 255
    block["color_indices"][edges] = 1023
    return block


SURVIVORS: Final = 239
"""Number of survivors of 251 splats: a prime as well."""


def survivors_of_many() -> Array:
    """Which of 73,501 splats survive, (N,) bool."""
    return repeated(np.arange(PERIOD) ** 3 % PERIOD < SURVIVORS, 73_501)


@case("stress", "reconstruct_intra", flags=FLAGS)
def many_splats_and_codewords(rng: Draws) -> Inputs:
    """70,001 splats, whose colours are sums of eight codewords of 8,192."""
    expected = yield {"width": 1921, "height": 1083, **many_codes(rng, ROWS)}
    assert result(expected, "parameters").any(axis=1).all()


@case("stress", "reconstruct_inter", flags=[*FLAGS, "survivors"])
def many_survivors(rng: Draws) -> Inputs:
    """Some 70,000 of 73,501 splats survive: what is added to each, and which it is, depends on all before it."""
    stay = survivors_of_many()
    reference = repeated(rng.normal(3, 1, (PERIOD, 8)).astype(np.float32), len(stay))
    expected = yield {"width": 1921, "height": 1083, "reference": reference, "survivors": stay.astype(np.uint8),
                      **many_codes(rng, int(np.count_nonzero(stay)), SURVIVORS)}  # fmt: skip
    assert len(result(expected, "parameters")) > 2**16


@case("stress", "parameter_checksum", flags=FLAGS)
def checksum_of_many(rng: Draws) -> Inputs:
    """66,001 splats: the checksum depends on the last bit of the last of them."""
    parameters = repeated(rng.normal(size=(PERIOD, 8)).astype(np.float32), 66_001)
    expected = yield {"parameters": parameters}
    assert result(expected, "checksum") > 0


@case("stress", "rendering_work", flags=[*FLAGS, "overflow"])
def work_of_many(rng: Draws) -> Inputs:
    """70,001 splats on a frame of 65,535 by 1,025 pixels: more than 2^33 pairs."""
    rows = np.column_stack([rng.uniform(0, 65_535, PERIOD), rng.uniform(0, 1025, PERIOD),
                            *rng.uniform(100, 900, (3, PERIOD)), np.ones((PERIOD, 3))])  # fmt: skip
    parameters = repeated(rows.astype(np.float32))
    parameters[EDGES, 2:5] = 1, 0, 1
    expected = yield {"parameters": parameters, "width": 65_535, "height": 1025}
    assert result(expected, "work") > 2**33


@case("stress", "scale_parameters", flags=FLAGS)
def many_scaled(rng: Draws) -> Inputs:
    """70,001 splats from 1920x1080 to 1281x719; those at the borders of blocks are a thousand times larger."""
    parameters = repeated(rng.uniform(1, 2, (PERIOD, 8)).astype(np.float32))
    parameters[EDGES] *= 1000
    expected = yield {"parameters": parameters, "width": 1920, "height": 1080, "new_width": 1281, "new_height": 719}
    assert result(expected, "parameters").all()


@case("stress", "scale_parameters_filtered", flags=FLAGS)
def many_filtered(rng: Draws) -> Inputs:
    """70,001 splats from 1920x1080 to 1281x719; those at the borders of blocks are a thousand times larger."""
    parameters = repeated(rng.uniform(1, 2, (PERIOD, 8)).astype(np.float32))
    parameters[EDGES] *= 1000
    expected = yield {"parameters": parameters, "width": 1920, "height": 1080, "new_width": 1281, "new_height": 719}
    assert result(expected, "parameters").all()


# --- Training --------------------------------------------------------------------------------------------------------


def many_rows(rng: Draws, count: int = ROWS) -> Array:
    """Rows in training (count, 9) f4, none with a zero; those at the borders of blocks have larger colours."""
    rows = repeated(trained_rows(rng, PERIOD), count)
    rows[EDGES[count > EDGES], 5:8] = 8, -16, 32
    return rows


@case("stress", "weighted_parameters", flags=FLAGS)
def many_weights(rng: Draws) -> Inputs:
    """70,001 splats with weights."""
    expected = yield {"values": many_rows(rng)}
    assert expected["parameters"].value.any(axis=1).all()


@case("stress", "weighted_gradients", flags=FLAGS)
def many_gradients_of_weights(rng: Draws) -> Inputs:
    """The gradients of 70,001 splats with weights."""
    gradients = repeated(rng.normal(size=(PERIOD, 8)).astype(np.float32))
    gradients[EDGES] = 64
    expected = yield {"values": many_rows(rng), "gradients": gradients}
    assert expected["gradients"].value.any(axis=1).all()


@case("stress", "learning_rates", flags=[*FLAGS, "schedule"])
def many_rates(rng: Draws) -> Inputs:
    """The rates of 70,001 iterations in any order; at the borders of blocks the first one, whose rate is largest."""
    iterations = repeated(rng.integers(1, 200_000, PERIOD))
    iterations[EDGES] = 0
    expected = yield {"iterations": iterations, "rate": 1e-3, "factor": 0.5, "interval": 20_000}
    assert np.all(expected["rates"].value[EDGES] == 1e-3)


@case("stress", "adan_step", flags=[*FLAGS, "mixed-ages"])
def many_steps(rng: Draws) -> Inputs:
    """A step of 70,001 splats of mixed ages; the rows at the borders of blocks take their first."""
    inputs = adan_inputs(rng, rng.integers(0, 3000, PERIOD), columns=9)
    first = adan_inputs(rng, [0], columns=9)
    for name in ("parameters", "gradients", "m", "v", "n", "previous", "steps"):
        inputs[name] = repeated(inputs[name])
        inputs[name][EDGES] = first[name]
    expected = yield inputs
    assert np.all(expected["steps"].value[EDGES] == 1)


@case("stress", "pruning_plan", flags=[*FLAGS, "schedule"])
def plan_of_many_removals() -> Inputs:
    """A removal after each of the first 70,001 iterations: three splats each, and 40 at last."""
    expected = yield {"splats": 420_080, "iterations": 100_000, "fraction": 0.5, "first": 1, "last": ROWS,
                      "interval": 1}  # fmt: skip
    counts = expected["counts"].value
    assert counts[:-1].tolist() == [3] * (ROWS - 1)
    assert counts[-1] == 40


@case("stress", "pruning_plan", flags=["schedule", "ties"], each={str(n): n for n in (14, 28, 56, 90, 112, 180)})
def plan_that_binary32_shifts(value: int) -> Inputs:
    """Of {key} iterations: products that are whole in binary64 and less in binary32, or the other way round."""
    expected = yield {"splats": 1000, "iterations": value, "fraction": 0.1, "first": 100, "last": 4000, "interval": 100}
    scale = np.float32(0.8) * np.float32(value) / np.float32(4000)
    narrow = np.floor(np.arange(100, 4001, 100, dtype=np.float32) * scale)
    assert _counted(narrow) != _counts(expected)


@case("stress", "pruning_plan", flags=["schedule", "ties"], each={str(n): n for n in (145, 175, 285)})
def plan_in_the_order_written(value: int) -> Inputs:
    """Of {key} iterations: with 0.8 (iterations / last) in place of (0.8 iterations) / last, products miss a whole."""
    expected = yield {"splats": 1000, "iterations": value, "fraction": 0.1, "first": 100, "last": 4000, "interval": 100}
    other = np.floor(np.arange(100, 4001, 100) * (0.8 * (value / 4000)))
    assert _counted(other) != _counts(expected)


def _counted(iterations: Array) -> list[tuple[int, int]]:
    """Iterations and their removals of 2 and, at last, 22 splats: a plan of 100 in 40 removals."""
    plan: dict[int, int] = {}
    for place, iteration in enumerate(np.maximum(iterations, 1).astype(int).tolist(), 1):
        plan[iteration] = plan.get(iteration, 0) + (22 if place == len(iterations) else 2)
    return list(plan.items())


def _counts(expected: Any) -> list[tuple[int, int]]:
    return list(zip(expected["iterations"].value.tolist(), expected["counts"].value.tolist(), strict=True))


@case("stress", "prune", flags=[*FLAGS, "ties"])
def many_splats_to_prune(rng: Draws) -> Inputs:
    """70,001 weights of which each comes again in other warps and blocks; of 2,789 equal ones the last 1,500 go."""
    weights = repeated((rng.permutation(PERIOD) // 10 + 3).astype(np.float32) * f4(1 / 64))
    weights[EDGES] = -8
    magnitude = abs(weights)
    threshold = np.unique(magnitude)[12]
    removed = np.count_nonzero(magnitude < threshold) + 1500
    expected = yield {"weights": weights, "removed": int(removed)}
    equal, survivors = np.flatnonzero(magnitude == threshold), expected["survivors"].value
    assert np.array_equal(equal[np.isin(equal, survivors)], equal[: len(equal) - 1500])
    assert np.isin(EDGES, survivors).all()


@case("stress", "prune", flags=[*FLAGS, "ties"])
def equal_weights_of_many() -> Inputs:
    """2,113 equal weights: the last 1,057 go, whatever warp or block they lie in."""
    expected = yield {"weights": np.full(2113, 0.25, np.float32), "removed": 1057}
    assert expected["survivors"].value.tolist() == list(range(1056))


@case("stress", "prune", flags=FLAGS)
def few_of_many_to_prune() -> Inputs:
    """Of 70,001 splats the 2,000 smallest go: those from 68,000 on, but for the last."""
    weights = repeated(np.arange(1.0, PERIOD + 1).astype(np.float32))
    weights[68_000:-1] = -(2.0**-10)
    expected = yield {"weights": weights, "removed": 2000}
    assert expected["survivors"].value.tolist() == [*range(68_000), ROWS - 1]


@case("stress", "compact", flags=[*FLAGS, "survivors"])
def many_survivors_keep_their_state(rng: Draws) -> Inputs:
    """Some 70,000 of 73,501 splats stay, each with its own state."""
    stay = survivors_of_many()
    state = {name: repeated(rows, len(stay)) for name, rows in state_of(rng, PERIOD).items()}
    expected = yield {"survivors": np.flatnonzero(stay), **state}
    assert len(expected["steps"].value) > 2**16


@case("stress", "augment", flags=FLAGS)
def many_new_splats(rng: Draws) -> Inputs:
    """70,001 splats, and 66,003 new ones after them."""
    uniforms = repeated(rng.uniform(0.1, 1, (PERIOD, 8)).astype(np.float32), 66_003)
    expected = yield {"values": many_rows(rng), "uniforms": uniforms, "width": 1921, "height": 1083}
    assert len(expected["values"].value) == ROWS + 66_003


@case("stress", "select_key_frames", flags=[*FLAGS, "window"])
def many_key_frames() -> Inputs:
    """70,001 frames whose losses fall, but for one frame of 251: all the others are key frames of the robust rule."""
    losses = repeated(np.arange(PERIOD, 0, -1.0))
    expected = yield {"losses_i": np.ones(ROWS), "losses_p": losses[1:] + 4, "window": 1, "threshold": 0.5,
                      "guard_ratio": 2.0, "robust": 1}  # fmt: skip
    assert len(expected["key_frames"].value) > 2**16


@case("stress", "select_key_frames", flags=[*FLAGS, "window"])
def cuts_of_a_long_sequence() -> Inputs:
    """A sequence of 1,249 frames with cuts at the borders of blocks, by the rule of the paper."""
    losses = np.resize([1.0, 2.0, 1.5, 1.25, 2.5, 1.75, 2.25], 1249)
    cuts = [32, 64, 128, 256, 512, 1024, 1238]
    losses[cuts] = 1e6
    expected = yield {"losses_i": np.ones(1249), "losses_p": losses[1:], "window": 10, "threshold": 3.0,
                      "guard_ratio": 1.0, "robust": 0}  # fmt: skip
    assert expected["key_frames"].value.tolist() == [0, *cuts]


@case("stress", "converged", flags=FLAGS)
def convergence_after_many_iterations() -> Inputs:
    """Losses that go up and down until iteration 69,000, and stay then."""
    losses = np.resize([1.0, 2.0], ROWS)
    losses[68_999:] = 1.5
    expected = yield {"losses": losses, "patience": 100, "tolerance": 1e-7}
    assert expected["iteration"].value == 69_100


@case("stress", "converged", flags=FLAGS)
def patience_of_many_iterations() -> Inputs:
    """A patience of 66,000 iterations, which starts again after the 3,000th."""
    losses = np.ones(ROWS)
    losses[:3000] = 2
    expected = yield {"losses": losses, "patience": 66_000, "tolerance": 0.0}
    assert expected["iteration"].value == 69_001


# --- LSQ+ ------------------------------------------------------------------------------------------------------------


@case("stress", "lsq_quantize", flags=FLAGS)
def many_to_quantize(rng: Draws) -> Inputs:
    """70,001 values of each of three channels; those at the borders of blocks have the largest code."""
    inputs = random_values(rng, PERIOD, 8)
    inputs["x"] = repeated(inputs["x"])
    inputs["x"][EDGES] = 1e4
    expected = yield inputs
    assert np.all(expected["codes"].value[EDGES] == 255)


@case("stress", "lsq_dequantize", flags=FLAGS)
def many_to_dequantize(rng: Draws) -> Inputs:
    """70,001 codes of each of three channels; those at the borders of blocks are the largest."""
    codes_of = repeated(rng.integers(0, 255, (PERIOD, 3)).astype(np.uint16))
    codes_of[EDGES] = 65_535
    expected = yield {"codes": codes_of, "scale": f4(0.11, 0.73, 1.9), "offset": f4(0.31, -7.7, -21)}
    assert np.all(expected["values"].value[EDGES] > 7000)


@case("stress", "lsq_gradients", flags=[*FLAGS, "region"])
def gradients_of_many(rng: Draws) -> Inputs:
    """70,001 values of each of three channels; 15 of them have most of the gradients."""
    inputs = random_values(rng, PERIOD, 8)
    inputs["x"] = repeated(inputs["x"])
    inputs["x"][EDGES] = 1e4
    grad = repeated(rng.normal(size=(PERIOD, 3)).astype(np.float32))
    grad[EDGES] = 2048
    expected = yield {**inputs, "grad_output": grad}
    largest = expected["grad_offset"].value
    assert np.all(abs(largest) > 1000 * len(EDGES))
