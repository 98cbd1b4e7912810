"""docs/check-your-implementation.md is true: its code makes mine.py, its commands print what stands there."""

import re
import shlex
import sys
import tomllib
from pathlib import Path

import pytest

from gsvc_conformance import causes, diagnosis, expectations
from gsvc_conformance.__main__ import main
from gsvc_conformance.mutants import MUTANTS

README = Path(__file__).parents[2] / "conformance" / "README.md"
GUIDE = Path(__file__).parents[2] / "docs" / "check-your-implementation.md"
BLOCK = re.compile(r"^```(python|console)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
STEPS = BLOCK.findall(GUIDE.read_text(encoding="utf-8"))
COMMAND = "$ gsvc-conformance "
DIGITS = re.compile(r"(?<=sha256 )[0-9a-f]{8}(?=…)")
"""Of the hash of the vectors, which are another set after each change."""


def sources():
    """The contents of mine.py when each command is run, with the command and what it prints."""
    code = ""
    for kind, text in STEPS:
        first, _, rest = text.partition("\n")
        if kind == "python":
            assert first in ("# mine.py", "# mine.py, added")
            code = rest if first == "# mine.py" else f"{code}\n\n{rest}"
        else:
            assert first.startswith(COMMAND)
            command = first.removeprefix(COMMAND)
            marks = [pytest.mark.exhaustive] if "gradients" in command or "claim" in command else []
            yield pytest.param(code, command, rest.splitlines(), id=command, marks=marks)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("code", "command", "printed"), list(sources()))
def test_a_step(code, command, printed, tmp_path, monkeypatch, capsys):
    (tmp_path / "mine.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    status = main(shlex.split(command))
    lines = [without_hash(line.rstrip()) for line in capsys.readouterr().out.splitlines()]
    printed = [without_hash(line) for line in printed]
    monkeypatch.delitem(sys.modules, "mine")
    place = 0
    for line, before in zip(printed, ["", *printed], strict=False):
        if line == "...":
            continue
        found = lines.index(line, place) if line in lines[place:] else None
        assert found is not None, f"not printed: {line}\n" + "\n".join(lines)
        assert before == "..." or found == place, f"lines left out before: {line}"
        place = found + 1
    assert status == (0 if printed[-1].startswith(("PASSED", "THE CLAIM HOLDS")) else 1)
    assert place == len(lines)


@pytest.mark.exhaustive
def test_what_the_readme_of_the_kit_shows(tmp_path, monkeypatch, capsys):
    text = README.read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    ((command, printed),) = re.findall(r"^`gsvc-conformance (.*)` says:\n\n```\n(.*?)^```$", text, re.M | re.DOTALL)
    (tmp_path / "mine.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    assert main(shlex.split(command)) == 1
    assert capsys.readouterr().out == printed
    monkeypatch.delitem(sys.modules, "mine")


def test_files_that_the_guide_shows_can_be_read():
    blocks = re.findall(r"^```toml\n# (\S+)\n(.*?)^```$", GUIDE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    files = {name: tomllib.loads(text) for name, text in blocks}
    assert set(files) == {"pyproject.toml", "waivers.toml", "features.toml"}
    assert set(files["waivers.toml"]["waiver"][0]) == {"vectors", "reason", "issue", "until"}


def without_hash(line):
    return DIGITS.sub("0" * 8, line)


def test_links_and_names():
    text = GUIDE.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)", text):
        assert (GUIDE.parent / target).exists(), target
    headings = {
        re.sub(r"[^a-z0-9 -]", "", line.lower()).replace(" ", "-") for line in re.findall("^###? (.*)", text, re.M)
    }
    assert set(re.findall(r"\]\(#([^)]+)", text)) <= headings


def test_what_the_report_says_is_what_it_can_say():
    known = [mutant.sentence for mutant in MUTANTS]
    sources = [*Path(diagnosis.__file__).parent.glob("*.py"), Path(expectations.__file__), Path(causes.__file__)]
    known += [path.read_text(encoding="utf-8") for path in sources]
    text = GUIDE.read_text(encoding="utf-8")
    tables = re.findall(r"^\| the report says \|.*\n\|[-|]+\n((?:\|.*\n)+)", text, re.MULTILINE)
    said = [part.strip() for table in tables for row in table.splitlines() for part in first_cell(row).split(";")]
    assert len(said) > 30
    assert [part for part in said if not any(part in sentence for sentence in known)] == []


def first_cell(row):
    return re.split(r"(?<!\\)\|", row)[1].replace("\\|", "|")
