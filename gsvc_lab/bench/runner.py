"""Several coders on one clip, point by point, with an estimate of the time left; what was measured survives Ctrl-C."""

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from gsvc_base.errors import UsageError
from gsvc_lab.bench import ffmpeg
from gsvc_lab.bench.codecs import CODECS, Codec
from gsvc_lab.bench.coders import MAIN, PAPER, SLOW, WIDER, Coder
from gsvc_lab.bench.elsewhere import MadePoint, submit_point
from gsvc_lab.bench.ffmpeg import FfmpegError
from gsvc_lab.bench.measure import Curve, Point, codec_point, gsvc_point, point_notes
from gsvc_lab.bench.planes import PlanarClip
from gsvc_ref.encoder import Settings

MAX_CURVE_POINTS: Final = len(WIDER)
"""Points that a curve can have."""


@dataclass(frozen=True)
class Entry:
    """A coder by the name that the command line has for it."""

    name: str  # name on the command line
    label: str  # name on the page
    coder: Coder | Codec  # GSVC's settings, or a codec of ffmpeg
    variant: int = 0  # the number of the codec's variant


def _entries() -> tuple[Entry, ...]:
    avc, hevc, av1, vvc = CODECS
    ours = (("gsvc", MAIN), ("gsvc-slow", SLOW), ("gsvc-paper", PAPER))
    theirs = (("x264", avc, 0), ("x264-ip", avc, 1), ("x265", hevc, 0), ("svt-av1", av1, 0), ("vvenc", vvc, 0))
    return (
        *(Entry(name, coder.name, coder) for name, coder in ours),
        *(Entry(name, codec.label(variant), codec, variant) for name, codec, variant in theirs),
    )


ENTRIES: Final = {entry.name: entry for entry in _entries()}
"""All coders by their names; ``x264-ip`` has I- and P-frames only, as GSVC has."""

DEFAULT: Final = ("gsvc", "x264", "x264-ip", "x265", "svt-av1", "vvenc")


def chosen(names: Sequence[str]) -> list[Entry]:
    """The coders of some names, each once, in the order given.

    A UsageError says that there is no such coder, or one needs an ffmpeg that is not there.
    """
    for name in names:
        if name not in ENTRIES:
            raise UsageError(f"there is no coder {name!r}; there are {', '.join(ENTRIES)}")
    entries = [ENTRIES[name] for name in dict.fromkeys(names)]
    if any(isinstance(entry.coder, Codec) for entry in entries):
        ffmpeg.program()
    return entries


def middle(values: Sequence[int], count: int) -> tuple[int, ...]:
    """So many of the values out of their middle, from coarse to fine."""
    start = (len(values) - count) // 2
    return tuple(values[start : start + count])


@dataclass
class Measured:
    """What was measured so far."""

    clip: PlanarClip  # the clip
    # The points of each coder by its label, from coarse to fine
    points: dict[str, list[Point]] = field(default_factory=dict)
    notes: dict[str, dict[str, None]] = field(default_factory=dict)  # what a reader must know of each coder
    missing: dict[str, str] = field(default_factory=dict)  # why a coder has no points
    planned: int = 0  # The number of points that were to be measured, and whether Ctrl-C ended it
    interrupted: bool = False

    @property
    def count(self) -> int:
        """The number of points that were measured."""
        return sum(map(len, self.points.values()))

    @property
    def curves(self) -> list[Curve]:
        """The curves of all coders."""
        return [
            Curve(name, self.clip.title, tuple(points), tuple(self.notes[name]), self.missing.get(name))
            for name, points in self.points.items()
        ]


OnPoint = Callable[[str, float, float | None], None]
"""Called before each point with what comes, the seconds that are spent, and those of the whole (None: unknown)."""


