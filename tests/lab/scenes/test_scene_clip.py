import hashlib
import math
import subprocess
import sys

import numpy as np
import pytest
from scene_cases import WAVES_SIZE, scene, waves, waves_file

from gsvc_base.errors import GsvcError
from gsvc_lab.scenes import EFFECTS, Base, Camera, Clip, Scene, effect_class, frames
from gsvc_lab.scenes import seeds as seeds_module
from gsvc_lab.scenes.camera import View
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import Effect
from gsvc_lab.scenes.effects.cross_fade import CrossFade
from gsvc_lab.scenes.effects.motion_blur import MotionBlur
from gsvc_lab.scenes.paths import progress
from gsvc_ref.video import encode_png

COLOR = {"color": (0.2, 0.4, 0.6)}
PAN = {"kind": "pan", "from": (0.4, 0.5), "to": (0.6, 0.5), "span": 0.5}
EXAMPLES = {
    "pan": PAN,
    "zoom": {"kind": "zoom", "to": 0.3},
    "rotation": {"kind": "rotation", "to": 30},
    "cut": {"kind": "cut", "at": 3, "to": {"color": (1, 0, 0)}},
    "cross-fade": {"kind": "cross-fade", "start": 1, "end": 4, "to": {"color": (1, 0, 0)}},
    "shape": {"kind": "shape", "form": "ball"},
    "text": {"kind": "text", "text": "HI"},
    "highlight": {"kind": "highlight"},
    "flash": {"kind": "flash", "at": [2]},
    "brightness": {"kind": "brightness", "gain": [1, 0.5]},
    "motion-blur": {"kind": "motion-blur"},
    "grain": {"kind": "grain"},
    "noise": {"kind": "noise"},
    "water": {"kind": "water"},
    "sway": {"kind": "sway"},
}


def digest(found: Scene) -> str:
    return hashlib.sha256(b"".join(frame.tobytes() for frame in frames(found))).hexdigest()


def test_every_effect_has_an_example_here_that_changes_the_picture():
    assert set(EXAMPLES) == set(EFFECTS)
    base = {"gradient": {"from": (0, 0.2, 1), "to": (1, 0.4, 0)}}
    plain = digest(scene(base, PAN))
    for kind, table in EXAMPLES.items():
        assert kind == "pan" or digest(scene(base, PAN, table)) != plain, kind


def test_frames_are_what_a_video_has():
    drawn = list(frames(scene(COLOR, size=(7, 5), frames=3)))
    assert [(frame.shape, frame.dtype) for frame in drawn] == [((5, 7, 3), np.uint8)] * 3
    assert (np.array(drawn) == np.rint(np.array([0.2, 0.4, 0.6]) * 255)).all()
    assert next(frames(scene(COLOR, size=(1, 1)))).shape == (1, 1, 3)


def test_values_between_two_codes_are_rounded_half_to_even(monkeypatch):
    halves = np.float32([[[1, 3, 5]]]) / np.float32(510)
    assert (halves * 255).tolist() == [[[0.5, 1.5, 2.5]]]
    monkeypatch.setattr(Clip, "picture", lambda *_: halves)
    assert next(frames(scene(COLOR, size=(1, 1)))).tolist() == [[[0, 2, 2]]]


@pytest.mark.parametrize("kind", EFFECTS)
def test_the_same_seed_gives_the_same_bytes_in_any_order_of_frames(kind):
    found = scene({"noise": {}}, EXAMPLES[kind], frames=5, seed=3)
    once = [frame.tobytes() for frame in frames(found)]
    clip = Clip(found)
    assert [clip.frame(number).tobytes() for number in (4, 2, 0, 3, 1)] == [once[n] for n in (4, 2, 0, 3, 1)]


def test_a_frame_may_be_changed_by_whoever_asked_for_it():
    clip = Clip(scene(COLOR))
    clip.frame(0)[:] = 0
    assert clip.frame(0).any()


class Counted:
    """Counts the calls of a function."""

    def __init__(self, function):
        self.function, self.calls = function, 0

    def __call__(self, *arguments, **settings):
        self.calls += 1
        return self.function(*arguments, **settings)


