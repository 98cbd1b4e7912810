"""Small clips for encoders, drawn by stated arithmetic, and the PSNR that each of their frames must have.

A floor is `MARGIN` below the least PSNR of the frames that gsvc_ref gives with as many splats, and at most `CAP`: an
encoder may have twice the root mean squared error of gsvc_ref's quick preset. A third of its iterations is enough for
that in every clip (`tests/conformance/test_encoders.py`). The numbers of gsvc_ref stand here as they were measured, by
version 0.1.0 in deterministic precision: a better encoder changes no vector.
"""

import inspect
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_base.draws import Draws
from gsvc_base.portable import exp
from gsvc_conformance.case import Inputs, Tier, add

Frames = NDArray[Any]

MARGIN: Final = 6.0
"""Decibels below gsvc_ref's worst frame: four times its mean squared error."""
CAP: Final = 36.0
"""The highest floor in dB: a root mean squared error of four steps of 255. Better than that, splats can be saved."""

RED: Final = (0.9, 0.15, 0.1)
PERIODS: Final = (17.0, 13.0, 19.0)
SPOTS: Final = ((5, 6, 1.1), (13, 5, 1.4), (21, 8, 1.0), (28, 5, 1.5), (8, 15, 1.3), (16, 14, 1.0), (25, 17, 1.2),
                (4, 21, 1.5), (12, 20, 1.0), (20, 21, 1.4))  # fmt: skip
"""Column, row and standard deviation of round spots, in pixels."""


def wave(t: Frames, period: float) -> Frames:
    """A wave from -1 to 1 of straight and cubic pieces, from sums and products alone."""
    phase = t / period - np.floor(t / period)
    straight = 2 * abs(2 * phase - 1) - 1
    return np.asarray(straight * (1.5 - 0.5 * straight * straight))


def samples(picture: Frames, bit_depth: int = 8) -> Frames:
    """A picture of 0..1 as samples, u1 or u2."""
    peak = 2**bit_depth - 1
    return np.asarray(np.rint(np.clip(picture, 0, 1) * peak), np.uint8 if bit_depth == 8 else np.uint16)


def grid(width: int, height: int) -> tuple[Frames, Frames]:
    """The column and the row of each pixel's centre."""
    row, column = np.mgrid[:height, :width] + 0.5
    return column, row


def pattern(width: int, height: int, left: float, top: float) -> Frames:
    """A part of an endless picture of waves, with a patch of tiles: (H, W, 3) f8."""
    column, row = grid(width, height)
    x, y = column + left, row + top
    waves = (0.5 + 0.3 * wave(x + 0.5 * y, PERIODS[0]), 0.45 + 0.3 * wave(y - 0.25 * x, PERIODS[1]),
             0.4 + 0.3 * wave(x - y, PERIODS[2]))  # fmt: skip
    tiles = np.where((np.floor(x / 4) + np.floor(y / 3)) % 2 == 0, 0.15, -0.15) * (x < 16)
    return np.stack([channel + tiles * share for channel, share in zip(waves, (1, 0.6, -0.5), strict=True)], axis=-1)


def with_ball(picture: Frames, x: float, y: float, radius: float) -> Frames:
    """The picture with a red ball on it, its edge about a pixel soft."""
    column, row = grid(picture.shape[1], picture.shape[0])
    squared = (column - x) * (column - x) + (row - y) * (row - y)
    cover = np.clip((radius * radius - squared) / radius + 0.5, 0, 1)[..., None]
    return np.asarray(picture * (1 - cover) + cover * np.array(RED))


def scene(width: int = 32, height: int = 24, t: int = 0, speed: float = 0.0, ball: float = 0.0) -> Frames:
    """Frame t of a pattern that moves by `speed` columns a frame, with a ball that moves by `ball`."""
    return with_ball(pattern(width, height, speed * t, speed * t / 3), 12 + ball * t, 10, 5)


def still_picture() -> Frames:
    """Nothing moves in three frames."""
    return samples(np.stack([scene()] * 3))


def one_frame() -> Frames:
    """A single frame."""
    return samples(scene()[None])


def pan() -> Frames:
    """The camera and a ball move through six frames."""
    return samples(np.stack([scene(40, 24, t, speed=1.5, ball=2) for t in range(6)]))


def cut() -> Frames:
    """Another scene begins at frame 3 of 6."""
    other = [1 - with_ball(pattern(32, 24, 103 + t, 40), 20, 12, 6) for t in range(3)]
    return samples(np.stack([*(scene(t=t, speed=1) for t in range(3)), *other]))


def long_fade() -> Frames:
    """The camera moves and the picture brightens in 24 frames: errors that are not corrected add up.

    An encoder that predicts from anything else than what a decoder has gets worse from frame to frame.
    """
    return samples(np.stack([(0.5 + 0.02 * t) * pattern(20, 16, 0.5 * t, 0) for t in range(24)]))


def random_access() -> Frames:
    """A ball moves through eight frames, and an I-frame is asked for in every three."""
    return samples(np.stack([scene(t=t, ball=1.5) for t in range(8)]))


