"""P-frames of profile `main`: gradients, the motion field, new splats, and the same codes for any number of threads."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.encoder.main import differences
from gsvc_ref.encoder.main.codes import nearest_codes
from gsvc_ref.encoder.main.field import BIT_PRICE, best_field
from gsvc_ref.encoder.main.inter import PFrame, encode_inter
from gsvc_ref.encoder.main.intra import encode_intra
from gsvc_ref.encoder.main.new_splats import CUTOFF, best_candidates
from gsvc_ref.encoder.main.settings import InterSettings, IntraSettings
from gsvc_ref.encoder.main.target import Target
from gsvc_ref.main.cells import halving_count
from gsvc_ref.main.codes import REMOVED, MainCodes
from gsvc_ref.main.densities import PLANES, Densities, Density
from gsvc_ref.main.frames import frame_body
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.main.models import Models
from gsvc_ref.main.reconstruct import add_differences, intra_state
from gsvc_ref.main.state import parameters_of, to_splats
from gsvc_ref.main.tables import step_of
from gsvc_ref.rendering import Objective, Precision, SampledObjective

WIDTH, HEIGHT = 96, 64
QUANTIZER = 40
D = step_of(QUANTIZER)
DENSITIES = Densities((Density(scale_code=16),) * len(PLANES), (0,) * halving_count(WIDTH, HEIGHT))
LATTICES: tuple[tuple[int, int], ...] = ((1, 1), (2, 1), (2, 2))
HALF_A_UNIT = 2 ** (0.5 / 1024) - 1 + 2**-15
"""How far a decoder's colours are from the exact ones: it takes (A + B) / 2 in whole units, and 16 bits of 2^x."""
FIELD_ONLY = InterSettings(cells=(64, 32), motion_steps=6, motion_rounds=6)
SHORT = InterSettings(motion_steps=3, motion_rounds=3, iterations=24, rounded_iterations=9, progress=0.01)


def state_of(values: I8, densities: Densities | None = DENSITIES) -> MainState:
    """What a decoder has after a frame with these splats."""
    return MainState(WIDTH, HEIGHT, values, np.zeros(len(values), np.int64), Models(), densities)


def picture(values: I8) -> F4:
    objective = Objective(np.zeros((HEIGHT, WIDTH, 3)), threads=1)
    objective.loss(to_splats(values).to_array())
    return objective.picture()


@pytest.fixture
def values() -> I8:
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


def encoded(
    values: I8, target: F4, settings: InterSettings = SHORT, threads: int = 1, precision: Precision = "fast",
    densities: Densities | None = DENSITIES, lattice: tuple[int, int] = (2, 1),
) -> MainCodes:  # fmt: skip
    objective = Objective(target, threads=threads, precision=precision)
    sampled = SampledObjective(target, threads, precision=precision, down=lattice[0], right=lattice[1])
    frame = PFrame(
        state_of(values, densities), objective, sampled, picture(values), target, QUANTIZER, len(values)
    )  # fmt: skip
    return encode_inter(frame, settings)[0]


def anchors(values: I8) -> differences.Anchors:
    """Of splats that do not move, with the scale 1."""
    return differences.anchors_of(values, np.zeros((len(values), 2), np.int64), D, WIDTH * HEIGHT)._replace(scale=1.0)


def parameters_at(anchor: differences.Anchors, q: F8) -> F4:
    out, z = np.empty(q.shape, np.float32), np.empty(8)
    for i in range(len(q)):
        differences.put_value(anchor, i, q[i], z, out[i])
    return out


def after(values: I8, codes: MainCodes, densities: Densities | None = DENSITIES) -> MainState:
    """The state after a P-frame, by what a decoder reads."""
    s = Writer()
    written = frame_body(s, "P", state_of(values, densities), 1, 1000, codes).after
    read = frame_body(Reader(s.getvalue()), "P", state_of(values, densities), 1, 1000)
    assert read.codes == codes
    np.testing.assert_array_equal(read.after.values, written.values)
    return read.after


def error(values: I8, target: F4) -> float:
    return float(((picture(values) - target).astype(np.float64) ** 2).mean())


def test_no_differences_leave_the_splats_as_they_are(values: I8) -> None:
    parameters = parameters_at(anchors(values), np.zeros((len(values), 8)))
    np.testing.assert_allclose(parameters, to_splats(values).to_array(), rtol=HALF_A_UNIT)


def test_whole_differences_are_about_those_of_a_decoder(values: I8) -> None:
    q = np.random.default_rng(4).integers(-2, 3, (len(values), 8))
    decoded = parameters_of(add_differences(values, np.zeros((len(values), 2), np.int64), q, D))
    found = parameters_at(anchors(values), q.astype(np.float64))
    np.testing.assert_allclose(found[:, :2], decoded[:, :2], atol=1 / 512)
    np.testing.assert_allclose(found[:, [2, 4, 5, 6, 7]], decoded[:, [2, 4, 5, 6, 7]], rtol=HALF_A_UNIT, atol=1e-6)
    assert (np.abs(found[:, 3] - decoded[:, 3]) < 1.5 / 1024 * decoded[:, 4]).all()  # a decoder's S is a whole number


