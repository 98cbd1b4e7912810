"""The viewer's files: the example, those that are opened, dropped or named, damaged ones, and frames that are saved."""

import base64
import json
import re
import struct
import zlib

import numpy as np
import pytest

pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")

import web_pages

from gsvc_ref import cli

EXAMPLE = web_pages.INDEX.with_name("example.gsvc.js").read_text(encoding="utf-8")


def example():
    return base64.b64decode(EXAMPLE.partition("base64: `")[2].partition("`")[0])


def test_the_example_is_small():
    stream = example()
    assert stream.startswith(b"\x89GSVC")
    assert len(stream) <= 15_000
    assert f"{len(stream):,} bytes" in EXAMPLE


def test_a_file_is_dropped(viewer):
    page = viewer()
    data = base64.b64encode(next((web_pages.STREAMS / "moving_frames").glob("*.gsvc")).read_bytes()).decode()
    script = """
    (data) => {
      const dataTransfer = new DataTransfer();
      const bytes = Uint8Array.from(atob(data), (character) => character.charCodeAt(0));
      dataTransfer.items.add(new File([bytes], "dropped.gsvc"));
      const screen = document.querySelector("#screen");
      screen.dispatchEvent(new DragEvent("dragenter", { bubbles: true, dataTransfer }));
      const invited = !document.querySelector("#drop").hidden;
      screen.dispatchEvent(new DragEvent("drop", { bubbles: true, cancelable: true, dataTransfer }));
      return invited && document.querySelector("#drop").hidden;
    }
    """
    assert page.evaluate(script, data)
    page.wait_for_function("document.title.startsWith('dropped.gsvc')")


def test_the_file_that_was_asked_for_last_is_shown(viewer, tmp_path):
    page = viewer()
    page.evaluate("""() => {
      const { arrayBuffer } = Blob.prototype;
      Blob.prototype.arrayBuffer = async function () {
        if (this.name === "slow.gsvc") await new Promise((later) => setTimeout(later, 200));
        const read = await arrayBuffer.call(this);
        if (this.name === "slow.gsvc") setTimeout(() => (window.read = true), 100);
        return read;
      };
    }""")
    page.set_input_files("#open", stream_file(tmp_path, "slow.gsvc", example()))
    page.set_input_files("#open", stream_file(tmp_path, "quick.gsvc", example()))
    page.wait_for_function("window.read")
    assert page.evaluate("document.title").startswith("quick.gsvc")


def stream_file(tmp_path, name, data):
    path = tmp_path / name
    path.write_bytes(data)
    return path


def opened(page, path):
    page.set_input_files("#open", path)
    told = "name => document.querySelector('#status').textContent === `${name} is damaged.`"
    page.wait_for_function(told, arg=path.name)


@pytest.fixture(scope="module")
def files_viewer():
    """One viewer for many files."""
    with web_pages.pages() as opened:
        yield web_pages.viewer(opened())


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda data: data[:-30], ["breaks off", "frames before it are whole", "R-6.2-4"]),
        (lambda data: data[:-60] + bytes([data[-60] ^ 1]) + data[-59:], ["checksum of a chunk is wrong", "R-6.2-2"]),
        (lambda data: b"RIFF" + data[4:], ["is no GSVC file", "No frame can be shown", "R-6.1-1"]),
        (lambda data: data[:8] + b"\x02" + data[9:], ["is of version 2", "reads draft 2", "R-6.1-2"]),
        (lambda data: data[:8] + b"\x81" + data[9:], ["is of draft 1", "encoded again", "R-6.1-2"]),
        (lambda data: b"", ["file is empty", "example.gsvc is still shown"]),
        (lambda data: data + b"more", ["bytes after the end", "R-6.1-4"]),
    ],
    ids=["cut", "flipped", "other", "version", "draft", "empty", "longer"],
)
def test_what_is_wrong_with_a_file_is_said(files_viewer, tmp_path, damage, words):
    page = files_viewer
    data = next((web_pages.STREAMS / "moving_frames").glob("*.gsvc")).read_bytes()
    opened(page, stream_file(tmp_path, "holiday.gsvc", damage(data)))
    notice = page.text("#notice")
    assert notice.startswith("holiday.gsvc")
    for word in words:
        assert word in notice
    page.click("#example")
    page.wait_for_function("document.querySelector('#notice').hidden")


