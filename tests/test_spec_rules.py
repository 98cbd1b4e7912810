"""Requirement ids and equations: what the code cites stands in spec.md, and what stands there is cited by the code."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
RULE = re.compile(r"\bR-(\d+)(?:\.\d+)*-\d+\b")
EQUATION = re.compile(r"\((\d+-\d+)\)")
LAST_OF_CODEC = 11
"""Requirements up to this section bind gsvc_ref and gsvc_tools, which cite them; the others are the kit's."""


def text(path):
    return path.read_text(encoding="utf-8")


def rules(*paths):
    return {found[0] for path in paths for found in RULE.finditer(text(path))}


def equations(*paths):
    return {found[1] for path in paths for found in EQUATION.finditer(text(path))}


def test_code_and_spec_name_the_same_rules():
    spec = ROOT / "spec.md"
    stated = {found[0] for found in RULE.finditer(text(spec)) if f"**{found[0]}**" in found.string}
    assert stated
    assert rules(spec) == stated
    cited = rules(*(path for home in ("base", "ref", "tools") for path in ROOT.glob(f"gsvc_{home}/**/*.py")))
    assert cited <= stated
    assert {rule for rule in stated if int(RULE.match(rule)[1]) <= LAST_OF_CODEC} <= cited
    assert cited | rules(*ROOT.glob("conformance/**/*.py")) == stated


def test_code_cites_the_equations_of_the_spec():
    spec = re.sub(r"^```python\n.*?^```$", "", text(ROOT / "spec.md"), flags=re.MULTILINE | re.DOTALL)
    stated = set(re.findall(r"^(?: {4}|\|).*? \((\d+-\d+)\)(?: \|.*)?$", spec, re.MULTILINE))
    assert equations(ROOT / "spec.md") == stated
    cited = equations(*ROOT.glob("gsvc_base/**/*.py"), *ROOT.glob("gsvc_ref/**/*.py"))
    assert cited == stated
    assert equations(*ROOT.glob("conformance/**/*.py")) <= stated
