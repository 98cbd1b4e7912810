"""Nothing of a program stays when its vector is over: no process, no endless output, no full disk."""

import os
import shutil
import signal
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from toy_operations import write_program

from gsvc_conformance import process
from gsvc_conformance.implementations import Failure
from gsvc_conformance.process import ProcessImplementation
from gsvc_conformance.supervision import LOG_BYTES, Log, Program

linux = pytest.mark.skipif(sys.platform != "linux", reason="other systems do not tell who lost its parent")

STRAY = """
import os, sys, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        if {hidden}:
            os.execve("/bin/sleep", ["sleep", "600"], {{}})
        time.sleep(600)
    os._exit(0)
os.wait()
"""


def run(words, timeout=60.0, check=lambda: None) -> tuple[int | None, str]:
    log = Log()
    with Program(words, log, {}) as program:
        status = program.wait(timeout, check)
    return status, str(log)


def grandchildren() -> list[int]:
    """The processes that sleep for ten minutes among this one and all below it."""
    found, open_ones = [], [os.getpid()]
    while open_ones:
        for task in Path(f"/proc/{open_ones.pop()}/task").glob("*/children"):
            open_ones += map(int, task.read_text().split())
            found += map(int, task.read_text().split())
    return found


@linux
@pytest.mark.parametrize("hidden", [False, True])
def test_a_process_with_a_session_of_its_own_ends_with_its_vector(tmp_path, hidden):
    if hidden and shutil.which("/bin/sleep") is None:
        pytest.skip("no program to hide in")
    before = set(grandchildren())
    command = write_program(tmp_path, STRAY.format(hidden=hidden))
    assert run(command.split())[0] == 0
    assert set(grandchildren()) <= before


@linux
def test_processes_of_neighbours_are_left_alone(tmp_path):
    """Two programs at the same time: what the first leaves ends, and the second with its stray goes on."""
    note = tmp_path / "pid"
    child = f"import os, pathlib, time; pathlib.Path({str(note)!r}).write_text(str(os.getpid())); time.sleep(600)"
    long = (
        f"import subprocess, sys, time\nsubprocess.Popen([sys.executable, '-c', {child!r}], start_new_session=True)\n"
        "time.sleep(3)\n"
    )
    (tmp_path / "long.py").write_text(long)
    ended = []
    thread = threading.Thread(target=lambda: ended.append(run([sys.executable, str(tmp_path / "long.py")])))
    thread.start()
    while not (note.exists() and note.read_text()):
        time.sleep(0.01)
    stray = int(note.read_text())
    assert run(write_program(tmp_path, STRAY.format(hidden=False)).split())[0] == 0
    os.kill(stray, 0)
    thread.join()
    assert ended == [(0, "")]
    with pytest.raises(ProcessLookupError):
        os.kill(stray, 0)


@linux
def test_a_child_that_the_kit_had_before_is_left_alone():
    child = os.spawnv(os.P_NOWAIT, sys.executable, [sys.executable, "-c", "import time; time.sleep(600)"])
    try:
        assert run([sys.executable, "-c", ""])[0] == 0
        assert os.waitpid(child, os.WNOHANG) == (0, 0)
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def test_a_log_is_the_beginning_and_the_end():
    for size in (0, 1, LOG_BYTES - 1, LOG_BYTES, LOG_BYTES + 1, 3 * LOG_BYTES):
        data = bytes(97 + i % 26 for i in range(size))
        for step in (1, 1000, size + 1):
            log = Log()
            for start in range(0, size, step):
                log.add(data[start : start + step])
            text = str(log)
            if size <= LOG_BYTES:
                assert text == data.decode()
            else:
                first, last = text.split("\n[...]\n")
                assert data.startswith(first.encode())
                assert data.endswith(last.encode())
                assert LOG_BYTES - 100 < len(text) <= LOG_BYTES


def test_output_without_end_takes_no_room(toys, tmp_path, monkeypatch):
    """It goes through a pipe: before, it filled a file of the kit at gigabytes a second."""
    monkeypatch.setattr("tempfile.TemporaryFile", None)
    text = "import os\nwhile True: os.write(1, b'y' * (1 << 20))"
    answer = ProcessImplementation(write_program(tmp_path, text), 1.0).run(toys["halve"], {"values": np.arange(2)})
    assert isinstance(answer, Failure)
    assert (answer.outcome, answer.message) == ("timeout", "no end after 1 s")
    assert set(answer.log) == set("y\n[...]")
    assert LOG_BYTES - 4 <= len(answer.log) <= LOG_BYTES


def test_a_command_that_fills_its_folder_is_ended(toys, tmp_path, monkeypatch):
    monkeypatch.setattr(process, "MAX_OUT", 1 << 20)
    for text in (
        "f = open(sys.argv[3] + '/half.npy', 'wb')\nwhile True: f.write(bytes(1 << 12)); f.flush()",
        "import os\nos.mkdir(sys.argv[3] + '/a')\nfor i in range(10**9): open(f'{sys.argv[3]}/a/{i}', 'w').close()",
    ):
        command = write_program(tmp_path, f"import sys\n{text}")
        answer = ProcessImplementation(command, 60.0).run(toys["halve"], {"values": np.arange(2)})
        assert isinstance(answer, Failure)
        assert answer.message == "it wrote more than 1 MiB to IN_DIR and OUT_DIR, and was ended"
