"""Cases of a step of Adan."""

from typing import Any, Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.training import f4
from gsvc_conformance.operation import Values

BETAS = {"beta1": 0.98, "beta2": 0.92, "beta3": 0.99, "epsilon": 1e-8}


def adan_inputs(rng: Draws, steps: Any, columns: int = 4, gradient_size: float = 1.0) -> Values:
    """A state in the middle of training, whose averages are of the size of its gradients."""
    ages = np.array(steps, np.int64)
    old = (ages > 0)[:, None]
    parameters, gradients, m, v, n, previous = rng.normal(size=(6, len(ages), columns)).astype(np.float32)
    size = np.float32(gradient_size)
    return {
        "parameters": parameters,
        "gradients": gradients * size,
        "m": np.where(old, 0.3 * m * size, np.float32(0)).astype(np.float32),
        "v": np.where(old, 0.2 * v * size, np.float32(0)).astype(np.float32),
        "n": np.where(old, (n * size) ** 2, np.float32(0)).astype(np.float32),
        "previous": np.where(old, previous * size, np.float32(0)).astype(np.float32),
        "steps": ages,
        "rates": np.full(columns, 1e-2, np.float32),
        "units": np.ones(columns, np.float32),
        **BETAS,
    }


@case("core", "adan_step", flags=["first-step", "correction"])
def first_step(rng: Draws) -> Inputs:
    """The first step of a row: the difference of gradients is 0, and m / (1 - b1) over the root is the gradient's sign.

    The parameter moves by the rate against the gradient. A difference against a previous gradient of 0 makes it larger
    in v, n and the step, and any correction left out makes it ten times too small or too large.
    """
    inputs = adan_inputs(rng, [0] * 7)
    expected = yield inputs
    moved = expected["parameters"].value - inputs["parameters"]
    assert np.allclose(moved, -0.01 * np.sign(inputs["gradients"]), rtol=1e-4)
    assert not expected["v"].value.any()
    assert np.array_equal(expected["previous"].value, inputs["gradients"])


@case("core", "adan_step", flags=["first-step"])
def first_step_of_a_dirty_row(rng: Draws) -> Inputs:
    """A row of age 0 whose `previous` holds what another splat left there: it is not looked at."""
    inputs = adan_inputs(rng, [0, 0, 5])
    inputs["previous"] = rng.normal(size=(3, 4)).astype(np.float32)
    expected = yield inputs
    assert not expected["v"].value[:2].any()
    assert expected["v"].value[2].all()


@case("core", "adan_step", flags=["correction"])
def second_step() -> Inputs:
    """The second step from the state that the first has left, in numbers that can be followed by hand.

    With the gradients 1 and 3: d = 2, m = 0.98 * 0.02 + 0.02 * 3, v = 0.08 * 2, n = 0.99 * 0.01 + 0.01 * 4.84^2.
    """
    expected = yield {
        "parameters": f4([1.0]), "gradients": f4([3.0]), "m": f4([0.02]), "v": f4([0.0]), "n": f4([0.01]),
        "previous": f4([1.0]), "steps": np.array([1], np.int64), "rates": f4(0.5), "units": f4(1.0), **BETAS,
    }  # fmt: skip
    m, v, n = 0.98 * 0.02 + 0.06, 0.16, 0.0099 + 0.01 * 4.84**2
    update = (m / (1 - 0.98**2) + 0.92 * v / (1 - 0.92**2)) / (np.sqrt(n) / np.sqrt(1 - 0.99**2) + 1e-8)
    assert np.allclose([expected[name].value.item() for name in "mvn"], [m, v, n], rtol=1e-6)
    assert np.isclose(expected["parameters"].value.item(), 1 - 0.5 * update, rtol=1e-6)


@case("core", "adan_step", flags=["mixed-ages", "correction"])
def rows_of_mixed_ages(rng: Draws) -> Inputs:
    """Rows of ages 0 to 2000 side by side: each is corrected by its own count, as after an augmentation."""
    steps = [0, 1, 2, 3, 0, 9, 10, 63, 64, 65, 99, 127, 128, 500, 0, 999, 2000]
    expected = yield adan_inputs(rng, steps, columns=9)
    assert expected["steps"].value.tolist() == [k + 1 for k in steps]


