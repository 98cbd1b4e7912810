import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scene_cases import scene, waves_file
from scipy.ndimage import map_coordinates

from gsvc_base.errors import UsageError
from gsvc_lab.scenes import Clip, Scene, ground_truth, scene_names, truth
from gsvc_lab.scenes.effect import ObjectEffect, WarpEffect
from gsvc_lab.scenes.ground_truth import check_truth_size, write_truth

COLOR = {"color": (0.2, 0.4, 0.6)}
PAN = {"kind": "pan", "from": (0.4, 0.5), "to": (0.6, 0.5), "span": 0.5}
CUT = {"kind": "cut", "at": 3, "to": {"color": (1, 0, 0)}}
WIDTH, HEIGHT = 48, 32


@dataclass(frozen=True)
class Disc(ObjectEffect):
    """A disc of radius 6 that moves 3 pixels right in each frame, without antialiasing."""

    x: float = 10.0
    speed: float | None = 3.0

    def paint(self, picture, canvas, time):
        return np.where(self.coverage(*canvas.centres(), canvas, time)[..., None] > 0, np.float32(1), picture)

    def coverage(self, x, y, canvas, time):
        return (np.hypot(x - self.x - 3 * time, y - 16) < 6).astype(np.float64)

    def motion(self, x, y, canvas, time):
        return None if self.speed is None else (np.full(x.shape, self.speed), np.zeros(x.shape))


@dataclass(frozen=True)
class Ripple(WarpEffect):
    def displacement(self, x, y, canvas, time):
        return 1.5 * np.sin(y / 5 + time) + 0 * x, 1.0 * np.cos(x / 7 - time) + 0 * y


def over_waves(folder, *effects, size=(WIDTH, HEIGHT)):
    base = {"image": waves_file(folder)}
    return Scene.from_dict({"title": "t", "size": size, "frames": 6, "base": base, "effects": effects}, folder)


def grid():
    return np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)


def predicted(clip, number):
    """Frame `number` from the frame before, moved as the truth says, and its truth."""
    known = truth(clip, number)
    x, y = (axis - shift for axis, shift in zip(grid(), known["motion"].astype(np.float64), strict=True))
    before = clip.picture(number - 1).astype(np.float64)
    moved = [map_coordinates(before[..., c], (y - 0.5, x - 0.5), order=3, mode="nearest") for c in range(3)]
    return np.stack(moved, axis=-1), known


def test_what_stands_still_has_no_motion():
    known = truth(scene(COLOR), 4)
    assert known["motion"].shape == (2, 32, 48)
    assert known["motion"].dtype == np.float32
    assert (known["motion"] == 0).all()
    assert known["visible_before"].all()
    assert known["camera"].tolist() == [0.5, 0.5, 1, 0]
    assert known["cut"] is False


def test_nothing_comes_before_the_first_frame():
    known = truth(scene(COLOR, PAN), 0)
    assert np.isnan(known["motion"]).all()
    assert not known["visible_before"].any()
    assert known["cut"] is False


def test_a_pan_moves_all_by_the_same_fraction_of_a_pixel(tmp_path):
    known = truth(over_waves(tmp_path, PAN), 2)
    np.testing.assert_allclose(known["motion"][0], -96 * 0.2 / 5, rtol=1e-6)  # a picture pixel fills a frame pixel
    np.testing.assert_allclose(known["motion"][1], 0, atol=1e-6)
    x, _ = grid()
    np.testing.assert_array_equal(known["visible_before"], x + 3.84 <= WIDTH)


def test_a_zoom_moves_away_from_the_middle(tmp_path):
    known = truth(over_waves(tmp_path, {"kind": "zoom", "from": 0.9, "to": 0.3}), 3)
    factor = (0.3 / 0.9) ** (1 / 5)  # of the span from frame to frame
    x, y = grid()
    np.testing.assert_allclose(known["motion"][0], (x - WIDTH / 2) * (1 - factor), atol=1e-5)
    np.testing.assert_allclose(known["motion"][1], (y - HEIGHT / 2) * (1 - factor), atol=1e-5)
    assert known["visible_before"].all()


