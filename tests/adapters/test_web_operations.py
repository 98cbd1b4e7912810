"""The decoder in JavaScript, asked each operation in a headless browser, and what it says of damaged streams."""

import base64
import dataclasses
import random
import re

import numpy as np
import pytest

pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")

from gsvc_conformance import spec
from gsvc_conformance.adapters import web
from gsvc_conformance.adapters.web import browser
from gsvc_conformance.cases import full
from gsvc_conformance.implementations import load_module
from gsvc_conformance.results import FAULTS
from gsvc_conformance.runner import run_suite

MODULE = "gsvc_conformance.adapters.web"
EXACT = (
    "read_stream", "decode_plane", "encode_plane", "from_half", "to_half", "reconstruct_intra", "reconstruct_inter",
    "parameter_checksum", "rendering_work", "render_sum_deterministic", "to_frame", "to_frame_deterministic",
    "decode_stream_deterministic", "scale_parameters",
)  # fmt: skip
DRAWN = ("render_sum", "render_frame", "decode_stream", "decode_layers")


@pytest.fixture(scope="module")
def page():
    try:
        web.environment()
    except FileNotFoundError as error:
        pytest.skip(str(error))
    return browser.opened(browser.PAGE.as_uri())


@pytest.mark.parametrize("operation", EXACT)
def test_what_is_computed_in_javascript(page, judge, operation):
    assert {result.outcome for result in judge(MODULE, operation)} == {"pass"}


@pytest.mark.parametrize("kind", ["webgl2", "webgpu"])
@pytest.mark.parametrize("operation", DRAWN)
def test_what_is_drawn(page, judge, monkeypatch, operation, kind):
    monkeypatch.setenv("GSVC_WEB_RENDERER", kind)
    environment = web.environment()
    if environment["renderer"] == "none":
        pytest.skip(environment["adapter"])
    assert environment["renderer"] == kind
    assert {result.outcome for result in judge(MODULE, operation)} == {"pass"}


def test_refusals_tell_rule_and_bit_as_well(page, vector_folder):
    names = [name for name in vector_folder.names if name.split("/")[1] in ("reconstruct_stream", "seek")]
    in_full = dataclasses.replace(load_module(MODULE), in_full=True)
    results = run_suite(in_full, vector_folder.read(names))
    assert [f"{result.id}: {result.message}" for result in results if result.outcome in FAULTS] == []


def test_a_page_without_a_renderer_answers_all_but_pictures(page, monkeypatch):
    monkeypatch.setenv("GSVC_WEB_RENDERER", "an abacus")
    assert web.environment()["renderer"] == "none"
    assert web.from_half(bits=np.array([0x3C00], "<u2"))["values"] == 1
    with pytest.raises(NotImplementedError, match="an abacus"):
        web.render_sum(np.zeros((0, 8), "<f4"), 1, 1)


def test_a_fault_of_the_page_is_told(page):
    with pytest.raises(RuntimeError, match=r"^malformed R-6\.1-1 0 \((bits|syntax)\.js:\d+\)$"):
        web.read_stream(b"no stream")


def test_the_environment_tells_what_was_judged(page):
    environment = web.environment()
    assert environment.keys() == {"browser", "renderer", "adapter", "playwright"}
    assert re.fullmatch(r"Chromium [\d.]+, headless", environment["browser"])


def test_nothing_is_shared_with_the_reference(imported_by):
    assert {name.partition(".")[0] for name in imported_by("web")}.isdisjoint(
        {"gsvc_base", "gsvc_ref", "tests", "scipy", "numba"}
    )
    assert {name for name in imported_by("web") if name.startswith("gsvc_conformance")} == {
        "gsvc_conformance.adapters.web.browser"
    }


# Streams that no vector has: the same stream with random damage, its checksums right, so that faults lie deep.


def uv_and_payload(stream, at):
    """Where the payload of the chunk at a byte begins and ends."""
    length = shift = 0
    at += 1
    while True:
        length |= (stream[at] & 127) << shift
        shift, at = shift + 7, at + 1
        if stream[at - 1] < 128:
            return at, at + length


def damaged(stream, rng):
    """A stream with one to three wrong bytes in payloads, and right checksums."""
    chunks, at = [], 10
    while at < len(stream):
        first, end = uv_and_payload(stream, at)
        chunks.append((at, first, end))
        at = end + 4
    data = bytearray(stream)
    for _ in range(rng.randrange(1, 4)):
        at, first, end = rng.choice([chunk for chunk in chunks if chunk[1] < chunk[2]])
        data[rng.randrange(first, end)] ^= 1 << rng.randrange(8)
        data[end : end + 4] = spec.namespace()["crc32c"](bytes(data[at:end])).to_bytes(4, "little")
    return bytes(data)


