"""Frames, gradients and training iterations: against the C++ limit, between precisions, and against peers."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

import numpy as np

from gsvc_lab.benchmarks.material import SIZES, Case, cases, changed, limit_cases, trained
from gsvc_lab.benchmarks.peers import DensePyTorch, Limit, PairListPyTorch, load_torch, numpy_frame
from gsvc_lab.benchmarks.results import Goal, Section, Table
from gsvc_lab.benchmarks.timing import Spread, interleaved, ratio
from gsvc_ref import Splats
from gsvc_ref.rendering import Objective, Renderer
from gsvc_ref.rendering.precision import Precision
from gsvc_ref.training import KEPT_WEIGHT, NEW, FitSettings, Population, Rates, fit

FIT_ITERATIONS: Final = 10
"""Iterations that are timed together; the loss at the end of `fit` adds some 4 % to each."""

WORKS: Final = ("frame", "gradients", "iteration")

LIMIT_GOALS: Final = {"frame": (1.3, 1.15), "gradients": (1.8, 1.4), "iteration": (1.5, 1.3)}
SMALL_LIMIT_GOALS: Final = {"frame": (1.6, 1.3), "gradients": (1.8, 1.4), "iteration": (1.7, 1.4)}
"""Must and aim of `fast` against the C++ limit, for 1920x1080 and 352x288 pixels."""

DETERMINISTIC_GOALS: Final = (1.2, 1.1)
"""Must and aim of `deterministic` against `fast`."""

MEANING: Final = {
    "frame": "8-bit frame, `Renderer.frame`",
    "gradients": "`Renderer.gradients`, which turns the residual into tiles, while the limit finds that done",
    "iteration": "training iteration with Adan, as `fit` makes it, while the limit's has no optimiser",
}


def fitting(case: Case, threads: int) -> Callable[[], object]:
    """FIT_ITERATIONS training iterations of `fit` that hardly move the splats, each time from the same state."""
    rates = Rates(1e-4, 1e-4, 1e-6)
    settings = FitSettings(
        iterations=FIT_ITERATIONS, rates=rates, learn_pixels=True, relative_steps=True, convergence=None, pruning=None
    )
    objective = Objective(case.target, threads)

    def call() -> None:
        origins = np.full(len(case.splats), NEW, np.int64)
        fit(Population(case.splats, KEPT_WEIGHT, origins, settings.optimizer), objective, settings)

    return call


def alternating(case: Case) -> Callable[[], Splats]:
    """The population and one with other colours in turn, so that nothing that was rendered can be used again."""
    pair = [case.splats, changed(case.splats)]

    def take() -> Splats:
        pair.reverse()
        return pair[0]

    return take


def ours(case: Case, threads: int) -> dict[str, Callable[[], object]]:
    """Our contender for each of `WORKS`."""
    renderer, take = Renderer(case.width, case.height, threads=threads), alternating(case)
    residual = case.target - np.float32(0.5)
    return {
        "frame": lambda: renderer.frame(take(), 8),
        "gradients": lambda: renderer.gradients(case.splats, residual),
        "iteration": fitting(case, threads),
    }


def limits(case: Case, stick: Any, threads: int) -> dict[str, Callable[[], object]]:
    """The C++ limit's contender for each of `WORKS`."""
    splats = case.splats.to_array()
    splats[:, :2] -= np.float32(0.5)  # its pixels have their centres at integers
    size = case.width, case.height
    once = stick.prepare_iteration(splats, *size, case.target, threads)
    return {
        "frame": stick.prepare_forward(splats, *size, threads, u8=True),
        "gradients": stick.prepare_gradients(splats, *size, case.target - np.float32(0.5), threads),
        "iteration": lambda: [once() for _ in range(FIT_ITERATIONS)],
    }


def kernels(threads: int, limit: Limit) -> Section:
    """Frame, gradients and iteration for every population, beside the C++ limit."""
    section = Section("Frames, gradients, training iterations")
    rows = []
    ratios: dict[str, dict[str, Spread]] = {work: {} for work in WORKS}
    for case in _populations(limit):
        mine, theirs = ours(case, threads), limits(case, limit.stick, threads) if limit.stick else {}
        for work in WORKS:
            calls = {"ours": mine[work], **({"limit": theirs[work]} if theirs else {})}
            times = interleaved(calls, seconds=1.2)
            share = 1000 / (FIT_ITERATIONS if work == "iteration" else 1)
            cells = [Spread.of(times["ours"]).text(2, share)]
            if theirs:
                ratios[work][case.name] = ratio(times, "ours", "limit")
                cells += [Spread.of(times["limit"]).text(2, share), ratios[work][case.name].text()]
            rows.append([case.name, f"{case.covering():.1f}", work, *cells])
            section.numbers.append({"case": case.name, "work": work, "seconds": times})
    header = ["population", "splats a pixel", "work", "ms", *(["limit, ms", "ratio"] if limit.stick else [])]
    text = "; ".join(f"{work}: {meaning}" for work, meaning in MEANING.items())
    section.tables.append(Table(f"Median (quartiles) of interleaved calls. {text}.", header, rows))
    for work in WORKS:
        section.goals += list(_limit_goals(work, ratios[work], limit.reason))
    return section


