"""A mean PSNR or VMAF: a clip encoded with one number of splats after another, until one reaches it."""

from dataclasses import replace
from typing import IO, Final

from gsvc_base.errors import UsageError
from gsvc_base.portable import log2
from gsvc_ref.encoder.report import EncodeReport
from gsvc_ref.stream import decode
from gsvc_tools.libvmaf import vmaf
from gsvc_tools.targets.passes import Passes, splats_of, temporary_files
from gsvc_tools.targets.reading_again import Chosen

MEASURES: Final = {"mean_psnr": "PSNR", "vmaf": "VMAF"}
"""The means that a clip is encoded to, as people call them."""

MAX_SEARCHES: Final = 5
"""The most passes over a clip to reach a mean."""

NEAR_MEAN: Final = {"mean_psnr": 0.2, "vmaf": 1.0}
"""The search ends at a mean that exceeds the goal by at most this."""

GAIN_PER_DOUBLING: Final = {"mean_psnr": 3.4, "vmaf": 10.0}
"""First guess of what twice the splats gain."""

DEFAULT_MEAN: Final = {"mean_psnr": 33.0, "vmaf": 80.0}
"""First guess of what the default number of splats reaches."""

EQUAL_PSNR: Final = 100.0
"""The PSNR that stands for that of a frame equal to its source in a mean that is to be reached, in dB."""


def to_mean(passes: Passes) -> EncodeReport:
    """Encode to a mean PSNR or VMAF with few splats."""
    name = str(passes.settings.goal)
    goal = float(getattr(passes.settings, name))
    default = passes.base.with_(splats=None).splat_count(passes.format.width, passes.format.height)
    slope = GAIN_PER_DOUBLING[name]
    octave = float(log2(default)) + (goal - DEFAULT_MEAN[name]) / slope
    attempts: dict[int, tuple[float, EncodeReport, IO[bytes]]] = {}
    with temporary_files() as new_file:
        for attempt in range(MAX_SEARCHES):
            octave = min(max(octave, passes.low), passes.high)
            splats = min(splats_of(octave), passes.most)
            if splats in attempts:
                break
            file = new_file()
            pass_name = f"{MEASURES[name]} {goal:g}, pass {attempt + 1}"
            report = passes.run_to_file(passes.frames(), file, passes.base.with_(splats=splats), pass_name)
            reached = _reached(passes, name, report, file)
            attempts[splats] = reached, report, file
            if 0 <= reached - goal <= NEAR_MEAN[name]:
                break
            octave = _next_octave(attempts, goal + NEAR_MEAN[name] / 2, slope)
        enough = [number for number, (reached, _, _) in attempts.items() if reached >= goal]
        best = min(enough) if enough else max(attempts, key=lambda number: attempts[number][0])
        reached, report, file = attempts[best]
        passes.put(file)
    unit = " dB" if name == "mean_psnr" else ""
    notes = [
        f"asked for a mean {MEASURES[name]} of {goal:g}{unit}, got {reached:.2f}{unit} with {best:,} splats a frame"
    ]
    if not enough:
        notes.append(f"more is not reached with at most {passes.most:,} splats a frame; splats (--splats) allows more")
    return replace(report, notes=[*report.notes, *notes])


def _reached(passes: Passes, name: str, report: EncodeReport, file: IO[bytes]) -> float:
    """The mean of a stream."""
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


def _next_octave(attempts: dict[int, tuple[float, EncodeReport, IO[bytes]]], goal: float, slope: float) -> float:
    """log2 of the number of splats to be tried next, by the nearest number below the goal and the nearest above it."""
    points = sorted((float(log2(number)), found[0]) for number, found in attempts.items())
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
