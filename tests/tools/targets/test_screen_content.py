"""Text and screens are told from photographs, and what is said of them."""

import numpy as np
import pytest
from codec_cases import waves
from PIL import Image, ImageDraw, ImageFont

from gsvc_lab.scenes import Scene
from gsvc_ref.encoder import Settings
from gsvc_tools.targets.screen_content import GOOD, Sharpness, screen_note

WORDS = "the splats of a video are sums and every frame has bits to spend on them again "


def page(width, height, size=12, paper="white", ink="black") -> np.ndarray:
    picture = Image.new("RGB", (width, height), paper)
    draw = ImageDraw.Draw(picture)
    for row in range(4, height, int(size * 1.4)):
        draw.text(
            (6, row), (WORDS[row % 40 :] + WORDS)[: 2 * width // size], font=ImageFont.load_default(size), fill=ink
        )
    return np.asarray(picture)


SCREENS = {
    "page": page(176, 144),
    "large page": page(640, 360, 14),
    "terminal": page(352, 288, 11, (18, 18, 18), (200, 240, 200)),
    "dark editor": page(176, 144, 14, (30, 30, 46), (205, 214, 244)),
    "slide": page(352, 288, 28, (250, 250, 252), (30, 60, 120)),
}


@pytest.mark.parametrize("name", SCREENS)
@pytest.mark.parametrize("bit_depth", [8, 10])
def test_text_is_found(name, bit_depth):
    frame, peak = SCREENS[name], 2**bit_depth - 1
    deep = frame if bit_depth == 8 else (frame.astype(np.uint16) << 2)
    assert Sharpness.of(deep, peak).is_screen
    note = screen_note(deep, peak, Settings.quick(splats=200))
    assert note is not None
    assert f"for {GOOD:.0f} dB" in note


@pytest.mark.parametrize("name", ["pan", "text", "noise", "jumping-circle", "fade", "talking-head", "shapes"])
def test_scenes_are_none(name):
    frame = next(iter(Scene.named(name).resized(176, 144, frames=2).open_video()))
    assert screen_note(frame, 255, Settings.quick()) is None


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (16, 16)])
def test_small_and_even_pictures_are_none(shape):
    assert screen_note(np.full((*shape, 3), 7, np.uint8), 255, Settings.quick()) is None


def test_waves_are_none():
    assert not Sharpness.of(waves(64, 48, 1)[0], 255).is_screen


def test_what_is_expected_grows_with_the_splats():
    sharpness = Sharpness.of(SCREENS["page"], 255)
    good = sharpness.good_splats
    assert sharpness.expected_psnr(good) == GOOD
    assert sharpness.expected_psnr(2 * good) > GOOD > sharpness.expected_psnr(good // 2)
    few = screen_note(SCREENS["page"], 255, Settings.quick(splats=good // 4))
    many = screen_note(SCREENS["page"], 255, Settings.quick(splats=2 * good))
    held = screen_note(SCREENS["page"], 255, Settings.quick(psnr=34))
    assert "give or take 4" in few
    assert many is None  # nothing to warn of
    assert "in an I-frame" in held
