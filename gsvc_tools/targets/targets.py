"""Goals of a whole clip: a bit rate, a size, a mean PSNR, a mean VMAF.

For a bit rate or a size the clip is encoded at least twice. The first pass tells what each frame of each group of
pictures takes with one number of splats, and the first frames of each group, encoded again with another number, how
that changes. `curves.equal_slope` makes a plan of that, and `BudgetCoder` keeps to it in the second pass. Should the
stream miss the goal by more than NEAR_TARGET, as where a group cannot be as small or as large as planned, what it took
corrects the curves, and another pass follows.

For a mean PSNR or VMAF see `means`.
"""

import math
import time
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from tempfile import TemporaryFile
from typing import IO, Final

from gsvc_base.errors import UsageError
from gsvc_base.portable import log2, power, total
from gsvc_ref.encoder.report import EncodeReport, FrameReport, IncompleteEncodeError, OnProgress
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.encoder.setup import frame_count_of
from gsvc_ref.encoder.source_and_target import Source, Target, is_file
from gsvc_ref.video.format import FrameRate
from gsvc_tools.libvmaf import ffmpeg_with_libvmaf
from gsvc_tools.targets.budget import GroupPlan, planned_coder
from gsvc_tools.targets.curves import FrameCost, GroupCurve, equal_slope
from gsvc_tools.targets.means import to_mean
from gsvc_tools.targets.passes import Passes, splats_of, temporary_files
from gsvc_tools.targets.reading_again import Chosen, readable_again

NEAR_TARGET: Final = 0.03
"""A stream that is as near to its goal, in parts of it, is left as it is."""

PASS_REASONS: Final = ("second pass", "correcting the size", "correcting the size again")
"""What the passes after the first one are for; no more follow, near enough or not."""

SPLAT_BITS: Final = 33.0
"""Bits of an I-frame for each splat, and..."""

LATER_BITS: Final = 7.0
"""...those of a P-frame, about, for the first guess of N: of the scenes ``pan`` and ``water``, 128x96, 640 splats."""

FIRST_LOWER: Final = 0.5
"""Octaves of splats by which the first pass stays below the guess, since it is then cheaper."""

SAMPLED: Final = 3
"""The frames of each group that are encoded again with another number of splats."""

MIN_APART: Final = 0.75
"""By how many octaves at least that number differs."""

