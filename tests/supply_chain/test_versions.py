"""The minimum versions that pyproject.toml promises are those that `make lowest` installs."""

import re
import tomllib
from pathlib import Path

import pytest

from tests.conftest import depends_on_versions

ROOT = Path(__file__).parents[2]
PROJECT, KIT = (
    tomllib.loads((ROOT / home / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for home in ("", "conformance")
)
REQUIREMENT = re.compile(r"(?P<name>[a-z0-9_-]+)(?:\[.*\])?(?P<relation>[<>=!~]*)(?P<version>[0-9.]*)", re.IGNORECASE)

PINNED = {"lint", "clips", "peers"}
"""Extras that state one version: of tools whose opinions change, of files, and of what numbers are compared with."""


def required(project: dict, *, extras: set[str]) -> dict[str, tuple[str, str]]:
    """Relation and version by package, without our own."""
    lines = [*project["dependencies"]] if "core" in extras else []
    for extra in extras - {"core"}:
        lines += project["optional-dependencies"][extra]
    found = [REQUIREMENT.fullmatch(line) for line in lines if not line.startswith(("gsvc_ref", "gsvc-conformance"))]
    assert all(found), lines
    return {match["name"]: (match["relation"], match["version"]) for match in found if match}


def version(text: str) -> tuple[int, ...]:
    numbers = [int(part) for part in text.split(".")]
    return tuple(numbers + [0] * (3 - len(numbers)))


def test_everything_that_is_not_pinned_has_a_tested_minimum() -> None:
    open_ended = {"core", *PROJECT["optional-dependencies"]} - PINNED
    needed = required(PROJECT, extras=open_ended)
    of_the_kit = required(KIT, extras={"core", *KIT["optional-dependencies"]})
    assert all(needed.setdefault(name, minimum) == minimum for name, minimum in of_the_kit.items())
    assert {relation for relation, _ in needed.values()} == {">="}
    lines = (Path(__file__).parent / "lowest.txt").read_text(encoding="utf-8").splitlines()
    lowest = dict(line.split("==") for line in lines if not line.startswith("#"))
    tested = {name: version(lowest[name]) for name in lowest}
    assert tested == {name: version(minimum) for name, (_, minimum) in needed.items()}


def test_what_is_pinned_is_pinned_to_one_version() -> None:
    assert {relation for relation, _ in required(PROJECT, extras=PINNED).values()} == {"=="}


@pytest.mark.parametrize(
    ("name", "depends"),
    [
        ("rendering/test_deterministic.py", True),  # a room of kernels
        ("tools/jobs/test_cluster.py", True),  # imports distributed
        ("tools/jobs/test_resume.py", False),
        ("test_arrows.py", False),
    ],
)
def test_the_lowest_versions_run_what_depends_on_them(name: str, depends: bool) -> None:
    assert depends_on_versions(ROOT / "tests" / name) == depends
