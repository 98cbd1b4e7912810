"""Static splats: which they are, and that training leaves them alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.splats import Splats
from gsvc_ref import Settings, encode, open
from gsvc_ref.encoder.blocks import BLOCK, block_errors
from gsvc_ref.encoder.static import changed_pixels, static_splats
from gsvc_ref.rendering import covered_pixels, render
from gsvc_ref.video import ColorDescription, VideoFormat

WIDTH, HEIGHT = 40, 24
COLOR = ColorDescription(primaries=1, transfer=1, matrix=0, full_range=True, chroma_location=0)

f4 = {"width": 32}
splat = st.tuples(
    st.floats(-20, 60, **f4), st.floats(-20, 44, **f4), st.floats(0.25, 9, **f4), st.floats(-9, 9, **f4),
    st.floats(0.25, 9, **f4),
)  # fmt: skip


@pytest.mark.parametrize(("width", "height"), [(40, 24), (32, 16), (1, 50), (17, 1)])
def test_errors_and_changes_are_those_of_their_definitions(width, height):
    rng = np.random.default_rng(width)
    before, now = rng.integers(0, 2, (2, height, width, 3)).astype(np.float32)
    for kind in (np.float32, np.uint8, np.uint16):
        changed = changed_pixels(before.astype(kind), now.astype(kind))
        assert np.array_equal(changed, (before != now).any(axis=2))
    residual = (now - before) * rng.random((height, width, 3), np.float32)
    squares = np.square(residual, dtype=np.float64)
    for (row, column), error in np.ndenumerate(block_errors(residual)):
        block = squares[row * BLOCK : (row + 1) * BLOCK, column * BLOCK : (column + 1) * BLOCK]
        assert error == pytest.approx(block.sum(), rel=1e-12)


@given(splat, st.integers(0, WIDTH - 1), st.integers(0, HEIGHT - 1))
def test_a_splat_that_covers_a_changed_pixel_is_not_static(shape, column, row):
    changed = np.zeros((HEIGHT, WIDTH), bool)
    changed[row, column] = True
    parameters = np.array([[*shape, 1, 1, 1]], np.float32)
    covers = render(Splats.from_array(parameters), WIDTH, HEIGHT)[row, column, 0] > 0
    assert not (covers and static_splats(parameters, changed)[0])


@given(splat)
def test_where_nothing_changes_all_are_static_and_where_all_changes_none_that_shows(shape):
    parameters = np.array([[*shape, 1, 1, 1]], np.float32)
    if covered_pixels(Splats.from_array(parameters), WIDTH, HEIGHT)[0]:
        assert static_splats(parameters, np.zeros((HEIGHT, WIDTH), bool)).all()
        assert not static_splats(parameters, np.ones((HEIGHT, WIDTH), bool)).any()


def test_a_splat_that_training_would_widen_is_not_static():
    parameters = np.array([[10, 10, 0.2, 0, 3, 1, 1, 1], [10, 10, 3, 0, 0.2, 1, 1, 1]], np.float32)
    assert not static_splats(parameters, np.zeros((HEIGHT, WIDTH), bool)).any()


@pytest.mark.parametrize("place", [(-50, 10), (90, 10), (10, -50), (10, 80)])
def test_a_splat_that_left_the_frame_is_not_static(place):
    """It would keep its place among the N splats for ever, and a camera that pans would run out of them."""
    parameters = np.array([[*place, 3, 1, 3, 1, 1, 1]], np.float32)
    assert not static_splats(parameters, np.zeros((HEIGHT, WIDTH), bool)).any()


def test_changed_pixels_differ_in_any_channel():
    before = np.zeros((2, 3, 3), np.float32)
    now = before.copy()
    now[1, 2, 1] = 0.5
    assert changed_pixels(before, now).tolist() == [[False] * 3, [False, False, True]]


def frames():
    """A texture in which one corner changes."""
    rng = np.random.default_rng(4)
    still = rng.integers(60, 200, (48, 64, 3), np.uint8)
    for number in range(3):
        frame = still.copy()
        frame[4:12, 4 + 3 * number : 12 + 3 * number] = (250, 30, 30)
        yield frame


def decoded(tmp_path, **overrides):
    video = VideoFormat(64, 48, 25, 8, "rgb", COLOR, frame_count=3)
    target = tmp_path / "a.gsvc"
    encode(
        (frames(), video),
        target,
        Settings.quick(profile="paper", splats=60, iterations=30, key_frames=(0,), **overrides),
    )
    with open(target) as stream:
        return list(stream)


def test_what_stands_still_is_coded_as_it_was(tmp_path):
    """Far from the corner that changes, every splat survives with the same parameters, to the bit."""
    first, *others = decoded(tmp_path)
    before = first
    for frame in others:
        now, old = frame.splats.to_array(), before.splats.to_array()
        far = (old[:, 0] - 4 * old[:, 2] > 30) & (old[:, 1] - 4 * np.hypot(old[:, 3], old[:, 4]) > 20)
        assert far.sum() >= 5
        origins = frame.codes.origins
        kept = {int(o): n for n, o in enumerate(origins) if o >= 0}
        for o in np.flatnonzero(far):
            assert np.array_equal(now[kept[int(o)]], old[o])
        assert not np.array_equal(now[: len(old)], old)
        before = frame


def test_constant_quality_trains_everything(tmp_path):
    """It has a goal for every frame, which static splats could keep it from."""
    first, second, _ = decoded(tmp_path, psnr=20.0)
    survivors = second.codes.origins[second.codes.origins >= 0]
    assert len(survivors)
    assert not np.array_equal(second.splats.to_array()[: len(survivors)], first.splats.to_array()[survivors])


def test_a_splat_without_a_place_may_be_anywhere():
    """Infinite minus infinite is no number: no machine's cast of it decides, and no warning."""
    parameters = np.array([[np.inf, 5, np.inf, 0, 1, 0, 0, 0]], np.float32)
    changed = np.zeros((HEIGHT, WIDTH), bool)
    assert static_splats(parameters, changed).tolist() == [True]
    changed[5, -1] = True
    assert static_splats(parameters, changed).tolist() == [False]
