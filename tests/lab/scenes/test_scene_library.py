import numpy as np
import pytest

from gsvc_lab.scenes import EFFECTS, Clip, Scene, scene_names, truth
from gsvc_lab.scenes.effect import kind_of

NAMES = (
    "static", "talking-head", "pan", "zoom", "rotation", "cut", "cross-fade", "flash", "fade", "grain", "noise",
    "motion-blur", "text", "highlight", "water", "shapes", "occlusion", "appearing", "jumping-circle", "many",
)  # fmt: skip


def small(name, width=64):
    scene = Scene.named(name)
    return scene.resized(width=width, height=round(scene.height * width / scene.width))


def equal_frames(name):
    """The numbers of the frames that are equal to the one before."""
    frames = list(Clip(small(name)))
    return [number for number in range(1, len(frames)) if (frames[number] == frames[number - 1]).all()]


def test_the_library_has_its_scenes():
    assert set(NAMES) <= set(scene_names())


@pytest.mark.parametrize("name", scene_names())
def test_a_scene_is_small_short_and_drawn_at_any_size(name):
    scene = Scene.named(name)
    assert scene.width <= 352
    assert scene.height <= 288
    assert 24 <= scene.frames <= 60
    assert not scene.title.endswith(".")
    tiny = scene.resized(31, 25)
    last = scene.frames - 1
    clip = Clip(tiny)
    frames = [clip.frame(number) for number in (0, last // 2, last)]
    assert {(frame.shape, frame.dtype.name) for frame in frames} == {((25, 31, 3), "uint8")}
    assert frames[1].std() > 4
    # The same bytes, whatever was drawn before.
    assert (Clip(tiny).frame(last) == frames[2]).all()


def test_every_kind_of_effect_is_in_some_scene():
    used = {kind_of(effect) for name in scene_names() for effect in Scene.named(name).effects}
    assert used == set(EFFECTS)


def test_what_is_still_is_still():
    assert equal_frames("static") == list(range(1, 48))
    assert equal_frames("cut") == [number for number in range(1, 48) if number != 24]
    assert equal_frames("jumping-circle") == [number for number in range(1, 24) if number != 12]
    assert equal_frames("appearing") == [number for number in range(1, 48) if number not in (10, 22, 34, 42)]
    assert equal_frames("noise") == equal_frames("water") == equal_frames("talking-head") == []


@pytest.mark.parametrize("name", NAMES)
def test_cuts_are_where_they_are_told(name):
    clip = Clip(small(name))
    cuts = [number for number in range(clip.scene.frames) if truth_of_cut(clip, number)]
    assert cuts == {"cut": [24], "many": [14]}.get(name, [])


def truth_of_cut(clip, number):
    return number > 0 and not set(clip.shown(number)) & set(clip.shown(number - 1))


def test_the_circle_jumps_from_the_left_half_to_the_right_one():
    clip = Clip(Scene.named("jumping-circle"))
    for number, half in ((11, slice(0, 128)), (12, slice(128, 256))):
        mask = truth(clip, number)["shape-1.mask"]
        assert mask[:, half].sum() == pytest.approx(mask.sum())
        assert mask.sum() == pytest.approx(np.pi * 36**2, rel=0.001)


def test_only_the_middle_of_a_talking_head_moves():
    clip = Clip(small("talking-head", 176))
    moved = np.any([np.hypot(*truth(clip, number)["motion"]) > 1e-6 for number in range(1, 20, 3)], axis=0)
    assert moved[:, 40:136].mean() > 0.6
    assert not moved[:, :12].any()
    assert not moved[:, -12:].any()
    assert not moved[-2:].any()


def test_posts_hide_the_ball_and_the_ball_the_cat():
    clip = Clip(small("occlusion", 176))
    ball, *posts = clip.objects.values()
    x, y = np.broadcast_arrays(*clip.canvas.centres())
    hidden = []
    for number in range(0, 48, 4):
        front = np.max([post.coverage(x, y, clip.canvas, number) for post in posts], axis=0)
        hidden.append((ball.coverage(x, y, clip.canvas, number) * front).sum())
    assert max(hidden) > 1000 > 1 > hidden[0]
