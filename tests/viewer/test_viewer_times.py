"""When the viewer shows frames: chunks `t` of sound, faulty and cut-off streams say what they say to `Stream.times`."""

import base64

import pytest

pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")

import web_pages

import gsvc_ref
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.times import write_times
from gsvc_ref.testing import OVERVIEW_HEADER, join_chunks, overview_frames, split_chunks, write_stream

FOLDER = web_pages.VECTORS / "core" / "reconstruct_stream"

TOLD = """(data) => {
  const reading = new GSVC.StreamReading({ salvage: true });
  reading.append(Uint8Array.from(atob(data), (character) => character.charCodeAt(0)), true);
  for (const _ of reading.steps());
  return [reading.frames.map((frame) => frame.number), GSVC.timesOf(reading)];
}"""


def stamped(*times):
    """A stream of three frames with such chunks before the first one."""
    data = write_stream(OVERVIEW_HEADER, overview_frames(), index=False)
    header, *rest = split_chunks(data)
    return join_chunks([header, *[(b"t", write_times(*each)) for each in times], *rest], prefix=data[:PREFIX_SIZE])


def streams():
    """Those with time stamps among the vectors, by their names; and one of them cut off."""
    found = {path.parent.name: path.read_bytes() for path in sorted(FOLDER.glob("*time_stamps*/*.gsvc"))}
    empty = stamped((1000, 4, []), (1000, 1, [(1, 400)]))  # the first says nothing of frames
    return {**found, "of no frame, then of one": empty, "cut off": found["time_stamps_of_all_frames"][:-30]}


def test_times_are_those_of_the_reference(viewer):
    page = viewer()
    uneven = 0
    for name, data in streams().items():
        numbers, times = page.evaluate(TOLD, base64.b64encode(data).decode())
        with gsvc_ref.open(data) as stream:
            expected = stream.times()
            rate = stream.format.frame_rate
        if times is None:
            times = [float(number / rate) for number in [*numbers, numbers[-1] + 1]]
        else:
            uneven += 1
        assert times == pytest.approx([float(expected.time_of(n)) for n in [*numbers, numbers[-1] + 1]]), name
    assert uneven >= 4


def test_a_frame_that_takes_no_time_does_not_stop_the_page(viewer):
    page = viewer()
    shown = page.evaluate("""async () => {
      const shown = [];
      const player = new GSVC.Player((n) => shown.push(n), () => {});
      player.load(3, 25, [0, 1e-9, 2e-9, 3e-9]);
      player.play();
      await new Promise((later) => setTimeout(later, 300));
      player.pause();
      return shown.length;
    }""")
    assert shown > 2
