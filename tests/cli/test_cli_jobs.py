"""``gsvc encode --jobs``: signals, deaths of processes, and that none is left behind."""

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from cli.test_cli_killed import START, TIMEOUT_S, Encoder, encoder

import gsvc_ref
from gsvc_ref.cli import main
from gsvc_tools.jobs.processes import Processes

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes as Linux tells them")

JOBS = ["--jobs", "2"]
SMALL = ["--splats", "12", "--key-frames", "2"]


def parents() -> dict[int, int]:
    """The parent of each process that is no zombie."""
    found = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, parent = path.read_text().rpartition(")")[2].split()[:2]
            if state != "Z":
                found[int(path.parent.name)] = int(parent)
    return found


def descendants(ancestor: int) -> set[int]:
    """The processes that a process has started, and those that these have."""
    tree = parents()
    found, new = set[int](), {ancestor}
    while new:
        new = {process for process, parent in tree.items() if parent in new}
        found |= new
    return found


def wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def workers(running: Encoder) -> set[int]:
    """The processes that encode."""
    return {
        process
        for process in descendants(running.process.pid)
        if b"spawn_main" in Path(f"/proc/{process}/cmdline").read_bytes()
    }


def ended(processes: set[int]) -> None:
    """See to it that all of them end soon."""
    wait_for(lambda: not processes & set(parents()))


def test_the_file_and_the_report_do_not_depend_on_jobs(clip, tmp_path, capsys):
    told = []
    for jobs in ("1", "2"):
        out = tmp_path / "out.gsvc"
        assert (
            main(["encode", str(clip), str(out), "--splats", "12", "--key-frames", "2", "--jobs", jobs, "--json"]) == 0
        )
        report = json.loads(capsys.readouterr().out)
        for part in (report, *report["frames"], *(one for frame in report["frames"] for one in frame["decisions"])):
            part.pop("seconds")
        report.pop("seconds_by_stage")
        told.append((report, out.read_bytes()))
    assert told[0] == told[1]


@pytest.mark.parametrize("step", ["start", pytest.param("kill", marks=pytest.mark.exhaustive)])
def test_an_interrupt_waits_while_processes_are_started_or_ended(monkeypatch, clip, tmp_path, capsys, step):
    original = getattr(Processes, step)
    begun = []

    def interrupted(self, *arguments):
        begun.append(step)
        signal.raise_signal(signal.SIGINT)
        original(self, *arguments)

    monkeypatch.setattr(Processes, step, interrupted)
    out = tmp_path / "out.gsvc"
    code = main(["encode", str(clip), str(out), *SMALL, *JOBS, "--quiet"])
    assert begun
    assert multiprocessing.active_children() == []
    if step == "kill":  # the file was complete
        assert (code, capsys.readouterr().err) == (0, "")
        assert len(list(gsvc_ref.decode(out))) == 4
    else:
        assert code == 130
        assert "nothing was saved" in capsys.readouterr().err
        assert not out.exists()


def test_no_process_is_started_for_what_cannot_be_done(clip, tmp_path, capsys):
    for arguments in (["--jobs", "0"], ["--jobs", "1025"], ["--jobs", "2", "--dry-run"], ["--jobs", "1"]):
        main(["encode", str(clip), str(tmp_path / "out.gsvc"), *SMALL, *arguments, "--quiet"])
        assert multiprocessing.active_children() == []
    assert "must be a whole number in 1..1024" in capsys.readouterr().err
    assert main(["encode", str(tmp_path / "none.y4m"), str(tmp_path / "out.gsvc"), *JOBS]) != 0
    assert main(["encode", str(clip), str(tmp_path / "other.gsvc"), *JOBS, "--psnr", "-5"]) != 0
    assert multiprocessing.active_children() == []


def test_one_group_is_told(clip, tmp_path, capsys):
    command = ["encode", str(clip), str(tmp_path / "out.gsvc"), "--splats", "12", "--key-frames", "9", *JOBS]
    assert main(command) == 0
    assert (
        "note: one group of pictures, so one process was at work; --key-frames K makes more\n"
        in capsys.readouterr().out
    )


