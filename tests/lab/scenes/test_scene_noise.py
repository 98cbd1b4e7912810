import numpy as np
import pytest
from scene_cases import scene

from gsvc_base.draws import Draws
from gsvc_lab.scenes import Clip, truth
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effects.grain import Grain
from gsvc_lab.scenes.effects.noise import Noise

CANVAS = Canvas(256, 200, 10)


def flat(level):
    return np.full((200, 256, 3), level, np.float32)


def developed(effect, level, seed=0):
    """What an effect adds to a flat picture, (H, W, 3) f8."""
    picture = effect.develop(flat(level), CANVAS, 0, Draws(seed))
    return picture.astype(np.float64) - np.float32(level)


def correlation(a, b):
    return np.corrcoef(a.ravel(), b.ravel())[0, 1]


@pytest.mark.parametrize("level", [0.1, 0.4, 0.8])
def test_noise_has_the_deviation_that_it_tells(level):
    noise = Noise(read=0.01, shot=0.04)
    known = noise.truth(CANVAS, 0)
    expected = np.sqrt(known["read"] ** 2 + known["shot"] ** 2 * level)
    added = developed(noise, level)
    # 153,600 samples: the deviation is known to 0.2 %, the mean to 0.3 % of it, by one standard error.
    assert added.std() == pytest.approx(expected, rel=0.01)
    assert abs(added.mean()) < 0.01 * expected
    np.testing.assert_allclose(noise.sigma(flat(level)), expected, rtol=1e-6)


def test_noise_is_independent_between_pixels_channels_and_frames():
    noise = Noise(read=0.05, shot=0)
    added = developed(noise, 0.5)
    assert abs(correlation(added[:, 1:], added[:, :-1])) < 0.015
    assert abs(correlation(added[1:], added[:-1])) < 0.015
    assert abs(correlation(added[..., 0], added[..., 1])) < 0.02
    clip = Clip(scene({"color": [0.5] * 3}, {"kind": "noise", "read": 0.05}, size=(200, 160), frames=3))
    frames = [frame.astype(float) for frame in clip]
    assert abs(correlation(frames[0], frames[1])) < 0.015
    assert abs(correlation(frames[0], frames[2])) < 0.015


def test_noise_of_nothing_is_nothing():
    assert not developed(Noise(read=0, shot=0), 0.5).any()
    assert not developed(Grain(strength=0), 0.5).any()


@pytest.mark.parametrize("level", [0.0, 0.25, 0.5])
def test_grain_follows_the_tones(level):
    grain = Grain(strength=0.06, size=0.008)
    expected = 0.06 * (0.25 + 0.75 * 4 * level * (1 - level))
    np.testing.assert_allclose(grain.sigma(flat(level)), expected, rtol=1e-5)
    if level > 0:  # in black half of it is clipped
        # A clump is 4 pi size^2 = 32 pixels large, so that one frame knows its deviation to 1.8 %, 16 to 0.45 %.
        variance = np.mean([developed(grain, level, seed).var() for seed in range(16)])
        assert np.sqrt(variance) == pytest.approx(expected, rel=0.015)
        assert grain.truth(CANVAS, 0) == {"strength": 0.06, "size": pytest.approx(1.6)}


def test_grain_is_clumped_by_its_law():
    size = 2.0  # pixels
    added = developed(Grain(strength=0.1, size=size / 200, color=1), 0.5)
    for distance in (1, 2, 4, 6):
        expected = np.exp(-(distance**2) / (4 * size**2))
        assert correlation(added[:, distance:], added[:, :-distance]) == pytest.approx(expected, abs=0.03)
        assert correlation(added[distance:], added[:-distance]) == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize("color", [0.0, 0.3, 1.0])
def test_grain_has_a_part_of_its_own_in_each_colour(color):
    added = developed(Grain(strength=0.05, size=0.005, color=color), 0.5)
    assert correlation(added[..., 0], added[..., 2]) == pytest.approx(1 - color, abs=0.03)
    assert added.std() == pytest.approx(0.05, rel=0.02)


@pytest.mark.parametrize("kind", ["noise", "grain"])
def test_same_seed_same_bytes_in_any_order_of_frames(kind):
    def drawn(seed, order=range(4)):
        clip = Clip(scene({"color": [0.5] * 3}, {"kind": kind}, frames=4, seed=seed))
        frames = {number: clip.frame(number) for number in order}
        return [frames[number].tobytes() for number in range(4)]

    assert drawn(1) == drawn(1, [3, 1, 0, 2])
    assert len({*drawn(1), *drawn(2)}) == 8


def test_two_of_a_kind_draw_differently_and_neither_changes_the_other():
    noise = {"kind": "noise", "read": 0.05, "shot": 0}
    one = Clip(scene({"color": [0.5] * 3}, noise, size=(100, 80)))
    two = Clip(scene({"color": [0.5] * 3}, noise, noise, size=(100, 80)))
    first = one.frame(1) / 255 - 0.5
    second = two.frame(1) / 255 - 0.5 - first
    assert abs(correlation(first, second)) < 0.03
    assert second.std() == pytest.approx(0.05, rel=0.03)
    assert truth(two, 1)["noise-2.read"] == 0.05


def test_samples_stay_in_range():
    for level in (0.0, 1.0):
        for effect in (Noise(read=0.3), Grain(strength=0.5)):
            picture = effect.develop(flat(level), CANVAS, 0, Draws(0))
            assert 0 <= picture.min() < picture.max() <= 1
            assert (picture == level).mean() > 0.3  # about half of what is added is clipped
