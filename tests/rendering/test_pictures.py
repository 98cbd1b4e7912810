"""Rounding pictures to frames."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.rendering import Renderer, to_frame, to_frame_deterministic


def gray(*values, dtype=np.float64):
    return np.repeat(np.array(values, dtype), 3).reshape(1, -1, 3)


def test_clamps_scales_and_rounds_half_to_even():
    frame = to_frame(gray(-1.0, 0.0, 0.5 / 255, 1.5 / 255, 2.5 / 255, 1.0, 7.0), 8)
    assert frame.dtype == np.uint8
    assert frame[0, :, 0].tolist() == [0, 0, 0, 2, 2, 255, 255]


@pytest.mark.parametrize("bit_depth", range(9, 17))
def test_more_than_eight_bits(bit_depth):
    peak = 2**bit_depth - 1
    frame = to_frame(gray(0.0, 1 / peak, 1.0, 2.0, dtype=np.float32), bit_depth)
    assert frame.dtype == np.uint16
    assert frame[0, :, 0].tolist() == [0, 1, peak, peak]


@given(st.integers(8, 16), st.integers(0, 2**16 - 1))
def test_every_code_survives(bit_depth, code):
    peak = 2**bit_depth - 1
    code %= peak + 1
    for dtype in (np.float32, np.float64):
        assert to_frame(gray(code / peak, dtype=dtype), bit_depth)[0, 0].tolist() == [code] * 3


@pytest.mark.parametrize(
    ("picture", "message"),
    [
        (np.zeros((4, 5)), "must be \\(H, W, 3\\)"),
        (np.zeros((4, 5, 4)), "must be \\(H, W, 3\\)"),
        (np.zeros((4, 5, 3), np.uint8), "must be float32 or float64"),
        (np.full((1, 1, 3), np.nan), "NaN"),
    ],
)
def test_what_is_no_picture_is_refused(picture, message):
    with pytest.raises(UsageError, match=message):
        to_frame(picture, 8)


@pytest.mark.parametrize("bit_depth", [0, 7, 17])
def test_a_wrong_bit_depth_is_refused(bit_depth):
    with pytest.raises(UsageError, match="must be 8 to 16"):
        to_frame(np.zeros((1, 1, 3)), bit_depth)


def test_the_deterministic_frame_rounds_in_binary32_and_takes_no_number_for_black():
    sums = gray(-1.0, np.nan, 0.5 / 255, 1.5 / 255, 1.0, np.inf, -np.inf, dtype=np.float32)
    frame = to_frame_deterministic(sums, 8)
    assert frame.dtype == np.uint8
    assert frame[0, :, 0].tolist() == [0, 0, *np.rint(sums[0, 2:4, 0] * np.float32(255)), 255, 255, 0]
    with pytest.raises(UsageError, match="must be 8 to 16"):
        to_frame_deterministic(sums, 7)
    with pytest.raises(UsageError, match="must be \\(H, W, 3\\)"):
        to_frame_deterministic(sums[0], 8)


@pytest.mark.parametrize("bit_depth", [8, 10, 16])
def test_the_deterministic_frame_is_what_the_renderer_writes(bit_depth):
    rng = np.random.default_rng(bit_depth)
    splats = Splats.from_array(
        np.concatenate([rng.uniform(0, 37, (20, 2)), rng.uniform(1, 9, (20, 3)), rng.uniform(-1, 2, (20, 3))], axis=1)
    )
    renderer = Renderer(37, 21, precision="deterministic", threads=1)
    sums = renderer.picture(splats, clamp=False)
    assert to_frame_deterministic(sums, bit_depth).tobytes() == renderer.frame(splats, bit_depth).tobytes()
