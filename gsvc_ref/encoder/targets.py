"""Goals of a whole clip: a bit rate, a size, a mean PSNR, a mean VMAF.

For a bit rate or a size the clip is encoded twice. The first pass tells what each frame of each group of pictures takes
with one number of splats, and the first frames of each group, encoded again with another number, how that changes.
`curves.equal_slope` makes a plan of that, and `BudgetCoder` keeps to it in the second pass. Should the stream miss the
goal by more than TOLERANCE, as where a group cannot be as small or as large as planned, what it took corrects the
curves, and another pass follows.

For a mean PSNR or VMAF the clip is encoded with one number of splats after another, by a line over its logarithm.
"""

import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from shutil import copyfileobj
from tempfile import TemporaryFile
from typing import IO, Final, cast

from gsvc_ref.encoder.budget import BudgetCoder, GroupPlan
from gsvc_ref.encoder.curves import FrameCost, GroupCurve, equal_slope
from gsvc_ref.encoder.encoder import LedBy, encode_once
from gsvc_ref.encoder.reading_again import Chosen, readable_again
from gsvc_ref.encoder.report import EncodeReport, FrameReport, IncompleteEncodeError, OnProgress, Progress
from gsvc_ref.encoder.settings import MIN_PIXELS_PER_SPLAT, Settings
from gsvc_ref.encoder.source_and_target import Source, Target, is_file
from gsvc_ref.errors import UsageError
from gsvc_ref.files import opened_output
from gsvc_ref.metrics.libvmaf import MIN_SIDE, ffmpeg_with_libvmaf, vmaf
from gsvc_ref.portable import log2, power, total
from gsvc_ref.stream import decode
from gsvc_ref.video import VideoReader
from gsvc_ref.video.format import FrameRate

TOLERANCE: Final = 0.03
"""A stream that is as near to its goal, in parts of it, is left as it is."""

MOST_PASSES: Final = 3
"""How often a stream is encoded at most after the first pass, to come near enough."""

SPLAT_BITS: Final = 33.0
"""Bits of an I-frame for each splat, and..."""

LATER_BITS: Final = 7.0
"""...those of a P-frame, about, for the first guess of N: of the scenes ``pan`` and ``water``, 128x96, 640 splats."""

FIRST_LOWER: Final = 0.5
"""The first pass has so many octaves of splats less than the guess, since it is the cheaper."""

SAMPLED: Final = 3
"""The frames of each group that are encoded again with another number of splats."""

LEAST_APART: Final = 0.75
"""By how many octaves at least that number differs."""

GUESSED_FRAMES: Final = 25
"""Frames between two I-frames, for the guess alone."""

MOST_SEARCHES: Final = 5
"""How often a clip is encoded at most to reach a mean quality."""

NEAR: Final = {"mean_psnr": 0.2, "vmaf": 1.0}
"""A mean quality that is reached by at most so much more is not looked for any further."""

QUALITY_SLOPE: Final = {"mean_psnr": 3.4, "vmaf": 10.0}
"""First guess of what twice the splats gain."""

START: Final = {"mean_psnr": 33.0, "vmaf": 80.0}
"""First guess of what the default number of splats reaches."""

EQUAL_PSNR: Final = 100.0
"""The PSNR that stands for that of a frame equal to its source in a mean that is to be reached, in dB."""


