"""`gsvc_ref.encode` takes arrays as they are, and says in a sentence what is wrong with others."""

from fractions import Fraction
from io import BytesIO

import numpy as np
import pytest
from codec_cases import fast, video_format, waves

import gsvc_ref


def encoded(source, **options):
    file = BytesIO()
    return gsvc_ref.encode(source, file, fast(), **options), file.getvalue()


def test_an_array_an_iterable_and_frames_with_a_format_are_the_same_frames():
    clip = waves(24, 16, 3)
    sources = [np.stack(clip), clip, iter(clip), tuple(clip), (frame for frame in clip)]
    results = [encoded(source) for source in sources]
    for report, data in results:
        assert report.header.frame_rate == 25
        assert (report.header.width, report.header.height, report.header.bit_depth) == (24, 16, 8)
        assert data == results[0][1]
    _, paired = encoded((clip, video_format(24, 16)))
    pictures = [list(gsvc_ref.decode(data)) for data in (results[0][1], paired)]
    assert all(np.array_equal(a, b) for a, b in zip(*pictures, strict=True))


def test_16_bits_and_a_frame_rate():
    report, _ = encoded(np.stack(waves(24, 16, 2, bit_depth=16)), frame_rate=Fraction(30000, 1001))
    assert (report.header.bit_depth, report.header.frame_rate) == (16, Fraction(30000, 1001))


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (np.zeros((2, 8, 8, 3)), r"float64; .* np.rint\(np.clip\(frame, 0, 1\) \* 255\).astype\(np.uint8\)"),
        ([np.zeros((8, 8, 3), np.float32)], "frame 0 is float32; .* np.rint"),
        (np.zeros((2, 8, 8, 3), np.int64), "frame 0 is int64; frames are uint8, or uint16"),
        (np.zeros((8, 8, 3), np.uint8), r"shape \(8, 8, 3\); .* one frame, so give array\[None\]"),
        (np.zeros((4, 8, 8), np.uint8), "grey frames, give np.repeat"),
        (np.zeros((2, 3, 8, 8), np.uint8), "channels come last, np.moveaxis"),
        (np.zeros((2, 8, 8, 4), np.uint8), r"leave alpha out, array\[..., :3\]"),
        (np.zeros((0, 8, 8, 3), np.uint8), "there are no frames"),
        ([], "there are no frames"),
        (["a.png"], "frame 0 is a str"),
        ([None], "frame 0 is a NoneType"),
        ([np.zeros((8, 8, 3), np.uint8), np.zeros((8, 9, 3), np.uint8)], r"frame 1: .* shape \(8, 9, 3\)"),
        (5, "a int is not a source"),
        (None, "a NoneType is not a source"),
        ({"a": 1}, "a dict is not a source"),
    ],
)
def test_what_is_no_video_is_refused_with_what_to_do(source, message):
    with pytest.raises((gsvc_ref.UsageError, gsvc_ref.IncompleteEncodeError), match=message):
        encoded(source)


def test_a_frame_rate_is_for_arrays_alone():
    with pytest.raises(gsvc_ref.UsageError, match="frame_rate is 30, but the source states its own"):
        encoded((waves(8, 8, 1), video_format(8, 8)), frame_rate=30)
    with pytest.raises(gsvc_ref.UsageError, match="frame_rate is -1"):
        encoded(waves(8, 8, 1), frame_rate=-1)


def test_settings_are_settings():
    with pytest.raises(gsvc_ref.UsageError, match=r"settings is a dict; give Settings.quick"):
        gsvc_ref.encode(waves(8, 8, 1), BytesIO(), {"splats": 3})
