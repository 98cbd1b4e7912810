import importlib
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import toy_operations
import toy_reports

from gsvc_conformance.verdicts import Report

USERS = (
    "vector", "verdicts", "vector_folder", "report.comparison", "operation", "commands.judging", "commands.list",
    "commands.verify",
    "reference", "implementations", "features", "pytest_vectors",
)  # fmt: skip
"""Modules that have `operations` by name."""


@pytest.fixture
def toys(monkeypatch) -> dict:
    """The toy operations in place of all others."""
    # All are imported first: one that is imported when another is changed already would keep the toys for ever.
    for module in [importlib.import_module(f"gsvc_conformance.{name}") for name in USERS]:
        monkeypatch.setattr(module, "operations", lambda: toy_operations.OPERATIONS)
    return toy_operations.OPERATIONS


@pytest.fixture
def report(toys) -> Report:
    """A report of them with every kind of result."""
    return toy_reports.toy_report()


@pytest.fixture
def folder(toys, tmp_path) -> Path:
    """Vectors of the toy operations."""
    return toy_operations.write_vectors(tmp_path / "vectors")


@pytest.fixture
def toy_module(monkeypatch) -> Callable[..., str]:
    """Puts functions into an importable module and returns its name."""

    def make(**changes) -> str:
        module = type(sys)("toy_implementation")
        vars(module).update({**toy_operations.REFERENCE, **changes})
        monkeypatch.setitem(sys.modules, module.__name__, module)
        return module.__name__

    return make
