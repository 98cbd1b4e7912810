"""Frames of any size, depth and content, down to one pixel and one splat."""

from io import BytesIO

import numpy as np
import pytest
from codec_cases import encoded, flat, paper_fast, paper_quick, video_format, waves
from hypothesis import given, settings
from hypothesis import strategies as st

from gsvc_ref.encoder import Settings, encode
from gsvc_ref.metrics import psnr
from gsvc_ref.stream import Stream, decode
from gsvc_ref.testing.strategies import videos

SIZES = [(1, 1), (1, 9), (7, 1), (2, 2), (17, 5), (33, 31), (16, 16)]


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("preset", [paper_quick, Settings.paper])
def test_any_size_makes_the_round_trip(width, height, preset):
    clip = waves(width, height, 3)
    report, data = encoded(clip, preset(iterations=3, cholesky_bits=8, key_frames=2, checksums=True))
    decoded = list(decode(data))
    has_pixel_splats = preset is paper_quick and width * height == 1
    assert [frame.type for frame in report.frames] in (
        [list("III")] if has_pixel_splats else [list("IPI"), list("IRI")]
    )
    assert [frame.shape for frame in decoded] == [(height, width, 3)] * 3
    for frame, picture, told in zip(clip, decoded, report.frames, strict=True):
        assert told.psnr == psnr(frame, picture, 255)
        assert 1 <= told.splats <= max(1, width * height // 40)


def test_automatic_key_frames_and_motion_work_at_any_size():
    detection = paper_quick(iterations=1).detection
    for width, height in SIZES:
        clip = waves(width, height, 3)
        report, data = encoded(clip, paper_fast(key_frames="auto", detection=detection))
        assert len(list(decode(data))) == len(report.frames) == 3


@pytest.mark.parametrize("bit_depth", [8, 9, 10, 12, 16])
def test_any_depth_makes_the_round_trip(bit_depth):
    peak = 2**bit_depth - 1
    clip = waves(24, 16, 2, bit_depth=bit_depth)
    report, data = encoded(clip, paper_fast(iterations=60, splats=40), bit_depth)
    decoded = list(decode(data))
    assert {frame.dtype for frame in decoded} == {np.dtype(np.uint8 if bit_depth == 8 else np.uint16)}
    assert max(int(frame.max()) for frame in decoded) <= peak
    assert [frame.psnr for frame in report.frames] == [
        psnr(frame, picture, peak) for frame, picture in zip(clip, decoded, strict=True)
    ]
    assert min(frame.psnr for frame in report.frames) > 22  # 24 to 26 dB at any depth


def test_the_depth_of_the_source_does_not_change_the_splats():
    """16 bits of a clip whose samples are 257 times those of 8 bits are the same picture."""
    eight = waves(24, 16, 2)
    sixteen = [frame.astype(np.uint16) * 257 for frame in eight]
    streams = [Stream(encoded(eight, paper_fast())[1]), Stream(encoded(sixteen, paper_fast(), 16)[1])]
    for a, b in zip(*streams, strict=True):
        assert np.allclose(a.splats.to_array(), b.splats.to_array(), rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("splats", [1, 2])
def test_one_splat_makes_a_frame(splats):
    report, data = encoded(waves(24, 16, 4), paper_fast(splats=splats, key_frames=2))
    assert [frame.splats for frame in report.frames] == [splats] * 4
    assert len(list(decode(data))) == 4


def test_the_papers_preset_can_do_with_one_splat():
    report, _ = encoded(waves(24, 16, 3), Settings.paper(splats=1, iterations=5, key_frames=()))
    assert [frame.splats for frame in report.frames] == [1, 1, 1]


def test_black_is_exactly_black():
    clip = flat(0, frames=2)
    report, data = encoded(clip, paper_fast(effects="auto,frames=all"))
    assert [frame.psnr for frame in report.frames] == [np.inf, np.inf]
    assert report.mean_psnr == np.inf
    assert not any(frame.any() for frame in decode(data))


@pytest.mark.parametrize("value", [255, 128, (255, 0, 60)], ids=["white", "grey", "red"])
def test_even_frames_are_no_trouble(value):
    clip = flat(value, frames=2)
    report, data = encoded(clip, paper_fast(iterations=60, effects="auto,frames=all"))
    assert [frame.type for frame in report.frames] == ["I", "P"]
    assert min(frame.psnr for frame in report.frames) > 20
    assert len(list(decode(data))) == 2


def test_from_black_to_white_and_back():
    clip = [*flat(0), *flat(255), *flat(0), *waves(frames=1), *flat(255)]
    report, data = encoded(clip, paper_fast(iterations=30, effects="auto,frames=all"))
    assert [frame.type for frame in report.frames] == list("IPPPP")
    assert np.isfinite([frame.psnr for frame in report.frames[1:2]]).all()
    assert len(list(decode(data))) == 5


QUICK = st.fixed_dictionaries(
    {"iterations": st.integers(1, 3), "cholesky_bits": st.integers(1, 12)},
    optional={
        "splats": st.integers(1, 6),
        "psnr": st.sampled_from((15.0, 35.0)),
        "key_frames": st.sampled_from((1, 2, "auto", (1, 2))),
        "color_stages": st.integers(1, 8),
        "color_codewords": st.sampled_from((1, 2, 33)),
        "low_latency": st.booleans(),
        "effects": st.sampled_from(["auto", "all", "auto,frames=all", "all,gsa=off,motion=auto"]),
        "lane_count": st.sampled_from((1, 5, 64)),
        "seed": st.integers(0, 2**63 - 1),
    },
)


@settings(max_examples=25)
@given(videos(max_frames=3, max_size=20), QUICK, st.sampled_from((paper_quick, Settings.paper)))
def test_whatever_the_video_and_the_settings_the_stream_decodes(video, overrides, preset):
    frames, bit_depth = video
    height, width = frames[0].shape[:2]
    if overrides.get("splats", 1) > width * height:
        overrides = {**overrides, "splats": width * height}
    if preset == Settings.paper:
        overrides = {"key_frames": 2} | overrides
        overrides["key_frames"] = 2 if overrides["key_frames"] == "auto" else overrides["key_frames"]
    chosen = preset(threads=1, checksums=True, **overrides)
    file = BytesIO()
    report = encode((frames, video_format(width, height, bit_depth)), file, chosen)
    decoded = list(decode(file.getvalue(), threads=1))
    assert report.file_bytes == len(file.getvalue())
    assert len(decoded) == len(frames)
    for frame, picture, told in zip(frames, decoded, report.frames, strict=True):
        assert told.psnr == psnr(frame, picture, 2**bit_depth - 1)
        assert told.splats <= chosen.most_splats(width, height)
