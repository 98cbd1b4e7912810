"""The log of decisions: what is written is read, and nothing that a hostile one says does any harm."""

import json
import tracemalloc
import zlib
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from codec_cases import encoded, flat, paper_fast, waves
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_ref import open as open_stream
from gsvc_ref.encoder import Settings
from gsvc_ref.encoder.effects import EFFECT_NAMES, Effects
from gsvc_ref.encoder.log import (
    LOG_SIGNATURE,
    MAX_LOG_LINE,
    MAX_STEPS,
    OFF,
    Decision,
    FrameLog,
    percent,
    read_log,
    write_log,
)
from gsvc_ref.stream import StreamWriter

CLIP = waves(32, 24, 4)
REPORT, DATA = encoded(CLIP, paper_fast(splats=12))
LOG = write_log([frame.decisions for frame in REPORT.frames])


def without_seconds(frames):
    return [tuple(replace(one, seconds=0.0) for one in frame) for frame in frames]


def lines_of(payload: bytes) -> list[dict]:
    return [json.loads(line) for line in zlib.decompress(payload[len(LOG_SIGNATURE) :], -15).splitlines()]


def packed(body: bytes) -> bytes:
    deflater = zlib.compressobj(wbits=-15)
    return LOG_SIGNATURE + deflater.compress(body) + deflater.flush()


def changed(number: int, name: str, **fields) -> bytes:
    """The log of REPORT with other fields of one decision, or without those that are None."""
    lines = lines_of(LOG)
    entry = lines[number][name] | fields
    lines[number][name] = {key: value for key, value in entry.items() if value is not None}
    return packed(b"".join(json.dumps(line).encode() + b"\n" for line in lines))


phrases = st.text(st.characters(categories=["L", "N", "P", "S"]) | st.just(" "), min_size=1, max_size=20)
counts = st.integers(0, 3) | st.integers(0, MAX_STEPS)
frames = st.lists(
    st.tuples(*(st.builds(Decision, st.just(name), st.booleans(), phrases, counts, counts) for name in EFFECT_NAMES)),
    max_size=3,
)


@given(frames)
def test_what_is_written_is_read(made):
    assert read_log(write_log(made), len(made)) == made


def test_a_stream_holds_the_decisions_of_the_report():
    with open_stream(DATA) as stream:
        found = read_log(stream.info().ancillary, len(CLIP))
    assert found == without_seconds(frame.decisions for frame in REPORT.frames)
    assert sum(one.seconds for frame in REPORT.frames for one in frame.decisions) > 0


def test_the_log_is_lines_of_json_by_names():
    first, second, *_ = lines_of(LOG)
    assert list(first) == ["frame", *EFFECT_NAMES]
    assert first["frames"]["reason"] == "the first frame"
    assert first["frames"]["iterations"] == REPORT.frames[0].iterations
    assert first["dks"] == {"done": False, "reason": "key frames are not looked for"}
    assert second["frame"] == 1


def test_names_of_later_versions_are_skipped():
    lines = lines_of(LOG)
    for line in lines:
        line["later"] = [line["gsa"]]
        line["gsa"]["later"] = {}
    body = b"".join(json.dumps(line).encode() + b"\n" for line in lines)
    assert read_log(packed(body), len(CLIP)) == read_log(LOG, len(CLIP))


def test_without_decisions_the_frames_are_the_same():
    _, bare = encoded(CLIP, paper_fast(splats=12, decisions=False))
    with open_stream(bare) as a, open_stream(DATA) as b:
        assert a.info().ancillary is None
        assert a.info().bits["ancillary"] == 0
        assert [frame.size for frame in a.info().frames] == [frame.size for frame in b.info().frames]


def test_ordinary_frames_take_a_few_bytes_each():
    """Numbers as they come of a moving scene, all different: some 17 bytes a frame, and next to nothing if none is."""
    rng = np.random.default_rng(2)
    usual = {
        "frames": "{} % of the pixels differ from the frame before",
        "regions": "{} % of the splats are static: nothing changed under them",
        "gsa": "{} % of the picture is predicted worse than the frame before was left",
        "dks": "no cut: the picture changes by {} % of its variance",
        "gsp": "{} splats make room for new ones",
        "motion": "moved splats bring the prediction {} dB closer",
    }
    clip = [
        [Decision(name, True, usual[name].format(int(10 * rng.gamma(4)))) for name in EFFECT_NAMES] for _ in range(1000)
    ]
    assert len(write_log(clip)) < 20_000
    assert len(write_log([clip[0]] * 1000)) < 6_000