def encode_to_goal(
    source: Source,
    target: Target,
    settings: Settings,
    frame_rate: FrameRate | None,
    jobs: int,
    executor: Executor | None,
    progress: OnProgress | None,
    *,
    live: bool,
) -> EncodeReport:
    """Encode with a goal of `settings.GOALS`; parameters, results and errors are those of `encode`.

    The report is that of the pass that is kept, with the time of all passes, and notes tell what was reached.

    Raises
    ------
    UsageError
        With `live`, since the first frame is final only when the whole clip has been encoded once; without a program
        that has VMAF; or the source can be read once only and its frames do not fit into a temporary file.
    """
    if live:
        raise UsageError(f"{settings.goal} needs every frame twice, and a live stream is written at once: drop one")
    if settings.vmaf is not None and (why := ffmpeg_with_libvmaf()[1]) is not None:
        raise UsageError(f"a VMAF cannot be held: {why}")
    with readable_again(source, frame_rate) as opened:
        passes = _Passes(opened, target, settings, jobs, executor, progress)
        by_size = settings.goal in ("bitrate", "size")
        report = _to_size(passes) if by_size else _to_quality(passes)
    seconds = time.perf_counter() - passes.begin
    stages = {**report.seconds_by_stage, "other passes": seconds - report.seconds}
    report = replace(report, settings=settings, seconds=seconds, seconds_by_stage=stages)
    if passes.fault is not None:
        fault = passes.fault
        raise IncompleteEncodeError(fault.kind, fault.message, report, fault.rule, fault.bit) from fault
    return report


