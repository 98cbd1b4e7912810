"""A scale under a pull without end, and codebooks that are updated thousands of times."""

import numpy as np

from gsvc_ref.paper.lsq_parameters import SCALE_FLOOR
from tests.hard_cases.long_quantizers import DOWN, RATE, averages, scales


def test_a_scale_never_crosses_zero_and_comes_back():
    path = scales()
    assert np.isfinite(path).all()
    assert path.min() == SCALE_FLOOR
    assert np.all(path[3500 : DOWN + 1] == SCALE_FLOOR)  # the pull has lasted long enough, and does not end
    assert np.all(path[-1] > 2 * SCALE_FLOOR)


def test_a_scale_moves_by_a_small_part_of_itself():
    path = scales().astype(np.float64)
    growth = path[1:] / path[:-1]
    assert np.all(abs(growth - 1) < 2.4 * RATE)


def test_averages_settle_at_their_users_and_nobodys_fade():
    counts, sums = averages()
    assert np.allclose(counts, [2, 2, 0], atol=0.7)  # 0.999^5000 of the start is left
    assert 0 < counts[2] < 0.03
    assert np.isfinite(sums).all()
