"""The growth of the cost of rendering and of training with splats, with pixels, with threads; and memory."""

from collections.abc import Callable
from typing import Final

from gsvc_base.splats import scale_parameters
from gsvc_lab.benchmarks.material import SIZES, Case, cases, trained, trained_path
from gsvc_lab.benchmarks.memory import peaks_of
from gsvc_lab.benchmarks.rendering import FIT_ITERATIONS, ours
from gsvc_lab.benchmarks.results import Goal, Section, Table
from gsvc_lab.benchmarks.timing import Spread, interleaved, ratio

THREAD_GOAL: Final = (1.6, 1.9)
"""Must and aim of one thread's time over that of two."""

MEMORY: Final = """
import sys
import numpy as np
from gsvc_lab.benchmarks.memory import peak_kib
from gsvc_ref.rendering import Objective, Renderer
from gsvc_base.splats import Splats
parameters, width, height = np.load(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
Renderer(1, 1).frame(Splats.empty(), 8)
peaks = [peak_kib()]
renderer = Renderer(width, height)
for _ in range(3): renderer.frame(Splats.from_array(parameters), 8)
peaks.append(peak_kib())
objective = Objective(np.zeros((height, width, 3), np.float32))
for _ in range(3): objective.evaluate(parameters)
print(*peaks, peak_kib())
"""


def scaling(threads: int) -> Section:
    """All four tables."""
    section = Section("How cost grows")
    _with_splats(section, threads)
    _with_pixels(section, threads)
    _with_threads(section, threads)
    _memory(section)
    return section


def _with_splats(section: Section, threads: int) -> None:
    rows = []
    for width, height in SIZES:
        of_size = list(cases(width, height))
        calls = [ours(case, threads) for case in of_size]
        frame = interleaved({c.name: f["frame"] for c, f in zip(of_size, calls, strict=True)}, seconds=2)
        step = interleaved({c.name: f["iteration"] for c, f in zip(of_size, calls, strict=True)}, seconds=5)
        for case in of_size:
            cells = [Spread.of(times[case.name]).text(2, unit) for times, unit in _units(frame, step)]
            growth = [f"{ratio(times, case.name, of_size[0].name).median:.2f}" for times in (frame, step)]
            rows.append([case.name, f"{case.covering():.1f}", *cells, *growth])
    text = "With the number of splats: ms, and as multiples of the first row of that size."
    header = ["population", "splats a pixel", "frame", "iteration", "frame, x", "iteration, x"]
    section.tables.append(Table(text, header, rows))


def _with_pixels(section: Section, threads: int) -> None:
    """The same splats on frames of other sizes: positions and Cholesky factors scale with the frame."""
    rows = []
    base = trained(1920, 1080, 10_000)
    scaled = {}
    for denominator in (4, 2, 1):
        width, height = base.width // denominator, base.height // denominator
        splats = scale_parameters(base.splats, denominator, denominator, 1, 1)
        target = base.target[::denominator, ::denominator][:height, :width].copy()
        scaled[f"{width}x{height}"] = Case("scaled", width, height, splats, target)
    calls = {name: ours(case, threads) for name, case in scaled.items()}
    frame = interleaved({name: call["frame"] for name, call in calls.items()}, seconds=2)
    step = interleaved({name: call["iteration"] for name, call in calls.items()}, seconds=3)
    for name, case in scaled.items():
        pixels = case.width * case.height
        cells = [Spread.of(times[name]).text(2, unit) for times, unit in _units(frame, step)]
        each = [f"{1e9 * unit / 1000 * Spread.of(t[name]).median / pixels:.2f}" for t, unit in _units(frame, step)]
        rows.append([name, *cells, *each])
    text = "With the number of pixels, N = 10,000 splats that scale with the frame: ms, and ns a pixel."
    section.tables.append(Table(text, ["frame size", "frame", "iteration", "frame, ns", "iteration, ns"], rows))


def _with_threads(section: Section, threads: int) -> None:
    rows = []
    for case in (trained(1920, 1080, 10_000), trained(1920, 1080, 50_000), trained(352, 288, 2000)):
        one, two = ours(case, 1), ours(case, 2)
        for work in ("frame", "gradients", "iteration"):
            calls: dict[str, Callable[[], object]] = {"one": one[work], "two": two[work]}
            times = interleaved(calls, seconds=1.5)
            gain = ratio(times, "one", "two")
            share = 1000 / (FIT_ITERATIONS if work == "iteration" else 1)
            cells = [Spread.of(times[name]).text(2, share) for name in calls]
            rows.append([case.name, work, *cells, gain.text()])
            section.numbers.append({"case": case.name, "work": work, "seconds": times})
            if threads < 2:
                goal = Goal(f"threads, {work}, {case.name}", "T1/T2", *THREAD_GOAL, None, True, "needs two cores")
            else:
                goal = Goal(f"threads, {work}, {case.name}", "T1/T2", *THREAD_GOAL, gain.median, True)
            section.goals.append(goal)
    text = "With threads: ms on one and on two."
    section.tables.append(Table(text, ["population", "work", "one", "two", "T1/T2"], rows))


def _memory(section: Section) -> None:
    rows = []
    for (width, height), counts in SIZES.items():
        for count in counts if width > 1000 else counts[-1:]:
            trained(width, height, count)  # makes the file
            peaks = peaks_of(MEMORY, str(trained_path(width, height, count)), str(width), str(height))
            rows.append([f"{width}x{height}, N = {count:,}", *(f"{peak:.0f}" for peak in peaks)])
            section.numbers.append({"case": f"{width}x{height}, N = {count}", "MiB": peaks})
    text = "Memory of a process of its own: peaks in MiB after its imports, after three frames, after three iterations."
    section.tables.append(Table(text, ["population", "imports", "frames", "iterations"], rows))


def _units(
    frame: dict[str, list[float]], step: dict[str, list[float]]
) -> tuple[tuple[dict[str, list[float]], float], ...]:
    """Times with the factor that makes them milliseconds of one frame and of one iteration."""
    return (frame, 1000), (step, 1000 / FIT_ITERATIONS)
