"""Seconds per I- and P-frame to the PSNR that the paper's schedule ends at: writes the tables of docs/encoding.md.

For each frame size, picture and seed the preset `paper` is fitted to its end (50,000 iterations or convergence); then
`quick` is asked for more and more iterations until its fit ends at that PSNR or above. Both fits are in binary32,
before quantisation. The P-frame is the same picture moved by fractions of a pixel, with other noise; each preset begins
it with its own I-frame. At last `quick` encodes whole frames, with quantisation-aware fine-tuning.

Every case is written to its own file, and what a file has is not measured again, so the script can be interrupted. On
an idle machine `python -m gsvc_lab.benchmarks.encoding` does everything and its seconds are those on the wall. Where
other work runs beside, `--part fits` finds PSNR and iterations, which do not depend on that, and `--part seconds`, in a
quiet moment, measures seconds: of quick's whole fits, and of the paper's as the mean of SAMPLE iterations at each of
the states that the fit went through (CHECKPOINTS), integrated over the iterations. `--part report` prints the tables.
"""

import argparse
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from gsvc_base.arrays import F4
from gsvc_base.files import write_text
from gsvc_base.processors import processors
from gsvc_base.splats import Splats
from gsvc_lab.benchmarks.encoding_tables import report
from gsvc_lab.benchmarks.pictures import PHOTOGRAPHS, SIZES, pictures
from gsvc_ref.encoder.frame import FrameEncoder
from gsvc_ref.encoder.rate import add_where_wrong, make_room
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.paper import FrameType
from gsvc_ref.rendering import Objective
from gsvc_ref.training import (
    KEPT_WEIGHT,
    NEW,
    NEW_WEIGHT,
    AnyFit,
    Population,
    fit,
    image_start,
    psnr_of_loss,
    random_splats,
    uniform_numbers,
)
from gsvc_ref.training.coarse import Sizes
from gsvc_ref.training.motion import estimated_motion

BUDGETS: Final = (10, 20, 30, 40, 60, 80, 100, 125, 150, 200, 300, 500, 1000, 2000)
"""Iterations that quick is asked for, until one reaches the PSNR."""

CHECKPOINTS: Final = (100, 500, 1000, 2000, 4000, 8000, 16_000, 32_000, 50_000)
"""Iterations after which the paper's splats are kept for `--part seconds`."""

CURVE: Final = sorted({round(10 ** (4.7 * k / 40)) for k in range(41)})
"""Iterations at which the PSNR is noted."""

SAMPLE: Final = 20
"""Iterations that are timed at each checkpoint."""


class Run:
    """One fit, noted while it runs.

    Attributes
    ----------
    note
        JSON: iterations, psnr, curve (pairs of iteration and PSNR), and wall and CPU seconds with the start.
    population
        The splats as fitted.
    kept
        CHECKPOINTS that were passed, with the parameters (N, 8) f4.
    """

    def __init__(self, start: Callable[[], Population], objective: Objective, settings: AnyFit, total: int,
                 rng: np.random.Generator, *, sizes: Sizes, keep: bool = False) -> None:  # fmt: skip
        self.kept: dict[int, F4] = {}
        self.curve: list[tuple[int, float]] = []
        self.keep = keep
        wall, cpu = time.perf_counter(), time.process_time()
        self.population = start()
        loss, done = fit(self.population, objective, settings, rng, total=total, sizes=sizes,
                         on_iteration=self._on_iteration)  # fmt: skip
        psnr = psnr_of_loss(loss)
        self.note: dict[str, Any] = {
            "iterations": done,
            "psnr": psnr,
            "curve": [*self.curve, (done, psnr)],
            "wall_seconds": time.perf_counter() - wall,
            "cpu_seconds": time.process_time() - cpu,
        }
        if keep:
            self.kept[done] = self.population.parameters()

    def _on_iteration(self, done: int, iterations: int, loss: float) -> None:
        if done in CURVE:
            self.curve.append((done, psnr_of_loss(loss)))
        if self.keep and done in CHECKPOINTS:
            self.kept[done] = self.population.parameters()


