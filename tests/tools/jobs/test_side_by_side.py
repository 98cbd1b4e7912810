"""Groups of pictures side by side give the bytes of one after the other, whoever encodes them, whatever happens."""

import io
import multiprocessing
import pickle
import random
import signal
import threading
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from codec_cases import Counting, encoded, fast, flat, paper_fast, paper_quick, video_format, waves

from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.interrupts import INSISTING_S
from gsvc_ref.encoder import IncompleteEncodeError, encode
from gsvc_ref.encoder.main.frame import MainFrameEncoder
from gsvc_ref.encoder.paper import FrameEncoder
from gsvc_ref.stream import StreamWriter, decode
from gsvc_ref.video import open_writer
from gsvc_tools.jobs import groups, side_by_side
from gsvc_tools.jobs.processes import DeadProcessError

SMALL = video_format(24, 16)
CLIP = waves(24, 16, 9, cut=5)
WAIT_S = 120

SETTINGS = {
    "main": fast(key_frames=3),
    "main, one splat, checksums, lanes": fast(key_frames=2, splats=1, checksums=True, lane_count=4),
    "main, psnr": fast(key_frames=4, psnr=24.0),
    "main, quality": fast(key_frames=4, quality=20),
    "main, layers": fast(key_frames=5, layers=(20.0, 24.0)),
    "main, layers of splats": fast(key_frames=(0, 2, 7), layer_splats=(5, 9)),
    "main, key frames found": fast(key_frames="auto"),
    "main, paced": fast(key_frames="auto", paced=True),
    "paper": paper_fast(key_frames=3),
    "paper, quantisers chosen": paper_quick(iterations=3, key_frames=4, threads=1),
    "paper, psnr": paper_fast(key_frames=4, psnr=20.0, seed=3),
    "paper, every effect": paper_fast(key_frames=5, effects="all,dks=off"),
}

LIKE_OTHERS = ("main, one splat, checksums, lanes", "main, layers", "main, paced", "paper")
"""Settings that take the ways that others take as well, or that test_resume.py takes."""

PARAMETERS = [
    pytest.param(settings, id=name, marks=[pytest.mark.exhaustive] if name in LIKE_OTHERS else [])
    for name, settings in SETTINGS.items()
]


class Here(Executor):
    """Makes each call at once."""

    def submit(self, function, /, *arguments, **options):
        future: Future = Future()
        try:
            future.set_result(function(*arguments, **options))
        except Exception as error:
            future.set_exception(error)
        return future


class OddOrder(Executor):
    """Makes calls in a random order, in a thread of its own, as another machine would: by what is pickled."""

    def __init__(self, jobs: int) -> None:
        self.jobs, self.calls, self.rng, self.most = jobs, [], random.Random(5), 0
        self.changed = threading.Condition()
        self.ended = False
        threading.Thread(target=self.work, daemon=True).start()

    def submit(self, function, /, *arguments, **options):
        future: Future = Future()
        with self.changed:
            self.calls.append((future, pickle.dumps((function, arguments, options))))
            self.most = max(self.most, len(self.calls))
            self.changed.notify_all()
        return future

    def work(self) -> None:
        while True:
            with self.changed:
                self.changed.wait_for(lambda: len(self.calls) == self.jobs or self.ended, timeout=0.02)
                if self.ended:
                    return
                if not self.calls:
                    continue
                future, call = self.calls.pop(self.rng.randrange(len(self.calls)))
            function, arguments, options = pickle.loads(call)
            future.set_result(pickle.loads(pickle.dumps(function(*arguments, **options))))

    def shutdown(self, wait=True, *, cancel_futures=False):
        self.ended = True


def without_times(report):
    """A report without what differs from run to run."""
    frames = [
        replace(frame, seconds=0.0, decisions=tuple(replace(one, seconds=0.0) for one in frame.decisions))
        for frame in report.frames
    ]
    return replace(report, seconds=0.0, seconds_by_stage={}, frames=frames)


