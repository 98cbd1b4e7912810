"""Profile `main` in JavaScript: random, damaged and layered streams against the code of spec.md, and in the viewer."""

import base64
import random

import numpy as np
import pytest

pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")

import web_pages

from gsvc_base.draws import Draws
from gsvc_conformance.adapters import web
from gsvc_conformance.adapters.web import browser
from gsvc_conformance.cases.main_layers import BASE, LAYERS, LayerPlan, with_layers
from gsvc_conformance.cases.main_streams import Plan
from gsvc_ref import spec
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import random_main_stream
from tests.adapters.test_web_operations import damaged, in_base64
from tests.main.material import GROWING, growing

OPEN = """
([base64, mostKept, quality]) => {
  const bytes = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
  const { frames, fault, frame } = GSVC.openStream(bytes, mostKept, quality);
  const order = [...frames.keys(), ...[...frames.keys()].reverse()];
  const sums = order.map((n) => [n, GSVC.parameterChecksum(frame(n).parameters), [...frame(n).origins]]);
  return { frames, fault, sums };
}
"""
PLANES = {
    "positions": ("cells", "place", "position"),
    "cholesky": ("size", "aspect", "shear", "shape"),
    "colors": ("luma", "chroma", "color"),
    "motion": ("motion",),
    "modes": ("modes",),
    "densities": ("densities",),
}


@pytest.fixture(scope="module")
def page():
    try:
        web.environment()
    except FileNotFoundError as error:
        pytest.skip(str(error))
    return browser.opened(browser.PAGE.as_uri())


@pytest.fixture(scope="module")
def layered():
    """A stream of a base and three layers, with checksums."""
    return with_layers(Draws(29), BASE, LAYERS, parameter_checksum_flag=True)


def assert_same(actual, expected):
    assert actual["error"] == expected["error"]
    assert np.array_equal(actual["counts"], expected["counts"])
    assert actual["parameters"].tobytes() == expected["parameters"].tobytes()


@pytest.mark.parametrize("first", [0, 20, 40])
def test_random_streams(page, first):
    for seed in range(first, first + 20):
        stream = random_main_stream(seed).data
        expected, actual = spec.read_main_stream(stream), web.read_main_stream(stream)
        for name, value in expected.items():
            assert actual[name].dtype == value.dtype
            assert np.array_equal(actual[name], value), f"{name} of the stream {seed}"
        assert_same(web.reconstruct_stream(stream), spec.reconstruct_stream(stream))
        last = len(expected["counts"]) - 1
        assert_same(web.seek(stream, last, last), spec.seek(stream, last, last))


def test_damaged_streams(page):
    rng = random.Random(1)
    faults = set()
    for seed in range(150):
        stream = damaged(random_main_stream(seed % 50).data, rng)
        expected = spec.reconstruct_stream(stream)
        assert_same(web.reconstruct_stream(stream), expected)
        faults.update(expected["error"].split()[1:2])
    assert {"R-7-1", "R-6.4-3", "R-3.2-1"} <= faults
    assert len(faults) > 8


def test_layers_and_damaged_layers(page, layered):
    rng = random.Random(3)
    faults = set()
    for number in range(80):
        stream = damaged(layered, rng) if number >= 4 else layered
        quality = number % 4
        expected = spec.reconstruct_layers(stream, quality)
        assert_same(web.reconstruct_layers(stream, quality), expected)
        faults.update(expected["error"].split()[1:2])
    assert {"R-7-1", "R-15.13-1"} <= faults


@pytest.mark.parametrize("name", GROWING)
def test_the_level_counts_a_layer_that_repeats(page, name):
    for level, quality in ((1, 1), (1, 2), (2, 2)):
        stream = growing(name, level, checksums=True)
        assert_same(web.reconstruct_layers(stream, quality), spec.reconstruct_layers(stream, quality))


@pytest.mark.parametrize("data", ["paper", "in front of the first frame"])
def test_chunks_that_are_no_layers_are_skipped(page, layered, data):
    chunk = b"n\x01\xff"
    chunk += spec.crc32c(chunk).to_bytes(4, "little")
    stream = layered if data != "paper" else (web_pages.STREAMS / "moving_frames" / "stream.gsvc").read_bytes()
    payload = stream[11]
    at = 12 + payload + 4  # behind the sequence header
    changed = stream[:at] + chunk + stream[at:]
    for one in (web, spec):
        assert_same(one.reconstruct_layers(changed, 3), spec.reconstruct_layers(stream, 3))


