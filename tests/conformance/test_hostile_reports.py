"""Texts of others reach no terminal as a command and lose no report, and what is no report is refused."""

import json
import math
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import toy_operations
from toy_operations import write_program

from gsvc_base.errors import UsageError
from gsvc_conformance.__main__ import main
from gsvc_conformance.implementations import ModuleImplementation
from gsvc_conformance.report.json import from_object, read, to_object
from gsvc_conformance.results import OutputResult, Result
from gsvc_conformance.runner import judge_outputs
from gsvc_conformance.verdicts import Report

ROOT = Path(__file__).parents[2]
CODES = "\x1b]0;owned\x07 \x9b31m \x7f \r \u202egnp \u2066 \ud800"
VISIBLE = r"\x1b]0;owned\x07 \x9b31m \x7f \r \u202egnp \u2066 \ud800"
COMMANDS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def run(folder, *words) -> int:
    return main(["run", "--vectors", str(folder), "--quiet", "--no-diagnosis", *map(str, words)])


def test_codes_for_the_terminal_are_shown_as_what_they_are(folder, toy_module, tmp_path, capsys):
    def halve(values):
        raise ValueError(CODES)

    name = toy_module(halve=halve, environment=lambda: {"device": CODES})
    files = [tmp_path / f"report.{kind}" for kind in ("json", "xml", "html")]
    assert run(folder, "--module", name, "--json", files[0], "--junit", files[1], "--html", files[2]) == 1
    for text in (capsys.readouterr().out, *(path.read_text(encoding="utf-8") for path in files)):
        assert not COMMANDS.search(text)
    assert any(VISIBLE.replace(r" \r ", " ") in result.message for result in read(files[0]).results)
    assert read(files[0]).runs_on["device"] == VISIBLE.replace(r" \r ", " ")
    assert ET.parse(files[1]).getroot().find(".//error") is not None


def test_codes_in_what_a_command_prints_and_in_its_name(folder, tmp_path, capsys):
    odd = tmp_path / os.fsdecode(b"pro\xff\x1b[31m")
    odd.write_text("#!/bin/sh\nprintf 'x\\033]0;owned\\007'; exit 1\n")
    odd.chmod(0o755)
    files = [tmp_path / f"report.{kind}" for kind in ("json", "xml", "html")]
    command = f"'{odd}'"
    assert run(folder, "--impl", command, "--json", files[0], "--junit", files[1], "--html", files[2]) == 1
    out = capsys.readouterr().out
    assert r"| x\x1b]0;owned\x07" in out
    assert r"pro\udcff\x1b[31m" in out
    for text in (out, *(path.read_text(encoding="utf-8") for path in files)):
        assert not COMMANDS.search(text)


def test_an_error_names_an_input_without_its_codes(capsys):
    assert main(["report", "a\x1b[31mb.json"]) == 2
    assert r"a\x1b[31mb.json" in capsys.readouterr().err
    assert main(["run", "--reference", "--case", "\x1b]0;owned\x07"]) == 2
    assert r"\x1b]0;owned\x07" in capsys.readouterr().err


def test_a_record_with_a_ratio_that_is_infinite_comes_back():
    output = OutputResult("scaled", "bounded", False, "m", math.inf, (2, 1), 3)
    result = Result("core/scale/a", "A", "training", "fail", "m", (output,), ("c",), "l", 0.5)
    report = Report({"kit": "k"}, "command", "", ["note"], [result], {"device": "d"}, "ended early")
    assert from_object(json.loads(json.dumps(to_object(report)))) == report


