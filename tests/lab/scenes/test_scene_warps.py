import math

import numpy as np
import pytest
from scene_cases import WAVES_SIZE, scene, waves, waves_file

from gsvc_base.draws import Draws
from gsvc_lab.scenes import Clip, Scene, truth
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effects.sway import Sway
from gsvc_lab.scenes.effects.water import Water

CANVAS = Canvas(240, 200, 20)


def grid(canvas=CANVAS):
    return np.broadcast_arrays(*canvas.centres())


def prepared(water, seed=0, canvas=CANVAS):
    return water.prepare(canvas, lambda: Draws(seed))


def test_water_has_the_strength_that_is_asked_for():
    # Over all phases of its waves; in one frame the sum of a few waves may be stronger or weaker.
    canvas, squares = Canvas(120, 100, 20), []
    for seed in range(40):
        water = prepared(Water(strength=0.01, wavelength=0.1), seed, canvas)
        right, below = water.displacement(*canvas.centres(), canvas, 3)
        squares.append(np.mean(right**2 + below**2))
    assert math.sqrt(np.mean(squares)) == pytest.approx(0.01 * 100, rel=0.03)


def test_water_is_the_slope_of_a_surface_that_moves_smoothly():
    water = prepared(Water(wavelength=0.3))
    x, y = grid()
    right, below = water.displacement(x, y, CANVAS, 5)
    # Without curl: d right / dy = d below / dx.
    step = 1e-4
    across = (water.displacement(x, y + step, CANVAS, 5)[0] - right) / step
    down = (water.displacement(x + step, y, CANVAS, 5)[1] - below) / step
    np.testing.assert_allclose(across, down, atol=1e-5)
    later = [water.displacement(x, y, CANVAS, 5 + part)[0] for part in (0.5, 1, 1.5, 2)]
    assert np.abs(later[1] - right).max() < 0.5 * np.abs(right).max()
    np.testing.assert_allclose(later[0], (right + later[1]) / 2, atol=0.02 * np.abs(right).max())


def test_rows_and_columns_give_the_same_as_whole_arrays():
    water, sway = prepared(Water()), Sway()
    for effect in (water, sway):
        for lean, full in zip(
            effect.displacement(*CANVAS.centres(), CANVAS, 4), effect.displacement(*grid(), CANVAS, 4), strict=True
        ):
            np.testing.assert_allclose(lean, full, atol=1e-12)


def test_a_wave_passes_by_in_its_period():
    water = prepared(Water(waves=1, period=20, shading=0))
    x, y = grid()
    (wave,) = water._waves
    period = 2 * math.pi / wave.omega
    assert 20 / math.sqrt(1.6) <= period <= 20 * math.sqrt(1.6)
    for now, then in zip(
        water.displacement(x, y, CANVAS, 1), water.displacement(x, y, CANVAS, 1 + period), strict=True
    ):
        np.testing.assert_allclose(now, then, atol=1e-9)


def test_another_seed_is_other_water_and_the_same_the_same():
    def frame(seed):
        return Clip(scene({"checker": {}}, {"kind": "water"}, seed=seed)).frame(2).tobytes()

    assert frame(1) == frame(1) != frame(2)


def test_above_the_shore_nothing_changes():
    base = {"checker": {"size": 0.1}}
    still = Clip(scene(base, size=(60, 80))).frame(0)
    for number, frame in enumerate(Clip(scene(base, {"kind": "water", "shore": 0.5}, size=(60, 80)))):
        np.testing.assert_array_equal(frame[:40], still[:40], err_msg=f"frame {number}")
        assert (frame[52:] != still[52:]).any()


