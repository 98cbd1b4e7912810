"""P-frames of profile `main`: gradients, the motion field, new splats, and the same codes for any number of threads."""

from types import SimpleNamespace

import numpy as np
import pytest

from gsvc_ref.main_encoder import differences
from gsvc_ref.main_encoder.inter import InterCodes, InterEncoder, InterSettings, PFrame
from gsvc_ref.main_encoder.motion_field import best_field, flow_at_points
from gsvc_ref.main_encoder.new_splats import best_candidates, rounded, state_parameters
from gsvc_ref.rendering import Objective

WIDTH, HEIGHT = 96, 64
D = 16 * 16
SIZES, SHEARS = 1477 >> np.arange(11), 2048 >> np.arange(11)
LIMITS = np.tile(np.array([-200, 200]), (3, 11, 1))
SHORT = InterSettings(motion_steps=3, motion_rounds=3, iterations=24, rounded_iterations=9)


def level(n, step):
    k = (np.abs(n) + step // 2) // step
    return np.array([min(int(e).bit_length() // 2, 10) if e >= 2 else 0 for e in (k * k).sum(axis=1)])


def steps(state, j):
    return [np.maximum(1, np.floor(2.0 ** (8.5 + state[:, k] / 1024 - j))).astype(np.int64) for k in (2, 3)]


def moved(state, field, cell):
    """The field at the splats, to the nearest 1/256 px."""
    u = np.clip(state[:, 0] / 256 / cell - 0.5, 0, field.shape[1] - 1)
    v = np.clip(state[:, 1] / 256 / cell - 0.5, 0, field.shape[0] - 1)
    i, j = np.minimum(u.astype(int), max(field.shape[1] - 2, 0)), np.minimum(v.astype(int), max(field.shape[0] - 2, 0))
    s, t = u - i, v - j
    i1, j1 = np.minimum(i + 1, field.shape[1] - 1), np.minimum(j + 1, field.shape[0] - 1)
    mean = [
        (1 - t) * ((1 - s) * field[j, i, k] + s * field[j, i1, k])
        + t * ((1 - s) * field[j1, i, k] + s * field[j1, i1, k])
        for k in (0, 1)
    ]
    return [np.floor(64 * m + 0.5).astype(np.int64) for m in mean]


def to_binary32(state):
    out = np.empty(state.shape, np.float32)
    state_parameters(state, out)
    return out


CODEC = SimpleNamespace(H_SIZE=SIZES, H_SHEAR=SHEARS, level=level, steps=steps, moved=moved, to_binary32=to_binary32)


def picture(state):
    objective = Objective(np.zeros((HEIGHT, WIDTH, 3)), threads=1)
    objective.loss(to_binary32(state))
    return objective.picture()


@pytest.fixture
def state():
    rng = np.random.default_rng(7)
    count = 40
    out = np.empty((count, 8), np.int64)
    out[:, 0] = rng.integers(0, 256 * WIDTH, count)
    out[:, 1] = rng.integers(0, 256 * HEIGHT, count)
    out[:, 2:4] = rng.integers(1500, 2800, (count, 2))
    out[:, 4] = rng.integers(-900, 900, count)
    out[:, 5] = rng.integers(16 * 150, 16 * 900, count)
    out[:, 6:] = rng.integers(-16 * 90, 16 * 90, (count, 2))
    return out


def encoded(state, target, settings=SHORT, threads=1, precision="fast") -> InterCodes:
    objective = Objective(target, threads=threads, precision=precision)
    frame = PFrame(state, objective, picture(state), target, D, LIMITS, len(state))
    return InterEncoder(CODEC, settings).encode(frame)


def anchors(state):
    j = level(state[:, 5:], D)
    zero = np.zeros(len(state), np.int64)
    return differences.anchors(state, (zero, zero), steps(state, j), j, SIZES, SHEARS)


def test_no_differences_leave_the_splats_as_they_are(state):
    parameters = np.empty((len(state), 8), np.float32)
    differences.values(anchors(state), np.zeros((len(state), 8)), D / 16, parameters)
    np.testing.assert_array_equal(parameters, to_binary32(state))


def test_gradients_by_differences_are_those_of_the_error(state):
    rng = np.random.default_rng(1)
    anchor, q = anchors(state), rng.normal(0, 0.3, (len(state), 8))
    weights = rng.normal(0, 1, (len(state), 8)).astype(np.float32)  # of a loss that is linear in the parameters
    parameters, found = np.empty((len(state), 8), np.float32), np.empty((len(state), 8))
    differences.values(anchor, q, D / 16, parameters)
    differences.gradients(anchor, q, parameters, weights, D / 16, 1.0, found)
    sides = np.empty((2, len(state), 8), np.float32)
    for k in range(8):
        for side, step in zip(sides, (0.05, -0.05), strict=True):
            differences.values(anchor, q + step * np.eye(8)[k], D / 16, side)
        wanted = ((sides[0].astype(np.float64) - sides[1]) * weights).sum(axis=1) / 0.1
        np.testing.assert_allclose(found[:, k], wanted, atol=2e-3 * np.abs(wanted).max())


def test_crowding_of_splats_alone_and_in_the_same_place(state):
    parameters = to_binary32(state)[:2]
    parameters[1] = parameters[0]
    np.testing.assert_allclose(differences.crowding(parameters), 2)
    parameters[1, 0] += 1000
    np.testing.assert_array_equal(differences.crowding(parameters), 1)


def test_the_field_finds_a_shift_and_none_where_nothing_moves(state):
    before, shifted = picture(state), state + np.array([600, -300, 0, 0, 0, 0, 0, 0])
    for target, wanted in ((picture(shifted), (9.375, -4.6875)), (before, (0, 0))):
        flow = flow_at_points(before, target)
        field = best_field(Objective(target, threads=1), to_binary32(state), flow, None, 500, 2.4, (64, 32), 6, 6)
        assert (field.cell > 0) == (wanted != (0, 0))
        assert np.abs(field.vectors - wanted).mean() < 2


def test_a_still_picture_needs_no_codes(state):
    codes = encoded(state, picture(state))
    assert codes.field.cell == 0
    assert not codes.differences.any()
    assert not codes.removed.any()
    assert len(codes.new.state) == 0


def test_a_change_of_colour_is_followed_by_colour_alone(state):
    changed = state.copy()
    changed[3, 5] += 6 * D
    codes = encoded(state, picture(changed))
    assert codes.differences[3, 5] > 3
    assert np.abs(np.delete(codes.differences, 3, axis=0)).sum() < np.abs(codes.differences[3]).sum()


def test_splats_outside_the_frame_are_removed(state):
    target = picture(state)
    state[5, 0] = 256 * 500
    codes = encoded(state, target)
    assert np.flatnonzero(codes.removed).tolist() == [5]


def test_what_appears_gets_new_splats_whose_codes_decode_to_their_state(state):
    blob = np.array([[256 * 60, 256 * 30, 2000, 2000, 0, 16 * 900, 0, 16 * 200]])
    codes = encoded(state, picture(np.concatenate([state, blob])))
    assert len(codes.new.state) > 0
    nearest = np.abs(codes.new.state[:, :2] - blob[0, :2]).sum(axis=1).min()
    assert nearest < 3 * 256
    new, j = codes.new, level(codes.new.colors * D, D)
    np.testing.assert_array_equal(new.state[:, 5:], new.colors * D)
    np.testing.assert_array_equal(new.state[:, 2], (new.shapes[:, 0] + new.shapes[:, 1]) * SIZES[j])
    np.testing.assert_array_equal(new.state[:, 3], (new.shapes[:, 0] - new.shapes[:, 1]) * SIZES[j])
    np.testing.assert_array_equal(new.state[:, 4], new.shapes[:, 2] * SHEARS[j])
    for k in (0, 1):
        exponent = np.clip((new.state[:, 2 + k] >> 10) + 1 - j, -4, 2)
        assert ((new.places[:, k] >= 0) & (new.places[:, k] < 1 << (2 - exponent))).all()
        place = new.cells[:, k] * 1024 + (new.places[:, k] << (exponent + 8)) + (1 << (exponent + 7))
        np.testing.assert_array_equal(new.state[:, k], place)


def test_codes_of_new_splats_stay_within_their_limits():
    z = np.array([[50.0, 30.0, 4.0, 2.0, 9.0, 800.0, 20.0, 0.0]])
    codes = rounded(z, D, WIDTH, HEIGHT, SIZES, SHEARS, np.tile(np.array([-1, 1]), (3, 11, 1)))
    assert np.abs(codes.shapes).max() == 1


def test_candidates_lie_where_the_residual_is_and_promise_its_energy():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    blob = np.exp(-0.5 * ((x - 40) ** 2 + (y - 20) ** 2) / 4.0**2)
    residual = (0.3 * blob[..., None] * np.ones(3)).astype(np.float32)
    z = best_candidates(residual, (2.0, 4.0, 8.0), 100.0, 5)
    np.testing.assert_allclose(z[0, :2], (40.5, 20.5), atol=1.5)
    np.testing.assert_allclose((z[0, 5:] ** 2).sum(), ((255 * residual) ** 2).sum(), rtol=0.1)  # on a grid of 2 px
    assert len(best_candidates(residual, (4.0,), 1e9, 5)) == 0


def test_codes_are_the_same_for_any_number_of_threads(state):
    changed = state + np.array([100, 60, 30, 0, 0, 200, 0, 0])
    one, two = (encoded(state, picture(changed), threads=n, precision="deterministic") for n in (1, 2))
    np.testing.assert_array_equal(one.differences, two.differences)
    np.testing.assert_array_equal(one.field.vectors, two.field.vectors)
    np.testing.assert_array_equal(one.new.state, two.new.state)
