"""Each room of docs/tour.md keeps its budget of lines of Python."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TOUR = ROOT / "docs" / "tour.md"
ROW = re.compile(r"^\| (\[.*) \| .* \| ([\d,]+(?:, [\d,]+)*) \|$", re.MULTILINE)


def budgets():
    """The folder of each room with the lines that it may have."""
    for cells, numbers in ROW.findall(TOUR.read_text(encoding="utf-8")):
        folders = re.findall(r"\]\(\.\./([\w/]+)\)", cells)
        yield from zip(folders, (int(n.replace(",", "")) for n in numbers.split(", ")), strict=True)


BUDGETS = dict(budgets())


def lines_of(room):
    """Lines of Python of a room, without those of rooms that stand in it: of gsvc_ref itself just its own files."""
    inner = [ROOT / other for other in BUDGETS if other.startswith(f"{room}/")]
    files = [path for path in (ROOT / room).rglob("*.py") if not any(path.is_relative_to(home) for home in inner)]
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)


@pytest.mark.parametrize("room", BUDGETS)
def test_a_room_keeps_its_budget(room):
    lines = lines_of(room)
    assert lines <= BUDGETS[room], f"{room} has {lines:,} lines; docs/tour.md gives it {BUDGETS[room]:,}"


def test_every_room_with_code_has_a_budget():
    packages = {path.parent for path in (*ROOT.glob("gsvc_*/__init__.py"), *ROOT.glob("gsvc_ref/*/__init__.py"))}
    assert packages <= {ROOT / room for room in BUDGETS}
