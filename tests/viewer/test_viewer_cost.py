"""What a file of any origin may cost the page: a high level is asked about, and nothing long is done in one go."""

import dataclasses

import numpy as np
import pytest

pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")

import web_pages

from gsvc_base.draws import Draws
from gsvc_conformance.cases.main_layers import BASE, LAYERS, with_layers
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, write_stream
from gsvc_tools.viewing.server import Viewing, serving
from gsvc_tools.viewing.streams import GrowingFile, WholeFile

ASKED = "() => !document.querySelector('#ask').hidden"
COUNT_STEPS = """
() => {
  window.steps = 0;
  const { steps } = GSVC.StreamReading.prototype;
  GSVC.StreamReading.prototype.steps = function* () {
    window.steps += 1;
    yield* steps.call(this);
  };
}
"""
SLOW = """
() => { // nothing is kept but the first state, and each step takes too long
  const { StreamReading } = GSVC;
  GSVC.StreamReading = class extends StreamReading {
    constructor(given) {
      super({ ...given, mostKept: 1 });
    }
  };
  GSVC.LONGEST_STEP = -1;
}
"""


@pytest.fixture(scope="module")
def page():
    """A page with all scripts of the viewer."""
    with web_pages.pages() as opened:
        page = opened()
        page.goto(web_pages.INDEX.as_uri())
        yield page


def of_level(folder, level):
    """A file of a level with the stream of spec.md's overview, three frames of 16 x 12 pixels."""
    path = folder / f"level{level}.gsvc"
    path.write_bytes(write_stream(dataclasses.replace(OVERVIEW_HEADER, level=level), overview_frames()))
    return path


def titled(page, name):
    page.wait_for_function("name => document.title.startsWith(name)", arg=name)


def test_a_stream_of_a_higher_level_is_decoded_when_somebody_asks_for_it(viewer, tmp_path):
    page = viewer()
    page.set_input_files("#open", of_level(tmp_path, 3))
    titled(page, "level3.gsvc")
    assert page.is_hidden("#ask")
    page.evaluate(COUNT_STEPS)
    page.set_input_files("#open", of_level(tmp_path, 4))
    page.wait_for_function(ASKED)
    told = page.text("#ask")
    assert "level4.gsvc" in told
    assert "is of level 4: a frame may have up to" in told
    assert "1,048,576 splats" in told
    assert "above level 3 are decoded only when you ask for it" in told
    assert "level3.gsvc is still shown" in told
    assert page.is_hidden("#busy")
    assert page.evaluate("window.steps") == 0  # no frame was decoded
    page.click("#decode")
    titled(page, "level4.gsvc")
    assert page.is_hidden("#ask")
    assert page.evaluate("window.steps") == 1
    assert "3 at 25 a second" in page.text("#file")


def test_another_file_takes_the_question_away(viewer, tmp_path):
    page = viewer()
    page.evaluate(COUNT_STEPS)
    page.set_input_files("#open", of_level(tmp_path, 4))
    page.wait_for_function(ASKED)
    page.set_input_files("#open", of_level(tmp_path, 5))
    page.wait_for_function("document.querySelector('#ask').textContent.includes('level5.gsvc')")
    assert page.is_visible("#ask")
    page.click("#example-main")
    titled(page, "example-main")
    assert page.is_hidden("#ask")
    assert page.evaluate("window.steps") == 1  # of the example alone


def test_layers_are_chosen_without_another_question(viewer, tmp_path):
    path = tmp_path / "layers.gsvc"
    path.write_bytes(with_layers(Draws(29), BASE, LAYERS, level=4))
    page = viewer()
    page.set_input_files("#open", path)
    page.wait_for_function(ASKED)
    page.click("#decode")
    titled(page, "layers.gsvc")
    page.select_option("#layer", "0")
    page.wait_for_function("document.querySelector('#layer').value === '0'")
    assert page.is_hidden("#ask")


@pytest.mark.parametrize("stream", [WholeFile, GrowingFile])
def test_gsvc_view_asks_as_well(new_page, tmp_path, stream):
    path = of_level(tmp_path, 4)
    page = new_page()
    with serving(Viewing(path.name, stream(path))) as server:
        page.goto(f"{server.url}&renderer=webgl2")
        page.wait_for_function(ASKED)
        assert "still shown" not in page.text("#ask")
        assert page.is_hidden("#busy")
        page.click("#decode")
        titled(page, path.name)
        page.wait_for_function("() => document.querySelector('#file').textContent.includes('3 at 25 a second')")
        assert page.is_hidden("#ask")


