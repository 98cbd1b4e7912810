"""What the worst streams of a level cost the viewer's decoder, in CPU time beside gsvc_ref's; nothing for a test."""

import json
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from gsvc_ref.bitstream import LEVELS
from gsvc_ref.main.cells import halving_count
from gsvc_ref.main.codes import IntraCodes, MainCodes
from gsvc_ref.main.densities import Densities, Density
from gsvc_ref.main.motion import field_shape
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import write_stream
from tests import node_decoder
from tests.hostile.hostile_streams import MOTION_CELL, cases, largest_picture, main_frames, main_header

MOST: Final = 5
"""The viewer's decoder may take so many times gsvc_ref's time."""

LEAST_MS: Final = 1.0
"""Frames that take less are not compared: what a call costs would be measured."""

ROUNDS: Final = 6
"""The first ones warm up both; the fastest counts."""

TIMES: Final = """
const { readFileSync } = require("node:fs");
const rounds = [];
for (let round = 0; round < ROUNDS; round++) {
  const reading = new GSVC.StreamReading({ salvage: true });
  reading.append(new Uint8Array(readFileSync(process.argv[2])), true);
  const begun = process.cpuUsage();
  for (const _ of reading.steps());
  const { user, system } = process.cpuUsage(begun);
  if (reading.faultCount > 0) throw new Error(reading.faults[0].message);
  rounds.push((user + system) / 1000 / reading.frames.length);
}
console.log(JSON.stringify(Math.min(...rounds)));
"""


def everywhere(level: int, predicted: int, count: int, *, checksums: bool = False) -> bytes:
    """Splats in random cells with random codes, and P-frames with random vectors, modes and differences."""
    rng = np.random.default_rng(1)
    head = main_header(level, *largest_picture(level), parameter_checksum_flag=int(checksums))
    columns, rows = -(-head.width // 4), -(-head.height // 4)
    cells = np.stack([rng.integers(0, columns, count), rng.integers(0, rows, count)], axis=1)
    order = sum((cells[:, axis] >> bit & 1) << 2 * bit + 1 - axis for bit in range(16) for axis in range(2))
    none = np.zeros((count, 2), np.int64)
    shapes = np.stack([rng.integers(-2, 2, count), none[:, 0], rng.integers(-3, 4, count)], axis=1)
    new = IntraCodes(
        cells=cells[np.argsort(order, kind="stable")], colors=rng.integers(-60, 60, (count, 3)), shapes=shapes,
        places=none,
    )  # fmt: skip
    plain = Densities(tuple(Density(1, 22) for _ in range(6)), (3,) * halving_count(head.width, head.height))
    frames = [MainCodes(type="I", quantizer=24, lane_exponent=6, densities=plain, new=new)]
    for _ in range(predicted):
        modes, differences = rng.integers(0, 8, count), rng.integers(-2, 3, (count, 8))
        for bit, (first, end) in enumerate(((0, 2), (2, 5), (5, 8))):
            differences[:, first] += 3  # not all are 0
            differences[(modes >> bit & 1) == 0, first:end] = 0
        vectors = rng.integers(-8, 9, (*field_shape(head.width, head.height, 16), 2))
        frames.append(
            MainCodes(
                type="P", quantizer=24, lane_exponent=6, motion_cell=MOTION_CELL, vectors=vectors, modes=modes,
                differences=differences,
            )
        )  # fmt: skip
    return write_stream(head, frames, index=False)


def repeated(level: int, frames: int, *, checksums: bool = False) -> bytes:
    """A quarter of the splats each in the base and in three layers, all of which every frame repeats."""
    head = main_header(level, *largest_picture(level), parameter_checksum_flag=int(checksums))
    first = main_frames(head, LEVELS[level].splats // 4, 0)[0]
    again = MainCodes.repeated_frame()
    layers = {n: [(layer, again if n else first) for layer in (1, 2, 3)] for n in range(frames + 1)}
    return write_stream(head, [first] + [again] * frames, layers=layers, index=False)


def streams(level: int) -> Iterator[tuple[str, bytes]]:
    """Streams at the limits of a level, by name."""
    for name, case in cases(level).items():
        if case.rule is None:
            yield name, b"".join(case.make())
    head = main_header(level, *largest_picture(level))
    still = main_frames(head, LEVELS[level].splats, 4)
    yield "main, nothing changes", write_stream(head, still, index=False)
    yield "main, all changes", everywhere(level, 4, LEVELS[level].splats)
    yield "main, all changes, checksums", everywhere(level, 2, LEVELS[level].splats, checksums=True)
    yield "main, layers that repeat", repeated(level, 8)


def of_reference(data: bytes) -> float:
    """Milliseconds of CPU time that gsvc_ref takes for a frame, without drawing it."""
    rounds = []
    for _ in range(ROUNDS):
        begun = time.process_time()
        frames = sum(1 for _ in StreamReader(data, layer=None))
        rounds.append(1000 * (time.process_time() - begun) / frames)
    return min(rounds)


def table(level: int) -> bool:
    """Print what a frame of each stream costs both; whether the viewer's decoder keeps within `MOST`."""
    good = True
    print(f"level    {'stream':30} {'bytes':>10}   gsvc_ref  JavaScript  ratio")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "stream.gsvc"
        for name, data in streams(level):
            path.write_bytes(data)
            reference = of_reference(data)
            viewer = json.loads(node_decoder.run(TIMES.replace("ROUNDS", str(ROUNDS)), path))
            fine = viewer <= max(MOST * reference, LEAST_MS)
            good = good and fine
            times = f"{reference:6.2f} ms  {viewer:7.2f} ms  {viewer / reference:5.1f}"
            print(f"level {level}  {name:30} {len(data):10}  {times}  {'' if fine else 'TOO SLOW'}", flush=True)
    return good
