"""spec.md as a text: its parts agree with each other and with the code."""

import ast
import inspect
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from gsvc_conformance import spec
from gsvc_conformance.operation import Port, operations
from gsvc_conformance.pairs import PAIRS, Free
from gsvc_conformance.vector import VECTORS
from gsvc_ref.bitstream.rules import kind_of
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, write_stream

TEXT = spec.SPEC.read_text(encoding="utf-8")
TAG = re.compile(r"\[(paper|upstream|ours)\b[^\]]*\]")
LONGEST_FUNCTION = 35


def headings(level: int) -> list[str]:
    return re.findall(rf"^{'#' * level} (.*)$", TEXT, re.MULTILINE)


def clauses() -> Iterator[tuple[str, str]]:
    """Heading and text of each part that has no headings of the second or third level in it."""
    parts = re.split(r"^#{2,3} (.*)$", TEXT, flags=re.MULTILINE)
    return zip(parts[1::2], parts[2::2], strict=True)


def section(heading: str) -> str:
    return next(text for name, text in clauses() if name.startswith(heading))


def test_contents_link_every_section() -> None:
    def anchor(heading: str) -> str:
        return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")

    contents = TEXT[TEXT.index("Contents\n") : TEXT.index("## 1 Scope")]
    names = re.findall(r"^###? (.*)$", TEXT[TEXT.index("## 1 Scope") :], re.MULTILINE)
    assert re.findall(r"\[([^\]]*)\]\(#([^)]*)\)", contents) == [(name, anchor(name)) for name in names]


def test_every_clause_says_where_it_comes_from() -> None:
    untagged = [heading for heading, text in clauses() if text.strip() and not TAG.search(text)]
    assert untagged == []


NORMATIVE = re.compile(r"\b(MUST|SHALL|SHOULD|REQUIRED|RECOMMENDED)\b")
ALMOST_NORMATIVE = re.compile(r"\b(must(?! be ready for)|shall|should|required|recommended)\b|\b(is|are) not allowed\b")
QUOTES_THE_WORDS = "2.3 Words of requirement"
INFORMATIVE = ("12.5 ", "14 ", "Annex C", "Annex D", "Annex E", "Annex F")


def paragraphs() -> Iterator[tuple[str, str]]:
    """The heading of the clause and each paragraph, item or row; a new one begins with each id."""
    for heading, text in clauses():
        prose = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
        for paragraph in re.split(r"\n\n|(?=\*\*R-)|\n(?= *- |\||\d+\. |#)", prose):
            yield heading, " ".join(re.sub(TAG, "", paragraph).split())


def test_what_binds_has_an_id() -> None:
    """A word of BCP 14 stands after an id in its paragraph, and the sentence of an id has such a word."""
    binding = {text for heading, text in paragraphs() if NORMATIVE.search(text) and heading != QUOTES_THE_WORDS}
    assert {text for text in binding if not text.startswith("**R-")} == set()
    requirements = {text for _, text in paragraphs() if text.startswith("**R-")}
    sentences = {re.split(r"(?<=[.:]) (?=[A-Z`(])", text)[0] for text in requirements}
    assert {sentence for sentence in sentences if not re.search("MUST|SHOULD|MAY|reserved", sentence)} == set()


def test_no_word_in_lower_case_binds() -> None:
    """In lower case the words of BCP 14 bind nobody, so they stand only where nothing is asked of an implementation."""
    found = {
        text
        for heading, text in paragraphs()
        if ALMOST_NORMATIVE.search(text) and not heading.startswith((QUOTES_THE_WORDS, *INFORMATIVE))
    }
    assert found == set()


def test_terms_are_used_and_defined_once() -> None:
    rows = re.findall(r"^\| (?!term|---)(.*?) \| .* \|$", section("2.2 "), re.MULTILINE)
    terms = [term for row in rows for term in row.split(", ")]
    assert [term for term, count in Counter(terms).items() if count > 1] == []
    elsewhere = TEXT.replace(section("2.2 "), "")
    assert [term for term in terms if not re.search(rf"\b{re.escape(term)}", elsewhere, re.IGNORECASE)] == []


