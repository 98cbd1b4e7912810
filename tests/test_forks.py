"""Forked and spawned processes, and the threading layer that bears no concurrent calls."""

import hashlib
import multiprocessing
import os
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager

import pytest
from test_threads import JOBS

NAMES = ("encode", "render", "gradients", "objective")
"""The jobs whose tasks are shared among threads."""


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
@pytest.mark.skipif(not hasattr(os, "fork"), reason="only POSIX can fork")
def test_a_fork_has_threads_of_its_own():
    """A fork does not copy those of the parent."""
    keys = [(name, seed) for name in NAMES for seed in range(2)]
    expected = [digest(key) for key in keys]  # the parent has its threads now
    context = multiprocessing.get_context("fork")
    with forks_allowed(), ProcessPoolExecutor(2, context) as pool:
        assert list(pool.map(digest, keys)) == expected
    assert [digest(key) for key in keys[:2]] == expected[:2]  # and still has them


def test_spawned_processes():
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        assert pool.submit(digest, ("render", 0)).result() == digest(("render", 0))