def ten_bits() -> Frames:
    """Three frames of 10 bits."""
    return samples(np.stack([scene(t=t, ball=1) for t in range(3)]), 10)


def odd_size() -> Frames:
    """Three frames of 33x25 pixels, 30000/1001 a second."""
    return samples(np.stack([scene(33, 25, t, ball=1) for t in range(3)]))


def spots() -> Frames:
    """Two frames of sharp spots on black, which splats can draw nearly as they are.

    Pixel centres at whole numbers shift them by half a pixel, which costs much more than any fit.
    """
    column, row = grid(32, 24)
    total = np.zeros((24, 32, 3))
    for number, (x, y, deviation) in enumerate(SPOTS):
        squared = (column - x) * (column - x) + (row - y) * (row - y)
        colour = np.array([0.9, 0.5, 0.2])[[number % 3, (number + 1) % 3, (number + 2) % 3]]
        total += exp(-squared / (2 * deviation * deviation))[..., None] * colour
    return samples(np.stack([total, total]))


def flat_colour() -> Frames:
    """Two frames of one colour."""
    return np.broadcast_to(np.array([200, 60, 20], np.uint8), (2, 12, 16, 3)).copy()


def black() -> Frames:
    """Two frames that are black, which no splat at all can draw."""
    return np.zeros((2, 12, 16, 3), np.uint8)


def noise() -> Frames:
    """Two frames of noise, each its own: no splat fits them, and the stream has to be legal all the same."""
    return Draws(7).integers(0, 256, (2, 16, 24, 3)).astype(np.uint8)


def one_pixel() -> Frames:
    """Two frames of a single pixel, of other colours."""
    return np.array([[[[10, 200, 90]]], [[[250, 3, 128]]]], np.uint8)


class Clip(NamedTuple):
    """A clip and what is asked of its encoder.

    Attributes
    ----------
    draw
        Draws the frames, (T, H, W, 3) u1 or u2.
    splats
        N.
    reference
        The least PSNR of gsvc_ref's frames with N splats, in dB, as it was measured.
    tier, flags
        Of the vector.
    bit_depth, frame_rate, key_frame_interval
        As inputs of encode_video; the rate as numerator and denominator.
    """

    draw: Callable[[], Frames]
    splats: int
    reference: float
    tier: Tier = "core"
    bit_depth: int = 8
    frame_rate: tuple[int, int] = (25, 1)
    key_frame_interval: int = 0
    flags: tuple[str, ...] = ()

    @property
    def floor(self) -> float:
        """The PSNR that each frame must have, in dB, rounded down to a tenth."""
        return min(float(np.floor(10 * (self.reference - MARGIN))) / 10, CAP)

    def inputs(self) -> dict[str, Any]:
        """The inputs of encode_video."""
        return {
            "frames": self.draw(), "bit_depth": self.bit_depth, "frame_rate_numerator": self.frame_rate[0],
            "frame_rate_denominator": self.frame_rate[1], "splats": self.splats,
            "key_frame_interval": self.key_frame_interval, "level": 1, "floor": self.floor,
        }  # fmt: skip


CLIPS: Final = (
    Clip(one_frame, 48, 27.05),
    Clip(still_picture, 48, 27.05),
    Clip(pan, 60, 26.56, flags=("prediction",)),
    Clip(cut, 48, 26.10, flags=("channel-order",)),
    Clip(long_fade, 24, 28.03, flags=("prediction",)),
    Clip(random_access, 48, 25.56, key_frame_interval=3, flags=("prediction",)),
    Clip(spots, 20, 55.36, flags=("pixel-centre",)),
    Clip(flat_colour, 6, 54.77),
    Clip(ten_bits, 48, 26.75, "uncommon", bit_depth=10, flags=("bit-depth",)),
    Clip(odd_size, 50, 25.78, "uncommon", frame_rate=(30000, 1001), flags=("odd-size",)),
    Clip(black, 6, np.inf, "stress", flags=("empty",)),
    Clip(noise, 64, 10.89, "stress"),
    Clip(one_pixel, 1, 49.89, "stress"),
)


def encoded_clip(value: Clip) -> Inputs:
    """The case of a clip."""
    expected = yield value.inputs()
    assert expected["stream"].task.floor <= value.reference - MARGIN


def _reference_words(clip: Clip) -> str:
    """What gsvc_ref gives, in words, after what the clip is there for."""
    reason = (clip.draw.__doc__ or "").partition("\n")[2]
    quality = "equal to the source" if clip.reference == np.inf else f"{clip.reference:.2f} dB or more"
    return f"{inspect.cleandoc(reason)} gsvc_ref 0.1.0 has {quality} in each frame with {clip.splats} splats.".lstrip()


for _clip in CLIPS:
    add(
        _clip.tier, "encode_video", _clip.draw.__name__,
        title=(_clip.draw.__doc__ or "").partition("\n")[0], reason=_reference_words(_clip), function=encoded_clip,
        arguments={"value": _clip}, flags=_clip.flags,
    )  # fmt: skip
