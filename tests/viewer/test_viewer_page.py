"""The viewer does what its user asks, from a disk and from a server."""

import re
import shutil

import numpy as np
import pytest

pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")

import web_pages

from gsvc_conformance.adapters.web import browser
from gsvc_conformance.vector import VECTORS

DECODER = "conformance/gsvc_conformance/adapters/web"


@pytest.mark.parametrize(("place", "kind"), [("disk", "webgl2"), ("server", "webgl2"), ("disk", "webgpu")])
def test_the_example_is_shown_at_once_and_nothing_else_is_loaded(new_page, server, kind, place):
    page = new_page(width=420, height=420)
    base = web_pages.ROOT.as_uri() + "/" if place == "disk" else server
    page.goto(f"{base}viewer/index.html?renderer={kind}")
    page.wait_for_function("document.querySelector('canvas.picture') || !document.querySelector('#notice').hidden")
    if page.is_visible("#notice"):
        pytest.skip(page.text("#notice"))
    page.drawn()
    assert {"webgl2": "WebGL2", "webgpu": "WebGPU"}[kind] in page.text("#drawing")
    assert "168 × 112" in page.text("#file")
    picture = page.picture()
    cat = picture[80:-80, 80:-80]
    assert cat.std() > 20  # neither black nor flat
    assert cat[..., 0].mean() > cat[..., 2].mean() + 20  # its fur is warm
    assert page.is_hidden("#notice")
    assert all(url.startswith((f"{base}viewer/", f"{base}{DECODER}/", "data:")) for url in page.requests)


def test_it_has_the_scripts_that_are_judged():
    judged, seen = (re.findall(r'src="(.*?)"', page.read_text()) for page in (browser.PAGE, web_pages.INDEX))
    assert judged[-1] == "bridge.js"
    assert seen[: len(judged) - 1] == [f"../{DECODER}/{name}" for name in judged[:-1]]
    assert all((web_pages.INDEX.parent / name).is_file() for name in seen)
    rest = {path.name for path in web_pages.INDEX.parent.glob("*.js")}
    assert rest == set(seen[len(judged) - 1 :])


def test_playing_and_seeking(viewer):
    page = viewer()
    assert page.text("#place") == "0 of 0–17, I"
    page.press("ArrowRight", "ArrowRight")
    assert page.text("#place") == "2 of 0–17, P"
    assert page.input_value("#seek") == "2"
    page.press("]")
    assert page.text("#place") == "7 of 0–17, I"
    page.press("[", "End")
    assert page.text("#place").startswith("17 of 0–17")
    page.press("Home")
    page.fill("#seek", "9")
    assert page.text("#place").startswith("9 of 0–17")
    page.press("Home", "Space")
    assert page.text("#play") == "Pause"
    page.wait_for_function("!document.querySelector('#place').textContent.startsWith('0 of')")
    page.press("Space")
    assert page.text("#play") == "Play"
    place = page.text("#place")
    page.wait_for_timeout(300)
    assert page.text("#place") == place


def test_it_ends_without_loop(viewer):
    page = viewer()
    page.select_option("#speed", "4")
    page.uncheck("#loop")
    page.press("Home")
    page.click("#play")
    page.wait_for_function("document.querySelector('#play').textContent === 'Play'")
    assert page.text("#place").startswith("17 of 0–17")


def test_playing_and_pausing_leaves_one_loop(viewer):
    page = viewer()
    script = """
    () => {
      const waiting = new Set();
      const { requestAnimationFrame: request, cancelAnimationFrame: cancel } = window;
      window.requestAnimationFrame = (step) => {
        const id = request((now) => (waiting.delete(id), step(now)));
        waiting.add(id);
        return id;
      };
      window.cancelAnimationFrame = (id) => (waiting.delete(id), cancel(id));
      for (let i = 0; i < 9; i++) document.querySelector("#play").click();
      return waiting.size;
    }
    """
    assert page.evaluate(script) <= 2  # the player's, and that of the picture
    assert page.text("#play") == "Pause"


