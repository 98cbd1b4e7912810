"""Tasks on threads: each is run once, by several threads where there are some, and none outlives its job."""

import subprocess
import sys
import threading
import time

import pytest

from gsvc_ref._compiler import numba
from gsvc_ref.rendering.fast import threads
from gsvc_ref.rendering.fast.threads import run_tasks

SEVERAL = pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="there is one processor")


@pytest.mark.parametrize("tasks", [1, 2, 3, 40])
def test_each_task_is_run_once(tasks):
    done = []
    run_tasks(done.append, tasks)
    assert sorted(done) == list(range(tasks))


def test_one_task_is_run_by_the_caller():
    seen = []
    run_tasks(lambda _: seen.append(threading.current_thread()), 1)
    assert seen == [threading.current_thread()]


def test_no_more_threads_than_allowed_have_a_part():
    seen = []

    def task(_: int) -> None:
        time.sleep(0.001)
        seen.append(threading.current_thread())

    run_tasks(task, 20, 2)
    assert (len(seen), len(set(seen)) <= 2) == (20, True)


@SEVERAL
def test_two_tasks_are_run_at_the_same_time():
    barrier = threading.Barrier(2)
    run_tasks(lambda _: barrier.wait(30) and None, 2)


@SEVERAL
@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_a_caller_that_is_interrupted_waits_for_the_others(error):
    caller, others_began, ended = threading.current_thread(), threading.Event(), []

    def task(_: int) -> None:
        if threading.current_thread() is caller:
            others_began.wait(30)
            raise error
        others_began.set()
        time.sleep(0.2)
        ended.append(True)

    with pytest.raises(error):
        run_tasks(task, 2)
    assert ended == [True]


@SEVERAL
def test_what_another_thread_raises_is_raised_by_the_caller():
    caller, raised = threading.current_thread(), threading.Event()

    def task(_: int) -> None:
        if threading.current_thread() is caller:
            raised.wait(30)
            return
        raised.set()
        raise ZeroDivisionError("of the other")

    with pytest.raises(ZeroDivisionError, match="of the other"):
        run_tasks(task, 2)


def test_where_no_thread_can_be_started_the_caller_does_it_all(monkeypatch):
    def none() -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threads, "_workers", none)
    done = []
    run_tasks(done.append, 3)
    assert done == [0, 1, 2]


AT_EXIT = """
import atexit, numpy as np, gsvc_ref
splats = gsvc_ref.Splats.from_array(np.array([[20, 9, 5, 0, 5, 1, 1, 1]], np.float32))
before = gsvc_ref.render(splats, 64, 20, threads=2)
atexit.register(lambda: print((gsvc_ref.render(splats, 64, 20, threads=2) == before).all()))
"""


def test_frames_are_rendered_while_the_process_ends():
    run = subprocess.run([sys.executable, "-c", AT_EXIT], capture_output=True, text=True, timeout=300)
    assert (run.stdout, run.stderr) == ("True\n", "")