def opened(page, stream, most_kept, quality):
    return browser.wait(page.evaluate(OPEN, [in_base64(stream), most_kept, quality]))


@pytest.mark.parametrize("quality", range(4))
def test_any_frame_of_an_open_stream_with_layers(page, layered, quality):
    expected = spec.reconstruct_layers(layered, quality)
    parts = np.split(expected["parameters"], np.cumsum(expected["counts"])[:-1])
    checksums = [int(spec.parameter_checksum(part)["checksum"]) for part in parts]
    found = [opened(page, layered, most_kept, quality) for most_kept in (1, 10**9)]
    assert found[0] == found[1]
    assert found[0]["fault"] is None
    origins = {}
    for n, checksum, indices in found[0]["sums"]:
        assert checksum == checksums[n]
        assert origins.setdefault(n, indices) == indices
    for n, frame in enumerate(found[0]["frames"]):
        assert frame["splatCount"] == len(origins[n]) == frame["newCount"] + frame["survivorCount"]
        assert sum(index < 0 for index in origins[n]) == frame["newCount"]
        assert sum(frame["planeBits"].values()) == 8 * frame["size"]
        assert min(frame["planeBits"].values()) >= 0
        assert [layer["layer"] for layer in frame["layers"]] == sorted(
            entry.layer for entry in LAYERS if entry.frame == n and entry.layer <= quality
        )
    if quality == 0:
        return
    kept = [(n, i) for n, indices in origins.items() for i, old in enumerate(indices) if old >= 0]
    repeated = sum(np.array_equal(parts[n][i], parts[n - 1][origins[n][i]]) for n, i in kept)
    assert repeated >= 0.5 * len(kept)  # most of these splats do not change, and so it is the same one


def test_the_list_of_frames_has_the_parts_that_the_reference_counts(page):
    for seed in range(10):
        stream = random_main_stream(seed).data
        frames = opened(page, stream, 10**9, 0)["frames"]
        for frame, expected in zip(frames, StreamReader(stream), strict=True):
            assert frame["size"] == expected.size
            for plane, parts in PLANES.items():
                counted = sum(expected.bits.get(part, 0) for part in parts)
                assert frame["planeBits"].get(plane, 0) == counted, f"{plane} of frame {expected.number}"
            if expected.type != "R":
                assert frame["coding"]["quantizer"] == expected.codes.quantizer
                assert frame["coding"]["lanes"] == 1 << expected.codes.lane_exponent


# The viewer.


@pytest.fixture
def new_page():
    with web_pages.pages() as opened:
        yield opened


@pytest.mark.parametrize("kind", ["webgl2", "webgpu"])
def test_the_viewer_shows_layers(new_page, layered, tmp_path, kind):
    path = tmp_path / "layers.gsvc"
    path.write_bytes(layered)
    page = new_page()
    page.goto(f"{web_pages.INDEX.as_uri()}?renderer={kind}")
    page.drawn()
    assert page.is_hidden("#layers")  # the example has none
    page.set_input_files("#open", path)
    page.wait_for_function("document.title.startsWith('layers')")
    assert page.is_visible("#layers")
    assert page.eval_on_selector_all("#layer option", "all => all.map((one) => one.textContent)") == [
        "base", "base + 1", "base + 2", "base + 3",
    ]  # fmt: skip
    page.press("End")
    for quality in (3, 0, 1, 2):
        page.select_option("#layer", str(quality))
        counts = spec.reconstruct_layers(layered, quality)["counts"]
        told = f"{counts[-1]}: "
        page.wait_for_function("told => document.querySelector('#frame').textContent.includes(told)", arg=told)
        page.wait_for_function("document.querySelector('#place').textContent.startsWith('3 of')")
    assert "D 4 (quantizer 24), 1 lane" in page.text("#frame")
    assert "layer 1" in page.text("#frame")
    assert "layer 3" not in page.text("#frame")
    assert "3 above the base" in page.text("#file")


