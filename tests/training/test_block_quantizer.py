"""The quantisers of a block: codes that decode to what fine-tuning sees, masks, gradients, and learning."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.encoder import Settings
from gsvc_ref.paper import FrameCodes, Kept, RvqSettings, State, lsq_gradients, reconstruct, rvq
from gsvc_ref.training import BlockSettings
from gsvc_ref.training.block_quantizer import BlockQuantizer, ForwardResult

WIDTH, HEIGHT = 40, 30
SIZE = np.array([WIDTH / 2, HEIGHT / 2], np.float32)
QUICK = Settings.quick(profile="paper")
INTRA, INTER = QUICK.intra.quantizer, QUICK.inter.quantizer
PAPER = Settings.paper().intra.quantizer
COLUMNS = (slice(0, 2), slice(2, 5), slice(5, 8))


def parameters(count=50, seed=0) -> np.ndarray:
    """(count, 8) f4 of ordinary splats."""
    rng = np.random.default_rng(seed)
    values = np.empty((count, 8), np.float32)
    values[:, :2] = rng.random((count, 2)) * [WIDTH, HEIGHT]
    values[:, 2:5] = rng.random((count, 3)) * [3, 2, 3] + [0.5, -1, 0.5]
    values[:, 5:8] = rng.normal(0.1, 0.3, (count, 3))
    return values


def moved(values: np.ndarray, seed=1) -> np.ndarray:
    """The same splats a frame later."""
    rng = np.random.default_rng(seed)
    change = rng.normal(0, 1, values.shape) * [0.5, 0.5, 0.1, 0.1, 0.1, 0.05, 0.05, 0.05]
    return (values + change).astype(np.float32)


def intra_block(values, chosen=INTRA, kept=Kept(), seed=0) -> BlockQuantizer:  # noqa: B008
    return BlockQuantizer(values, None, None, SIZE, chosen, np.random.default_rng(seed), kept)


def inter_block(values, reference, active, chosen=INTER, kept=Kept(), seed=0) -> BlockQuantizer:  # noqa: B008
    return BlockQuantizer(values, reference, active, SIZE, chosen, np.random.default_rng(seed), kept)


def decoded_intra(block) -> np.ndarray:
    return reconstruct(FrameCodes.intra_frame(block), State.initial(WIDTH, HEIGHT)).splats.to_array()


def decoded_inter(block, reference, kept=Kept()) -> np.ndarray:  # noqa: B008
    state = State(WIDTH, HEIGHT, Splats.from_array(reference), inter=kept)
    codes = FrameCodes.predicted_frame(np.ones(len(reference), np.bool_), block)
    return reconstruct(codes, state).splats.to_array()


def forward(quantizer: BlockQuantizer, values: np.ndarray) -> tuple[np.ndarray, ForwardResult]:
    """The values that will be decoded, and the result that goes backward."""
    decoded = np.full_like(values, np.nan)
    return decoded, quantizer.forward(values, decoded)


def plain_gradients(quantizer: BlockQuantizer, values: np.ndarray, gradient: np.ndarray) -> tuple:
    """What `backward` does, attribute by attribute: its result, and the gradients of scale and offset, (2, 3) f4."""
    difference, result = quantizer.differences(values), gradient.copy()
    lsq, books = quantizer.lsq, quantizer.codebooks
    grad = lsq_gradients(difference[:, 2:5], lsq.scale, lsq.offset, quantizer.settings.cholesky_bits, gradient[:, 2:5])
    result[:, 2:5] = grad.grad_x
    flat = rvq.flat(books)
    pull = rvq.commitment(difference[:, 5:8], rvq.rvq_assign(difference[:, 5:8], *flat), *flat).grad_x
    result[:, 5:8] += np.float32(quantizer.settings.commitment) * pull
    mask = np.repeat(quantizer.active, [2, 3, 3], axis=1)
    return np.where(mask, result, np.float32(0)).astype(np.float32), np.stack([grad.grad_scale, grad.grad_offset])


def masks(count: int) -> st.SearchStrategy[np.ndarray]:
    bits = st.lists(st.booleans(), min_size=3 * count, max_size=3 * count)
    return bits.map(lambda chosen: np.array(chosen, np.bool_).reshape(count, 3))


def test_values_come_back_near():
    values = parameters(200)
    back = decoded_intra(intra_block(values).codes(values))
    assert np.abs(back - values)[:, :2].max() <= 0.05 / 2 + 0.01  # steps of at most 0.05 px, and binary16
    assert np.abs(back - values)[:, 2:5].max() <= 3 / 255
    assert np.sqrt(np.square(back - values)[:, 5:8].mean()) < 0.05
    paper = decoded_intra(intra_block(values, PAPER).codes(values))
    assert np.abs(paper - values)[:, :2].max() <= 0.01  # all bits of binary16
    assert np.abs(paper - values)[:, 2:5].max() <= 3 / 63


def test_differences_come_back_near():
    reference = parameters(200)
    values = moved(reference)
    active = np.ones((200, 3), np.bool_)
    back = decoded_inter(inter_block(values, reference, active).codes(values), reference)
    assert np.abs(back - values)[:, :2].max() <= 0.2 / 2 + 0.01
    assert np.abs(back - values)[:, 2:5].max() <= 0.14 / 2 + 1e-5
    assert np.sqrt(np.square(back - values)[:, 5:8].mean()) < 0.05


@given(masks(12))
@settings(max_examples=50)
def test_what_is_inactive_keeps_the_bits_of_the_reference(active):
    reference = parameters(12)
    values = moved(reference)
    block = inter_block(values, reference, active).codes(values)
    back = decoded_inter(block, reference)
    for part, columns in enumerate(COLUMNS):
        static = ~active[:, part]
        assert back[static, columns].tobytes() == reference[static, columns].tobytes()
    present = (block.positions is not None, block.cholesky is not None, block.colors is not None)
    assert present == tuple(active.any(axis=0))
    assert (block.quantizer is not None) == present[1]
    assert (block.codebooks is not None) == present[2]


def test_learning_moves_no_inactive_attribute():
    reference = parameters(12)
    values = moved(reference)
    active = np.zeros((12, 3), np.bool_)
    active[:4] = True
    quantizer = inter_block(values, reference, active)
    rng = np.random.default_rng(3)
    for _ in range(20):
        back, done = forward(quantizer, values)
        assert back[4:].tobytes() == reference[4:].tobytes()
        gradient = quantizer.backward(done, rng.normal(0, 1, (12, 8)).astype(np.float32))
        assert not gradient[4:].any()
        quantizer.learn(done, 1.0)
        values -= np.float32(0.01) * gradient


@pytest.mark.parametrize("chosen", [INTRA, PAPER, replace(INTRA, commitment=0.0)], ids=["quick", "paper", "plain"])
def test_the_gradient_goes_straight_through(chosen):
    values = parameters(60)
    quantizer = intra_block(values, chosen)
    values[7, 2:5] = (99, -99, 99)  # far outside of what the codes reach
    gradient = np.random.default_rng(0).normal(0, 1, (60, 8)).astype(np.float32)
    kept = gradient.copy()
    back = quantizer.backward(forward(quantizer, values)[1], gradient)
    assert back.shape == (60, 8)
    assert back.dtype == np.float32
    assert np.array_equal(gradient, kept)
    assert np.array_equal(back[:, :2], gradient[:, :2])
    largest = (1 << chosen.cholesky_bits) - 1
    t = (values[:, 2:5] - quantizer.lsq.offset) / quantizer.lsq.scale
    inside = (t >= 0) & (t <= largest)
    assert not inside[7].any()
    assert np.array_equal(back[:, 2:5], np.where(inside, gradient[:, 2:5], 0))
    pull = back[:, 5:8] - gradient[:, 5:8]
    if chosen.commitment:
        assert pull.any()
    else:
        assert not pull.any()


def test_commitment_pulls_a_colour_to_its_codewords():
    """With one stage the pull is 2 (c - C[i]) / (3 N)."""
    values = parameters(30)
    quantizer = intra_block(values, replace(INTRA, colors=RvqSettings((4,)), commitment=0.5))
    block = quantizer.codes(values)
    back = quantizer.backward(forward(quantizer, values)[1], np.zeros((30, 8), np.float32))
    error = values[:, 5:8] - quantizer.codebooks[0][block.colors[:, 0]]
    np.testing.assert_allclose(back[:, 5:8], 0.5 * 2 * error / 90, rtol=1e-5)
    assert not back[:, :5].any()


def test_learning_makes_a_random_quantiser_better():
    values = parameters(300)
    quantizer = intra_block(values, replace(INTRA, cholesky_bits=3, quantizer_rate=0.05))
    start = quantizer.lsq
    quantizer.lsq = type(start)(start.scale * 3, start.offset - 1)
    errors = []
    for _ in range(60):
        back, done = forward(quantizer, values)
        errors.append(np.square(back - values)[:, 2:5].mean())
        quantizer.backward(done, 2 * (back - values))
        quantizer.learn(done, 1.0)
    assert errors[-1] < 0.5 * errors[0]
    assert (quantizer.lsq.scale > 0).all()


def test_codebooks_follow_the_colours():
    values = parameters(200)
    quantizer = intra_block(values, replace(INTRA, colors=RvqSettings((8,))))
    later = values.copy()
    later[:, 5:8] += 1
    before = quantizer.color_error(later)
    for _ in range(30):
        quantizer.learn(forward(quantizer, later)[1], 1.0)
    assert quantizer.color_error(later) < 0.1 * before


def test_what_the_decoder_keeps_is_used_and_not_sent_again():
    values = parameters(40)
    first = intra_block(values)
    block = first.codes(values)
    kept = Kept().after(block)
    other = parameters(25, seed=9)
    again = intra_block(other, kept=kept)
    for _ in range(3):
        codes = again.codes(other)
        assert codes.quantizer is None
        assert codes.codebooks is None
        state = State(WIDTH, HEIGHT, Splats.empty(), intra=kept)
        frame = FrameCodes.predicted_frame(np.zeros(0, np.bool_), None, codes)
        assert np.isfinite(reconstruct(frame, state).splats.to_array()).all()
        done = forward(again, other)[1]
        again.backward(done, np.ones((25, 8), np.float32))
        again.learn(done, 1.0)
    assert again.quantizer == block.quantizer
    assert all(np.array_equal(a, b) for a, b in zip(again.codebooks, block.codebooks, strict=True))


CHOICES = st.builds(
    BlockSettings,
    st.sampled_from((None, 0.05, 4.0)), st.integers(1, 12), st.sampled_from((None, 0.1)),
    st.builds(
        RvqSettings, st.lists(st.integers(1, 40), min_size=1, max_size=4).map(tuple), zero_codeword=st.booleans()
    ),
    st.booleans(), st.sampled_from((0.0, 1.0)), st.sampled_from((0.0, 0.1)),
)  # fmt: skip


@given(CHOICES, st.integers(1, 60), st.booleans(), st.integers(0, 999))
@settings(max_examples=30)
def test_a_pass_is_what_codes_decode_to_and_its_gradient_the_plain_one(chosen, count, predicted, seed):
    rng = np.random.default_rng(seed)
    reference, values = parameters(count, seed), parameters(count, seed + 1)
    if predicted:
        quantizer = inter_block(moved(reference, seed), reference, rng.random((count, 3)) < rng.random(3), chosen)
    else:
        quantizer = intra_block(reference, chosen)
    for _ in range(4):
        back, done = forward(quantizer, values)
        codes = quantizer.codes(values)
        plain = decoded_inter(codes, reference) if predicted else decoded_intra(codes)
        assert back.tobytes() == plain.tobytes()
        gradient = rng.normal(0, 1, (count, 8)).astype(np.float32)
        by_values, by_quantizer = plain_gradients(quantizer, values, gradient)
        assert np.array_equal(quantizer.backward(done, gradient), by_values)
        assert np.array_equal(quantizer._lsq_gradient, by_quantizer * quantizer.lsq.scale)
        quantizer.learn(done, 1.0)
        values -= np.float32(0.02) * by_values


def test_what_was_learned_can_be_had_again():
    values = parameters(40)
    quantizer = intra_block(values)
    early, first = quantizer.learned, forward(quantizer, values)[0]
    for _ in range(5):
        done = forward(quantizer, values)[1]
        quantizer.backward(done, np.ones((40, 8), np.float32))
        quantizer.learn(done, 1.0)
    assert not np.array_equal(forward(quantizer, values)[0], first)
    quantizer.learned = early
    assert np.array_equal(forward(quantizer, values)[0], first)
    assert np.array_equal(decoded_intra(quantizer.codes(values)), first)


def test_a_fixed_step_is_not_learned_and_has_an_exact_zero():
    reference = parameters(20)
    values = moved(reference)
    quantizer = inter_block(values, reference, np.ones((20, 3), np.bool_), replace(INTER, cholesky_step=0.25))
    done = forward(quantizer, values)[1]
    quantizer.backward(done, np.ones((20, 8), np.float32))
    quantizer.learn(done, 1.0)
    assert (quantizer.lsq.scale == 0.25).all()
    zero = quantizer.codes(reference)
    assert decoded_inter(zero, reference).tobytes() == reference.tobytes()


@given(
    st.integers(1, 6), st.integers(1, 12), st.integers(1, 8), st.sampled_from((1, 2, 16, 100)),
    st.sampled_from((None, 0.05, 4.0)), st.booleans(), st.integers(0, 99),
)  # fmt: skip
@settings(max_examples=30)
def test_any_settings_make_legal_codes(count, bits, stages, codewords, step, weigh, seed):
    chosen = BlockSettings(step, bits, None, RvqSettings((codewords,) * stages), weigh)
    values = parameters(count, seed)
    block = intra_block(values, chosen, seed=seed).codes(values)
    assert block.cholesky.max() < 1 << bits
    assert block.colors.shape == (count, stages)
    assert block.colors.max() < codewords
    assert np.isfinite(decoded_intra(block)).all()


@pytest.mark.parametrize("place", [-1e30, -1e6, 1e6, 1e30])
def test_positions_far_out_stay_finite(place):
    values = parameters(4)
    quantizer = intra_block(values)
    values[2, :2] = place
    back = decoded_intra(quantizer.codes(values))
    assert np.isfinite(back).all()
    assert abs(back[2, 0]) > 5e5
    reference = parameters(4)
    difference = inter_block(values, reference, np.ones((4, 3), np.bool_))
    assert np.isfinite(decoded_inter(difference.codes(values), reference)).all()


def test_a_step_of_positions_is_a_power_of_two_of_at_most_so_many_pixels():
    values = parameters(300)
    for step in (0.05, 0.5, 3.0):
        back = decoded_intra(intra_block(values, replace(INTRA, position_step=step)).codes(values))
        grid = 2.0 ** np.floor(np.log2(step / SIZE.max()))  # of the normalised position
        assert grid * SIZE.max() <= step
        normalised = back[:, :2].astype(np.float64) / SIZE - 1
        np.testing.assert_allclose(normalised / grid, np.rint(normalised / grid), atol=1e-3)


@pytest.mark.parametrize(
    "wrong",
    [
        {"cholesky_bits": 0},
        {"cholesky_bits": 13},
        {"colors": RvqSettings((4,) * 9)},
        {"colors": RvqSettings((4, 1025))},
    ],
)
def test_settings_beyond_the_format_are_refused(wrong):
    with pytest.raises(UsageError, match="must be"):
        BlockSettings(**wrong)


def test_stages_and_codewords_can_be_changed_one_by_one():
    base = replace(INTRA, colors=RvqSettings((16, 4), decay=0.5))
    assert base.with_() == base
    assert base.with_(color_stages=3).colors.codewords == (16, 16, 16)
    assert base.with_(color_stages=2).colors.codewords == (16, 16)
    assert base.with_(color_codewords=2).colors.codewords == (2, 2)
    assert base.with_(color_stages=1, color_codewords=64).colors == RvqSettings((64,), decay=0.5)
    changed = base.with_(colors=RvqSettings((8,)), color_stages=2, cholesky_bits=5)
    assert (changed.colors.codewords, changed.cholesky_bits) == ((8, 8), 5)
