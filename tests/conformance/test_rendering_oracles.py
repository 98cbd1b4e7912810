"""The oracles of rendering: against other formulas, and against other arithmetic that is legal, too."""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from gsvc_conformance import reference
from gsvc_conformance.case import of_operation
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.gradients import ALL_GROUPS, noise, slope
from gsvc_conformance.cases.splat_sets import MIN_GUARDS, population, splat, splats
from gsvc_conformance.operation import operations
from gsvc_conformance.operations.rendering import MIN_SPLATS, edge_margins
from gsvc_ref.rendering import LN_255, SMALLEST_NORMAL


def oracle(name, **inputs):
    return operations()[name].oracle(**inputs)


@cache
def vectors(name):
    """Inputs and expectations of all small cases of an operation; large ones have no other arithmetic than these."""
    return {case.id: case.run() for case in of_operation(name) if case.tier != "full" and CAPACITY not in case.flags}


def nearest(x):
    """To binary32, ties to even; the numbers stay binary64."""
    return np.asarray(x, np.float64).astype(np.float32).astype(np.float64)


def chopped(x):
    """To binary32, towards zero."""
    near = np.asarray(x, np.float64).astype(np.float32)
    return np.where(abs(near) > abs(x), np.nextafter(near, np.float32(0)), near).astype(np.float64)


def flushed(x):
    """To binary32, and what is subnormal to zero."""
    near = nearest(x)
    return np.where(abs(near) < SMALLEST_NORMAL, 0.0, near)


class Arithmetic(NamedTuple):
    """What the error model leaves open."""

    fl: object = nearest
    fused: bool = False
    reciprocal: bool = False
    base_2: bool = False
    backwards: bool = False

    def add_product(self, a, b, c):
        """A b + c."""
        return self.fl(a * b + c) if self.fused else self.fl(self.fl(a * b) + c)

    def divide(self, a, b):
        return self.fl(a * self.fl(1 / b)) if self.reciprocal else self.fl(a / b)

    def exp_minus(self, x):
        return self.fl(np.exp2(self.fl(x * -self.fl(1 / np.log(2)))) if self.base_2 else np.exp(-x))


ARITHMETIC = {
    "plain": Arithmetic(),
    "backwards": Arithmetic(backwards=True),
    "fused": Arithmetic(fused=True),
    "reciprocals": Arithmetic(reciprocal=True),
    "reciprocals, fused, exp2": Arithmetic(fused=True, reciprocal=True, base_2=True, backwards=True),
    "towards zero": Arithmetic(fl=chopped),
    "flushed to zero": Arithmetic(fl=flushed, reciprocal=True),
}


def weights(parameters, width, height, arithmetic):
    """Per splat: index, u1, u2, g, each (H, W) f8, g is zero where it covers nothing."""
    fl = arithmetic.fl
    rows = range(len(parameters))
    for n in reversed(rows) if arithmetic.backwards else rows:
        x, y, l11, l21, l22 = parameters[n, :5].astype(np.float64)
        if not (SMALLEST_NORMAL <= l11 < np.inf and SMALLEST_NORMAL <= l22 < np.inf):
            continue
        u1 = arithmetic.divide(fl(np.arange(width) + 0.5 - x), l11)
        d_y = fl(np.arange(height) + 0.5 - y)[:, None]
        u2 = arithmetic.divide(arithmetic.add_product(-l21, u1, d_y), l22)
        sigma = fl(arithmetic.add_product(u2, u2, fl(u1 * u1)) / 2)
        g = np.where(sigma <= np.float32(LN_255), arithmetic.exp_minus(sigma), 0.0)
        yield n, np.broadcast_to(u1, g.shape), u2, g


def summed(parameters, width, height, arithmetic):
    C = np.zeros((height, width, 3))
    for n, _, _, g in weights(parameters, width, height, arithmetic):
        covered = (g > 0)[..., None]
        C = np.where(covered, arithmetic.add_product(g[..., None], parameters[n, 5:].astype(np.float64), C), C)
    return C.astype(np.float32)


@pytest.mark.exhaustive
@pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")  # infinities far from extreme splats
@pytest.mark.parametrize("arithmetic", ARITHMETIC.values(), ids=ARITHMETIC)
def test_legal_sums_are_within_the_bounds_of_every_vector(arithmetic):
    for name, (inputs, expected) in vectors("render_sum").items():
        verdict = expected["sum"].judge(summed(**inputs, arithmetic=arithmetic))
        assert verdict.passed, f"{name} {verdict.message}"


