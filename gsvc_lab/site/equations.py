"""Equations of spec.md, which are indented lines of Unicode, as MathML.

The converter knows what spec.md writes and no more: names, numbers, scripts, brackets, roots, quotients and words
between them. Where a line has something else it gives up, and the page shows the lines as they are.
"""

import html
import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

NUMBERED: Final = re.compile(r"\s+\((\d+-\d+)\)$")
"""The number at the end of an equation's line."""

NAMES: Final = frozenset(
    (
        "fl", "max", "min", "clamp", "round", "log", "ln", "exp", "mean", "loss", "rate", "unit", "parameter", "chroma",
        "factor", "interval", "total", "times", "share", "scale", "iteration", "iterations", "fraction", "splats",
        "first", "last", "time", "tolerance", "smooth", "absolute", "band", "lowest", "highest", "computed", "slot",
        "peak", "MSE", "PSNR", "MS-SSIM", "cs", "Cb", "Cr",
    )
)  # fmt: skip
"""Names of more than one letter; other such words are text."""

UNITS: Final = ("dB",)
DIFFERENTIALS: Final = "dδΔ∂"
RAISED: Final = "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺ᵏᵀ"
LOWERED: Final = "₀₁₂₃₄₅₆₇₈₉"
ACCENTS: Final = {"\u0302": "^", "\u0303": "~"}
CLOSING: Final = {"(": ")", "[": "]", "⌊": "⌋", "⌈": "⌉", "|": "|"}
RELATIONS: Final = ("=", "←", "≤")
WORD_OPERATORS: Final = ("mod", "div")

TOKEN: Final = re.compile(
    rf"""(?P<space>\ +) | (?P<reference>\(\d+-\d+\)) | (?P<code>`[^`]+`) | (?P<number>\d+(?:\.\d+)?)
    | (?P<word>MS-SSIM|[A-Za-zα-ωβΔΓΩ∂](?:[A-Za-zα-ω]|[{"".join(ACCENTS)}])*)(?P<digits>\d*)(?P<primes>′*)
    | (?P<raised>[{RAISED}]+) | (?P<lowered>[{LOWERED}]+) | (?P<big>[ΣΠ]) | (?P<root>√) | (?P<constant>[∞…])
    | (?P<bracket>[()\[\]⌊⌋⌈⌉|]) | (?P<script>[_^]) | (?P<operator><<|>>|[=←<>≤≥+−·±∘,;:/])""",
    re.VERBOSE,
)


class NotCertainError(ValueError):
    """A line that the converter does not know how to set."""


@dataclass
class Node:
    """A part of an equation."""

    kind: str  # ``atom`` (can be multiplied or divided), ``operator`` or ``text``
    xml: str  # as MathML
    spaced: bool  # whether a space stands before it
    inner: str = ""  # what a pair of round brackets holds, if it is one
    wordy: bool = False  # whether it is written in whole words


def mathml(text: str) -> str:
    """One expression as ``<math>``.

    A NotCertainError says that something in it is not known.
    """
    return _math(_Parser(text).whole(), text)


def equation_numbers(text: str) -> list[str]:
    """The numbers, such as ``8-1``, of the lines of a block."""
    return [found[1] for line in text.splitlines() if (found := NUMBERED.search(line))]


def equation_block(text: str) -> str:
    """A block of lines as HTML: one row a line, aligned at their relations where each line has one.

    A NotCertainError says that something in it is not known.
    """
    rows = [_Row(line) for line in text.splitlines() if line.strip()]
    if all(row.relation or row.goes_on for row in rows):
        several = sum(len(row.chunks) > 1 for row in rows) > 1
        body = "".join(_aligned(row, several) for row in rows)
        return f'<div class="equations" tabindex="0"><div class="aligned">{body}</div></div>'
    body = "".join(_as_line(row) for row in rows)
    return f'<div class="equations" tabindex="0"><div class="lines">{body}</div></div>'


class _Row:
    """A line of a block: its number, and its expressions, which stand two or more spaces apart."""

    def __init__(self, line: str) -> None:
        found = NUMBERED.search(line)
        self.number = found[1] if found else ""
        text = line[: found.start()] if found else line
        self.indent = len(text) - len(text.lstrip())
        text = re.sub(r" +(?=[=←] )", " ", text.strip())
        self.chunks = [(chunk, _Parser(chunk).whole()) for chunk in re.split(r" {2,}", text)]
        self.relation = _relation(self.chunks[0][1])
        self.goes_on = text[0] in "+−" and self.indent > 0


