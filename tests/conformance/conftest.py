import importlib
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import toy_stages

USERS = (
    "vectors", "results", "selection", "report.comparison", "commands", "commands.list", "commands.verify", "reference",
    "implementations",
)  # fmt: skip
"""Modules that have `stages` by name."""


@pytest.fixture
def toys(monkeypatch) -> dict:
    """The toy stages in place of all others."""
    for name in USERS:
        monkeypatch.setattr(importlib.import_module(f"conformance.{name}"), "stages", lambda: toy_stages.STAGES)
    return toy_stages.STAGES


@pytest.fixture
def folder(toys, tmp_path) -> Path:
    """Vectors of the toy stages."""
    return toy_stages.write_vectors(tmp_path / "vectors")


@pytest.fixture
def toy_module(monkeypatch) -> Callable[..., str]:
    """Puts functions into an importable module and returns its name."""

    def make(**changes) -> str:
        module = type(sys)("toy_implementation")
        vars(module).update({**toy_stages.REFERENCE, **changes})
        monkeypatch.setitem(sys.modules, module.__name__, module)
        return module.__name__

    return make