EDITS = [
    (lambda r: r["results"][0].update(seconds="x"), "seconds of result 0 is 'x'; it must be a number"),
    (lambda r: r["results"][0].update(seconds=math.nan), "seconds of result 0 is nan"),
    (lambda r: r["results"][0].update(seconds=True), "seconds of result 0 is True"),
    (lambda r: r["results"][0].update(seconds=10**400), r"seconds of result 0 is 10+\.\.\.; it must be a number"),
    (lambda r: r["results"][0].update(size=10**400), "size of result 0 is 10+"),
    (lambda r: r["results"][0].update(level=-1), "level of result 0 is -1; it must be a whole number"),
    (lambda r: r["results"][0]["outputs"][0].update(ratio=10**400), "ratio of an output of core/scale/a is 10+"),
    (lambda r: r["results"][0]["outputs"][0].update(place=[True]), "place of an output of core/scale/a is .True."),
    (lambda r: r["results"][0]["outputs"][0].update(wrong=10**400), "wrong of an output of core/scale/a is 10+"),
    (lambda r: r["results"][0].update(log=5), "log of result 0 is 5; it must be a text"),
    (lambda r: r["results"][0].update(message=[]), "message of result 0 is .*; it must be a text"),
    (lambda r: r["results"][0].update(title=None), "title of result 0 is None"),
    (lambda r: r["results"][0].pop("title"), "title of result 0 is missing"),
    (lambda r: r["results"][0].update(causes="c"), "causes of result 0 is 'c'; it must be a list"),
    (lambda r: r["results"][0].update(causes=[1]), "causes of result 0 is .*; it must be a list of texts"),
    (lambda r: r["results"][0].update(outputs=[3]), "an output of core/scale/a is 3; it must be an object"),
    (lambda r: r["results"][0]["outputs"][0].update(ratio="x"), "ratio of an output of core/scale/a is 'x'"),
    (lambda r: r["results"][0]["outputs"][0].update(place=["x"]), "place of an output of core/scale/a"),
    (lambda r: r["results"][0]["outputs"][0].update(wrong=1.5), "wrong of an output .* must be a whole number"),
    (lambda r: r["results"][0]["outputs"][0].update(passed="yes"), "passed of an output .* must be true or false"),
    (lambda r: r["results"][0].update(outcome="fine"), "the outcome 'fine'"),
    (lambda r: r["results"][0].update(id="a/b"), "id of result 0 is 'a/b'; it must be TIER/OPERATION/SLUG"),
    (
        lambda r: r["results"][0].update(table={"title": "t", "columns": ["x"], "rows": [["a"]]}),
        "a table has a row without a name and one cell for each column",
    ),
    (lambda r: r["results"][0].update(level=[0] * 9999), r"level of result 0 is \[0, 0, [0, ]+\.\.\.; it must be"),
    (lambda r: r["results"].append(7), "result 1 is 7; it must be an object"),
    (lambda r: r.update(results={}), "results of the report is {}; it must be a list"),
    (lambda r: r.update(notes=[1]), "notes of the report"),
    (lambda r: r.update(environment={"kit": 1}), "environment of the report is .*; it must be an object of texts"),
    (lambda r: r.update(format="other"), "its format is 'other'"),
]


@pytest.mark.parametrize(("edit", "words"), EDITS)
def test_a_report_that_was_edited_is_refused_with_the_name_of_the_field(tmp_path, capsys, toys, edit, words):
    output = {"name": "scaled", "check": "bounded", "passed": False, "message": "m", "ratio": 2.0, "place": [1, 2]}
    result = {"id": "core/scale/a", "title": "A", "class": "training", "outcome": "fail", "seconds": 1.0,
              "message": "m", "log": "l", "causes": ["c"], "outputs": [output]}  # fmt: skip
    around = {"environment": {"kit": "k"}, "command": "run", "selection": "", "notes": []}
    report = {"format": "gsvc-conformance-report/1", **around, "results": [result]}
    from_object(report)
    edit(report)
    path = tmp_path / "report.json"
    path.write_text(json.dumps(report))
    with pytest.raises(UsageError, match=words):
        read(path)
    assert main(["report", str(path)]) == 2
    assert str(path) in capsys.readouterr().err


def test_a_report_of_classes_that_this_kit_does_not_know_is_shown(tmp_path, capsys, toys):
    result = {"id": "core/scale/a", "title": "A", "class": "other", "outcome": "fail", "seconds": 1.0, "message": "m"}
    around = {"environment": {"kit": "k"}, "command": "run", "selection": "", "notes": []}
    path = tmp_path / "report.json"
    path.write_text(json.dumps({"format": "gsvc-conformance-report/1", **around, "results": [result]}))
    assert main(["report", str(path), "--html", str(tmp_path / "page.html")]) == 1
    assert "core/scale/a" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["", "[]", "5", "{", "[" * 100_000, '"\ud800"', "\xff"])
def test_what_is_no_report_at_all(tmp_path, capsys, text):
    path = tmp_path / "report.json"
    path.write_bytes(text.encode("latin-1" if text == "\xff" else "utf-8", "surrogatepass"))
    assert main(["report", str(path)]) == 2
    assert str(path) in capsys.readouterr().err


def test_a_fault_in_the_judgement_of_one_vector_is_an_error_of_it(folder, toy_module, tmp_path, capsys, monkeypatch):
    """It lost the results of all others."""

    def judge(vector, *more):
        if vector.id == "core/scale/by_two":
            raise RuntimeError("a bug of the kit")
        return judge_outputs(vector, *more)

    monkeypatch.setattr("gsvc_conformance.runner.judge_outputs", judge)
    path = tmp_path / "report.json"
    assert run(folder, "--module", toy_module(), "--json", path) == 1
    report = read(path)
    assert len(report.results) == 9
    (wrong,) = report.faults
    assert wrong.id == "core/scale/by_two"
    assert wrong.message.startswith("its answer cannot be judged (RuntimeError: a bug of the kit): please report it")


