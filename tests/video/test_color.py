"""Colour conversion against published values, itself, and an independent converter."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_ref import spec
from gsvc_ref.video import ColorDescription, VideoFormat, to_planes, to_rgb
from gsvc_ref.video.color import matrix_pair

MATRICES = (0, 1, 4, 5, 6, 7, 8, 9)


def make_format(width=8, height=6, bit_depth=8, chroma="444", matrix=1, full=False, location=0):
    color = ColorDescription(1, 1, matrix, full, location)
    return VideoFormat(width, height, Fraction(25), bit_depth, chroma, color)


@st.composite
def formats(draw, matrices=MATRICES):
    chroma = draw(st.sampled_from(("420", "422", "444")))
    matrix = draw(st.sampled_from([m for m in matrices if m != 0 or chroma == "444"]))
    return make_format(
        draw(st.integers(1, 40)),
        draw(st.integers(1, 40)),
        draw(st.integers(8, 16)),
        chroma,
        matrix,
        draw(st.booleans()),
        draw(st.integers(0, 5)),
    )


def random_frame(video, seed):
    return np.random.default_rng(seed).integers(0, video.peak + 1, (video.height, video.width, 3), dtype=video.dtype)


@pytest.mark.parametrize(
    ("matrix", "cr_to_r", "cb_to_g", "cr_to_g", "cb_to_b"),
    [
        (1, 1.5748, -0.1873, -0.4681, 1.8556),
        (4, 1.4, -0.3319, -0.7119, 1.78),
        (5, 1.402, -0.3441, -0.7141, 1.772),
        (6, 1.402, -0.3441, -0.7141, 1.772),
        (7, 1.576, -0.2266, -0.4766, 1.826),
        (9, 1.4746, -0.1646, -0.5714, 1.8814),
    ],
)
def test_decoding_matrices_have_the_published_values(matrix, cr_to_r, cb_to_g, cr_to_g, cb_to_b):
    _, inverse = matrix_pair(matrix)
    published = [[1, 0, cr_to_r], [1, cb_to_g, cr_to_g], [1, cb_to_b, 0]]
    np.testing.assert_allclose(inverse, published, rtol=0, atol=6e-5)


@pytest.mark.parametrize("matrix", MATRICES)
def test_matrices_are_inverse_to_each_other(matrix):
    forward, inverse = matrix_pair(matrix)
    np.testing.assert_allclose(forward @ inverse, np.eye(3), rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("matrix", "bit_depth", "full", "rgb", "codes"),
    [
        (6, 8, False, (255, 0, 0), (81, 90, 240)),
        (6, 8, False, (0, 255, 0), (145, 54, 34)),
        (6, 8, False, (0, 0, 255), (41, 240, 110)),
        (6, 8, False, (255, 255, 255), (235, 128, 128)),
        (6, 8, True, (255, 0, 0), (76, 85, 255)),
        (1, 8, False, (255, 0, 0), (63, 102, 240)),
        (1, 8, False, (0, 255, 0), (173, 42, 26)),
        (1, 8, False, (0, 0, 255), (32, 240, 118)),
        (1, 10, False, (1023, 0, 0), (250, 409, 960)),
        (1, 10, False, (0, 0, 0), (64, 512, 512)),
        (9, 10, False, (1023, 1023, 1023), (940, 512, 512)),
        (0, 8, False, (0, 255, 255), (235, 235, 16)),
        (8, 8, True, (0, 255, 0), (128, 255, 128)),
        (8, 8, True, (200, 100, 100), (125, 103, 178)),
    ],
)
def test_known_codes(matrix, bit_depth, full, rgb, codes):
    video = make_format(1, 1, bit_depth, "444", matrix, full)
    planes = to_planes(np.array([[rgb]], video.dtype), video)
    assert tuple(int(plane[0, 0]) for plane in planes) == codes


def as_spec_says(video):
    """The format in the arguments of spec.md's functions."""
    color = video.color
    return (
        ("rgb", "420", "422", "444").index(video.chroma_format),
        color.matrix,
        int(color.full_range),
        color.chroma_location,
        video.bit_depth,
    )


@settings(max_examples=60, deadline=None)
@given(formats(matrices=(*MATRICES, 2)), st.integers(0, 2**32))
def test_conversion_has_the_bits_of_spec_md(video, seed):
    frame = random_frame(video, seed)
    planes = to_planes(frame, video)
    plain = spec.frame_to_planes(frame, *as_spec_says(video)).values()
    for plane, expected, shape in zip(planes, plain, video.plane_shapes, strict=True):
        assert plane.shape == shape
        assert plane.dtype == expected.dtype == video.dtype
        np.testing.assert_array_equal(plane, expected)
    rng = np.random.default_rng(seed)
    wild = tuple(rng.integers(0, np.iinfo(p.dtype).max + 1, p.shape, dtype=p.dtype) for p in planes)
    frame = to_rgb(wild, video)
    assert frame.dtype == video.dtype
    assert frame.max() <= video.peak
    np.testing.assert_array_equal(frame, spec.planes_to_frame(*wild, *as_spec_says(video))["frame"])


@settings(max_examples=40, deadline=None)
@given(formats(matrices=[m for m in MATRICES if m]), st.integers(0, 2**32))
def test_grey_stays_grey(video, seed):
    grey = np.repeat(random_frame(video, seed)[..., :1], 3, axis=-1)
    planes = to_planes(grey, video)
    middle = 1 << (video.bit_depth - 1)
    assert (planes[1] == middle).all()
    assert (planes[2] == middle).all()
    back = to_rgb(planes, video)
    np.testing.assert_array_equal(back[..., 0], back[..., 1])
    np.testing.assert_array_equal(back[..., 0], back[..., 2])
    step = 1 if video.color.full_range else Fraction(video.peak, 219 << (video.bit_depth - 8))
    assert np.abs(back.astype(int) - grey).max() <= (0 if video.color.full_range else step / 2 + Fraction(1, 2))