def test_preconditions_are_of_operations_and_their_inputs() -> None:
    """Each operation has a row of its own or only the one for all; what a row names are inputs of its operations."""
    table = section("4.3").partition("| operation | preconditions |")[2]
    rows = [re.findall(r"`(\w+)`", row) for row in re.findall(r"^\| (`.*?) \| .* \|$", table, re.MULTILINE)]
    named = Counter(name for names in rows for name in names)
    assert set(named) <= set(operations())
    assert max(named.values()) == 1
    for names, text in zip(rows, re.findall(r"^\| `.*?` \| (.*) \|$", table, re.MULTILINE), strict=True):
        ports = {
            word
            for name in names
            for p in operations()[name].inputs
            for word in re.findall(r"\w+", f"{p.name} {p.shape}")
        }
        assert set(re.findall(r"`(\w+)`", text)) <= ports | set(names), names


def test_errata_are_dated_and_name_vectors_that_exist() -> None:
    rows = re.findall(r"^\| (\d{4}-\d\d-\d\d) \| .* \| .* \| .* \| (.*) \|$", section("Annex D"), re.MULTILINE)
    assert rows
    dates = [date for date, _ in rows]
    assert dates == sorted(dates)
    for _, changed in rows:
        for pattern in re.findall(r"`([\w*]+/[\w*]+/[\w*]+)`", changed):
            if pattern.split("/")[1] in operations():
                assert any(VECTORS.glob(pattern)), pattern


def test_every_syntax_element_has_a_heading() -> None:
    for number in range(1, 9):
        text = section(f"6.{number} ")
        rows = re.findall(r"^\| (?!---)(.*?) \|", text, re.MULTILINE)
        in_table = [name for row in rows for name in re.findall(r"`(\w+)`(?= |,|\[|$)", _elements_of(row))]
        described = [name for title in re.findall(r"^#### (.*)$", text, re.MULTILINE) for name in _names(title)]
        assert sorted(set(in_table)) == sorted(described), number


def _elements_of(row: str) -> str:
    """A row of a table without its conditions and what is called."""
    row = re.sub(r"(if|for) \((?:[^()]|\([^()]*\))*\)", "", row)
    return re.sub(r"\w+\(.*?\).*|= [\dA-F ]+\(.*", "", row)


def _names(title: str) -> list[str]:
    return re.findall(r"`(\w+)`", title)


def test_annex_b_lists_all_equations() -> None:
    annex = section("Annex B")
    numbered = Counter(int(a) for a, _ in set(re.findall(r"\((\d+)-(\d+)\)", TEXT)))
    listed = {}
    for of, first, last in re.findall(r"\((\d+)-(\d+)\)(?: to \(\d+-(\d+)\))?", annex):
        assert first == "1"
        listed[int(of)] = int(last or first)
    assert listed == dict(numbered)


def test_annex_a_lists_all_constants_of_the_code() -> None:
    names = spec.namespace()
    rows = {
        row[0]: row[1:] for row in re.findall(r"^\| `(\w+)` \| (.*?) \| ?(.*?) ?\|", section("Annex A"), re.MULTILINE)
    }
    tables = dict(re.findall(r"`(\w+)`\s\(([\d.]+)\)", section("Annex A")))
    constants = {name: value for name, value in names.items() if name.isupper()}
    assert rows.keys() | tables.keys() == constants.keys()
    assert not rows.keys() & tables.keys()
    assert {name for name, number in tables.items() if f"\n{name} = " not in section(f"{number} ")} == set()
    for name in rows:
        value = constants[name]
        if isinstance(value, (float, np.floating)):
            assert float(rows[name][0]) == value, name
            assert float.fromhex(rows[name][1].strip("`")) == value, name
        elif isinstance(value, int):
            assert int(rows[name][0], 0) == value, name


def test_kinds_are_those_of_gsvc_ref() -> None:
    for rule in set(re.findall(r"\bR-[\d.]+-\d+\b", TEXT)):
        assert spec.namespace()["kind_of"](rule) == kind_of(rule), rule


def test_classes_and_ports_are_those_of_the_operations() -> None:
    rows = re.findall(r"^\| `(\w+)` \| (`.*`) \|$", section("13.1"), re.MULTILINE)
    classes = {name: sorted(_names(row)) for name, row in rows}
    groups: dict[str, list[str]] = {}
    for operation in operations().values():
        groups.setdefault(operation.group, []).append(operation.name)
    assert classes == {group: sorted(names) for group, names in groups.items()}

    def text(ports: tuple[Port, ...]) -> str:
        return "; ".join(f"`{p.name}` {p.type.replace('|', ' or ')} {p.shape}".strip() for p in ports)

    table = re.findall(r"^\| `(\w+)` \| [\d.]+ \| (.*) \| (.*) \|$", section("4.3"), re.MULTILINE)
    assert table == [(s.name, text(s.inputs), text(s.outputs)) for s in operations().values()]
    for operation in operations().values():
        if not isinstance(PAIRS[operation.name], Free):
            function = spec.namespace()[operation.name]
            assert list(inspect.signature(function).parameters) == [p.name for p in operation.inputs]


