"""The syntax of spec.md as data: what its tables and headings say about every element, read from the document itself.

A table whose right column is `descriptor` is a structure; a heading ``#### `name` `` says what its elements mean.
Rules, levels and the constants of Annex A stand beside them. spec/syntax.json is this, written down, and
spec/syntax.schema.json tells its shape.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Any, Final

from gsvc_base.document import PATH

Json = dict[str, Any]

_SUPERSCRIPTS: Final = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_NUMBER: Final = r"(?:\d+(?:\^\d+|[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)?(?: − \d+)?)"
_HEADING: Final = re.compile(r"^(#{2,4}) (?:(Annex [A-Z]|(?:[A-Z]\.)?[0-9.]+) )?(.*)$")
_RULE: Final = re.compile(r"\*\*(R-[\w.-]+)\*\* ")
_CITED: Final = re.compile(r"R-\d+(?:\.\d+)*-\d+")
_CODE: Final = re.compile(r"`([^`]+)`")
_SENTENCE: Final = re.compile(r"(?<=\.)\s+(?=[A-Zα-ω0-9`(*])")
_TAG: Final = re.compile(r"\[(?:ours|paper|upstream)\] ")


@cache
def syntax() -> Json:
    """The syntax, ready to be written as JSON; `spec/syntax.schema.json` describes its shape."""
    parts = _parts()
    rules = _rules(parts)
    structures = [structure for part in parts.values() for structure in _structures(part, rules)]
    return {
        "document": "spec.md",
        "version": _version(),
        "descriptors": _descriptors(parts["3.1"], rules),
        "levels": _levels(parts["5"]),
        "chunk_types": _chunk_types(parts["F.10"]),
        "structures": structures,
        "constants": _constants(parts["Annex A"]),
        "rules": {rule: {key: about[key] for key in ("section", "text")} for rule, about in rules.items()},
    }


def elements() -> Iterator[tuple[str, Json]]:
    """Every element that has a heading, with the name of its structure, in the order of the document."""
    for structure in syntax()["structures"]:
        for element in structure["elements"]:
            if "heading" in element:
                yield structure["name"], element


@cache
def named() -> Mapping[str, Json]:
    """The elements by the names of their headings: ``frame_count (end)`` is that of the end chunk."""
    return {element["heading"]: element for _, element in elements()}


def rules_of(element: Json) -> list[str]:
    """The ids of the rules about an element that has a heading, and about its descriptor."""
    return _all_rules()[element["heading"]]


@cache
def _all_rules() -> Mapping[str, list[str]]:
    """The ids by heading: a listing asks for them with every line."""
    about = {row["descriptor"].partition("(")[0]: row["rules"] for row in syntax()["descriptors"]}
    return {name: [*e["rules"], *about.get(e["descriptor"].partition("(")[0], ())] for name, e in named().items()}


def number(text: str) -> int | None:
    """An integer as spec.md writes it: ``1024``, ``2^16``, ``2³² − 1``; None for other texts."""
    if not re.fullmatch(_NUMBER, text):
        return None
    power, _, less = text.partition(" − ")
    raised = re.fullmatch(r"(\d+?)\^?([⁰¹²³⁴⁵⁶⁷⁸⁹]+|(?<=\^)\d+)", power)
    value = math.prod([int(raised[1])] * int(raised[2].translate(_SUPERSCRIPTS))) if raised else int(power)
    return value - int(less or 0)


class _Part:
    """A numbered section, without those in it: its lines of text by the heading of an element, '' before the first."""

    def __init__(self, section: str, title: str) -> None:
        self.section, self.title = section, title
        self.texts: dict[str, list[str]] = {"": []}


def _parts() -> dict[str, _Part]:
    parts = {"": _Part("", "")}
    part, under, in_code = parts[""], "", False
    for line in PATH.read_text(encoding="utf-8").splitlines():
        if line.startswith("```"):
            in_code = not in_code
        elif not in_code and (found := _HEADING.match(line)):
            if found[1] == "####":
                under = found[3]
                part.texts[under] = []
            else:
                part, under = _Part(found[2] or "", found[3]), ""
                parts[part.section] = part
        elif not in_code:
            part.texts[under].append(line)
    return parts


def _version() -> str:
    title = PATH.read_text(encoding="utf-8").split("\n", 1)[0]
    return title.rpartition("version ")[2]


def _paragraphs(lines: Iterable[str]) -> list[str]:
    """Paragraphs without tables, each in one line, and without a tag of its origin."""
    found: list[list[str]] = [[]]
    for line in lines:
        if not line.strip() or line.startswith("|"):
            found.append([])
        else:
            if line.startswith("**R-"):  # a rule at the start of a line begins another sentence
                line = " " + line
            found[-1].append(line.strip())
    return [_TAG.sub("", " ".join(part)) for part in found if part]


def _tables(lines: Iterable[str]) -> Iterator[list[list[str]]]:
    """The rows of each table, the header first, as cells."""
    rows: list[list[str]] = []
    for line in (*lines, ""):
        if line.startswith("|"):
            cells = [cell.strip() for cell in line.strip("|\n").split("|")]
            if not all(re.fullmatch(r":?-+:?", cell) for cell in cells):
                rows.append(cells)
        elif rows:
            yield rows
            rows = []


def _rules(parts: Mapping[str, _Part]) -> Json:
    """Every rule: its section, its heading, its sentence."""
    found: Json = {}
    for part in parts.values():
        for heading, lines in part.texts.items():
            for place, paragraph in enumerate(_paragraphs(lines)):
                _, *said = _RULE.split(paragraph)
                for rule, text in zip(said[::2], said[1::2], strict=True):
                    found[rule] = {
                        "section": part.section,
                        "text": text.strip(),
                        "under": heading if place == 0 else "",
                    }
    return found


def _names(heading: str) -> list[str]:
    """The elements that a heading is about, as it writes them, without the marks of code."""
    return [name.replace("`", "") for name in heading.split(", ")] if heading else []


def _rules_about(name: str, heading: str, plain: str, section: str, rules: Json) -> list[str]:
    """Ids of the rules that begin the text under a heading, are cited there, or name the element in its section."""
    cited = _CITED.findall(plain)
    return [
        rule for rule, about in rules.items()
        if about["under"] == heading or rule in cited or (about["section"] == section and f"`{name}`" in about["text"])
    ]  # fmt: skip


def _structures(part: _Part, rules: Json) -> Iterator[Json]:
    for rows in _tables(part.texts[""] if part.section.startswith(("6.", "15.")) else ()):
        head = re.fullmatch(r"(\w+)\((.*)\)", rows[0][0])
        if head is None or rows[0][1:] != ["descriptor"]:
            continue
        described = {name: heading for heading in part.texts for name in _names(heading)}
        table = [
            {key: value for key, value in entry.items() if value is not None}
            for element in _elements(rows[1:])
            for entry in (element | _description(element["name"], head[1], described, part, rules),)
        ]
        for rule, about in rules.items():
            if about["section"] == part.section and about["text"].startswith("Each element "):
                for element in table:
                    described_only = any("*descriptive*" in rules[other]["text"] for other in element.get("rules", ()))
                    element["rules"] += [rule] if "heading" in element and not described_only else []
        taken = {rule for element in table for rule in element["rules"]}
        own = [rule for rule, about in rules.items() if about["section"] == part.section and rule not in taken]
        parameters = head[2].split(", ") if head[2] else []
        yield {
            "name": head[1],
            "parameters": parameters,
            "section": part.section,
            "title": part.title.replace("`", ""),
            "rules": own,
            "elements": table,
        }


_TOKEN: Final = re.compile(
    r"(?P<open>\{)|(?P<close>\})|(?P<condition>if|for) (?=\()|for (?P<each>each \w+)"
    r"|`(?P<name>\w+)`(?P<place>\[\w+\])?(?: = (?P<value>[0-9A-F ]+)\(hexadecimal\))?(?: \((?P<symbol>\w+)\))?"
    r"|(?P<call>\w+)(?=\()|(?P<word>\w+)"
)


def _elements(rows: Iterable[list[str]]) -> Iterator[Json]:
    """The elements of a table in their order, each with the conditions and loops that it stands in, outermost first."""
    blocks: list[list[Json]] = []
    pending: list[Json] = []
    for left, right in rows:
        descriptor = right.removesuffix(" each").replace("`", "") or None
        at = 0
        while found := _TOKEN.search(left, at):
            at = found.end()
            if found["condition"]:
                end = _closing(left, at)
                pending.append({found["condition"]: left[left.index("(", at) + 1 : end].replace("`", "")})
                at = end + 1
            elif found["each"]:
                pending.append({"for": found["each"]})
            elif found["open"]:
                blocks.append(pending)
                pending = []
            elif found["close"]:
                blocks.pop()
            else:
                note = None
                name = found["name"] or found["word"]
                if found["call"]:
                    end = _closing(left, at)
                    name = f"{found['call']}({left[left.index('(', at) + 1 : end].replace('`', '')})"
                    at = end + 1
                    rest = re.match(r"[^{}]*", left[at:])
                    if rest and rest[0].strip():
                        note = rest[0].strip().replace("`", "")
                        at += rest.end()
                yield {
                    "name": name,
                    "index": found["place"] and found["place"].strip("[]"),
                    "symbol": found["symbol"],
                    "descriptor": None if found["call"] else descriptor,
                    "within": [*(context for block in blocks for context in block), *pending],
                    "value": found["value"] and found["value"].strip(),
                    "note": note,
                }
                pending = []


def _closing(text: str, at: int) -> int:
    """The place of the bracket that closes the one at or after a place."""
    depth = 0
    for place in range(text.index("(", at), len(text)):
        depth += {"(": 1, ")": -1}.get(text[place], 0)
        if depth == 0:
            return place
    raise ValueError(f"a bracket stays open in {text!r}")


def _description(name: str, structure: str, described: Mapping[str, str], part: _Part, rules: Json) -> Json:
    """What the heading of an element says about it; what has no heading, such as align(), has no rules."""
    own = f"{name} ({structure})"
    key = own if own in described else name
    if key not in described:
        return {"rules": []}
    heading = described[key]
    body = _paragraphs(part.texts[heading])
    plain = _RULE.split(body[0])[0]
    about = _rules_about(name, heading, plain, part.section, rules)
    texts = [rules[rule]["text"] for rule in about]
    sentences = [_strip(sentence) for sentence in _SENTENCE.split(plain) if sentence.strip()]
    span = next((text.removeprefix("Range: ") for text in sentences if _is_span(text)), None)
    absent = next((text for text in sentences if text.startswith("Absent ")), None)
    others = [text for text in sentences if not _is_span(text) and text != absent]
    own_rules = [rules[rule]["text"] for rule in about if rules[rule]["under"] == heading]
    lowest, highest = _bounds(span, name, texts)
    clauses = [clause for text in (plain, *own_rules) for clause in re.split(r"[;.:] ", text)]
    bits = {found[2]: int(found[1]) for found in re.finditer(r"\b[Bb]it (\d+)[^.;:]*? is `(\w+)`", " ".join(body))}
    return {
        "heading": key,
        "range": span,
        "minimum": lowest,
        "maximum": highest,
        "values": _values(span),
        "reserved": next((_strip(clause) for clause in clauses if "reserved" in clause), None),
        "bits": bits or None,
        "absent": absent,
        "meaning": others[0] if others else _strip(_SENTENCE.split(own_rules[0])[0]) if own_rules else None,
        "rules": about,
    }


def _is_span(sentence: str) -> bool:
    """Whether a sentence tells the values that an element may have."""
    return re.match(r"Range[: ]|One value|Any value|Symbols ", sentence) is not None


def _strip(text: str) -> str:
    return text.strip().rstrip(".").replace("`", "")


def _bounds(span: str | None, name: str, rules: list[str]) -> tuple[int | str | None, int | str | None]:
    """The ends of a range: integers, or what spec.md says where they depend on other elements; None if not given."""
    if span and (values := _values(span)):
        return min(map(int, values)), max(map(int, values))
    if span and (one := re.match(rf"({_NUMBER})(?=$|[;, ])(?! to )", span)):
        return number(one[1]), number(one[1])
    if span and (found := re.match(r"(?:Symbols )?(\S+?(?: − \d+)?) (?:to|and) (.+?)(?=$|;|, |\s\()", span)):
        return _end(found[1]), _end(found[2])
    for text in rules:
        if found := re.search(rf"`{name}` (?:MUST be )?({_NUMBER})\.\.(\S+?)[. ]?(?=$|\s)", text):
            return _end(found[1]), _end(found[2])
        if found := re.search(rf"`{name}` MUST be at least ({_NUMBER})", text):
            return _end(found[1]), None
    return None, None


def _end(text: str) -> int | str | None:
    value = number(text)
    words = text.replace("`", "").rstrip(".")
    return words if value is None and re.search(r"\w", words) and words not in ("both", "an") else value


def _values(span: str | None) -> dict[str, str] | None:
    """The values that a range lists with their meanings: ``0 constant, 1 raw, 2 coded``."""
    listed = (span or "").partition(";")[0].split(", ")
    found = [re.fullmatch(r"(\d+) (?!to )(\S+)", item) for item in listed]
    return {item[1]: item[2] for item in found if item} if len(found) > 1 and all(found) else None


def _descriptors(part: _Part, rules: Json) -> list[Json]:
    rows = next(rows for rows in _tables(part.texts[""]) if rows[0] == ["descriptor", "meaning"])
    found = []
    for names, meaning in rows[1:]:
        for name in _CODE.findall(names):
            about = [rule for rule, text in rules.items() if text["section"] == "3.1" and f"`{name}`" in text["text"]]
            found.append({"descriptor": name, "meaning": meaning.replace("`", ""), "rules": about})
    return found


def _levels(part: _Part) -> list[Json]:
    """The limits of each level by the heads of the columns; several tables of levels are one."""
    found: dict[str, Json] = {}
    for rows in _tables(part.texts[""]):
        if rows[0][0] == "level":
            for level, *limits in rows[1:]:
                row = found.setdefault(level, {"level": int(level), "limits": {}})
                row["limits"] |= {
                    what.replace("`", ""): text if (value := number(text)) is None else value
                    for what, text in zip(rows[0][1:], limits, strict=True)
                }
    return list(found.values())


def _chunk_types(part: _Part) -> list[Json]:
    """The types of chunks that have a name, by the registry."""
    rows = next(rows for rows in _tables(part.texts[""]) if rows[0][0] == "letters")
    keys = ("letter", "value", "name", "belongs_to", "safe_to_copy", "status", "section")
    found: list[Json] = [
        {key: cell.replace("`", "") or None for key, cell in zip(keys, row, strict=True)} for row in rows[1:]
    ]
    return [{**row, "value": int(row["value"], 16)} for row in found if row["name"]]


def _constants(part: _Part) -> list[Json]:
    rows = next(rows for rows in _tables(part.texts[""]) if rows[0][0] == "constant")
    keys = ("name", "value", "hexadecimal", "meaning", "section")
    return [{key: cell.replace("`", "") or None for key, cell in zip(keys, row, strict=True)} for row in rows[1:]]
