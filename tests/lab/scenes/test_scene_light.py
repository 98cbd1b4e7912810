import math

import numpy as np
import pytest
from scene_cases import scene

from gsvc_base.errors import UsageError
from gsvc_lab.scenes import Clip, truth
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effects.brightness import Brightness
from gsvc_lab.scenes.effects.flash import Flash
from gsvc_lab.scenes.effects.highlight import Highlight

CANVAS = Canvas(60, 40, 25)
RAMP = np.broadcast_to(np.linspace(0, 1, 60, dtype=np.float32)[None, :, None], (40, 60, 3))


def test_a_flash_changes_its_frames_and_no_other():
    flash = Flash((5, 15), frames=3, gain=1.5, offset=0.1)
    for frame in range(25):
        lit = 5 <= frame < 8 or 15 <= frame < 18
        picture = flash.light(RAMP, CANVAS, frame)
        assert (picture is RAMP) == (not lit)
        known = flash.truth(CANVAS, frame)
        assert known == ({"gain": 1.5, "offset": 0.1} if lit else {"gain": 1, "offset": 0})
        np.testing.assert_allclose(picture, np.clip(RAMP * known["gain"] + known["offset"], 0, 1), atol=1e-6)
        assert (flash.light(RAMP, CANVAS, frame - 0.49) is RAMP) == (not lit)


def test_a_flash_may_fade():
    flash = Flash((2,), frames=4, gain=3, offset=0.2, fading=True)
    gains = [flash.truth(CANVAS, frame)["gain"] for frame in range(8)]
    assert gains == pytest.approx([1, 1, 3, 2.5, 2, 1.5, 1, 1])
    overlapping = Flash((2, 3), frames=4, gain=3, fading=True)
    assert overlapping.truth(CANVAS, 3)["gain"] == 3


def test_brightness_goes_from_value_to_value():
    ramp = Brightness(gain=(0.5, 1.5), offset=(0.2,), at=(4, 14))
    for frame, gain in [(0, 0.5), (4, 0.5), (9, 1.0), (14, 1.5), (24, 1.5)]:
        known = ramp.truth(CANVAS, frame)
        assert (known["gain"], known["offset"]) == pytest.approx((gain, 0.2))
        expected = np.clip(RAMP * known["gain"] + known["offset"], 0, 1)
        np.testing.assert_allclose(ramp.light(RAMP, CANVAS, frame), expected, atol=1e-6)
    whole = Brightness(gain=(0.0, 1.0, 0.0), pace="gentle")
    gains = [whole.truth(CANVAS, frame)["gain"] for frame in range(25)]
    assert (gains[0], gains[6], gains[12], gains[24]) == pytest.approx((0, 0.5, 1, 0), abs=1e-12)
    assert gains[1] < 0.25 * (gains[7] - gains[6]) + 0.01


def test_brightness_swings():
    wave = Brightness(gain=(0.8,), swing=0.25, period=12)
    for frame in range(25):
        gain = wave.truth(CANVAS, frame)["gain"]
        assert gain == pytest.approx(0.8 * (1 + 0.25 * math.sin(2 * math.pi * frame / 12)))
    assert Brightness().light(RAMP, CANVAS, 3) is RAMP


def test_frames_have_the_gain_that_is_told():
    base = {"gradient": {"from": [0.1, 0.2, 0.3], "to": [0.5, 0.4, 0.6]}}
    effects = {"kind": "flash", "at": [2], "frames": 1, "gain": 1.4}, {"kind": "brightness", "gain": [0.6, 1.1]}
    plain, lit = Clip(scene(base)), Clip(scene(base, *effects))
    for number in range(6):
        known = truth(lit, number)
        expected = plain.picture(number) * known["flash-1.gain"] + known["flash-1.offset"]
        expected = np.clip(expected, 0, 1) * known["brightness-1.gain"]
        np.testing.assert_allclose(lit.frame(number), expected * 255, atol=0.501)


@pytest.mark.parametrize("lobe", ["gaussian", "glossy"])
def test_a_highlight_adds_its_lobe_and_is_clipped(lobe):
    spot = Highlight(path=((0.2, 0.5), (0.8, 0.5)), lobe=lobe, radius=0.1, strength=(0.9,), color=(1, 0.5, 0))
    x, y = np.broadcast_arrays(*CANVAS.centres())
    known = spot.truth(CANVAS, 12)
    np.testing.assert_allclose(known["center"], [30, 20])
    square = ((x - 30) ** 2 + (y - 20) ** 2) / 4**2
    expected = 0.9 * (np.exp(-square / 2) if lobe == "gaussian" else 1 / (1 + square) ** 2)
    np.testing.assert_allclose(known["light"], expected, atol=1e-6)
    picture = spot.paint(RAMP, CANVAS, 12)
    np.testing.assert_allclose(picture, np.clip(RAMP + expected[..., None] * [1, 0.5, 0], 0, 1), atol=1e-6)
    assert picture.max() == 1
    assert spot.coverage(x, y, CANVAS, 12) is None


def test_a_highlight_moves_grows_and_is_seen_for_a_while():
    spot = Highlight(path=((0, 0), (1, 0)), at=(5, 15), strength=(0.2, 0.6), start=3, end=20)
    assert spot.truth(CANVAS, 10)["center"][0] == pytest.approx(30)
    x = CANVAS.centres()[0][0] - 30
    assert spot.truth(CANVAS, 10)["light"][0, np.abs(x).argmin()] == pytest.approx(0.4, rel=0.05)
    for frame in (2, 20):
        assert spot.paint(RAMP, CANVAS, frame) is RAMP
        assert not spot.truth(CANVAS, frame)["light"].any()
        assert np.isnan(spot.truth(CANVAS, frame)["center"]).all()
    jumping = Highlight(path=((0.2, 0.5), (0.8, 0.5)), at=(0, 9), pace="jump")
    assert [jumping.truth(CANVAS, frame)["center"][0] for frame in (8, 9)] == pytest.approx([12, 48])


@pytest.mark.parametrize(
    ("kind", "wrong", "message"),
    [
        (Flash, {"at": []}, "at is .*a list of 1 to"),
        (Flash, {"at": [1], "frames": 0}, "frames is 0"),
        (Flash, {}, "at is missing: the first frame of each flash"),
        (Brightness, {"gain": [1, 2, 3], "at": [0, 1]}, "gain has 3 values"),
        (Brightness, {"gain": [-1]}, "gain is .*from 0 to 100"),
        (Highlight, {"strength": []}, "strength is"),
        (Highlight, {"path": [[0, 0], [1, 1]], "strength": [1, 2, 3]}, "path has 2 values"),
        (Highlight, {"start": 4, "end": 1}, "end is 1; it must be after start"),
        (Highlight, {"radius": 0}, "radius is 0"),
    ],
)
def test_light_that_cannot_be_is_refused(kind, wrong, message):
    with pytest.raises(UsageError, match=message):
        kind.from_table(wrong)
