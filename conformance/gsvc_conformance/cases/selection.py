"""Cases of pruning, compaction and augmentation: which splats go and come, and when."""

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.training import f4, trained_rows
from gsvc_conformance.operation import Values

# --- Pruning ---------------------------------------------------------------------------------------------------------


INTRA = {"fraction": 0.1, "first": 100, "last": 4000, "interval": 100}
INTER = {"fraction": 0.1, "first": 500, "last": 1000, "interval": 100}


@case("core", "pruning_plan", flags=["schedule"])
def plan_of_an_intra_frame() -> Inputs:
    """The plan of I-frames at full length: forty removals of 25 splats, and 28 at last."""
    expected = yield {"splats": 10_030, "iterations": 50_000, **INTRA}
    assert expected["iterations"].value.tolist() == list(range(100, 4001, 100))
    assert expected["counts"].value.tolist() == [25] * 39 + [28]


@case("core", "pruning_plan", flags=["schedule"])
def plan_of_a_predicted_frame() -> Inputs:
    """The plan of P-frames: the remainder of 100 over six removals comes with the last."""
    expected = yield {"splats": 1000, "iterations": 20_000, **INTER}
    assert expected["iterations"].value.tolist() == [500, 600, 700, 800, 900, 1000]
    assert expected["counts"].value.tolist() == [16, 16, 16, 16, 16, 20]


@case("core", "pruning_plan", flags=["schedule"])
def plan_of_a_short_training() -> Inputs:
    """Half of the iterations that the plan needs: all removals move forward, and a fifth of them is left to settle."""
    expected = yield {"splats": 600, "iterations": 625, **INTER}
    assert expected["iterations"].value.tolist() == [250, 300, 350, 400, 450, 500]
    assert expected["counts"].value.tolist() == [10] * 6


@case("core", "pruning_plan", flags=["schedule"])
def plan_of_few_iterations() -> Inputs:
    """Six removals within eight iterations: those that fall on one iteration are added up, none comes before the first.

    Times 500 to 1000 times 0.0064 are 3.2, 3.84, 4.48, 5.12, 5.76 and 6.4.
    """
    expected = yield {"splats": 640, "iterations": 8, **INTER}
    assert expected["iterations"].value.tolist() == [3, 4, 5, 6]
    assert expected["counts"].value.tolist() == [20, 10, 20, 14]


@case("core", "pruning_plan", flags=["schedule"])
def plan_of_one_iteration() -> Inputs:
    """A single iteration: every removal comes after it."""
    expected = yield {"splats": 800, "iterations": 1, **INTRA}
    assert expected["iterations"].value.tolist() == [1]
    assert expected["counts"].value.tolist() == [80]


@case("core", "pruning_plan", flags=["schedule"], each={"just_enough": 1250, "one_too_few": 1249})
def plan_at_full_length(value: int) -> Inputs:
    """The number of iterations from which on a plan is not moved any more: {key}."""
    expected = yield {"splats": 1000, "iterations": value, **INTER}
    assert expected["iterations"].value[-1] == (1000 if value == 1250 else 999)


@case("core", "pruning_plan", flags=["schedule", "empty"])
def plan_of_few_splats() -> Inputs:
    """Fewer splats to remove than removals: only the last has any, and those without are left out."""
    expected = yield {"splats": 50, "iterations": 50_000, **INTRA}
    assert expected["iterations"].value.tolist() == [4000]
    assert expected["counts"].value.tolist() == [5]


@case("core", "pruning_plan", flags=["ties"], each={"down": 5, "up": 7},
      said={"down": "2.5 splats, which is rounded down to 2",
            "up": "3.5 splats, which is rounded up to 4"})  # fmt: skip
def plan_of_half_a_splat(value: int) -> Inputs:
    """A total of {key}, the even number."""
    expected = yield {"splats": value, "iterations": 100, "fraction": 0.5, "first": 10, "last": 10, "interval": 1}
    assert expected["counts"].value.tolist() == [2 if value == 5 else 4]


