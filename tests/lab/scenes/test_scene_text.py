import math

import numpy as np
import pytest
from scene_cases import scene

from gsvc_base.errors import UsageError
from gsvc_lab.scenes import Clip, truth
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effects.text import Text
from gsvc_lab.scenes.stroke_font import CHARACTERS, text_width

CANVAS = Canvas(120, 80, 20)
GREY = np.full((80, 120, 3), 0.4, np.float32)


def grid():
    return np.broadcast_arrays(*CANVAS.centres())


def covered(text, time=0):
    return text.coverage(*grid(), CANVAS, time)


def test_every_character_is_drawn_and_differs_from_all_others():
    drawn = {letter: covered(Text(letter, (0.5, 0.5), size=0.5)).tobytes() for letter in CHARACTERS}
    assert covered(Text(" ", (0.5, 0.5))).max() == 0
    assert len(set(drawn.values())) == len(CHARACTERS)
    assert set("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789 .,:;!?'-+/()%") < set(CHARACTERS)


def test_small_letters_are_written_as_capitals():
    np.testing.assert_array_equal(covered(Text("gsvc")), covered(Text("GSVC")))


def test_other_characters_are_refused_with_those_that_there_are():
    with pytest.raises(UsageError, match=r"text is wrong: 'naïve €' has Ï €, .* ABC.*0123456789.*&"):
        Text("naïve €")
    with pytest.raises(UsageError, match="text is missing"):
        Text.from_table({})
    with pytest.raises(UsageError, match="one line"):
        Text("two\nlines")


def test_a_stroke_has_the_area_of_a_line_with_round_ends():
    size, weight = 0.5, 0.2  # 40 pixels high, 8 thick
    area = covered(Text("I", (0.5, 0.5), size=size, weight=weight)).sum()
    assert area == pytest.approx(8 * 32 + math.pi * 4**2, abs=0.02 * 90)


@pytest.mark.parametrize(("anchor", "left"), [("left", 60), ("middle", None), ("right", None)])
def test_it_stands_where_it_is_said_to(anchor, left):
    text = Text("NEON", (0.5, 0.5), anchor=anchor, size=0.2)
    width = text_width("NEON", text.weight) * 16
    left = left or 60 - width * {"middle": 0.5, "right": 1}[anchor]
    columns = np.flatnonzero(covered(text).max(axis=0) > 0.5)
    rows = np.flatnonzero(covered(text).max(axis=1) > 0.5)
    assert columns[0] == pytest.approx(left, abs=1)
    assert columns[-1] + 1 == pytest.approx(left + width, abs=1)
    assert (rows[0], rows[-1] + 1) == pytest.approx((32, 48), abs=1)


def test_it_scrolls_by_fractions_of_a_pixel():
    text = Text("SO IT GOES", (0.9, 0.5), speed=(-0.0125, 0.004), start=2)
    x, y = grid()
    right, below = text.motion(x, y, CANVAS, 9)
    assert (right == -1.5).all()
    np.testing.assert_allclose(below, 0.32)
    np.testing.assert_allclose(covered(text, 9), text.coverage(x - right, y - below, CANVAS, 8), atol=1e-9)
    np.testing.assert_allclose(text.truth(CANVAS, 12)["box"] - text.truth(CANVAS, 2)["box"], [-15, 3.2, -15, 3.2])
    assert text.motion(x, y, CANVAS, 2) is None


def test_what_is_painted_is_the_mixture_that_the_mask_tells():
    text = Text("A,b;?", (0.5, 0.5), size=0.3, color=(0.9, 0.8, 0.1))
    part = covered(text)[..., None]
    np.testing.assert_allclose(text.paint(GREY, CANVAS, 0), GREY * (1 - part) + part * text.color, atol=1e-6)


def test_a_box_stands_behind_it():
    text = Text("A", (0.5, 0.5), size=0.25, box=(0, 0, 1), margin=0.5, color=(1, 0, 0))
    left, top, right, bottom = text.truth(CANVAS, 0)["box"]
    assert bottom - top == pytest.approx(40)
    assert covered(text).sum() == pytest.approx((right - left) * (bottom - top), rel=0.002)
    picture = text.paint(GREY, CANVAS, 0)
    inside = covered(text) == 1
    np.testing.assert_allclose(picture[inside][:, 0] + picture[inside][:, 2], 1, atol=1e-6)
    letter = covered(Text("A", (0.5, 0.5), size=0.25))
    np.testing.assert_allclose(picture[inside][:, 0], letter[inside], atol=1e-6)


def test_it_is_seen_from_start_to_before_end():
    text = Text("X", start=3, end=6)
    assert [text.paint(GREY, CANVAS, frame) is not GREY for frame in range(8)] == [3 <= frame < 6 for frame in range(8)]
    assert [covered(text, frame).any() for frame in range(8)] == [3 <= frame < 6 for frame in range(8)]
    assert np.isnan(text.truth(CANVAS, 6)["box"]).all()
    with pytest.raises(UsageError, match="end is 2; it must be after start, which is 2"):
        Text("X", start=2, end=2)


def test_text_hides_what_was_painted_before():
    shape = {"kind": "shape", "form": "rectangle", "width": 4, "color": [0, 1, 0]}
    text = {"kind": "text", "text": "HIDE", "place": [0.5, 0.5], "size": 0.4, "color": [1, 0, 0]}
    clip = Clip(scene({"color": [0, 0, 0]}, shape, text))
    known, frame = truth(clip, 2), clip.frame(2)
    letters = known["text-1.mask"]
    np.testing.assert_allclose(known["shape-1.seen"], 1 - letters, atol=1e-6)
    assert (frame[letters == 1] == (255, 0, 0)).all()
    assert (frame[letters == 0] == (0, 255, 0)).all()


def test_letters_smaller_than_a_pixel_cover_nothing_far_from_them():
    tiny = Text("HI", (0.5, 0.5), size=0.01, start=0)
    part = covered(tiny)
    assert 0 < part.sum() < 3
    x, y = grid()
    assert not part[np.hypot(x - 60, y - 40) > 3].any()


def test_outside_the_frame_it_changes_nothing():
    text = Text("FAR AWAY", (3.0, 0.5))
    np.testing.assert_array_equal(text.paint(GREY, CANVAS, 0), GREY)