def test_frames_that_take_long_are_shown_in_the_end(viewer, tmp_path):
    page = viewer()
    page.evaluate(SLOW)
    page.click("#example-main")
    titled(page, "example-main")
    last = int(page.get_attribute("#seek", "max"))
    shown = "n => document.querySelector('#place').textContent.startsWith(`${n} of`)"
    page.press("End", "Home", "End")
    page.wait_for_function(shown, arg=last)
    page.press("ArrowLeft")
    page.wait_for_function(shown, arg=last - 1)
    page.wait_for_selector("#busy", state="hidden")
    page.uncheck("#loop")
    page.press("Home")
    page.wait_for_function(shown, arg=0)
    page.click("#play")
    page.wait_for_function("document.querySelector('#play').textContent === 'Play'")
    page.wait_for_function(shown, arg=last)


def test_ways_to_frames_may_cross(page):
    """Somebody asks for a frame while the way to another one is taken: both get theirs."""
    script = """
    () => {
      const data = Uint8Array.from(atob(GSVC.EXAMPLE_MAIN.base64), (character) => character.charCodeAt(0));
      const checksum = ({ parameters }) => GSVC.parameterChecksum(parameters);
      const { frames, frame } = GSVC.openStream(data, 1);
      const expected = frames.map((_, n) => checksum(GSVC.openStream(data).frame(n)));
      const found = [];
      for (let n = 0; n < frames.length; n++) {
        const other = (5 * n) % frames.length;
        const steps = frame.steps(n);
        const first = steps.next();
        found.push([other, checksum(frame(other))]);
        found.push([n, checksum(first.done ? first.value : GSVC.finished(steps))]);
      }
      const last = frames.length - 1;
      frame(last);
      const distances = [frame.distance(last), frame.distance(2)]; // of frame 2 nothing is kept but the first state
      return [found.filter(([n, sum]) => sum !== expected[n]), distances];
    }
    """
    assert page.evaluate(script) == [[], [0, 3]]


def test_a_splat_is_not_followed_for_more_than_so_many_splats(page):
    script = """
    (splatCount) => {
      let decoded = 0;
      const frame = (n) => {
        decoded += 1;
        return { parameters: new Float32Array(8), origins: Int32Array.of(0) };
      };
      const frames = Array.from({ length: 100 }, () => ({ splatCount }));
      const stream = { frames, frame: Object.assign(frame, { distance: () => 1 }) };
      const there = new GSVC.splats.Track(stream, 50, 0);
      return [there.indexIn(90), there.indexIn(10), decoded];
    }
    """
    assert page.evaluate(script, 100)[:2] == [0, 0]
    there, back, decoded = page.evaluate(script, 2**20)
    assert (there, back) == (None, None)
    assert decoded < 20


def test_a_frame_is_rendered_in_steps(page):
    splats = np.tile(np.array([5, 4, 2, 0, 2, 0.5, 0.25, 1], "<f4"), (7, 1))
    script = """
    async (values) => {
      const parameters = Float32Array.from(values);
      const parts = [];
      const steps = GSVC.renderingSteps(parameters, 10, 8);
      let step = steps.next();
      for (; !step.done; step = steps.next()) parts.push(step.value);
      const whole = GSVC.renderSumDeterministic(parameters, 10, 8);
      const later = await GSVC.inSteps(GSVC.renderingSteps(parameters, 10, 8));
      const same = (sum) => sum.every((value, i) => value === whole[i]);
      return [parts.length, same(step.value), same(later), whole.some((value) => value > 0)];
    }
    """
    assert page.evaluate(script, splats.ravel().tolist()) == [7, True, True, True]


def test_no_frame_is_left_out_while_another_is_late(page):
    script = """
    () => {
      const waiting = [];
      const { requestAnimationFrame } = window;
      window.requestAnimationFrame = (step) => waiting.push(step);
      const shown = [];
      const player = new GSVC.Player((n) => shown.push(n), () => {});
      player.load(100, 10); // each is shown for 100 ms
      player.play();
      let now = 0;
      const wait = (milliseconds) => {
        now += milliseconds;
        waiting.shift()(now);
      };
      for (const milliseconds of [0, 110]) wait(milliseconds);
      player.late = true;
      for (let i = 0; i < 20; i++) wait(100);
      player.late = false;
      for (const milliseconds of [16, 50, 60, 110]) wait(milliseconds);
      window.requestAnimationFrame = requestAnimationFrame;
      return shown;
    }
    """
    assert page.evaluate(script) == [0, 1, 2, 3]
