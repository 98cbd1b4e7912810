"""Cases of metrics."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case

Frame = NDArray[np.unsignedinteger[Any]]


def scene(rng: Draws, height: int, width: int, peak: int = 255) -> Frame:
    """A frame with structure at every scale: a random walk along both axes, in whole numbers."""
    walk = rng.integers(-9, 10, (height, width, 3)).cumsum(axis=0).cumsum(axis=1)
    walk = walk - walk.min()
    return np.asarray(walk * peak // max(int(walk.max()), 1), np.uint8 if peak == 255 else np.uint16)


def disturbed(rng: Draws, frame: Frame, amount: tuple[int, int, int], peak: int = 255) -> Frame:
    """The frame with noise of a different size in each channel."""
    noise = rng.integers(-np.array(amount), np.array(amount) + 1, frame.shape)
    return np.asarray(np.clip(frame.astype(np.int64) + noise, 0, peak), frame.dtype)


SIZES = {
    "7x5": (5, 7), "11x11": (11, 11), "13x10": (10, 13), "20x33": (33, 20), "21x21": (21, 21), "23x45": (45, 23),
    "41x43": (43, 41),
}  # fmt: skip


@case("core", "metrics", flags=["metric", "odd-size"], each=SIZES)
def noisy_scene(rng: Draws, value: tuple[int, int]) -> Inputs:
    """A scene with noise of 3, 20 and 60 steps in R, G and B: {key} pixels.

    One MSE over the channels, while a mean of three PSNRs is several dB higher. The window shrinks on sides below 11,
    the number of scales follows from the shorter side, and at odd sides the outermost samples count twice.
    """
    frame = scene(rng, *value)
    other = disturbed(rng, frame, (3, 20, 60))
    expected = yield {"a": frame, "b": other, "bit_depth": 8}
    errors = (frame.astype(float) - other) ** 2
    of_channels = 10 * np.log10(255**2 / errors.mean(axis=(0, 1)))
    assert expected["psnr"].value < of_channels.mean() - 2
    assert 0.2 < expected["ms_ssim"].value < 0.999


@case("core", "metrics", flags=["metric"])
def five_scales(rng: Draws) -> Inputs:
    """161x162 pixels, the least size with all five scales."""
    frame = scene(rng, 162, 161)
    expected = yield {"a": frame, "b": disturbed(rng, frame, (30, 60, 90)), "bit_depth": 8}
    assert 0.5 < expected["ms_ssim"].value < 0.99


FIVE_SCALES: Final = {"192x176": (176, 192, 7), "192x177": (177, 192, 7), "192x1088": (1088, 192, 7)}
"""Rows and columns, and the rows of a scene that is repeated over them."""


@case("core", "metrics", flags=["metric", "odd-size"], each=FIVE_SCALES)
def five_scales_of_a_repeated_scene(rng: Draws, value: tuple[int, int, int]) -> Inputs:
    """Five scales of {key} pixels, a scene of a few rows again and again, a pixel further to the left each time."""
    height, width, rows = value
    frame = scene(rng, rows, width + 1)
    pair = (np.resize(one.reshape(-1, 3), (height, width, 3)) for one in (frame, disturbed(rng, frame, (30, 60, 90))))
    expected = yield {**dict(zip("ab", pair, strict=True)), "bit_depth": 8}
    assert 0.5 < expected["ms_ssim"].value < 0.99


@case("core", "metrics", flags=["metric"])
def psnr_by_hand() -> Inputs:
    """A grey frame and one that is 5 steps brighter: MSE 25, PSNR 20 log10(51), no difference in structure."""
    frame = np.full((4, 6, 3), 100, np.uint8)
    expected = yield {"a": frame, "b": frame + np.uint8(5), "bit_depth": 8}
    assert expected["mse"].value == 25
    assert np.isclose(expected["psnr"].value, 20 * np.log10(51), rtol=1e-12)
    assert np.isclose(expected["ms_ssim"].value, (2 * 100 * 105 + 2.55**2) / (100**2 + 105**2 + 2.55**2), rtol=1e-9)


@case("core", "metrics", flags=["metric", "bit-depth"], each={"8_bits": 8, "10_bits": 10})
def darkness(rng: Draws, value: int) -> Inputs:
    """Samples of {key}, up to 2 % of the peak: C1 and C2 decide, which are 0.01 and 0.03 of the peak, squared."""
    dtype = np.uint8 if value == 8 else np.uint16
    a, b = rng.integers(0, 5 << (value - 8), (2, 12, 14, 3)).astype(dtype)
    b[:, :7] //= 4
    expected = yield {"a": a, "b": b, "bit_depth": value}
    assert 0.4 < expected["ms_ssim"].value < 0.99


@case("core", "metrics", flags=["metric", "cancellation"])
def brightness(rng: Draws) -> Inputs:
    """Samples of 250 to 255: variances of a few steps are the differences of means of squares near the peak's."""
    a, b = rng.integers(250, 256, (2, 22, 23, 3)).astype(np.uint8)
    expected = yield {"a": a, "b": b, "bit_depth": 8}
    assert 0.9 < expected["ms_ssim"].value < 0.999