def test_the_renderer_that_was_asked_for_last_draws(viewer):
    page = viewer()
    page.evaluate("""() => {
      GSVC.renderers.webgpu = async () => {
        await new Promise((later) => setTimeout(later, 200));
        return { kind: "webgpu", draw: async () => {}, destroy: () => (window.ended = true) };
      };
    }""")
    page.select_option("#renderer", "webgpu")
    page.select_option("#renderer", "webgl2")
    page.wait_for_function("window.ended")
    assert page.text("#drawing dd").startswith("WebGL2")
    page.evaluate("() => { GSVC.renderers.webgpu = async () => { throw new Error('out of ink'); }; }")
    page.select_option("#renderer", "webgpu")
    page.wait_for_selector("#notice:has-text('out of ink')")
    assert page.input_value("#renderer") == "webgl2"
    page.select_option("#renderer", "auto")
    page.wait_for_selector("#notice", state="hidden")


def test_motion_starts_by_itself_unless_it_is_unwanted(viewer):
    page = viewer(reduced_motion="no-preference")
    assert page.text("#play") == "Pause"
    page.emulate_media(reduced_motion="reduce")
    page.click("#example")
    page.wait_for_function("document.querySelector('#play').textContent === 'Play'")


def test_zoom_and_overlay_change_the_picture(viewer):
    page = viewer()
    fitted = page.picture()
    zoom = page.text("#zoom")
    page.press("+", "+", "+")
    assert page.text("#zoom") != zoom
    page.picture_when(lambda picture: abs(picture - fitted).mean() > 3)
    page.press("0")
    assert page.text("#zoom") == zoom
    page.picture_when(lambda picture: abs(picture - fitted).mean() < 1)

    def share_of_orange(picture):
        return ((picture[..., 0] > 170) & (picture[..., 0] - picture[..., 2] > 140)).mean()

    before = share_of_orange(fitted)
    page.press("1", "3")  # an I-frame has new splats only
    page.picture_when(lambda picture: share_of_orange(picture) > before + 0.01)
    page.press("4")  # the page behind the picture, in light colours
    page.picture_when(lambda picture: np.median(picture) > 200 and share_of_orange(picture) > 0.01)


def test_the_picture_is_dragged(viewer):
    page = viewer()
    box = browser.wait(page.page.locator("#screen").bounding_box())
    fitted = page.picture()
    page.press("+", "+", "+", "+", "+")
    page.picture_when(lambda picture: abs(picture - fitted).mean() > 3)
    before = page.picture()

    async def dragged(x, y, dx, dy):
        await page.page.mouse.move(x, y)
        await page.page.mouse.down()
        await page.page.mouse.move(x + dx, y + dy, steps=4)
        await page.page.mouse.up()
        await page.page.mouse.move(0, 0)

    browser.wait(dragged(box["x"] + 200, box["y"] + 80, 60, 25))
    inner = slice(40, -40)
    page.picture_when(lambda after: abs(after[25:, 60:][inner, inner] - before[:-25, :-60][inner, inner]).mean() < 1)
    assert "Followed" not in page.text("#splat")  # it was no click


def test_a_splat_is_followed_to_its_end(viewer):
    page = viewer()
    box = browser.wait(page.page.locator("#screen").bounding_box())
    page.press("ArrowRight")
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    browser.wait(page.page.mouse.move(x, y))
    page.wait_for_function("document.querySelector('#splat').textContent.includes('covered by')")
    assert page.is_visible("#tip")
    browser.wait(page.page.mouse.click(x, y))
    assert "Followed" in page.text("#splat")
    assert "of 190, kept" in page.text("#splat")
    page.press("ArrowRight", "ArrowRight")
    assert "of 190, kept" in page.text("#splat")
    page.press("]")  # behind the cut there are other splats
    assert "not in this frame" in page.text("#splat")
    page.press("Escape")
    assert "Followed" not in page.text("#splat")


