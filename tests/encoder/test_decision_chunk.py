"""The chunk of decisions: what is written is read, and nothing that a hostile one says does any harm."""

import struct
import zlib
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from codec_cases import encoded, fast, waves
from hypothesis import given
from hypothesis import strategies as st

from gsvc_ref import open as open_stream
from gsvc_ref.encoder.decision_chunk import SIGNATURE, pack, unpack
from gsvc_ref.encoder.decisions import CAUSE_NAMES, CAUSES, MAX_VALUE, Decision
from gsvc_ref.encoder.effects import EFFECT_NAMES
from gsvc_ref.errors import UsageError
from gsvc_ref.stream import StreamWriter

CLIP = waves(32, 24, 4)
REPORT, DATA = encoded(CLIP, fast(splats=12))


@st.composite
def decisions(draw):
    """Decisions about a few frames, as encoders make them."""
    return [
        tuple(
            Decision(
                name, draw(st.booleans()), draw(st.sampled_from(CAUSE_NAMES)),
                draw(st.none() | st.integers(0, MAX_VALUE)), draw(st.integers(0, 2**32 - 1)), draw(st.integers(0, 9)),
            )
            for name in EFFECT_NAMES
        )
        for _ in range(draw(st.integers(0, 3)))
    ]  # fmt: skip


@given(decisions())
def test_what_is_packed_is_unpacked_but_for_digits(made):
    told = unpack(pack(made), len(made))
    for before, after in zip((d for f in made for d in f), (d for f in told for d in f), strict=True):
        assert replace(before, value=after.value) == after
        if before.value is None or CAUSES[before.cause].is_rare:
            assert after.value == before.value
        else:
            assert abs(after.value - before.value) <= before.value / 2
            assert len(str(after.value).rstrip("0")) <= 1 or after.value == MAX_VALUE


def test_a_stream_tells_what_its_report_tells():
    with open_stream(DATA) as stream:
        told = unpack(stream.info().ancillary, len(CLIP))
    assert [[replace(one, seconds=0.0, value=one.stored) for one in frame.decisions] for frame in REPORT.frames] == [
        list(frame) for frame in told
    ]


def test_without_decisions_the_frames_are_the_same():
    _, bare = encoded(CLIP, fast(splats=12, decisions=False))
    with open_stream(bare) as a, open_stream(DATA) as b:
        assert a.info().ancillary is None
        assert a.info().bits["ancillary"] == 0
        assert [frame.size for frame in a.info().frames] == [frame.size for frame in b.info().frames]


def test_ordinary_frames_take_a_few_bytes_each():
    """Numbers as they come of a moving scene, all different: some 3 bytes a frame."""
    rng = np.random.default_rng(2)
    usual = {
        "frames": "differs",
        "regions": "rest",
        "gsa": "new",
        "dks": "smooth",
        "gsp": "exchanged",
        "motion": "gain",
    }
    clip = [
        [Decision(name, True, usual[name], int(10 * rng.gamma(4)), 90 if name == "frames" else 0) for name in usual]
        for _ in range(1000)
    ]
    assert len(pack(clip)) < 3200
    still = [[replace(one, value=7) for one in clip[0]]] * 1000
    assert len(pack(still)) < 200


def broken_payloads():
    good = pack([frame.decisions for frame in REPORT.frames])
    body = zlib.decompress(good[8:], -15)

    def with_body(changed: bytes, count: int = 4) -> bytes:
        deflater = zlib.compressobj(wbits=-15)
        return SIGNATURE + struct.pack("<I", count) + deflater.compress(changed) + deflater.flush()

    return {
        "nothing": b"",
        "another application's": b"something else",
        "a later version": b"DEC\x02" + good[4:],
        "cut in its head": good[:6],
        "cut": good[:-3],
        "no deflate": good[:8] + b"\xff" * 20,
        "longer": good + b"\0",
        "other frame count": with_body(body, 5),
        "too short": with_body(body[:-1]),
        "too long": with_body(body + b"\0"),
        "a bomb": with_body(bytes(50_000_000)),
        "unknown cause": with_body(b"\xff" + body[1:]),
        "wrong flag": with_body(body[:24] + b"\x02" + body[25:]),
        "four billion frames": with_body(body, 2**32 - 1),
    }


@pytest.mark.parametrize("name", broken_payloads())
def test_broken_payloads_are_refused(name):
    with pytest.raises(UsageError, match="decisions"):
        unpack(broken_payloads()[name], 4)


@given(st.integers(0, 2**32 - 1), st.data())
def test_no_damage_does_harm(seed, data):
    good = bytearray(pack([frame.decisions for frame in REPORT.frames]))
    rng = np.random.default_rng(seed)
    for _ in range(data.draw(st.integers(1, 4))):
        good[rng.integers(len(good))] = rng.integers(256)
    try:
        told = unpack(bytes(good), 4)
    except UsageError:
        return
    assert len(told) == 4
    assert all(one.reason for frame in told for one in frame)


def test_a_chunk_that_the_level_has_no_room_for_is_left_out():
    with open_stream(DATA) as stream:
        header, frames = stream.header, list(stream)
    target = BytesIO()
    writer = StreamWriter(target, header)
    for frame in frames:
        writer.write_frame(frame.codes)
    writer.finish(("d", bytes(header.limits.payload + 1)))
    with open_stream(target.getvalue()) as stream:
        assert stream.info().ancillary is None
        assert stream.info().error is None
