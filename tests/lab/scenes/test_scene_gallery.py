import re

import numpy as np
import pytest
from html_pages import parsed

from gsvc_lab.scenes import EFFECTS, Scene, gallery, scene_names
from gsvc_lab.scenes.built_in import scene_text
from gsvc_lab.scenes.gallery_pictures import (
    changing_frames,
    motion_wheel,
    shows_something,
    telling_frames,
    truth_picture,
)

FEW = ("static", "cut", "many", "jumping-circle")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    told = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gallery, "scene_names", lambda: FEW)
        patch.setattr(gallery, "WIDTH", 48)
        path = tmp_path_factory.mktemp("gallery") / "gallery.html"
        gallery.write_gallery(path, lambda *progress: told.append(progress))
    assert told == [
        (f"scene {name}", number, 4) for number, name in enumerate(["static", "cut", "jumping-circle", "many"])
    ]
    assert [file.name for file in path.parent.iterdir()] == ["gallery.html"]
    return path.read_text(encoding="utf-8")


def test_the_page_is_whole_and_needs_nothing_else(page):
    checker = parsed(page)
    assert "script" not in checker.tags
    sources = [value for name, value in checker.attributes if name in {"src", "srcset"}]
    assert len(sources) > 4 * 8
    assert all(source.startswith("data:image/") for source in sources)
    assert "http" not in re.sub(r"data:image/[^\"]*", "", page)
    targets = {value for name, value in checker.attributes if name == "id"}
    links = {value for name, value in checker.attributes if name == "href"}
    assert links <= {f"#{target}" for target in targets}
    assert {f"#{name}" for name in FEW} <= links


def test_the_page_says_all_about_its_scenes(page):
    text = "".join(parsed(page).text)
    for name in FEW:
        assert Scene.named(name).title in text
        assert scene_text(name) in text
        assert f"gsvc scene {name} {name}.y4m" in text
        assert f"gsvc encode scene:{name} {name}.gsvc" in text
    assert 'to = { photograph = "chelsea" }, at = 24' in text
    assert "shape-1.mask" in text
    assert "a cut; nothing of the frame before is left" in text
    assert "motion of up to 143.4 pixels" in text


def test_the_page_has_every_kind_of_effect(page):
    checker = parsed(page)
    text = "".join(checker.text)
    assert {("id", f"effect-{kind}") for kind in EFFECTS} <= set(checker.attributes)
    assert "how many bulges run around it" in text
    assert "a sample v becomes gain v + offset" in text
    assert "``" not in text


def test_a_folder_that_is_not_there_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(gallery, "scene_names", lambda: ("jumping-circle",))
    monkeypatch.setattr(gallery, "WIDTH", 32)
    with pytest.raises(FileNotFoundError):
        gallery.write_gallery(tmp_path / "no" / "gallery.html")


def test_without_webp_the_pictures_are_still(monkeypatch):
    monkeypatch.setattr(gallery, "animation_uri", lambda *_: None)
    frames = [np.zeros((4, 6, 3), np.uint8)] * 3
    assert gallery._moving(frames, frames[0], 24, "nothing").count("data:image/png") == 2


def test_all_scenes_are_in_an_order_that_leads_through_the_stages():
    scenes = list(gallery.gallery_scenes())
    assert sorted(scenes) == list(scene_names())
    assert scenes[0] == "static"
    assert scenes[-1] == "many"
    assert scenes.index("pan") < scenes.index("cut") < scenes.index("flash") < scenes.index("noise")


def frames(levels):
    return [np.full((8, 12, 3), level, np.uint8) for level in levels]


def test_a_strip_is_even_but_misses_no_flash():
    assert telling_frames(frames([50] * 26), 6) == [0, 5, 10, 15, 20, 25]
    assert telling_frames(frames(range(26)), 6) == [0, 5, 10, 15, 20, 25]
    assert telling_frames(frames([50] * 12 + [200] + [50] * 13), 6) == [0, 5, 12, 15, 20, 25]
    assert telling_frames(frames([50, 60, 70]), 6) == [0, 1, 2]
    assert telling_frames(frames([50]), 6) == [0]


def test_the_frames_that_change_most():
    assert changing_frames(frames([50, 50, 90, 95, 95]), 2) == [2, 3]
    assert changing_frames(frames([50]), 2) == [0]


def known(right=0.0, below=0.0, size=(6, 8), **rest):
    motion = np.stack([np.full(size, right), np.full(size, below)])
    return {"motion": motion, "visible_before": np.ones(size, bool), **rest}


def test_motion_has_the_colour_of_its_direction():
    assert (truth_picture(known()) == 255).all()
    colors = {}
    for name, direction in {"right": (2, 0), "down": (0, 2), "left": (-2, 0), "up": (0, -2)}.items():
        colors[name] = tuple(truth_picture(known(*direction))[2, 3])
    assert len(set(colors.values())) == 4
    assert colors["right"][0] > 200 > 50 > colors["right"][1]
    wheel = motion_wheel(40)
    np.testing.assert_allclose(wheel[20, 38], colors["right"], atol=25)
    np.testing.assert_allclose(wheel[20, 1], colors["left"], atol=25)
    np.testing.assert_allclose(wheel[38, 20], colors["down"], atol=25)
    assert (wheel[20, 20] > 230).all()
    assert (wheel[0, 0] == 255).all()


def test_what_is_new_unknown_or_in_front_is_marked():
    facts = known(1.0, 0.0)
    facts["motion"][:, 0] = np.nan
    facts["visible_before"][1] = False
    facts["shape-1.seen"] = np.pad(np.ones((3, 4)), ((3, 0), (0, 4)))
    picture = truth_picture(facts)
    assert (picture[0] == 150).all()
    assert (picture[1] < 40).all()
    outline = (picture == 20).all(axis=-1)
    assert outline.sum() == 6
    assert outline[3, :4].all()
    assert outline[3:, 3].all()


def test_what_is_worth_a_picture():
    assert not shows_something(known())
    assert shows_something(known(0.0, 0.1))
    assert shows_something(known(**{"text-1.seen": np.zeros((6, 8))}))