def test_a_scene_without_effects_draws_its_base_once(monkeypatch):
    drawn = Counted(Base.picture)
    read = Counted(View._read)
    generators = Counted(np.random.default_rng)
    monkeypatch.setattr(Base, "picture", lambda *arguments: drawn(*arguments))
    monkeypatch.setattr(View, "_read", lambda *arguments: read(*arguments))
    monkeypatch.setattr(np.random, "default_rng", generators)
    found = list(frames(scene({"photograph": "coffee"}, frames=20)))
    assert (drawn.calls, read.calls, generators.calls) == (1, 1, 0)
    assert all((frame == found[0]).all() for frame in found)


def test_what_is_not_shown_is_not_drawn(monkeypatch):
    drawn = Counted(Base.picture)
    monkeypatch.setattr(Base, "picture", lambda *arguments: drawn(*arguments))
    clip = Clip(scene(COLOR, EXAMPLES["cut"], EXAMPLES["cross-fade"]))
    assert drawn.calls == 0
    clip.frame(0)
    assert drawn.calls == 1
    clip.frame(2)  # the fade has begun
    assert drawn.calls == 2


def test_a_slide_show_keeps_few_pictures():
    colors = [(number / 10, 0, 0) for number in range(8)]
    cuts = [{"kind": "cut", "at": number, "to": {"color": color}} for number, color in enumerate(colors) if number]
    clip = Clip(scene({"color": colors[0]}, *cuts, frames=8))
    for number in (0, 1, 2, 3, 4, 5, 6, 7, 1, 0):
        assert (clip.frame(number)[0, 0] == np.rint(np.array(colors[number]) * 255)).all()
        assert len(clip._views) <= 4


def test_a_camera_that_has_arrived_costs_nothing_more(monkeypatch):
    read = Counted(View._read)
    monkeypatch.setattr(View, "_read", lambda *arguments: read(*arguments))
    list(frames(scene({"photograph": "coffee"}, PAN | {"end": 2}, frames=10)))
    assert read.calls == 3


def test_only_effects_that_are_named_are_imported_and_no_scenes_by_reading_video():
    program = """
import sys
import gsvc_lab.scenes
heavy = {name for name in sys.modules if name.startswith(("numpy", "scipy", "skimage", "PIL"))}
assert heavy == set(), heavy
import gsvc_ref.video
names = {name for name in sys.modules if name.startswith("gsvc_lab.scenes.")}
assert names == {"gsvc_lab.scenes.names", "gsvc_lab.scenes.built_in"}, names
from gsvc_lab.scenes import Scene, frames
list(frames(Scene.from_dict({"title": "t", "size": [4, 3], "frames": 2, "base": {"color": [0, 0, 0]}})))
assert "skimage" not in sys.modules
prefix = "gsvc_lab.scenes.effects."
assert {name for name in sys.modules if name.startswith(prefix)} == set()
pan = {"kind": "pan", "to": [0.5, 0.5]}
list(frames(Scene.from_dict(
    {"title": "t", "size": [4, 3], "frames": 2, "base": {"color": [0, 0, 0]}, "effects": [pan]}
)))
assert {name for name in sys.modules if name.startswith(prefix)} == {prefix + "pan"}
"""
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.parametrize("kind", EFFECTS)
def test_hooks_of_effects_that_are_not_named_are_not_called(kind, monkeypatch):
    hooks = ("move", "displacement", "shade", "replace", "paint", "light", "moments", "develop", "prepare", "truth")
    effect = effect_class(kind)

    def refuse(*_arguments, **_settings):
        raise AssertionError(f"{kind} takes part without being named")

    for hook in hooks:
        if hook in vars(effect):
            monkeypatch.setattr(effect, hook, refuse)
    list(frames(scene(COLOR, *(table for name, table in EXAMPLES.items() if name != kind), size=(16, 12), frames=5)))


