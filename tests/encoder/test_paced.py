"""Paced encodes: I-frames at least every four seconds, and an error where a second has too much."""

from dataclasses import replace
from fractions import Fraction
from io import BytesIO

import numpy as np
import pytest
from codec_cases import fast, video_format, waves

from gsvc_base.errors import UsageError
from gsvc_ref.encoder import IncompleteEncodeError, encode, frame_types, setup
from gsvc_ref.encoder.frame_types import TypedFrame
from gsvc_ref.stream import Stream

STILL = [np.zeros((16, 24, 3), np.uint8)] * 10


def encoded(frames, rate=1, **settings):
    """The report and the bytes of an encode at a frame rate."""
    height, width = frames[0].shape[:2]
    file = BytesIO()
    video = replace(video_format(width, height), frame_rate=Fraction(rate))
    return encode((frames, video), file, fast(**settings)), file.getvalue()


def types(frames, **settings):
    _, data = encoded(frames, **settings)
    with Stream(data) as stream:
        assert stream.header.paced_flag == settings.get("paced", False)
        return "".join(frame.type for frame in stream)


def test_an_i_frame_comes_every_four_seconds():
    assert types(STILL, key_frames="auto", paced=True) == "IRRRIRRRIR"
    assert types(STILL, key_frames="auto") == "IRRRRRRRRR"


def test_key_frames_that_are_asked_for_count():
    moving = waves(24, 16, 7)
    assert types(moving, key_frames=(0, 2), paced=True) == "IPIPPPI"


def test_distances_count_from_the_last_i_frame():
    kinds = "IPPIPPPPPPI"
    frames = [TypedFrame(n, STILL[0], kind, "given") for n, kind in enumerate(kinds)]
    found = [item.type for item in frame_types.with_i_frames(frames, 4)]
    assert "".join(found) == "IPPIPPPIPPI"


def test_the_level_has_room_for_a_second():
    assert encoded(STILL[:2], 100_000)[0].header.level == 1
    assert encoded(STILL[:2], 100_000, paced=True)[0].header.level == 2


def test_a_rate_that_no_level_allows_is_refused():
    with pytest.raises(UsageError, match=r"no level allows .*R-5-7"):
        encoded(STILL[:2], 2**31 - 1, paced=True)


def test_a_second_with_too_much_ends_the_encode_with_the_frames_before(monkeypatch):
    monkeypatch.setattr(setup, "paced_level", lambda *_: 1)
    still = [np.zeros((256, 512, 3), np.uint8)] * 70
    with pytest.raises(IncompleteEncodeError, match=r"R-5-7.*saved: 64 complete frames") as ended:
        encoded(still, 100, paced=True, key_frames="auto", splats=4)
    assert len(ended.value.report.frames) == 64
