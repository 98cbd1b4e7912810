"""A cluster of dask.distributed as an executor (extra ``cluster``): workers may die, the scheduler may come back.

The tasks are those of processes on one machine; dask sends them, and gives them to other workers where one dies. What
travels is pickled here, so that the scheduler hands bytes on, and needs neither gsvc_ref nor time for arrays. This is
what `Client.get_executor` does but for one thing: there, a call whose result is on its way as the connection breaks
never ends.
"""

import logging
import pickle
import re
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, InvalidStateError
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from queue import SimpleQueue
from typing import Any, Final, ParamSpec, TypeVar

from gsvc_base.errors import UsageError
from gsvc_tools.jobs.cluster_task import OtherCodeError, call, worker_code
from gsvc_tools.jobs.code_version import code_version

P = ParamSpec("P")
R = TypeVar("R")

CONNECT_S: Final = 10.0
"""Seconds that a scheduler, and its first worker, have to answer at the start."""

RECONNECT_S: Final = 60.0
"""Seconds that a scheduler that is lost has to come back: one that is started again by hand or by a service does."""

ANSWER_S: Final = 5.0
"""Seconds that a scheduler has to answer a question."""

ADDRESS: Final = re.compile(r"(tcp|tls|ws|wss|ucx|ucxx)://[^\s/]+:[0-9]{1,5}")
"""Addresses of schedulers, by the protocols that dask has."""

MISSING: Final = re.compile(r"No module named '[\w.]*'")
"""What a worker says that lacks a module; dask hands on the words, but not always the type of the exception."""

RETRY_S: Final = 0.5
"""Seconds between two looks at a scheduler that is lost."""

RETRIES: Final = 2
"""How often a task is given to a worker again after a fault: another one may have room on its disk."""

TASK_S: Final = 4.0
"""Seconds that a task is meant to take: the coder travels with each, and so much is lost with a worker that dies."""


class ClusterError(ConnectionError):
    """The cluster is gone, or its workers die of a task."""


class Cluster(Executor):
    """An executor of a cluster that is there; `opened_cluster` makes one.

    `segment_s` is how many seconds a task should take.
    """

    segment_s = TASK_S

    def __init__(self, address: str, client: Any) -> None:  # the scheduler's address, and dask's client of it
        self.address, self._client = address, client
        self._again: SimpleQueue[_Call | None] = SimpleQueue()
        self._is_closed = False
        threading.Thread(target=self._call_again, name="gsvc_ref cluster", daemon=True).start()

    @property
    def thread_count(self) -> int:
        """The number of tasks that the workers take at the same time, at least 1."""
        return max(1, sum(_threads_of(self._client).values()))

    def submit(self, function: Callable[P, R], /, *arguments: P.args, **options: P.kwargs) -> Future[R]:
        """Call a function of a module on a worker; its arguments and what it returns or raises are pickled.

        The future raises a ClusterError if the workers that have it die one after the other, or the scheduler is gone.
        """
        request = _Call(pickle.dumps((function, arguments, options)))
        self._give(request)
        return request.future

    def _give(self, request: "_Call", workers: list[str] | None = None) -> None:
        """Give a call to the cluster, or to some of its workers."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # dask would rather have frames on a shared disk
                request.task = self._client.submit(
                    call, code_version(), request.data, workers=workers, retries=RETRIES, pure=False
                )
        except Exception:  # the client is closed
            self._again.put(request)
            return
        request.task.add_done_callback(partial(self._take, request))

    def _take(self, request: "_Call", task: Any) -> None:
        """Take what became of a call, in a thread of dask; it is made again if the fault is not its own."""
        if request.future.done():
            return
        try:
            worker, request.result = pickle.loads(task.result())
        except Exception as error:
            if task.status == "error":
                request.fail(_as_raised_here(error))
            else:  # it was lost with the scheduler, perhaps on its way back
                self._again.put(request)
            return
        if isinstance(getattr(request.result, "fault", None), OSError | MemoryError) and len(request.refused) < RETRIES:
            request.refused.append(worker)
            self._again.put(request)
        else:
            request.finish()

    def _call_again(self) -> None:
        """Make calls again: on the scheduler that comes back, or on a worker that may have more room."""
        while (request := self._again.get()) is not None:
            try:
                workers = self._workers()
            except ClusterError as error:
                request.fail(error)
            else:
                others = workers - set(request.refused)
                self._give(request, sorted(others) if request.refused and others else None)

    def _workers(self) -> set[str]:
        """The addresses of the workers; waits for a scheduler that is lost, with another client if dask gives up."""
        end = time.monotonic() + RECONNECT_S
        while not self._is_closed and time.monotonic() < end:
            with suppress(Exception):  # the connection may break at any moment
                if self._client.status in ("closed", "closing"):
                    self._client = _client(self.address, RETRY_S)
                if self._client.status == "running" and (workers := _threads_of(self._client)):
                    return set(workers)
            time.sleep(RETRY_S)
        raise ClusterError(
            f"the scheduler at {self.address} is gone, or has no workers, and was not back after {RECONNECT_S:g} s; "
            "with --resume the same command goes on from the groups that are done"
        )

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls; those that are in work are dropped."""
        self._is_closed = True
        self._again.put(None)
        with suppress(Exception):
            self._client.close(timeout=2)


