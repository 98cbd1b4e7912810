"""Decoding a stream of 1920x1080 pixels: its stages apart and in sum, and the memory that it takes."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pkgutil import resolve_name
from typing import Any, Final
from unittest.mock import patch

import numpy as np

from gsvc_lab.benchmarks.material import PROFILES, STREAM_SPLATS, Profile, stream
from gsvc_lab.benchmarks.memory import peaks_of
from gsvc_lab.benchmarks.results import Goal, Section, Table
from gsvc_lab.benchmarks.timing import Spread
from gsvc_ref import decode

GOALS: Final = {10_000: (110, 150), 50_000: (60, 80)}
"""Must and aim in frames per second by N."""

MAIN_GOALS: Final = (1.3, 1.0)
"""Must and aim of the time of profile `main`, in that of `paper`."""

STAGES: Final = {
    "checksum": ("gsvc_ref.bitstream.chunks.crc32c",),
    "entropy": (
        "gsvc_ref.bitstream.planes.decode_kernel",
        "gsvc_ref.bitstream.bit_reader.decode_golombs",
        "gsvc_ref.main.frames.read_predicted",
        "gsvc_ref.main.frames.read_intra",
    ),
    "reconstruct": ("gsvc_ref.stream.profiles.reconstruct",),
    "work": ("gsvc_ref.stream.profiles.rendering_work", "gsvc_ref.main.frames.work_of"),
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
        # One after the other: what is read ahead would count to the frame before.
        stack.enter_context(patch("gsvc_ref.stream.decoder.read_ahead", lambda frames, worth_it: frames))
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
    """Stages, frames per second and memory of both profiles, and what `main` takes against `paper`."""
    section = Section("Decoding")
    header = ["profile", "N", "splats", "frame", "bytes", *COLUMNS, "sum", "frames/s"]
    rows, memory, ratios = [], [], []
    for count in STREAM_SPLATS:
        sources = {profile: stream(count, profile).read_bytes() for profile in PROFILES}
        whole, stages = _measured(sources, threads)
        for label, frames in (("I", slice(0, 1)), ("P", slice(1, None))):
            means = {}
            for profile, source in sources.items():
                seconds = means[profile] = np.array([part[frames] for part in whole[profile]]).mean(axis=1)
                medians = {
                    stage: float(
                        np.median([np.mean([frame[stage] for frame in part[frames]]) for part in stages[profile]])
                    )
                    for stage in COLUMNS
                }
                rate = Spread.of(1 / seconds)
                sizes, splats = np.mean(_frame_sizes(source)[frames], axis=0)
                row = [profile, f"{count:,}", f"{splats:,.0f}", label, f"{sizes:,.0f}"]
                row += [f"{1000 * value:.2f}" for value in medians.values()]
                rows.append([*row, Spread.of(seconds).text(2, 1000), rate.text(0)])
                numbers = {"profile": profile, "splats": count, "frame": label}
                section.numbers.append({**numbers, "stages": medians, "seconds": seconds.tolist()})
                must, aim = GOALS[count]
                goal = f"decode a 1080p stream of {profile}, N = {count:,}, {label}-frames"
                section.goals.append(Goal(goal, "frames/s", must, aim, rate.median, True))
            against = Spread.of(means["main"] / means["paper"])
            ratios.append([f"{count:,}", label, against.text()])
            goal = f"decode main against paper, N = {count:,}, {label}-frames"
            section.goals.append(Goal(goal, "times", *MAIN_GOALS, against.median, False))
        for profile in PROFILES:
            peaks = peaks_of(MEMORY, str(stream(count, profile)))
            memory.append([profile, f"{count:,}", *(f"{peak:.0f}" for peak in peaks)])
            section.numbers.append({"profile": profile, "splats": count, "MiB": peaks})
    text = (
        f"Milliseconds a frame by stage, medians of {ROUNDS} decodes with a clock in every stage, one after the other; "
        "the sum and frames per second without those clocks, median (quartiles), the next frame being read while one "
        "is rendered. The streams are what `gsvc encode` writes with the preset `quick`: an I-frame and three P-frames "
        "of a picture that moves; the first frame also sets the decoder up, in its `other`. `work` is the check of "
        "R-5-4; `render` goes to 8 bits. A kernel of profile `main` that reads also reconstructs: `reconstruct` is 0."
    )
    section.tables.append(Table(text, header, rows))
    text = (
        "Time of a frame of `main` in that of `paper`, decoded in turns, from the file to 8 bits: median (quartiles)."
    )
    section.tables.append(Table(text, ["N", "frame", "main / paper"], ratios))
    header = ["profile", "N", "after import, MiB", "peak, MiB"]
    section.tables.append(Table("Memory of a process of its own that decodes the stream.", header, memory))
    return section


def _measured(
    sources: Mapping[Profile, bytes], threads: int
) -> tuple[dict[Profile, list[list[float]]], dict[Profile, list[list[dict[str, float]]]]]:
    """`frame_seconds` and `stage_seconds` of streams, in turns, `ROUNDS` times after one that does not count."""
    whole: dict[Profile, list[list[float]]] = {profile: [] for profile in sources}
    stages: dict[Profile, list[list[dict[str, float]]]] = {profile: [] for profile in sources}
    for number in range(ROUNDS + 1):
        for profile, source in sources.items():
            seconds, parts = frame_seconds(source, threads), stage_seconds(source, threads)
            if number > 0:
                whole[profile].append(seconds)
                stages[profile].append(parts)
    return whole, stages


def _frame_sizes(source: bytes) -> list[tuple[int, int]]:
    """Bytes and splats of each frame of a stream."""
    from gsvc_ref.stream import StreamReader

    with StreamReader(source) as reader:
        return [(frame.size, len(frame.splats)) for frame in reader.frames()]
