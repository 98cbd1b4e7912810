"""``python -m gsvc_lab.benchmarks.cluster CLIP``: how long a film takes on 1 to 1000 workers of a cluster, simulated.

The tasks of a clip are made here, one after the other, and measured: seconds, and bytes each way. A film is made of
groups drawn from those, and its tasks are played through: the first free worker gets the next task of the longest group
that has none in work, groups are read ahead of the one to be written next, both as in `gsvc_tools.jobs.side_by_side`,
and all bytes go over the one link of the command.
"""

import argparse
import pickle
import time
from collections import deque
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from heapq import heappop, heappush
from io import BytesIO
from typing import Any, Final

import numpy as np

from gsvc_base.cli.text import duration
from gsvc_base.pages.tables import Table
from gsvc_lab.machine import environment
from gsvc_ref import Settings, encode
from gsvc_tools.jobs.cluster import TASK_S
from gsvc_tools.jobs.side_by_side import GROUPS_AHEAD

WORKERS: Final = (1, 10, 100, 1000)


@dataclass(frozen=True)
class Task:
    """Seconds that a task took, its number of frames, and the bytes that went to the worker and came back."""

    seconds: float
    frames: int
    sent: int
    returned: int


@dataclass(frozen=True)
class Simulated:
    """A film on a number of workers: seconds, those since the first worker had nothing more to do, and bytes."""

    seconds: float
    tail: float
    moved: int


class Measuring(Executor):
    """Makes each call here at once, of what is pickled, and notes what it took by the group of its first frame."""

    segment_s = TASK_S

    def __init__(self) -> None:
        self._tasks: dict[int, list[Task]] = {}  # by the number of the group's first frame

    @property
    def groups(self) -> list[list[Task]]:
        """The tasks of each group, in the order of the clip."""
        return [self._tasks[first] for first in sorted(self._tasks)]

    def submit(self, function: Any, /, *arguments: Any, **options: Any) -> "Future[Any]":
        """Call a function of a coder and frames."""
        sent = pickle.dumps((function, arguments, options))
        function, arguments, options = pickle.loads(sent)
        begin = time.process_time()
        result = function(*arguments, **options)
        seconds = time.process_time() - begin
        returned = pickle.dumps(result)
        _, kind, number = arguments[1][0]
        first = number if kind == "I" else max(known for known in self._tasks if known <= number)
        self._tasks.setdefault(first, []).append(Task(seconds, len(arguments[1]), len(sent), len(returned)))
        future: Future[Any] = Future()
        future.set_result(pickle.loads(returned))
        return future


def measured(clip: str, settings: Settings) -> list[list[Task]]:
    """The tasks of each group of pictures of a clip."""
    executor = Measuring()
    encode(clip, BytesIO(), settings.with_(frames=(0, 3)))  # compiles kernels
    encode(clip, BytesIO(), settings, executor=executor)
    return executor.groups


def simulated(film: list[list[Task]], workers: int, link: float) -> Simulated:
    """Play the tasks of a film through.

    `film`: the tasks of each group, in order. `workers`: workers with one thread each. `link`: bytes per second that
    the command can send, and as many that it can receive.
    """
    ahead = GROUPS_AHEAD * workers + 1
    waiting: list[tuple[int, int, deque[Task]]] = []  # groups of which no task is in work, those with most left first
    ends: list[
        tuple[float, int, deque[Task], int]
    ] = []  # tasks in work, by the time of their end, and then of their return
    unread = deque(enumerate(film))
    now = sender = receiver = 0.0
    idle_since: float | None = None
    free, moved, written = workers, 0, 0
    done: set[int] = set()  # groups that are encoded, and wait for those before them to be written
    while unread or waiting or ends:
        while unread and unread[0][0] - written < ahead:
            number, tasks = unread.popleft()
            heappush(waiting, (-sum(task.frames for task in tasks), number, deque(tasks)))
        while free and waiting:
            _, number, left = heappop(waiting)
            task = left.popleft()
            sender = max(sender, now) + task.sent / link
            heappush(ends, (sender + task.seconds, number, left, task.returned))
            moved += task.sent + task.returned
            free -= 1
        if free and not unread and idle_since is None:
            idle_since = now
        now, number, left, returned = heappop(ends)
        if returned:  # it is encoded, and has to come back
            receiver = max(receiver, now) + returned / link
            heappush(ends, (receiver, number, left, 0))
            continue
        free += 1
        if left:
            heappush(waiting, (-sum(task.frames for task in left), number, left))
        else:
            done.add(number)
            while written in done:
                done.remove(written)
                written += 1
    return Simulated(now, 0.0 if idle_since is None else now - idle_since, moved)


def table(groups: list[list[Task]], count: int, link: float, seed: int) -> Table:
    """A film of so many groups, drawn from those measured, on each number of workers."""
    rng = np.random.default_rng(seed)
    film = [groups[i] for i in rng.integers(len(groups), size=count)]
    work = sum(task.seconds for group in film for task in group)
    rows = []
    for workers in WORKERS:
        found = simulated(film, workers, link)
        rate = 8e-6 * found.moved / found.seconds
        rows.append([
            f"{workers:,}", duration(found.seconds), f"{work / found.seconds:.1f}",
            f"{work / found.seconds / workers:.0%}", duration(found.tail), f"{rate:,.1f}",
        ])  # fmt: skip
    frames = sum(task.frames for group in film for task in group)
    gigabytes = found.moved / 1e9
    text = (
        f"Simulated: {frames:,} frames in {count:,} groups of pictures, {duration(work)} of work, {gigabytes:,.1f} GB "
        f"both ways, over a link of {8e-9 * link:g} Gbit/s."
    )
    return Table(text, ["workers", "time", "speed-up", "of the ideal", "last workers alone", "Mbit/s"], rows)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m gsvc_lab.benchmarks.cluster", description=__doc__)
    parser.add_argument("clip", help="anything that gsvc encode reads")
    parser.add_argument("--preset", choices=("quick", "slow"), default="quick")
    parser.add_argument("--splats", type=int, default=2000, metavar="N")
    parser.add_argument("--key-frames", type=int, default=10, metavar="K", help="I-frames every K frames")
    parser.add_argument("--frames", type=int, metavar="T", help="measure the first T frames; default: all")
    parser.add_argument("--groups", type=int, default=10_000, metavar="G", help="groups of the film (default 10,000)")
    parser.add_argument("--link", type=float, nargs="+", default=[1, 10], metavar="GBIT", help="default: 1 and 10")
    arguments = parser.parse_args()
    settings = getattr(Settings, arguments.preset)(
        splats=arguments.splats, key_frames=arguments.key_frames, frames=(0, arguments.frames), threads=1,
        precision="deterministic",
    )  # fmt: skip
    groups = measured(arguments.clip, settings)
    tasks = [task for group in groups for task in group]
    machine = environment(1)
    print(
        f"Measured on {machine['cpu']}: {len(groups)} groups in {len(tasks)} tasks; a frame takes "
        f"{sum(task.seconds for task in tasks) / sum(task.frames for task in tasks):.2f} s, a group "
        f"{min(sum(task.seconds for task in group) for group in groups):.1f} to "
        f"{max(sum(task.seconds for task in group) for group in groups):.1f} s; a task has "
        f"{np.mean([task.sent for task in tasks]) / 1e6:.2f} MB there and "
        f"{np.mean([task.returned for task in tasks]) / 1e6:.2f} MB back.\n"
    )
    for link in arguments.link:
        print(table(groups, arguments.groups, link * 1e9 / 8, seed=1).markdown(), end="\n\n", flush=True)


if __name__ == "__main__":
    main()