def _relation(nodes: Sequence[Node]) -> int:
    """Where the first relation stands after a left side without a condition; 0 if there is none."""
    for place, node in enumerate(nodes):
        if node.kind == "text" and node.xml.startswith(("<mtext>if", "<mtext>where", "<mtext>while")):
            return 0
        if node.kind == "operator" and any(f">{html.escape(sign)}</mo>" in node.xml for sign in RELATIONS):
            return place
    return 0


def _aligned(row: _Row, several: bool) -> str:
    """Cells of a grid: left side, right side, and so on for each expression; the number last."""
    if row.goes_on:
        cells = "<span></span>" + f'<span class="rest">{_math(row.chunks[0][1], row.chunks[0][0])}</span>'
        return cells + _number(row.number)
    if not several or len(row.chunks) == 1:
        text, nodes = row.chunks[0]
        at = row.relation
        gaps = "".join(f'<span class="gap">{_math(more, chunk)}</span>' for chunk, more in row.chunks[1:])
        left = f'<span class="left">{_math(nodes[:at], text)}</span>'
        return f'{left}<span class="rest">{_math(nodes[at:], text)}{gaps}</span>' + _number(row.number)
    cells = ""
    for place, (text, nodes) in enumerate(row.chunks):
        at = 0 if place and nodes[0].kind == "text" else _relation(nodes)
        gap = ' class="left gap"' if place else ' class="left"'
        if at:
            cells += f"<span{gap}>{_math(nodes[:at], text)}</span><span>{_math(nodes[at:], text)}</span>"
        else:
            cells += f'<span class="gap two">{_math(nodes, text)}</span>'
    return cells + _number(row.number)


def _as_line(row: _Row) -> str:
    parts = "".join(f'<span class="gap">{_math(nodes, text)}</span>' for text, nodes in row.chunks)
    return f'<span style="padding-left: {row.indent / 2}em">{parts}</span>{_number(row.number)}'


def _number(number: str) -> str:
    if not number:
        return '<span class="number"></span>'
    return f'<span class="number" id="eq-{number}"><a href="#eq-{number}">({number})</a></span>'


def _math(nodes: Sequence[Node], text: str) -> str:
    return f'<math displaystyle="true" alttext="{html.escape(text)}">{_row(nodes)}</math>'


def _row(nodes: Sequence[Node]) -> str:
    """Nodes one after the other, with the spaces that operators do not bring."""
    parts: list[str] = []
    before: Node | None = None
    for node in nodes:
        stand_apart = before and (before.kind == "text" or "operator" not in (before.kind, node.kind))
        if before and stand_apart and node.spaced:
            wide = "text" in (before.kind, node.kind) or before.wordy or node.wordy
            parts.append(f'<mspace width="{0.3 if wide else 0.17}em"></mspace>')
        xml = node.xml
        if xml in ("<mo>−</mo>", "<mo>+</mo>") and (before is None or before.kind != "atom"):
            xml = xml.replace("<mo>", '<mo form="prefix">')
        if before and before.kind == "operator" and before.xml in ("<mo>,</mo>", "<mo>:</mo>", "<mo>;</mo>"):
            parts.append('<mspace width="0.25em"></mspace>')
        parts.append(xml)
        before = node
    return "<mrow>" + "".join(parts) + "</mrow>"


