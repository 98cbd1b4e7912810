"""The pytest plug-in, as its user sees it: in a folder elsewhere, with a module of one's own."""

import importlib
import json
import subprocess
import sys
import time
import tomllib
from importlib.metadata import entry_points
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import toy_operations
from toy_operations import INPUTS, good_program

from gsvc_conformance import diagnosis, pytest_vectors
from gsvc_conformance.operation import input_size
from gsvc_conformance.results import NOT_ASKED
from gsvc_conformance.vector_folder import VectorFolder

pytest_plugins = ["pytester"]

ROOT = Path(__file__).parents[2]
PLUGIN = "gsvc_conformance.pytest_plugin"
LOADED = any(entry.value == PLUGIN for entry in entry_points(group="pytest11"))
ID = "gsvc::core/halve/one_to_six"


def wrong_halves(values):
    return {**toy_operations.halve(values), "count": np.asarray(0)}


def toy_causes(failures, passed, errors):
    """The diagnosis knows no toys: a cause for each failure, if others pass."""
    return {failure.vector.id: [f"a toy, beside {len(passed)} that pass"] for failure in failures}


@pytest.fixture
def run(pytester, folder, monkeypatch):
    """Runs pytest in a folder with a test of its own; the vectors are toys."""
    monkeypatch.setattr(diagnosis, "diagnose", toy_causes)
    pytester.makepyfile(test_own="def test_own():\n    pass\n")

    def go(*words, vectors=True):
        loaded = [] if LOADED else ["-p", PLUGIN]
        chosen = [f"--gsvc-vectors={folder}"] if vectors else []
        return pytester.runpytest_inprocess(*loaded, "-p", "no:xdist", *words, *chosen)

    return go


def sentence(result):
    """The one line of an error of use."""
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    (line,) = [line for line in result.errlines if line]
    return line.removeprefix("ERROR: ")


def test_the_vectors_run_alone(run, toy_module):
    result = run("-q", "--gsvc-module", toy_module())
    result.assert_outcomes(passed=len(INPUTS))
    assert result.ret == 0
    result.stdout.fnmatch_lines(
        [
            "*vectors of no set (sha256 *): toy_implementation*",
            "class training passed: 3 vectors*",
            "passes vectors of no set (sha256 *), class training, profile paper, level 5, 0 waivers",
        ]
    )


@pytest.mark.parametrize("settings", ["", "[pytest]\ntestpaths = .\n"])
def test_tests_that_cannot_be_imported_stay_out_of_the_way(run, toy_module, pytester, settings):
    """Those of a fork of gsplat without its CUDA extension."""
    pytester.makeini(settings)
    theirs = pytester.makepyfile(test_theirs="raise ImportError('no CUDA extension')")
    words = ["-q", "--gsvc-module", toy_module()]
    run(*words).assert_outcomes(passed=len(INPUTS))
    run(*words, "-m", "gsvc").assert_outcomes(passed=len(INPUTS))
    run(*words, "test_own.py").assert_outcomes(passed=len(INPUTS) + 1)
    run("-q", "test_own.py", vectors=False).assert_outcomes(passed=1)
    assert run(*words, str(theirs)).ret == pytest.ExitCode.INTERRUPTED


def test_without_an_option_nothing_is_added_and_nothing_imported(run):
    run("-q", vectors=False).assert_outcomes(passed=1)
    code = f"import sys; before = set(sys.modules); import {PLUGIN}; print(*sorted(set(sys.modules) - before))"
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT / "conformance"
    )
    assert {name for name in out.stdout.split() if name.startswith(("gsvc", "numpy"))} == {"gsvc_conformance", PLUGIN}


