"""Servers: one process that answers many vectors, and everything that such a process can do wrong."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from toy_operations import INPUTS, REFERENCE, judge, write_program

from gsvc_base.errors import UsageError
from gsvc_conformance import process, server
from gsvc_conformance.__main__ import main
from gsvc_conformance.process import write_inputs
from gsvc_conformance.report.json import read
from gsvc_conformance.server import MAX_REQUEST, ServerImplementation
from gsvc_conformance.vector_folder import Selection

SCALE = Selection(operations=("scale",))

SERVER = """
import hashlib, json, os, pathlib, shutil, signal, sys, time

def answer(request, **more):
    say(**{{"id": request["id"], "status": "done", **more}})

def say(**fields):
    sys.stdout.write(json.dumps(fields) + "\\n")
    sys.stdout.flush()

def write(request):
    inputs = b"".join(path.read_bytes() for path in sorted(pathlib.Path(request["in"]).iterdir()))
    answer = pathlib.Path({answers!r}, hashlib.sha256(inputs).hexdigest())
    shutil.copytree(answer, request["out"], dirs_exist_ok=True)

count = 0
{start}
say(gsvc=1, name="toy server", environment={{"device": "NumPy"}})
for line in sys.stdin:
    request = json.loads(line)
    count += 1
{each}
    write(request)
    answer(request)
"""
"""A server of the toy operations that knows the answers, with more of its own at its start and for each request."""


def write_answers(folder) -> None:
    """The outputs of each toy vector, in a folder that is named after its inputs."""
    for name, inputs in INPUTS.items():
        asked = folder / "asked" / name
        asked.mkdir(parents=True)
        write_inputs(asked, inputs)
        digest = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(asked.iterdir()))).hexdigest()
        answered = folder / digest
        answered.mkdir(exist_ok=True)
        for port, value in REFERENCE[name.split("/")[1]](**inputs).items():
            if isinstance(value, str):
                (answered / f"{port}.txt").write_text(value)
            else:
                np.save(answered / f"{port}.npy", value)


def command_of(folder, each="", start="") -> str:
    answers = folder / "answers"
    if not answers.exists():
        write_answers(answers)
    indented = "\n".join(f"    {line}" for line in each.splitlines())
    text = SERVER.format(answers=str(answers), each=indented, start=start)
    return write_program(folder, text).replace(sys.executable, f"{sys.executable} -S", 1)


LAST_WORDS = """
if count == 2:
    write(request)
    print("of this vector", file=sys.stderr, flush=True)
    answer(request)
    print("illegal address at mine.cu:77", file=sys.stderr, flush=True)
    sys.exit(3)