@case("core", "adan_step", flags=["correction"])
def old_rows(rng: Draws) -> Inputs:
    """Rows that are tens of thousands of steps old: the corrections are 1."""
    inputs = adan_inputs(rng, [49_999, 20_000, 30_001])
    expected = yield inputs
    n, v, m = (expected[name].value for name in "nvm")
    plain = inputs["parameters"] - 0.01 * (m + 0.92 * v) / (np.sqrt(n) + 1e-8)
    assert np.allclose(expected["parameters"].value, plain, rtol=1e-6)


@case("core", "adan_step", flags=["epsilon"])
def tiny_gradients(rng: Draws) -> Inputs:
    """Gradients around epsilon, where it slows the step by half.

    Inside the root, or added to n before the correction, epsilon would be 1e-4 there and stop the splats; left out,
    they move twice as far.
    """
    inputs = adan_inputs(rng, [0, 0, 3, 40], gradient_size=1e-8)
    expected = yield inputs
    moved = abs(expected["parameters"].value[:2] - inputs["parameters"][:2])
    assert np.all(moved < 0.0099)
    assert np.all(moved > 1e-6)


@case("core", "adan_step", flags=["units"])
def positions_in_units_of_the_frame(rng: Draws) -> Inputs:
    """Units of half the frame's sides for x and y: gradients are multiplied by them, and so are steps.

    The state is that of the learned values: without the unit on either side, positions barely move or fly away.
    """
    inputs = adan_inputs(rng, [0, 5, 30, 700], columns=9)
    inputs["units"] = f4(960, 540, 1, 1, 1, 1, 1, 1, 1)
    inputs["rates"] = np.full(9, 1e-3, np.float32)
    units = inputs["units"]
    for name, unit in (("m", units), ("v", units), ("n", units * units), ("previous", units)):
        inputs[name] = (inputs[name] * unit).astype(np.float32)
    expected = yield inputs
    moved = expected["parameters"].value[0] - inputs["parameters"][0]
    assert np.allclose(abs(moved), 1e-3 * inputs["units"], rtol=1e-3)


@case("core", "adan_step", flags=["units"])
def rates_of_their_own(rng: Draws) -> Inputs:
    """Another learning rate for every column, and 0 for one: that parameter stays while its averages move on."""
    inputs = adan_inputs(rng, [0, 1, 12], columns=9)
    inputs["rates"] = f4(1e-3, 2e-3, 5e-4, 0, 0.018, 1e-2, 0.1, 1, 1e-5)
    expected = yield inputs
    assert np.array_equal(expected["parameters"].value[:, 3], inputs["parameters"][:, 3])
    assert not np.array_equal(expected["m"].value[:, 3], inputs["m"][:, 3])


@case("core", "adan_step", flags=["empty"])
def gradients_of_zero(rng: Draws) -> Inputs:
    """A gradient of 0 in a row with history, such as of a splat that has left the frame: momentum carries it on."""
    inputs = adan_inputs(rng, [4, 200])
    inputs["gradients"] = np.zeros((2, 4), np.float32)
    expected = yield inputs
    assert not expected["previous"].value.any()
    assert np.allclose(expected["m"].value, 0.98 * inputs["m"], rtol=1e-6)
    assert not np.array_equal(expected["parameters"].value, inputs["parameters"])


@case("core", "adan_step", flags=["empty", "epsilon"])
def nothing_ever() -> Inputs:
    """No gradient and no history: 0 over epsilon is 0, and the parameter stays."""
    zeros = np.zeros((2, 3), np.float32)
    expected = yield {
        "parameters": f4([1, -2, 0], [4, 5, 6]), "gradients": zeros, "m": zeros, "v": zeros, "n": zeros,
        "previous": zeros, "steps": np.array([0, 7], np.int64), "rates": f4(1, 1, 1), "units": f4(1, 1, 1), **BETAS,
    }  # fmt: skip
    assert expected["parameters"].value.tolist() == [[1, -2, 0], [4, 5, 6]]


