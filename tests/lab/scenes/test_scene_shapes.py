import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scene_cases import scene

from gsvc_base.errors import UsageError
from gsvc_lab.scenes import Clip, paint_ball, truth
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.distances import polygon_distance, segment_distance
from gsvc_lab.scenes.effects.shape import Shape
from gsvc_lab.scenes.outlines import Pose, regular_polygon, round_distance
from gsvc_lab.scenes.shapes import Ball

CANVAS = Canvas(60, 48, 25)
GREY = np.full((48, 60, 3), 0.5, np.float32)


def grid(canvas=CANVAS):
    return np.broadcast_arrays(*canvas.centres())


def covered(shape, time=0.0, canvas=CANVAS):
    return shape.coverage(*grid(canvas), canvas, time)


def shoelace(points):
    x, y = points.T
    return abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2


FORMS = [
    {"form": "circle"},
    {"form": "ball"},
    {"form": "ellipse", "height": 0.3},
    {"form": "rectangle", "height": 0.25},
    {"form": "polygon", "points": 6},
    {"form": "polygon", "corners": ((-1, -1), (1, -0.8), (0.2, 0.1), (0.9, 1), (-1, 0.7))},
    {"form": "star", "points": 5},
    {"form": "circle", "wobble": 0.2, "waves": 4},
    {"form": "rectangle", "wobble": 0.2},
]


@pytest.mark.parametrize("form", FORMS)
@settings(max_examples=12)
@given(x=st.floats(0.4, 0.6), y=st.floats(0.45, 0.55), angle=st.floats(-180, 180))
def test_the_area_is_that_of_the_outline_wherever_it_stands(form, x, y, angle):
    shape = Shape(width=0.6, path=((x, y),), angle=(angle,), **form)
    expected = shoelace(shape.truth(CANVAS, 0)["outline"])
    assert covered(shape).sum() == pytest.approx(expected, rel=0.012)


def test_areas_are_those_of_geometry():
    circle, ellipse = Shape("circle", width=0.5), Shape("ellipse", width=0.8, height=0.4)
    rectangle = Shape("rectangle", width=0.8, height=0.3, angle=(30,))
    # A pixel's part is known by its centre's distance alone; along the outline that errs by a fiftieth of a pixel.
    assert covered(circle).sum() == pytest.approx(math.pi * 12**2, abs=0.02 * 2 * math.pi * 12)
    assert covered(ellipse).sum() == pytest.approx(math.pi * 19.2 * 9.6, abs=0.02 * 93)
    assert covered(rectangle).sum() == pytest.approx(38.4 * 14.4, abs=0.02 * 105.6)


@pytest.mark.parametrize("form", FORMS)
def test_half_of_a_pixel_on_the_outline_is_covered(form):
    shape = Shape(width=0.6, angle=(20,), **form)
    outline = shape.truth(CANVAS, 3)["outline"]
    middles = outline if form["form"] in {"circle", "ball", "ellipse"} else (outline + np.roll(outline, 1, axis=0)) / 2
    np.testing.assert_allclose(shape.coverage(middles[:, 0], middles[:, 1], CANVAS, 3), 0.5, atol=1e-6)


@pytest.mark.parametrize("form", [form for form in FORMS if form["form"] != "ball"])
def test_what_is_painted_is_the_mixture_that_the_mask_tells(form):
    shape = Shape(width=0.7, color=(0.2, 0.9, 0.4), path=((0.1, 0.7), (0.6, 0.4)), **form)
    part = covered(shape, 7.3)[..., None]
    np.testing.assert_allclose(shape.paint(GREY, CANVAS, 7.3), GREY * (1 - part) + part * shape.color, atol=1e-6)


def test_a_still_ball_is_the_ball_of_old():
    shape = Shape("ball", width=0.5, path=((0.4, 0.6),), color=(0.1, 0.5, 0.8))
    old = paint_ball(GREY, Ball(24, 28.8, 12, (0.1, 0.5, 0.8)))
    np.testing.assert_allclose(shape.paint(GREY, CANVAS, 0), old, atol=1e-6)


def test_the_light_on_a_ball_does_not_turn_with_it():
    still, turned = (Shape("ball", angle=(angle,)).paint(GREY, CANVAS, 0) for angle in (0, 90))
    np.testing.assert_allclose(still, turned, atol=1e-6)


def test_a_ball_that_turns_moves_as_its_light_does():
    way = {"path": ((0.3, 0.5), (0.7, 0.5)), "angle": (0, 300)}
    right, below = Shape("ball", **way).motion(*grid(), CANVAS, 9)
    np.testing.assert_allclose(right, 1)
    np.testing.assert_allclose(below, 0, atol=1e-12)
    # Its bulges turn as those of a circle do.
    bulges = {**way, "wobble": 0.2, "width": 0.5}
    np.testing.assert_allclose(covered(Shape("ball", **bulges), 9), covered(Shape("circle", **bulges), 9), atol=1e-9)