BODY = zlib.decompress(LOG[len(LOG_SIGNATURE) :], -15)
DEEP = b'{"frame":0,"frames":' + b"[" * (MAX_LOG_LINE - 30) + b"\n"
BROKEN = {
    "nothing": b"",
    "another application's": b"something else",
    "the table of an earlier version": b"DEC\x01" + LOG[4:],
    "a later version": b"LOG\x02" + LOG[4:],
    "cut in its head": LOG[:3],
    "cut": LOG[:-3],
    "no deflate": LOG_SIGNATURE + b"\xff" * 20,
    "longer": LOG + b"\0",
    "no end of the last line": packed(BODY[:-1]),
    "a frame less": packed(BODY[: BODY[:-1].rindex(b"\n") + 1]),
    "a frame more": packed(BODY + BODY.splitlines(keepends=True)[-1].replace(b'"frame":3', b'"frame":4')),
    "frames in another order": packed(b"".join(reversed(BODY.splitlines(keepends=True)))),
    "an empty line": packed(BODY + b"\n"),
    "a bomb of one line": packed(bytes(10_000_000)),
    "a bomb of lines": packed(b"\n" * 10_000_000),
    "a bomb after the log": packed(BODY + b" " * 10_000_000),
    "a line that is too long": packed(BODY.replace(b"{", b"{" + b" " * MAX_LOG_LINE, 1)),
    "no JSON": packed(BODY.replace(b"}", b"]")),
    "no text": packed(BODY.replace(b'"', b"\xff")),
    "deep": packed(DEEP + BODY[BODY.index(b"\n") + 1 :]),
    "lists": packed(b"[]\n" * 4),
    "numbers": packed(b"0\n" * 4),
    "an effect less": packed(BODY.replace(b'"gsa"', b'"asg"')),
    "an effect that is a number": packed(BODY.replace(b'"gsa":{', b'"gsa":7,"asg":{')),
    "an effect that is a text": packed(BODY.replace(b'"gsa":{', b'"gsa":"done reason","asg":{')),
    "no done": changed(1, "gsa", done=None),
    "no reason": changed(1, "gsa", reason=None),
    "done is a number": changed(1, "gsa", done=1),
    "the reason is a list": changed(1, "gsa", reason=["new"]),
    "the reason is empty": changed(1, "gsa", reason=""),
    "the reason commands a terminal": changed(1, "gsa", reason="\x1b[2J"),
    "the reason is half a character": changed(1, "gsa", reason="\ud800"),
    "iterations are no whole number": changed(1, "gsa", iterations=1.5),
    "iterations are True": changed(1, "gsa", iterations=True),
    "iterations are negative": changed(1, "gsa", iterations=-1),
    "saved is huge": changed(1, "gsa", saved=10**400),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_payloads_are_refused(name):
    tracemalloc.start()
    with pytest.raises(UsageError, match="decisions"):
        read_log(BROKEN[name], len(CLIP))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2_000_000


@given(st.integers(0, 2**32 - 1), st.data())
def test_no_damage_does_harm(seed, data):
    good = bytearray(LOG if data.draw(st.booleans()) else BODY)
    rng = np.random.default_rng(seed)
    for _ in range(data.draw(st.integers(1, 4))):
        good[rng.integers(len(good))] = rng.integers(256)
    try:
        found = read_log(bytes(good) if good.startswith(LOG_SIGNATURE) else packed(bytes(good)), 4)
    except UsageError:
        return
    assert len(found) == 4
    assert all([one.effect for one in frame] == list(EFFECT_NAMES) for frame in found)
    assert all(one.reason.isprintable() and one.iterations >= 0 for frame in found for one in frame)


def test_a_log_that_the_level_has_no_room_for_is_left_out():
    with open_stream(DATA) as stream:
        header, decoded = stream.header, list(stream)
    target = BytesIO()
    writer = StreamWriter(target, header)
    for frame in decoded:
        writer.write_frame(frame.codes)
    writer.finish(("d", bytes(header.limits.payload + 1)))
    with open_stream(target.getvalue()) as stream:
        assert stream.info().ancillary is None
        assert stream.info().error is None


def test_a_frame_has_one_decision_about_each_effect_the_last_one_made():
    log = FrameLog([Decision("gsp", True, "at first")])
    with log.timed("gsp"):
        log.add("gsp", "at last", done=False, saved=3)
    found = {one.effect: one for one in log.completed(Effects.parse("auto,motion=off"), "I")}
    assert list(found) == list(EFFECT_NAMES)
    assert (found["gsp"].reason, found["gsp"].done, found["gsp"].saved) == ("at last", False, 3)
    assert found["gsp"].seconds > 0
    assert found["motion"].reason == OFF
    assert found["gsa"].reason == "an I-frame begins from nothing"
    assert {one.reason for one in FrameLog().completed(Effects(), "R")} == {"the frame before is repeated"}
    assert "room for all splats" in {one.effect: one for one in FrameLog().completed(Effects(), "P")}["gsp"].reason


def test_percentages_are_at_least_one():
    assert [percent(fraction) for fraction in (1e-9, 0.004, 0.375, 1)] == ["1 %", "1 %", "38 %", "100 %"]


@pytest.mark.parametrize("settings", [Settings.quick(splats=4), Settings.quick(profile="paper", splats=4)])
def test_a_repeated_frame_saves_the_iterations_of_a_p_frame_of_its_profile(settings):
    report, _ = encoded(flat(90, 16, 12, frames=4), replace(settings, threads=1))
    saved = [{one.effect: one for one in frame.decisions}["frames"].saved for frame in report.frames]
    inter = settings.inter
    steps = inter.evaluations if settings.profile == "main" else inter.fit.iterations + inter.tune.iterations
    assert [frame.type for frame in report.frames] == ["I", "R", "R", "R"]
    assert saved == [0, steps, steps, steps]
