"""Adapters are independent implementations; to see that, their packages need not be there."""

from pathlib import Path

import pytest

ADAPTERS = Path(__file__).parents[2] / "conformance" / "gsvc_conformance" / "adapters"
NAMES = sorted(path.parent.name for path in ADAPTERS.glob("*/__init__.py"))


@pytest.mark.parametrize("name", NAMES)
def test_an_adapter_imports_nothing_of_the_project_but_adapters(imported_by, name):
    modules = imported_by(name)
    assert modules
    ours = {
        module
        for module in modules
        if module.partition(".")[0] in {"gsvc_base", "gsvc_ref", "gsvc_conformance", "tests"}
    }
    assert all(
        module == "gsvc_conformance.adapters" or module.startswith("gsvc_conformance.adapters.") for module in ours
    )


def test_the_package_says_what_each_adapter_is():
    text = (ADAPTERS / "__init__.py").read_text(encoding="utf-8")
    assert sorted(line.split()[0] for line in text.splitlines() if line.startswith("    ")) == NAMES