def test_damaged_streams_are_refused_as_by_the_decoder_of_the_specification(page, vector_folder):
    rng = random.Random(1)
    sound = [
        vector.inputs["stream"]
        for vector in vector_folder.read([n for n in vector_folder.names if n.startswith("core/reconstruct_stream/")])
        if len(vector.inputs["stream"]) < 2000
    ]
    reconstruct_stream = spec.namespace()["reconstruct_stream"]
    faults = set()
    for _ in range(300):
        stream = damaged(rng.choice(sound), rng)
        expected, actual = reconstruct_stream(stream), web.reconstruct_stream(stream)
        assert actual["error"] == expected["error"], stream.hex()
        assert np.array_equal(actual["counts"], expected["counts"])
        assert actual["parameters"].tobytes() == expected["parameters"].tobytes()
        faults.update(expected["error"].split()[1:2])
    assert len(faults) > 15  # the damage reaches most rules


# What the viewer calls.


def in_base64(stream):
    return base64.b64encode(stream).decode()


OPEN = """
([base64, mostKept, order]) => {
  const bytes = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
  const { header, frames, fault, frame } = GSVC.openStream(bytes, mostKept);
  const sums = order.map((n) => [n, GSVC.parameterChecksum(frame(n).parameters), [...frame(n).origins]]);
  return { header, frames, fault, sums };
}
"""


@pytest.fixture(scope="module")
def forty_frames():
    """A stream, and the checksum of the splats of each frame."""
    stream = full.sequence(np.random.default_rng(3), 64, 48, 30, 40)
    expected = spec.namespace()["reconstruct_stream"](stream)
    checksum = spec.namespace()["parameter_checksum"]
    parts = np.split(expected["parameters"], np.cumsum(expected["counts"])[:-1])
    return stream, [int(checksum(part)["checksum"]) for part in parts]


@pytest.mark.parametrize("most_kept", [1, 20_000, 10**9])
def test_any_frame_of_an_open_stream_in_any_order(page, forty_frames, most_kept):
    stream, sums = forty_frames
    order = [*range(40), *reversed(range(40)), *random.Random(2).choices(range(40), k=40)]
    opened = browser.wait(page.evaluate(OPEN, [in_base64(stream), most_kept, order]))
    assert [(n, value) for n, value, _ in opened["sums"]] == [(n, sums[n]) for n in order]
    assert opened["fault"] is None
    assert opened["header"]["width"] == 64
    for n, _, origins in opened["sums"]:
        frame = opened["frames"][n]
        kept = [origin for origin in origins if origin >= 0]
        assert origins == kept + [-1] * frame["newCount"]
        assert len(kept) == frame["survivorCount"]
        assert kept == sorted(set(kept))
        assert not kept or kept[-1] < opened["frames"][n - 1]["splatCount"]


def test_the_list_of_frames_accounts_for_every_bit(page):
    stream = full.sequence(np.random.default_rng(3), 64, 48, 30, 12)
    frames = browser.wait(page.evaluate(OPEN, [in_base64(stream), 10**9, []]))["frames"]
    assert [frame["number"] for frame in frames] == list(range(12))
    assert frames[0]["type"] == "I"
    for frame in frames:
        assert stream[frame["byteOffset"]] == ord(frame["type"])
        assert uv_and_payload(stream, frame["byteOffset"])[1] + 4 == frame["byteOffset"] + frame["byteLength"]
        assert sum(frame["planeBits"].values()) == 8 * frame["byteLength"]
        assert min(frame["planeBits"].values()) >= 0
        assert frame["splatCount"] == frame["newCount"] + frame["survivorCount"]


def test_a_cut_stream_gives_the_frames_before_the_cut(page):
    stream = full.sequence(np.random.default_rng(3), 64, 48, 30, 12)
    frames = browser.wait(page.evaluate(OPEN, [in_base64(stream), 10**9, []]))["frames"]
    cut = stream[: frames[7]["byteOffset"] + 20]
    opened = browser.wait(page.evaluate(OPEN, [in_base64(cut), 10**9, [6, 0]]))
    assert opened["frames"] == frames[:7]
    assert opened["fault"]["rule"] == "R-6.2-4"
    assert opened["fault"]["message"].startswith("malformed R-6.2-4 ")


def test_a_long_stream_lets_the_page_go_on(page):
    stream = full.sequence(np.random.default_rng(3), 64, 48, 3000, 40)
    script = """
    async (base64) => {
      const bytes = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
      const told = [];
      const stream = await GSVC.openStreamInSteps(bytes, (part) => told.push(part));
      const ended = new AbortController();
      const ending = GSVC.openStreamInSteps(bytes, () => ended.abort(), ended.signal).catch((error) => error.name);
      return { told, same: JSON.stringify(stream) === JSON.stringify(GSVC.openStream(bytes)), ending: await ending };
    }
    """
    result = browser.wait(page.evaluate(script, in_base64(stream)))
    assert result["same"]
    assert result["told"], "40 frames of 3000 splats took less than 30 ms"
    assert result["told"] == sorted(result["told"])
    assert 0 < result["told"][0] < result["told"][-1] <= 1 or len(result["told"]) == 1
    assert result["ending"] == "AbortError"
