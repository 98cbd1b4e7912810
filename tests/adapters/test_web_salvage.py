"""The page finds after damage what the reference finds (spec.md 12.5), also when a stream comes in pieces."""

import base64
import random

import pytest

pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")

from gsvc_base.draws import Draws
from gsvc_conformance.adapters import web
from gsvc_conformance.adapters.web import browser
from gsvc_conformance.cases.main_layers import BASE, LAYERS, with_layers
from gsvc_conformance.vector import VECTORS
from gsvc_ref import GsvcError, parameter_checksum
from gsvc_ref import open as open_stream
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.stream import Gap
from gsvc_ref.testing import OVERVIEW_HEADER, join_chunks, overview_frames, split_chunks, write_stream

FOLDERS = ("decode_stream_deterministic", "reconstruct_layers")
LONGEST = 5_000
READ = """
(streams) => streams.map((base64) => {
  const data = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
  const read = (length) => {
    const reading = new GSVC.StreamReading({ salvage: true });
    for (let at = 0; at === 0 || at < data.length; at += length) {
      reading.append(data.slice(at, at + length), at + length >= data.length);
      for (const _ of reading.steps());
    }
    return reading;
  };
  const checksums = (reading, order) => {
    const seek = reading.seeker();
    const found = {};
    for (const n of order) found[n] = GSVC.parameterChecksum(seek(n).parameters);
    return Object.values(found);
  };
  const whole = read(Infinity);
  const pieces = read(97);
  const forwards = [...whole.frames.keys()];
  return {
    numbers: whole.frames.map(({ number }) => number),
    lacking: whole.frames.map(({ lacking }) => lacking),
    forwards: checksums(whole, forwards),
    backwards: checksums(whole, forwards.toReversed()),
    pieces: checksums(pieces, forwards),
    same: JSON.stringify([pieces.frames, pieces.faults]) === JSON.stringify([whole.frames, whole.faults]),
    unknown: whole.missingAtEnd === null,
    missing: whole.frames.reduce((sum, { missing = 0 }) => sum + missing, whole.missingAtEnd),
    faults: whole.faultCount,
  };
})
"""


def damaged(data: bytes, rng: random.Random) -> bytes:
    """A stream with up to three places at which bits were turned, bytes taken out or put in, or all is cut off."""
    changed = bytearray(data)
    for _ in range(rng.randrange(4)):
        at = rng.randrange(min(50, len(changed) - 1), len(changed))
        kind = rng.choice(["turned", "turned", "taken", "put", "cut"])
        if kind == "turned":
            changed[at] ^= 1 << rng.randrange(8)
        elif kind == "taken":
            del changed[at : at + rng.randrange(1, 60)]
        elif kind == "put":
            changed[at:at] = rng.randbytes(rng.randrange(1, 40))
        elif len(changed) > 200:
            del changed[max(at, 200) :]
    return bytes(changed)


def salvaged(data: bytes) -> tuple[list[int], list[int], list[list[int]], int | None]:
    """Numbers, checksums and lost layers of the frames that the reference finds, and how many it misses, if known."""
    numbers, checksums, lacking, missing = [], [], [], [0]
    try:
        with open_stream(data) as stream:
            for part in stream.salvage():
                if isinstance(part, Gap):
                    missing.append(part.missing_count)
                else:
                    numbers.append(part.number)
                    checksums.append(int(parameter_checksum(part.splats)))
                    lacking.append(list(part.lacking))
    except GsvcError:  # there is no header
        return [], [], [], 0
    return numbers, checksums, lacking, None if None in missing else sum(missing)


@pytest.fixture(scope="module")
def page():
    try:
        web.environment()
    except FileNotFoundError as error:
        pytest.skip(str(error))
    return browser.opened(browser.PAGE.as_uri())


def test_what_is_left_is_that_of_the_reference(page):
    rng = random.Random(1)
    sound = [path.read_bytes() for folder in FOLDERS for path in sorted(VECTORS.glob(f"*/{folder}/*/*.gsvc"))]
    sound = [data for data in sound if 300 < len(data) < LONGEST]
    sound += len(sound) // 2 * [with_layers(Draws(29), BASE, LAYERS, parameter_checksum_flag=True)]
    streams = [damaged(rng.choice(sound), rng) for _ in range(40)]
    found = browser.wait(page.evaluate(READ, [base64.b64encode(data).decode() for data in streams]))
    for data, answer in zip(streams, found, strict=True):
        numbers, checksums, lacking, missing = salvaged(data)
        assert answer["numbers"] == numbers
        assert answer["lacking"] == lacking
        assert answer["forwards"] == answer["backwards"] == answer["pieces"] == checksums
        assert answer["same"]
        assert answer["unknown"] == (missing is None)
        assert missing is None or answer["missing"] == missing
    assert sum(answer["faults"] > 0 for answer in found) > 20
    assert sum(answer["missing"] > 0 for answer in found) > 5
    assert sum(any(answer["lacking"]) for answer in found) > 2


def test_hostile_numbers_cost_nothing(page):
    """An I-frame and an end chunk may say that billions of frames are missing before them."""
    stream = write_stream(OVERVIEW_HEADER, overview_frames(), index=False)
    header, first, *_ = split_chunks(stream)
    header = (header[0], header[1][:19] + bytes(4) + header[1][23:])  # frame_count 0: unknown
    late = (first[0], encode_uv(2**32 - 2) + first[1][1:])
    end = (b"E", (2**32 - 1).to_bytes(4, "little") + bytes(4))
    data = join_chunks([header, first, late, end], prefix=stream[:10])
    (answer,) = browser.wait(page.evaluate(READ, [base64.b64encode(data).decode()]))
    assert (answer["numbers"], answer["missing"]) == ([0, 2**32 - 2], 2**32 - 3)
    assert salvaged(data)[::3] == ([0, 2**32 - 2], 2**32 - 3)