class _Call:
    """A call: what is to become of it, its task of dask, what the last worker said, and which had no room for it."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.future: Future[Any] = Future()
        self.future.add_done_callback(self._drop)
        self.task: Any = None
        self.result: Any = None
        self.refused: list[str] = []

    def finish(self) -> None:
        """Return the result."""
        with suppress(InvalidStateError):  # it was cancelled just now
            self.future.set_result(self.result)

    def fail(self, error: Exception) -> None:
        """Raise an exception."""
        with suppress(InvalidStateError):
            self.future.set_exception(error)

    def _drop(self, future: "Future[Any]") -> None:
        """Let go of the task: dask drops one that nobody holds, done or not."""
        self.task = None


def _as_raised_here(error: BaseException) -> Exception:
    """What is raised here for an exception of dask or of a worker."""
    if type(error).__name__ == "KilledWorker":
        worker = getattr(getattr(error, "last_worker", None), "address", "an unknown address")
        return ClusterError(
            f"several workers ended while they had the same frames, the last one at {worker}: they have too little "
            "memory for these, or something kills them"
        )
    if isinstance(error, OtherCodeError):
        return ClusterError(f"{error}; install the same version everywhere, or end that worker")
    return error if isinstance(error, Exception) else ClusterError(str(error))


@contextmanager
def opened_cluster(address: str) -> Iterator[Cluster]:
    """The executor of a cluster, whose workers were asked whether they have this version of gsvc_ref.

    The address is that of the scheduler, such as ``tcp://host:8786``. A UsageError says that the extra ``cluster`` is
    missing, that there is no scheduler, that it has no workers, or that one of them has no gsvc_ref or another version.
    """
    if not ADDRESS.fullmatch(address):
        raise UsageError(f"{address!r} is not the address of a scheduler; give it as tcp://HOST:8786")
    try:
        client = _client(address, CONNECT_S)
    except ImportError as error:
        raise UsageError(f"{error}; --scheduler needs the extra cluster: pip install 'gsvc_ref[cluster]'") from None
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise UsageError(
            f"no scheduler of dask answers at {address} within {CONNECT_S:g} s ({reason}): start one with "
            "`dask scheduler`, and give its address as tcp://HOST:8786"
        ) from None
    with _quiet():
        cluster = None
        try:
            _check_workers(client, address)
            cluster = Cluster(address, client)
            yield cluster
        finally:
            if cluster is not None:
                cluster.shutdown()
            else:
                client.close(timeout=2)


def _client(address: str, timeout_s: float) -> Any:
    """A client of dask that is connected."""
    with _quiet(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return import_module("distributed").Client(address, timeout=timeout_s, set_as_default=False)


def _threads_of(client: Any) -> dict[str, int]:
    """The number of threads of each worker, by its address; raises TimeoutError if the scheduler does not answer."""
    threads: dict[str, int] = client.sync(client.scheduler.ncores, callback_timeout=ANSWER_S)
    return threads


def _check_workers(client: Any, address: str) -> None:
    """Refuse a cluster without workers, and one of whose workers has no gsvc_ref, or another version."""
    end = time.monotonic() + CONNECT_S
    while not _threads_of(client):
        if time.monotonic() > end:
            raise UsageError(f"the scheduler at {address} has no workers; start some with `dask worker {address}`")
        time.sleep(0.1)
    try:
        answers = client.run(worker_code, on_error="return")
    except OSError as error:
        raise UsageError(f"the workers of {address} do not answer: {error}") from None
    check_answers(answers)


def check_answers(answers: dict[str, Any]) -> None:
    """Refuse workers by what they answered to `worker_code`.

    A UsageError says that a worker has no gsvc_ref, or another version.
    """
    for worker, answer in sorted(answers.items()):
        if isinstance(answer, BaseException) and (missing := MISSING.search(str(answer))):
            message = f"the worker at {worker} cannot make a task ({missing[0]})"
            raise UsageError(f"{message}: install this version of gsvc_ref there")
        if isinstance(answer, BaseException):
            raise UsageError(f"the worker at {worker} could not be asked for its version: {answer}")
        if answer != code_version():
            raise UsageError(
                f"the worker at {worker} has gsvc_ref {answer}, and this is {code_version()}: the same bytes need the "
                "same version everywhere"
            )


@contextmanager
def _quiet() -> Iterator[None]:
    """What dask logs about connections is said by us, in a sentence."""
    logger = logging.getLogger("distributed")
    before, logger.disabled = logger.level, False
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(before)