@pytest.mark.parametrize("kind", [kind for kind in EFFECTS if kind not in ("grain", "noise")])
def test_an_effect_more_changes_nothing_that_others_draw(kind):
    """The random parts of grain and noise are the same with and without the effect, described before or after them."""
    drawn = []

    def draws(*tables):
        drawn.clear()
        for _ in frames(scene(COLOR, *tables, size=(16, 12), frames=4, seed=5)):
            pass
        return [(name, numbers, rng) for name, numbers, rng in drawn if name.startswith(("grain", "noise"))]

    def recorded(seed, name, *numbers):
        rng = original(seed, name, *numbers)
        drawn.append((name, numbers, rng.words(1)[0]))
        return rng

    original = seeds_module.generator
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gsvc_lab.scenes.clip.generator", recorded)
        alone = draws(EXAMPLES["grain"], EXAMPLES["noise"])
        assert alone
        assert draws(EXAMPLES[kind], EXAMPLES["grain"], EXAMPLES["noise"]) == alone
        assert sorted(draws(EXAMPLES["noise"], EXAMPLES["grain"], EXAMPLES[kind]), key=str) == sorted(alone, key=str)


def test_generators_are_told_apart():
    states = [
        seeds_module.generator(*arguments).words(1)[0]
        for arguments in [(0, "a"), (1, "a"), (0, "b"), (0, "a", 0), (0, "a", 1), (0, "a", 1, 0)]
    ]
    assert len(set(states)) == len(states)


def test_a_cut_never_blends_and_is_where_it_says():
    found = scene(COLOR, EXAMPLES["cut"], {"kind": "motion-blur", "shutter": 1.0}, size=(4, 3))
    colors = [frame[0, 0].tolist() for frame in frames(found)]
    assert colors == [[51, 102, 153]] * 3 + [[255, 0, 0]] * 3


def test_a_cross_fade_is_the_mixture_that_it_tells():
    found = scene(COLOR, EXAMPLES["cross-fade"], size=(4, 3))
    shares = [0, 0, 1 / 3, 2 / 3, 1, 1]
    for share, frame in zip(shares, frames(found), strict=True):
        expected = (1 - share) * np.array([0.2, 0.4, 0.6]) + share * np.array([1, 0, 0])
        assert np.abs(frame - expected * 255).max() <= 0.51
    fade = CrossFade(to=Base(color=(1, 0, 0)), start=1, end=4)
    told = [fade.truth(Canvas(4, 3, 6), time)["share"] for time in range(6)]
    np.testing.assert_allclose(told, shares)


def test_motion_blur_is_the_mean_of_its_moments(tmp_path):
    base = {"image": waves_file(tmp_path)}
    blur = MotionBlur(shutter=0.75, moments_=5)
    sharp = Scene.from_dict({"title": "t", "size": WAVES_SIZE, "frames": 6, "base": base, "effects": [PAN]}, tmp_path)
    blurred = Clip(Scene.from_dict({**vars_of(sharp), "effects": [PAN, blur]}, tmp_path))
    clip = Clip(sharp)
    times = blur.moments(3)
    assert np.mean(times) == pytest.approx(3)
    np.testing.assert_allclose(np.diff(times), 0.15)
    mean = np.mean([clip.picture(time) for time in times], axis=0)
    assert np.abs(blurred.frame(3) - mean * 255).max() <= 0.51
    assert (blurred.frame(3) != clip.frame(3)).any()


def vars_of(found: Scene) -> dict:
    return {"title": found.title, "size": (found.width, found.height), "frames": found.frames, "base": found.base}


def test_motion_blur_of_what_stands_still_changes_nothing():
    still = scene({"photograph": "chelsea"})
    assert digest(still) == digest(scene({"photograph": "chelsea"}, EXAMPLES["motion-blur"]))