@pytest.mark.exhaustive
@pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")
@pytest.mark.parametrize("arithmetic", ARITHMETIC.values(), ids=ARITHMETIC)
def test_legal_frames_are_within_the_intervals_of_every_vector(arithmetic):
    for name, (inputs, expected) in vectors("render_frame").items():
        depth = inputs["bit_depth"]
        C = summed(inputs["parameters"], inputs["width"], inputs["height"], arithmetic).astype(np.float64)
        frame = np.rint(arithmetic.fl(np.clip(C, 0, 1) * (2**depth - 1)))
        verdict = expected["frame"].judge(frame.astype(expected["frame"].value.dtype))
        assert verdict.passed, f"{name} {verdict.message}"


def gradients(parameters, residual, total, arithmetic, moments):
    """Gradients in binary32 with `total` for sums, by sums of q v or by moments."""
    fl = arithmetic.fl
    height, width, _ = residual.shape
    result = np.zeros((len(parameters), 8))
    for n, u1, u2, g in weights(parameters, width, height, arithmetic):
        at = g > 0
        u1, u2, g, e, c = u1[at], u2[at], g[at], residual[at].astype(np.float64), parameters[n, 5:].astype(np.float64)
        l11, l21, l22 = parameters[n, 2:5].astype(np.float64)
        q = fl(g * arithmetic.add_product(e[:, 2], c[2], arithmetic.add_product(e[:, 1], c[1], fl(e[:, 0] * c[0]))))
        if moments:
            of_1, of_2, of_11, of_12, of_22 = (total(fl(q * m)) for m in (u1, u2, u1 * u1, u1 * u2, u2 * u2))
            shear = fl(fl(l21 / l22) / l11)  # l11 l22 may underflow
            of_l = [of_1 / l11 - shear * of_2, of_2 / l22, of_11 / l11 - shear * of_12, of_12 / l22, of_22 / l22]
        else:
            v2 = fl(u2 / l22)
            v1 = fl(fl(u1 - fl(l21 * v2)) / l11)
            products = (fl(q * v1), fl(q * v2), fl(fl(q * v1) * u1), fl(fl(q * v2) * u1), fl(fl(q * v2) * u2))
            of_l = [total(product) for product in products]
        result[n] = [*of_l, *(total(fl(g * e[:, k])) for k in range(3))]
    return result.astype(np.float32)


def one_after_the_other(x):
    return float(np.cumsum(x, dtype=np.float32)[-1]) if len(x) else 0.0


def two_by_two(x):
    return float(np.sum(x.astype(np.float32)))


@pytest.mark.exhaustive
@pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")
@pytest.mark.parametrize("moments", [False, True], ids=["products", "moments"])
@pytest.mark.parametrize("total", [one_after_the_other, two_by_two])
@pytest.mark.parametrize("name", ["plain", "reciprocals, fused, exp2"])
def test_legal_gradients_are_within_the_bounds_of_every_vector(name, total, moments):
    for case, (inputs, expected) in vectors("render_gradients").items():
        verdict = expected["gradients"].judge(
            gradients(**inputs, total=total, arithmetic=ARITHMETIC[name], moments=moments)
        )
        assert verdict.passed, f"{case} {verdict.message}"