class _Estimate:
    """Seconds in all, from those of the points that are done."""

    def __init__(self) -> None:
        self.begin = time.perf_counter()
        self.spent: dict[str, list[float]] = {}

    def add(self, label: str, seconds: float) -> None:
        """A point is done."""
        self.spent.setdefault(label, []).append(seconds)

    def whole(self, left: Sequence[str]) -> tuple[float, float | None]:
        """Seconds so far, and in all with one more point for each label in `left`; None as long as nothing is known."""
        so_far = time.perf_counter() - self.begin
        means = {label: sum(seconds) / len(seconds) for label, seconds in self.spent.items()}
        if not means:
            return so_far, None
        usual = sum(means.values()) / len(means)
        return so_far, so_far + sum(means.get(label, usual) for label in left)


def measure(
    clip: PlanarClip,  # the clip, as planes
    entries: Sequence[Entry],  # the coders
    points: int,  # points of a curve, 2 to MAX_CURVE_POINTS
    folder: Path,  # folder for files, which are overwritten
    threads: int | None,  # threads to compute with; None: all, and one for each point that an executor measures
    on_point: OnPoint,  # called before each point
    # Measures the points of GSVC, all of them asked for at once; None: they are measured here, one by one
    executor: Executor | None = None,
) -> Measured:
    """Measure each coder at several qualities, in turns from coarse to fine: an early end leaves whole curves."""
    found = Measured(clip, {entry.label: [] for entry in entries}, {entry.label: {} for entry in entries})
    turns = [(entry, number) for number in range(points) for entry in entries]
    found.planned = len(turns)
    asked = {} if executor is None else _asked(executor, clip, turns, points, threads)
    estimate = _Estimate()
    try:
        for place, (entry, number) in enumerate(turns):
            if entry.label in found.missing:
                continue
            left = [other.label for other, _ in turns[place:] if other.label not in found.missing]
            on_point(f"{place + 1}/{len(turns)} {entry.label}", *estimate.whole(left))
            begin = time.perf_counter()
            try:
                made, notes = _point(clip, entry, number, points, folder, threads, asked)
            except FfmpegError as error:
                found.missing[entry.label] = str(error)
                continue
            estimate.add(entry.label, time.perf_counter() - begin)
            found.points[entry.label].append(made)
            found.notes[entry.label] |= dict.fromkeys(notes)
    except KeyboardInterrupt:
        found.interrupted = True
        for future in asked.values():
            future.cancel()
    return found


Asked = Mapping[tuple[str, int], "Future[MadePoint]"]
"""Points that an executor was asked for, by the label of their coder and their number."""


def _asked(
    executor: Executor, clip: PlanarClip, turns: Sequence[tuple[Entry, int]], points: int, threads: int | None
) -> Asked:
    """Ask for all points of GSVC, each with one thread if nothing else is asked for: several may share a machine."""
    each = 1 if threads is None else threads
    return {
        (entry.label, number): submit_point(
            executor, clip, entry.coder, _settings(entry.coder, clip, number, points, each)
        )
        for entry, number in turns
        if isinstance(entry.coder, Coder)
    }


def _settings(coder: Coder, clip: PlanarClip, number: int, points: int, threads: int | None) -> Settings:
    """The settings of a point."""
    area = clip.format.width * clip.format.height
    return coder.settings(splats=max(1, area // middle(WIDER, points)[number]), threads=threads)


def _point(
    clip: PlanarClip, entry: Entry, number: int, points: int, folder: Path, threads: int | None, asked: Asked
) -> MadePoint:
    """One point of a coder, and what a reader must know of it."""
    if (task := asked.get((entry.label, number))) is not None:
        return task.result()
    if isinstance(entry.coder, Coder):
        return gsvc_point(clip, _settings(entry.coder, clip, number, points, threads), folder)
    value = middle(entry.coder.values, points)[number]
    variant = entry.coder.variants[entry.variant]
    made, coded = codec_point(clip, entry.coder, variant, value, folder, threads)
    return made, point_notes(entry.coder, variant, coded) if number == 0 else ()