@pytest.mark.parametrize(
    ("table", "where"),
    [
        (PAN, lambda x, y, share: (96 * (0.4 + 0.2 * share) + (x - 48) * 0.5, 32 + (y - 32) * 0.5)),
        (
            {"kind": "zoom", "from": 0.8, "to": 0.2, "at": (0.4, 0.6)},
            lambda x, y, share: (
                38.4 + (x - 48) * 0.8 * 0.25**share, 38.4 + (y - 32) * 0.8 * 0.25**share,
            ),
        ),
        (
            {"kind": "rotation", "from": -20, "to": 40, "span": 0.5},
            lambda x, y, share: (
                48 + (x - 48) * 0.5 * math.cos(math.radians(60 * share - 20))
                - (y - 32) * 0.5 * math.sin(math.radians(60 * share - 20)),
                32 + (x - 48) * 0.5 * math.sin(math.radians(60 * share - 20))
                + (y - 32) * 0.5 * math.cos(math.radians(60 * share - 20)),
            ),
        ),
    ],
    ids=["pan", "zoom", "rotation"],
)  # fmt: skip
def test_the_camera_shows_what_stands_where_it_says(tmp_path, table, where):
    """Against the waves' own formula, at positions written down here again."""
    found = Scene.from_dict(
        {"title": "t", "size": WAVES_SIZE, "frames": 6, "base": {"image": waves_file(tmp_path)}, "effects": [table]},
        tmp_path,
    )
    x, y = Canvas(*WAVES_SIZE, 6).centres()
    clip = Clip(found)
    for number in (0, 2, 5):
        expected = waves(*np.broadcast_arrays(*where(x, y, number / 5)))
        np.testing.assert_allclose(clip.picture(number)[4:-4, 4:-4], expected[4:-4, 4:-4], atol=2e-3)


def test_moves_one_after_the_other():
    first = {"kind": "pan", "from": (0.2, 0.5), "to": (0.6, 0.5), "start": 1, "end": 3, "span": 0.4}
    second = {"kind": "pan", "to": (0.6, 0.1), "start": 4, "end": 6}
    clip = Clip(scene(COLOR, first, second, {"kind": "rotation", "to": 90, "start": 6, "end": 7}, frames=9))
    stands = [(round(c.x, 6), round(c.y, 6), c.span, round(c.roll, 6)) for c in map(clip.camera, range(9))]
    a, b, c, d = (0.5, 0.5, 1.0, 0.0), (0.2, 0.5, 0.4, 0.0), (0.6, 0.5, 0.4, 0.0), (0.6, 0.1, 0.4, 0.0)
    turned = (*d[:3], round(math.pi / 2, 6))
    assert stands == [a, b, (0.4, 0.5, 0.4, 0.0), c, c, (0.6, 0.3, 0.4, 0.0), d, turned, turned]


@pytest.mark.parametrize(
    "table",
    [
        {"kind": "pan", "from": (0.2, 0.5), "to": (0.6, 0.5)},
        {"kind": "zoom", "from": 0.5, "to": 0.4},
        {"kind": "rotation", "from": 40, "to": 50},
    ],
)
def test_an_open_shutter_never_sees_both_sides_of_a_jump_of_the_camera(table):
    clip = Clip(scene(COLOR, table | {"start": 3, "end": 5}))
    for frame, jumped in ((2, False), (3, True)):
        assert {clip.camera(frame + part) != Camera(0.5, 0.5, 1.0) for part in (-0.49, 0, 0.49)} == {jumped}
    assert clip.camera(2.51) == clip.camera(3)


@pytest.mark.parametrize(
    ("time", "pace", "share"),
    [(0, "even", 0), (2, "even", 0), (3, "even", 0.25), (6, "even", 1), (99, "even", 1), (-0.5, "even", 0),
     (4, "gentle", 0.5), (3, "gentle", 0.5 - math.sqrt(0.5) / 2), (6, "gentle", 1)],
)  # fmt: skip
def test_progress(time, pace, share):
    assert progress(time, 2, 6, 20, pace) == pytest.approx(share)
    assert progress(time, 2, None, 7, pace) == pytest.approx(share)


def test_progress_in_a_clip_of_one_frame():
    assert progress(0, 0, None, 1) == 0


