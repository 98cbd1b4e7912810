"""Imports point one way, those in functions and for types too: no circles of modules or rooms, no package above."""

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BESIDE = ("gsvc_base", "gsvc_ref", "gsvc_tools", "gsvc_lab")
PACKAGES = {**dict.fromkeys(BESIDE, ROOT), "gsvc_conformance": ROOT / "conformance"}
"""The folder that each package lies in."""
MAKING = ("gsvc_conformance.cases.", "gsvc_conformance.streams")
"""Beginnings of the names of the kit's modules that make vectors and streams."""
ROOMS = (
    "cli", "encoder", "stream", "training", "bitstream", "paper",
)  # fmt: skip
"""The codec's way from a command to a number, from the top down."""


def home_of(path):
    """The folder that the package of a file lies in."""
    return next(home for package, home in PACKAGES.items() if path.is_relative_to(home / package))


def name_of(path):
    """The dotted name of a module."""
    parts = path.relative_to(home_of(path)).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for package, home in PACKAGES.items() for path in sorted((home / package).rglob("*.py"))}


def is_for_types(node):
    """Whether a node is ``if TYPE_CHECKING:``, whose imports never run."""
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id.endswith("TYPE_CHECKING")


def imported(tree, *, when_loaded=False):
    """Modules that code imports: when it is loaded, in functions, and for types; or only `when_loaded`."""
    for node in ast.iter_child_nodes(tree):
        if when_loaded and (is_for_types(node) or isinstance(node, ast.FunctionDef)):
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in MODULES else node.module
        yield from imported(node, when_loaded=when_loaded)


@cache
def arrows():
    """The modules of the project that each of its modules imports."""
    found = {name: {*imported(ast.parse(path.read_text(encoding="utf-8")))} for name, path in MODULES.items()}
    return {name: {other for other in others if other in MODULES and other != name} for name, others in found.items()}


def room_of(module):
    """The package, and the folder in it, that a module lies in."""
    path = MODULES[module].relative_to(home_of(MODULES[module]))
    return ".".join(path.parts[:2]) if len(path.parts) > 2 else ".".join(path.with_suffix("").parts)


def circle(graph):
    """One circle of a graph, or nothing."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_modules_import_in_no_circle():
    assert circle(arrows()) == []


def test_rooms_import_in_no_circle():
    rooms = {}
    for module, others in arrows().items():
        rooms.setdefault(room_of(module), set()).update(room_of(other) for other in others)
    assert circle({room: others - {room} for room, others in rooms.items()}) == []


@pytest.mark.parametrize(
    ("package", "not_allowed"),
    [
        ("gsvc_base", ("gsvc_ref", "gsvc_tools", "gsvc_lab", "gsvc_conformance")),
        ("gsvc_ref", ("gsvc_tools", "gsvc_lab", "gsvc_conformance")),
        ("gsvc_tools", ("gsvc_lab", "gsvc_conformance")),
        ("gsvc_lab", ("gsvc_conformance",)),
        ("gsvc_conformance", ("gsvc_lab",)),
    ],
)
def test_packages_import_only_those_below(package, not_allowed):
    wrong = [
        (module, other)
        for module, others in arrows().items()
        for other in others
        if module.partition(".")[0] == package and other.partition(".")[0] in not_allowed
    ]
    assert wrong == []


def test_what_judges_is_loaded_without_the_codec():
    """Of the kit, what makes vectors and streams imports gsvc_ref when it is loaded; all else does so in functions."""
    making = {name for name in MODULES if name.startswith(MAKING)}
    wrong = [
        (module, other)
        for module, path in MODULES.items()
        if module.startswith(("gsvc_base", "gsvc_conformance")) and module not in making
        for other in imported(ast.parse(path.read_text(encoding="utf-8")), when_loaded=True)
        if other in making or other.startswith(("gsvc_ref", "gsvc_tools", "gsvc_lab"))
    ]
    assert wrong == []
    assert len(making) > 50


def test_what_ships_needs_nothing_that_stays_in_the_checkout():
    """pyproject.toml leaves these out of the wheel."""
    left_out = ("gsvc_lab.experiments", "gsvc_lab.benchmarks", "gsvc_lab.site")
    wrong = [
        (module, other)
        for module, others in arrows().items()
        for other in others
        if module.startswith(BESIDE) and not module.startswith(left_out) and other.startswith(left_out)
    ]
    assert wrong == []


def test_rooms_of_the_codec_import_only_those_below():
    order = {f"gsvc_ref.{room}": place for place, room in enumerate(ROOMS)}
    wrong = [
        (module, other)
        for module, others in arrows().items()
        for other in others
        if order.get(room_of(module), -1) > order.get(room_of(other), len(ROOMS))
    ]
    assert wrong == []
    assert all(MODULES[f"gsvc_ref.{room}"].exists() for room in ROOMS)


def test_a_circle_is_found():
    names = ["a", "b", "c", "a"]
    assert set(circle({name: {other} for name, other in pairwise(names)})) == {"a", "b", "c"}
