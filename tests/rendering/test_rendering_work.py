"""Rendering work (spec.md section 5): the kernel against spec.md, boxes by hand, and parameters of any size."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.splats import Splats
from gsvc_ref import spec
from gsvc_ref.bitstream.work import rendering_work
from gsvc_ref.testing import splat_sets


def splat(x: float, y: float, l11: float, l21: float, l22: float) -> Splats:
    return Splats.from_array([[x, y, l11, l21, l22, 1, 1, 1]])


@given(splat_sets(64, 48, hard=True), st.sampled_from(((64, 48), (1, 1), (65535, 3))))
def test_kernel_is_definition(splats: Splats, size: tuple[int, int]) -> None:
    work = rendering_work(splats, *size)
    assert work == spec.rendering_work(splats.to_array(), *size)["work"]
    assert 0 <= work <= len(splats) * size[0] * size[1]


@pytest.mark.parametrize(
    ("parameters", "work"),
    [
        ((5, 5, 1, 0, 1), 8 * 8),  # 5 - 3.33 = 1.67 to 5 + 3.33 = 8.33: pixels 1 to 8
        ((5, 5, 1, -1, 1), 8 * 12),  # rows 5 -+ 6.66: -1.66 to 11.66, cut to 0 .. 11
        ((0, 0, 1, 0, 1), 4 * 4),
        ((-4, 5, 1, 0, 1), 0),
        ((24, 5, 1, 0, 1), 0),
        ((5, 5, 2.0**-126, 0, 2.0**-126), 0),  # at a corner of pixels, the box is empty
        ((5.5, 5.5, 2.0**-126, 0, 2.0**-126), 1),
        ((5.5, 5.5, 2.0**-127, 0, 1), 0),
        ((5.5, 5.5, 1, 0, 0), 0),
        ((5.5, 5.5, -1, 0, 1), 0),
        ((5.5, 5.5, 3e38, -3e38, 3e38), 20 * 16),
        ((3e38, 5.5, 3e38, 0, 3e38), 20 * 16),
        ((3e38, 5.5, 1, 0, 3e38), 0),
    ],
)
def test_boxes(parameters: tuple[float, float, float, float, float], work: int) -> None:
    assert rendering_work(splat(*parameters), 20, 16) == work


def test_empty_and_sums() -> None:
    assert rendering_work(Splats.empty(), 20, 16) == 0
    one = splat(5, 5, 1, 0, 1)
    assert rendering_work(one.append(one), 20, 16) == 128


def test_the_largest_frame_is_counted_exactly() -> None:
    count = 1000
    splats = Splats.from_array(np.tile(splat(0, 0, 1e30, 0, 1e30).to_array(), (count, 1)))
    assert rendering_work(splats, 8191, 8191) == count * 8191 * 8191
