"""docs/tour.md: its paths and names exist, its table has the rooms in the order of their use, its pixel is right."""

import ast
import re
from functools import cache
from itertools import chain
from pathlib import Path

import numpy as np
import pytest

import gsvc_ref
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, write_stream

ROOT = Path(__file__).parents[1]
TOUR = ROOT / "docs" / "tour.md"
TEXT = TOUR.read_text(encoding="utf-8")
LINKS = re.findall(r"\[([^\]]*)\]\(([^)]*)\)", TEXT)


@cache
def defined(path):
    """The names of a module: functions, classes, `Class.method`, and what it assigns."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.ClassDef):
            names |= {
                node.name,
                *(f"{node.name}.{part.name}" for part in node.body if isinstance(part, ast.FunctionDef)),
            }
        elif isinstance(node, ast.AnnAssign | ast.Assign):
            targets = [node.target] if isinstance(node, ast.AnnAssign) else node.targets
            names |= {target.id for target in targets if isinstance(target, ast.Name)}
    return names


@pytest.mark.parametrize(("words", "target"), LINKS)
def test_what_is_linked_exists(words, target):
    path = (TOUR.parent / target.partition("#")[0]).resolve()
    assert path.exists(), f"docs/tour.md: there is no {target}"
    name = re.fullmatch(r"`([\w.]+)`", words)
    if name:
        assert name[1] in defined(path), f"docs/tour.md: {target} has no {name[1]}"
    elif "/" in words:
        assert path == ROOT / words


def test_names_without_a_link_stand_beside_one():
    linked = {words.strip("`").split(".")[-1] for words, _ in LINKS}
    plain = set(re.findall(r"(?<!\[)`([a-z]+_[a-z_]+)`", TEXT))
    assert plain - linked <= {"adan_step"}  # the function of spec.md


def rooms():
    """The rooms of the table's rows, from the top down."""
    table = TEXT[TEXT.index("| room |") :].partition("\n\n")[0]
    rows = [
        re.findall(r"\]\(\.\./(?:conformance/)?([\w/]+)\)", row.split("|")[1]) for row in table.splitlines()[2:] if row
    ]
    return [[room.replace("/", ".") for room in row] for row in rows]


def imported(path):
    """The modules that a file imports, wherever in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_every_room_of_the_package_is_in_the_table():
    packages = {f"gsvc_ref.{path.parent.name}" for path in ROOT.glob("gsvc_ref/*/__init__.py")}
    others = {"gsvc_base", "gsvc_ref", "gsvc_tools", "gsvc_lab", "gsvc_conformance", "viewer"}
    assert packages | others == set(chain(*rooms()))


def test_rooms_use_those_above_them():
    levels = {room: level for level, row in enumerate(rooms()) for room in row}
    upward = []
    for room, level in levels.items():
        if room in ("gsvc_ref", "viewer"):  # gsvc_ref/__init__.py names what the rooms offer
            continue
        for path in ROOT.glob(f"{room.replace('.', '/')}/**/*.py"):
            for module in imported(path):
                used = max((other for other in levels if f"{module}.".startswith(f"{other}.")), key=len, default=None)
                if used not in (None, "gsvc_ref", room) and levels[used] > level:
                    upward.append(f"{path.relative_to(ROOT)} uses {module}")
    assert upward == []


def test_the_pixel_of_the_tour():
    stream = write_stream(OVERVIEW_HEADER, overview_frames(), index=False)
    pixel = next(gsvc_ref.decode(stream))[4, 6]
    assert f"({', '.join(map(str, pixel))})." in TEXT
    g = np.exp(-1 / 32)
    assert f"g = {g:.5f}" in TEXT
    assert np.rint(255 * g * np.array([0.75, 0.5, 0.25])).tolist() == pixel.tolist()
