"""What a frame costs the decoder in JavaScript, counted: ``python -m tests.hostile viewer 3`` has the times."""

import json

import pytest

from gsvc_ref.bitstream import LEVELS
from gsvc_ref.testing import write_stream
from tests import node_decoder
from tests.hostile.hostile_streams import (
    end,
    header,
    intra,
    largest_picture,
    main_frames,
    main_header,
    opening,
    predicted,
)
from tests.hostile.viewer_cost import everywhere, repeated

pytestmark = pytest.mark.skipif(node_decoder.missing() != "", reason=node_decoder.missing() or "-")

LEVEL = 1
READ = """
const { readFileSync } = require("node:fs");
const reading = new GSVC.StreamReading();
reading.append(new Uint8Array(readFileSync(process.argv[2])), true);
for (const _ of reading.steps());
const splats = reading.frames.map(({ splatCount }) => splatCount);
console.log(JSON.stringify({ splats, faults: reading.faults, counted: globalThis.counted }));
"""
CALLBACKS = """
globalThis.counted = 0; // how many elements of arrays were handed to a function
for (const type of [Array, Object.getPrototypeOf(Int32Array)]) {
  for (const name of ["every", "filter", "findIndex", "forEach", "map", "reduce", "some"]) {
    const plain = type.prototype[name];
    type.prototype[name] = function (...given) {
      globalThis.counted += this.length;
      return plain.apply(this, given);
    };
  }
  const plain = type.from;
  type.from = function (...given) {
    globalThis.counted += given[0].length ?? 0;
    return plain.apply(this, given);
  };
}
"""
LOOKED_AT = """
globalThis.counted = { work: 0, checksums: 0 }; // splats whose boxes were found, and whose parameters were summed up
const { mainWork } = GSVC.main;
GSVC.main.mainWork = (states, ...size) => {
  globalThis.counted.work += states.length / 8;
  return mainWork(states, ...size);
};
const { setFloat32 } = DataView.prototype;
DataView.prototype.setFloat32 = function (...given) {
  globalThis.counted.checksums += 1 / 8;
  setFloat32.apply(this, given);
};
"""


def read(tmp_path, data, before):
    """Splats of each frame of a stream, and what was counted by code that comes before the script it is about."""
    path = tmp_path / "stream.gsvc"
    path.write_bytes(data)
    found = json.loads(node_decoder.run(READ, path, behind=before))
    assert found["faults"] == []
    return found["splats"], found["counted"]


@pytest.mark.parametrize("name", ["main", "paper"])
def test_no_function_is_called_for_each_splat(tmp_path, name):
    found = []
    for count in (LEVELS[LEVEL].splats, LEVELS[LEVEL].splats // 2):
        if name == "main":
            data = everywhere(LEVEL, 3, count)
        else:
            data = opening(header(LEVEL, 16, 16)) + intra(0, count) + predicted(1, count) + end(2)
        splats, elements = read(tmp_path, data, ("told.js", CALLBACKS))
        assert set(splats) == {count}
        found.append((sum(splats), elements))
    (most, elements), (fewer, fewer_elements) = found
    assert abs(elements - fewer_elements) < 0.02 * (most - fewer)


@pytest.mark.parametrize("layered", [False, True])
def test_splats_that_are_repeated_are_looked_at_once(tmp_path, layered):
    if layered:
        data = repeated(LEVEL, 6, checksums=True)
    else:
        head = main_header(LEVEL, *largest_picture(LEVEL), parameter_checksum_flag=1)
        first = main_frames(head, LEVELS[LEVEL].splats, 0)
        data = write_stream(head, first + [type(first[0]).repeated_frame()] * 6)
    splats, looked_at = read(tmp_path, data, ("main_splats.js", LOOKED_AT))
    assert splats == [LEVELS[LEVEL].splats] * 7
    assert looked_at == {"work": LEVELS[LEVEL].splats, "checksums": LEVELS[LEVEL].splats}