@case("core", "pruning_plan", flags=["schedule"])
def plan_that_ends_off_its_grid() -> Inputs:
    """The last removal is not a whole number of intervals after the first: it comes all the same, and once."""
    expected = yield {"splats": 30, "iterations": 100, "fraction": 0.5, "first": 10, "last": 35, "interval": 10}
    assert expected["iterations"].value.tolist() == [10, 20, 30, 35]
    assert expected["counts"].value.tolist() == [3, 3, 3, 6]


@case("uncommon", "pruning_plan", flags=["ties"])
def plan_of_the_default_half() -> Inputs:
    """A tenth of 25 is 2.5 in binary64 and rounds to 2, though the binary64 nearest to 0.1 lies above it."""
    expected = yield {"splats": 25, "iterations": 50_000, **INTRA}
    assert expected["counts"].value.tolist() == [2]


@case("uncommon", "pruning_plan", flags=["empty"], each={"fraction": (900, 9, 0.0), "iterations": (900, 0, 0.1),
                                                        "splats": (4, 9, 0.1)},
      said={"fraction": "a fraction"})  # fmt: skip
def plan_of_nothing(value: tuple[int, int, float]) -> Inputs:
    """Nothing to remove, for want of {key}."""
    splats, iterations, fraction = value
    expected = yield {"splats": splats, "iterations": iterations, **INTER, "fraction": fraction}
    assert expected["iterations"].value.shape == (0,)


@case("core", "prune", flags=["signed-zero"])
def weights_of_both_signs() -> Inputs:
    """Negative weights count by their magnitude."""
    expected = yield {"weights": f4(-0.9, 0.1, 0.5, -0.05, 0.02, -0.3), "removed": 3}
    assert expected["survivors"].value.tolist() == [0, 2, 5]


@case("core", "prune", flags=["ties"])
def equal_weights() -> Inputs:
    """Of equal magnitudes the higher index goes, whatever the signs: five of seven times 0.25."""
    expected = yield {"weights": f4(0.25, -0.25, 1, 0.25, -0.25, 0.25, 0.125, 0.25, -0.25), "removed": 6}
    assert expected["survivors"].value.tolist() == [0, 1, 2]


@case("core", "prune", flags=["survivors"])
def random_weights(rng: Draws) -> Inputs:
    """A tenth of 101 splats goes; the survivors keep their order."""
    weights = trained_rows(rng, 101)[:, 8]
    expected = yield {"weights": weights, "removed": 10}
    survivors = expected["survivors"].value
    assert np.all(np.diff(survivors) > 0)
    assert abs(weights[survivors]).min() > np.delete(abs(weights), survivors).max()


@case("core", "prune", flags=["empty"], each={"none": 0, "all": 4})
def extreme_removals(value: int) -> Inputs:
    """Of four splats {key} are removed."""
    expected = yield {"weights": f4(1, -1, 0, 2), "removed": value}
    assert len(expected["survivors"].value) == 4 - value


@case("core", "prune", flags=["signed-zero", "ties"])
def weights_of_zero() -> Inputs:
    """0 and -0 are equal: the higher index goes first, with either sign."""
    expected = yield {"weights": f4(0.0, -0.0, 1, -0.0, 0.0), "removed": 2}
    assert expected["survivors"].value.tolist() == [0, 1, 2]


@case("stress", "prune", flags=["subnormal", "overflow"])
def extreme_weights() -> Inputs:
    """Magnitudes from 1e-38 to 1e38, whose squares vanish or overflow."""
    expected = yield {"weights": f4(1e-37, 3e38, 2e-37, -1e38, 1.5e-37, 2e38), "removed": 2}
    assert expected["survivors"].value.tolist() == [1, 2, 3, 5]


# --- Compaction ------------------------------------------------------------------------------------------------------


def state_of(rng: Draws, count: int) -> Values:
    """Splats in training and what Adan knows of them; no two numbers of a column are alike."""
    m, v, n, previous = rng.normal(size=(4, count, 9)).astype(np.float32)
    steps = rng.permutation(count) + 1
    return {"values": trained_rows(rng, count), "m": m, "v": v, "n": n * n, "previous": previous, "steps": steps}


