"""The documents: links lead to files and headings that exist, named paths as well, and no word is a placeholder."""

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted(
    {*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("conformance/*.md"), *ROOT.glob("viewer/*.md")}
)
FOLDERS = ("gsvc_base", "gsvc_ref", "gsvc_tools", "gsvc_lab", "conformance", "tests", "viewer", "vectors", "docs")
HISTORY = ("CHANGELOG.md",)
"""Documents whose text, apart from links, names paths of former versions or of a user's machine."""


def name(path):
    return path.relative_to(ROOT).as_posix()


@cache
def text(path):
    """A document without its blocks of code."""
    return re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


@cache
def anchors(path):
    """The anchors that GitHub gives to the headings of a document."""
    headings = re.findall(r"^#+ (.*)$", text(path), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS, ids=name)
def test_links(document):
    broken = []
    for link in re.findall(r"\]\(([^)\s]+)\)", text(document)):
        if "://" in link or link.startswith("mailto:"):
            continue
        path, _, anchor = link.partition("#")
        target = document.parent / path if path else document
        if not target.exists() or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
            broken.append(link)
    assert broken == []


@pytest.mark.parametrize("document", [path for path in DOCUMENTS if path.name not in HISTORY], ids=name)
def test_paths(document):
    named = re.findall(rf"`((?:{'|'.join(FOLDERS)})/[\w./-]*)`", text(document))
    assert [path for path in named if not (ROOT / path).exists()] == []


def test_the_links_are_found():
    assert len(DOCUMENTS) > 8
    assert "#41-the-codec-in-five-minutes" in text(ROOT / "spec.md")
    assert "41-the-codec-in-five-minutes" in anchors(ROOT / "spec.md")


@pytest.mark.parametrize("document", [*DOCUMENTS, ROOT / "Makefile"], ids=name)
def test_no_word_stands_for_what_is_still_to_come(document):
    assert re.findall(r"\b(?:TODO|FIXME|TBD|XXX|TIMETEST)\b", document.read_text(encoding="utf-8")) == []
