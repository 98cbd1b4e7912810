import math
import tomllib
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scene_cases import scene

from gsvc_base.errors import UsageError
from gsvc_lab.scenes import EFFECTS, Base, Scene, effect_class, scene_names
from gsvc_lab.scenes.built_in import scene_text
from gsvc_lab.scenes.description import MAX_EFFECTS, MAX_PIXELS
from gsvc_lab.scenes.effects.cut import Cut
from gsvc_lab.scenes.effects.pan import Pan
from gsvc_lab.scenes.parameters import ParameterError, key_of, parameters
from gsvc_lab.scenes.reference import reference_lines, reference_object
from gsvc_lab.scenes.scene import MAX_FILE_BYTES

DESCRIPTION = """
title = "A pan and a cut"
size = [64, 48]
frames = 12
frame_rate = "30000/1001"
seed = 7

[base]
photograph = "coffee"

[[effects]]
kind = "pan"
from = [0.4, 0.5]
to = [0.6, 0.5]
span = 0.5

[[effects]]
kind = "cut"
at = 6
to = { color = [1, 0, 0.5] }
"""


def write(folder, text, name="mine.toml"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_a_file_says_all_of_a_scene(tmp_path):
    found = Scene.from_toml(write(tmp_path, DESCRIPTION))
    assert (found.title, found.width, found.height, found.frames) == ("A pan and a cut", 64, 48, 12)
    assert (found.frame_rate, found.seed, found.base) == (Fraction(30000, 1001), 7, Base(photograph="coffee"))
    pan = Pan(to=(0.6, 0.5), from_=(0.4, 0.5), span=0.5)
    assert found.effects == (pan, Cut(to=Base(color=(1, 0, 0.5)), at=6))
    assert found.folder == tmp_path


def test_rate_and_seed_and_effects_may_be_left_out():
    found = scene({"color": [0, 0, 0]})
    assert (found.frame_rate, found.seed, found.effects) == (24, 0, ())
    assert Scene.from_dict({"title": "t", "size": (4, 3), "frames": 1, "base": {"color": (0, 0, 0)}}).width == 4


def test_a_byte_order_mark_is_no_fault(tmp_path):
    assert Scene.from_toml(write(tmp_path, "\ufeff" + DESCRIPTION)).frames == 12


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("size = [64, 48]", "size = [64, 0]", r"size \(height\) is 0; it must be a whole number from 1 to 16,384"),
        ("size = [64, 48]", "size = [64.0, 48]", r"size \(width\) is 64.0; it must be a whole number"),
        ("size = [64, 48]", "size = [true, 48]", r"size \(width\) is True"),
        ("size = [64, 48]", "size = [16384, 16384]", rf"size is \[16384, 16384\].* at most {MAX_PIXELS:,} pixels"),
        ("size = [64, 48]", "size = 64", r"size is 64; it must be \[width, height\]"),
        ("size = [64, 48]", "", "size is missing"),
        ("frames = 12", "frames = 1000001", "frames is 1000001; it must be a whole number from 1 to 1,000,000"),
        ("frames = 12", "frames = -1", "frames is -1"),
        ("frames = 12", "frames = 2020-01-01", "frames is datetime.date"),
        ("seed = 7", "seed = -7", "seed is -7; it must be a whole number from 0"),
        ("seed = 7", f"seed = {10**400}", r"seed is 1000.*\.\.\..*; it must be"),
        ("seed = 7", "colour = 3", "colour is unknown here; there are title, size"),
        ('"30000/1001"', '"1/0"', "frame_rate is '1/0'; it must be a number from 0.001"),
        ('"30000/1001"', '"1/00"', "frame_rate is '1/00'"),
        ('"30000/1001"', f"{10**400}", "frame_rate is 1000"),
        ('"30000/1001"', "true", "frame_rate is True"),
        ('"30000/1001"', "nan", "frame_rate is nan"),
        ('"30000/1001"', "inf", "frame_rate is inf"),
        ('"30000/1001"', "1e9", "frame_rate is 1000000000.0"),
        ('"30000/1001"', '"1e999999999"', "frame_rate is '1e999999999'"),
        ('title = "A pan and a cut"', 'title = ""', "title is ''; it must be a text"),
        ('title = "A pan and a cut"', f'title = "{"x" * 201}"', "title is 'xxx"),
        ('photograph = "coffee"', 'photograph = "tea"', "base.photograph is 'tea'; .* astronaut, chelsea, coffee"),
        ('photograph = "coffee"', "", "base is empty; it must have exactly one of color, gradient"),
        ('photograph = "coffee"', 'photograph = "coffee"\ncolor = [0, 0, 0]', "base has color and photograph"),
        ('photograph = "coffee"', 'image = "tea.png"', "base.image is 'tea.png', and there is no file .*tea.png"),
        ('photograph = "coffee"', 'image = "."', "base.image is '.', and there is no file"),
        ('photograph = "coffee"', "gradient = 3", "base.gradient is 3; it must be a table with keys such as from, to"),
        ('photograph = "coffee"', "gradient = {from = [0, 0, 0]}", "base.gradient.to is missing: the colour where it"),
        ('photograph = "coffee"', "color = [0, 0, nan]", r"base.color is \[0, 0, nan\]; it must be three numbers"),
        ('photograph = "coffee"', "color = [0, 0]", r"base.color is \[0, 0\]"),
        ('kind = "pan"', "", r"effects\[1\].kind is missing"),
        ('kind = "pan"', 'kind = "bloom"', r"effects\[1\].kind is 'bloom'; there is no effect 'bloom'; there are pan,"),
        ('kind = "pan"', 'kind = "../pan"', r"effects\[1\].kind is '../pan'"),
        ('kind = "pan"', "kind = 3", r"effects\[1\].kind is 3"),
        ('kind = "pan"', "kind = [1]", r"effects\[1\].kind is \[1\]"),
        ("from = [0.4, 0.5]", "from = [0.4, inf]", r"effects\[1\].from is \[0.4, inf\]; .* two numbers from 0 to 1"),
        ("from = [0.4, 0.5]", "from = [0.4, 1.5]", r"effects\[1\].from is \[0.4, 1.5\]"),
        ("from = [0.4, 0.5]", "from_ = [0.4, 0.5]", r"effects\[1\].from_ is unknown here; there are to, from, span"),
        ("from = [0.4, 0.5]", "start = 5\nend = 5", r"effects\[1\].end is 5; it must be after start, which is 5"),
        ("span = 0.5", "span = 1e400", r"effects\[1\].span is inf"),
        ("span = 0.5", f"span = {10**400}", r"effects\[1\].span is 1000"),
        ("to = [0.6, 0.5]", "", r"effects\[1\].to is missing: the point it looks at in the end"),
        ("at = 6", "at = 12", r"effects\[2\].at is 12; the clip has frames 0 to 11"),
        ("at = 6", "at = 6.5", r"effects\[2\].at is 6.5; it must be the number of a frame"),
        ("{ color = [1, 0, 0.5] }", "{ color = [1, 0, 2] }", r"effects\[2\].to.color is \[1, 0, 2\]"),
        ("{ color = [1, 0, 0.5] }", '{ image = "no.png" }', r"effects\[2\].to.image is 'no.png', and there is no file"),
    ],
)  # fmt: skip
def test_a_wrong_description_is_refused_with_file_key_and_what_is_allowed(tmp_path, old, new, message):
    assert old in DESCRIPTION
    path = write(tmp_path, DESCRIPTION.replace(old, new))
    with pytest.raises(UsageError, match=rf"mine\.toml: {message}") as caught:
        Scene.from_toml(path)
    assert len(str(caught.value)) < 500 + len(str(path))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("title =\nframes = 1", "is not TOML: .*line 1"),
        (b"\xff\xfe", "is not TOML: .*utf-8"),
        ("base = " + "[" * 5000, "nested too deeply|is not TOML"),
        ("seed = " + "9" * 5000, "is not TOML"),
        ("", "title is missing; a scene needs a title"),
        ("effects = 3\nframes = 1\nsize = [1, 1]\ntitle = 't'\nbase = {color = [0, 0, 0]}", "effects is 3; .* a list"),
        ("effects = [3]\nframes = 1\nsize = [1, 1]\ntitle = 't'\nbase = {color = [0, 0, 0]}", r"effects\[1\].kind is"),
        ("x" * (MAX_FILE_BYTES + 1), "bytes; a scene takes at most"),
    ],
)  # fmt: skip
def test_what_is_no_description_is_refused(tmp_path, text, message):
    with pytest.raises(UsageError, match=message):
        Scene.from_toml(write(tmp_path, text))