class Case:
    """One picture at one size with one seed: both presets, I- and P-frame."""

    def __init__(self, size: str, name: str, seed: int, threads: int | None) -> None:
        self.width, self.height, self.total = SIZES[size]
        self.seed, self.threads = seed, threads
        self.frames = pictures(size, name)
        self.objectives = [Objective(frame, threads) for frame in self.frames]
        pairs = zip(self.frames, self.objectives, strict=True)
        self.sizes = [Sizes(frame, threads, full=objective) for frame, objective in pairs]
        presets = (Settings.paper, Settings.quick)
        self.paper, self.quick = (preset(profile="paper", splats=self.total) for preset in presets)

    def rng(self, number: int) -> np.random.Generator:
        """The generator of a frame, seeded as `FrameEncoder` does it."""
        return np.random.default_rng([self.seed, number])

    def intra(self, settings: Settings, fit_settings: AnyFit, *, keep: bool = False) -> Run:
        """An I-frame's fit, as `FrameEncoder` makes it."""
        rng = self.rng(0)

        def start() -> Population:
            count = fit_settings.growth.start(self.total) if fit_settings.growth else self.total
            if settings.intra.start == "image":
                splats, weight = image_start(self.frames[0], count, rng), KEPT_WEIGHT
            else:
                splats, weight = random_splats(uniform_numbers(count, rng), self.width, self.height), NEW_WEIGHT
            return Population(splats, weight, np.full(count, NEW, np.int64), fit_settings)

        return Run(start, self.objectives[0], fit_settings, self.total, rng, sizes=self.sizes[0], keep=keep)

    def inter(self, settings: Settings, fit_settings: AnyFit, before: Splats, *, keep: bool = False) -> Run:
        """A P-frame's fit, as `FrameEncoder` makes it, from the splats of the I-frame before quantisation."""
        rng, objective, kind = self.rng(1), self.objectives[1], settings.inter

        def start() -> Population:
            population = Population(before, KEPT_WEIGHT, np.arange(len(before)), fit_settings)
            new = round(kind.new_fraction * self.total)
            if settings.effects.motion == "auto":
                moved = population.parameters()
                moved[:, :2] += estimated_motion(*self.frames, population.values[:, :2])
                if objective.loss(moved) < objective.loss(population.parameters()):
                    population.values[:, :2] = moved[:, :2]
            if kind.new_from_residual:
                everywhere = np.ones((self.height, self.width), np.bool_)
                add_where_wrong(
                    population,
                    objective,
                    make_room(population, objective, new, self.total),
                    rng,
                    everywhere,
                    self.sizes[1],
                )
            else:
                population.augment(uniform_numbers(new, rng), self.width, self.height)
            return population

        return Run(start, objective, fit_settings, self.total, rng, sizes=self.sizes[1], keep=keep)

    def climb(
        self, run: Callable[[AnyFit], Run], settings: AnyFit, goal: float, budgets: Sequence[int] = BUDGETS
    ) -> list[dict[str, Any]]:
        """Quick's fits with more and more iterations, the last of which reaches the goal in dB, if any does."""
        notes = []
        for iterations in budgets:
            note = run(settings.with_(iterations=iterations)).note
            notes.append({key: note[key] for key in ("iterations", "psnr", "wall_seconds", "cpu_seconds")})
            if note["psnr"] >= goal:
                break
        return notes

    def whole(self, goals: dict[str, float]) -> dict[str, Any]:
        """Whole frames with fine-tuning: the first I-frame, which also chooses (b, M, B), another one, a P-frame.

        Where there is a goal in dB for a type, its frames are also made with more and more iterations, and fine-tuning
        in proportion, until one decodes to that PSNR: ``I to the PSNR`` and ``P to the PSNR``.
        """
        settings = replace(self.quick, seed=self.seed, threads=self.threads)
        encoder = FrameEncoder(settings, self.width, self.height, 8)
        notes = {"first I": self.frame(encoder, "I", 0)}
        before = encoder.state, encoder.past
        notes["I"] = self.frame(encoder, "I", 1)
        after = encoder.state, encoder.past
        notes["P"] = self.frame(encoder, "P", 2)
        chosen = encoder.settings
        types: tuple[tuple[FrameType, str, Any], ...] = (("I", "intra", before), ("P", "inter", after))
        for kind, field, (state, past) in types:
            frame_settings = getattr(chosen, field)
            share = frame_settings.tune.iterations / frame_settings.fit.iterations
            for iterations in BUDGETS if kind in goals else ():
                fit_settings = frame_settings.fit.with_(iterations=iterations)
                tune = frame_settings.tune.with_(iterations=max(1, round(share * iterations)))
                encoder.settings = replace(chosen, **{field: replace(frame_settings, fit=fit_settings, tune=tune)})
                encoder.state, encoder.past = state, past
                notes[f"{kind} to the PSNR"] = note = self.frame(encoder, kind, 1 + (kind == "P"))
                if note["psnr"] >= goals[kind]:
                    break
        return notes

    def frame(self, encoder: FrameEncoder, kind: FrameType, number: int) -> dict[str, Any]:
        """One whole frame."""
        begin = time.perf_counter()
        result = encoder.encode(np.rint(self.frames[kind == "P"] * 255).astype(np.uint8), kind, number, lambda *_: None)
        return {
            "psnr": result.psnr,
            "iterations": result.iterations,
            "seconds": time.perf_counter() - begin,
            "stages": result.seconds,
        }