def test_an_edge_is_a_line_inside_the_outline():
    plain = Shape("rectangle", width=0.5, color=(1, 0, 0))
    edged = Shape("rectangle", width=0.5, color=(1, 0, 0), edge=2 / 48, edge_color=(0, 0, 1))
    picture = edged.paint(GREY, CANVAS, 0)
    np.testing.assert_array_equal(covered(plain), covered(edged))
    blue = (picture == (0, 0, 1)).all(axis=-1)
    assert blue.sum() == 24**2 - 20**2
    assert (picture == (1, 0, 0)).all(axis=-1).sum() == 20**2


def test_it_is_seen_from_start_to_before_end_and_costs_nothing_else():
    shape = Shape("circle", start=5, end=8)
    for frame in range(12):
        assert (shape.paint(GREY, CANVAS, frame) is not GREY) == (5 <= frame < 8)
        assert covered(shape, frame).any() == (5 <= frame < 8)
        # An open shutter sees no other side of it.
        assert (shape.paint(GREY, CANVAS, frame - 0.49) is not GREY) == (5 <= frame < 8)
    assert np.isnan(shape.truth(CANVAS, 4)["center"]).all()
    assert shape.motion(*grid(), CANVAS, 5) is None
    assert shape.motion(*grid(), CANVAS, 6) is not None


def test_the_jumping_circle_is_at_one_place_and_then_at_the_other():
    shape = Shape("circle", path=((0.25, 0.5), (0.75, 0.5)), at=(0, 12), pace="jump")
    centres = [shape.truth(CANVAS, frame)["center"][0] for frame in range(25)]
    assert centres == [15.0] * 12 + [45.0] * 13
    right, below = shape.motion(*grid(), CANVAS, 12)
    np.testing.assert_allclose(right, 30)
    np.testing.assert_allclose(below, 0, atol=1e-12)


