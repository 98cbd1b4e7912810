"""Splats that a scale has taken beyond binary32: they cover nothing in any precision (spec.md sections 9.1 and 9.4)."""

import itertools

import numpy as np
import pytest

from gsvc_base.constants import SUPPORT_SQUARED
from gsvc_base.splats import Splats
from gsvc_ref import spec
from gsvc_ref.bitstream.work import rendering_work
from gsvc_ref.rendering import SequenceRenderer, covered_pixels, render_exact_with_bound, render_gradients, render_sum
from gsvc_ref.rendering.deterministic import gradients_plain, sum_plain, whitened

ORDINARY = [8.25, 4.5, 3, 0.5, 2, 1, -1, 0.5]
WIDTH, HEIGHT = 37, 9

BEYOND = [
    (*ORDINARY[:first], *values, *ORDINARY[first + len(values) :])
    for first, values in [
        *((column, (np.inf,)) for column in range(5)),
        *((column, (-np.inf,)) for column in (0, 1, 3)),
        *((1, values) for values in itertools.product([np.inf, -np.inf], [np.inf, 3], [np.inf, -np.inf], [np.inf, 2])),
    ]
]
"""All kinds of infinite parameters, and a y and l21 between which infinities cancel."""


def beside(*rows) -> Splats:
    """Splats with an ordinary one between each two."""
    return Splats.from_array(np.array([ORDINARY, *(row for wrong in rows for row in (wrong, ORDINARY))], np.float32))


@pytest.mark.parametrize("precision", ["fast", "deterministic", "exact"])
def test_they_cover_nothing(precision):
    splats, alone = beside(*BEYOND), beside(*[[*ORDINARY[:2], 0, 0, 0, 1, 1, 1]] * len(BEYOND))
    with np.errstate(all="raise", under="ignore"):
        picture = render_sum(splats, WIDTH, HEIGHT, precision=precision)
        pixels = covered_pixels(splats, WIDTH, HEIGHT, precision=precision)
    assert picture.any()
    assert np.array_equal(picture, render_sum(alone, WIDTH, HEIGHT, precision=precision))
    assert pixels.tolist() == [pixels[0], *[0, pixels[0]] * len(BEYOND)]


@pytest.mark.parametrize("precision", ["fast", "deterministic", "exact"])
def test_they_have_no_gradient(precision):
    residual = np.random.default_rng(3).normal(0, 1, (HEIGHT, WIDTH, 3)).astype(np.float32)
    gradients = render_gradients(beside(*BEYOND), residual, precision=precision)
    assert not gradients[1::2].any()
    assert np.array_equal(gradients[::2], np.repeat(gradients[:1], len(BEYOND) + 1, axis=0))
    assert gradients[0].all()


@pytest.mark.parametrize("row", BEYOND)
def test_the_plain_form_agrees(row):
    splats = beside(row)
    assert sum_plain(splats, WIDTH, HEIGHT).tobytes() == render_sum(
        splats, WIDTH, HEIGHT, precision="deterministic"
    ).tobytes()  # fmt: skip
    residual = np.ones((HEIGHT, WIDTH, 3), np.float32)
    assert not gradients_plain(splats, residual)[1].any()
    if np.isfinite([row[2], row[4]]).all():  # not degenerate: that they cover nothing follows from (9-4)
        with np.errstate(invalid="ignore", over="ignore"):
            assert not (whitened(np.array(row, np.float32), WIDTH, HEIGHT)[2] <= SUPPORT_SQUARED).any()
    C, bound = render_exact_with_bound(splats, WIDTH, HEIGHT)
    assert np.isfinite(bound).all()
    assert np.array_equal(C, render_sum(splats, WIDTH, HEIGHT, precision="exact"))


def test_they_are_no_work():
    splats = beside(*BEYOND)
    ordinary = rendering_work(splats.take(np.arange(1)), WIDTH, HEIGHT)
    assert rendering_work(splats, WIDTH, HEIGHT) == ordinary * (len(BEYOND) + 1)
    assert spec.rendering_work(splats.to_array(), WIDTH, HEIGHT)["work"] == ordinary * (len(BEYOND) + 1)


def test_they_come_and_go_in_a_sequence():
    before, after = beside(BEYOND[2], ORDINARY), beside(ORDINARY, BEYOND[2])
    renderer = SequenceRenderer(WIDTH, HEIGHT)
    for splats in (before, after, before):
        frame = renderer.next_frame(splats, 8, np.arange(len(splats)))
        assert np.array_equal(frame, SequenceRenderer(WIDTH, HEIGHT).next_frame(splats, 8))
