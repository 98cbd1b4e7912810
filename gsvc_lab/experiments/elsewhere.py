"""Experiments in processes, or on the workers of a cluster: each is a task, whose files and words come back."""

import argparse
import io
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from gsvc_base.files import complete_file
from gsvc_tools.jobs.cluster import opened_cluster
from gsvc_tools.jobs.processes import Processes

Make = Callable[[str, argparse.Namespace], bool]


class Made(NamedTuple):
    """What became of an experiment: whether it could be made, what it said, and the contents of its files by name."""

    is_made: bool
    said: str
    files: dict[str, bytes]


def make_here(make: Make, name: str, arguments: argparse.Namespace) -> Made:
    """Make an experiment in a folder that goes again; this is what a worker is asked to do."""
    said = io.StringIO()
    with TemporaryDirectory() as folder, redirect_stdout(said), redirect_stderr(said):
        is_made = make(name, argparse.Namespace(**{**vars(arguments), "output": Path(folder)}))
        files = {path.name: path.read_bytes() for path in Path(folder).iterdir() if path.is_file()}
    return Made(is_made, said.getvalue().replace(folder, str(arguments.output)), files)


def make_elsewhere(
    make: Make, names: Sequence[str], arguments: argparse.Namespace, jobs: int, scheduler: str | None
) -> list[str]:
    """Make experiments at the same time, and keep each as it comes; returns the names of those that were not made.

    A UsageError says that there is no such scheduler, or one of its workers cannot be used. A ClusterError or
    BrokenExecutor says that the scheduler went away, or a process or its workers died of an experiment; those
    before are kept.
    """
    failed = []
    with opened_cluster(scheduler) if scheduler is not None else Processes(jobs) as executor:
        tasks = {executor.submit(make_here, make, name, arguments): name for name in names}
        for task in as_completed(tasks):
            made = task.result()
            print(made.said, end="", flush=True)
            for name, contents in made.files.items():
                with complete_file(arguments.output / name) as file:
                    file.write(contents)
            if not made.is_made:
                failed.append(tasks[task])
    return failed
