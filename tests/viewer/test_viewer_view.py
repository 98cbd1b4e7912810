"""The viewer as `gsvc view` opens it: beside the source, with a stream that grows, and with what damage has left."""

from contextlib import closing, contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")

import web_pages

from gsvc_conformance.adapters.web import browser
from gsvc_ref import decode
from gsvc_ref import open as open_stream
from gsvc_ref.metrics import psnr
from gsvc_ref.video import open_writer
from gsvc_tools.viewing.redirect_page import RedirectPage
from gsvc_tools.viewing.server import Viewing, serving
from gsvc_tools.viewing.source_frames import SourceFrames
from gsvc_tools.viewing.streams import GrowingFile, WholeFile

PATH = next((web_pages.STREAMS / "moving_frames").glob("*.gsvc"))
DATA = PATH.read_bytes()
HOSTILE = "<img src=x onerror=alert(1)>.gsvc"
MEASURED = "() => /on average/.test(file.textContent) && !/so far/.test(file.textContent)"


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    """A source: the decoded frames, 4 grey levels off in places; the folder, and the PSNR of each frame."""
    folder = tmp_path_factory.mktemp("source")
    with open_stream(DATA) as stream:
        video = stream.format
    values, rng = [], np.random.default_rng(1)
    with open_writer(folder, video) as writer:
        for number, frame in enumerate(decode(DATA)):
            off = rng.integers(-4, 5, frame.shape) * (number > 0)  # the first frame is the same
            source = np.clip(frame.astype(int) + off, 0, 255).astype(np.uint8)
            writer.write(source)
            values.append(psnr(frame, source, 255))
    return folder, values


@contextmanager
def shown(page, name, stream, source=None):
    """The page with what a server of `gsvc view` has."""
    with serving(Viewing(name, stream, source)) as server:
        page.goto(f"{server.url}&renderer=webgl2")
        yield page


def facts(page, selector):
    """What a panel says: term -> text."""
    script = "list => Object.fromEntries([...list.querySelectorAll('dt')].map((dt) => [dt.textContent,"
    return page.eval_on_selector(selector, f"{script} dt.nextElementSibling.textContent]))")


def test_the_source_is_beside_the_stream_and_measured(new_page, noisy):
    folder, values = noisy
    page = new_page()
    with closing(SourceFrames(str(folder))) as source, shown(page, HOSTILE, WholeFile(PATH), source):
        page.wait_for_function(MEASURED)
        assert page.is_visible("#psnr")
        assert facts(page, "#file")["name"] == HOSTILE  # as text
        assert page.evaluate("document.querySelectorAll('img').length") == 0
        mean, least = facts(page, "#file")["PSNR"].split(" dB on average, ")
        assert float(mean) == pytest.approx(np.mean(values[1:]), abs=0.02)
        assert least.endswith(f"in frame {np.argmin(values)}")
        assert facts(page, "#frame")["PSNR"] == "identical"
        page.press("ArrowRight")
        assert float(facts(page, "#frame")["PSNR"].removesuffix(" dB")) == pytest.approx(values[1], abs=0.02)

        assert page.input_value("#mode") == "split"
        page.select_option("#mode", "stream")
        page.wait_for_function("() => document.querySelector('.beside').hidden")
        stream_alone = page.picture()
        page.press("c")
        assert page.input_value("#mode") == "split"
        half = stream_alone.shape[1] // 2
        picture = page.picture_when(lambda picture: abs(picture - stream_alone)[20:-40, half + 8 :].max() > 2)
        assert abs(picture - stream_alone)[20:-40, : half - 8].max() == 0
        browser.wait(page.page.locator(".wipe").press("ArrowLeft"))
        assert page.get_attribute(".wipe", "aria-valuenow") == "48"

        page.press("c", "c")
        assert page.input_value("#mode") == "difference"
        page.select_option("#gain", "16")
        assert page.text(".side.right") == "GSVC − source, × 16: grey is 0, white +8 of 255, black −8"
        page.press("Home")  # where there is none
        page.picture_when(lambda picture: (abs(picture - 128) <= 1).mean() > 0.3)
        page.click("#example")
        page.wait_for_function("() => document.title.startsWith('example.gsvc')")
        assert page.is_hidden("#beside")
        assert page.is_hidden("#psnr")


