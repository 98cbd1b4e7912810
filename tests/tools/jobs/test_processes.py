"""The executor of processes: calls, deaths, ends, and starts ahead."""

import multiprocessing
import os
import signal
import sys
import threading
import time

import pytest

from gsvc_tools.jobs.processes import DeadProcessError, Processes

WAIT_S = 120


def pid() -> int:
    return os.getpid()


def is_loaded(name: str) -> bool:
    return name in sys.modules


def pid_after(seconds: float) -> int:
    time.sleep(seconds)
    return os.getpid()


def add(a: int, *, b: int) -> int:
    return a + b


def fail(error: Exception) -> None:
    raise error


def wait(seconds: float) -> None:
    time.sleep(seconds)


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_calls_and_what_they_raise():
    with Processes(1) as processes:
        assert processes.submit(add, 1, b=2).result(WAIT_S) == 3
        assert processes.submit(pid).result(WAIT_S) == processes.submit(pid).result(WAIT_S) != os.getpid()
        with pytest.raises(ZeroDivisionError, match="mine"):
            processes.submit(fail, ZeroDivisionError("mine")).result(WAIT_S)
        with pytest.raises(RuntimeError, match="pickle"):
            processes.submit(threading.Lock).result(WAIT_S)
        assert processes.submit(add, 1, b=3).result(WAIT_S) == 4
        assert processes.submit(signal.getsignal, signal.SIGINT).result(WAIT_S) is signal.SIG_IGN
    assert multiprocessing.active_children() == []
    with pytest.raises(RuntimeError, match="shutdown"):
        processes.submit(pid)


def test_processes_can_be_started_ahead_of_their_calls():
    with Processes(3) as processes:
        processes.start(2)
        processes.start(2)
        started = {child.pid for child in multiprocessing.active_children()}
        assert len(started) == 2
        calls = [processes.submit(pid_after, 0.5) for _ in range(2)]
        assert {call.result(WAIT_S) for call in calls} == started
    assert multiprocessing.active_children() == []
    with Processes(1) as processes:
        processes.start(1)
        processes.kill()
        processes.start(1)
        assert multiprocessing.active_children() == []
    processes.start(1)  # whom nobody would end
    assert multiprocessing.active_children() == []


def test_a_module_is_loaded_before_the_first_call(capfd):
    with Processes(1) as processes:
        assert not processes.submit(is_loaded, "wave").result(WAIT_S)
    with Processes(2, preload="wave") as processes:
        assert processes.submit(is_loaded, "wave").result(WAIT_S)
        assert not processes.submit(is_loaded, "chunk_of_nothing").result(WAIT_S)
    with Processes(1, preload="chunk_of_nothing") as processes:  # its calls tell, if they need it
        assert processes.submit(add, 1, b=2).result(WAIT_S) == 3
    assert capfd.readouterr().err == ""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_process_that_dies_takes_one_call_with_it():
    with Processes(1) as processes:
        first = processes.submit(pid).result(WAIT_S)
        with pytest.raises(DeadProcessError):
            processes.submit(die).result(WAIT_S)
        second = processes.submit(pid).result(WAIT_S)
        assert second != first
        os.kill(second, signal.SIGKILL)
        for child in multiprocessing.active_children():
            child.join(WAIT_S)
        assert processes.submit(pid).result(WAIT_S) != second  # it had no call that would be lost


def test_no_process_is_started_before_a_call():
    with Processes(3):
        assert multiprocessing.active_children() == []


def test_killed_at_work():
    processes = Processes(2)
    calls = [processes.submit(wait, 1000) for _ in range(3)]
    begin = time.monotonic()
    while len(multiprocessing.active_children()) < 2:
        assert time.monotonic() - begin < WAIT_S
        time.sleep(0.02)
    processes.kill()
    assert multiprocessing.active_children() == []
    assert all(call.cancelled() or isinstance(call.exception(), DeadProcessError) for call in calls)