@case("core", "adan_step", flags=["correction"])
def other_decay_rates(rng: Draws) -> Inputs:
    """Three quite different decay rates and an epsilon that matters: exchanged ones show in every output."""
    inputs = adan_inputs(rng, [0, 1, 2, 8])
    inputs |= {"beta1": 0.5, "beta2": 0.75, "beta3": 0.9375, "epsilon": 0.125}
    expected = yield inputs
    assert np.array_equal(expected["m"].value, (inputs["m"].astype(np.float64) + inputs["gradients"]) / 2)


@case("core", "adan_step", flags=["correction"])
def corrections_of_slow_averages(rng: Draws) -> Inputs:
    """Decay rates of 0.999, 0.9 and 0.9999 in the first steps, parameters of 0: only the update counts.

    1 - b^k is small, and loses its last digits where the power is rounded to binary32 before the subtraction.
    """
    inputs = adan_inputs(rng, [0, 1, 2, 3, 4, 7, 12], columns=3)
    inputs["parameters"] = np.zeros((7, 3), np.float32)
    inputs |= {"beta1": 0.999, "beta2": 0.9, "beta3": 0.9999}
    expected = yield inputs
    k = inputs["steps"][:, None] + 1
    of_m, of_v, of_n = (1 - (np.float32(inputs[b]) ** k).astype(np.float32) for b in ("beta1", "beta2", "beta3"))
    m, v, n = (expected[name].value for name in "mvn")
    update = (m / of_m + 0.9 * v / of_v) / (np.sqrt(n / of_n) + 1e-8)
    assert np.all(abs(-0.01 * update - expected["parameters"].value) > 4 * expected["parameters"].bound)


@case("core", "adan_step", flags=["units"])
def no_weight_decay() -> Inputs:
    """Large parameters with small gradients: nothing pulls them towards 0."""
    gradients = f4([1e-4, -1e-4], [2e-4, 3e-4])
    zeros = np.zeros((2, 2), np.float32)
    inputs = {
        "parameters": f4([1000, 1000], [-1000, 500]), "gradients": gradients, "m": zeros, "v": zeros, "n": zeros,
        "previous": zeros, "steps": np.array([0, 0], np.int64), "rates": f4(0.25, 0.25), "units": f4(1, 1), **BETAS,
    }  # fmt: skip
    expected = yield inputs
    moved = expected["parameters"].value - inputs["parameters"]
    assert np.allclose(moved, -0.25 * np.sign(gradients), rtol=1e-3)


@case("core", "adan_step", flags=["correction"])
def large_gradients(rng: Draws) -> Inputs:
    """Gradients of a thousand after small ones: nothing is clipped, and n takes the square of g + b2 d."""
    inputs = adan_inputs(rng, [3, 50], gradient_size=1e-2)
    inputs["gradients"] = f4([1000, -1000, 500, 250], [-700, 800, 900, -1000])
    expected = yield inputs
    assert np.all(expected["n"].value > 0.01 * inputs["gradients"].astype(np.float64) ** 2 * 3)


# --- All rows of one age, as optimisers with one count of steps have them -----------------------------------------


@case("core", "adan_step", flags=["correction"], each={str(k): k for k in (0, 1, 2, 3, 10, 99, 1000, 20_000)})
def rows_of_one_age(value: int, rng: Draws) -> Inputs:
    """Eleven rows, steps that each has had: {key}."""
    expected = yield adan_inputs(rng, [value] * 11, columns=8)
    assert (expected["steps"].value == value + 1).all()


@case("core", "adan_step", each={"one_row": (1, 1), "61_rows": (61, 9)})
def shapes_of_one_age(value: tuple[int, int], rng: Draws) -> Inputs:
    """A state of {key}, after 30 steps."""
    rows, columns = value
    expected = yield adan_inputs(rng, [30] * rows, columns)
    assert expected["parameters"].value.shape == value


@case("core", "adan_step", flags=["epsilon"], each={"a_millionth": 1e-6, "a_thousandth": 1e-3, "a_thousand": 1e3})
def gradients_of_one_age(value: float, rng: Draws) -> Inputs:
    """Gradients of about {key}, after 7 steps."""
    expected = yield adan_inputs(rng, [7] * 5, gradient_size=value)
    assert expected["m"].value.all()


