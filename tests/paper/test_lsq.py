"""LSQ+: codes, values and straight-through gradients against the definitions, and the checks of arguments."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gsvc_base.errors import UsageError
from gsvc_ref import spec
from gsvc_ref.paper import lsq, lsq_dequantize, lsq_gradients, lsq_quantize

values = st.floats(-100, 100, width=32)
scales = st.floats(0.0009765625, 50, width=32)


@st.composite
def channels(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """x (N, 3), scale (3,), offset (3,), bits."""
    x = draw(hnp.arrays(np.float32, st.tuples(st.integers(0, 12), st.just(3)), elements=values))
    scale = draw(hnp.arrays(np.float32, 3, elements=scales))
    offset = draw(hnp.arrays(np.float32, 3, elements=values))
    return x, scale, offset, draw(st.integers(1, 16))


def test_codes_round_half_to_even() -> None:
    x = np.array([[0.5], [1.5], [2.5], [2.4375], [2.5625]], np.float32)
    assert lsq_quantize(x, [1], [0], 6).ravel().tolist() == [0, 2, 2, 2, 3]


def test_codes_clamp_at_both_ends() -> None:
    x = np.array([[-1e30], [-1.0], [63.4], [63.6], [1e30]], np.float32)
    assert lsq_quantize(x, [1], [0], 6).ravel().tolist() == [0, 0, 63, 63, 63]


def test_a_difference_beyond_binary32_clamps() -> None:
    x = np.array([[3e38], [-3e38]], np.float32)
    assert lsq_quantize(x, [1e-6], [-3e38], 6).ravel().tolist() == [63, 0]
    assert lsq_gradients(x, [1e-6], [-3e38], 6, np.ones((2, 1), np.float32)).grad_x.ravel().tolist() == [0, 1]


@given(channels())
def test_fast_functions_equal_the_definitions_bit_for_bit(case: tuple[np.ndarray, np.ndarray, np.ndarray, int]) -> None:
    x, scale, offset, bits = case
    p = lsq.largest_code(bits)
    codes = lsq_quantize(x, scale, offset, bits)
    assert np.array_equal(codes, spec.lsq_quantize(x, scale, offset, bits)["codes"])
    restored = lsq_dequantize(codes, scale, offset)
    assert restored.tobytes() == spec.lsq_dequantize(codes, scale, offset)["values"].tobytes()
    grad_output = np.cos(np.arange(x.size, dtype=np.float32)).reshape(x.shape)
    grad = lsq_gradients(x, scale, offset, bits, grad_output)
    grad_x, grad_s, grad_beta = lsq.gradients_plain(x, scale, offset, p, grad_output)
    assert grad.grad_x.tobytes() == grad_x.tobytes()
    assert grad.grad_scale.tobytes() == grad_s.astype(np.float32).tobytes()
    assert grad.grad_offset.tobytes() == grad_beta.astype(np.float32).tobytes()


@given(channels())
def test_values_inside_the_range_move_by_at_most_half_a_step(
    case: tuple[np.ndarray, np.ndarray, np.ndarray, int],
) -> None:
    x, scale, offset, bits = case
    codes = lsq_quantize(x, scale, offset, bits)
    wide = x.astype(np.float64)
    inside = (wide >= offset) & (wide <= offset + lsq.largest_code(bits) * scale.astype(np.float64))
    error = np.abs(lsq_dequantize(codes, scale, offset) - wide)
    rounding = 2.0**-22 * (np.abs(wide) + np.abs(offset) + scale)  # of the three binary32 operations
    assert (error <= scale / 2 + rounding)[inside].all()


@given(
    st.lists(st.integers(0, 65535), max_size=20),
    st.floats(2.0**-20, 2.0**20, width=32),
    values,
)
def test_every_code_survives_the_round_trip_where_steps_are_resolved(
    codes: list[int], scale: float, offset: float
) -> None:
    offset = float(np.float32(round(offset / scale) % 512 * scale))  # keeps q s + beta within 17 bits of s
    q = np.array(codes, np.uint16).reshape(-1, 1)
    restored = lsq_dequantize(q, [scale], [offset])
    assert np.array_equal(lsq_quantize(restored, [scale], [offset], 16), q)


def test_dequantisation_is_two_roundings_not_a_fused_one() -> None:
    rng = np.random.default_rng(3)
    scale, offset = rng.uniform(0.1, 1, 64).astype(np.float32), rng.uniform(-40, 0, 64).astype(np.float32)
    codes = rng.integers(0, 64, (100, 64)).astype(np.uint16)
    product = (codes.astype(np.float64) * scale).astype(np.float32)  # exact in binary64, then rounded once
    twice = (product.astype(np.float64) + offset).astype(np.float32)
    fused = (codes.astype(np.float64) * scale + offset).astype(np.float32)
    assert lsq_dequantize(codes, scale, offset).tobytes() == twice.tobytes()
    assert (twice != fused).any()  # so the case tells them apart


def test_gradients_by_hand() -> None:
    # t = -0.5 (below), 0 (bound: inside), 1.25, 3 (bound: inside), 4 (above); p = 3.
    x = np.array([[0.0], [1.0], [3.5], [7.0], [9.0]], np.float32)
    grad_output = np.array([[1.0], [10.0], [100.0], [1000.0], [10000.0]], np.float32)
    grad = lsq_gradients(x, [2], [1], 2, grad_output)
    assert grad.grad_x.ravel().tolist() == [0, 10, 100, 1000, 0]
    assert grad.grad_scale.tolist() == [100 * (1 - 1.25) + 10000 * 3]
    assert grad.grad_offset.tolist() == [1 + 10000]
    scaled = lsq_gradients(x, [2], [1], 2, grad_output, gradient_scale=True)
    assert scaled.grad_x.tolist() == grad.grad_x.tolist()
    assert scaled.grad_scale.tolist() == [np.float32((100 * (1 - 1.25) + 10000 * 3) / np.sqrt(5 * 3))]


@given(channels())
def test_gradients_equal_autograd_through_a_straight_through_round(
    case: tuple[np.ndarray, np.ndarray, np.ndarray, int],
) -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is the peer that differentiates the straight-through round")
    x, scale, offset, bits = case
    p = lsq.largest_code(bits)
    leaves = [torch.tensor(part, dtype=torch.float64, requires_grad=True) for part in (x, scale, offset)]
    t = (leaves[0] - leaves[2]) / leaves[1]
    steps = t.detach().numpy()
    # Within a binary32 rounding of a bound or a tie, the two may decide differently: no gradient there.
    undecided = (np.abs(steps) < 0.05) | (np.abs(steps - p) < 0.05) | (np.abs(np.remainder(steps, 1.0) - 0.5) < 0.05)
    grad_output = np.where(undecided, 0.0, np.sin(1.0 + np.arange(x.size)).reshape(x.shape))
    clamped = t.clamp(0, p)
    rounded = clamped + (clamped.round() - clamped).detach()
    (rounded * leaves[1] + leaves[2]).backward(torch.tensor(grad_output))
    ours = lsq_gradients(x, scale, offset, bits, grad_output)
    unit = 2.0**-21 * (np.abs(grad_output).sum() + 2.0**-40)
    for mine, leaf, slope in zip(ours, leaves, (1.0, p + np.abs(steps).max(initial=0.0), 1.0), strict=True):
        assert np.abs(mine - leaf.grad.numpy()).max(initial=0.0) <= unit * slope


@pytest.mark.parametrize("bits", [0, 17, -1])
def test_bits_out_of_range_are_refused(bits: int) -> None:
    with pytest.raises(UsageError, match=r"1\.\.16"):
        lsq_quantize(np.zeros((1, 1)), [1], [0], bits)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_refused(bad: float) -> None:
    with pytest.raises(UsageError, match="NaN or infinite"):
        lsq_quantize([[0.0], [bad]], [1], [0], 6)
    with pytest.raises(UsageError, match="NaN or infinite"):
        lsq_gradients([[0.0], [bad]], [1], [0], 6, [[1.0], [1.0]])
    with pytest.raises(UsageError, match="finite"):
        lsq_dequantize(np.zeros((1, 1), np.uint8), [1], [bad])


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_scales_that_are_not_positive_are_refused(scale: float) -> None:
    with pytest.raises(UsageError, match="positive"):
        lsq_dequantize(np.zeros((1, 1), np.uint8), [scale], [0])


def test_values_that_overflow_are_refused() -> None:
    with pytest.raises(UsageError, match="overflows"):
        lsq_dequantize(np.array([[0], [255]], np.uint8), [3e37], [0])


def test_shapes_and_types_that_do_not_fit_are_refused() -> None:
    with pytest.raises(UsageError, match="uint16"):
        lsq_dequantize(np.zeros((1, 1), np.int64), [1], [0])
    with pytest.raises(UsageError, match=r"both must be \(3,\)"):
        lsq_quantize(np.zeros((2, 3)), [1, 1], [0, 0], 6)
    with pytest.raises(UsageError, match=r"\(N, channels\)"):
        lsq_quantize(np.zeros(3), [1], [0], 6)
    with pytest.raises(UsageError, match="must be equal"):
        lsq_gradients(np.zeros((2, 1)), [1], [0], 6, np.zeros((1, 1)))


def test_no_splats_give_no_codes_and_zero_gradients() -> None:
    none = np.empty((0, 3), np.float32)
    assert lsq_quantize(none, [1] * 3, [0] * 3, 6).shape == (0, 3)
    grad = lsq_gradients(none, [1] * 3, [0] * 3, 6, none, gradient_scale=True)
    assert grad.grad_scale.tolist() == [0, 0, 0]
    assert grad.grad_offset.tolist() == [0, 0, 0]
