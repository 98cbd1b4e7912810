"""The syntax tables are read as they are meant: what stands in what, and under which condition."""

import re

import pytest

pytest.importorskip("markdown_it", reason="markdown-it-py is one of the extra site")
pytest.importorskip("pygments", reason="Pygments is one of the extra site")

from gsvc_lab.site.__main__ import ROOT
from gsvc_lab.site.build import Site
from gsvc_lab.site.document import FENCED, SYNTAX, Part, parts_of
from gsvc_lab.site.syntax import Group, tables_of

TABLE = """
| thing(count) | descriptor |
|---|---|
| `first`, `second` (b) | `le(2)` each |
| if (`first` > 0) for (i = 0 .. count − 1) { `third` | `u(3)` |
|   if (`second` = 1) `fourth` | plane(count, 2^b) |
|   for (j = 0 .. min(`first`, count) − 1) `fifth`[j] } | `f16` |
| align() | |
"""


def outline(group):
    """A group as nested lists of labels, each list beginning with its condition."""
    return [group.condition, *(outline(one) if isinstance(one, Group) else one.label for one in group.content)]


def sizes(group):
    return [size for one in group.content for size in (sizes(one) if isinstance(one, Group) else [one.bits])]


def read(text):
    return tables_of([Part("6", "6 Syntax", "spec-6.html", text)])


def test_conditions_hold_what_stands_under_them():
    thing = read(TABLE)["thing"]
    assert outline(thing.group) == [
        "",
        "`first`",
        "`second` (b)",
        [
            "if (`first` > 0)",
            [
                "for (i = 0 .. count − 1)",
                "`third`",
                ["if (`second` = 1)", "`fourth`"],
                ["for (j = 0 .. min(`first`, count) − 1)", "`fifth`[j]"],
            ],
        ],
        "align()",
    ]
    assert sizes(thing.group) == [16, 16, 3, None, 16, None]


def test_a_bracket_that_is_never_closed_is_told():
    with pytest.raises(ValueError, match="never closed"):
        read(TABLE.replace(" } |", " |"))


def test_every_element_of_the_tables_has_a_box():
    parts = parts_of((ROOT / "spec.md").read_text(encoding="utf-8"))
    spec = next(FENCED.sub("", part.text) for part in parts if part.name == SYNTAX)
    page = Site(ROOT)._glance()
    labels = re.sub(r"<[^>]+>", "", " ".join(re.findall(r"<b>(.*?)</b>", page)))
    tables = re.findall(r"^\| \w+\([^|]*\) \| descriptor \|\n((?:\|.*\n)+)", spec, re.MULTILINE)
    assert len(tables) >= 8
    named = {
        name
        for table in tables
        for row in table.splitlines()
        for name in re.findall(r"`([a-z]+_\w+)`", re.sub(r"\((?:[^()]|\([^()]*\))*\)", "", row.split(" | ")[0]))
    }
    assert len(named) > 50
    assert [name for name in named if name not in labels] == []
