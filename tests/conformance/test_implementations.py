"""Modules that return strange arrays, or do to the kit's own streams what they should not."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import toy_operations
from toy_operations import judge, module

from gsvc_conformance.expectations import Bounded, Decision, Exact, Interval
from gsvc_conformance.implementations import load_module
from gsvc_conformance.vector_folder import Selection

ROOT = Path(__file__).parents[2]


class Shy(np.ndarray):
    """A subclass that finds itself equal to everything."""

    def __ne__(self, other):
        return np.zeros(self.shape, bool)

    def __array__(self, *arguments, **more):
        return np.arange(1, 7)


def masked(values):
    return np.ma.masked_invalid(np.full(values.shape, np.nan))


@pytest.mark.parametrize(
    "expected",
    [
        Exact(np.zeros(3)),
        Decision(np.zeros(3, "<i8")),
        Bounded(np.zeros(3), np.ones(3)),
        Interval(np.zeros(3, "|u1"), np.zeros(3, "|u1"), np.ones(3, "|u1")),
    ],
    ids=lambda expected: expected.check,
)
def test_no_check_passes_what_is_masked_or_no_plain_array(expected):
    for other in (np.ma.masked_all(3, expected.value.dtype), np.full(3, 9, expected.value.dtype).view(Shy)):
        judgement = expected.judge(other)
        assert not judgement.passed
        assert f"is {type(other).__name__}, not an array" in judgement.message


@pytest.mark.parametrize("operation", ["scale", "paint", "halve"])
def test_a_masked_array_is_refused(folder, operation):
    def answer(**inputs):
        return {name: masked(value) for name, value in toy_operations.REFERENCE[operation](**inputs).items()}

    report = judge(folder, module(**{operation: answer}), Selection(operations=(operation,)))
    assert {result.outcome for result in report.results} == {"error"}
    assert "as a masked array: return a plain one" in report.results[0].message


def test_other_subclasses_are_taken_for_what_they_hold(folder):
    def right(values, factor):
        return {"scaled": toy_operations.scale(values, factor)["scaled"].view(Shy)}

    def wrong(values):
        return {**toy_operations.halve(values), "half": np.full(6, 99, "<i8").view(Shy)}

    report = judge(folder, module(scale=right, halve=wrong))
    assert {result.outcome for result in report.results if result.operation == "scale"} == {"pass"}
    assert [result.outcome for result in report.results if result.operation == "halve"] == ["fail"]


STREAMS = {
    "closes": "import sys\nsys.stdout.close()",
    "closes both": "import sys\nsys.stdout.close(); sys.stderr.close()",
    "closes the handles": "import os\nos.close(1); os.close(2)",
    "replaces": "import io, sys\nsys.stdout = io.StringIO()",
    "has none": "import sys\nsys.stdout = None",
    "prints": "import os\nprint('by Python'); os.write(1, b'by the system')",
}


HARD = ("closes the handles", "replaces", "prints")
"""What is tried at other times than a call as well: handles of the system, Python's objects, and both."""

RUDE = [
    *(pytest.param("call", name, marks=[] if name in HARD else [pytest.mark.exhaustive]) for name in STREAMS),
    *(pytest.param(when, name, marks=pytest.mark.exhaustive) for when in ("import", "environment") for name in HARD),
]


@pytest.mark.parametrize(("when", "name"), RUDE)
def test_what_a_module_does_to_standard_output_harms_no_report(tmp_path, when, name):
    text = STREAMS[name]
    function = "def {}({}):\n    {}\n    return {}\n"
    body = text.replace("\n", "; ")
    module = text + "\n" if when == "import" else ""
    module += function.format("environment", "", body if when == "environment" else "pass", "{'device': 'a toy'}")
    module += function.format("from_half", "bits", body if when == "call" else "pass", "{'values': 0.0}")
    (tmp_path / "rude.py").write_text(module)
    command = [
        sys.executable,
        "-m",
        "gsvc_conformance",
        "run",
        "--module",
        "rude",
        "--case",
        "core/from_half/*",
        "--json",
        "-",
    ]
    environment = {"PYTHONPATH": f"{tmp_path}:{ROOT}", "PATH": ""}
    run = subprocess.run(command, capture_output=True, cwd=ROOT, env=environment, timeout=100)
    assert run.returncode == 1
    assert run.stdout.startswith(b'{\n"format":')
    assert run.stdout.endswith(b"]\n}\n")
    assert run.stderr.endswith(b"\nFAILED\n")
    assert (b"by Python" in run.stderr) == (b"by the system" in run.stderr) == (name == "prints")


def test_a_module_may_be_in_the_current_folder(tmp_path, monkeypatch):
    """A command, unlike `python -m`, has the current folder not among those that it imports from."""
    (tmp_path / "lies_here.py").write_text("def from_half(bits):\n    raise NotImplementedError\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [folder for folder in sys.path if folder not in ("", str(tmp_path))])
    monkeypatch.delitem(sys.modules, "lies_here", raising=False)
    assert load_module("lies_here").functions.keys() == {"from_half"}
