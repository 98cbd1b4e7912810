"""Profile `main` in JavaScript: tables, states and runs, in Node and without a browser."""

import json
from pathlib import Path

import numpy as np
import pytest

from gsvc_ref import spec
from tests import node_decoder

pytestmark = pytest.mark.skipif(node_decoder.missing() != "", reason=node_decoder.missing() or "-")

COUNT = 5_000
OF_STATES = """
const { readFileSync } = require("node:fs");
const bytes = readFileSync(process.argv[2]);
const states = new Int32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
const { main } = GSVC;
console.log(JSON.stringify({
  parameters: [...new Uint32Array(main.stateParameters(states).buffer)],
  work: [0, 1, 2, 3].map((halvings) => main.mainWork(states, 1921, 1079, halvings)),
}));
"""
TABLES = """
const { EXP2, FAMILIES, betaBinomial } = GSVC.main;
const crc = (values, size) => {
  const bytes = new DataView(new ArrayBuffer(size * values.length));
  values.forEach((value, i) => (size === 2 ? bytes.setUint16(2 * i, value, true)
    : bytes.setUint32(4 * i, value, true)));
  return GSVC.crc32c(new Uint8Array(bytes.buffer));
};
const halves = [1, 2, 3, 4, 6, 10, 20, 100].flatMap((alpha) =>
  Array.from({ length: 15 }, (_, i) => [...betaBinomial(i + 1, alpha)].slice(1, -1)).flat());
console.log(JSON.stringify([crc([...EXP2], 2), ...FAMILIES.map((T) => crc([...T], 4)), crc(halves, 2)]));
"""
RUNS = """
const { main, Bits } = GSVC;
let state = 1;
const random = (most) => Math.floor(((state = (Math.imul(state, 1103515245) + 12345) >>> 0) / 2 ** 32) * most);
const uv = (value) => (value < 128 ? [value] : [128 | (value & 127), ...uv(value >> 7)]);
const some = (count, most) => Array.from({ length: count }, () => random(most));
const tables = [0, 1, 2].map(() => main.frequenciesOf(Uint32Array.from(some(24, 200), (count) => count + 1)));
let wrong = 0;
for (let round = 0; round < 300; round++) {
  const laneExponent = random(10);
  const passes = Array.from({ length: 1 + random(5) }, () => {
    const count = random(400);
    const sizes = some(count, 19);
    return { which: some(count, 3), symbols: some(count, 24), sizes, low: sizes.map((size) => random(2 ** size)) };
  });
  const of = (value) => passes.flatMap(({ which, symbols }) => symbols.map((s, i) => value(tables[which[i]], s, i)));
  const lateSizes = some(random(400), 7);
  const late = lateSizes.map((size) => random(2 ** size));
  const coded = main.encodeRun({
    starts: of((C, s) => C[s]), frequencies: of((C, s) => C[s + 1] - C[s]),
    lanes: of((C, s, i) => i % 2 ** laneExponent),
    laneCount: 2 ** laneExponent, early: passes.flatMap(({ low }) => low),
    earlySizes: passes.flatMap(({ sizes }) => sizes), late, lateSizes,
  });
  const le = (value, size) => Array.from({ length: size }, (_, i) => (value >>> (8 * i)) & 255);
  const bytes = Uint8Array.from([
    ...[...coded.laneStates].flatMap((lane) => le(lane, 4)), ...coded.wordCounts.slice(0, -1).flatMap(uv),
    ...[...coded.words].flatMap((word) => le(word, 2)), ...coded.tail,
  ]);
  const run = new main.Run(new Bits(bytes), laneExponent, {});
  const same = (found, expected) => found.every((value, i) => value === expected[i]);
  const part = (function* () {
    for (const [i, { which, symbols, sizes, low }] of passes.entries()) {
      if (!same(run.symbols(tables, which), symbols) || !same(run.early(sizes), low)) wrong += 1;
      if (i + 1 < passes.length) yield;
    }
  })();
  run.passes([part]);
  if (!same(run.finish([["late", lateSizes]])[0], late)) wrong += 1;
}
console.log(JSON.stringify({ wrong }));
"""


def random_states(rng: np.random.Generator) -> np.ndarray:
    """States (COUNT, 8) with values at the ends of their ranges, and at 0, among others of all magnitudes."""
    columns = []
    for most in [2**24, 2**24, None, None, 2**15 - 1, 2**28, 2**28, 2**28]:
        low, high = (-3072, 13311) if most is None else (-most, most)
        values = np.sign(high) * rng.integers(low, high, COUNT, endpoint=True)
        if most is not None:
            values >>= rng.integers(0, 28, COUNT)
        corner = rng.integers(0, 8, COUNT)
        columns.append(np.select([corner == 0, corner == 1, corner == 2], [low, high, 0], values))
    return np.stack(columns, axis=1)


def test_parameters_and_work_of_random_states(tmp_path: Path):
    states = random_states(np.random.default_rng(1))
    path = tmp_path / "states"
    path.write_bytes(states.astype("<i4").tobytes())
    found = json.loads(node_decoder.run(OF_STATES, path))
    expected = spec.state_parameters(states)["parameters"]
    assert np.array_equal(np.array(found["parameters"], np.uint32), expected.view(np.uint32).ravel())
    assert found["work"] == [int(spec.main_work(states, 1921, 1079, halvings)["work"]) for halvings in range(4)]


def test_tables_are_those_of_the_specification():
    words = [spec.EXP2.astype("<u2"), spec.LOGISTIC.astype("<u4"), spec.LAPLACE.astype("<u4")]
    assert json.loads(node_decoder.run(TABLES)) == [*(spec.crc32c(table.tobytes()) for table in words), 0x3EEBFA2E]


def test_symbols_and_raw_bits_come_back_from_runs_of_all_lane_counts():
    assert json.loads(node_decoder.run(RUNS)) == {"wrong": 0}