GUESSED_FRAMES: Final = 25
"""Frames between two I-frames, for the guess alone."""


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

    A UsageError refuses `live`, since the first frame is final only when the whole clip has been encoded once, VMAF
    without a program that has it, and a source that can be read once only and does not fit into a temporary file.
    """
    if live:
        raise UsageError(f"{settings.goal} needs every frame twice, and a live stream is written at once: drop one")
    if settings.vmaf is not None and (why := ffmpeg_with_libvmaf()[1]) is not None:
        raise UsageError(f"a VMAF cannot be held: {why}")
    with readable_again(source, frame_rate) as opened:
        passes = Passes(opened, target, settings, jobs, executor, progress)
        by_size = settings.goal in ("bitrate", "size")
        report = _to_size(passes) if by_size else to_mean(passes)
    seconds = time.perf_counter() - passes.begin
    stages = {**report.seconds_by_stage, "other passes": seconds - report.seconds}
    report = replace(report, settings=settings, seconds=seconds, seconds_by_stage=stages)
    if passes.fault is not None:
        fault = passes.fault
        raise IncompleteEncodeError(fault.kind, fault.message, report, fault.rule, fault.bit) from fault
    return report


@dataclass(frozen=True)
class _Stream:
    """A stream that was encoded, how far it is from the goal, and the file that holds it, if not the target does."""

    report: EncodeReport
    distance: float
    file: IO[bytes] | None


def _to_size(passes: Passes) -> EncodeReport:
    """Encode to a bit rate or a size."""
    asked = passes.settings
    settings = passes.base.with_(splats=splats_of(_first_octave(passes)))
    with TemporaryFile() as scratch:
        report = passes.run_to_file(passes.frames(), scratch, settings, "first pass")
    goal = _goal_bits(asked, report)
    fixed = 8.0 * report.file_bytes - sum(_bits(frame) for frame in report.frames)
    curves = _with_slopes(passes, _curves(report.frames, log2(settings.splats or 1)), goal - fixed)
    best: _Stream | None = None
    file: IO[bytes]
    bound = False
    with temporary_files() as new_file:
        for attempt, pass_name in enumerate(PASS_REASONS):
            octaves = equal_slope(curves, max(goal - fixed, 0.0), passes.low, passes.high)
            plans = _plans(curves, octaves)
            most = max(plan.splats for plan in plans.values())
            most = min(2 * most, passes.most)
            settings = passes.base.with_(splats=most)
            make_coder = partial(planned_coder, plans=plans, most=most)
            if attempt == 0 and is_file(passes.target):
                made = passes.run(passes.frames(), passes.target, settings, pass_name, make_coder)
                stream = _Stream(made, abs(8 * made.file_bytes / goal - 1), None)
            else:
                file = new_file()
                try:
                    made = passes.run_to_file(passes.frames(), file, settings, pass_name, make_coder)
                except KeyboardInterrupt:
                    if best is None:
                        raise
                    best = replace(best, report=replace(best.report, interrupted=True))
                    break
                stream = _Stream(made, abs(8 * made.file_bytes / goal - 1), file)
            best = stream if best is None or stream.distance < best.distance else best
            bound = all(at in (passes.low, passes.high) for at in octaves)
            if made.interrupted or best.distance <= NEAR_TARGET or bound:
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


def _first_octave(passes: Passes) -> float:
    """log2 of the number of splats of the first pass."""
    asked, video = passes.settings, passes.format
    count = frame_count_of(asked, video)
    frames = GUESSED_FRAMES if count is None else max(1, count)
    bits = 8.0 * asked.size if asked.size is not None else float((asked.bitrate or 1.0) * frames / video.frame_rate)
    keys = asked.key_frames
    groups = -(-frames // keys) if isinstance(keys, int) else len({0, *keys}) if isinstance(keys, tuple) else 1
    splats = bits / (SPLAT_BITS * groups + LATER_BITS * max(0, frames - groups))
    return min(max(float(log2(max(splats, 1.0))) - FIRST_LOWER, passes.low + 2), passes.high)


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


def _with_slopes(passes: Passes, curves: list[GroupCurve], bits: float) -> list[GroupCurve]:
    """The curves with slopes by the first frames of each group, encoded again with about the splats that it needs."""
    octave = curves[0].octave
    planned = equal_slope(curves, max(bits, 0.0), passes.low, passes.high)
    away = total(planned) / len(planned) - octave
    if abs(away) < MIN_APART:
        away = MIN_APART if away >= 0 and octave + MIN_APART <= passes.high else -MIN_APART
    other = min(max(octave + away, passes.low), passes.high)
    splats = splats_of(other)
    offset = passes.base.frames[0]
    numbers = [frame.number for curve in curves for frame in curve.frames[:SAMPLED]]
    starts, place = [], 0
    for curve in curves:
        starts.append(place)
        place += min(SAMPLED, len(curve.frames))
    settings = passes.base.with_(splats=splats, frames=(0, None), key_frames=tuple(starts))
    chosen = Chosen(passes.frames(), tuple(offset + number for number in numbers))
    with TemporaryFile() as file:
        report = passes.run_to_file(chosen, file, settings, "first frames again")
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
        plans[curve.frames[0].number] = GroupPlan(splats_of(octave), total(bits), tuple(bits))
    return plans


def _corrected(curves: list[GroupCurve], octaves: list[float], frames: list[FrameReport]) -> list[GroupCurve]:
    """The curves through what a pass took."""
    corrected = []
    for curve, octave in zip(curves, octaves, strict=True):
        begin = curve.frames[0].number
        costs = [_cost(begin + place, frame) for place, frame in enumerate(frames[begin : begin + len(curve.frames)])]
        corrected.append(replace(curve, frames=tuple(costs), octave=octave) if costs else curve)
    return corrected


def _size_notes(passes: Passes, report: EncodeReport, goal: float, fixed: float, bound: bool) -> list[str]:
    """What was asked and what came out, and what binds if these differ; `bound`: no group can do more."""
    bits = 8.0 * report.file_bytes
    asked = passes.settings
    if asked.size is not None:
        sizes = f"asked for {asked.size:,} bytes, got {report.file_bytes:,}"
    else:
        seconds = float(len(report.frames) / report.header.frame_rate)
        sizes = f"asked for {goal / seconds / 1000:,.1f} kbit/s, got {bits / seconds / 1000:,.1f}"
    notes = [f"{sizes} ({100 * (bits / goal - 1):+.1f} %)"]
    if report.interrupted or abs(bits / goal - 1) <= NEAR_TARGET:
        return notes
    if not bound:
        notes.append(f"{len(PASS_REASONS)} passes after the first came no nearer; another --seed or --key-frames may")
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