def test_jobs_out_of_range(clip, tmp_path, capsys):
    assert main(["encode", str(clip), str(tmp_path / "out.gsvc"), "--jobs", "0", "--quiet"]) == 2
    assert capsys.readouterr().err == "gsvc encode: jobs is 0; it must be a whole number in 1..1024\n"


@pytest.mark.parametrize(
    ("number", "all_of_them"),
    [(signal.SIGINT, True), pytest.param(signal.SIGTERM, False, marks=pytest.mark.exhaustive)],
)
def test_a_signal_that_asks_to_end_keeps_the_frames_done(clip, tmp_path, number, all_of_them):
    """A terminal sends Ctrl-C to the processes that encode as well; they leave it to the command."""
    out = tmp_path / "out.gsvc"
    with encoder(clip, out, "--json", *JOBS) as running:
        running.give(3)
        others = workers(running)
        assert len(others) == 2
        for process in (*others, running.process.pid) if all_of_them else (running.process.pid,):
            os.kill(process, number)
        status, error = running.end()
        ended(others)
    assert status == 128 + number
    assert error == f"gsvc encode: interrupted; {out} is a valid file with the 3 frames done so far\n"
    assert [path.name for path in tmp_path.iterdir()] == ["out.gsvc"]
    assert len(list(gsvc_ref.decode(out))) == 3


def test_killed_with_its_processes_gone(clip, tmp_path):
    out = tmp_path / "out.gsvc"
    with encoder(clip, out, "--quiet", "--live", *JOBS) as running:
        running.give(3)
        others = descendants(running.process.pid)
        assert len(workers(running)) == 2
        running.process.kill()
        assert running.process.wait(TIMEOUT_S) == -signal.SIGKILL
        ended(others)
    assert len(running.complete()) == 3


def test_a_process_that_is_killed_is_replaced(clip, tmp_path):
    out = tmp_path / "out.gsvc"
    with encoder(clip, out, "--quiet", *JOBS) as running:
        running.give(3)
        for process in workers(running):
            os.kill(process, signal.SIGKILL)
        running.give(1)
        others = workers(running)
        assert running.end() == (0, "")
        ended(others)
    plain = tmp_path / "plain.gsvc"
    assert main(["encode", str(clip), str(plain), *SMALL, "--quiet"]) == 0
    assert out.read_bytes() == plain.read_bytes()


DYING = """
import os, sys
from gsvc_ref.encoder.main.frame import MainFrameEncoder

def encode(self, frame, kind, number, progress, original=MainFrameEncoder.encode):
    if number == 3:
        os.kill(os.getpid(), 9)
    return original(self, frame, kind, number, progress)

MainFrameEncoder.encode = encode
if __name__ == "__main__":
    from gsvc_ref.cli import main
    raise SystemExit(main())
"""


@pytest.mark.exhaustive
def test_processes_that_are_killed_again_and_again(clip, tmp_path):
    """As where there is no memory for a frame."""
    script, out = tmp_path / "dying.py", tmp_path / "out.gsvc"
    script.write_text(DYING)
    command = [sys.executable, str(script), "encode", str(clip), str(out), *SMALL, *JOBS]
    run = subprocess.run([*command, "--quiet"], capture_output=True, text=True, timeout=TIMEOUT_S)
    assert run.stderr == (
        "gsvc encode: a process was ended before its frames were encoded, and so was the next one that got them: "
        "something killed them, or there is too little memory for so many; give a lower number of jobs; "
        "saved: 3 complete frames, as a valid stream\n"
    )
    assert run.returncode == 1
    assert len(list(gsvc_ref.decode(out))) == 3


@pytest.mark.exhaustive
def test_a_reader_that_has_enough_ends_all_processes_silently(clip):
    with subprocess.Popen(
        [sys.executable, "-c", START, "encode", str(clip), "-", *SMALL, *JOBS, "--quiet"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.read(4) == b"\x89GSV"
        process.stdout.close()
        assert process.stderr.read() == b""  # which ends when nobody holds the other end any more
        assert process.wait(TIMEOUT_S) == 141
