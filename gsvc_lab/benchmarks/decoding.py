"""Decoding a stream of 1920x1080 pixels: its stages apart and in sum, and the memory that it takes."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pkgutil import resolve_name
from typing import Any, Final
from unittest.mock import patch

import numpy as np

from gsvc_lab.benchmarks.material import STREAM_SPLATS, stream
from gsvc_lab.benchmarks.memory import peaks_of
from gsvc_lab.benchmarks.results import Goal, Section, Table
from gsvc_lab.benchmarks.timing import Spread
from gsvc_ref import decode

GOALS: Final = {10_000: (150, 250), 50_000: (70, 120)}
"""Must and aim in frames per second by N."""

STAGES: Final = {
    "checksum": ("gsvc_ref.bitstream.chunks.crc32c",),
    "entropy": ("gsvc_ref.bitstream.planes.decode_kernel", "gsvc_ref.bitstream.bit_reader.decode_golombs"),
    "reconstruct": ("gsvc_ref.stream.chunk_decoder.reconstruct",),
    "work": ("gsvc_ref.stream.chunk_decoder.rendering_work",),
    "chunk": ("gsvc_ref.stream.reader.ChunkDecoder.decode",),
    "render": ("gsvc_ref.stream.decoder.SequenceRenderer.next_frame",),
}
"""The functions that are timed for each stage. Those of the first four are called within `chunk`; the rest of it is
parsing, and what is in no stage is `other`."""

COLUMNS: Final = ("checksum", "parse", "entropy", "reconstruct", "work", "render", "other")

ROUNDS: Final = 15

MEMORY: Final = """
import sys
from gsvc_lab.benchmarks.memory import peak_kib
import gsvc_ref, gsvc_ref.encoder
before = peak_kib()
for frame in gsvc_ref.decode(sys.argv[1]): pass
print(before, peak_kib())
"""


@contextmanager
def timed_stages(spent: dict[str, float]) -> Iterator[None]:
    """Add up the seconds inside the functions of `STAGES`."""

    def timed(stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            begin = time.perf_counter()
            try:
                return function(*arguments, **options)
            finally:
                spent[stage] += time.perf_counter() - begin

        return call

    with ExitStack() as stack:
        for stage, names in STAGES.items():
            for name in names:
                stack.enter_context(patch(name, timed(stage, resolve_name(name))))
        yield


def frame_seconds(source: bytes, threads: int) -> list[float]:
    """Seconds of each frame of a stream."""
    seconds, begin = [], time.perf_counter()
    for _ in decode(source, threads=threads):
        end = time.perf_counter()
        seconds.append(end - begin)
        begin = end
    return seconds


def stage_seconds(source: bytes, threads: int) -> list[dict[str, float]]:
    """Seconds of each stage of each frame of a stream."""
    frames = []
    spent: dict[str, float] = defaultdict(float)
    with timed_stages(spent):
        frames_of_stream = decode(source, threads=threads)
        while True:
            spent.clear()
            begin = time.perf_counter()
            if next(frames_of_stream, None) is None:
                break
            whole = time.perf_counter() - begin
            parse = spent["chunk"] - sum(spent[stage] for stage in COLUMNS[:1] + COLUMNS[2:5])
            other = whole - spent["chunk"] - spent["render"]
            frames.append({**spent, "parse": parse, "other": other})
    return frames


def decoding(threads: int) -> Section:
    """Stages, frames per second, and memory."""
    section = Section("Decoding")
    header = ["N", "frame", "bytes", *COLUMNS, "sum", "frames/s"]
    rows, memory = [], []
    for count in STREAM_SPLATS:
        path = stream(count)
        source = path.read_bytes()
        frame_seconds(source, threads), stage_seconds(source, threads)
        whole, stages = [], []
        for _ in range(ROUNDS):
            whole.append(frame_seconds(source, threads))
            stages.append(stage_seconds(source, threads))
        sizes = _frame_bytes(source)
        for label, frames in (("I", slice(0, 1)), ("P", slice(1, None))):
            seconds = np.array([part[frames] for part in whole]).mean(axis=1)
            medians = {
                stage: float(np.median([np.mean([frame[stage] for frame in part[frames]]) for part in stages]))
                for stage in COLUMNS
            }
            rate = Spread.of(1 / seconds)
            row = [f"{count:,}", label, f"{np.mean(sizes[frames]):,.0f}"]
            row += [f"{1000 * value:.2f}" for value in medians.values()]
            rows.append([*row, Spread.of(seconds).text(2, 1000), rate.text(0)])
            section.numbers.append({"splats": count, "frame": label, "stages": medians, "seconds": seconds.tolist()})
            must, aim = GOALS[count]
            goal = f"decode a 1080p stream, N = {count:,}, {label}-frames"
            section.goals.append(Goal(goal, "frames/s", must, aim, rate.median, True))
        peaks = peaks_of(MEMORY, str(path))
        memory.append([f"{count:,}", *(f"{peak:.0f}" for peak in peaks)])
        section.numbers.append({"splats": count, "MiB": peaks})
    text = (
        "Milliseconds a frame by stage, medians of "
        f"{ROUNDS} decodes with a clock in every stage; the sum and frames per second without those clocks, median "
        "(quartiles). The stream is what `gsvc encode` writes with the preset `quick`: an I-frame and three P-frames "
        "of a picture that moves; the first frame also sets the decoder up, in its `other`. `work` is the check of "
        "R-5-4; `render` goes to 8 bits."
    )
    section.tables.append(Table(text, header, rows))
    header = ["N", "after import, MiB", "peak, MiB"]
    section.tables.append(Table("Memory of a process of its own that decodes the stream.", header, memory))
    return section


def _frame_bytes(source: bytes) -> list[int]:
    from gsvc_ref.stream import StreamReader

    with StreamReader(source) as reader:
        return [frame.size for frame in reader.frames()]