class _Parser:
    """Recursive descent over the tokens of one expression."""

    def __init__(self, text: str) -> None:
        self.text = re.sub("[À-ž]", lambda letter: unicodedata.normalize("NFD", letter[0]), text)
        self.tokens = list(self._split())
        self.at = 0

    def _split(self) -> Iterator[tuple[str, str, re.Match[str], bool]]:
        place, spaced = 0, False
        while place < len(self.text):
            found = TOKEN.match(self.text, place)
            if not found:
                raise NotCertainError(f"{self.text[place]!r} in {self.text!r}")
            kind = "word" if found["word"] else str(found.lastgroup)
            if kind != "space":
                yield kind, found[0], found, spaced
            spaced = kind == "space"
            place = found.end()

    def peek(self) -> tuple[str, str]:
        return self.tokens[self.at][:2] if self.at < len(self.tokens) else ("end", "")

    def spaced(self) -> bool:
        return self.at < len(self.tokens) and self.tokens[self.at][3]

    def whole(self) -> list[Node]:
        """The nodes of all of it."""
        nodes = self.sequence("")
        if self.at < len(self.tokens):
            raise NotCertainError(f"{self.peek()[1]!r} closes nothing in {self.text!r}")
        return nodes

    def sequence(self, end: str) -> list[Node]:
        """Nodes up to a closing bracket, which is not taken."""
        nodes: list[Node] = []
        while (token := self.peek()) != ("end", "") and token != ("bracket", end):
            if token == ("operator", "/"):
                self._quotient(nodes)
                continue
            node = self.node()
            if nodes and node.xml.startswith("<mtext>") and nodes[-1].xml.startswith("<mtext>"):
                joined = nodes[-1].xml.removesuffix("</mtext>") + " " + node.xml.removeprefix("<mtext>")
                nodes[-1] = Node("text", joined, nodes[-1].spaced, wordy=True)
            else:
                nodes.append(node)
        if end and self.peek() != ("bracket", end):
            raise NotCertainError(f"{end!r} is missing in {self.text!r}")
        return nodes

    def _quotient(self, nodes: list[Node]) -> None:
        """A fraction of the product before the stroke (without spaces: of the last factor) and the factor after it."""
        tight = not self.spaced()
        self.at += 1
        first = len(nodes)
        while first and nodes[first - 1].kind == "atom" and not (tight and first < len(nodes)):
            first -= 1
        above = nodes[first:]
        if not above or self.peek()[0] == "end":
            raise NotCertainError(f"a quotient without one of its sides in {self.text!r}")
        below = self.node()
        if below.kind != "atom":
            raise NotCertainError(f"a quotient by {below.xml} in {self.text!r}")
        spaced = above[0].spaced
        upper = above[0].inner if len(above) == 1 and above[0].inner else _row(above)
        xml = f"<mfrac>{upper}{below.inner or below.xml}</mfrac>"
        if len(above) == 1 and above[0].xml.startswith("<mn>") and below.xml.startswith("<mn>"):
            xml = f'<mstyle displaystyle="false">{xml}</mstyle>'
        nodes[first:] = [Node("atom", xml, spaced)]

    def node(self) -> Node:
        """An operator, a piece of text, or a factor with its scripts and arguments."""
        kind, text = self.peek()
        found, spaced = self.tokens[self.at][2], self.spaced()
        if kind == "operator":
            self.at += 1
            return Node("operator", f"<mo>{html.escape(text)}</mo>", spaced)
        if kind == "reference":
            self.at += 1
            return Node("text", f'<mtext class="reference">{text}</mtext>', spaced, wordy=True)
        if kind == "big":
            self.at += 1
            return self.scripted(
                Node("operator", f'<mo largeop="true" lspace="0.05em" rspace="0.17em">{text}</mo>', spaced)
            )
        if kind == "word" and not self._is_name(found):
            self.at += 1
            if text in WORD_OPERATORS:
                return Node("operator", f'<mo lspace="0.3em" rspace="0.3em">{text}</mo>', spaced)
            return Node("text", f"<mtext>{html.escape(text)}</mtext>", spaced, wordy=True)
        node = self.scripted(self._base())
        while self.peek()[1] in ("(", "[") and not self.spaced() and self.peek()[0] == "bracket":
            arguments = self.scripted(self._base())
            node = Node("atom", f"<mrow>{node.xml}{arguments.xml}</mrow>", spaced, wordy=node.wordy)
        return node

    def _is_name(self, found: re.Match[str]) -> bool:
        """Whether a word names something; other words, and the article "a", are text."""
        letters = _bare(found["word"])
        if letters in UNITS:
            return False
        if letters == "a" and not found["digits"] and re.match(r" [A-Za-z]{3,}\b(?!_)", self.text[found.end() :]):
            return re.match(r" ([A-Za-z]+)", self.text[found.end() :])[1] in NAMES  # type: ignore[index]
        rest = letters[1:]
        return (
            len(letters) == 1 or letters in NAMES or (letters[0] in DIFFERENTIALS and (len(rest) == 1 or rest in NAMES))
        )

    def _base(self) -> Node:
        kind, text = self.peek()
        found, spaced = self.tokens[self.at][2], self.spaced()
        self.at += 1
        if kind == "number":
            return Node("atom", f"<mn>{text}</mn>", spaced)
        if kind == "code":
            return Node("atom", f'<mtext class="element">{html.escape(text[1:-1])}</mtext>', spaced, wordy=True)
        if kind == "constant":
            return Node("atom", f"<mi>{text}</mi>", spaced)
        if kind == "word":
            return Node(
                "atom", _name(found["word"], found["digits"], found["primes"]), spaced, wordy=_bare(text) in NAMES
            )
        if kind == "root":
            below = self.node()
            return Node("atom", f"<msqrt>{below.inner or below.xml}</msqrt>", spaced)
        if kind == "bracket" and text in CLOSING:
            inner = _row(self.sequence(CLOSING[text]))
            self.at += 1
            left = f'<mo form="prefix" stretchy="true" lspace="0" rspace="0">{text}</mo>'
            right = f'<mo form="postfix" stretchy="true" lspace="0" rspace="0">{CLOSING[text]}</mo>'
            return Node("atom", f"<mrow>{left}{inner}{right}</mrow>", spaced, inner if text == "(" else "")
        raise NotCertainError(f"{text!r} in {self.text!r}")

    def scripted(self, base: Node) -> Node:
        """A base with the scripts that follow it."""
        lower, upper = "", ""
        while not self.spaced():
            kind, text = self.peek()
            if kind == "raised":
                self.at += 1
                upper += _raised(text)
            elif kind == "lowered":
                self.at += 1
                lower += f"<mn>{unicodedata.normalize('NFKC', text)}</mn>"
            elif kind == "script":
                self.at += 1
                script = self._script(nested=text == "^")
                lower, upper = (lower, upper + script) if text == "^" else (lower + script, upper)
            else:
                break
        if not lower and not upper:
            return base
        tag = {(True, True): "msubsup", (True, False): "msub", (False, True): "msup"}[bool(lower), bool(upper)]
        scripts = "".join(f"<mrow>{script}</mrow>" for script in (lower, upper) if script)
        digits = re.fullmatch(r"<msub>(<mi>.+?</mi>)<mn>(\d+)</mn></msub>", base.xml)
        if digits and tag == "msup":  # one base with both scripts, not a script of a script
            return Node("atom", f"<msubsup>{digits[1]}<mn>{digits[2]}</mn>{scripts}</msubsup>", base.spaced)
        return Node(base.kind, f"<{tag}>{base.xml}{scripts}</{tag}>", base.spaced, wordy=base.wordy)

    def _script(self, nested: bool) -> str:
        """What stands after ``_`` or ``^``: a bracket, a name or a number; a raised name may have a lower script."""
        kind, text = self.peek()
        if (kind, text) == ("operator", "−"):
            self.at += 1
            return '<mo form="prefix" lspace="0" rspace="0">−</mo>' + self._base().xml
        if kind == "word" and not nested:
            self.at += 1
            found = self.tokens[self.at - 1][2]
            if found["digits"] and len(found["word"]) == 1 and self.peek()[0] == "word" and not self.spaced():
                return _name(found["word"], found["digits"], "") + self._script(nested)
            if len(found["word"]) == 1:
                return _name(found["word"], found["digits"], found["primes"])
            return "".join(f"<mi>{letter}</mi>" for letter in found["word"]) + (
                f"<mn>{found['digits']}</mn>" if found["digits"] else ""
            )
        base = self._base()
        if base.inner:
            return base.inner
        return self.scripted(base).xml if nested else base.xml


