"""Pixel layouts against FFmpeg's own descriptions and copies."""

import numpy as np
import pytest

from gsvc_tools.video.pixel_layout import layout, stand_in, take

av = pytest.importorskip("av")

EXACT = {
    "rgb24": ["bgr24", "rgb0", "bgr0", "0rgb", "0bgr", "rgba", "bgra", "argb", "abgr", "gbrp", "gbrap"],
    "yuv420p": ["nv12", "nv21"],
    "yuv422p": ["yuyv422", "uyvy422", "yvyu422", "nv16"],
    "yuv444p": ["nv24", "nv42"],
    "rgb48le": ["rgb48be", "bgr48le", "bgr48be", "rgba64le", "bgra64be", "gbrp16le", "gbrp16be", "gbrap16le"],
    "yuv420p10le": ["yuv420p10be", "p010le", "p010be"],
    "yuv422p10le": ["yuv422p10be", "p210le"],
    "yuv444p12le": ["yuv444p12be", "p412le"],
    "gbrp10le": ["gbrp10be"],
    "gray": ["ya8"],
    "gray16le": ["gray16be", "ya16le"],
}
"""Formats among which libswscale only moves samples."""


def picture(name, width=14, height=6):
    """A picture with random samples of the right depth in every plane."""
    frame = av.VideoFrame(width, height, name)
    rng = np.random.default_rng(1)
    depth = layout(name).bit_depth
    for plane in frame.planes:
        memory = np.frombuffer(memoryview(plane), layout(name).dtype)
        memory[:] = rng.integers(0, 1 << depth, memory.shape)
    return frame


def components(frame):
    pixels = layout(frame.format.name)
    buffers = [np.frombuffer(memoryview(p), np.uint8).reshape(-1, p.line_size) for p in frame.planes]
    rows = (frame.height + 1) // 2 if pixels.chroma_format == "420" else frame.height
    columns = (frame.width + 1) // 2 if pixels.chroma_format in ("420", "422") else frame.width
    shapes = [(frame.height, frame.width), (rows, columns), (rows, columns)]
    return [take(place, buffers, shapes[i], pixels) for i, place in enumerate(pixels.places)]


@pytest.mark.parametrize(("plain", "name"), [(plain, name) for plain, names in EXACT.items() for name in names])
def test_samples_are_where_libswscale_puts_them(plain, name):
    original = picture(plain)
    copy = original.reformat(format=name)
    assert layout(name).chroma_format == layout(plain).chroma_format
    assert layout(name).bit_depth == layout(plain).bit_depth
    for expected, found in zip(components(original), components(copy), strict=True):
        assert found.dtype == expected.dtype
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("plain", EXACT)
def test_the_plain_formats_match_their_descriptions(plain):
    description = av.VideoFormat(plain, 14, 6)
    pixels = layout(plain)
    assert pixels.bit_depth == description.components[0].bits
    assert [place[0] for place in pixels.places] == [component.plane for component in description.components]


@pytest.mark.parametrize("name", sorted(av.video.frame.supported_np_pix_fmts))
def test_depth_and_alpha_of_every_known_name(name):
    pixels = layout(name)
    if pixels is not None:
        described = av.VideoFormat(name, 16, 16).components
        assert pixels.bit_depth == described[0].bits
        assert (pixels.alpha is not None) == any(component.is_alpha for component in described)
        assert len(pixels.places) == sum(not component.is_alpha for component in described)


@pytest.mark.parametrize(
    "name", ["yuv410p", "yuv440p", "pal8", "rgb565le", "gbrpf32le", "grayf32le", "xyz12le", "gbr", "rgbb"]
)
def test_other_formats_have_no_layout(name):
    assert layout(name) is None


@pytest.mark.parametrize("rgb", [False, True])
@pytest.mark.parametrize("alpha", [False, True])
@pytest.mark.parametrize("deep", [False, True])
def test_stand_ins_have_a_layout(rgb, alpha, deep):
    pixels = layout(stand_in(rgb=rgb, alpha=alpha, deep=deep))
    assert pixels.chroma_format == ("rgb" if rgb else "444")
    assert (pixels.alpha is not None) == alpha
    assert pixels.bit_depth == (16 if deep else 8)
