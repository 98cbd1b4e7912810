"""Forked and spawned processes, and the threading layer that bears no concurrent calls."""

import hashlib
import multiprocessing
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest
from test_threads import JOBS, THREADS, gradients, render

NAMES = ("encode", "render", "gradients", "objective")
"""The jobs that have parallel kernels."""

WORKQUEUE = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from concurrent.futures import ThreadPoolExecutor
import numba
from test_processes import NAMES, digest
with ThreadPoolExecutor({THREADS}) as pool:
    print(*pool.map(digest, [(name, seed) for name in NAMES for seed in range(2)]))
print(numba.threading_layer())
"""


def digest(key: tuple[str, int]) -> str:
    """What a job gives, in short."""
    name, seed = key
    return hashlib.sha256(repr(JOBS[name](seed)).encode()).hexdigest()[:12]


@contextmanager
def forks_allowed() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of a fork while there are threads
        yield


@pytest.mark.exhaustive
def test_with_workqueue_threads_take_turns():
    """It would end the process at a second call at the same time."""
    environment = {**os.environ, "NUMBA_THREADING_LAYER": "workqueue", "NUMBA_NUM_THREADS": "2"}
    run = subprocess.run(
        [sys.executable, "-c", WORKQUEUE], capture_output=True, text=True, timeout=300, env=environment
    )
    assert run.returncode == 0, run.stderr
    digests, layer = run.stdout.splitlines()
    assert layer == "workqueue"
    assert digests.split() == [digest((name, seed)) for name in NAMES for seed in range(2)]


@pytest.mark.exhaustive
@pytest.mark.skipif(not hasattr(os, "fork"), reason="only POSIX can fork")
def test_a_fork_goes_on_with_one_thread():
    """GNU OpenMP would end the child at its first parallel kernel."""
    keys = [(name, seed) for name in NAMES for seed in range(2)]
    expected = [digest(key) for key in keys]  # the parent has its threads now
    context = multiprocessing.get_context("fork")
    with forks_allowed(), ProcessPoolExecutor(2, context) as pool:
        assert list(pool.map(digest, keys)) == expected
    assert [digest(key) for key in keys[:2]] == expected[:2]  # and still has them


def test_spawned_processes():
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        assert pool.submit(digest, ("render", 0)).result() == digest(("render", 0))


def test_the_number_of_threads_of_others_stays():
    import numba

    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        render(0)
        gradients(0)
        assert numba.get_num_threads() == 1
    finally:
        numba.set_num_threads(before)