@settings(max_examples=30, deadline=None)
@given(st.sampled_from(MATRICES), st.integers(8, 16), st.integers(0, 2**32))
def test_rgb_through_full_range_444_is_off_by_one_step_at_most(matrix, bit_depth, seed):
    video = make_format(16, 16, bit_depth, "444", matrix, full=True)
    frame = random_frame(video, seed)
    back = to_rgb(to_planes(frame, video), video)
    assert np.abs(back.astype(int) - frame).max() <= (0 if matrix == 0 else 1)


@settings(max_examples=30, deadline=None)
@given(st.sampled_from([m for m in MATRICES if m]), st.integers(8, 16), st.integers(0, 2**32))
def test_limited_444_through_rgb_is_exact_inside_the_gamut(matrix, bit_depth, seed):
    """Rounding R'G'B' moves a limited-range code by at most 224/255 of half a step."""
    video = make_format(16, 16, bit_depth, "444", matrix)
    inner = random_frame(video, seed) // 2 + np.asarray(video.peak // 4, video.dtype)
    planes = to_planes(inner, video)
    again = to_planes(to_rgb(planes, video), video)
    for plane, plane_again in zip(planes, again, strict=True):
        np.testing.assert_array_equal(plane, plane_again)


@pytest.mark.parametrize("chroma", ["420", "422"])
@pytest.mark.parametrize("location", range(6))
@pytest.mark.parametrize(("width", "height"), [(40, 36), (41, 37)])
def test_a_colour_gradient_survives_subsampling(chroma, location, width, height):
    """Linear chroma is neither shifted nor blurred, whatever the siting; at the edges it lies half a sample off."""
    video = make_format(width, height, 10, chroma, 1, full=True, location=location)
    y, x = np.mgrid[:height, :width]
    frame = np.stack([200 + 8 * x + 3 * y, 500 + 2 * x - 4 * y, 700 - 7 * x + 6 * y], axis=-1).astype(np.uint16)
    error = np.abs(to_rgb(to_planes(frame, video), video).astype(int) - frame)
    assert error[2:-2, 2:-2].max() <= 1
    assert error.max() <= 20


def test_a_wrong_siting_is_visible():
    video = make_format(40, 36, 10, "420", 1, full=True, location=0)
    x = np.broadcast_to(np.arange(40), (36, 40))
    frame = np.stack([200 + 16 * x, 500 + 0 * x, 900 - 16 * x], axis=-1).astype(np.uint16)
    planes = to_planes(frame, video)
    centred = replace(video, color=replace(video.color, chroma_location=1))
    error = np.abs(to_rgb(planes, centred).astype(int) - frame)
    assert error[2:-2, 2:-2].max() >= 6


def test_a_steep_edge_is_clipped_not_wrapped():
    video = make_format(2, 1, 8, "444", 1)
    planes = [np.array([[255, 0]], np.uint8), np.array([[255, 0]], np.uint8), np.array([[255, 0]], np.uint8)]
    np.testing.assert_array_equal(to_rgb(planes, video), [[[255, 184, 255], [0, 77, 0]]])


def test_unspecified_matrix_follows_the_height():
    small, large = make_format(4, 576, matrix=2), make_format(4, 577, matrix=2)
    for video, matrix in ((small, 6), (large, 1)):
        stated = replace(video, color=replace(video.color, matrix=matrix))
        frame = random_frame(video, 7)
        for plane, expected in zip(to_planes(frame, video), to_planes(frame, stated), strict=True):
            np.testing.assert_array_equal(plane, expected)


@pytest.mark.parametrize(("chroma", "matrix"), [("444", 10), ("420", 14), ("rgb", 0)])
def test_formats_without_a_conversion_are_refused(chroma, matrix):
    video = make_format(chroma=chroma, matrix=matrix)
    with pytest.raises(UsageError, match=r"supported are|ask for"):
        to_planes(random_frame(video, 0), video)


def test_arrays_that_do_not_fit_are_refused():
    video = make_format(8, 6, 10, "420")
    frame = random_frame(video, 0)
    planes = to_planes(frame, video)
    with pytest.raises(UsageError, match="the frame is uint8"):
        to_planes(frame.astype(np.uint8), video)
    with pytest.raises(UsageError, match="10 bits end at 1023"):
        to_planes(frame + np.uint16(1024), video)
    with pytest.raises(UsageError, match="a plane is"):
        to_rgb((planes[0], planes[1][:-1], planes[2]), video)


@pytest.mark.parametrize(("matrix", "name"), [(1, "ITU709"), (6, "ITU601"), (7, "SMPTE240M")])
@pytest.mark.parametrize("full", [False, True])
def test_agrees_with_libswscale(matrix, name, full):
    """An independent converter with fixed-point arithmetic: the same matrix and range within two steps."""
    av = pytest.importorskip("av")
    video = make_format(64, 32, 8, "444", matrix, full)
    planes = to_planes(random_frame(video, 3), video)
    picture = av.VideoFrame.from_ndarray(np.stack(planes), format="yuv444p")
    span = "JPEG" if full else "MPEG"
    copy = picture.reformat(
        format="rgb24", src_colorspace=name, src_color_range=span, dst_color_range="JPEG", interpolation="BICUBIC"
    )
    error = np.abs(to_rgb(planes, video).astype(int) - copy.to_ndarray())
    assert error.max() <= 2
