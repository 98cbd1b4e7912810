"""Requirement ids: what the code cites stands in spec.md, and what stands there is cited by the code."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
RULE = re.compile(r"\bR-(\d+)(?:\.\d+)*-\d+\b")
LAST_OF_CODEC = 11
"""Requirements up to this section are about what gsvc_ref computes, and it cites them; the others are the kit's."""


def rules(*paths):
    return {found[0] for path in paths for found in RULE.finditer(path.read_text(encoding="utf-8"))}


def test_code_and_spec_name_the_same_rules():
    spec = ROOT / "spec.md"
    stated = {
        found[0] for found in RULE.finditer(spec.read_text(encoding="utf-8")) if f"**{found[0]}**" in found.string
    }
    assert stated
    assert rules(spec) == stated
    cited = rules(*ROOT.glob("gsvc_ref/**/*.py"))
    assert cited <= stated
    assert {rule for rule in stated if int(RULE.match(rule)[1]) <= LAST_OF_CODEC} <= cited
    assert cited | rules(*ROOT.glob("conformance/**/*.py")) == stated