def test_gradients_by_differences_are_those_of_the_error(values: I8) -> None:
    rng = np.random.default_rng(1)
    anchor, q = anchors(values), rng.normal(0, 0.3, (len(values), 8))
    weights = rng.normal(0, 1, (len(values), 8)).astype(np.float32)  # of a loss that is linear in the parameters
    parameters, found = parameters_at(anchor, q), np.empty((len(values), 8))
    for i in range(len(q)):
        differences.put_slope(anchor, i, q[i], parameters[i], weights[i], found[i])
    for k in range(8):
        sides = [parameters_at(anchor, q + step * np.eye(8)[k]).astype(np.float64) for step in (0.05, -0.05)]
        wanted = ((sides[0] - sides[1]) * weights).sum(axis=1) / 0.1
        np.testing.assert_allclose(found[:, k], wanted, atol=2e-3 * np.abs(wanted).max())


@pytest.mark.parametrize("price", [0.0, 0.1, 0.3])
def test_idle_splats_are_those_that_a_proximal_step_leaves_as_they_are(values: I8, price: float) -> None:
    rng, count = np.random.default_rng(2), len(values)
    anchor, length, q = anchors(values), np.full(count, 0.2), np.zeros((count, 8))
    q[:5, 3] = 1
    parameters = parameters_at(anchor, q)
    gradient = rng.normal(0, 1, (count, 8)).astype(np.float32) * rng.uniform(0, 0.5, (count, 1)).astype(np.float32)
    before = parameters.copy()
    idle = differences.idle(anchor, differences.Iterate(q, q, parameters, length), gradient, price)
    np.testing.assert_array_equal(parameters, before)
    np.testing.assert_array_equal(q[5:], 0)
    after = differences.Iterate(q.copy(), q.copy(), parameters, length)
    differences.proximal_step(anchor, after, gradient, price)
    unchanged = (after.q == 0).all(axis=1)
    np.testing.assert_array_equal(idle[5:], unchanged[5:])
    assert not idle[:5].any()
    assert idle.any() or price == 0
    assert not unchanged.all()


def test_crowding_of_splats_alone_and_in_the_same_place(values: I8) -> None:
    parameters = to_splats(values).to_array()[:2].copy()
    parameters[1] = parameters[0]
    np.testing.assert_allclose(differences.crowding(parameters), 2)
    parameters[1, 0] += 1000
    np.testing.assert_array_equal(differences.crowding(parameters), 1)


def test_the_field_finds_a_shift_and_none_where_nothing_moves(values: I8) -> None:
    before, shifted = picture(values), values + np.array([600, -300, 0, 0, 0, 0, 0, 0])
    for target, wanted in ((picture(shifted), (9.375, -4.6875)), (before, (0, 0))):
        reference, unmoved = to_splats(values).to_array(), np.zeros((len(values), 2), np.int64)
        for down, right in LATTICES:
            sampled = SampledObjective(target, 1, down=down, right=right)
            step = math.sqrt(500 / BIT_PRICE)
            field = best_field(sampled, reference, unmoved, (before, target), None, FIELD_ONLY, step)
            assert (field.cell > 0) == (wanted != (0, 0))
            assert field.cell == 0 or np.abs(field.vectors - wanted).mean() < 2


@pytest.mark.parametrize("lattice", LATTICES)
def test_a_still_picture_needs_no_codes(values: I8, lattice: tuple[int, int]) -> None:
    codes = encoded(values, picture(values), lattice=lattice)
    assert codes.motion_cell == 0
    assert not codes.modes.any()
    assert not codes.differences.any()
    assert len(codes.new) == 0


def test_a_change_of_colour_is_followed_by_colour_alone(values: I8) -> None:
    changed = values.copy()
    changed[3, 5] += 6 * D
    codes = encoded(values, picture(changed))
    assert codes.differences[3, 5] > 3
    assert np.abs(np.delete(codes.differences, 3, axis=0)).sum() < np.abs(codes.differences[3]).sum()


def test_splats_that_the_picture_does_not_miss_are_removed(values: I8) -> None:
    target = picture(values)
    outside, colorless = values.copy(), values.copy()
    outside[5, 0] = 256 * 500
    colorless[6, 5:] = 0
    for changed, which in ((outside, 5), (colorless, 6)):
        codes = encoded(changed, picture(changed))
        assert np.flatnonzero(codes.modes == REMOVED).tolist() == [which]
        assert error(after(changed, codes).values, picture(changed)) < 1e-6
    codes = encoded(values, target)
    assert not (codes.modes == REMOVED).any()


