"""Each vector asked for several times, and in other orders: races and what is kept from vector to vector."""

import json
import os
import platform

import numpy as np
import pytest
import toy_operations
from toy_operations import INPUTS, PROGRAM, judge, module, outcomes, write_program

from gsvc_conformance.__main__ import main
from gsvc_conformance.commands.judging import shuffled
from gsvc_conformance.process import ProcessImplementation
from gsvc_conformance.report.json import read
from gsvc_conformance.vector_folder import Selection

HALVE = Selection(operations=("halve",))
NAME = "core/halve/one_to_six"


class Halves:
    """The toy operation, which goes wrong, or another legal way, when it is called for the given times."""

    def __init__(self, wrong=(), other=(), fails=()) -> None:
        self.wrong, self.other, self.fails, self.calls = wrong, other, fails, 0

    def __call__(self, values):
        self.calls += 1
        if self.calls in self.fails:
            raise RuntimeError("now and then")
        answer = toy_operations.halve(values)
        if self.calls in self.other:
            answer["half"][4] = 3  # 5/2 may be 2 or 3
        return {**answer, "count": np.asarray(0)} if self.calls in self.wrong else answer


@pytest.mark.parametrize(
    ("halves", "times", "outcome", "words"),
    [
        (Halves(), 5, "pass", ""),
        (Halves(wrong={4}), 3, "pass", ""),
        (Halves(wrong={4}), 5, "fail", "gave 2 different answers in 5 runs, of which 1 is wrong: a race, or memory"),
        (
            Halves(wrong={1}),
            5,
            "fail",
            "of which 1 is wrong: only the first differs, so it has something of the vector",
        ),
        (Halves(wrong={1}), 2, "fail", "gave 2 different answers in 2 runs, of which 1 is wrong: a race"),
        (Halves(wrong={1, 2, 3}), 3, "fail", "output count is 0, expected 6"),
        (Halves(wrong={1, 3}, other={2, 3}), 4, "fail", "gave 4 different answers in 4 runs, of which 2 are wrong: "),
        (Halves(other={2}), 3, "pass", "gave 2 different answers in 3 runs, each within what is allowed: an order of"),
        (Halves(fails={2}), 3, "error", "gave 2 different answers in 3 runs, of which 1 is wrong: a race"),
    ],
)
def test_answers_that_differ_are_told(folder, halves, times, outcome, words):
    result = judge(folder, module(halve=halves), HALVE, repeat=times).results[0]
    assert result.outcome == outcome
    assert words in result.message
    assert bool(words) == bool(result.message)
    assert halves.calls == times


def test_the_message_of_what_is_wrong_stands_behind_it(folder):
    result = judge(folder, module(halve=Halves(wrong={2})), HALVE, repeat=2).results[0]
    assert result.message.endswith("; output count is 0, expected 6")
    assert [output.passed for output in result.outputs] == [True, False]


def test_memory_that_a_module_uses_again_is_no_answer_to_the_next(folder):
    """All answers were one array: the last call wrote what the first had returned."""
    memory = np.zeros(6, "<i8")

    def halve(values):
        memory[:] = toy_operations.halve(values)["half"] + (halve.calls % 2)
        halve.calls += 1
        return {"half": memory, "count": np.asarray(6)}

    halve.calls = 0
    result = judge(folder, module(halve=halve), HALVE, repeat=3).results[0]
    assert "gave 2 different answers in 3 runs, of which 1 is wrong" in result.message


def test_what_is_unsupported_or_takes_too_long_is_not_asked_again(folder, tmp_path):
    calls = []
    judge(
        folder,
        module(halve=lambda values: calls.append(1) or (_ for _ in ()).throw(NotImplementedError)),
        HALVE,
        repeat=9,
    )
    assert len(calls) == 1
    note = tmp_path / "note"
    text = f"import time\nopen({str(note)!r}, 'a').write('x')\ntime.sleep(600)"
    report = judge(folder, ProcessImplementation(write_program(tmp_path, text), 2.0), HALVE, repeat=9)
    assert outcomes(report) == {NAME: "timeout"}
    assert note.read_text() == "x"