def test_a_failure_shows_the_message_of_the_kit_and_the_command_that_works(run, toy_module, folder):
    result = run("-q", "--gsvc-module", toy_module(halve=wrong_halves))
    result.assert_outcomes(passed=len(INPUTS) - 1, failed=1)
    again = f"pytest --gsvc-module=toy_implementation --gsvc-vectors={folder} {ID}"
    result.stdout.fnmatch_lines(
        [
            "*_ core/halve/one_to_six _*",
            "The vector one_to_six.",
            "  output count is 0, expected 6*",
            f"  again: {again}",
            "Probable cause: a toy, beside 0 that pass (halve: 1 of 1 examined)",
            "class quantization failed: 1 of 1 *",
            f"FAILED {ID} - output count is 0, expected 6*",
        ]
    )
    result.stdout.no_fnmatch_line("*Traceback*")
    result.stdout.no_fnmatch_line("*pytest_vectors.py*")
    alone = run(*again.split()[1:], "-q", vectors=False)
    alone.assert_outcomes(failed=1)
    alone.stdout.fnmatch_lines(["1 of 1 vector ran: 1 fail*"])


def test_k_x_and_lf(run, toy_module):
    name = toy_module(halve=wrong_halves, parse=lambda stream: {"count": np.asarray(0), "error": ""})
    words = ["-q", "--gsvc-module", name]
    run(*words, "-k", "halve or by_two").assert_outcomes(failed=1, passed=1, deselected=len(INPUTS) - 2)
    run(*words, "-m", "gsvc", "-x", ".").assert_outcomes(failed=1, deselected=1)
    run(*words).assert_outcomes(failed=3, passed=len(INPUTS) - 3)
    run(*words, "--lf").assert_outcomes(failed=3, deselected=len(INPUTS) - 3)


def test_vectors_come_from_the_simple_to_the_hard(folder):
    vectors = VectorFolder(folder)
    names = pytest_vectors.simplest_vectors_first(vectors, vectors.names)
    assert [name for name in names if "/scale/" in name] == [
        "core/scale/by_two", "core/scale/by_a_third", "stress/scale/nothing"
    ]  # fmt: skip
    assert list(dict.fromkeys(name.split("/")[1] for name in names)) == list(toy_operations.OPERATIONS)
    for vector in vectors.read(vectors.names):
        assert vectors.input_size(vector.id) == input_size(vector.inputs)
    (folder / "core/scale/by_two/manifest.json").write_text("[]")
    assert vectors.input_size("core/scale/by_two") == 0


def test_a_search_for_causes_that_fails_ends_nothing(run, toy_module, monkeypatch):
    def failing(failures, passed, errors):
        raise ZeroDivisionError("a mutant divides")

    monkeypatch.setattr(diagnosis, "diagnose", failing)
    result = run("-q", "--gsvc-module", toy_module(halve=wrong_halves))
    result.assert_outcomes(passed=len(INPUTS) - 1, failed=1)
    result.stdout.fnmatch_lines([
        "class quantization failed: 1 of 1 *",
    ])  # fmt: skip
    assert "note: halve: the search for causes failed: ZeroDivisionError: a mutant divides" in result.outlines


def test_options_choose_vectors_and_node_ids_prevail(run, toy_module):
    words = ["-q", "--gsvc-module", toy_module()]
    run(*words, "--gsvc-operation", "scale", "--gsvc-operation", "halve").assert_outcomes(passed=4)
    run(*words, "--gsvc-class", "bitstream", "--gsvc-case", "core/*").assert_outcomes(passed=1)
    run(*words, ID).assert_outcomes(passed=1)
    run(*words, f"../{ID}").assert_outcomes(passed=1)
    run(*words, "gsvc::core/scale/*", "test_own.py").assert_outcomes(passed=3)
    run(*words, "gsvc::", "--gsvc-operation", "scale").assert_outcomes(passed=3)
    run(*words, "test_own.py").assert_outcomes(passed=len(INPUTS) + 1)


