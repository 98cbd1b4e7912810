"""Wrong outputs that are the right ones in other places."""

import numpy as np
import pytest

from gsvc_conformance.diagnosis.layouts import layout_cause
from gsvc_conformance.names import SPLAT

PICTURE = np.random.default_rng(7).uniform(0.1, 1, (43, 60, 3)).astype(np.float32)
SPLATS = np.random.default_rng(8).uniform(1, 9, (11, 8)).astype(np.float32)


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
        (SPLATS, SPLATS[:, [0, 1, 2, 4, 3, 5, 6, 7]], "columns l21 and l22 exchanged"),
        (SPLATS, SPLATS[:, [0, 1, 2, 2, 4, 5, 6, 7]], "l11 in place of l21"),
        (SPLATS, SPLATS[::-1], "rows in reverse order"),
        (SPLATS, np.roll(SPLATS, 1, axis=0), "shifted by one, to the next place"),
        (PICTURE, PICTURE[:, :, [1, 0, 2]], "channels red and green exchanged"),
        (PICTURE, PICTURE[::-1, ::-1], "half a turn"),
        (PICTURE, np.roll(PICTURE, 1, axis=1), "one pixel to the right"),
        (PICTURE, np.pad(PICTURE[:-1], ((1, 0), (0, 0), (0, 0))), "one pixel down"),
        (
            PICTURE,
            np.pad(PICTURE, ((0, 0), (0, 1), (0, 0))).reshape(-1, 3)[: 43 * 60].reshape(43, 60, 3),
            "W + 1 pixels apart",
        ),
        (np.arange(7, dtype=np.uint16), np.arange(7, dtype=np.uint16).byteswap(), "bytes of each element"),
        (np.array([1, 25, 1000], np.int64), np.array([1, 25 << 24, 1000], np.int64), "4-byte numbers"),
        (
            np.arange(9, dtype=np.uint8),
            np.array([0, 128, 64, 192, 32, 160, 96, 224, 16], np.uint8),
            "bits of each byte",
        ),
    ],
)
def test_a_layout_is_named(value, mine, word):
    names = SPLAT[:8] if value.shape == SPLATS.shape else ()
    assert word in layout_cause(value, np.ascontiguousarray(mine), names)


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