def test_an_open_shutter_sees_no_two_places_of_what_jumps():
    for repeat in (False, True):
        shape = Shape("circle", path=((0.2, 0), (0.5, 0), (0.8, 0)), at=(0, 6, 12), pace="jump", repeat=repeat)
        for frame in range(25):
            seen = {centre(shape, frame + part)[0] for part in (-0.49, 0, 0.49)}
            assert seen == {(12.0, 30.0)[frame // 6 % 2] if repeat else (12.0, 30.0, 48.0)[min(frame // 6, 2)]}


def centre(shape, time):
    return shape.truth(CANVAS, time)["center"]


def test_ways_from_place_to_place():
    path, at = ((0.2, 0.8), (0.8, 0.8)), (4, 20)
    ways = {pace: Shape("circle", path=path, at=at, pace=pace) for pace in ("even", "gentle", "bouncing")}
    for shape in ways.values():
        for time, x in [(0, 12), (4, 12), (12, 30), (20, 48), (24, 48)]:
            assert centre(shape, time)[0] == pytest.approx(x)
    np.testing.assert_allclose(np.diff([centre(ways["even"], time)[0] for time in range(4, 21)]), 36 / 16)
    steps = np.diff([centre(ways["gentle"], time)[0] for time in range(4, 21)])
    assert steps[0] < 0.2 * steps[8] > 0
    assert centre(ways["bouncing"], 12)[1] == pytest.approx(0.8 * 48 - 0.3 * 48)
    falls = np.diff([centre(ways["bouncing"], time)[1] for time in range(4, 21)], 2)
    np.testing.assert_allclose(falls, falls[0])  # as by gravity
    assert falls[0] > 0


def test_without_frames_the_way_spans_the_clip_and_may_be_repeated():
    shape = Shape("circle", path=((0, 0), (0.5, 0), (1, 0)))
    assert [centre(shape, time)[0] for time in (0, 6, 12, 24)] == pytest.approx([0, 15, 30, 60])
    again = Shape("circle", path=((0, 0), (1, 0)), at=(0, 10), repeat=True)
    assert [centre(again, time)[0] for time in (0, 5, 10, 15, 23)] == pytest.approx([0, 30, 0, 30, 18])
    alone = Shape("circle", path=((0, 0), (1, 0)))
    assert alone.truth(Canvas(60, 48, 1), 0)["center"][0] == 0


@pytest.mark.parametrize("form", FORMS)
def test_points_go_with_the_motion_that_is_told(form):
    shape = Shape(width=0.5, path=((0.3, 0.4), (0.7, 0.6)), angle=(0, 60), scale=(0.8, 1.3), wobble_period=10, **form)
    now = shape.truth(CANVAS, 9)["outline"]
    right, below = shape.motion(now[:, 0], now[:, 1], CANVAS, 9)
    np.testing.assert_allclose(now - np.stack([right, below], axis=1), shape.truth(CANVAS, 8)["outline"], atol=1e-9)
    assert np.hypot(right, below).min() > 0.1


@given(
    st.floats(0.1, 0.9), st.floats(3, 30), st.floats(3, 30), st.floats(-4, 4), st.floats(0, 0.5), st.integers(1, 6),
    st.floats(0, 1), st.floats(0, 6.2),
)  # fmt: skip
def test_own_coordinates_lead_back(x, a, b, angle, wobble, waves, u, theta):
    pose = Pose(60 * x, 20, a, b, angle, wobble, waves, 1.0)
    point = np.array([u * math.cos(theta)]), np.array([u * math.sin(theta)])
    np.testing.assert_allclose(pose.own(*pose.frame(*point)), point, atol=1e-9)


@given(st.floats(2, 20), st.floats(0, 40), st.floats(0, 40))
def test_the_distance_to_a_circle_is_exact(radius, x, y):
    pose = Pose(20, 20, radius, radius)
    expected = math.hypot(x - 20, y - 20) - radius
    assert round_distance(np.array([x]), np.array([y]), pose)[0] == pytest.approx(expected, abs=1e-9)


@settings(max_examples=40)
@given(st.integers(3, 9), st.floats(-2, 2), st.floats(-2, 2))
def test_the_distance_to_a_polygon_has_its_sign_and_size(points, x, y):
    corners = np.array(regular_polygon(points))
    distance = polygon_distance(np.array([x]), np.array([y]), corners)[0]
    ends = [*map(tuple, corners), tuple(corners[0])]
    nearest = min(
        math.hypot(x - ax - t * (bx - ax), y - ay - t * (by - ay))
        for (ax, ay), (bx, by) in pairwise(ends)
        for t in np.linspace(0, 1, 200)
    )
    assert abs(distance) == pytest.approx(nearest, abs=0.01)
    # Inside a convex polygon a point is on the same side of every side.
    sides = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for (ax, ay), (bx, by) in pairwise(ends)]
    if min(map(abs, sides)) > 1e-9:
        assert (distance < 0) == (min(sides) > 0)


def test_the_distance_to_a_point_is_that_of_a_line_without_length():
    x, y = np.array([3.0]), np.array([4.0])
    assert segment_distance(x, y, [(0, 0)]) == segment_distance(x, y, [(0, 0), (0, 0)]) == 5


def test_later_shapes_hide_earlier_ones():
    ball = {"kind": "shape", "form": "circle", "color": [0, 0, 1], "width": 0.8, "path": [[0.4, 0.5]]}
    post = {"kind": "shape", "form": "rectangle", "color": [1, 0, 0], "width": 0.25, "height": 2}
    clip = Clip(scene({"color": [0, 1, 0]}, ball, post))
    frame, known = clip.frame(1), truth(clip, 1)
    mask, seen, front = known["shape-1.mask"], known["shape-1.seen"], known["shape-2.mask"]
    assert (seen <= mask).all()
    assert mask.sum() > 1.1 * seen.sum() > 0
    np.testing.assert_array_equal(frame[front == 1], [[255, 0, 0]] * int((front == 1).sum()))
    np.testing.assert_array_equal(frame[seen == 1], [[0, 0, 255]] * int((seen == 1).sum()))
    other = Clip(scene({"color": [0, 1, 0]}, post, ball)).frame(1)
    np.testing.assert_array_equal(other[mask == 1], [[0, 0, 255]] * int((mask == 1).sum()))


def test_a_new_shape_leaves_all_else_as_it_was():
    first = {"kind": "shape", "form": "ball", "path": [[0.2, 0.3], [0.6, 0.5]]}
    second = {"kind": "shape", "form": "star", "path": [[0.8, 0.7]], "width": 0.3, "start": 2, "end": 4}
    noise = {"kind": "noise"}
    for rest in ([], [noise]):
        with_it, without = (
            Clip(scene({"color": [0.5] * 3}, first, second, *rest)),
            Clip(scene({"color": [0.5] * 3}, first, *rest)),
        )
        for number in range(6):
            hidden = truth(with_it, number)["shape-2.mask"] > 0
            same = (with_it.frame(number) == without.frame(number)).all(axis=-1)
            assert same[~hidden].all()
            assert hidden.any() == (number in (2, 3))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"form": "cube"}, r"form is 'cube'; it must be one of circle, ball"),
        ({"form": "circle", "height": 0.1}, "height of a circle is its width"),
        ({"form": "star", "corners": [[0, 0], [1, 0], [0, 1]]}, "corners are 3 of a star"),
        ({"form": "polygon", "corners": [[0, 0], [1, 0]]}, "corners are 2 of a polygon"),
        ({"form": "circle", "path": [[0, 0], [1, 1]], "at": [3]}, "path has 2 values; .* the 1 frames of `at`"),
        ({"form": "circle", "path": [[0, 0], [1, 1], [0, 1]], "scale": [1, 2]}, "scale has 2 values; .* or 3"),
        ({"form": "circle", "at": [3, 3]}, r"at is \[3.0, 3.0\]; each frame must be greater"),
        ({"form": "circle", "start": 3, "end": 3}, "end is 3; it must be after start, which is 3"),
        ({"form": "circle", "width": 0}, "width is 0; it must be a number from"),
        ({"form": "circle", "color": [1, 1, 2]}, "color is .*; it must be three numbers from 0 to 1"),
    ],
)
def test_a_shape_that_cannot_be_is_refused(wrong, message):
    with pytest.raises(UsageError, match=message):
        Shape.from_table(wrong)