def test_a_time_that_is_used(run, toy_module):
    """The vector with the least work is asked for, and no other."""

    def slow(stream):
        time.sleep(0.3)
        return toy_operations.parse(stream)

    result = run("-q", "-rs", "--gsvc-module", toy_module(parse=slow), "--gsvc-seconds", "0.2")
    result.assert_outcomes(passed=1, skipped=len(INPUTS) - 1)
    result.stdout.fnmatch_lines(
        [
            f"1 of {len(INPUTS)} vectors ran: 1 pass, {len(INPUTS) - 1} skipped; *",
            f"SKIPPED [[]{len(INPUTS) - 1}] *{NOT_ASKED}",
        ]
    )
    assert "--gsvc-seconds takes a number of seconds, not 0" in sentence(
        run("--gsvc-module", toy_module(), "--gsvc-seconds", "0")
    )


def test_options_of_the_configuration_give_way_to_paths(run, toy_module, pytester, folder):
    pytester.makeini(f"[pytest]\naddopts = --gsvc-module={toy_module()} --gsvc-vectors={folder}\n")
    run("-q", vectors=False).assert_outcomes(passed=len(INPUTS) + 1)
    run("-q", "test_own.py", vectors=False).assert_outcomes(passed=1)
    run("-q", ID, vectors=False).assert_outcomes(passed=1)


def test_what_is_unsupported_is_skipped_with_its_reason(run, toy_module):
    def only_small(stream):
        raise NotImplementedError("no streams today")

    result = run("-q", "-rs", "--gsvc-module", toy_module(parse=only_small, halve=None))
    result.assert_outcomes(passed=len(INPUTS) - 4, skipped=4)
    result.stdout.fnmatch_lines(["SKIPPED [[]1] *toy_implementation has no function halve*"])
    result.stdout.fnmatch_lines(["SKIPPED [[]3] *no streams today*"])
    assert result.outlines[0].count("s") == 3  # what has no function prints no letter


WAIVERS = """
[[waiver]]
vectors = ["core/halve/*"]
reason = "bug 12"
issue = "https://example.org/12"
[[waiver]]
vectors = ["core/parse/three_bytes"]
reason = "over"
until = 2020-01-01
"""


def test_waivers_are_strict_xfail(run, toy_module, pytester):
    file = pytester.makefile(".toml", known=WAIVERS)
    words = ["-q", "-rx", "--gsvc-waivers", file.name, "--gsvc-module"]
    result = run(*words, toy_module(halve=wrong_halves))
    result.assert_outcomes(xfailed=1, passed=len(INPUTS) - 1)
    result.stdout.fnmatch_lines([f"XFAIL {ID} - *bug 12 (https://example.org/12) (waived fail: output count is 0*"])
    run(*words, toy_module(halve=wrong_halves), "--runxfail").assert_outcomes(failed=1, passed=len(INPUTS) - 1)
    stale = run(*words, toy_module())
    stale.assert_outcomes(failed=1, passed=len(INPUTS) - 1)
    stale.stdout.fnmatch_lines(['  it passes, so take it out of the waiver "bug 12" in known.toml'])
    stale.stdout.fnmatch_lines(["1 vector passes with a stale waiver: take it out"])
    part = run(*words, toy_module(), "--gsvc-operation", "halve")
    part.stdout.fnmatch_lines(["1 of 1 vector ran: 1 pass (1 of them with a stale waiver: take it out); *"])
    over = run(*words, toy_module(parse=lambda stream: {}), "gsvc::core/parse/three_bytes")
    over.assert_outcomes(failed=1)
    over.stdout.fnmatch_lines(["  error: parse returned no count, error",
                               '  the waiver "over" ended on 2020-01-01: it counts no more'])  # fmt: skip


def test_a_command(run, tmp_path):
    words = ["-q", "--gsvc-operation", "halve", "--gsvc-impl", good_program(tmp_path)]
    run(*words, "--gsvc-timeout", "50").assert_outcomes(passed=1)
    assert sentence(run(*words, "--gsvc-timeout", "soon")) == "--gsvc-timeout takes a number of seconds, not soon"


def test_an_id_that_no_vector_has_is_named_as_it_was_given(run, toy_module):
    assert "no vector matches gsvc::core/parse/nope" in sentence(
        run("--gsvc-module", toy_module(), "gsvc::core/parse/nope")
    )


