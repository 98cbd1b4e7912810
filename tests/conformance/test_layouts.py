"""Wrong outputs that are the right ones in other places."""

import numpy as np
import pytest

from conformance.diagnosis.layouts import layout_cause

PICTURE = np.random.default_rng(7).uniform(0.1, 1, (43, 60, 3)).astype(np.float32)
SPLATS = np.random.default_rng(8).uniform(1, 9, (11, 8)).astype(np.float32)


def beyond_tiles(tile):
    part = PICTURE.copy()
    part[43 // tile * tile :] = 0
    part[:, 60 // tile * tile :] = 0
    return part


@pytest.mark.parametrize(
    ("value", "mine", "word"),
    [
        (PICTURE, 0 * PICTURE, "nothing was written to: every element is 0"),
        (PICTURE, np.nan * PICTURE, "nothing was written to: every element is nan"),
        (SPLATS.astype(np.uint16), np.full((11, 8), 65535, np.uint16), "every element is 65535"),
        (PICTURE, PICTURE[:, :, ::-1], "B, G, R"),
        (PICTURE, PICTURE[::-1], "y axis"),
        (PICTURE, PICTURE[:, ::-1], "x axis"),
        (PICTURE, PICTURE.transpose(2, 0, 1).reshape(43, 60, 3), "planes one after the other"),
        (PICTURE, PICTURE.transpose(1, 0, 2).reshape(43, 60, 3), "columns one after the other (W, H, 3)"),
        (SPLATS, SPLATS.T.reshape(11, 8), "fields of splats"),
        (PICTURE, PICTURE * np.float32(255), "255 times"),
        (PICTURE, PICTURE / np.float32(255), "divided by 255"),
        (SPLATS, -SPLATS, "other sign"),
        (PICTURE, beyond_tiles(16), "last whole tile of 16x16"),
        (PICTURE, beyond_tiles(8), "last whole tile of 8x8"),
    ],
)
def test_a_layout_is_named(value, mine, word):
    assert word in layout_cause(value, np.ascontiguousarray(mine))


@pytest.mark.parametrize(
    ("value", "mine"),
    [
        (PICTURE, PICTURE + np.float32(0.1)),
        (PICTURE, PICTURE * 2),
        (PICTURE, PICTURE[1:]),  # another shape
        (PICTURE, np.where(PICTURE > 0.5, PICTURE, np.nan).astype(np.float32)),
        (np.full((4, 4, 3), 0.5, np.float32), np.zeros((4, 4, 3), np.float32)),  # any constant may be computed
        (np.zeros((0, 8), np.float32), np.zeros((0, 8), np.float32)),
        (np.float64(2), np.float64(0)),
        (np.tile(PICTURE[:, :, :1], (1, 1, 3)), np.tile(PICTURE[:, :, :1], (1, 1, 3)) * 3),  # grey is its own B, G, R
    ],
)
def test_something_else_is_not(value, mine):
    assert layout_cause(np.asarray(value), np.asarray(mine)) == ""
