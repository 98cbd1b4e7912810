"""The syntax tables are read as they are meant: what stands in what, and under which condition."""

import re

import pytest

pytest.importorskip("markdown_it", reason="markdown-it-py is one of the extra site")
pytest.importorskip("pygments", reason="Pygments is one of the extra site")

from gsvc_lab.site.__main__ import ROOT
from gsvc_lab.site.build import Site
from gsvc_lab.site.document import FENCED, SYNTAX, parts_of
from gsvc_lab.site.syntax import Group, tables_of

SYNTAX_DATA = {
    "structures": [
        {
            "name": "thing",
            "parameters": ["count"],
            "elements": [
                {"name": "first", "descriptor": "le(2)", "within": []},
                {"name": "second", "descriptor": "le(2)", "within": [], "symbol": "b"},
                {"name": "third", "descriptor": "u(3)", "within": [{"if": "first > 0"}, {"for": "each entry"}]},
                {
                    "name": "fourth",
                    "descriptor": "uv",
                    "within": [{"if": "first > 0"}, {"for": "each entry"}, {"if": "x"}],
                },
                {"name": "fifth", "descriptor": "f16", "within": [{"if": "first > 0"}], "index": "j"},
                {"name": "align()", "within": []},
            ],
        }
    ]
}


def outline(group):
    """A group as nested lists of labels, each list beginning with its condition."""
    return [group.condition, *(outline(one) if isinstance(one, Group) else one.label for one in group.content)]


def sizes(group):
    return [size for one in group.content for size in (sizes(one) if isinstance(one, Group) else [one.bits])]


def test_conditions_hold_what_stands_under_them():
    thing = tables_of(SYNTAX_DATA)["thing"]
    assert outline(thing.group) == [
        "",
        "`first`",
        "`second` (b)",
        ["if (first > 0)", ["for each entry", "`third`", ["if (x)", "`fourth`"]], "`fifth`[j]"],
        "align()",
    ]
    assert sizes(thing.group) == [16, 16, 3, None, 16, None]


def test_every_element_of_the_tables_has_a_box():
    parts = parts_of((ROOT / "spec.md").read_text(encoding="utf-8"))
    spec = "".join(FENCED.sub("", part.text) for part in parts if part.name in SYNTAX)
    page = Site(ROOT)._glance()
    labels = re.sub(r"<[^>]+>", "", " ".join(re.findall(r"<b>(.*?)</b>", page)))
    tables = re.findall(r"^\| \w+\([^|]*\) \| descriptor \|\n((?:\|.*\n)+)", spec, re.MULTILINE)
    assert len(tables) >= 13
    named = {
        name
        for table in tables
        for row in table.splitlines()
        for name in re.findall(r"`([a-z]+_\w+)`", re.sub(r"\((?:[^()]|\([^()]*\))*\)", "", row.split(" | ")[0]))
    }
    assert len(named) > 60
    assert [name for name in named if name not in labels] == []
