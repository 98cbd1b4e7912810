"""Implementations behind the process protocol: crashes, hangs, garbage and hostile files."""

import io
import json
import os
import signal
import sys

import numpy as np
import pytest
from toy_operations import good_program, judge, write_program

from gsvc_base.errors import UsageError
from gsvc_conformance.implementations import Failure, Unsupported
from gsvc_conformance.operation import Port
from gsvc_conformance.process import MAX_BYTES, ProcessImplementation, read_output
from gsvc_conformance.vector import npy
from gsvc_conformance.vector_folder import Selection


def outcome_of(folder, tmp_path, text, timeout=60.0):
    command = write_program(tmp_path, text)
    report = judge(folder, ProcessImplementation(command, timeout), Selection(operations=("halve",)))
    assert not report.passed
    return report.results[0]


def test_a_process_that_crashes(folder, tmp_path):
    result = outcome_of(folder, tmp_path, "import os; print('so far', flush=True); os.kill(os.getpid(), 11)")
    assert (result.outcome, result.message) == ("crash", "killed by SIGSEGV")
    assert result.log == "so far"


def test_a_process_that_never_ends(folder, tmp_path):
    result = outcome_of(folder, tmp_path, "import time; print('zzz', flush=True); time.sleep(600)", timeout=1.0)
    assert (result.outcome, result.message) == ("timeout", "no end after 1 s")
    assert result.log == "zzz"


def test_no_process_outlives_its_vector(folder, tmp_path):
    note = tmp_path / "pid"
    text = (
        "import subprocess, sys, pathlib, time\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        f"pathlib.Path({str(note)!r}).write_text(str(child.pid))\n"
        "time.sleep(600 if {} else 0)\n"
    )
    for sleeps in (True, False):
        outcome_of(folder, tmp_path, text.format(sleeps), timeout=3.0)
        pid = int(note.read_text())
        for _ in range(200):  # the kernel may take a moment to bury it
            if not _alive(pid):
                break
            signal.sigtimedwait([signal.SIGUSR2], 0.02)
        assert not _alive(pid)


def _alive(pid) -> bool:
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_exit_statuses(folder, tmp_path):
    assert outcome_of(folder, tmp_path, "raise SystemExit(77)").outcome == "unsupported"
    result = outcome_of(folder, tmp_path, "raise SystemExit(3)")
    assert (result.outcome, result.message) == ("error", "exit status 3")
    result = outcome_of(folder, tmp_path, "raise ValueError('something is wrong')")
    assert result.outcome == "error"
    assert result.log.endswith("ValueError: something is wrong")


def test_only_the_ends_of_what_is_printed_are_kept(folder, tmp_path):
    text = "print('the reason', 'x' * 10_000_000, 'the end', sep='\\n'); raise SystemExit(1)"
    result = outcome_of(folder, tmp_path, text)
    assert result.log.startswith("the reason\n")
    assert result.log.endswith("\nthe end")
    assert 4000 < len(result.log) <= 4096


WRITE = "import sys, os, pathlib; out = pathlib.Path(sys.argv[3])\n"
GARBAGE = {
    "nothing": "",
    "not-npy": "(out / 'half.npy').write_bytes(b'garbage')",
    "empty": "(out / 'half.npy').write_bytes(b'')",
    "folder": "(out / 'half.npy').mkdir()",
    "link": "os.symlink('/dev/zero', out / 'half.npy')",
    "pipe": "os.mkfifo(out / 'half.npy')",
    "huge": f"f = open(out / 'half.npy', 'wb'); f.truncate({MAX_BYTES + 1})",
}


@pytest.mark.parametrize("text", GARBAGE.values(), ids=GARBAGE)
def test_garbage_instead_of_outputs(folder, tmp_path, text):
    result = outcome_of(folder, tmp_path, WRITE + text)
    assert result.outcome == "error"
    assert "half.npy" in result.message


def test_other_files_are_ignored(folder, tmp_path):
    text = good_program(tmp_path).split()[1]
    with open(text, "a") as program:
        program.write("Path(outside, 'more.npy').write_bytes(b'garbage'); Path(outside, 'x').mkdir()\n")
    assert judge(folder, ProcessImplementation(f"{sys.executable} {text}", 60), Selection(operations=("halve",))).passed


def header(text, version=b"\x01\x00") -> bytes:
    return b"\x93NUMPY" + version + len(text).to_bytes(2 if version[0] == 1 else 4, "little") + text


GOOD = b"{'descr': '<i8', 'fortran_order': False, 'shape': (2,), }\n"
BAD_HEADERS = {
    "shape": header(GOOD.replace(b"2,", b"3,")) + bytes(16),
    "negative": header(GOOD.replace(b"2,", b"-1,-2")) + bytes(16),
    "true": header(GOOD.replace(b"2,", b"True,")) + bytes(8),
    "no-length": header(GOOD.replace(b"2,", b"0,10**30")) + bytes(16),
    "giant": header(GOOD.replace(b"2,", b"0, 1" + b"0" * 30)),
    "short": header(GOOD) + bytes(15),
    "long": header(GOOD) + bytes(17),
    "objects": header(GOOD.replace(b"<i8", b"|O")) + bytes(16),
    "text": header(GOOD.replace(b"<i8", b"|S8")) + bytes(16),
    "code": header(b"__import__('os').abort()\n") + bytes(16),
    "nesting": header(b"(" * 9000 + b"\n"),
    "version": header(GOOD, b"\x07\x00") + bytes(16),
    "cut": header(GOOD)[:30],
}