@case("core", "compact", flags=["survivors", "mixed-ages"])
def survivors_keep_their_state(rng: Draws) -> Inputs:
    """Thirteen splats of nineteen stay, each with its own moments and its own count of steps."""
    state, stay = state_of(rng, 19), np.array([0, 2, 3, 5, 6, 8, 10, 11, 12, 15, 16, 17, 18])
    expected = yield {"survivors": stay, **state}
    for name, rows in state.items():
        assert np.array_equal(expected[name].value, rows[stay])
        assert not np.array_equal(expected[name].value, rows[: len(stay)])


@case("uncommon", "compact", flags=["empty"], each={"none": [], "all": [0, 1, 2, 3, 4]})
def extreme_compactions(value: list[int], rng: Draws) -> Inputs:
    """Of five splats {key} stay."""
    expected = yield {"survivors": np.array(value, np.int64), **state_of(rng, 5)}
    assert len(expected["steps"].value) == len(value)


@case("stress", "compact", flags=["signed-zero", "subnormal"])
def odd_numbers_are_copied() -> Inputs:
    """Minus zero, subnormal and infinite numbers, and counts of steps beyond 2^31: copied as they are."""
    row = f4(-0.0, 1e-45, -1e-45, np.inf, 2.0**-126, -3e38, 0, 1, 2)
    rows = np.stack([np.roll(row, shift) for shift in range(4)])
    state: Values = {name: np.roll(rows, shift, 0) for shift, name in enumerate(("values", "m", "v", "n", "previous"))}
    steps = np.array([2**31, 1, 2**40, 0])
    expected = yield {"survivors": np.array([1, 2]), **state, "steps": steps}
    assert expected["steps"].value.tolist() == [1, 2**40]


# --- Augmentation ----------------------------------------------------------------------------------------------------


@case("core", "augment", flags=["odd-size", "order"])
def new_splats_of_a_wide_frame(rng: Draws) -> Inputs:
    """Five splats more on 200x30 pixels: x spans the width and y the height, factors begin at 1/2, w is 0.01."""
    values, uniforms = trained_rows(rng, 3), rng.random((5, 8), np.float32)
    expected = yield {"values": values, "uniforms": uniforms, "width": 200, "height": 30}
    new = expected["values"].value[3:]
    assert np.array_equal(new[:, 5:8], uniforms[:, 5:])
    assert np.all(new[:, 0] > uniforms[:, 0])
    assert np.array_equal(new[:, [2, 4]], uniforms[:, [2, 4]] + np.float32(0.5))
    assert np.all(new[:, 8] == np.float32(0.01))


@case("core", "augment", flags=["order"])
def new_splats_by_hand() -> Inputs:
    """One splat from eighths: every column is drawn, scaled and shifted as it should be."""
    uniforms = (np.arange(8, dtype=np.float32) / 8)[None]
    expected = yield {"values": np.zeros((0, 9), np.float32), "uniforms": uniforms, "width": 64, "height": 16}
    assert expected["values"].value[0, :8].tolist() == [0, 2, 0.75, 0.375, 1, 0.625, 0.75, 0.875]


@case("uncommon", "augment", flags=["empty"])
def no_new_splats(rng: Draws) -> Inputs:
    """Nothing to add: the old splats stay as they are."""
    values = trained_rows(rng, 4)
    expected = yield {"values": values, "uniforms": np.zeros((0, 8), np.float32), "width": 8, "height": 8}
    assert np.array_equal(expected["values"].value, values)


@case("stress", "augment", flags=["limit"])
def new_splats_of_the_largest_frame() -> Inputs:
    """The least and the largest uniform numbers on 65535x65535 pixels: products that are rounded once."""
    uniforms = np.array([[0] * 8, [1 - 2.0**-24] * 8, [2.0**-24] * 8], np.float32)
    expected = yield {"values": np.zeros((0, 9), np.float32), "uniforms": uniforms, "width": 65535, "height": 65535}
    assert expected["values"].value[1, 0] <= 65535