@pytest.fixture(autouse=True)
def nothing_is_left_behind():
    yield
    assert multiprocessing.active_children() == []
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("gsvc_ref groups")]


@pytest.mark.parametrize("settings", PARAMETERS)
def test_the_same_bytes_and_reports_whoever_encodes(settings):
    report, data = encoded(CLIP, settings)
    assert sum(frame.type == "I" for frame in report.frames) > 1
    with OddOrder(3) as odd, ThreadPoolExecutor(2) as threads:
        for jobs, executor in ((1, Here()), (2, threads), (3, odd)):
            other, same = encoded(CLIP, settings, jobs=jobs, executor=executor)
            assert same == data
            assert without_times(other) == without_times(report)
    assert odd.most > 1 or settings.key_frames == "auto"


@pytest.mark.parametrize(
    "settings",
    [
        fast(key_frames=3),
        pytest.param(paper_quick(iterations=3, key_frames=4, threads=1), marks=pytest.mark.exhaustive),
    ],
)
def test_the_same_bytes_in_processes(settings):
    _, data = encoded(CLIP, settings)
    report, same = encoded(CLIP, settings.with_(threads=None), jobs=2)
    assert same == data
    assert report.settings.threads is None


@pytest.mark.parametrize("run", [1e-9, 1e9])
def test_the_length_of_runs_changes_nothing(monkeypatch, run):
    _, data = encoded(CLIP, fast(key_frames=5, psnr=22.0))
    monkeypatch.setattr(groups, "SEGMENT_S", run)
    lengths = []
    with ThreadPoolExecutor(2) as threads:

        class Noting(Here):
            def submit(self, function, /, *arguments, **options):
                lengths.append(len(arguments[1]))
                return threads.submit(function, *arguments, **options)

        assert encoded(CLIP, fast(key_frames=5, psnr=22.0), jobs=2, executor=Noting())[1] == data
    assert sum(lengths) == len(CLIP)
    assert (max(lengths) == 1) == (run < 1)


