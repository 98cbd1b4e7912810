import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_ref.metrics import mse, psnr, psnr_from_mse


def grey(value, dtype=np.uint8, height=3, width=5):
    return np.full((height, width, 3), value, dtype)


def test_one_step_everywhere_is_48_decibels():
    assert mse(grey(100), grey(101), 255) == 1.0
    assert psnr(grey(100), grey(101), 255) == pytest.approx(20 * math.log10(255), rel=1e-15)


def test_one_sample_of_45_off_by_3():
    a = grey(7)
    b = a.copy()
    b[1, 2, 0] += 3
    assert mse(a, b, 255) == 9 / 45


def test_black_against_white_is_0_decibels():
    assert psnr(grey(0), grey(255), 255) == 0.0


@pytest.mark.parametrize(("peak", "dtype"), [(1023, np.uint16), (65535, np.uint16), (255, np.uint16)])
def test_the_largest_error_of_any_depth_does_not_overflow(peak, dtype):
    a, b = grey(0, dtype, 64, 64), grey(peak, dtype, 64, 64)
    assert mse(a, b, peak) == float(peak) ** 2
    assert psnr(a, b, peak) == pytest.approx(0, abs=1e-12)


def test_identical_frames_have_infinite_psnr():
    assert psnr(grey(9), grey(9), 255) == math.inf


def test_u1_and_u2_frames_of_the_same_samples_agree():
    a, b = grey(10), grey(12)
    assert psnr(a, b.astype(np.uint16), 255) == psnr(a, b, 255)


@given(st.integers(0, 2**32 - 1), st.sampled_from([(255, np.uint8), (1023, np.uint16), (65535, np.uint16)]))
def test_equals_the_definition_in_rationals_and_is_symmetric(seed, depth):
    peak, dtype = depth
    rng = np.random.default_rng(seed)
    a, b = rng.integers(0, peak, (2, 4, 3, 3), dtype=dtype, endpoint=True)
    by_hand = sum((int(x) - int(y)) ** 2 for x, y in zip(a.flat, b.flat, strict=True))
    assert mse(a, b, peak) == by_hand / 36
    assert psnr(a, b, peak) == psnr(b, a, peak)


@given(st.floats(0, 1e10), st.floats(0, 1e10))
def test_more_error_never_raises_the_psnr(one, other):
    low, high = sorted((one, other))
    assert psnr_from_mse(low, 255) >= psnr_from_mse(high, 255)


@pytest.mark.parametrize("bad", [-1.0, math.nan])
def test_an_error_that_is_none_is_refused(bad):
    with pytest.raises(UsageError, match="0 or more"):
        psnr_from_mse(bad, 255)


@pytest.mark.parametrize(
    ("a", "b", "peak", "words"),
    [
        (grey(1), grey(1, height=4), 255, "one size"),
        (grey(1).astype(np.float32), grey(1), 255, r"first frame .*float32.*uint8 or uint16"),
        (grey(1), grey(1)[..., :2], 255, r"second frame has shape \(3, 5, 2\)"),
        (grey(1)[..., 0], grey(1), 255, r"first frame has shape \(3, 5\)"),
        (grey(1)[:0], grey(1)[:0], 255, "not empty"),
        (grey(1), grey(200), 127, "second frame holds the value 200, above the stated peak 127"),
        (grey(0), grey(0), 0, "peak is 0"),
        (grey(0), grey(0), 65536, "peak is 65536"),
    ],
)
def test_frames_that_do_not_fit_are_refused(a, b, peak, words):
    with pytest.raises(UsageError, match=words):
        psnr(a, b, peak)
