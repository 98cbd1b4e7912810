"""protocol.md and its examples: what stands there is true, complete, and works; manifests follow their schema."""

import ast
import json
import re
import shutil
import subprocess
import sys
from dataclasses import fields, replace
from itertools import islice
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from toy_operations import INPUTS

from gsvc_conformance import server
from gsvc_conformance.case import of_operation
from gsvc_conformance.commands.list import BEGIN, END, markdown
from gsvc_conformance.commands.run import TIMEOUT
from gsvc_conformance.diagnosis import EXAMINED
from gsvc_conformance.expectations import Exact
from gsvc_conformance.features import Features, read_features
from gsvc_conformance.implementations import Failure, ModuleImplementation, Unsupported, load_module
from gsvc_conformance.operation import operations
from gsvc_conformance.process import EXIT_UNSUPPORTED, MAX_BYTES, ProcessImplementation
from gsvc_conformance.report.console import CONCLUSIONS
from gsvc_conformance.results import OUTCOMES
from gsvc_conformance.runner import judge_vector, run_suite
from gsvc_conformance.server import ServerImplementation
from gsvc_conformance.streams import PARTS
from gsvc_conformance.vector import VECTORS, Vector, files_of, from_files
from gsvc_conformance.vector_folder import SCHEMA, matches
from gsvc_conformance.verdicts import EXIT_CODES, Verdict

ROOT = Path(__file__).parents[2]
PROTOCOL = (ROOT / "conformance" / "protocol.md").read_text(encoding="utf-8")
EXAMPLES = ROOT / "conformance" / "examples"


def test_the_table_of_operations_is_that_of_the_code():
    between = PROTOCOL.partition(BEGIN)[2].partition(END)[0].strip()
    assert between == markdown(VECTORS), "write it again: gsvc-conformance list --markdown conformance/protocol.md"


@pytest.mark.parametrize("name", ["minimal.c", "minimal.py"])
def test_examples_are_quoted_in_full(name):
    assert f"```{name.partition('.')[2].replace('py', 'python')}\n{(EXAMPLES / name).read_text()}```" in PROTOCOL


def test_the_example_in_python_runs_where_old_code_does():
    """Its syntax is that of Python 3.8; annotations are not evaluated, and no operator there is newer than that."""
    tree = ast.parse((EXAMPLES / "minimal.py").read_text(encoding="utf-8"), feature_version=(3, 8))
    assert any(isinstance(node, ast.ImportFrom) and node.module == "__future__" for node in tree.body)
    assert not any(isinstance(node, ast.BitOr) for node in ast.walk(tree))  # of dicts, since Python 3.9
    hints = {
        hint for node in ast.walk(tree) for hint in (getattr(node, "annotation", None), getattr(node, "returns", None))
    }
    evaluated = list(ast.walk(Unannotated(hints).visit(tree)))
    names = [
        node.value.id for node in evaluated if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name)
    ]
    assert names
    assert not set(names) & {"dict", "list", "tuple", "set", "Callable"}


class Unannotated(ast.NodeTransformer):
    """Takes annotations out of a tree."""

    def __init__(self, hints) -> None:
        self._hints = hints

    def visit(self, node):
        return None if node in self._hints else super().visit(node)


def test_what_the_protocol_says_of_the_code():
    for outcome in OUTCOMES:
        assert f"| {outcome} |" in PROTOCOL
    assert f"| {EXIT_UNSUPPORTED} |" in PROTOCOL
    assert MAX_BYTES == 256 << 20
    assert "256 MiB" in PROTOCOL
    for command in re.findall(r"gsvc-conformance (\w+)", PROTOCOL):
        assert (ROOT / "conformance" / "gsvc_conformance" / "commands" / f"{command}.py").is_file()


def test_what_the_protocol_says_of_servers():
    chapter = PROTOCOL.partition("\n## A server\n")[2].partition("\n## ")[0]
    texts = (
        f"`--start-timeout` seconds ({server.START_S:g})", f"`--timeout` seconds ({TIMEOUT:g})",
        f"has {server.END_S:g} seconds to end", f"{server.MAX_LINE >> 10} KiB long", f"{server.MAX_REQUEST} bytes long",
    )  # fmt: skip
    for text in texts:
        assert text in chapter
    assert (server.STARTS, "three times in a row" in chapter) == (3, True)
    hello, request, answer = map(
        json.loads, re.findall(r"^\| (?:hello|request|answer) .*`({.*})` \|$", chapter, re.MULTILINE)
    )
    assert hello["gsvc"] == server.PROTOCOL
    assert list(request) == ["id", "operation", "in", "out"]
    assert answer["status"] in server.STATUSES
    for status in server.STATUSES:
        assert f"`{status}`" in chapter