def _populations(limit: Limit) -> Iterator[Case]:
    for width, height in SIZES:
        yield from cases(width, height)
    if limit.stick:
        yield from limit_cases(limit.stick)


def _limit_goals(work: str, ratios: dict[str, Spread], reason: str) -> Iterator[Goal]:
    """One goal for each population of 1920x1080, and one for the worst of 352x288."""
    name = f"`fast` {work} against the C++ limit"
    if not ratios:
        yield Goal(name, "times its time", *LIMIT_GOALS[work], None, note=reason)
        return
    large = {case: spread.median for case, spread in ratios.items() if case.startswith("1920x1080")}
    small = max(spread.median for case, spread in ratios.items() if case not in large)
    for case, measured in large.items():
        yield Goal(f"{name}, {case}", "times its time", *LIMIT_GOALS[work], measured)
    yield Goal(f"{name}, 352x288, the worst N", "times its time", *SMALL_LIMIT_GOALS[work], small)


def precisions(threads: int) -> Section:
    """The precisions against each other."""
    section = Section("Precisions")
    rows = []
    for width, height, count in ((1920, 1080, 10_000), (1920, 1080, 50_000), (352, 288, 2000)):
        case = trained(width, height, count)
        contenders: dict[tuple[str, Precision], Callable[[Precision], Callable[[], object]]] = {
            ("frame", "deterministic"): partial(_frame, case, threads),
            ("loss and gradients", "deterministic"): partial(_loss_and_gradients, case, threads),
            ("frame", "exact"): partial(_frame, case, threads),
        }
        for (work, precision), contender in contenders.items():
            times = interleaved(
                {name: contender(name) for name in ("fast", precision)},
                seconds=1.5,
                fewest=2 if precision == "exact" else 5,
            )
            rows.append([case.name, work, precision, *_cells(times, precision, "fast")])
            section.numbers.append({"case": case.name, "work": work, "seconds": times})
            if precision == "deterministic":
                goal = f"`deterministic` {work} against `fast`, {case.name}"
                measured = ratio(times, precision, "fast").median
                section.goals.append(Goal(goal, "times", *DETERMINISTIC_GOALS, measured))
    text = "Each precision beside `fast`, in turn. `exact` is the definition in binary64 in plain NumPy."
    section.tables.append(Table(text, ["population", "work", "precision", "ms", "fast, ms", "ratio"], rows))
    return section


def _frame(case: Case, threads: int, precision: Precision) -> Callable[[], object]:
    renderer, take = Renderer(case.width, case.height, precision=precision, threads=threads), alternating(case)
    return lambda: renderer.frame(take(), 8)


def _loss_and_gradients(case: Case, threads: int, precision: Precision) -> Callable[[], object]:
    return partial(Objective(case.target, threads, precision=precision).evaluate, case.splats.to_array())


def _cells(times: dict[str, list[float]], of: str, to: str) -> list[str]:
    return [
        Spread.of(times[of]).text(2, 1000),
        Spread.of(times[to]).text(2, 1000),
        ratio(times, of, to).text(2),
    ]


def peers(threads: int) -> Section:
    """Programs that a user would write."""
    section = Section("Peers")
    case = trained(352, 288, 2000)
    parameters = case.splats.to_array()
    mine = ours(case, threads)
    rows = []
    times = interleaved(
        {"ours": mine["frame"], "NumPy": lambda: numpy_frame(parameters, case.width, case.height)}, seconds=3
    )
    rows.append(["frame", "plain NumPy, splat by splat", *_cells(times, "NumPy", "ours")])
    section.numbers.append({"case": case.name, "work": "frame", "seconds": times})
    torch = load_torch(threads)
    goals: dict[str, tuple[Any, int]] = {"pair list": (PairListPyTorch, 100), "dense": (DensePyTorch, 1000)}
    for name, (contender, least) in goals.items():
        goal = f"PyTorch autograd, {name}, against our training iteration, {case.name}"
        if torch is None:
            section.goals.append(Goal(goal, "times slower", least, None, None, note="PyTorch is not installed"))
            continue
        peer = contender(torch, case.target)
        times = interleaved({"ours": mine["iteration"], name: partial(peer.iteration, parameters)}, seconds=8)
        times["ours"] = [seconds / FIT_ITERATIONS for seconds in times["ours"]]
        rows.append(["iteration", f"PyTorch autograd, {name}", *_cells(times, name, "ours")])
        section.numbers.append({"case": case.name, "work": "iteration", "seconds": times})
        section.goals.append(Goal(goal, "times slower", least, None, ratio(times, name, "ours").median, True))
    text = f"Population: {case.name}. An iteration of PyTorch is loss and gradients, ours also Adan's step."
    section.tables.append(Table(text, ["work", "peer", "ms", "ours, ms", "times slower"], rows))
    return section