@pytest.mark.parametrize("lengths", [[13] * 5, [13] * 3, [4, 4, 4, 12], [30, 1, 1], [5, 1, 9, 2, 2, 7, 7]])
@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_no_group_is_left_over_at_the_end(lengths, jobs):
    all_groups = [SimpleNamespace(left=length) for length in lengths]
    steps, first_done = 0, None
    while any(group.left for group in all_groups):
        at_work = [group for group in side_by_side.in_turn(all_groups, jobs) if group.left][:jobs]
        for group in at_work:
            group.left -= 1
        steps += 1
        first_done = steps if first_done is None and not all_groups[0].left else first_done
    assert steps == max(*lengths, -(-sum(lengths) // jobs))  # no schedule takes fewer
    assert first_done == lengths[0] or len(set(lengths)) > 1  # and yet the first one is done as soon as can be


def test_sources_of_every_kind(tmp_path):
    clip = np.stack(CLIP)
    path, settings = tmp_path / "clip.y4m", fast(key_frames=3, frames=(2, 8))
    with open_writer(path, replace(SMALL, chroma_format="444")) as writer:
        for frame in CLIP:
            writer.write(frame)
    with ThreadPoolExecutor(2) as threads, path.open("rb") as file:
        for source in (lambda: clip, lambda: iter(CLIP), lambda: (CLIP, SMALL), lambda: path, lambda: file):
            one, other = io.BytesIO(), io.BytesIO()
            encode(source(), one, settings)
            file.seek(0)
            report = encode(source(), other, settings, jobs=2, executor=threads)
            file.seek(0)
            assert one.getvalue() == other.getvalue()
            assert len(report.frames) == 6


def test_repeated_frames_and_groups_of_one():
    clip = [*flat(90, 24, 16, 3), *flat((200, 10, 30), 24, 16, 2), *CLIP[:2]]
    for settings in (fast(key_frames=(0, 3, 5)), fast(key_frames=1), fast(key_frames=())):
        with ThreadPoolExecutor(3) as threads:
            assert encoded(clip, settings, jobs=3, executor=threads)[1] == encoded(clip, settings)[1]


@pytest.mark.parametrize("error", [GsvcError("malformed", "cut"), OSError("gone")], ids=repr)
def test_a_fault_of_the_source_keeps_all_frames_before(error):
    file = io.BytesIO()
    with ThreadPoolExecutor(2) as threads, pytest.raises((IncompleteEncodeError, OSError)) as caught:
        encode((Counting(CLIP[:7], error), SMALL), file, fast(key_frames=3), jobs=2, executor=threads)
    assert file.getvalue() == encoded(CLIP[:7], fast(key_frames=3))[1]
    assert "saved: 7 complete frames" in str(caught.value) + "".join(getattr(caught.value, "__notes__", []))


@pytest.mark.parametrize("encoder", [MainFrameEncoder, FrameEncoder])
@pytest.mark.parametrize("error", [UsageError("no"), MemoryError(), ZeroDivisionError("mine")], ids=repr)
def test_a_fault_in_a_task_is_raised_where_its_frame_would_stand(monkeypatch, encoder, error):
    """Also if a later group has it, and before those before it are done."""
    settings = (fast if encoder is MainFrameEncoder else paper_fast)(key_frames=2)
    whole = encoded(CLIP[:5], settings)[1]

    def fail(self, frame, kind, number, progress, original=encoder.encode):
        if number == 5:
            raise error
        return original(self, frame, kind, number, progress)

    monkeypatch.setattr(encoder, "encode", fail)
    with OddOrder(3) as odd:
        for options in ({}, {"jobs": 3, "executor": odd}):
            file = io.BytesIO()
            with pytest.raises((IncompleteEncodeError, type(error))) as caught:
                encode((CLIP, SMALL), file, settings, **options)
            assert file.getvalue() == whole
            assert "saved: 5 complete frames" in str(caught.value) + "".join(getattr(caught.value, "__notes__", []))
    cause = caught.value.__cause__
    cause = cause.__cause__ if isinstance(caught.value, IncompleteEncodeError) else cause
    assert isinstance(cause, groups.RemotePlaceError)
    assert "raise error" in str(cause)


def test_a_fault_at_the_first_frame_is_itself(monkeypatch):
    def fail(*_):
        raise UsageError("no")

    monkeypatch.setattr(MainFrameEncoder, "encode", fail)
    with pytest.raises(UsageError, match="no"):
        encode((CLIP, SMALL), io.BytesIO(), fast(), jobs=2, executor=Here())


def test_an_exception_that_cannot_be_sent_is_told():
    class CannotBeSentError(Exception):  # of its own, for distributed makes all that are there when it is imported go
        def __init__(self, a, b):
            super().__init__("never mind")

    assert str(groups._portable(CannotBeSentError(1, 2))) == "CannotBeSentError: never mind"


def test_a_target_that_fails_is_its_own_error():
    class Full(io.BytesIO):
        def write(self, data) -> int:
            if self.tell() > 300:
                raise OSError(28, "No space left on device")
            return super().write(data)

    with ThreadPoolExecutor(2) as threads, pytest.raises(OSError, match="No space left"):
        encode((CLIP, SMALL), Full(), fast(key_frames=2), jobs=2, executor=threads)


def test_a_frame_beyond_the_level_keeps_the_frames_before(monkeypatch):
    whole = encoded(CLIP[:3], fast(key_frames=2))[1]

    def refuse(self, codes, state=None, layers=None, *, write=StreamWriter.write_frame):
        if self.frame_count == 3:
            raise UsageError("rendering frame 3 takes too many pairs (R-5-4)")
        return write(self, codes, state, layers)

    monkeypatch.setattr(StreamWriter, "write_frame", refuse)
    file = io.BytesIO()
    with ThreadPoolExecutor(2) as threads, pytest.raises(IncompleteEncodeError, match="saved: 3 complete frames"):
        encode((CLIP, SMALL), file, fast(key_frames=2), jobs=2, executor=threads)
    assert file.getvalue() == whole


class Killing(Here):
    """Loses runs so many times, given by the number of their first frame; the others `usually` as often."""

    def __init__(self, usually: int, times: dict[int, int]) -> None:
        self.usually, self.left = usually, times

    def submit(self, function, /, *arguments, **options):
        first = arguments[1][0][2]
        self.left[first] = self.left.get(first, self.usually) - 1
        if self.left[first] >= 0:
            future: Future = Future()
            future.set_exception(DeadProcessError("killed"))
            return future
        return super().submit(function, *arguments, **options)


def test_what_is_lost_with_a_process_is_encoded_again():
    settings = fast(key_frames=3)
    data = encoded(CLIP, settings)[1]
    assert encoded(CLIP, settings, jobs=2, executor=Killing(1, {}))[1] == data


def test_what_is_lost_twice_ends_the_encode_with_the_frames_before(monkeypatch):
    monkeypatch.setattr(groups, "SEGMENT_S", 1e-9)
    settings, file = fast(key_frames=3), io.BytesIO()
    with pytest.raises(side_by_side.DeadWorkerError, match="give a lower number of jobs") as caught:
        encode((CLIP, SMALL), file, settings, executor=Killing(0, {4: 2}))
    assert file.getvalue() == encoded(CLIP[:4], settings)[1]
    assert caught.value.__notes__ == ["gsvc_ref.encode saved: 4 complete frames, as a valid stream"]


def test_an_executor_that_takes_no_more():
    class Broken(Here):
        def submit(self, function, /, *arguments, **options):
            raise BrokenExecutor("broken")

    with ThreadPoolExecutor(1) as closed:
        pass
    for executor, error in ((Broken(), side_by_side.DeadWorkerError), (closed, RuntimeError)):
        with pytest.raises(error):
            encode((CLIP, SMALL), io.BytesIO(), fast(), executor=executor)


@pytest.mark.parametrize("stage", ["detect", "groups"])
def test_an_interrupt_keeps_the_frames_done(monkeypatch, stage):
    clip = waves(24, 16, 60, cut=5)  # so long that it is never done before this thread comes to its interrupt
    is_written, interrupted = threading.Event(), []
    original = StreamWriter.write_frame

    def write(self, *parts):
        written = original(self, *parts)
        is_written.set()
        return written

    def interrupt(progress):
        if progress.stage == stage and progress.frame >= 4 and not interrupted:  # several groups may be done at once
            interrupted.append(progress.frame)
            assert is_written.wait(WAIT_S)  # without a frame there would be nothing to keep
            raise KeyboardInterrupt

    monkeypatch.setattr(StreamWriter, "write_frame", write)
    monkeypatch.setattr(groups, "SEGMENT_S", 1e-9)  # a frame at a time

    file = io.BytesIO()
    settings = fast(key_frames="auto", low_latency=True)
    with ThreadPoolExecutor(2) as threads:
        report = encode((clip, SMALL), file, settings, jobs=2, executor=threads, progress=interrupt)
    assert report.interrupted
    assert 1 <= len(report.frames) < len(clip)
    assert file.getvalue() == encoded(clip[: len(report.frames)], settings)[1]


def test_an_interrupt_before_the_first_frame_leaves_nothing(tmp_path):
    with ThreadPoolExecutor(2) as threads, pytest.raises(KeyboardInterrupt):
        encode((Counting([], KeyboardInterrupt()), SMALL), tmp_path / "a.gsvc", fast(), jobs=2, executor=threads)
    assert list(tmp_path.iterdir()) == []


def test_frames_are_written_while_the_source_waits():
    file = io.BytesIO()

    def slow():
        for number, frame in enumerate(CLIP):
            end = time.monotonic() + WAIT_S
            while number in (4, 6) and len(written) < number:
                assert time.monotonic() < end
                time.sleep(0.01)
            yield frame

    written: list[int] = []
    original = StreamWriter.write_frame

    def write(self, *parts):
        written.append(self.frame_count)
        return original(self, *parts)

    with pytest.MonkeyPatch.context() as patch, ThreadPoolExecutor(2) as threads:
        patch.setattr(StreamWriter, "write_frame", write)
        encode((slow(), SMALL), file, fast(key_frames=3), live=True, jobs=2, executor=threads)
    assert len(list(decode(file.getvalue()))) == len(CLIP)


@pytest.mark.parametrize("key_frames", [(), 2])
def test_frames_that_are_read_ahead_are_bounded(monkeypatch, key_frames):
    """By their bytes in a group without an end, by the number of groups where these are short."""
    most = 5 if key_frames == () else 2 * 3
    monkeypatch.setattr(side_by_side, "BYTES_AHEAD", 5 * CLIP[0].nbytes if key_frames == () else 1 << 28)
    monkeypatch.setattr(side_by_side, "GROUPS_AHEAD", 2)
    source, written, ahead = Counting(waves(24, 16, 24)), [], []
    original = StreamWriter.write_frame

    def write(self, *parts):
        ahead.append(source.taken - len(written))
        written.append(1)
        time.sleep(0.01)
        return original(self, *parts)

    monkeypatch.setattr(StreamWriter, "write_frame", write)
    with ThreadPoolExecutor(1) as threads:
        encode((source, SMALL), io.BytesIO(), fast(key_frames=key_frames), jobs=1, executor=threads)
    assert most // 2 < max(ahead) <= most + 1  # and that which is read and cannot be put yet


def test_progress_counts_the_frames_of_all_groups():
    told = []
    with ThreadPoolExecutor(2) as threads:
        encoded(CLIP, fast(key_frames=3), jobs=2, executor=threads, progress=told.append)
    found = [progress for progress in told if progress.stage == "groups"]
    assert [progress.frame for progress in found] == sorted({progress.frame for progress in found})
    assert found[-1].frame == len(CLIP) - 1
    assert {progress.iterations for progress in found} == {2}


@pytest.mark.parametrize("jobs", [0, -1, 1025, 1.0, True, "2", None])
def test_jobs_that_are_none_are_refused_before_any_work(jobs):
    source = Counting(CLIP)
    with pytest.raises(UsageError, match=r"jobs is .* 1\.\.1024"):
        encode((source, SMALL), io.BytesIO(), fast(), jobs=jobs)
    assert source.taken == 0


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="signals of POSIX")
def test_a_write_that_never_ends_can_be_left():
    """A pipe that nobody reads: the first Ctrl-C ends the encode, and one more than a second after the next its end."""
    main = threading.main_thread().ident
    blocked, go_on, left = threading.Event(), threading.Event(), threading.Event()

    class Pipe(io.BytesIO):
        def write(self, data) -> int:
            if self.tell() > 300:
                blocked.set()
                go_on.wait(WAIT_S)
            return super().write(data)

    def insist():
        blocked.wait(WAIT_S)
        for pause in (0.3, INSISTING_S + 0.3, 0):
            signal.pthread_kill(main, signal.SIGINT)
            time.sleep(pause)
        while not left.wait(INSISTING_S + 4):  # two that come while the process gets no time are one
            signal.pthread_kill(main, signal.SIGINT)

    def slow():
        yield from CLIP
        blocked.wait(WAIT_S)
        time.sleep(WAIT_S)

    file = Pipe()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    thread = threading.Thread(target=insist)
    thread.start()
    try:
        with ThreadPoolExecutor(2) as threads, pytest.raises(KeyboardInterrupt):
            encode((slow(), SMALL), file, fast(key_frames=2), jobs=2, executor=threads)
        length = len(file.getvalue())
    finally:
        left.set()
        thread.join()
        signal.signal(signal.SIGINT, before)
        go_on.set()
    assert 300 < length < 400
    while any(thread.name.startswith("gsvc_ref groups") for thread in threading.enumerate()):
        time.sleep(0.01)