@pytest.mark.parametrize("name", ["moving_frames", "bit_depth_10", "bit_depth_16"])
def test_a_saved_frame_has_the_samples_of_deterministic_decoding(files_viewer, name):
    page = files_viewer
    path = next((web_pages.STREAMS / name).glob("*.gsvc"))
    depth = int(name.rpartition("_")[2]) if "depth" in name else 8
    frames = np.load(web_pages.STREAMS / name / "frames.expected.npy")
    page.set_input_files("#open", path)
    told = f"{frames.shape[2]} × {frames.shape[1]}, {depth} bits"
    page.wait_for_function("told => document.querySelector('#file').textContent.includes(told)", arg=told)
    last = len(frames) - 1
    page.press("End")
    file, png = page.saved()
    assert file == f"{path.stem}_{last:06d}.png"
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    samples, bits = png_samples(png)
    assert bits == (None if depth % 8 == 0 else depth)
    shift = 0 if depth == 8 else 16 - depth
    assert np.array_equal(samples >> shift, frames[last])


def png_samples(data):
    """The samples of a PNG file whose rows have no filter, and sBIT; every checksum is looked at."""
    chunks, at = {}, 8
    while at < len(data):
        (length,) = struct.unpack_from(">I", data, at)
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        assert struct.unpack_from(">I", data, at + 8 + length)[0] == zlib.crc32(kind + body)
        chunks[kind] = body
        at += length + 12
    width, height, depth, color = struct.unpack(">IIBB", chunks[b"IHDR"][:10])
    assert color == 2
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, -1)
    assert not rows[:, 0].any()
    samples = np.ascontiguousarray(rows[:, 1:]).view(">u1" if depth == 8 else ">u2").reshape(height, width, 3)
    return samples.astype(int), chunks[b"sBIT"][0] if b"sBIT" in chunks else None


def facts(page, selector):
    """What a panel says: term -> text."""
    script = "list => Object.fromEntries([...list.querySelectorAll('dt')].map((dt) => [dt.textContent,"
    return page.eval_on_selector(selector, f"{script} dt.nextElementSibling.textContent]))")


@pytest.mark.parametrize("cut", [0, 5000])
def test_the_panels_tell_what_gsvc_info_tells(files_viewer, tmp_path, capsys, cut):
    page = files_viewer
    data = example()
    path = stream_file(tmp_path, f"cut_by_{cut}.gsvc", data[: len(data) - cut])
    page.set_input_files("#open", path)
    page.wait_for_function("name => document.title.startsWith(name)", arg=path.name)
    cli.main(["info", "--json", str(path)])
    told = json.loads(capsys.readouterr().out)
    frames = told["frames"]
    assert page.is_visible("#notice") == (cut > 0)
    about = facts(page, "#file")
    assert about["frames"].startswith(f"{len(frames)} of " if cut else f"{len(frames)} at ")
    counts = [sum(frame["type"] == kind for frame in frames) for kind in "IPR"]
    assert about["of these"] == "{} I, {} P, {} R".format(*counts)
    pixels = told["header"]["width"] * told["header"]["height"] * len(frames)
    size = sum(frame["size"] for frame in frames) if cut else len(data)
    assert float(about["rate"].split(" ")[0].replace(",", "")) == round(8 * size / pixels, 4)
    for frame in frames:
        page.fill("#seek", str(frame["number"]))
        shown = facts(page, "#frame")
        assert shown["number"].startswith(f"{frame['number']} of 0–{len(frames) - 1},")
        assert shown["type"].strip()[0] == frame["type"]
        assert shown["splats"].replace(",", "").partition(":")[0] == str(frame["splats"])
        assert shown["bytes"].replace(",", "") == f"{frame['size']} from byte {frame['offset']}"
        parts = page.eval_on_selector_all("#parts span", "parts => parts.map((part) => part.title)")
        bits = dict(re.fullmatch(r"(\w+): ([\d,]+) bits", part).groups() for part in parts)
        bits = {name: int(count.replace(",", "")) for name, count in bits.items()}
        expected = frame["bits"]
        assert bits.pop("other") == sum(expected.get(part, 0) for part in ("container", "frame_header", "checksums"))
        assert bits.pop("shapes", 0) == expected.get("cholesky", 0) + expected.get("quantizers", 0)
        assert bits.pop("colours", 0) == expected.get("colors", 0)
        assert bits == {part: expected[part] for part in ("positions", "codebooks", "survivors") if expected.get(part)}


def test_a_file_is_named_by_the_address(new_page, server):
    page = new_page()
    path = next((web_pages.STREAMS / "moving_frames").glob("*.gsvc"))
    page.goto(f"{server}viewer/index.html?renderer=webgl2&file=/{path.relative_to(web_pages.ROOT).as_posix()}")
    page.drawn()
    assert page.evaluate("document.title").startswith(path.name)