def test_shading_follows_the_slope_and_can_be_left_out():
    grey = np.full((200, 240, 3), 0.5, np.float32)
    dull = prepared(Water(shading=0))
    assert dull.shade(grey, CANVAS, 2) is grey
    shaded = prepared(Water(shading=0.2)).shade(grey, CANVAS, 2)[..., 0]
    right, below = dull.displacement(*grid(), CANVAS, 2)
    assert np.corrcoef((right + below).ravel(), shaded.ravel())[0, 1] > 0.999
    assert prepared(Water(strength=0)).shade(grey, CANVAS, 2) is grey


WARPS = [
    {"kind": "water", "shading": 0, "wavelength": 0.4},
    {"kind": "sway", "reach": [0.06, 0.04], "turn": 8, "period": 9},
]


@pytest.mark.parametrize("warp", WARPS)
def test_pixels_are_read_where_the_truth_says(tmp_path, warp):
    base = {"image": waves_file(tmp_path)}
    table = {"title": "A test", "size": WAVES_SIZE, "frames": 6, "base": base, "effects": [warp]}
    clip = Clip(Scene.from_dict(table, tmp_path))
    known = truth(clip, 4)
    right, below = known[f"{warp['kind']}-1.displacement"]
    assert np.hypot(right, below).max() > 0.5
    x, y = grid(clip.canvas)
    inner = (x + right > 4) & (x + right < 92) & (y + below > 4) & (y + below < 60)
    expected = waves(x + right, y + below)
    np.testing.assert_allclose(clip.picture(4)[inner], expected[inner], atol=4e-3)


@pytest.mark.parametrize("warp", WARPS)
def test_what_moves_is_where_the_motion_says(tmp_path, warp):
    base = {"image": waves_file(tmp_path)}
    table = {"title": "A test", "size": WAVES_SIZE, "frames": 6, "base": base, "effects": [warp]}
    clip = Clip(Scene.from_dict(table, tmp_path))
    right, below = truth(clip, 4)["motion"].astype(float)
    x, y = grid(clip.canvas)
    x_before, y_before = x - right, y - below
    # Both read the same point of the base.
    now, before = clip.displacement(x, y, 4), clip.displacement(x_before, y_before, 3)
    np.testing.assert_allclose(x + now[0], x_before + before[0], atol=1e-5)
    np.testing.assert_allclose(y + now[1], y_before + before[1], atol=1e-5)


def test_a_head_moves_as_a_whole_and_the_background_stands_still():
    sway = Sway(place=(0.5, 0.5), width=0.8, height=0.6, reach=(0.05, 0.02), turn=0, period=16)
    x, y = grid()
    for time in range(20):
        right, below = sway.displacement(x, y, CANVAS, time)
        radius = np.hypot((x - 120) / 80, (y - 100) / 60)
        assert not right[radius >= 1].any()
        assert not below[radius >= 1].any()
        phase = 2 * math.pi * time / 16
        np.testing.assert_allclose(right[radius <= 0.5], -10 * math.sin(phase), atol=1e-9)
        np.testing.assert_allclose(below[radius <= 0.5], -4 * math.sin(2 * phase), atol=1e-9)


def test_a_head_turns_about_its_middle():
    sway = Sway(place=(0.5, 0.5), reach=(0, 0), turn=10, period=16)
    right, below = sway.displacement(np.array([130.0]), np.array([100.0]), CANVAS, 0)
    # It has turned clockwise by 10 degrees, so that what is 10 pixels right of the middle was 10 degrees above.
    assert (right[0], below[0]) == pytest.approx(
        (10 * math.cos(math.radians(10)) - 10, -10 * math.sin(math.radians(10)))
    )


def test_outside_of_the_head_frames_stay_equal():
    clip = Clip(scene({"checker": {"size": 0.07}}, {"kind": "sway", "width": 0.5, "height": 0.5}, size=(90, 60)))
    still = Clip(scene({"checker": {"size": 0.07}}, size=(90, 60))).frame(0)
    x, y = grid(clip.canvas)
    outside = np.hypot(x - 45, y - 30) > 15
    for frame in clip:
        np.testing.assert_array_equal(frame[outside], still[outside])
        assert (frame != still).any()
