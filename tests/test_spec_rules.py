"""Requirement ids: what the code cites stands in spec.md, and what stands there is cited by the code."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
RULE = re.compile(r"\bR-\d+(?:\.\d+)*-\d+\b")


def rules(*paths):
    return {rule for path in paths for rule in RULE.findall(path.read_text(encoding="utf-8"))}


def test_code_and_spec_name_the_same_rules():
    spec = ROOT / "spec.md"
    stated = set(re.findall(r"\*\*(R-\d+(?:\.\d+)*-\d+)\*\*", spec.read_text(encoding="utf-8")))
    assert stated
    assert rules(spec) == stated
    assert rules(*ROOT.glob("gsvc_ref/**/*.py")) == stated