def test_a_gradient_is_even_and_has_its_colours_at_its_ends():
    picture = Base(gradient={"from": (0, 0, 1), "to": (1, 0, 0)}).picture(Canvas(10, 4, 1), 0)
    np.testing.assert_allclose(picture[2, :, 0], (np.arange(10) + 0.5) / 10, atol=1e-6)
    np.testing.assert_allclose(picture[..., 0] + picture[..., 2], 1, atol=1e-6)
    down = Base(gradient={"from": (0, 0, 0), "to": (1, 1, 1), "angle": 90}).picture(Canvas(10, 4, 1), 0)
    np.testing.assert_allclose(down[:, 3, 1], (np.arange(4) + 0.5) / 4, atol=1e-6)


def test_a_checker_has_half_of_each_colour_and_its_squares_where_it_says():
    checker = Base(checker={"size": 0.25, "first": (1, 1, 1), "second": (0, 0, 0)})
    picture = checker.picture(Canvas(40, 40, 1), 0)[..., 0]  # squares of 10 pixels, one of them in the middle
    assert picture.mean() == pytest.approx(0.5, abs=0.01)
    assert (picture[15:25, 15:25] == 1).all()
    np.testing.assert_allclose(picture[15:25, 25:35], 0, atol=1e-12)
    shifted = checker.picture(Canvas(41, 40, 1), 0)[..., 0]  # the edges of the middle square now halve a pixel
    np.testing.assert_allclose(shifted[20, 14:28], [0, 0.5, *[1] * 9, 0.5, 0, 0], atol=1e-12)


def test_noise_has_its_mean_and_contrast_and_depends_on_the_seed():
    noise = Base(noise={"size": 0.05, "mean": (0.3, 0.5, 0.6), "contrast": 0.1})
    picture = noise.picture(Canvas(200, 150, 1), 1)
    np.testing.assert_allclose(picture.mean(axis=(0, 1)), (0.3, 0.5, 0.6), atol=0.02)
    assert picture.std(axis=(0, 1)) == pytest.approx([0.1] * 3, rel=0.1)
    assert (picture == noise.picture(Canvas(200, 150, 1), 1)).all()
    assert (picture != noise.picture(Canvas(200, 150, 1), 2)).any()


@pytest.mark.parametrize("depth", [8, 16])
def test_an_image_of_the_frames_size_is_shown_as_it_is(tmp_path, depth):
    peak = 2**depth - 1
    samples = np.random.default_rng(0).integers(0, peak, (9, 12, 3), endpoint=True)
    image = samples.astype(np.uint8 if depth == 8 else np.uint16)
    (tmp_path / "a.png").write_bytes(encode_png(image, depth))
    found = Scene.from_dict({"title": "t", "size": (12, 9), "frames": 1, "base": {"image": "a.png"}}, tmp_path)
    np.testing.assert_array_equal(next(frames(found)), np.rint(samples / peak * 255))


def test_an_image_that_cannot_be_read_says_which(tmp_path):
    (tmp_path / "a.png").write_bytes(b"no picture")
    found = Scene.from_dict({"title": "t", "size": (12, 9), "frames": 1, "base": {"image": "a.png"}}, tmp_path)
    with pytest.raises(GsvcError, match=r"a\.png is neither a PNG nor a JPEG"):
        next(frames(found))


def test_an_image_that_is_too_large_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("gsvc_lab.scenes.base.MAX_IMAGE_PIXELS", 100)
    (tmp_path / "a.png").write_bytes(encode_png(np.zeros((9, 12, 3), np.uint8)))
    found = Scene.from_dict({"title": "t", "size": (12, 9), "frames": 1, "base": {"image": "a.png"}}, tmp_path)
    with pytest.raises(GsvcError, match="12x9 pixels; a scene takes at most 100"):
        next(frames(found))


def test_effects_are_called_by_their_kind_and_number():
    class Mine(Effect):
        STAGE = "light"

    names = list(Clip(scene(COLOR, PAN, EXAMPLES["cross-fade"], PAN)).effects)
    assert names == ["pan-1", "cross-fade-1", "pan-2"]
    assert Mine().truth(Canvas(1, 1, 1), 0) == {}