@pytest.mark.exhaustive
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator")
def test_memory_that_is_not_written_to_differs_in_a_command(folder, tmp_path, monkeypatch):
    """Each answer comes from a new process, whose new memory is zero as often as not.

    4,096 bytes: more than glibc keeps for reuse without filling it.
    """
    monkeypatch.delenv("MALLOC_PERTURB_", raising=False)
    text = PROGRAM.format(home=os.path.dirname(toy_operations.__file__))
    text += "\nimport ctypes\nC = ctypes.CDLL(None)\nC.malloc.restype = ctypes.POINTER(ctypes.c_longlong * 6)\n"
    text += "half = np.array(C.malloc(4096).contents)\nnp.save(Path(outside, 'half.npy'), half)\n"
    report = judge(folder, ProcessImplementation(write_program(tmp_path, text), 60.0), HALVE, repeat=3)
    assert "gave 3 different answers in 3 runs" in report.results[0].message
    monkeypatch.setenv("MALLOC_PERTURB_", "7")  # the user's own choice
    report = judge(folder, ProcessImplementation(write_program(tmp_path, text), 60.0), HALVE, repeat=3)
    assert "different" not in report.results[0].message


def test_the_order_is_another_one_and_always_the_same():
    assert shuffled(INPUTS, 5) == [
        "core/parse/three_bytes", "core/scale/by_two", "core/halve/one_to_six", "uncommon/parse/empty",
        "uncommon/paint/ten_bits", "core/scale/by_a_third", "faulty/parse/bad_letter", "stress/scale/nothing",
        "core/paint/odd_size",
    ]  # fmt: skip
    assert shuffled(INPUTS, 6) != shuffled(INPUTS, 5)
    some = [name for name in INPUTS if name.startswith("core")]
    assert shuffled(some, 5) == [name for name in shuffled(INPUTS, 5) if name in some]


def test_what_is_kept_from_vector_to_vector_shows_in_another_order(folder, toy_module, tmp_path, capsys):
    """A buffer that is never cleared is right as long as no larger vector came before."""
    kept = np.zeros((7, 2), "<f4")

    def scale(values, factor):
        kept[: len(values)] = values * np.float32(factor)
        rows = max(len(values), int(np.count_nonzero(kept.any(axis=1))) if factor == 2 else 0)
        return {"scaled": kept[:rows].copy()}

    words = ["run", "--module", toy_module(scale=scale), "--vectors", str(folder), "--operation", "scale", "--quiet"]
    outcome = {}
    for seed in (5, 1):
        kept[:] = 0
        path = tmp_path / f"{seed}.json"
        outcome[seed] = main([*words, "--order", str(seed), "--json", str(path), "--no-diagnosis"])
        report = read(path)
        assert [result.id for result in report.results] == [name for name in sorted(INPUTS) if "/scale/" in name]
        assert any(f"in the order of --order {seed}" in note for note in report.notes)
    assert [shuffled(INPUTS, seed).index("core/scale/by_two") < shuffled(INPUTS, seed).index("core/scale/by_a_third")
            for seed in (5, 1)] == [True, False]  # fmt: skip
    assert outcome == {5: 0, 1: 1}
    assert "has shape (7, 2)" in capsys.readouterr().out


def test_the_options(folder, toy_module, tmp_path, capsys):
    words = ["run", "--vectors", str(folder), "--quiet", "--no-diagnosis"]
    assert main([*words, "--module", toy_module(), "--repeat", "0"]) == 2
    assert "less than 1" in capsys.readouterr().err
    path = tmp_path / "report.json"
    name = toy_module(halve=Halves(other={2}), scale=lambda values, factor: {"scaled": values})
    assert main([*words, "--module", name, "--repeat", "3", "--json", str(path)]) == 1
    out = capsys.readouterr().out
    assert f"run --module {name} --repeat 3 --vectors {folder} --case core/scale/by_a_third" in out
    assert "note: halve: 1 vector gave different answers when asked again, each within what is allowed" in out
    assert json.loads(path.read_text())["command"].endswith(f"--repeat 3 --vectors {folder}")
