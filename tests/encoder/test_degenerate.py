"""Frames without anything to hold on to: all are encoded and decoded, with finite numbers and without a warning."""

import numpy as np
import pytest
from codec_cases import encoded, fast, paper_fast, paper_quick

from gsvc_ref.encoder import Settings
from gsvc_ref.metrics import psnr
from gsvc_ref.stream import Stream, decode

SIZES = {(1, 1): 8, (1, 9): 16, (9, 1): 8, (16, 12): 16}
"""Width and height, and the bit depth that goes with it."""

FRAMES = 3


def hot(picture, value, t=0):
    """The picture with one pixel of another value."""
    height, width = picture.shape[:2]
    changed = picture.copy()
    changed[height // 2, (width // 2 + 3 * t) % width] = value
    return changed


def black(zero, peak, rng):
    return [zero] * FRAMES


def white(zero, peak, rng):
    return [zero + peak] * FRAMES


def grey(zero, peak, rng):
    return [zero + peak // 2] * FRAMES


def one_hot_pixel(zero, peak, rng):
    return [hot(zero, peak)] * FRAMES


def one_dark_pixel(zero, peak, rng):
    return [hot(zero + peak, 0)] * FRAMES


def a_hot_pixel_that_moves(zero, peak, rng):
    return [hot(zero, peak, t) for t in range(FRAMES)]


def noise(zero, peak, rng):
    return [rng.integers(0, peak, zero.shape, zero.dtype, endpoint=True) for _ in range(FRAMES)]


def black_and_white(zero, peak, rng):
    return [zero + (peak if t % 2 else 0) for t in range(FRAMES)]


def saturated(zero, peak, rng):
    """Stripes of full colours, beyond which splats may overshoot free of charge."""
    colors = np.array([[peak, 0, 0], [0, peak, 0], [0, 0, peak], [peak, peak, 0]])
    return [(zero + colors[(np.arange(zero.shape[1]) + t) % 4]) for t in range(FRAMES)]


def text(zero, peak, rng):
    """Strokes of one pixel, as of small letters, that scroll."""
    page = np.where(rng.random((zero.shape[0] + FRAMES, zero.shape[1], 1)) < 0.3, 0, peak)
    return [zero + page[t : t + zero.shape[0]] for t in range(FRAMES)]


KINDS = (
    black,
    white,
    grey,
    one_hot_pixel,
    one_dark_pixel,
    a_hot_pixel_that_moves,
    noise,
    black_and_white,
    saturated,
    text,
)
PRESETS = {
    "main": lambda: fast(effects="auto,frames=all"),
    "main, detected": lambda: Settings.quick(threads=1),
    "main, PSNR": lambda: fast(psnr=50, key_frames=2),
    "main, quality": lambda: fast(quality=60),
    "quick": lambda: paper_fast(effects="auto,frames=all"),
    "detected": lambda: paper_quick(iterations=3, threads=1, effects="auto,frames=all"),
    "paper": lambda: Settings.paper(iterations=4, threads=1, key_frames=2),
}

LIKE_OTHERS = ("main, quality", "quick")
"""Presets whose ways "main, PSNR" and "detected" take as well."""


@pytest.mark.parametrize(
    "preset", [pytest.param(name, marks=[pytest.mark.exhaustive] if name in LIKE_OTHERS else []) for name in PRESETS]
)
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_it_makes_the_round_trip(kind, preset):
    for (width, height), depth in SIZES.items():
        peak, zero = 2**depth - 1, np.zeros((height, width, 3), np.uint8 if depth == 8 else np.uint16)
        clip = [frame.astype(zero.dtype) for frame in kind(zero, peak, np.random.default_rng(4))]
        report, data = encoded(clip, PRESETS[preset](), depth)
        assert all(np.isfinite(frame.splats.to_array()).all() for frame in Stream(data))
        decoded = list(decode(data, threads=1))
        told = [frame.psnr for frame in report.frames]
        assert told == [psnr(frame, picture, peak) for frame, picture in zip(clip, decoded, strict=True)]
        assert min(told) >= 0


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("settings", [fast(key_frames="auto"), paper_quick(iterations=3, threads=1)])
def test_one_frame_alone_makes_the_round_trip(kind, settings):
    zero = np.zeros((5, 7, 3), np.uint8)
    clip = [kind(zero, 255, np.random.default_rng(4))[0].astype(np.uint8)]
    report, data = encoded(clip, settings)
    assert [frame.type for frame in report.frames] == ["I"]
    assert len(list(decode(data, threads=1))) == 1