@pytest.mark.parametrize("data", BAD_HEADERS.values(), ids=BAD_HEADERS)
def test_a_hostile_npy_file_is_refused(tmp_path, data):
    (tmp_path / "half.npy").write_bytes(data)
    with pytest.raises(ValueError, match=r"^half\.npy"):
        read_output(tmp_path, Port("half", "i8", "(N,)"))


@pytest.mark.parametrize("version", [b"\x01\x00", b"\x02\x00"])
def test_an_npy_file_is_read_as_numpy_reads_it(tmp_path, version):
    (tmp_path / "half.npy").write_bytes(header(GOOD, version) + np.array([5, -7], "<i8").tobytes())
    assert read_output(tmp_path, Port("half", "i8", "(N,)")).tolist() == [5, -7]


def test_arrays_by_columns_are_read(tmp_path):
    array = np.asfortranarray(np.arange(6.0).reshape(2, 3))
    np.save(tmp_path / "half.npy", array)
    read = read_output(tmp_path, Port("half", "f8", "(A, B)"))
    assert np.array_equal(read, array)
    assert read.flags.c_contiguous


def test_a_text_is_read_without_its_end_of_line_and_may_be_no_unicode(tmp_path):
    (tmp_path / "error.txt").write_bytes(b"malformed R-6.2-2 412\r\n")
    assert read_output(tmp_path, Port("error", "text")) == "malformed R-6.2-2 412"
    (tmp_path / "error.txt").write_bytes(b"\xff\xfe")
    assert read_output(tmp_path, Port("error", "text")) == "\ufffd\ufffd"


def test_inputs_as_files(toys, tmp_path):
    text = (
        "import sys, json, pathlib, numpy as np\n"
        "found = {p.name: p.read_bytes().hex() for p in pathlib.Path(sys.argv[2]).iterdir()}\n"
        f"pathlib.Path({str(tmp_path / 'found.json')!r}).write_text(json.dumps([sys.argv[1], found]))\n"
        "raise SystemExit(77)\n"
    )
    inputs = {"values": np.arange(3, dtype="<f4"), "width": 7, "factor": 0.5, "stream": b"\x00\xff"}
    answer = ProcessImplementation(write_program(tmp_path, text), 60).run(toys["halve"], inputs)
    assert isinstance(answer, Unsupported)
    operation, found = json.loads((tmp_path / "found.json").read_text())
    assert operation == "halve"
    assert sorted(found) == ["factor.npy", "stream.gsvc", "values.npy", "width.npy"]
    assert found["stream.gsvc"] == "00ff"
    for name, dtype in (("values", "<f4"), ("width", "<i8"), ("factor", "<f8")):
        array = np.load(io.BytesIO(bytes.fromhex(found[f"{name}.npy"])))
        assert array.dtype.str == dtype
        assert np.array_equal(array, inputs[name])


def test_a_program_that_is_not_there_or_cannot_be_started(toys, tmp_path):
    script = tmp_path / "script"
    script.write_text("not executable yet\n")
    wrong = {
        "": "--impl needs a command",
        "  ": "--impl needs a command",
        "/no/such/program": "there is no program '/no/such/program'; build it first",
        "./no-such-program": r"there is no program '\./no-such-program'; build it first",
        "no-such-program": r"there is no program 'no-such-program'; give its path, such as \./decoder",
        "'unfinished": "cannot be split into words",
        str(tmp_path): "is a folder",
        f"{script} --fast": rf"{script} cannot be executed: chmod \+x",
    }
    for command, message in wrong.items():
        with pytest.raises(UsageError, match=message):
            ProcessImplementation(command, 1)
    script.write_text("no interpreter is named here\n")
    script.chmod(0o755)
    answer = ProcessImplementation(str(script), 10).run(toys["halve"], {"values": np.arange(2)})
    assert isinstance(answer, Failure)
    assert answer.outcome == "error"


def test_a_program_of_the_current_folder_without_its_path(tmp_path, monkeypatch):
    (tmp_path / "judge-me").touch(0o755)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match=r"say \./judge-me"):
        ProcessImplementation("judge-me", 1)


def test_no_shell_sees_a_command(folder, tmp_path):
    target = tmp_path / "made"
    command = f"{sys.executable} -c 'raise SystemExit(77)' ; touch {target}"
    judge(folder, ProcessImplementation(command, 60), Selection(operations=("halve",)))
    assert not target.exists()


def test_arrays_become_native_and_are_little_endian_on_all_machines(tmp_path):
    (tmp_path / "half.npy").write_bytes(npy(np.array([1, 2], "<i8")))
    array = read_output(tmp_path, Port("half", "i8", "(N,)"))
    assert array.dtype.isnative
    assert array.tolist() == [1, 2]
    (tmp_path / "half.npy").write_bytes(npy(np.array([1, 2], ">i8")))
    with pytest.raises(ValueError, match=r"^half\.npy has numbers of type >i8, most significant byte first"):
        read_output(tmp_path, Port("half", "i8", "(N,)"))


@pytest.mark.skipif(os.name != "posix", reason="links of POSIX")
def test_outputs_are_not_read_through_a_link(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "error.txt").write_text("malformed R-6.2-2 412")
    (tmp_path / "out").symlink_to("elsewhere")
    with pytest.raises(ValueError, match="out is a link"):
        read_output(tmp_path / "out", Port("error", "text"))
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "error.txt").symlink_to(tmp_path / "elsewhere" / "error.txt")
    with pytest.raises(ValueError, match=r"error\.txt is not a regular file"):
        read_output(tmp_path / "own", Port("error", "text"))