def test_the_viewer_shows_what_stands_before_a_fault(new_page, layered, tmp_path):
    path = tmp_path / "cut.gsvc"
    path.write_bytes(layered[:-40])
    page = new_page()
    page.goto(f"{web_pages.INDEX.as_uri()}?renderer=webgl2")
    page.drawn()
    page.set_input_files("#open", path)
    page.wait_for_function("document.title.startsWith('cut')")
    assert "breaks off" in page.text("#notice")
    assert page.is_visible("#layers")


QUIET = Plan("I", 6), Plan("P", 1, motion_cell=3), Plan("R")
QUIET_LAYERS = LayerPlan(0, 1, Plan("I", 8)), LayerPlan(0, 2, Plan("I", 4)), LayerPlan(1, 2, Plan("P", 1))


def shown(new_page, tmp_path, stream, name="quiet"):
    """A page that shows a stream, with its first frame."""
    path = tmp_path / f"{name}.gsvc"
    path.write_bytes(stream)
    page = new_page()
    page.goto(f"{web_pages.INDEX.as_uri()}?renderer=webgl2")
    page.drawn()
    page.set_input_files("#open", path)
    page.wait_for_function(f"document.title.startsWith('{name}')")
    return page


def told_of_frame(page, number):
    """The facts about a frame, to which the page goes."""
    page.press("Home", *["ArrowRight"] * number)
    page.wait_for_function(f"document.querySelector('#place').textContent.startsWith('{number} of')")
    return page.text("#frame")


def test_the_viewer_tells_what_each_layer_does(new_page, tmp_path):
    points = ((1, 1), (2, 0), (2, 0))
    stream = with_layers(Draws(5), QUIET, QUIET_LAYERS, layer_count=3, level=2, qualities=points)
    page = shown(new_page, tmp_path, stream)
    assert page.is_hidden("#notice")
    assert "base: level 1 at 1/2 of the size; base + 1: level 2; base + 2: level 2" in page.text("#file")
    predicted = told_of_frame(page, 1)
    assert "layer 1moves with the base: no bytes" in predicted
    assert "motion of the base" in predicted.partition("layer 2")[2]
    repeated = told_of_frame(page, 2)
    assert "layer 1stays as it was: no bytes" in repeated
    assert "layer 2stays as it was: no bytes" in repeated


def test_the_viewer_shows_that_a_layer_is_lost(new_page, tmp_path):
    page = shown(new_page, tmp_path, with_layers(Draws(5), QUIET, QUIET_LAYERS, layer_count=3, lost=[(1, 2)]))
    notice = page.text("#notice")
    for words in ("A layer that a frame names is missing.", "2 frames lack a layer.", "R-15.13-6"):
        assert words in notice
    assert "Missing:" not in notice
    assert "2 without a layer" in page.get_attribute("#chart", "aria-label")
    assert "lost" not in told_of_frame(page, 0)
    assert "layer 2lost, and not shown before its next I" in told_of_frame(page, 1)
    assert "layer 1moves with the base" in page.text("#frame")


def test_a_quality_of_a_lower_level_is_shown_without_a_question(new_page, tmp_path):
    points = ((1, 0), (3, 0), (4, 0))
    stream = with_layers(Draws(5), QUIET, QUIET_LAYERS, layer_count=3, level=4, qualities=points)
    page = shown(new_page, tmp_path, stream)
    assert page.is_hidden("#ask")
    assert page.input_value("#layer") == "1"
    page.select_option("#layer", "2")
    page.wait_for_function("!document.querySelector('#ask').hidden")
    page.click("#decode")
    page.wait_for_function("document.querySelector('#layer').value === '2' && document.querySelector('#ask').hidden")


def test_the_example_of_profile_main(new_page):
    page = new_page()
    page.goto(f"{web_pages.INDEX.as_uri()}?renderer=webgl2")
    page.drawn()
    page.click("#example-main")
    page.wait_for_function("document.title.startsWith('example-main')")
    assert "profilemain" in page.text("#file")
    assert "D " in page.text("#frame")
    source = web_pages.INDEX.with_name("example-main.gsvc.js").read_text(encoding="utf-8")
    stream = base64.b64decode(source.partition("base64: `")[2].partition("`")[0])
    assert f"{len(stream):,} bytes" in source
    assert len(stream) <= 15_000
    assert spec.reconstruct_stream(stream)["error"] == ""
