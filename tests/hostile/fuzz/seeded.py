"""Fuzzing by a seed: the same inputs on every machine, and compiled kernels, so many of them."""

import multiprocessing
import os
import signal
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from types import FrameType

from .fuzzing import TARGETS, Target, name_of

LONGEST_SECONDS = 20
"""An execution that takes more CPU time counts as hanging."""

WARMING = 24
"""Inputs that are executed before time is taken."""

PIECE = 500
"""Executions after which a job tells how far it is."""


class HangError(Exception):
    """An execution took too long."""


@dataclass
class Tally:
    """Of executions: how many of each outcome, the longest time in CPU seconds, and the defects with their places."""

    outcomes: Counter[str] = field(default_factory=Counter)
    longest: float = 0.0
    defects: list[tuple[str, str]] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        """Count what another part of a run found."""
        self.outcomes += other.outcomes
        self.longest = max(self.longest, other.longest)
        self.defects += other.defects

    @property
    def runs(self) -> int:
        """Executions."""
        return self.outcomes.total()

    def line(self, target: str, seconds: float) -> str:
        """The tally in a sentence."""
        accepted = sum(count for word, count in self.outcomes.items() if word == "accepted" or word.endswith("frames"))
        rules = {word.split()[0] for word in self.outcomes if word.startswith("R-")}
        return (
            f"{target}: {self.runs} executions in {seconds:.0f} s ({self.runs / seconds:.0f} a second, the longest "
            f"{self.longest:.2f} s), {accepted} with frames or accepted, {self.outcomes['skipped']} skipped as too "
            f"large, {len(rules)} rules broken, {len(self.defects)} defects"
        )


def pool(target: Target) -> list[bytes]:
    """What mutations begin with."""
    return target.seeds() + [path.read_bytes() for path in target.corpus()]


def input_of(target: Target, inputs: list[bytes], seed: int, number: int) -> bytes:
    """Input `number` of a seed."""
    rng = Random(seed << 40 | number)
    return target.mutate(rng.choice(inputs), rng, inputs)


def execute(target: Target, data: bytes) -> str:
    """One execution, with warnings as errors and a limit of time."""

    def hang(_signal: int, _frame: FrameType | None) -> None:
        raise HangError(f"an execution took more than {LONGEST_SECONDS} s")

    before = signal.signal(signal.SIGVTALRM, hang)
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_SECONDS)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return target.run(data)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)


def warm_up(target: Target, inputs: list[bytes]) -> None:
    """Have all kernels compiled, which is no part of an execution's time."""
    for data in inputs[:WARMING]:
        target.run(data)


def run_part(name: str, seed: int, numbers: range, inputs: list[bytes], folder: Path) -> Tally:
    """Executions of some numbers of a seed; inputs that show a defect are written to a folder."""
    target = TARGETS[name]
    tally = Tally()
    for number in numbers:
        data = input_of(target, inputs, seed, number)
        begin = time.process_time()
        try:
            tally.outcomes[execute(target, data)] += 1
        except Exception:
            path = folder / name_of(f"{name}-defect", data)
            path.write_bytes(data)
            tally.outcomes["defect"] += 1
            tally.defects.append((str(path), f"seed {seed}, number {number}\n{traceback.format_exc()}"))
        tally.longest = max(tally.longest, time.process_time() - begin)
    return tally


_inputs: dict[str, list[bytes]] = {}
"""Of a job, by target: made once."""


def _job(task: tuple[str, int, range, Path]) -> Tally:
    name, seed, numbers, folder = task
    if name not in _inputs:
        _inputs[name] = pool(TARGETS[name])
        warm_up(TARGETS[name], _inputs[name])
    return run_part(name, seed, numbers, _inputs[name], folder)


def run(name: str, *, runs: int, seed: int, first: int = 0, jobs: int = 1, folder: Path) -> bool:
    """Run a target and print what came of it: whether there was no defect."""
    begin = time.perf_counter()
    numbers = range(first, first + runs)
    tasks = [(name, seed, numbers[at : at + PIECE], folder) for at in range(0, runs, PIECE)]
    total = Tally()
    with multiprocessing.get_context("spawn").Pool(jobs) if jobs > 1 else _Here() as workers:
        for part in workers.imap_unordered(_job, tasks):
            total.add(part)
            for path, what in part.defects:
                print(f"\nDEFECT: {what}written to {path}; replay: {replay_command(name, path)}\n", flush=True)
            if total.runs % (100 * PIECE) == 0:
                print(total.line(name, time.perf_counter() - begin), flush=True)
    print(total.line(name, time.perf_counter() - begin), flush=True)
    words = ", ".join(f"{word} {count}" for word, count in total.outcomes.most_common())
    print(f"{name}: {words}", flush=True)
    return not total.defects


def replay_command(name: str, path: str | os.PathLike[str]) -> str:
    """How to execute one input again."""
    return f"python -m tests.hostile.fuzz {name} --replay {path}"


class _Here:
    """A pool of no processes."""

    def __enter__(self) -> "_Here":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    imap_unordered = staticmethod(map)
