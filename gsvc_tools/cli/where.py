"""Where an encode is done, and what is left of it if it is ended: ``--jobs``, ``--scheduler`` and ``--resume``."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

from gsvc_base.cli.arguments import whole
from gsvc_base.errors import UsageError
from gsvc_base.interrupts import Interrupts
from gsvc_base.processors import processors
from gsvc_ref.cli.files import STDIO
from gsvc_tools.jobs.processes import MAX_JOBS, Processes, check_jobs


def add_where_options(parser: ArgumentParser) -> None:
    """Add the options."""
    where = parser.add_argument_group("jobs, many machines, long encodes")
    where.add_argument(
        "--jobs", type=whole, metavar="J",
        help="groups of pictures to encode at the same time, each in a process with one thread; the file does not "
        "depend on it. Default 1: a clip without cuts has one group (but --key-frames K makes more), and each "
        "process needs memory",
    )  # fmt: skip
    where.add_argument(
        "--scheduler", metavar="tcp://HOST:8786",
        help="encode groups of pictures on the workers of this scheduler of dask (extra cluster; docs/cluster.md); the "
        "file does not depend on it with --precision deterministic, nor without on one kind of CPU. --jobs is then the "
        "number of groups at the same time, by default one for each thread of the workers",
    )  # fmt: skip
    where.add_argument(
        "--resume", action="store_true",
        help="keep each finished group of pictures in the folder OUT.gsvc.resume, which is removed once the file is "
        "complete. After an encode that ended early, the same command with the same source continues from it",
    )  # fmt: skip
    where.add_argument(
        "--dry-run", action="store_true",
        help="write nothing: encode some frames, and estimate the time, size and PSNR of the whole encode",
    )  # fmt: skip


def resume_folder(arguments: Namespace) -> Path | None:
    """The folder of ``--resume``, or None.

    A UsageError says that the output is not a file, beside which it could stand.
    """
    if not arguments.resume:
        return None
    path = Path(arguments.output)
    if arguments.output == STDIO or (path.exists() and not path.is_file()):
        raise UsageError("--resume keeps finished groups next to the output: the output must be a file")
    return path.with_name(f"{path.name}.resume")


def opened_workers(scheduler: str | None) -> AbstractContextManager[Executor | None]:
    """The workers of a scheduler of dask, as an executor; None without one.

    A UsageError says that there is no such scheduler, or that one of its workers cannot be used.
    """
    if scheduler is None:
        return nullcontext()
    from gsvc_tools.jobs.cluster import opened_cluster

    return opened_cluster(scheduler)


@contextmanager
def started_processes(arguments: Namespace) -> Iterator[Processes | None]:
    """Processes for ``--jobs``, which load the encoder while the caller does; None if this process does all, or others.

    No more of them are started at once than there are processors. Interrupts wait until they are known, or ended.

    A UsageError says that the number of jobs is out of its range.
    """
    jobs = 1 if arguments.jobs is None else arguments.jobs
    if arguments.dry_run or arguments.scheduler is not None or jobs == 1:
        yield None
        return
    check_jobs(jobs)
    processes = Processes(jobs, preload="gsvc_tools.jobs.groups")
    try:
        with Interrupts(patient=True) as interrupts:
            interrupts.held = True
            processes.start(min(jobs, processors()))
            interrupts.release()
        yield processes
    finally:
        _end(processes)


def _end(processes: Processes) -> None:
    """End processes; their work is not wanted."""
    with Interrupts(patient=True) as interrupts:
        interrupts.held = True
        processes.kill()


@contextmanager
def opened_executor(arguments: Namespace, processes: Processes | None) -> Iterator[tuple[int, Executor | None]]:
    """The number of groups of pictures at the same time, and what encodes them; None: this process.

    `processes` are those of `started_processes`, which are ended. A UsageError says that there is no such scheduler, or
    that one of its workers cannot be used.
    """
    jobs = arguments.jobs
    if arguments.scheduler is None:
        try:
            yield 1 if jobs is None else jobs, processes
        finally:
            if processes is not None:
                _end(processes)
        return
    from gsvc_tools.jobs.cluster import opened_cluster

    with opened_cluster(arguments.scheduler) as cluster:
        yield min(cluster.thread_count, MAX_JOBS) if jobs is None else jobs, cluster