def sum_by_covariance(parameters, width, height):
    """The sum (H, W, 3) by the inverse of the covariance, in the type of the parameters; coverage by real parts."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    C = np.zeros((height, width, 3), parameters.dtype)
    for row in parameters:
        L = np.array([[row[2], 0], [row[3], row[4]]])
        inverse = np.linalg.inv(L @ L.T)
        d = np.stack([x - row[0], y - row[1]])
        sigma = np.einsum("ihw,ij,jhw->hw", d, inverse, d) / 2
        g = np.where(sigma.real <= np.log(255), np.exp(-sigma), 0)
        C += g[..., None] * row[5:]
    return C


def test_the_sum_by_the_inverse_covariance():
    parameters = population(np.random.default_rng(1), 40, 31, 22)
    expected = oracle("render_sum", parameters=parameters, width=31, height=22)["sum"]
    np.testing.assert_allclose(expected.value, sum_by_covariance(parameters.astype(np.float64), 31, 22), atol=1e-9)


def test_gradients_by_complex_steps():
    """The imaginary part of a sum of analytic functions at p + ih is h times the derivative, without cancellation."""
    parameters = population(np.random.default_rng(2), 5, 19, 14)
    residual = noise(np.random.default_rng(3), 19, 14)
    expected = oracle("render_gradients", parameters=parameters, residual=residual)["gradients"].value
    for n in range(5):
        for column in range(8):
            moved = parameters.astype(np.complex128)
            moved[n, column] += 1e-30j
            derivative = np.sum(residual * sum_by_covariance(moved, 19, 14).imag) / 1e-30
            assert expected[n, column] == pytest.approx(derivative, rel=1e-8, abs=1e-9)


def test_margins_are_counted_in_rounding_errors():
    on_the_edge = splat(10.5, 3.5, 4 / np.sqrt(2 * np.log(255)), 0.0, 0.5)
    parameters = splats(on_the_edge, splat(10.4, 3.4, 2.0, 0.5, 1.0), splat(300, 300, 1.0, 0.0, 1.0))
    margins = edge_margins(parameters, 21, 7)
    assert margins[0] <= 1
    assert margins[1] > MIN_GUARDS
    assert margins[2] == np.inf


def test_random_splats_are_clear_of_the_edge():
    parameters = population(np.random.default_rng(4), 300, 64, 48)
    assert edge_margins(parameters, 64, 48).min() > MIN_GUARDS


def small_splats(count):
    return population(np.random.default_rng(5), count, 33, 29, radius=0.8)


@pytest.mark.parametrize(
    ("parameters", "residual"),
    [
        (small_splats(MIN_SPLATS - 1), noise(np.random.default_rng(6), 33, 29)),
        (population(np.random.default_rng(7), 60, 33, 29, radius=12.0), noise(np.random.default_rng(6), 33, 29)),
        (
            splats(small_splats(60), splat(10.5, 3.5, 4 / np.sqrt(2 * np.log(255)), 0.0, 0.5)),
            noise(np.random.default_rng(6), 33, 29),
        ),
        (small_splats(60), np.zeros((29, 33, 3), np.float32)),
    ],
    ids=["few splats", "much cancellation", "a pixel on the edge", "no residual"],
)
def test_gradients_are_not_judged_together_where_roundings_may_add_up(parameters, residual):
    assert oracle("render_gradients", parameters=parameters, residual=residual)["gradients"].groups == ()


def test_a_factor_that_single_bounds_allow_is_found_together():
    """One of 1 + 3e-6 on all gradients: within each bound, outside of the signed bias."""
    parameters = small_splats(60)
    parameters[:, [3, 5, 6, 7]] = abs(parameters[:, [3, 5, 6, 7]])
    residual = slope(33, 29)
    expected = oracle("render_gradients", parameters=parameters, residual=residual)["gradients"]
    right = reference.render_gradients(parameters=parameters, residual=residual)["gradients"]
    wrong = right * np.float32(1 + 3e-6)
    assert expected.groups == ALL_GROUPS
    assert expected.judge(right).passed
    assert np.all(abs(wrong - expected.value) <= expected.bound)
    assert "signed bias" in expected.judge(wrong).message


def test_frames_of_the_ends_of_the_bounds_are_accepted_and_none_beyond():
    parameters = population(np.random.default_rng(8), 23, 25, 18)
    size = {"width": 25, "height": 18}
    C = oracle("render_sum", parameters=parameters, **size)["sum"]
    frame = oracle("render_frame", parameters=parameters, **size, bit_depth=16)["frame"]
    for sign in (-1, 1):
        end = np.rint(np.clip(C.value + sign * C.bound, 0, 1) * 65535)
        assert frame.judge(end.astype(np.uint16)).passed
        beyond = np.clip(end + 2 * sign, 0, 65535)
        assert not frame.judge(beyond.astype(np.uint16)).passed


@pytest.mark.parametrize("bit_depth", [8, 10, 16])
def test_half_steps_round_either_way_where_the_product_is_rounded(bit_depth):
    peak = 2**bit_depth - 1
    values = ((np.arange(3 * 80) + 0.5) / peak).astype(np.float32).reshape(8, 10, 3)
    expected = oracle("to_frame", sum=values, bit_depth=bit_depth)["frame"]
    kind = expected.value.dtype
    wide = values.astype(np.float64) * peak
    for product in (
        wide,
        nearest(wide),
        chopped(wide),
        np.nextafter(nearest(wide).astype(np.float32), np.float32(9e9)),
    ):
        assert expected.judge(np.rint(product).astype(kind)).passed
    assert not expected.judge((expected.value + 1).astype(kind)).passed