@case("core", "metrics", flags=["metric"])
def contrast_without_shift(rng: Draws) -> Inputs:
    """Half the contrast around the same mean: only the term of contrast and structure tells."""
    deviation = rng.integers(-50, 51, (24, 25, 3))
    a, b = (128 + 2 * (deviation // 2)).astype(np.uint8), (128 + deviation // 2).astype(np.uint8)
    expected = yield {"a": a, "b": b, "bit_depth": 8}
    assert 0.75 < expected["ms_ssim"].value < 0.85


@case("core", "metrics", flags=["metric"])
def brightness_and_structure_together(rng: Draws) -> Inputs:
    """One half is brighter and of another structure, the other equal: the mean of products, not a product of means."""
    a, b = rng.integers(0, 40, (2, 14, 28, 3)).astype(np.uint8)
    b[:, :14] += 120
    b[:, 14:] = a[:, 14:]
    expected = yield {"a": a, "b": b, "bit_depth": 8}
    assert 0.2 < expected["ms_ssim"].value < 0.5


@case("core", "metrics", flags=["bit-depth"], each={"10_bits": 10, "16_bits": 16})
def deep_samples(rng: Draws, value: int) -> Inputs:
    """Frames of 15x12 pixels and {key}: the peak, and with it PSNR and the constants, follow the depth."""
    peak = (1 << value) - 1
    frame = scene(rng, 12, 15, peak)
    expected = yield {"a": frame, "b": disturbed(rng, frame, (peak // 50,) * 3, peak), "bit_depth": value}
    assert 30 < expected["psnr"].value < 45


@case("core", "metrics", flags=["metric"])
def inverted_structure(rng: Draws) -> Inputs:
    """A negative picture of 22x22 pixels: the mean of a scale is below 0 and counts as 0."""
    frame = scene(rng, 22, 22)
    expected = yield {"a": frame, "b": np.uint8(255) - frame, "bit_depth": 8}
    assert expected["ms_ssim"].value == 0


@case("core", "metrics", flags=["overflow"])
def black_and_white() -> Inputs:
    """Black against white, 64 pixels: the PSNR is 0, and no difference wraps around."""
    black = np.zeros((8, 8, 3), np.uint8)
    expected = yield {"a": black, "b": ~black, "bit_depth": 8}
    assert expected["mse"].value == 65025
    assert abs(expected["psnr"].value) < 1e-12


@case("core", "metrics", flags=["metric", "empty"])
def equal_frames(rng: Draws) -> Inputs:
    """A frame of 14x12 pixels and itself: nothing differs, so that the PSNR is infinite and MS-SSIM is 1."""
    frame = scene(rng, 12, 14)
    expected = yield {"a": frame, "b": frame.copy(), "bit_depth": 8}
    assert expected["mse"].value == 0
    assert expected["psnr"].value == np.inf
    assert np.isclose(expected["ms_ssim"].value, 1, rtol=1e-12)


@case("core", "metrics", flags=["metric"])
def one_sample_differs(rng: Draws) -> Inputs:
    """A single sample of 12x13 pixels is one step off, where a is below b: unsigned differences wrap around."""
    frame = np.minimum(scene(rng, 13, 12), 254).astype(np.uint8)
    other = frame.copy()
    other[4, 5, 1] += 1
    expected = yield {"a": frame, "b": other, "bit_depth": 8}
    assert np.isclose(expected["mse"].value, 1 / 468)


@case("uncommon", "metrics", flags=["odd-size"], each={"one_pixel": (1, 1), "one_row": (1, 30), "one_column": (14, 1)})
def thin_scenes(rng: Draws, value: tuple[int, int]) -> Inputs:
    """Frames of {key}: the window has a single tap on that side."""
    frame = scene(rng, *value)
    expected = yield {"a": frame, "b": np.clip(frame.astype(int) + 9, 0, 250).astype(np.uint8), "bit_depth": 8}
    assert 0 < expected["ms_ssim"].value < 1


@case("stress", "metrics", flags=["overflow", "bit-depth"])
def extremes_of_16_bits() -> Inputs:
    """A checkerboard of 0 and 65535 against its negative: squares that 32 bits just hold, sums that they do not."""
    board = (np.indices((16, 16)).sum(axis=0) % 2 * 65535).astype(np.uint16)
    frame = np.stack([board] * 3, axis=-1)
    expected = yield {"a": frame, "b": ~frame, "bit_depth": 16}
    assert expected["mse"].value == 65535**2