def test_operations_are_defined_where_their_table_says() -> None:
    places = re.findall(r"^\| `(\w+)` \| ([\d.]+) \| .* \| .* \|$", section("4.3"), re.MULTILINE)
    assert places
    free = [name for name, pair in PAIRS.items() if isinstance(pair, Free)]
    assert [name for name, number in places if f"\ndef {name}(" not in section(f"{number} ")] == free
    assert [name for name in free if f"`{name}`" not in section(f"{dict(places)[name]} ")] == []


def test_the_door_is_twelve_lines_of_decoding() -> None:
    _, decoding = re.findall(r"^```\n(.*?)^```$", section("4.1"), re.MULTILINE | re.DOTALL)
    assert len(decoding.splitlines()) == 12
    cited = re.findall(r"  (\d[\d., ]*)$", decoding, re.MULTILINE)
    assert len(cited) == 8
    assert {number for cell in cited for number in cell.split(", ")} <= {heading.split()[0] for heading, _ in clauses()}
    steps = re.findall(r"^\d\. \*(.*?)\.?\*", section("10.1"), re.MULTILINE)
    assert "section 10.1 has its six steps" in section("4.1")
    assert len(steps) == 6


def test_overview_stream() -> None:
    data = write_stream(OVERVIEW_HEADER, overview_frames(), index=False)
    overview = section("4.2")
    block = re.search(r"^```hex\n(.*?)^```$", overview, re.MULTILINE | re.DOTALL)
    assert block is not None
    assert bytes.fromhex(block[1]) == data
    rows = re.findall(r"^\| (\d+) \| ((?:[\dA-F]{2} ?)+) \|", overview, re.MULTILINE)
    offset = 0
    for start, part in rows:
        assert int(start) == offset
        assert bytes.fromhex(part) == data[offset : offset + len(bytes.fromhex(part))]
        offset += len(bytes.fromhex(part))
    assert offset == len(data)
    shown = re.findall(r"^\| \d \([IPR]\) \| (.*) \|$", overview, re.MULTILINE)
    parameters = [[float(n) for cell in row.split("|") for n in cell.split("=")[-1].split(",")] for row in shown]
    decoded = spec.namespace()["reconstruct_stream"](stream=data)
    assert decoded["parameters"].tolist() == parameters
    assert decoded["error"] == ""


def test_code_stands_alone() -> None:
    tree = ast.parse(spec.source())
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    imported |= {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module}
    assert imported == {"math", "struct", "fractions", "numpy"}
    first = ast.parse(spec.blocks()[0])
    assert all(isinstance(node, (ast.Import, ast.ImportFrom)) for node in first.body)


def test_code_is_fit_to_be_read() -> None:
    """Functions of a screen at most, lines of 120 characters, no name defined twice."""
    tree = ast.parse(spec.source())
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            assert node.end_lineno is not None
            assert node.end_lineno - node.lineno < LONGEST_FUNCTION, node.name
    assert max(map(len, spec.source().splitlines())) <= 120
    defined = [node.name for node in tree.body if isinstance(node, (ast.FunctionDef, ast.ClassDef))]
    defined += [
        t.id for node in tree.body if isinstance(node, ast.Assign) for t in node.targets if isinstance(t, ast.Name)
    ]
    assert [name for name, count in Counter(defined).items() if count > 1] == []


def test_tracebacks_name_lines_of_spec_md() -> None:
    lines = TEXT.splitlines()
    function = spec.namespace()["read_chunk"]
    assert Path(function.__code__.co_filename) == spec.SPEC
    assert lines[function.__code__.co_firstlineno - 1].startswith("def read_chunk(")


def test_patched_code_is_run_anew() -> None:
    patched = spec.namespace([("LOWEST_STATE = 2**16", "LOWEST_STATE = 2**15")])
    assert patched["LOWEST_STATE"] == 2**15
    assert spec.namespace()["LOWEST_STATE"] == 2**16
    assert spec.namespace() is spec.namespace()
    for text in ("no such text", "raise Fault"):
        with pytest.raises(LookupError):
            spec.namespace([(text, "")])