def goals(note: dict[str, Any]) -> dict[str, float]:
    """The PSNR that the paper's fits reached, by frame type."""
    return {kind: note[kind]["paper"]["psnr"] for kind in "IP" if kind in note}


def fits(case: Case, path: Path, frame_types: str, *, whole: bool) -> None:
    """All fits of a case that its file does not have yet."""
    note = load(path)
    for kind, run_paper, run_quick in (("I", paper_intra, quick_intra), ("P", paper_inter, quick_inter)):
        if kind not in frame_types or kind in note:
            continue
        paper = run_paper(case, path)
        keep_splats(path, f"paper {kind}", paper.kept)
        run, settings = run_quick(case)
        note[kind] = {
            "paper": paper.note,
            "quick": run(settings).note,
            "climb": case.climb(run, settings, paper.note["psnr"]),
        }
        write_text(json.dumps(note), path)
        print(path.stem, kind, summary(note[kind]), flush=True)
    if whole and "whole" not in note:
        note["whole"] = case.whole(goals(note))
        note["threads"] = case.threads or processors()
        for kind in frame_types:  # nothing ran beside, so what the fits took is what counts
            part = note[kind]
            part["measured"] = {
                "quick": part["quick"],
                "climb": part["climb"][-1],
                "paper": part["paper"]["wall_seconds"],
            }
        write_text(json.dumps(note), path)


def paper_intra(case: Case, path: Path) -> Run:
    """The paper's I-frame."""
    return case.intra(case.paper, case.paper.intra.fit, keep=True)


def paper_inter(case: Case, path: Path) -> Run:
    """The paper's P-frame, from the end of its I-frame."""
    kept = read_splats(path, "paper I")
    return case.inter(case.paper, case.paper.inter.fit, Splats.from_array(kept[max(kept)]), keep=True)


def quick_intra(case: Case) -> tuple[Callable[[AnyFit], Run], AnyFit]:
    """A function that makes quick's I-frame, and its settings."""
    return lambda settings: case.intra(case.quick, settings), case.quick.intra.fit


def quick_inter(case: Case) -> tuple[Callable[[AnyFit], Run], AnyFit]:
    """A function that makes quick's P-frame, and its settings."""
    before = case.intra(case.quick, case.quick.intra.fit).population.splats()
    return lambda settings: case.inter(case.quick, settings, before), case.quick.inter.fit


def seconds(case: Case, path: Path, frame_types: str) -> None:
    """Measure now: quick's whole fits, the paper's iterations at its checkpoints, and whole frames."""
    note = load(path)
    for kind, run_quick in (("I", quick_intra), ("P", quick_inter)):
        if kind not in note or kind not in frame_types:
            continue
        part = note[kind]
        run, settings = run_quick(case)
        run(settings.with_(iterations=2))  # so that no compiler is timed
        paper_settings = getattr(case.paper, {"I": "intra", "P": "inter"}[kind]).fit
        rates = {
            iteration: iteration_seconds(case.objectives[kind == "P"], parameters, paper_settings)
            for iteration, parameters in read_splats(path, f"paper {kind}").items()
        }
        reached = part["climb"][-1]["iterations"]  # fewer than it was asked for, if it ended by itself
        part["measured"] = {
            "quick": run(settings).note,
            "climb": case.climb(run, settings, part["paper"]["psnr"], [count for count in BUDGETS if count >= reached])[
                -1
            ],
            "paper": integrated(rates, part["paper"]["iterations"]),
        }
    note["whole"] = case.whole(goals(note))
    note["threads"] = case.threads or processors()
    write_text(json.dumps(note), path)
    print(path.stem, *(f"{kind}: {clock(note[kind])}" for kind in frame_types if kind in note), flush=True)


