"""A cluster of dask: the same bytes, workers that die, a scheduler that goes and comes back, what is said of faults."""

import io
import os
import socket
import time
from errno import ENOSPC

import pytest
from codec_cases import encoded, fast, video_format, waves

from gsvc_base.errors import UsageError
from gsvc_ref.encoder import encode
from gsvc_tools.jobs import cluster as clusters
from gsvc_tools.jobs.cluster import Cluster, ClusterError, check_answers, opened_cluster
from gsvc_tools.jobs.cluster_task import OtherCodeError, call
from gsvc_tools.jobs.code_version import code_version
from gsvc_tools.jobs.groups import EncodedSegment, encode_segment

distributed = pytest.importorskip("distributed")

SMALL = video_format(24, 16)
CLIP = waves(24, 16, 9, cut=5)
SETTINGS = fast(key_frames=3, precision="deterministic")
WAIT_S = 120

pytestmark = pytest.mark.filterwarnings("ignore")  # of dask and of what it is made of


@pytest.fixture(scope="module")
def whole() -> bytes:
    return encoded(CLIP, SETTINGS)[1]


@pytest.fixture(scope="module")
def local():
    """A cluster of two processes."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as made:
        yield made


def once(marker: str, action: str, coder, frames):
    """A run, before which the first worker that comes to frame 4 does something bad."""
    if any(number == 4 for _, _, number in frames):
        try:
            os.close(os.open(marker, os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            pass
        else:
            if action == "die":
                os._exit(1)
            fault = OSError(ENOSPC, "No space left on device")
            return EncodedSegment([], coder, fault, action)
    return encode_segment(coder, frames)


class Bad:
    """An executor that has each run made by `once`."""

    segment_s = 1e-9  # a frame a task

    def __init__(self, cluster: Cluster, marker: str, action: str) -> None:
        self.cluster, self.marker, self.action = cluster, marker, action

    def submit(self, function, /, *arguments):
        return self.cluster.submit(once, self.marker, self.action, *arguments)


def open_only(address: str) -> None:
    with opened_cluster(address):
        pass


@pytest.mark.parametrize("action", ["die", pytest.param("full", marks=pytest.mark.exhaustive)])
def test_the_same_bytes_with_a_worker_that_dies_or_has_no_room(local, tmp_path, whole, action):
    marker, file = tmp_path / "done", io.BytesIO()
    with opened_cluster(local.scheduler_address) as cluster:
        assert cluster.thread_count >= 1
        encode((CLIP, SMALL), file, SETTINGS, jobs=2, executor=Bad(cluster, str(marker), action))
    assert file.getvalue() == whole
    assert marker.exists()


def free_port() -> int:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port: int = taken.getsockname()[1]
        return port


def small_cluster(port: int):
    """A cluster in this process, whose scheduler has a port of its own."""
    return distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None, scheduler_port=port,
        host="127.0.0.1", protocol="tcp://",
    )  # fmt: skip


def test_a_scheduler_that_is_started_again_is_connected_to(whole):
    """In the middle of an encode; what its workers had is encoded again."""
    port, file, restarted = free_port(), io.BytesIO(), []
    first = small_cluster(port)

    def progress(now) -> None:
        if now.stage == "groups" and now.frame >= 2 and not restarted:
            first.close()
            restarted.append(small_cluster(port))

    try:
        with opened_cluster(first.scheduler_address) as cluster:
            encode((CLIP, SMALL), file, SETTINGS, jobs=2, executor=cluster, progress=progress)
    finally:
        for one in (first, *restarted):
            one.close()
    assert file.getvalue() == whole
    assert restarted


def test_a_scheduler_that_stays_away_keeps_the_groups_done(monkeypatch, tmp_path, whole):
    monkeypatch.setattr(clusters, "RECONNECT_S", 1.0)
    monkeypatch.setattr(clusters, "ANSWER_S", 1.0)
    file, folder, first = io.BytesIO(), tmp_path / "kept", small_cluster(free_port())

    def frames():
        yield from CLIP[:7]
        end = time.monotonic() + WAIT_S
        while not (folder / "00000000.gsvc").exists():
            assert time.monotonic() < end
            time.sleep(0.02)
        first.close()
        yield from CLIP[7:]

    with opened_cluster(first.scheduler_address) as cluster, pytest.raises(ClusterError) as caught:
        encode((frames(), SMALL), file, SETTINGS, jobs=2, executor=cluster, resume=folder)
    assert "is gone, or has no workers, and was not back after 1 s; with --resume the same command" in str(caught.value)
    file = io.BytesIO()
    report = encode((CLIP, SMALL), file, SETTINGS, resume=folder)
    assert file.getvalue() == whole
    assert "were taken from" in report.notes[0]


def test_a_scheduler_that_is_not_there(monkeypatch):
    monkeypatch.setattr(clusters, "CONNECT_S", 0.5)
    with pytest.raises(UsageError, match=r"no scheduler of dask answers at tcp://127.0.0.1:\d+ within 0.5 s") as caught:
        open_only(f"tcp://127.0.0.1:{free_port()}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("address", ["", "nothing", "ftp://x:1", "tcp://x", "tcp://:", "tcp://x:123456", "tcp://x y:1"])
def test_addresses_that_are_none(address):
    with pytest.raises(UsageError, match="is not the address of a scheduler; give it as tcp://HOST:8786"):
        open_only(address)


def test_a_scheduler_without_workers(monkeypatch):
    with distributed.LocalCluster(
        n_workers=0, processes=False, dashboard_address=None, host="127.0.0.1", protocol="tcp://"
    ) as empty:
        monkeypatch.setattr(clusters, "CONNECT_S", 2.0)
        with pytest.raises(UsageError, match="has no workers; start some with `dask worker tcp://"):
            open_only(empty.scheduler_address)


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (ModuleNotFoundError("No module named 'gsvc_ref'"), "cannot make a task (No module named 'gsvc_ref'): install"),
        (Exception("Error(\"No module named 'numba'\")"), "cannot make a task (No module named 'numba'): install"),
        ("0.1 abc", f"has gsvc_ref 0.1 abc, and this is {code_version()}: the same bytes need the same version"),
        (OSError("gone"), "could not be asked for its version: gone"),
    ],
)
def test_a_worker_that_cannot_be_used_is_named(answer, said):
    check_answers({"tcp://a:1": code_version()})
    with pytest.raises(UsageError) as caught:
        check_answers({"tcp://a:1": code_version(), "tcp://b:2": answer})
    assert str(caught.value).startswith(f"the worker at tcp://b:2 {said}")


def test_a_worker_that_joins_later_is_asked_with_each_task():
    with pytest.raises(OtherCodeError, match=r"a worker has gsvc_ref .*, and its caller 0.1 abc"):
        call("0.1 abc", b"")
    told = clusters._as_raised_here(OtherCodeError("a worker has another"))
    assert isinstance(told, ClusterError)
    assert str(told) == "a worker has another; install the same version everywhere, or end that worker"


def test_workers_that_die_again_and_again_are_told():
    class KilledWorker(Exception):  # noqa: N818  (dask's name)
        last_worker = type("State", (), {"address": "tcp://c:3"})()

    assert str(clusters._as_raised_here(KilledWorker())) == (
        "several workers ended while they had the same frames, the last one at tcp://c:3: they have too little memory "
        "for these, or something kills them"
    )


def test_a_missing_extra_is_named(monkeypatch):
    def missing(name: str):
        raise ModuleNotFoundError(f"No module named '{name}'")

    monkeypatch.setattr(clusters, "import_module", missing)
    with pytest.raises(UsageError, match=r"No module named 'distributed'; --scheduler needs the extra cluster: pip"):
        open_only("tcp://h:1")


def test_a_call_that_nobody_waits_for_takes_nothing():
    asked = clusters._Call(b"")
    asked.task = object()
    asked.future.cancel()
    asked.finish()
    asked.fail(OSError())
    assert asked.future.cancelled()
    assert asked.task is None