class _Passes:
    """The passes over a clip: what they share.

    Attributes
    ----------
    base
        The settings without a goal.
    low, high
        Limits of log2 of the number of splats.
    begin
        When the first one began, by `time.perf_counter`.
    fault
        What ended the last pass early, if anything did.
    """

    def __init__(
        self,
        opened: Callable[[], VideoReader],
        target: Target,
        asked: Settings,
        jobs: int,
        executor: Executor | None,
        progress: OnProgress | None,
    ) -> None:
        self._opened, self.target, self.asked = opened, target, asked
        self._jobs, self._executor, self._progress = jobs, executor, progress
        self.begin = time.perf_counter()
        self.fault: IncompleteEncodeError | None = None
        self.base = asked.with_(bitrate=None, size=None, mean_psnr=None, vmaf=None)
        with opened() as reader:
            self.format = reader.format
        if asked.vmaf is not None and min(self.format.width, self.format.height) < MIN_SIDE:
            raise UsageError(f"a VMAF cannot be held: VMAF needs frames of at least {MIN_SIDE}x{MIN_SIDE} pixels")
        pixels = self.format.width * self.format.height
        self.most = max(1, pixels // MIN_PIXELS_PER_SPLAT) if asked.splats is None else asked.splats
        self.base.with_(splats=self.most).splat_count(self.format.width, self.format.height)  # refuses too many
        self.low, self.high = 0.0, float(log2(self.most))

    def frames(self) -> VideoReader:
        """A new reader of the source."""
        return self._opened()

    def run(
        self, reader: VideoReader, target: Target, settings: Settings, step: str, led_by: LedBy | None = None
    ) -> EncodeReport:
        """Encode once."""

        def show(progress: Progress) -> None:
            if self._progress is not None:
                elapsed = time.perf_counter() - self.begin
                self._progress(replace(progress, step=step, elapsed_s=elapsed))

        with reader:
            return encode_once(
                reader, target, settings, None, self._jobs, self._executor, show if self._progress else None,
                led_by=led_by,
            )  # fmt: skip

    def tried(
        self, reader: VideoReader, file: IO[bytes], settings: Settings, step: str, led_by: LedBy | None = None
    ) -> EncodeReport:
        """Encode once to a temporary file; a fault of the source ends it early, as it will end the last pass.

        Raises
        ------
        KeyboardInterrupt
            It was interrupted.
        """
        try:
            report = self.run(reader, cast("Target", file), settings, step, led_by)
        except IncompleteEncodeError as error:
            self.fault, report = error, error.report
        if report.interrupted:
            raise KeyboardInterrupt
        return report

    def put(self, file: IO[bytes]) -> None:
        """Put a stream from a temporary file in the target's place."""
        file.seek(0)
        with opened_output(self.target) as target:
            copyfileobj(file, target)


@dataclass(frozen=True)
class _Stream:
    """A stream that was encoded, how far it is from the goal, and the file that holds it, if not the target does."""

    report: EncodeReport
    distance: float
    file: IO[bytes] | None


def _to_size(passes: _Passes) -> EncodeReport:
    """Encode to a bit rate or a size."""
    asked = passes.asked
    settings = passes.base.with_(splats=_splats(_first_octave(passes)))
    with TemporaryFile() as thrown_away:
        report = passes.tried(passes.frames(), thrown_away, settings, "first pass")
    goal = _goal_bits(asked, report)
    fixed = 8.0 * report.file_bytes - sum(_bits(frame) for frame in report.frames)
    curves = _with_slopes(passes, _curves(report.frames, log2(settings.splats or 1)), goal - fixed)
    best: _Stream | None = None
    file: IO[bytes]
    bound = False
    with _temporary_files() as new_file:
        for attempt in range(MOST_PASSES):
            octaves = equal_slope(curves, max(goal - fixed, 0.0), passes.low, passes.high)
            plans = _plans(curves, octaves)
            most = max(plan.splats for plan in plans.values())
            most = min(2 * most, passes.most)
            settings = passes.base.with_(splats=most)
            led_by = partial(BudgetCoder, plans=plans, most=most)
            if attempt == 0 and is_file(passes.target):
                made = passes.run(passes.frames(), passes.target, settings, "second pass", led_by)
                stream = _Stream(made, abs(8 * made.file_bytes / goal - 1), None)
            else:
                name = "second pass" if attempt == 0 else "correcting the size"
                file = new_file()
                made = passes.tried(passes.frames(), file, settings, name, led_by)
                stream = _Stream(made, abs(8 * made.file_bytes / goal - 1), file)
            best = stream if best is None or stream.distance < best.distance else best
            bound = all(at in (passes.low, passes.high) for at in octaves)
            if made.interrupted or best.distance <= TOLERANCE or bound:
                break
            fixed = 8.0 * made.file_bytes - sum(_bits(frame) for frame in made.frames)
            curves = _corrected(curves, octaves, made.frames)
        assert best is not None
        if best.file is not None:
            passes.put(best.file)
    return replace(best.report, notes=[*best.report.notes, *_size_notes(passes, best.report, goal, fixed, bound)])


def _goal_bits(asked: Settings, report: EncodeReport) -> float:
    """The bits of the whole stream."""
    if asked.size is not None:
        return 8.0 * asked.size
    assert asked.bitrate is not None
    return float(asked.bitrate * len(report.frames) / report.header.frame_rate)


def _first_octave(passes: _Passes) -> float:
    """log2 of the number of splats of the first pass."""
    asked, video = passes.asked, passes.format
    start, stop = asked.frames
    ends = [end for end in (video.frame_count, stop) if end is not None]
    frames = max(1, min(ends) - start) if ends else GUESSED_FRAMES
    bits = 8.0 * asked.size if asked.size is not None else float((asked.bitrate or 1.0) * frames / video.frame_rate)
    keys = asked.key_frames
    groups = -(-frames // keys) if isinstance(keys, int) else len({0, *keys}) if isinstance(keys, tuple) else 1
    splats = bits / (SPLAT_BITS * groups + LATER_BITS * max(0, frames - groups))
    return min(max(float(log2(max(splats, 1.0))) - FIRST_LOWER, passes.low + 2), passes.high)


def _splats(octave: float) -> int:
    return max(1, round(float(power(2.0, octave))))


def _bits(frame: FrameReport) -> float:
    """The bits of a frame's chunk."""
    return float(sum(frame.bits.values()))


def _cost(number: int, frame: FrameReport) -> FrameCost:
    error = 0.0 if math.isinf(frame.psnr) else float(power(10.0, -frame.psnr / 10))
    return FrameCost(number, frame.type, _bits(frame), error)


def _curves(frames: list[FrameReport], octave: float) -> list[GroupCurve]:
    """A curve for each group of pictures."""
    groups: list[list[FrameCost]] = []
    for number, frame in enumerate(frames):
        if frame.type == "I":
            groups.append([])
        groups[-1].append(_cost(number, frame))
    return [GroupCurve(tuple(group), octave) for group in groups]


def _with_slopes(passes: _Passes, curves: list[GroupCurve], bits: float) -> list[GroupCurve]:
    """The curves with slopes by the first frames of each group, encoded again with about as many splats as it needs."""
    octave = curves[0].octave
    planned = equal_slope(curves, max(bits, 0.0), passes.low, passes.high)
    away = total(planned) / len(planned) - octave
    if abs(away) < LEAST_APART:
        away = LEAST_APART if away >= 0 and octave + LEAST_APART <= passes.high else -LEAST_APART
    other = min(max(octave + away, passes.low), passes.high)
    splats = _splats(other)
    offset = passes.base.frames[0]
    numbers = [frame.number for curve in curves for frame in curve.frames[:SAMPLED]]
    starts, place = [], 0
    for curve in curves:
        starts.append(place)
        place += min(SAMPLED, len(curve.frames))
    settings = passes.base.with_(splats=splats, frames=(0, None), key_frames=tuple(starts))
    chosen = Chosen(passes.frames(), tuple(offset + number for number in numbers))
    with TemporaryFile() as file:
        report = passes.tried(chosen, file, settings, "first frames again")
    costs = [_cost(number, frame) for number, frame in zip(numbers, report.frames, strict=False)]
    bounds = [*starts, len(costs)]
    return [
        curve.with_slopes(costs[begin:end], float(log2(splats)))
        for curve, begin, end in zip(curves, bounds, bounds[1:], strict=False)
    ]


def _plans(curves: list[GroupCurve], octaves: list[float]) -> dict[int, GroupPlan]:
    """The plan of each group by the number of its first frame."""
    plans = {}
    for curve, octave in zip(curves, octaves, strict=True):
        bits = curve.frame_bits(octave)
        plans[curve.frames[0].number] = GroupPlan(_splats(octave), total(bits), tuple(bits))
    return plans


def _corrected(curves: list[GroupCurve], octaves: list[float], frames: list[FrameReport]) -> list[GroupCurve]:
    """The curves through what a pass took."""
    corrected = []
    for curve, octave in zip(curves, octaves, strict=True):
        begin = curve.frames[0].number
        costs = [_cost(begin + place, frame) for place, frame in enumerate(frames[begin : begin + len(curve.frames)])]
        corrected.append(replace(curve, frames=tuple(costs), octave=octave) if costs else curve)
    return corrected


def _size_notes(passes: _Passes, report: EncodeReport, goal: float, fixed: float, bound: bool) -> list[str]:
    """What was asked and what came out, and what binds if these differ; `bound`: no group can do more."""
    bits = 8.0 * report.file_bytes
    asked = passes.asked
    if asked.size is not None:
        sizes = f"asked for {asked.size:,} bytes, got {report.file_bytes:,}"
    else:
        seconds = float(len(report.frames) / report.header.frame_rate)
        sizes = f"asked for {goal / seconds / 1000:,.1f} kbit/s, got {bits / seconds / 1000:,.1f}"
    notes = [f"{sizes} ({100 * (bits / goal - 1):+.1f} %)"]
    if report.interrupted or abs(bits / goal - 1) <= TOLERANCE:
        return notes
    if not bound:
        notes.append(f"{MOST_PASSES} passes after the first came no nearer; another --seed or --key-frames may")
    elif bits > goal:
        notes.append(
            f"it does not get smaller: {fixed / 8:,.0f} bytes are header, index and log (decisions=False, "
            f"--no-decisions, leaves out the log), and {len(report.frames)} frames take the rest with as few splats as "
            "can be; fewer frames or a lower frame rate would help"
        )
    else:
        notes.append(
            f"it does not get larger with at most {passes.most:,} splats a frame, with which the mean PSNR is "
            f"{report.mean_psnr:.2f} dB" + ("; splats (--splats) allows more" if asked.splats is None else "")
        )
    return notes


def _to_quality(passes: _Passes) -> EncodeReport:
    """Encode to a mean PSNR or VMAF with few splats."""
    name = str(passes.asked.goal)
    goal = float(getattr(passes.asked, name))
    default = passes.base.with_(splats=None).splat_count(passes.format.width, passes.format.height)
    slope = QUALITY_SLOPE[name]
    octave = float(log2(default)) + (goal - START[name]) / slope
    tried: dict[int, tuple[float, EncodeReport, IO[bytes]]] = {}
    with _temporary_files() as new_file:
        for attempt in range(MOST_SEARCHES):
            octave = min(max(octave, passes.low), passes.high)
            splats = min(_splats(octave), passes.most)
            if splats in tried:
                break
            file = new_file()
            step = f"{NAMES[name]} {goal:g}, pass {attempt + 1}"
            report = passes.tried(passes.frames(), file, passes.base.with_(splats=splats), step)
            reached = _reached(passes, name, report, file)
            tried[splats] = reached, report, file
            if 0 <= reached - goal <= NEAR[name]:
                break
            octave = _next_octave(tried, goal + NEAR[name] / 2, slope)
        enough = [number for number, (reached, _, _) in tried.items() if reached >= goal]
        best = min(enough) if enough else max(tried, key=lambda number: tried[number][0])
        reached, report, file = tried[best]
        passes.put(file)
    unit = " dB" if name == "mean_psnr" else ""
    notes = [f"asked for a mean {NAMES[name]} of {goal:g}{unit}, got {reached:.2f}{unit} with {best:,} splats a frame"]
    if not enough:
        notes.append(f"more is not reached with at most {passes.most:,} splats a frame; splats (--splats) allows more")
    return replace(report, notes=[*report.notes, *notes])


NAMES: Final = {"mean_psnr": "PSNR", "vmaf": "VMAF"}
"""Measures of quality as people call them."""


def _reached(passes: _Passes, name: str, report: EncodeReport, file: IO[bytes]) -> float:
    """The mean quality of a stream."""
    if name == "mean_psnr":
        return sum(min(frame.psnr, EQUAL_PSNR) for frame in report.frames) / len(report.frames)
    start = passes.base.frames[0]
    numbers = tuple(range(start, start + len(report.frames)))
    file.seek(0)
    with Chosen(passes.frames(), numbers) as reader:
        score = vmaf(reader, decode(file.read()), passes.format.frame_rate, passes.format.peak)
    if score.mean is None:
        raise UsageError(f"a VMAF cannot be held: {score.reason}")
    return score.mean


def _next_octave(tried: dict[int, tuple[float, EncodeReport, IO[bytes]]], goal: float, slope: float) -> float:
    """log2 of the number of splats to be tried next, by the nearest number below the goal and the nearest above it."""
    points = sorted((float(log2(number)), found[0]) for number, found in tried.items())
    below = [point for point in points if point[1] < goal]
    above = [point for point in points if point[1] >= goal]
    if below and above:
        (left, low), (right, high) = below[-1], above[0]
        if right > left and high > low:
            return left + (right - left) * (goal - low) / (high - low)
    at, reached = above[0] if above else below[-1]
    if len(points) > 1:
        (left, low), (right, high) = points[0], points[-1]
        slope = min(max((high - low) / (right - left), slope / 3), slope * 2)
    return at + (goal - reached) / slope


@contextmanager
def _temporary_files() -> Iterator[Callable[[], IO[bytes]]]:
    """What opens temporary files, which are closed and gone behind the block."""
    files: list[IO[bytes]] = []

    def new() -> IO[bytes]:
        files.append(cast("IO[bytes]", TemporaryFile()))  # noqa: SIM115 (closed below)
        return files[-1]

    try:
        yield new
    finally:
        for file in files:
            file.close()