def iteration_seconds(objective: Objective, parameters: F4, settings: AnyFit) -> float:
    """Seconds of an iteration with these splats: SAMPLE of them after two others."""
    sample = replace(settings, iterations=SAMPLE, pruning=replace(settings.pruning, fraction=0.0)
                     if settings.pruning else None)  # fmt: skip
    splats = Splats.from_array(parameters)
    for iterations in (2, SAMPLE):
        population = Population(splats, KEPT_WEIGHT, np.full(len(splats), NEW, np.int64), sample)
        begin = time.perf_counter()
        fit(population, objective, replace(sample, iterations=iterations), np.random.default_rng(0))
        taken = (time.perf_counter() - begin) / iterations
    return taken


def integrated(rates: dict[int, float], iterations: int) -> float:
    """Seconds of all iterations, with the rates at the checkpoints joined by lines."""
    times = np.arange(1, iterations + 1)
    return float(np.interp(times, list(rates), list(rates.values())).sum())


def cases(folder: Path) -> dict[str, dict[str, Any]]:
    """All cases that a folder holds, by name."""
    return {path.stem: load(path) for path in sorted(folder.glob("*.json"))}


def load(path: Path) -> dict[str, Any]:
    """A case's file, or nothing yet."""
    return json.loads(path.read_text()) if path.exists() else {}


def keep_splats(path: Path, label: str, kept: dict[int, F4]) -> None:
    """Keep checkpoints beside the case's file."""
    numbered: dict[str, Any] = {str(iteration): splats for iteration, splats in kept.items()}
    np.savez(path.with_name(f"{path.stem} {label}.npz"), **numbered)


def read_splats(path: Path, label: str) -> dict[int, F4]:
    """The checkpoints, by iteration."""
    with np.load(path.with_name(f"{path.stem} {label}.npz")) as file:
        return {int(k): file[k] for k in file}


def summary(part: dict[str, Any]) -> str:
    """A frame type of a case on one line."""
    paper, quick, last = part["paper"], part["quick"], part["climb"][-1]
    return (
        f"paper {paper['psnr']:.2f} dB in {paper['iterations']} iterations, {paper['cpu_seconds']:.0f} s; quick "
        f"{quick['psnr']:.2f} dB in {quick['iterations']}, {last['psnr']:.2f} dB in {last['iterations']}"
    )


def clock(part: dict[str, Any]) -> str:
    """The measured seconds of a frame type of a case."""
    found = part["measured"]
    return (
        f"paper {found['paper']:.1f} s, quick {found['quick']['wall_seconds']:.3f} s, "
        f"to the PSNR {found['climb']['wall_seconds']:.3f} s in {found['climb']['iterations']}"
    )


def main() -> None:
    """Run the cases that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="+", choices=tuple(SIZES), default=tuple(SIZES))
    parser.add_argument("--images", nargs="+", choices=PHOTOGRAPHS, default=PHOTOGRAPHS)
    parser.add_argument("--seeds", nargs="+", type=int, default=(0, 1, 2))
    parser.add_argument("--frames", choices=("I", "IP"), default="IP")
    parser.add_argument("--threads", type=int, help="threads of the kernels (default: one per CPU)")
    parser.add_argument("--part", choices=("all", "fits", "seconds", "report"), default="all")
    parser.add_argument("--folder", type=Path, default=Path(__file__).parent / "cache" / "encoding")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    if arguments.part == "report":
        report(cases(arguments.folder))
        return
    for size in arguments.sizes:
        for seed in arguments.seeds:
            for name in arguments.images:
                path = arguments.folder / f"{size}-{name}-{seed}.json"
                case = Case(size, name, seed, arguments.threads)
                if arguments.part == "seconds":
                    seconds(case, path, arguments.frames)
                else:
                    fits(case, path, arguments.frames, whole=arguments.part == "all")
    if arguments.part == "all":
        report(cases(arguments.folder))


if __name__ == "__main__":
    main()