def test_a_missing_file_is_said_to_be_missing(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.toml; check the name"):
        Scene.from_toml(tmp_path / "none.toml")
    with pytest.raises(FileNotFoundError, match="no file"):
        Scene.from_toml(tmp_path)


def test_two_shutters_are_refused():
    blur = {"kind": "motion-blur"}
    with pytest.raises(
        UsageError, match=r"effects\[3\] is a second shutter after effects\[1\]; a scene has at most one"
    ):
        scene({"color": (0, 0, 0)}, blur, {"kind": "pan", "to": (0.5, 0.5)}, blur)


def test_effects_without_end_are_refused():
    pan = {"kind": "pan", "to": (0.5, 0.5)}
    assert len(scene({"color": (0, 0, 0)}, *[pan] * MAX_EFFECTS).effects) == MAX_EFFECTS
    with pytest.raises(UsageError, match=f"a list of at most {MAX_EFFECTS} effects"):
        scene({"color": (0, 0, 0)}, *[pan] * (MAX_EFFECTS + 1))


def test_what_happens_later_may_be_cut_off():
    whole_clip = scene({"color": (0, 0, 0)}, {"kind": "cut", "at": 5, "to": {"color": (1, 1, 1)}})
    assert whole_clip.resized(frames=2).frames == 2
    changed = whole_clip.resized(10, 20, seed=3)
    assert (changed.width, changed.height, changed.frames, changed.seed) == (10, 20, 6, 3)
    with pytest.raises(UsageError, match="width is 0"):
        whole_clip.resized(width=0)


def test_python_and_files_are_checked_alike():
    with pytest.raises(UsageError, match="from is"):
        Pan(to=(0.5, 0.5), from_=(math.nan, 0))
    with pytest.raises(UsageError, match="end is 3; it must be after start, which is 4"):
        Pan(to=(0.5, 0.5), start=4, end=3)
    kept = Pan(to=np.array([0.5, 0.25]), start=np.int64(3))
    assert kept == Pan(to=(0.5, 0.25), start=3)
    assert hash(kept) == hash(Pan(to=[0.5, 0.25], start=3))
    assert type(kept.start) is int
    with pytest.raises(ParameterError, match="frames is 0"):
        replace(scene({"color": (0, 0, 0)}), frames=0)


def test_scenes_are_equal_by_their_contents(tmp_path):
    path = write(tmp_path, DESCRIPTION)
    assert Scene.from_toml(path) == Scene.from_toml(path)
    assert len({Scene.from_toml(path), Scene.from_toml(path)}) == 1


json_like = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.dates(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["kind", "to", "color", "x"]), inner),
    max_leaves=8,
)