def test_a_decoder_comes_as_close_as_the_new_picture_is_worth(values: I8) -> None:
    target = picture(values + np.array([100, 60, 30, -20, 10, 500, -300, 0]))
    codes = encoded(values, target)
    assert error(after(values, codes).values, target) < 0.2 * error(values, target)


def test_what_appears_gets_new_splats(values: I8) -> None:
    blob = np.array([[256 * 60, 256 * 30, 2000, 2000, 0, 16 * 900, 0, 16 * 200]])
    target = picture(np.concatenate([values, blob]))
    codes = encoded(values, target)
    assert len(codes.new) > 0
    new = intra_state(codes.new, D)
    assert np.abs(new[:, :2] - blob[0, :2]).sum(axis=1).min() < 3 * 256
    assert error(after(values, codes).values, target) < 0.2 * error(values, target)


@pytest.mark.parametrize("count", [0, 40])
def test_new_splats_have_densities_of_their_own_where_none_are_kept(values: I8, count: int) -> None:
    blob = np.array([[256 * 60, 256 * 30, 2000, 2000, 0, 16 * 900, 0, 16 * 200]])
    few = values[:count]
    codes = encoded(few, picture(np.concatenate([few, blob])), replace(SHORT, new_share=2.0), densities=None)
    assert len(codes.new) == 0 or codes.densities is not None
    assert len(codes.new) > 0 or count == 0  # the share is one of the clip's splats
    after(few, codes, densities=None)


def test_codes_of_new_splats_stay_within_their_limits() -> None:
    z = np.array([[50.0, 30.0, 4.0, 2.0, 9.0, 800.0, 20.0, 0.0]])
    codes = nearest_codes(z, D, WIDTH, HEIGHT, np.tile(np.array([-1, 1]), (3, 11, 1)))
    assert np.abs(codes.shapes).max() == 1


def test_candidates_lie_where_the_residual_is_and_promise_its_energy() -> None:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    blob = np.exp(-0.5 * ((x - 40) ** 2 + (y - 20) ** 2) / 4.0**2)
    residual = (0.3 * blob[..., None] * np.ones(3)).astype(np.float32)
    z = best_candidates(residual, (2.0, 4.0, 8.0), 100.0, 5)
    np.testing.assert_allclose(z[0, :2], (40.5, 20.5), atol=1.5)
    np.testing.assert_allclose((z[0, 5:] ** 2).sum(), ((255 * residual) ** 2).sum(), rtol=0.1)  # on a grid of 2 px
    assert len(best_candidates(residual, (4.0,), 1e9, 5)) == 0


@pytest.mark.parametrize("size", [0.5, 1.0, 2.3, 5.0, 9.0])
def test_the_colour_of_a_candidate_is_the_projection_of_the_residual(size: float) -> None:
    residual = np.random.default_rng(5).normal(0, 0.2, (HEIGHT, WIDTH, 3)).astype(np.float32)
    z = best_candidates(residual, (size,), 0.0, 1, threads=1)
    assert np.array_equal(best_candidates(residual, (size,), 0.0, 1, threads=3), z)
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    radius = math.ceil(CUTOFF * size)
    inside = (np.abs(x - z[0, 0]) <= radius) & (np.abs(y - z[0, 1]) <= radius)
    weights = inside * np.exp(-((x - z[0, 0]) ** 2 + (y - z[0, 1]) ** 2) / (2 * size**2)) / (math.sqrt(math.pi) * size)
    opponent = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]]) / np.sqrt([[3], [2], [6]])
    expected = opponent @ (255 * np.einsum("yx,yxc->c", weights, residual.astype(np.float64)))
    np.testing.assert_allclose(z[0, 5:], expected, rtol=1e-10)


@pytest.mark.parametrize("total", [300, 768])
def test_a_frame_of_noise_with_up_to_a_splat_a_pixel_has_codes(total: int) -> None:
    rng = np.random.default_rng(0)
    noise = rng.random((2, 24, 32, 3), np.float32)
    state = MainState.initial(32, 24)
    intra = encode_intra(Target(noise[0]), total, rng, 24, IntraSettings())
    state = frame_body(Writer(), "I", state, 1, 1 << 16, intra).after
    objective, sampled = Objective(noise[1]), SampledObjective(noise[1])
    frame = PFrame(state, objective, sampled, noise[0], noise[1], 24, total)
    codes, _ = encode_inter(frame, InterSettings())
    after = frame_body(Writer(), "P", state, 1, 1 << 16, codes).after
    assert objective.loss(after.splats.to_array()) < objective.loss(state.splats.to_array()) / 2


def test_codes_are_the_same_for_any_number_of_threads(values: I8) -> None:
    changed = values + np.array([100, 60, 30, 0, 0, 200, 0, 0])
    one, two = (encoded(values, picture(changed), threads=n, precision="deterministic") for n in (1, 2))
    assert one.differences.any()
    assert one == two