def test_a_file_leads_the_browser_there_and_no_command_line_says_where(new_page):
    page = new_page()
    with serving(Viewing("a", WholeFile(PATH))) as server, closing(RedirectPage()) as redirect:
        page.goto(redirect.write(server.url).as_uri())
        page.wait_for_url(server.url)
        page.drawn()
        assert server.is_known.is_set()
        for path in Path("/proc").glob("[0-9]*/cmdline"):  # also of what the browser starts
            with suppress(OSError):
                assert server.token not in path.read_bytes().decode(errors="replace")


def test_a_source_of_another_size_is_not_compared(new_page, tmp_path):
    video_of = next((web_pages.STREAMS / "bit_depth_10").glob("*.gsvc"))
    with open_stream(video_of.read_bytes()) as stream, open_writer(tmp_path / "other", stream.format) as writer:
        writer.write(next(iter(decode(video_of.read_bytes()))))
    page = new_page()
    with closing(SourceFrames(str(tmp_path / "other"))) as source, shown(page, "a", WholeFile(PATH), source):
        page.drawn()
        assert page.text("#notice").startswith("other is not compared: it has ")
        assert page.is_hidden("#beside")


def test_a_live_stream_is_followed_and_ends(new_page, tmp_path):
    fcntl = pytest.importorskip("fcntl", reason="locks of POSIX")
    path = tmp_path / "live.gsvc"
    with open_stream(DATA) as stream:
        ends = [frame.offset + frame.size for frame in stream]
    page = new_page()

    def follows(number):
        page.wait_for_function(
            "n => document.querySelector('#place').textContent.startsWith(`${n} of 0–${n}`)", arg=number
        )

    with shown(page, path.name, GrowingFile(path)), path.open("wb", buffering=0) as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # as an encoder does
        page.wait_for_function("() => document.querySelector('#busy').textContent.startsWith('Waiting')")
        file.write(DATA[: ends[1] + 3])
        follows(1)
        assert page.is_checked("#live")
        page.press("ArrowLeft")
        assert not page.is_checked("#live")
        file.write(DATA[ends[1] + 3 : ends[2]])
        page.wait_for_function("() => document.querySelector('#place').textContent.startsWith('0 of 0–2')")
        page.check("#live")
        follows(2)
        file.write(DATA[ends[2] :])
        file.close()
        page.wait_for_selector("#live-label", state="hidden")
        assert page.is_hidden("#notice")
        assert facts(page, "#file")["frames"].startswith(f"{len(ends)} at ")


def test_frames_behind_damage_are_shown_from_a_disk(viewer, tmp_path):
    page = viewer()
    data = bytearray(page.evaluate("[...atob(GSVC.EXAMPLE.base64)].map((letter) => letter.charCodeAt(0))"))
    with open_stream(bytes(data)) as stream:
        frames = list(stream)
    data[frames[2].offset + 20] ^= 1
    path = tmp_path / "hurt.gsvc"
    path.write_bytes(data[: frames[-1].offset])
    page.set_input_files("#open", path)
    page.wait_for_function("() => document.title.startsWith('hurt.gsvc')")
    with open_stream(bytes(data[: frames[-1].offset])) as stream:
        numbers = [part.number for part in stream.salvage() if hasattr(part, "number")]
    assert numbers[:3] == [0, 1, 7]
    notice = page.text("#notice")
    assert f"The {len(numbers)} whole frames are shown, {len(numbers) - 2} of them after the damage." in notice
    assert "Missing: frames 2 to 6, 17." in notice
    assert "One more fault follows." in notice
    page.press("Home", "ArrowRight", "ArrowRight")
    assert page.text("#place") == f"7 of 0–{numbers[-1]}, I"
    assert facts(page, "#frame")["number"].startswith("7 of ")
    assert "missing: frames 2 to 6, 17" in page.get_attribute("#chart", "aria-label")
    page.press("ArrowLeft")
    assert page.text("#place").startswith("1 of ")
