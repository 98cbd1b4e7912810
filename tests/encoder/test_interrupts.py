"""Ctrl-C comes through at once but while something is written, and only once."""

import io
import os
import signal
import threading
import time

import pytest
from codec_cases import encoded, fast, video_format, waves

from gsvc_base.files import PartialFile
from gsvc_base.interrupts import Interrupts
from gsvc_ref.encoder import encode
from gsvc_ref.encoder.source_and_target import LiveFile

SMALL = video_format(24, 16)
CLIP = waves(24, 16, 5)

pytestmark = pytest.mark.usefixtures("_ctrl_c_as_usual")


@pytest.fixture
def _ctrl_c_as_usual():
    """Python's own handling of SIGINT, which a shell's background jobs do not have."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_an_interrupt_while_a_frame_is_written_keeps_that_frame():
    """A chunk is written whole: Ctrl-C waits for the few microseconds that this takes."""

    class Interrupting(io.BytesIO):
        writes = 0

        def write(self, data) -> int:
            self.writes += 1
            if self.writes == 5:  # the opening, the header, then frames 0, 1 and 2
                signal.raise_signal(signal.SIGINT)
            return super().write(data)

    file = Interrupting()
    report = encode((CLIP, SMALL), file, fast(index=False))
    assert report.interrupted
    assert len(report.frames) == 3
    assert file.getvalue() == encoded(CLIP[:3], fast(index=False))[1]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_while_llvmlite_frees_memory_waits():
    done: list[str] = []
    names = {"__name__": "llvmlite.binding.ffi", "signal": signal, "done": done}
    exec("def close():\n    signal.raise_signal(signal.SIGINT)\n    done.append('freed')", names)

    def interrupted():
        with Interrupts(patient=False):
            names["close"]()
            done.append("after it")
            time.sleep(60)

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done == ["freed", "after it"]


@pytest.mark.parametrize(("live", "opened", "method"), [(False, PartialFile, "_create"), (True, LiveFile, "__init__")])
def test_an_interrupt_while_the_target_is_opened_leaves_nothing(tmp_path, monkeypatch, live, opened, method):
    open_it = getattr(opened, method)

    def interrupted(*arguments):
        made = open_it(*arguments)
        assert list(tmp_path.iterdir())
        signal.raise_signal(signal.SIGINT)
        return made

    monkeypatch.setattr(opened, method, interrupted)
    with pytest.raises(KeyboardInterrupt):
        encode((CLIP, SMALL), tmp_path / "a.gsvc", fast(), live=live)
    assert list(tmp_path.iterdir()) == []
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_second_interrupt_while_the_stream_is_finished_loses_nothing(tmp_path, monkeypatch):
    def insist(*arguments, call=os.replace):
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        call(*arguments)

    def interrupt(progress):
        if progress.frame == 2:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(os, "replace", insist)
    report = encode((CLIP, SMALL), tmp_path / "a.gsvc", fast(), progress=interrupt)
    assert report.interrupted
    assert (tmp_path / "a.gsvc").read_bytes() == encoded(CLIP[:2], fast())[1]
    assert [path.name for path in tmp_path.iterdir()] == ["a.gsvc"]


def test_an_interrupt_while_the_last_name_is_given_is_told(tmp_path, monkeypatch):
    def interrupt(*arguments, call=os.replace):
        signal.raise_signal(signal.SIGINT)
        call(*arguments)

    monkeypatch.setattr(os, "replace", interrupt)
    report = encode((CLIP[:2], SMALL), tmp_path / "a.gsvc", fast())
    assert report.interrupted
    assert len(report.frames) == 2
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_other_signals_count_where_they_are_handled_like_ctrl_c(name):
    number = getattr(signal, name, None)
    if number is None:
        pytest.skip("this system has no such signal")

    def end(progress):
        if progress.frame == 2:
            signal.raise_signal(number)

    before = signal.signal(number, signal.default_int_handler)
    try:
        report = encode((CLIP, SMALL), io.BytesIO(), fast(), progress=end)
        assert signal.getsignal(number) is signal.default_int_handler
    finally:
        signal.signal(number, before)
    assert report.interrupted
    assert len(report.frames) == 2


def test_handlers_of_others_stay():
    seen = []
    before = signal.signal(signal.SIGINT, lambda *_: seen.append(1))
    try:
        report = encode((CLIP[:2], SMALL), io.BytesIO(), fast(), progress=lambda _: signal.raise_signal(signal.SIGINT))
    finally:
        signal.signal(signal.SIGINT, before)
    assert not report.interrupted
    assert seen


def test_a_handler_that_is_set_meanwhile_stays():
    def mine(number, frame):
        raise AssertionError("never called")

    with Interrupts(patient=True):
        signal.signal(signal.SIGINT, mine)
    assert signal.getsignal(signal.SIGINT) is mine


def test_a_hold_is_let_through_late_and_only_where_a_write_may_never_end(monkeypatch):
    now = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    for patient in (False, True):
        with Interrupts(patient=patient) as interrupts:
            interrupts.held = True
            signal.raise_signal(signal.SIGINT)
            now[0] += 0.5
            signal.raise_signal(signal.SIGINT)
            now[0] += 0.6
            if patient:
                signal.raise_signal(signal.SIGINT)
            else:
                with pytest.raises(KeyboardInterrupt):
                    signal.raise_signal(signal.SIGINT)
            with pytest.raises(KeyboardInterrupt):
                interrupts.release()


def test_only_the_first_gets_through_where_one_is_enough(monkeypatch):
    now = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    with Interrupts(patient=False, once=True):
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        now[0] += 0.5
        signal.raise_signal(signal.SIGINT)
        now[0] += 0.6
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_other_threads_have_no_signals_and_leave_them_alone():
    made = []

    def work():
        made.append(encode((CLIP[:2], SMALL), io.BytesIO(), fast()))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert len(made[0].frames) == 2


def test_an_interrupt_raised_in_another_thread_keeps_the_frames_done():
    """As debuggers and notebooks do it, with PyThreadState_SetAsyncExc."""
    made = []

    def interrupt(progress):
        if progress.frame == 2:
            raise KeyboardInterrupt

    def work():
        made.append(encode((CLIP, SMALL), io.BytesIO(), fast(), progress=interrupt))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert made[0].interrupted
    assert len(made[0].frames) == 2