def _bare(word: str) -> str:
    """A word without its accents."""
    return "".join(letter for letter in word if letter not in ACCENTS)


def _name(word: str, digits: str, primes: str) -> str:
    """A name: its letters, the digits after them as a lower script, and its primes."""
    letters = _bare(word)
    if len(letters) > 1 and letters not in NAMES:
        return f"<mrow><mi>{word[0]}</mi>{_name(word[1:], digits, primes)}</mrow>"
    xml = f"<mi>{letters}</mi>"
    for accent in word:
        if accent in ACCENTS:
            xml = f'<mover accent="true">{xml}<mo stretchy="false">{ACCENTS[accent]}</mo></mover>'
    if primes:
        xml = f'<mrow>{xml}<mo lspace="0" rspace="0">{primes}</mo></mrow>'
    return f"<msub>{xml}<mn>{digits}</mn></msub>" if digits else xml


def _raised(text: str) -> str:
    """Characters that are small and high by themselves, as an upper script."""
    plain = unicodedata.normalize("NFKC", text).replace("-", "−")
    sign, rest = (plain[0], plain[1:]) if plain[0] in "−+" else ("", plain)
    xml = f'<mo form="prefix" lspace="0" rspace="0">{sign}</mo>' if sign else ""
    return xml + (f"<mn>{rest}</mn>" if rest.isdigit() else f"<mi>{rest}</mi>" if rest else "")