"""


def test_the_last_words_between_two_requests_are_shown_with_the_vector_before(folder, monkeypatch):
    ask = server._Server.ask

    def ask_when_it_has_ended(self, number, *arguments):
        if number == 3:  # else what it says may come before the request or after it
            self._program.process.wait(20)
            time.sleep(server.LATE_S)
        return ask(self, number, *arguments)

    monkeypatch.setattr(server._Server, "ask", ask_when_it_has_ended)
    first, second, third = results_of(folder, command_of(folder, LAST_WORDS))
    assert first.passed
    assert second.passed
    assert "it ended with exit status 3" in third.message
    assert f"its answer to request 2, {second.id}" in third.message
    assert "illegal address at mine.cu:77" in third.log


def results_of(folder, command, timeout=20.0, selection=SCALE, **options):
    with ServerImplementation(command, timeout) as implementation:
        return judge(folder, implementation, selection, **options).results


def test_a_right_server_passes_everything_in_one_process(folder, tmp_path):
    note = tmp_path / "pids"
    command = command_of(tmp_path, start=f"open({str(note)!r}, 'a').write(str(os.getpid()) + ' ')")
    with ServerImplementation(command, 20) as implementation:
        assert (implementation.name, implementation.environment) == ("toy server", {"device": "NumPy"})
        assert judge(folder, implementation, repeat=2).passed
    (pid,) = note.read_text().split()
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid), 0)


def test_with_several_jobs_there_is_a_process_for_each(folder, tmp_path):
    note = tmp_path / "pids"
    command = command_of(tmp_path, "time.sleep(0.05)", f"open({str(note)!r}, 'a').write(str(os.getpid()) + ' ')")
    results = results_of(folder, command, selection=Selection(), jobs=3)
    assert {result.outcome for result in results} == {"pass"}
    assert [result.id for result in results] == [r.id for r in results_of(folder, command, selection=Selection())]
    assert 2 <= len(note.read_text().split()) - 1 <= 3


def test_requests_have_the_form_that_the_protocol_promises(folder, tmp_path):
    note = tmp_path / "lines"
    results_of(folder, command_of(tmp_path, f"open({str(note)!r}, 'a').write(line)"), selection=Selection())
    lines = note.read_text().splitlines(keepends=True)
    assert len(lines) == len(INPUTS)
    for number, line in enumerate(lines, 1):
        request = json.loads(line)
        assert list(request) == ["id", "operation", "in", "out"]
        wanted = '{{"id": {id}, "operation": "{operation}", "in": "{in}", "out": "{out}"}}\n'.format(**request)
        assert line == wanted
        assert (request["id"], "\\" in line, len(line.encode()) <= MAX_REQUEST) == (number, False, True)


def test_a_buffer_that_is_not_cleared_shows(folder, tmp_path):
    """A command cannot show it: each of its answers comes from a new process."""
    each = (
        "import numpy as np\nwrite(request)\n"
        "path = pathlib.Path(request['out'], 'scaled.npy')\nvalues = np.load(path)\n"
        "buffer = globals().setdefault('buffer', np.zeros(100, 'f4'))[:values.size]\nbuffer += values.ravel()\n"
        "np.save(path, buffer.reshape(values.shape))\nanswer(request)\ncontinue"
    )
    command = command_of(tmp_path, each).replace(" -S ", " ")  # where NumPy is
    first, second, third = results_of(folder, command)
    assert (first.outcome, second.outcome, third.outcome) == ("pass", "fail", "pass")  # the third has no elements
    asked_again = results_of(folder, command, repeat=3)[0]
    assert asked_again.message.startswith("gave 3 different answers in 3 runs, of which 2 are wrong: a race, or memory")


NOISE = "it wrote a line that is not a JSON object: "
ENDS = "without an answer"
WRONG = {
    "dies by a signal": ("os.kill(os.getpid(), signal.SIGSEGV)", "crash", f"killed by SIGSEGV {ENDS}"),
    "ends": ("raise SystemExit(3)", "error", f"it ended with exit status 3 {ENDS}"),
    "dies in the middle of a line": (
        'os.write(1, b\'{"id": 2, "sta\'); os.kill(os.getpid(), 9)',
        "crash",
        'killed by SIGKILL in the middle of the line \'{"id": 2, "sta\'',
    ),
    "hangs": ("time.sleep(600)", "timeout", "no answer after 1 s"),
    "hangs in the middle of a line": ("os.write(1, b'{\"id\"'); time.sleep(600)", "timeout", "no answer after 1 s"),
    "answers another request": (
        "answer({'id': 1})",
        "error",
        "it answered request 1, but was asked request 2",
    ),
    "answers a request that is none": ("answer({'id': True})", "error", "it answered request true, but was asked"),
    "prints noise": (
        "print('CUDA warning: slow', flush=True)",
        "error",
        f"{NOISE}'CUDA warning: slow'; standard output is the protocol's, so let it and its libraries print to "
        "standard error",
    ),
    "prints a number": ("print(7, flush=True)", "error", f"{NOISE}'7'; "),
    "nests without end": ("print('[' * 50000, flush=True)", "error", f"{NOISE}'{'[' * 100}...'; "),
    "answers twice": (
        "write(request); os.write(1, (json.dumps({'id': 2, 'status': 'done'}) + '\\n').encode() * 2); continue",
        "error",
        'it wrote a line after its answer: \'{"id": 2, "status": "done"}\'',
    ),
    "closes its output": (
        "os.close(1); time.sleep(600)",
        "error",
        f"it closed its standard output {ENDS}, and runs on",
    ),
    "has a line without end": (
        "while True: os.write(1, b'x' * 100000)",
        "error",
        f"it wrote a line of more than 64 KiB, which begins '{'x' * 100}...'",
    ),
    "writes what is no UTF-8": (
        "os.write(1, b'{\"id\": \\xff}\\n')",
        "error",
        "it wrote a line that is no UTF-8: '{\"id\": \\xff}'",
    ),
    "says another status": ("answer(request, status='ok')", "error", 'the status of its answer is "ok", not one of'),
    "says no status": ("say(id=2)", "error", "the status of its answer is null, not one of done, unsupported, error"),
    "says a message that is no text": (
        "answer(request, message=[1])",
        "error",
        "the message of its answer is [1], not",
    ),
    "fails": (
        "print('in the log', file=sys.stderr, flush=True)\nanswer(request, status='error', message='no memory\\nleft')"
        "\ncontinue",
        "error",
        "no memory left",
    ),
    "fails without a word": ("answer(request, status='error'); continue", "error", "status error, without a message"),
    "does not support it": (
        "answer(request, status='unsupported', message='no GPU'); continue",
        "unsupported",
        "no GPU",
    ),
    "says done too early": ("answer(request); continue", "error", "status done, but there is no scaled.npy"),
}


@pytest.mark.parametrize(("text", "outcome", "message"), WRONG.values(), ids=WRONG)
def test_what_one_vector_comes_to_and_the_others_are_kept(folder, tmp_path, monkeypatch, text, outcome, message):
    """The second of three vectors goes wrong; a new process answers the third."""
    monkeypatch.setattr(server, "PATIENCE_S", 0.3)
    flag = tmp_path / "done"
    once = f"if count == 2 and not os.path.exists({str(flag)!r}):\n    open({str(flag)!r}, 'w')\n"
    body = "".join(f"    {line}\n" for line in text.splitlines())
    print_to_log = "    print('seen', file=sys.stderr, flush=True)\n"
    command = command_of(tmp_path, once + print_to_log + body)
    first, second, third = results_of(folder, command, timeout=1.0 if outcome == "timeout" else 20.0)
    assert (first.outcome, second.outcome, third.outcome) == ("pass", outcome, "pass")
    assert second.message.startswith(message)
    if outcome != "unsupported":
        assert second.log.startswith("seen")


def test_a_line_before_it_is_asked(folder, tmp_path):
    flag = tmp_path / "done"
    start = f"new = not os.path.exists({str(flag)!r}); open({str(flag)!r}, 'w')"
    each = "if new and count == 1:\n    write(request); answer(request); say(id=2, status='done'); continue"
    first, second, third = results_of(folder, command_of(tmp_path, each, start))
    assert (third.outcome, {first.outcome, second.outcome}) == ("pass", {"pass", "error"})
    wrong = first if first.outcome == "error" else second  # it may come at once, or when the next vector is asked
    assert "it wrote a line after its answer" in wrong.message


def test_a_line_before_the_first_request(folder, tmp_path):
    start = 'os.write(1, b\'{"gsvc": 1, "name": "x"}\\nready\\n\')'
    results = results_of(folder, command_of(tmp_path, start=start))
    sentence = "it wrote a line after its hello and before the next request: 'ready'"
    assert [(result.outcome, result.message) for result in results] == [("error", sentence)] * 3


def test_an_end_between_two_vectors(folder, tmp_path):
    each = "write(request); answer(request); os._exit(0)"
    results = results_of(folder, command_of(tmp_path, each))
    assert results[0].outcome == "pass"
    assert results[1].outcome == "error"
    assert results[1].message.startswith("it ended with exit status 0 ")


def test_folders_that_it_fills(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(process, "MAX_OUT", 1 << 20)
    each = "f = open(request['out'] + '/x', 'wb')\nwhile True: f.write(bytes(1 << 12)); f.flush()"
    results = results_of(folder, command_of(tmp_path, each))
    assert results[0].message == "it wrote more than 1 MiB to IN_DIR and OUT_DIR, and was ended"


def test_what_it_started_ends_with_it(folder, tmp_path):
    note = tmp_path / "pid"
    start = (
        "import subprocess\nchild = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        f"pathlib.Path({str(note)!r}).write_text(str(child.pid))"
    )
    results_of(folder, command_of(tmp_path, start=start))
    for _ in range(200):
        try:
            os.kill(int(note.read_text()), 0)
        except ProcessLookupError:
            return
        signal.sigtimedwait([signal.SIGUSR2], 0.02)
    raise AssertionError("it lives")


def test_what_others_started_meanwhile_is_left_alone(folder, tmp_path):
    with ServerImplementation(command_of(tmp_path), 20) as implementation:
        child = subprocess.Popen([sys.executable, "-S", "-c", "import time; time.sleep(600)"])
        assert judge(folder, implementation, SCALE).passed
    try:
        assert child.poll() is None
    finally:
        child.kill()
        child.wait()


def test_a_server_that_ignores_its_end_is_killed(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(server, "END_S", 0.2)
    command = command_of(tmp_path)
    program = Path(command.split()[-1])
    program.write_text(program.read_text() + "\ntime.sleep(600)\n")
    assert {result.outcome for result in results_of(folder, command)} == {"pass"}


HELLOS = {
    "nothing": ("raise SystemExit(1)", "it ended with exit status 1 without a hello"),
    "a fault of its own": (
        "import no_such_module",
        "without a hello; it printed: 'ModuleNotFoundError: No module named",
    ),
    "a signal": ("os.kill(os.getpid(), 9)", "killed by SIGKILL without a hello"),
    "silence": ("time.sleep(600)", "no hello after 1 s"),
    "noise": (
        "print('Loading model...', flush=True)",
        "in place of the hello it wrote a line that is not a JSON object: 'Loading model...'; standard",
    ),
    "another version": (
        "say(gsvc=2, name='x')",
        "its hello is of version 2 of the protocol; this kit speaks version 1",
    ),
    "another object": ("say(status='done', id=1)", 'its first line must be the hello, {"gsvc": 1, "name": "..."}, and'),
    "no name": ("say(gsvc=1)", "its hello must have a name"),
    "numbers": (
        "say(gsvc=1, name='x', environment={'a': 1})",
        "the environment of its hello must be an object of texts",
    ),
    "empty": ("say(gsvc=1, name='x', environment={'': 'a'})", "the environment of its hello has '': 'a'"),
}


@pytest.mark.parametrize(("start", "message"), HELLOS.values(), ids=HELLOS)
def test_a_server_without_a_hello_judges_nothing(tmp_path, start, message):
    timeout = 1.0 if "sleep" in start else 20.0
    with pytest.raises(UsageError) as error:
        ServerImplementation(command_of(tmp_path, start=start), 20, timeout)
    assert message in str(error.value)


def test_commands_that_are_none(tmp_path):
    script = tmp_path / "script"
    script.write_text("no interpreter is named here\n")
    script.chmod(0o755)
    for command, message in (("", "--serve needs a command"), (str(script), f"{script} cannot be started")):
        with pytest.raises(UsageError, match=message):
            ServerImplementation(command, 1)


@pytest.mark.parametrize("name", ['a"b', "a\\b", "a\nb", "a" * 1001, "a\udc80"])
def test_folders_that_no_request_can_name(tmp_path, monkeypatch, name):
    monkeypatch.setattr("tempfile.gettempdir", lambda: f"/tmp/{name}")
    with pytest.raises(UsageError, match="set TMPDIR to another one"):
        ServerImplementation(sys.executable, 1)


# The command


def run(folder, command, *words):
    return main(["run", "--vectors", str(folder), "--quiet", "--no-diagnosis", "--serve", command, *words])


def test_a_report_says_what_the_server_runs_on(folder, tmp_path, capsys):
    assert run(folder, command_of(tmp_path), "--json", str(tmp_path / "r.json"), "--timeout", "7", "--order", "3") == 0
    report = read(tmp_path / "r.json")
    assert report.environment["implementation"] == "toy server"
    assert report.runs_on == {"device": "NumPy"}
    assert " run --serve " in report.command
    assert " --timeout 7" in report.command
    assert "device  NumPy" in capsys.readouterr().out


def test_a_server_that_cannot_be_started_again_ends_the_run_and_what_was_judged_is_kept(folder, tmp_path, capsys):
    flag = tmp_path / "broken"
    start = f"if os.path.exists({str(flag)!r}): raise SystemExit('no device')"
    each = f"if count == 2: open({str(flag)!r}, 'w'); os.kill(os.getpid(), 9)"
    status = run(folder, command_of(tmp_path, each, start), "--json", str(tmp_path / "r.json"))
    said = capsys.readouterr()
    assert status == 2
    sentence = "the server did not start 3 times in a row; the last time it ended with exit status 1 without a hello"
    assert f"ended early, after 4 of 9 vectors: {sentence}; it printed: 'no device'" in said.out
    assert sentence in said.err
    report = read(tmp_path / "r.json")
    assert [result.outcome for result in report.results] == ["pass", "crash", "error", "error"]
    assert report.results[2].message.startswith("the server cannot be started again: it ended with exit status 1")


def test_no_hello_no_judgement(folder, tmp_path, capsys):
    assert run(folder, command_of(tmp_path, start="time.sleep(60)"), "--start-timeout", "0.3") == 2
    assert "no hello after 0.3 s" in capsys.readouterr().err


def test_a_failure_is_told_with_the_command_that_serves_again(folder, tmp_path, capsys):
    command = command_of(tmp_path, "print('warming up', flush=True)")
    assert run(folder, command, "--operation", "scale", "--show", "1") == 1
    out = capsys.readouterr().out
    assert "it wrote a line that is not a JSON object: 'warming up'" in out
    assert "again: gsvc-conformance run --serve " in out
