"""Commands other than encode that are asked to end: 128 + the signal, one line, nothing under the output's name."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable

import pytest

import gsvc_ref
from gsvc_ref.cli import main
from gsvc_ref.video import images, y4m

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")

TIMEOUT_S = 120


@pytest.fixture(autouse=True)
def signals_as_in_a_terminal():
    """`nohup`, a container or a shell's background job may have had this process ignore them."""
    asked = dict.fromkeys((signal.SIGTERM, signal.SIGHUP), signal.SIG_DFL)
    asked[signal.SIGINT] = signal.default_int_handler
    before = {number: signal.signal(number, handler) for number, handler in asked.items()}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def signalling(number: int, call: Callable, after: int = 1) -> Callable:
    """The function, which sends this process a signal before its call number `after`."""
    calls = 0

    def signalled(*arguments, **options):
        nonlocal calls
        calls += 1
        if calls == after:
            signal.raise_signal(number)
        return call(*arguments, **options)

    return signalled


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("name", ["pictures", "there", "out.y4m"])
def test_an_ended_decode_leaves_nothing(stream, tmp_path, monkeypatch, capsys, number, name):
    """Also when a second signal comes while the files of the first frames are removed."""
    there, out = tmp_path / "there", tmp_path / name
    there.mkdir()
    monkeypatch.setattr(images, "encode_png", signalling(number, images.encode_png, after=3))
    monkeypatch.setattr(y4m.Y4mWriter, "_write", signalling(number, y4m.Y4mWriter._write, after=3))
    for writer in (images.ImageFolderWriter, y4m.Y4mWriter):
        monkeypatch.setattr(writer, "_discard", signalling(number, writer._discard))
    assert main(["decode", str(stream), str(out)]) == 128 + number
    assert capsys.readouterr() == ("", "gsvc decode: interrupted; nothing was saved\n")
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]
    assert signal.getsignal(number) is signal.SIG_DFL
    monkeypatch.undo()
    assert main(["decode", str(stream), str(out), "--quiet"]) == 0


def test_a_signal_that_the_parent_ignores_ends_nothing(stream, tmp_path, monkeypatch):
    """`nohup gsvc decode` goes on when its terminal is closed."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    monkeypatch.setattr(y4m.Y4mWriter, "_write", signalling(signal.SIGHUP, y4m.Y4mWriter._write, after=2))
    assert main(["decode", str(stream), str(tmp_path / "out.y4m"), "--quiet"]) == 0
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    assert [path.name for path in tmp_path.iterdir()] == ["out.y4m"]


def test_a_picture_that_has_just_got_its_name_is_removed_too(stream, tmp_path, monkeypatch):
    def written(*arguments, call=images._write_png):
        call(*arguments)
        signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr(images, "_write_png", written)
    assert main(["decode", str(stream), str(tmp_path / "out"), "--quiet"]) == 143
    assert list(tmp_path.iterdir()) == []


def test_a_decode_that_waits_for_its_input(stream, tmp_path):
    """All but the end of a stream on standard input: three frames are written, for the fourth it waits."""
    out = tmp_path / "out"
    with subprocess.Popen(
        [sys.executable, "-m", "gsvc_ref", "decode", "-", str(out), "--quiet"],
        stdin=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdin is not None
        process.stdin.write(stream.read_bytes()[:-100])
        process.stdin.flush()
        end = time.monotonic() + TIMEOUT_S
        while not list(out.glob("*.png")):
            assert process.poll() is None
            assert time.monotonic() < end
            time.sleep(0.05)
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=TIMEOUT_S)
    assert (process.returncode, error) == (143, b"gsvc decode: interrupted; nothing was saved\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["compare", "info"])
def test_other_commands_say_so(stream, clip, monkeypatch, capsys, command):
    monkeypatch.setattr(gsvc_ref, "open", signalling(signal.SIGTERM, gsvc_ref.open))
    assert main([command, str(stream), *([str(clip)] if command == "compare" else [])]) == 143
    assert capsys.readouterr() == ("", f"gsvc {command}: interrupted\n")


def test_ctrl_c_after_an_ended_command_is_ctrl_c_again(stream, monkeypatch):
    """The signal of one command says nothing of the next one in the same process."""
    for number, status in ((signal.SIGTERM, 143), (signal.SIGINT, 130)):
        with monkeypatch.context() as patched:
            patched.setattr(gsvc_ref, "open", signalling(number, gsvc_ref.open))
            assert main(["info", str(stream)]) == status


@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_experiments_end_with_the_code_of_the_signal(tmp_path, monkeypatch, number, status):
    command = pytest.importorskip("gsvc_lab.experiments.command")
    monkeypatch.setattr(command, "check_figures", lambda: None)
    monkeypatch.setattr(command, "make", lambda name, arguments: signal.raise_signal(number))
    assert command.main(["time", "--output", str(tmp_path)]) == status