DECAYS: Final = {"short": (0.5, 0.75, 0.9375), "long": (0.999, 0.995, 0.9999), "of_adam": (0.9, 0.9, 0.999)}


@case("core", "adan_step", flags=["correction"], each=DECAYS)
def decay_rates_of_one_age(value: tuple[float, float, float], rng: Draws) -> Inputs:
    """Decay rates that are {key}, in the fifth step."""
    expected = yield adan_inputs(rng, [4] * 5) | dict(zip(("beta1", "beta2", "beta3"), value, strict=True))
    assert (expected["steps"].value == 5).all()


@case("core", "adan_step", flags=["units"], each={"units": "units", "rates": "rates"})
def columns_of_one_age(value: str, rng: Draws) -> Inputs:
    """Columns that differ in their {key}, after 12 steps."""
    inputs = adan_inputs(rng, [12] * 5, columns=8)
    inputs[value] = inputs[value] * f4(0.5, 2, 0.25, 1, 1, 3, 5, 0.125)
    expected = yield inputs
    assert not np.array_equal(expected["parameters"].value, inputs["parameters"])


@case("uncommon", "adan_step", flags=["first-step", "correction"])
def decay_rates_of_zero(rng: Draws) -> Inputs:
    """Without memory (all decay rates 0): m is the gradient, v the difference, and all corrections are 1."""
    inputs = adan_inputs(rng, [0, 3])
    inputs |= {"beta1": 0.0, "beta2": 0.0, "beta3": 0.0, "epsilon": 1e-3}
    expected = yield inputs
    assert np.array_equal(expected["m"].value, inputs["gradients"])
    assert np.array_equal(expected["v"].value[1], inputs["gradients"][1].astype(np.float64) - inputs["previous"][1])


@case("uncommon", "adan_step", flags=["empty"])
def no_rows() -> Inputs:
    """A frame without splats."""
    none = np.zeros((0, 9), np.float32)
    expected = yield {
        "parameters": none, "gradients": none, "m": none, "v": none, "n": none, "previous": none,
        "steps": np.zeros(0, np.int64), "rates": np.full(9, 1e-3, np.float32), "units": np.ones(9, np.float32), **BETAS,
    }  # fmt: skip
    assert expected["parameters"].value.shape == (0, 9)


@case("uncommon", "adan_step", flags=["mixed-ages"])
def many_rows(rng: Draws) -> Inputs:
    """61 rows in runs of equal age whose lengths are no multiple of a vector's."""
    lengths, ages = [17, 1, 23, 2, 18], [300, 0, 300, 7, 0]
    expected = yield adan_inputs(rng, np.repeat(ages, lengths), columns=9)
    assert len(expected["steps"].value) == 61


@case("stress", "adan_step", flags=["subnormal", "epsilon"])
def vanishing_gradients(rng: Draws) -> Inputs:
    """Gradients of 1e-22, whose squares are subnormal or zero: epsilon keeps the quotient finite."""
    inputs = adan_inputs(rng, [0, 2, 90], gradient_size=1e-22)
    expected = yield inputs
    assert np.allclose(expected["parameters"].value, inputs["parameters"], atol=1e-12)


@case("stress", "adan_step", flags=["overflow"])
def huge_gradients(rng: Draws) -> Inputs:
    """Gradients of 1e17, whose squares are near the end of binary32."""
    inputs = adan_inputs(rng, [0, 2, 90], gradient_size=1e17)
    expected = yield inputs
    assert np.all(expected["n"].value < 3e38)


@case("stress", "adan_step", flags=["cancellation"])
def opposite_momentum(rng: Draws) -> Inputs:
    """Averages that the gradients cancel to nearly nothing: the bounds are those of the parts, not of the rest."""
    inputs = adan_inputs(rng, [10, 11])
    inputs["gradients"] = (-49 * inputs["m"]).astype(np.float32)
    expected = yield inputs
    assert np.all(abs(expected["m"].value) < 1e-5 * abs(inputs["gradients"]))