def test_followed_splats_are_those_of_the_maps(new_page):
    page = new_page()
    page.goto(web_pages.INDEX.as_uri())
    script = """
    () => {
      const data = Uint8Array.from(atob(GSVC.EXAMPLE.base64), (character) => character.charCodeAt(0));
      const { frames, frame } = GSVC.openStream(data);
      const decoded = frames.map((_, n) => frame(n));
      const stream = { frames, frame: Object.assign((n) => decoded[n], { distance: () => 0 }) };
      const lost = [];
      for (let n = 1; n < stream.frames.length; n++) {
        const { type, splatCount, survivorCount } = stream.frames[n];
        if (type === "I") continue;
        const before = stream.frames[n - 1].splatCount;
        const there = Array.from({ length: before }, (_, i) => new GSVC.splats.Track(stream, n - 1, i).indexIn(n));
        const back = Array.from({ length: splatCount }, (_, i) => new GSVC.splats.Track(stream, n, i).indexIn(n - 1));
        const kept = there.filter((i) => i >= 0);
        if (kept.some((i, k) => i !== k) || kept.length !== survivorCount) lost.push([n, "there"]);
        there.forEach((i, old) => i >= 0 && back[i] !== old && lost.push([n, old]));
        if (back.some((old, i) => (old < 0) !== (i >= survivorCount))) lost.push([n, "back"]);
      }
      return lost;
    }
    """
    assert page.evaluate(script) == []


def test_the_page_is_light_or_dark(viewer):
    page = viewer()
    for color_scheme in ("light", "dark"):
        page.emulate_media(color_scheme=color_scheme)
        ground = page.evaluate("getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)")
        assert (sum(ground) > 380) == (color_scheme == "light")


def test_the_page_fits_its_window(viewer):
    page = viewer(width=1280, height=480)
    for tab in ("#tab-watch", "#tab-check"):
        page.click(tab)
        for width in (1280, 821, 390, 320):
            page.set_viewport_size({"width": width, "height": 480})
            assert page.evaluate("document.scrollingElement.scrollWidth") <= width


def test_every_control_has_a_name(new_page):
    page = new_page()
    page.goto(web_pages.INDEX.as_uri())
    script = """
    () => [...document.querySelectorAll("button, input, select, [tabindex='0']")].filter((control) => {
      const words = [control.ariaLabel, control.textContent, ...[...(control.labels ?? [])].map((l) => l.textContent)];
      return !words.some((word) => /\\w|[‹›+−]/.test(word ?? ""));
    }).map((control) => control.outerHTML)
    """
    assert page.evaluate(script) == []


def test_the_check_of_the_page(viewer, tmp_path):
    page = viewer()
    for operation in ("from_half", "to_frame"):
        shutil.copytree(VECTORS / "core" / operation, tmp_path / "vectors" / "core" / operation)
    shutil.copy(VECTORS / "SHA256SUMS", tmp_path / "vectors")
    page.press("Space")
    page.click("#tab-check")
    assert page.is_hidden("#watch")
    page.set_input_files("#vectors", tmp_path / "vectors")
    page.wait_for_selector("#check-result .answer")
    count = len(list((tmp_path / "vectors" / "core").glob("*/*/manifest.json")))
    assert page.text("#check-result .answer").startswith(f"All {count} answers are right")
    assert "those that SHA256SUMS lists" in page.text("#check-result")
    cells = "rows => rows.map((row) => [0, 1, 3].map((column) => row.cells[column].textContent))"
    rows = page.eval_on_selector_all("#check-result tbody tr", cells)
    assert rows == [["from_half", "passed", "exact"], ["to_frame", "passed", "decision"]]
    assert "reconstruction: incomplete" in page.text("#check-result .classes")
    assert "unless all of its vectors" in page.text("#check-result")

    wrong = tmp_path / "vectors" / "core" / "to_frame" / "the_half_8_bits" / "frame.expected.npy"
    data = bytearray(wrong.read_bytes())
    data[-1] ^= 128
    wrong.write_bytes(data)
    (tmp_path / "vectors" / "SHA256SUMS").unlink()
    page.set_input_files("#vectors", tmp_path / "vectors")
    page.wait_for_selector("#check-result .answer.failed")
    assert "core/to_frame/the_half_8_bits" in page.text("#check-result")

    page.click("#example")
    assert page.is_visible("#watch")


def test_a_server_has_the_vectors(new_page, server):
    page = new_page()
    page.goto(f"{server}viewer/index.html?renderer=webgl2")
    page.drawn()
    page.click("#tab-check")
    page.click("#run-check")
    page.wait_for_function("document.querySelector('#check-progress').value > 0")
    page.click("#stop-check")
    page.wait_for_selector("#check-result .answer.passed")
    assert "stopped before the end" in page.text("#check-result")