@pytest.mark.parametrize(("fault", "status"), [(KeyboardInterrupt(), 130), (OSError(28, "No space left"), 1)])
def test_a_run_that_ends_early_keeps_what_it_judged(folder, toy_module, tmp_path, capsys, monkeypatch, fault, status):
    judged = []

    def answer(self, operation, inputs, turn=0, name=""):
        if len(judged) == 3:
            raise fault
        judged.append(name)
        return answered(self, operation, inputs, turn, name)

    answered = ModuleImplementation.run
    monkeypatch.setattr(ModuleImplementation, "run", answer)
    path = tmp_path / "report.json"
    assert run(folder, "--module", toy_module(), "--json", path, "--html", tmp_path / "page.html") == status
    out, err = capsys.readouterr()
    report = read(path)
    assert [result.id for result in report.results] == judged
    assert report.conclusion == "ended early"
    assert report.ended.startswith("ended early, after 3 of 9 vectors: ")
    assert f"note: {report.ended}" in out
    assert out.endswith("\nENDED EARLY, before all vectors were judged\n")
    assert ("interrupted" if status == 130 else "No space left") in err
    assert "ended early" in (tmp_path / "page.html").read_text(encoding="utf-8").lower()
    assert main(["report", str(path)]) == 2


def test_what_is_wrong_before_the_end_is_wrong(folder, toy_module, tmp_path):
    def halve(values):
        raise KeyboardInterrupt

    def paint(width, height, bit_depth):
        return {"frame": toy_operations.paint(width, height, bit_depth)["frame"] * 0}

    path = tmp_path / "report.json"
    assert run(folder, "--module", toy_module(paint=paint, halve=halve), "--json", path) == 130
    assert read(path).conclusion == "failed"


def test_a_search_for_causes_that_fails_loses_nothing(folder, toy_module, tmp_path, monkeypatch, capsys):
    def find(self, results):
        raise RecursionError("too deep")

    monkeypatch.setattr("gsvc_conformance.commands.judging.Causes.find", find)
    path = tmp_path / "report.json"
    words = ["run", "--vectors", str(folder), "--quiet", "--module", toy_module(), "--json", str(path)]
    assert main(words) == 70
    assert (len(read(path).results), read(path).ended) == (9, "")
    assert "too deep" in capsys.readouterr().out


def test_a_file_that_cannot_be_written_costs_only_itself(folder, toy_module, tmp_path, capsys):
    path = tmp_path / "report.xml"
    assert run(folder, "--module", toy_module(), "--json", "/dev/full", "--junit", path) == 1
    out, err = capsys.readouterr()
    assert f"JUnit XML: {path}" in out
    assert path.exists()
    assert out.endswith("PASSED\n")
    assert "/dev/full: No space left on device" in err


def test_reports_on_standard_output(folder, toy_module, capsysbinary):
    for kind in ("--json", "--junit", "--html"):
        assert run(folder, "--module", toy_module(), kind, "-") == 0
        out, err = capsysbinary.readouterr()
        assert out[:1] in (b"{", b"<")
        assert b"GSVC" in out or b"gsvc" in out
        assert b"PASSED" not in out
        assert err.endswith(b"PASSED\n")
    assert run(folder, "--module", toy_module(), "--json", "-", "--html", "-") == 2
    assert b"go to standard output" in capsysbinary.readouterr().err


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_run_that_is_asked_to_end_ends_its_command_and_writes_the_report(tmp_path):
    """The command that runs then went on alone."""
    text = "import os, sys, time\n"
    text += f"open({str(tmp_path / 'pids')!r}, 'a').write(f'{{os.getpid()}}\\n')\n"
    text += f"time.sleep(600 if len(open({str(tmp_path / 'pids')!r}).readlines()) > 2 else 0)\nraise SystemExit(3)\n"
    command = [
        sys.executable,
        "-m",
        "gsvc_conformance",
        "run",
        "--impl",
        write_program(tmp_path, text),
        "--operation",
        "to_half",
    ]
    command += ["--json", str(tmp_path / "report.json"), "--quiet", "--no-diagnosis"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    pids: list[str] = []
    while len(pids) < 3 and process.poll() is None:
        pids = (tmp_path / "pids").read_text().split() if (tmp_path / "pids").exists() else []
        signal.sigtimedwait([signal.SIGUSR2], 0.02)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 143, err
    assert len(read(tmp_path / "report.json").results) == 2
    with pytest.raises(ProcessLookupError):
        os.kill(int(pids[2]), 0)