def test_the_features_of_the_protocol_can_be_read(tmp_path):
    (text,) = re.findall(r"```toml\n(# features.toml.*?)```", PROTOCOL, re.DOTALL)
    (tmp_path / "features.toml").write_text(text)
    given = read_features(tmp_path / "features.toml").to_object()
    assert list(given) == [field.name for field in fields(Features)]


def test_vectors_that_documents_name_exist():
    """Ids, and the patterns of --case and --skip."""
    ids = ["/".join(path.parts[-4:-1]) for path in VECTORS.glob("*/*/*/manifest.json")]
    for text in (PROTOCOL, (ROOT / "README.md").read_text(encoding="utf-8")):
        named = re.findall(r"(?:core|uncommon|stress|faulty)/\w+/[\w*?]+", text)
        named += re.findall(r"--(?:case|skip) '?([^'`\s]+)", text)
        for name in set(named) - {"GLOB"}:
            assert any(matches(vector, vector.split("/")[2], patterns=(name,)) for vector in ids), name
    assert re.search(r"--case '\S+'", PROTOCOL)


def test_requirements_that_the_protocol_selects_by_have_vectors():
    known = [json.loads(path.read_text()) for path in VECTORS.glob("*/*/*/manifest.json")]
    for option, field in (("rule", "rules"), ("equation", "equations"), ("flag", "flags")):
        (value,) = re.findall(rf"`--{option} ([^`]+)`", PROTOCOL)
        assert any(value in manifest[field] for manifest in known), value


def test_the_protocol_says_what_a_run_can_come_to():
    assert f"in {EXAMINED} failures" in PROTOCOL.replace("\n", " ")
    for name, (words, _) in CONCLUSIONS.items():
        assert f"| {words.upper()} | {EXIT_CODES[name]} |" in PROTOCOL
    assert f"| NOTHING IS WRONG | {EXIT_CODES['incomplete']} |" in PROTOCOL
    for verdict in get_args(Verdict):
        assert f"- **{verdict}** if" in PROTOCOL
    for part in PARTS:
        assert f"`NAME.{part}.npy`" in PROTOCOL


# Examples