def test_a_roll_turns_the_other_way(tmp_path):
    known = truth(over_waves(tmp_path, {"kind": "rotation", "to": 50, "span": 0.6}), 1)
    angle = math.radians(10)
    x, y = grid()
    # Something right of the middle moves up when the camera rolls clockwise.
    assert known["motion"][1, HEIGHT // 2, -1] < -2
    turned_x = (x - WIDTH / 2) * math.cos(angle) - (y - HEIGHT / 2) * math.sin(angle)
    np.testing.assert_allclose(x - known["motion"][0] - WIDTH / 2, turned_x, atol=1e-5)


@pytest.mark.parametrize(
    "tables",
    [
        [PAN],
        [{"kind": "zoom", "from": 0.9, "to": 0.5, "at": (0.45, 0.55)}],
        [{"kind": "rotation", "from": -10, "to": 30, "span": 0.6}],
        [PAN, {"kind": "zoom", "to": 0.4}, {"kind": "rotation", "to": 20}],
        [Ripple()],
        [PAN, Ripple()],
        [{"kind": "rotation", "to": 20, "span": 0.6}, Ripple(), {"kind": "sway"}],
        [PAN, Disc()],
        [Disc(), Disc(x=20.0)],
    ],
    ids=["pan", "zoom", "rotation", "all", "ripple", "pan+ripple", "rotation+warps", "pan+disc", "two discs"],
)
def test_motion_predicts_a_frame_from_the_one_before(tmp_path, tables):
    clip = Clip(over_waves(tmp_path, *tables))
    for number in (1, 4):
        picture, known = predicted(clip, number)
        seen = known["visible_before"].copy()
        # At the frame's edges and those of a disc, reading between pixels mixes what does not belong together.
        for name in clip.objects:
            mask = known[f"{name}.mask"] > 0
            before = truth(clip, number - 1)[f"{name}.mask"] > 0
            for edge in (mask, np.roll(before, 3, axis=1), before):
                wide = np.zeros_like(edge)
                for shift in range(-6, 7):
                    wide |= np.roll(edge, shift, 1) | np.roll(edge, shift, 0)
                seen &= ~wide | edge & np.roll(edge, 4, 1) & np.roll(edge, -4, 1)
        seen[:5], seen[-5:], seen[:, :5], seen[:, -5:] = False, False, False, False
        assert seen.mean() > 0.1
        assert np.abs(picture - clip.picture(number))[seen].max() < 0.02


def test_what_a_disc_uncovers_was_hidden_before():
    known = truth(scene(COLOR, Disc(), frames=6), 2)
    x, y = grid()
    now, before = np.hypot(x - 16, y - 16) < 6, np.hypot(x - 13, y - 16) < 6
    np.testing.assert_array_equal(known["visible_before"], now | ~before)
    np.testing.assert_array_equal(known["motion"][0], np.where(now, 3, 0))
    np.testing.assert_array_equal(masks(known)[0], now)


def masks(known):
    return [value for key, value in known.items() if key.endswith(".mask")]


def test_what_is_behind_another_object_is_told_with_and_without_it():
    clip = Clip(scene(COLOR, Disc(), Disc(x=15.0), frames=6))
    known = truth(clip, 1)
    back, front = clip.objects
    x, y = grid()
    first, second = np.hypot(x - 13, y - 16) < 6, np.hypot(x - 18, y - 16) < 6
    np.testing.assert_array_equal(known[f"{back}.mask"], first)
    np.testing.assert_array_equal(known[f"{back}.seen"], first & ~second)
    np.testing.assert_array_equal(known[f"{front}.seen"], second)
    # All moves together, so everything of the discs was seen before, and the ground where no disc was.
    first_before, second_before = np.hypot(x - 10, y - 16) < 6, np.hypot(x - 15, y - 16) < 6
    np.testing.assert_array_equal(known["visible_before"], first | second | ~(first_before | second_before))


def test_an_object_whose_motion_is_unknown_says_so():
    known = truth(scene(COLOR, Disc(speed=None)), 2)
    (mask,) = masks(known)
    np.testing.assert_array_equal(np.isnan(known["motion"][0]), mask > 0)
    assert not known["visible_before"][mask > 0].any()


def test_what_comes_into_the_frame_was_outside():
    known = truth(scene(COLOR, Disc(x=-5.0)), 2)  # its left half has come in
    x, _ = grid()
    (mask,) = masks(known)
    np.testing.assert_array_equal(known["visible_before"][mask > 0], (x - 3 >= 0)[mask > 0])


def test_after_a_cut_nothing_was_seen_before():
    clip = Clip(scene(COLOR, PAN, CUT))
    assert [truth(clip, number)["cut"] for number in range(6)] == [False, False, False, True, False, False]
    known = truth(clip, 3)
    assert np.isnan(known["motion"]).all()
    assert not known["visible_before"].any()
    assert np.isfinite(truth(clip, 4)["motion"]).all()
    assert [truth(clip, number)["cut-1.after"] for number in (2, 3)] == [False, True]


def test_a_cut_to_the_same_is_none():
    known = truth(scene(COLOR, {"kind": "cut", "at": 3, "to": COLOR}), 3)
    assert known["cut"] is False
    assert known["visible_before"].all()


def test_a_cross_fade_brings_what_was_not_there():
    clip = Clip(scene(COLOR, {"kind": "cross-fade", "start": 1, "end": 4, "to": {"color": (1, 0, 0)}}))
    assert [bool(truth(clip, number)["visible_before"].all()) for number in range(1, 6)] == [
        True, False, True, True, True,
    ]  # fmt: skip
    assert not any(truth(clip, number)["cut"] for number in range(6))
    assert all((truth(clip, number)["motion"] == 0).all() for number in range(1, 6))


def test_pictures_of_two_sizes_have_no_one_motion_while_they_are_mixed():
    fade = {"kind": "cross-fade", "start": 0, "end": 5, "to": {"photograph": "chelsea"}}
    clip = Clip(scene({"photograph": "astronaut"}, PAN, fade))
    assert np.isnan(truth(clip, 2)["motion"]).all()
    assert np.isfinite(truth(clip, 5)["motion"]).all()


def test_a_mixture_before_a_camera_that_stands_still_moves_as_its_warps_do():
    fade = {"kind": "cross-fade", "start": 0, "end": 5, "to": {"photograph": "chelsea"}}
    mixed, alone = (truth(scene({"photograph": "astronaut"}, *others, Ripple()), 2) for others in ([fade], []))
    np.testing.assert_array_equal(mixed["motion"], alone["motion"])
    assert np.abs(mixed["motion"]).max() > 0.5


def test_motion_that_a_warp_makes_ambiguous_is_not_told():
    @dataclass(frozen=True)
    class Folding(WarpEffect):
        def displacement(self, x, y, canvas, time):
            return np.where(x < 24, 0.0, 40 * np.sin(x * time)) + 0 * y, 0 * x + 0 * y

    known = truth(scene(COLOR, Folding()), 2)
    unknown = np.isnan(known["motion"][0])
    assert unknown.any()
    assert not known["visible_before"][unknown].any()


@pytest.mark.parametrize("name", scene_names())
def test_every_built_in_scene_tells_its_truth(name):
    found = Scene.named(name).resized(40, 32)
    clip = Clip(found)
    for number in (0, 1, found.frames // 2):
        known = truth(clip, number)
        assert known["motion"].shape == (2, 32, 40)
        told = np.isfinite(known["motion"]).all(axis=0)
        assert told[known["visible_before"]].all()
        for mask in masks(known):
            assert 0 <= mask.min() <= mask.max() <= 1


def test_the_file_holds_the_truth_of_all_frames(tmp_path):
    shape = {"kind": "shape", "form": "circle", "start": 2, "end": 4, "path": [(0.2, 0.5), (0.8, 0.5)]}
    found = scene(COLOR, PAN, shape, CUT | {"at": 5}, {"kind": "noise"})
    seen = []
    keys = write_truth(found, tmp_path / "t.npz", seen.append)
    assert seen == list(range(6))
    clip = Clip(found)
    with np.load(tmp_path / "t.npz") as file:
        assert sorted(file.files) == keys
        assert {"motion", "visible_before", "cut", "camera", "shape-1.mask", "shape-1.seen", "cut-1.after"} <= set(keys)
        assert file["motion"].shape == (6, 2, 32, 48)
        assert file["cut"].tolist() == [False] * 5 + [True]
        for number in (0, 3, 5):
            for key, value in truth(clip, number).items():
                np.testing.assert_array_equal(file[key][number], value, err_msg=key)
        assert np.isnan(file["shape-1.center"][0]).all()
    assert [path.name for path in tmp_path.iterdir()] == ["t.npz"]


def test_more_truth_than_fits_is_refused_before_anything_is_drawn(tmp_path):
    large = replace(scene(COLOR), width=8192, height=4096, frames=1000)
    with pytest.raises(UsageError, match=r"1,000 frames of 8192x4096 would take 281\.3 GiB; at most 2"):
        write_truth(large, tmp_path / "t.npz", lambda number: pytest.fail("drawn"))
    with pytest.raises(FileNotFoundError, match="create it first"):
        write_truth(scene(COLOR), tmp_path / "none" / "t.npz")


def test_the_size_of_the_file_is_known_before():
    everything = [
        PAN, CUT | {"at": 2}, {"kind": "water"}, {"kind": "highlight"}, {"kind": "text", "text": "HI"},
        {"kind": "shape", "form": "star", "wobble": 0.1, "points": 40}, {"kind": "noise"},
    ]  # fmt: skip
    found = scene({"noise": {}}, *everything, frames=3)
    size = sum(np.asarray(value).nbytes for number in range(3) for value in truth(found, number).values())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ground_truth, "MAX_TRUTH_BYTES", size)
        check_truth_size(found)
        patch.setattr(ground_truth, "MAX_TRUTH_BYTES", size - 1)
        with pytest.raises(UsageError, match="3 frames of 48x32 would take"):
            check_truth_size(found)


def test_an_interrupt_leaves_no_file(tmp_path, monkeypatch):
    def stop(*_arguments, **_settings):
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez_compressed", stop)
    with pytest.raises(KeyboardInterrupt):
        write_truth(scene(COLOR), tmp_path / "t.npz")
    assert list(tmp_path.iterdir()) == []
