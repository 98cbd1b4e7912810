"""How the sources treat folders that a command adopts: by `gsvc_base.folders` alone, and nothing goes by a pattern."""

import ast
from contextlib import nullcontext

import pytest
from test_arrows import MODULES

MATCHING = {"glob", "rglob", "iglob", "fnmatch", "fnmatchcase"}
REMOVING = {"unlink", "rmdir", "removedirs", "remove_leftover"}
BY_PATH = {
    "complete_file", "copy", "copyfile", "copytree", "chmod", "chown", "fwalk", "glob", "iglob", "iterdir", "link_to",
    "listdir", "makedirs", "mkdir", "mkdtemp", "mkfifo", "open", "PartialFile", "read_bytes", "read_text", "removedirs",
    "rename", "rglob", "rmdir", "rmtree", "scandir", "symlink", "symlink_to", "touch", "truncate", "unlink", "walk",
    "write_bytes", "write_text",
}  # fmt: skip
"""Calls that reach a file by its path, through links and without a look at what it is."""

FOLDERS = "gsvc_base.folders"
WORDS = {"OwnFolder", "rmtree", *REMOVING}
"""A module without one of them does nothing that these laws are about."""
TEXTS = {name: path.read_text(encoding="utf-8") for name, path in MODULES.items()}
TREES = {name: ast.parse(text) for name, text in TEXTS.items() if any(word in text for word in WORDS)}


def calls(tree):
    """The last name of each function that code calls or hands on, such as ``rmtree`` of ``shutil.rmtree``."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.Name):
            yield node.id


def adopts(tree):
    """Whether a module has folders that a command adopts."""
    return any(
        isinstance(node, ast.ImportFrom) and node.module == FOLDERS and "OwnFolder" in {a.name for a in node.names}
        for node in ast.walk(tree)
    )


ADOPTING = [name for name, tree in TREES.items() if adopts(tree)]


@pytest.mark.parametrize("module", ADOPTING)
def test_a_module_that_adopts_folders_reaches_no_file_by_its_path(module):
    assert BY_PATH.isdisjoint(calls(TREES[module]))


def test_some_modules_adopt_folders():
    assert {"gsvc_tools.jobs.resume", "gsvc_conformance.report.kept", "gsvc_ref._kernel_cache"} <= set(ADOPTING)


@pytest.mark.parametrize("module", [name for name in TREES if name not in ("gsvc_base.files", FOLDERS)])
def test_nothing_is_removed_because_of_what_its_name_looks_like(module):
    """No module both finds files by a pattern and removes files, and whole trees go by `OwnFolder.remove_others`."""
    called = set(calls(TREES[module]))
    assert not (called & MATCHING and called & REMOVING)
    assert "rmtree" not in called


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("def f(p):\n    return p.glob('*.gsvc')\ndef g(p):\n    for q in f(p):\n        q.unlink()", True),
        ("def f(p):\n    shutil.rmtree(p)", True),
        ("def f(p):\n    p.unlink()", False),
    ],
)
def test_the_law_of_removal_finds_what_it_forbids(monkeypatch, code, found):
    monkeypatch.setitem(TREES, "planted", ast.parse(code))
    with pytest.raises(AssertionError) if found else nullcontext():
        test_nothing_is_removed_because_of_what_its_name_looks_like("planted")


@pytest.mark.parametrize(
    "call", ["path.open('rb')", "open(path)", "path.unlink()", "shutil.rmtree(path)", "os.mkdir(path)"]
)
def test_the_law_of_paths_finds_what_it_forbids(monkeypatch, call):
    tree = ast.parse(f"from {FOLDERS} import OwnFolder\ndef f(path):\n    {call}\n")
    monkeypatch.setitem(TREES, "planted", tree)
    assert adopts(tree)
    with pytest.raises(AssertionError):
        test_a_module_that_adopts_folders_reaches_no_file_by_its_path("planted")