@pytest.fixture(scope="session")
def compiled(tmp_path_factory) -> str:
    """minimal.c, compiled without a warning."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("there is no C compiler")
    program = tmp_path_factory.mktemp("example") / "minimal"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2"]
    subprocess.run([compiler, *flags, "-o", str(program), str(EXAMPLES / "minimal.c"), "-lm"], check=True)
    return str(program)


def test_the_example_in_c_compiles_as_c_plus_plus(tmp_path):
    compiler = shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        pytest.skip("there is no C++ compiler")
    flags = ["-x", "c++", "-std=c++11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only"]
    subprocess.run([compiler, *flags, str(EXAMPLES / "minimal.c")], check=True)


@pytest.fixture
def python() -> str:
    return f"{sys.executable} {EXAMPLES / 'minimal.py'}"


@pytest.fixture
def module(monkeypatch) -> ModuleImplementation:
    monkeypatch.syspath_prepend(EXAMPLES)
    return load_module("minimal")


@pytest.fixture(params=["module", "compiled", "python", "compiled --serve", "python --serve"])
def example(request):
    """The example in Python as a module, and each example as a command and as a server."""
    name, _, option = request.param.partition(" ")
    found = request.getfixturevalue(name)
    if isinstance(found, ModuleImplementation):
        yield found
    elif option:
        with ServerImplementation(f"{found} {option}", 60) as served:
            yield served
    else:
        yield ProcessImplementation(found, 60)


def vector(operation, inputs, expected) -> Vector:
    return Vector(f"core/{operation}/x", {"title": "x"}, operations()[operation], inputs, expected)


@pytest.mark.parametrize("count", [0, 1, 63488])
def test_examples_read_half_precision(example, count):
    bits = np.arange(65536, dtype="<u2")
    bits = bits[~np.isnan(bits.view("<f2"))][::-1][:count].copy()
    expected = {"values": Exact(bits.view("<f2").astype("<f4"))}
    result = judge_vector(example, vector("from_half", {"bits": bits}, expected)).result
    assert result.outcome == "pass", result.message


@pytest.mark.parametrize("count", [0, 9])
def test_examples_render(example, count):
    rng = np.random.default_rng(20)
    parameters = rng.uniform((0, 0, 0.5, -3, 0.5, -1, -1, -1), (21, 13, 5, 3, 5, 1, 1, 1), (count, 8)).astype("<f4")
    if count:
        parameters[3, 2] = 0  # degenerate: covers nothing
        parameters[4, 4] = 1e-40
    inputs = {"parameters": parameters, "width": 21, "height": 13}
    result = judge_vector(example, vector("render_sum", inputs, operations()["render_sum"].oracle(**inputs))).result
    assert result.outcome == "pass", result.message


def test_examples_do_not_support_other_operations(example):
    assert isinstance(example.run(operations()["metrics"], {"bit_depth": 8}), Unsupported)


def test_served_examples_are_asked_again_and_again(example):
    """Sizes that grow and shrink, so that memory of the request before would show."""
    for size in (3, 200, 1):
        inputs = {
            "parameters": np.tile(np.float32([4, 4, 2, 0.5, 2, 1, 0.5, 0.25]), (size % 7, 1)),
            "width": size,
            "height": 5,
        }
        expected = operations()["render_sum"].oracle(**inputs)
        assert judge_vector(example, vector("render_sum", inputs, expected)).result.outcome == "pass"


@pytest.mark.parametrize("example", ["python --serve"], indirect=True)
def test_the_python_server_tells_of_its_errors_and_goes_on(example):
    for _ in range(2):
        answer = example.run(operations()["from_half"], {})
        assert isinstance(answer, Failure)
        assert "missing 1 required positional argument" in answer.message
    assert example.environment == {"NumPy": np.__version__}


# Manifests


def validator() -> Draft202012Validator:
    return Draft202012Validator(json.loads(SCHEMA.read_text(encoding="utf-8")))


def objects(schema):
    """All parts of a schema that describe objects."""
    if isinstance(schema, dict):
        if schema.get("type") == "object":
            yield schema
        for part in schema.values():
            yield from objects(part)
    elif isinstance(schema, list):
        for part in schema:
            yield from objects(part)


def test_the_schema_is_one_and_lets_nothing_else_in():
    schema = validator().schema
    Draft202012Validator.check_schema(schema)
    found = list(objects(schema))
    assert len(found) > 5
    for part in found:
        assert "additionalProperties" in part
        assert part["additionalProperties"] is False or "propertyNames" in part


def test_manifests_follow_the_schema(folder):
    for name in INPUTS:
        assert list(validator().iter_errors(json.loads((folder / name / "manifest.json").read_text()))) == []


CHANGES = {
    "another field": lambda m: m.update(more=1),
    "no title": lambda m: m.pop("title"),
    "empty title": lambda m: m.update(title=""),
    "id of another form": lambda m: m.update(id="core/scale"),
    "id in a tier that is none": lambda m: m.update(id="easy/scale/by_two"),
    "tier that is none": lambda m: m.update(tier="easy"),
    "no level": lambda m: m.pop("level"),
    "level that is none": lambda m: m.update(level=6),
    "no outputs": lambda m: m.update(outputs={}),
    "class that is none": lambda m: m.update({"class": "sound"}),
    "twice the same rule": lambda m: m.update(rules=["R-3.1-1", "R-3.1-1"]),
    "input with more": lambda m: m["inputs"]["factor"].update(unit="px"),
    "path that leaves the folder": lambda m: m["inputs"]["values"].update(file="../values.npy"),
    "dtype of objects": lambda m: m["inputs"]["values"].update(dtype="|O"),
    "big-endian": lambda m: m["inputs"]["values"].update(dtype=">f4"),
    "hash cut short": lambda m: m["inputs"]["values"].update(sha256="00"),
    "no bound": lambda m: m["outputs"]["scaled"].pop("bound"),
    "bounds of another model": lambda m: m["outputs"]["scaled"].update(model="fp16/1"),
    "check that is none": lambda m: m["outputs"]["scaled"].update(check="fuzzy"),
    "field of another check": lambda m: m["outputs"]["scaled"].update(guard=1.0),
    "half a fault": lambda m: m.update(fault={"lie": "x"}),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_manifest_with_something_wrong_does_not(folder, change):
    manifest = json.loads((folder / "core/scale/by_two/manifest.json").read_text())
    change(manifest)
    assert list(validator().iter_errors(manifest))


@pytest.mark.parametrize(
    "value", ["malformed", "broken R-6.2-2 412", "malformed R-6.2-2", "malformed R-6.2-2 412 more"]
)
def test_a_refusal_has_kind_rule_and_bit(folder, value):
    manifest = json.loads((folder / "faulty/parse/bad_letter/manifest.json").read_text())
    assert not list(validator().iter_errors(manifest))
    manifest["outputs"]["error"]["value"] = value
    assert list(validator().iter_errors(manifest))


def test_jobs_change_the_time_alone(python):
    cases = [from_files(files_of(case, *case.run())) for case in islice(of_operation("from_half"), 2)]
    cases += [from_files(files_of(case, *case.run())) for case in islice(of_operation("render_sum"), 4)]
    one, many = (run_suite(ProcessImplementation(python, 60), cases, jobs=jobs) for jobs in (1, 3))
    assert [(result.id, result.outcome) for result in many] == [(vector.id, "pass") for vector in cases]
    assert [replace(result, seconds=0) for result in one] == [replace(result, seconds=0) for result in many]
