"""What Python programs use of the kit: its docstrings and the chapter of protocol.md are run."""

import doctest
import io
import re
import subprocess
import sys
import tomllib
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest

import gsvc_conformance
from gsvc_base.errors import UsageError
from gsvc_conformance import Result, Vector, assert_vector, diagnose, judge, vectors
from gsvc_conformance.pytest_plugin import OPTIONS
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector_folder import VectorFolder
from gsvc_conformance.waivers import KEYS, read_waivers

ROOT = Path(__file__).parents[2]
PROTOCOL = (ROOT / "conformance" / "protocol.md").read_text(encoding="utf-8")


def chapter(name):
    return PROTOCOL.partition(f"\n## {name}\n")[2].partition("\n## ")[0]


def blocks(name, kind):
    found = re.findall(r"^```(\w*)\n(.*?)^```$", chapter(name), re.MULTILINE | re.DOTALL)
    return [text for kind_of, text in found if kind_of == kind]


def halves(vector):
    return {"values": vector.inputs["bits"].view("f2").astype("f4")}


@pytest.mark.parametrize("name", [name for name in gsvc_conformance.__all__ if name[0].islower()])
def test_the_examples_of_docstrings(name):
    (test,) = doctest.DocTestFinder(recurse=False).find(getattr(gsvc_conformance, name), name, globs={})
    assert len(test.examples) >= 3
    assert doctest.DocTestRunner().run(test).failed == 0


def test_the_chapter_from_python():
    (code,), (printed,) = blocks("From Python", "python"), blocks("From Python", "")
    out = io.StringIO()
    with redirect_stdout(out):
        exec(code, {})
    assert out.getvalue() == printed
    for name in re.findall(r"^\| `(\w+)\(", chapter("From Python"), re.MULTILINE):
        assert name in gsvc_conformance.__all__


def test_the_chapter_from_pytest():
    text = chapter("From pytest")
    assert set(re.findall(r"--gsvc-(\w+)", text)) == set(OPTIONS)
    (configuration,) = blocks("From pytest", "toml")
    assert tomllib.loads(configuration)["tool"]["pytest"]["ini_options"]["addopts"]
    named = re.findall(r"gsvc::([\w/*]+)", text)
    assert len(named) > 2
    VectorFolder(VECTORS).check_patterns("gsvc::", tuple(named))


def test_the_chapter_on_waivers(tmp_path):
    (example,) = blocks("Waivers", "toml")
    file = tmp_path / "known.toml"
    file.write_text(example, encoding="utf-8")
    waivers = read_waivers(file)
    assert waivers.unmatched(VectorFolder(VECTORS).names) == []
    assert re.findall(r"^\| `(\w+)` \|", chapter("Waivers"), re.MULTILINE) == list(KEYS)


def test_the_import_of_the_package_is_light():
    code = "import sys, gsvc_conformance; print(*(name for name in sys.modules if name.startswith(('gsvc', 'numpy'))))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.split() == ["gsvc_conformance"]
    assert set(gsvc_conformance.__all__) <= set(dir(gsvc_conformance))
    with pytest.raises(AttributeError, match="no attribute 'judgement'"):
        _ = gsvc_conformance.judgement


def test_vectors_are_chosen():
    assert {vector.operation.name for vector in vectors(group="reconstruction", case="core/*")} > {
        "from_half",
        "to_half",
    }
    assert [vector.tier for vector in vectors("from_half", tier="stress")] == ["stress"]
    first = next(vectors("from_half"))
    assert isinstance(first, Vector)
    assert first.title
    with pytest.raises(UsageError, match=r"there is no operation 'from_hal'; did you mean from_half"):
        vectors("from_hal")
    with pytest.raises(UsageError, match="no vector matches"):
        vectors(case="unicorn")
    with pytest.raises(UsageError, match="no vector is selected by class renderin"):
        vectors(group="renderin")
    with pytest.raises(UsageError, match="there is no folder nowhere"):
        vectors(folder="nowhere")


def test_a_judgement_says_what_is_wrong():
    vector = next(vectors("from_half"))
    good = judge(vector, halves(vector))
    assert isinstance(good, Result)
    assert (good.passed, good.outcome, good.message) == (True, "pass", "")
    bad = judge(vector, {"values": halves(vector)["values"] + np.float32(1)})
    assert (bad.passed, bad.outcome) == (False, "fail")
    assert judge(vector, {}).message == "from_half returned no values"
    assert judge(vector, {}).outcome == "error"
    assert_vector(vector, halves(vector))
    with pytest.raises(AssertionError, match=f"FAIL {vector.id}: .*\n  output values is "):
        assert_vector(vector, {"values": halves(vector)["values"] + np.float32(1)})


def test_a_diagnosis_is_of_what_is_wrong():
    chosen = list(vectors("from_half"))
    assert diagnose((vector, halves(vector)) for vector in chosen) == []
    nothing = [(vector, {"values": np.zeros_like(halves(vector)["values"])}) for vector in chosen]
    assert diagnose(nothing) == [
        "an output that nothing was written to: every element is 0 (from_half: 3 of 3 examined)"
    ]
