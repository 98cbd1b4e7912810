"""The action for GitHub in conformance/action.yml: its steps run in bash as a runner runs them."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import toy_operations
import yaml

ROOT = Path(__file__).parents[2]
KIT = ROOT / "conformance"
ACTION = yaml.safe_load((KIT / "action.yml").read_text(encoding="utf-8"))
STEPS = {step["name"]: step for step in ACTION["runs"]["steps"]}
FILES = ("badge.json", "junit.xml", "report.html", "report.json", "summary.md")
GOOD = "def to_half(values):\n    return {'bits': values.astype('<f2').view('<u2')}\n"
WRONG = "def to_half(values):\n    return {'bits': (values * 0).astype('<u2')}\n"


def filled(text, values):
    """A text of the action with its expressions replaced."""
    return re.sub(r"\$\{\{ (.*?) \}\}", lambda found: values[found[1]], text)


def ran(name, folder, inputs, **environment):
    """A step of the action, run in a folder; unset inputs have their defaults."""
    step = STEPS[name]
    assert step["shell"] == "bash"
    given = {f"inputs.{key}": inputs.get(key, entry["default"]) for key, entry in ACTION["inputs"].items()}
    given["github.action_path"] = str(KIT)
    variables = {key: filled(text, given) for key, text in step["env"].items()}
    files = {"GITHUB_STEP_SUMMARY": str(folder / "summary.md"), "GITHUB_OUTPUT": str(folder / "outputs")}
    for path in files.values():
        Path(path).touch()
    return subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]],
        cwd=folder,
        env={**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", **files, **variables}
        | environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_every_input_is_used_and_every_expression_is_known():
    text = (KIT / "action.yml").read_text(encoding="utf-8")
    used = set(re.findall(r"inputs\.([a-z-]+)", text))
    assert used == set(ACTION["inputs"])
    known = {f"inputs.{name}" for name in used} | {"github.action_path", "steps.run.outputs.conclusion"}
    assert set(re.findall(r"\$\{\{ (.*?) \}\}", text)) <= known
    for step in STEPS.values():  # an expression in a script would run what an input says
        assert "${{" not in step.get("run", "")


def test_the_workflow_of_the_guide():
    guide = (ROOT / "docs" / "check-your-implementation.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"^```yaml\n(.*?)^```$", guide, re.MULTILINE | re.DOTALL)
    *_, step = yaml.safe_load(text)["jobs"]["gsvc"]["steps"]
    assert step["uses"].partition("@")[0] == "OWNER/gsvc_ref/conformance"
    assert set(step["with"]) <= set(ACTION["inputs"])


@pytest.mark.parametrize(
    ("code", "status", "conclusion"),
    [pytest.param(GOOD, 0, "passed", marks=pytest.mark.exhaustive), (WRONG, 1, "failed")],
)
def test_judging_a_module(tmp_path, code, status, conclusion):
    (tmp_path / "mine.py").write_text(code)
    inputs = {"module": "mine", "arguments": "--operation to_half --case *", "output": "reports of mine"}
    done = ran("Judge", tmp_path, inputs)
    assert done.returncode == status, done.stderr
    home = tmp_path / "reports of mine"
    assert sorted(path.name for path in home.iterdir()) == [*FILES]
    badge = json.loads((home / "badge.json").read_text())
    assert (badge["message"], badge["color"]) == (("to_half 0/6", "red") if status else ("to_half 6/6", "brightgreen"))
    assert (tmp_path / "summary.md").read_text().startswith("### GSVC conformance: mine\n")
    assert (tmp_path / "outputs").read_text() == f"conclusion={conclusion}\n"
    if status:
        assert ran("Judge", tmp_path, inputs).returncode == status
        assert (tmp_path / "summary.md").read_text().count("### GSVC conformance: mine\n") == 2  # of two steps


@pytest.mark.exhaustive
def test_a_waiver_that_is_not_needed_fails_if_it_is_to_be_strict(tmp_path):
    (tmp_path / "mine.py").write_text(GOOD)
    (tmp_path / "known.toml").write_text('[[waiver]]\nvectors = ["core/to_half/*"]\nreason = "none"\n')
    inputs = {"module": "mine", "arguments": "--operation to_half", "waivers": "known.toml"}
    assert ran("Judge", tmp_path, inputs).returncode == 0
    assert ran("Judge", tmp_path, inputs | {"strict-waivers": "true"}).returncode == 1


def test_judging_a_command_and_a_claim(tmp_path):
    program = toy_operations.write_program(tmp_path, "raise SystemExit(77)")
    done = ran("Judge", tmp_path, {"impl": program, "claim": "sizes,paper,1"})
    assert done.returncode == 1, done.stderr
    assert json.loads((tmp_path / "gsvc-conformance" / "report.json").read_text())["claim"] == "sizes,paper,1"


def test_wrong_use_fails_and_leaves_no_report_of_before(tmp_path):
    home = tmp_path / "gsvc-conformance"
    home.mkdir()
    (home / "report.json").write_text("{}")
    (home / "summary.md").write_text("before")
    done = ran("Judge", tmp_path, {"module": "no_such_module"})
    assert done.returncode == 2
    assert "no_such_module" in done.stderr
    assert (tmp_path / "outputs").read_text() == ""
    assert list(home.iterdir()) == []
    assert (tmp_path / "summary.md").read_text() == ""


@pytest.mark.exhaustive
def test_the_kit_of_the_same_ref_is_installed(tmp_path):
    site = tmp_path / "site"
    alone = {"PIP_TARGET": str(site), "PIP_NO_DEPS": "1", "PIP_NO_INDEX": "1", "PIP_NO_BUILD_ISOLATION": "0"}
    done = ran("Install the kit", tmp_path, {}, **alone)
    assert done.returncode == 0, done.stderr
    assert (site / "gsvc_conformance" / "commands" / "run.py").is_file()
    assert (site / "gsvc_conformance" / "report" / "page.js").is_file()
    done = ran("Install the kit", tmp_path, {"version": "9.9.9"}, **alone)
    assert done.returncode != 0
    assert "gsvc-conformance==9.9.9" in done.stderr