@given(
    st.dictionaries(st.sampled_from(["title", "size", "frames", "frame_rate", "seed", "base", "effects"]), json_like)
)
def test_any_contents_are_a_scene_or_a_usage_error(changes):
    good = {"title": "t", "size": [4, 3], "frames": 2, "base": {"color": [0, 0, 0]}}
    with suppress(UsageError):
        assert Scene.from_dict(good | changes).frames >= 1


@given(kind=st.sampled_from(EFFECTS), data=st.data())
def test_any_parameters_are_an_effect_or_a_usage_error(kind, data):
    keys = [key_of(item) for item in parameters(effect_class(kind))]
    table = data.draw(st.dictionaries(st.sampled_from([*keys, "x"]), json_like, max_size=3))
    with suppress(UsageError):
        assert effect_class(kind).from_table(table)


def test_every_built_in_scene_is_one():
    assert {"static", "pan"} <= set(scene_names())
    for name in scene_names():
        found = Scene.named(name)
        assert found == Scene.find(name) == Scene.find(f"scene:{name}")
        assert tomllib.loads(scene_text(name))["title"] == found.title


def test_an_unknown_name_gets_the_nearest_and_all():
    with pytest.raises(UsageError, match=r"no scene 'statik' \(did you mean static\?\); there are .*pan"):
        Scene.find("scene:statik")
    with pytest.raises(UsageError, match=r"there are .* or give a FILE\.toml"):
        Scene.named("../static")


def test_a_file_is_found_by_its_name(tmp_path, monkeypatch):
    path = write(tmp_path, DESCRIPTION)
    assert Scene.find(str(path)).title == "A pan and a cut"
    monkeypatch.chdir(tmp_path)
    write(tmp_path, DESCRIPTION, "pan")
    assert Scene.find("pan") == Scene.named("pan")
    write(tmp_path, DESCRIPTION, "odd")
    assert Scene.find("odd").title == "A pan and a cut"


def test_the_reference_names_every_parameter():
    known = reference_object()
    assert tuple(known["effects"]) == EFFECTS
    for name, entry in known["effects"].items():
        assert entry["summary"].endswith("."), name
        assert all(item["meaning"] and item["allowed"] for item in entry["parameters"].values()), name
    assert list(known["scene"]) == ["title", "size", "frames", "frame_rate", "seed", "base", "effects"]
    lines = "\n".join(reference_lines())
    assert "    seed: of all that is random; a whole number from 0 to 9,223,372,036,854,775,807; default 0" in lines
    assert 'kind = "cross-fade"' in lines
    assert "[base.checker]" in lines


def test_errors_of_nested_tables_tell_the_whole_way():
    error = ParameterError("x", "is 3").within("[2]").within("effects")
    assert str(error) == "effects[2].x is 3"
    assert str(ParameterError("", "is empty").within("base")) == "base is empty"