def test_wrong_use_is_told_in_a_sentence(run, toy_module, pytester):
    name = toy_module()
    assert (
        sentence(run("--gsvc-operation", "halve"))
        == "say what golden vectors judge: --gsvc-module or --gsvc-impl or --gsvc-serve"
    )
    assert sentence(run(ID)) == "say what golden vectors judge: --gsvc-module or --gsvc-impl or --gsvc-serve"
    assert "only one of" in sentence(run("--gsvc-module", name, "--gsvc-impl", "x"))
    assert "the module no_such_module cannot be imported" in sentence(run("--gsvc-module", "no_such_module"))
    assert "did you mean halve?" in sentence(run("--gsvc-module", name, "--gsvc-operation", "halv"))
    assert "did you mean training?" in sentence(run("--gsvc-module", name, "--gsvc-class", "trainin"))
    assert "did you mean core/halve/one_to_six or" in sentence(
        run("--gsvc-module", name, "gsvc::core/halve/one_to_sixx")
    )
    assert "did you mean by_two?" in sentence(run("--gsvc-module", name, "--gsvc-case", "by_tow"))
    assert "--gsvc-timeout needs --gsvc-impl" in sentence(run("--gsvc-module", name, "--gsvc-timeout", "5"))
    file = pytester.makefile(".toml", known='[[waiver]]\nvectors = ["core/halve/one"]\nreason = "x"\n')
    assert "which matches no vector" in sentence(run("--gsvc-module", name, "--gsvc-waivers", str(file)))
    file.write_text("[[waiver]]\n")
    assert "waiver 1 of " in sentence(run("--gsvc-module", name, "--gsvc-waivers", str(file)))
    assert "there is no folder nowhere" in sentence(
        run("--gsvc-module", name, "--gsvc-vectors", "nowhere", vectors=False)
    )


def test_a_damaged_vector_is_told_without_a_traceback(run, toy_module, folder):
    (folder / "core/halve/one_to_six/values.npy").write_bytes(b"")
    result = run("-q", "--gsvc-module", toy_module())
    result.assert_outcomes(failed=1, passed=len(INPUTS) - 1)
    result.stdout.fnmatch_lines(["*values.npy is not the file that SHA256SUMS lists*"])
    result.stdout.no_fnmatch_line("*Traceback*")


def test_junit_of_pytest_has_a_test_a_vector(run, toy_module, pytester):
    run("-q", "--gsvc-module", toy_module(halve=wrong_halves), "--junitxml", "junit.xml")
    tests = {test.get("name"): test for test in ET.parse(pytester.path / "junit.xml").iter("testcase")}
    assert set(INPUTS) <= set(tests)
    assert tests["core/halve/one_to_six"].find("failure").get("message").startswith("output count is 0, expected 6")


MODULE = """
import numpy as np

def from_half(bits):
    return {"values": np.zeros(bits.shape, "f4")}
"""


@pytest.mark.exhaustive
def test_several_processes(pytester):
    """The real thing, in processes of its own: the results and causes of all come together."""
    pytest.importorskip("xdist")
    pytester.makepyfile(mine=MODULE, test_theirs="raise ImportError")
    loaded = [] if LOADED else ["-p", PLUGIN]
    words = [*loaded, "-n", "2", "-q", "--gsvc-module", "mine", "--gsvc-operation", "from_half"]
    result = pytester.runpytest_subprocess(*words)
    result.assert_outcomes(failed=3)
    result.stdout.fnmatch_lines([
        "Probable cause: an output that nothing was written to: every element is 0 (from_half: 3 of 3 examined)",
        "3 of 3 vectors ran: 3 fail*",
        "FAILED gsvc::core/from_half/subnormal_halves - output values is 0.0 at*",
    ])  # fmt: skip


def test_the_entry_point_names_the_plug_in():
    project = tomllib.loads((ROOT / "conformance" / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"]["pytest11"] == {"gsvc": PLUGIN}
    assert json.dumps(importlib.import_module(PLUGIN).OPTIONS)
