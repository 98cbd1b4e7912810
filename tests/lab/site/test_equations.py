"""Equations of spec.md as MathML: nothing is lost or moved, fractions and scripts hold what they should."""

import re
import unicodedata
import xml.etree.ElementTree as ET

import pytest

pytest.importorskip("markdown_it", reason="markdown-it-py is one of the extra site")

from gsvc_lab.site.__main__ import ROOT
from gsvc_lab.site.document import FENCED, parts_of, targets_of
from gsvc_lab.site.equations import NUMBERED, NotCertainError, equation_block, mathml

SPEC = (ROOT / "spec.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"(?<=\n\n)(?:    .*\n)+(?=\n)", FENCED.sub("", SPEC))
KEPT_AS_TEXT = ("10-25",)
"""Blocks whose quotient has words below it."""
OF_WORDS = ("    I-frame ",)
"""What a block of words begins with, which is no equation: the order of passes."""


def bare(text):
    """What a line says, without its marks of scripts and grouping."""
    decomposed = unicodedata.normalize("NFKD", text).replace("\u0302", "^").replace("\u0303", "~")
    return re.sub(r"[\s()_^`]|\u2061|\u2062", "", decomposed.replace("−", "-").replace("…", "..."))


def lines(block):
    """The expressions of a block, without their numbers."""
    return [NUMBERED.sub("", line).strip() for line in block.splitlines()]


def said(node):
    """What MathML says, with a stroke for each fraction, a sign for each root, and accents after their letters."""
    inner = [said(child) for child in node]
    if node.tag == "mfrac":
        return f"{inner[0]}/{inner[1]}"
    if node.tag == "msqrt":
        return "√" + "".join(inner)
    return (node.text or "") + "".join(inner)


def shape(text):
    """MathML of an expression with brackets that show fractions and scripts."""

    def walk(node):
        inner = [walk(child) for child in node]
        if node.tag == "mfrac":
            return f"[{inner[0]}/{inner[1]}]"
        if node.tag in ("msub", "msup"):
            return f"{inner[0]}{'_' if node.tag == 'msub' else '^'}{{{inner[1]}}}"
        if node.tag == "msubsup":
            return f"{inner[0]}_{{{inner[1]}}}^{{{inner[2]}}}"
        if node.tag == "msqrt":
            return f"√[{''.join(inner)}]"
        return (node.text or "") + "".join(inner)

    return walk(ET.fromstring(mathml(text)))


def test_all_blocks_are_set_but_those_that_are_not_certain():
    kept = []
    for block in BLOCKS:
        try:
            equation_block(block)
        except NotCertainError:
            kept += re.findall(r"\((\d+-\d+)\)$", block, re.MULTILINE)
    assert tuple(kept) == KEPT_AS_TEXT
    assert len(BLOCKS) > 50


SET = [
    block
    for block in BLOCKS
    if not any(f"({number})" in block for number in KEPT_AS_TEXT) and not block.startswith(OF_WORDS)
]


@pytest.mark.parametrize("block", SET, ids=lambda block: lines(block)[0][:24])
def test_nothing_is_lost_or_moved(block):
    page = equation_block(block)
    found = "".join(said(ET.fromstring(math)) for math in re.findall(r"<math.*?</math>", page))
    assert bare(found) == bare("".join(lines(block)))


def test_a_lost_term_would_be_noticed():
    assert bare(said(ET.fromstring(mathml("a / (b + c)")))) == bare("a / (b + c)")
    assert bare(said(ET.fromstring(mathml("a / b")))) != bare("a / (b + c)")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("u2 = (d_y − l21 · u1) / l22", "u_{2}=[d_{y}−l_{21}·u_{1}/l_{22}]"),
        ("dL/dx̂ · ∂x̂/∂x", "[dL/dx^]·[∂x^/∂x]"),
        ("2 (1 − K_B) K_B / K_G · Cb", "[2(1−K_{B})K_{B}/K_{G}]·Cb"),
        ("2 r^(k+1) / (3 N)", "[2r^{k+1}/3N]"),
        ("1 − k ε / (1 − k ε)", "1−[kε/1−kε]"),
        ("i + 1/2", "i+[1/2]"),
        ("√n / √(1 − β3ᵏ) + ε", "[√[n]/√[1−β_{3}^{k}]]+ε"),
        ("fl(fl(x − β) / s)", "fl([fl(x−β)/s])"),
        ("r_jᵏ − r^(k+1)", "r_{j}^{k}−r^{k+1}"),
        ("max(mean cs_j, 0)^w_j", "max(meancs_{j},0)^{w_{j}}"),
        ("rate₀ · factor^⌊i / interval⌋", "rate_{0}·factor^{⌊[i/interval]⌋}"),
        ("S_u1u2 / l22 − |S|_m", "[S_{u_{1}u_{2}}/l_{22}]−|S|_{m}"),
        ("γ_6 |d_y| / l22 + |a / b|", "[γ_{6}|d_{y}|/l_{22}]+|[a/b]|"),
        ("2^(32−R) · L⁻ᵀ · 2^−23", "2^{32−R}·L^{−T}·2^{−23}"),
        ("2^`bit_depth` − 1", "2^{bit_depth}−1"),
        ("a removal of a n_b", "a removal ofan_{b}"),
    ],
)
def test_fractions_and_scripts(text, expected):
    assert shape(text) == expected


@pytest.mark.parametrize("text", ["a ⊗ b", "(a + b", "a + b)", "/ b", "a /", "a / number of times", "|a"])
def test_what_is_not_certain_is_refused(text):
    with pytest.raises(NotCertainError):
        mathml(text)


def test_every_number_is_found():
    numbers = re.findall(r"\((\d+-\d+)\)(?: \|)?$", FENCED.sub("", SPEC), re.MULTILINE)
    of_blocks = {number for block in BLOCKS for number in re.findall(r"\((\d+-\d+)\)$", block, re.MULTILINE)}
    found = targets_of(parts_of(SPEC)).equations
    assert of_blocks <= set(found) <= set(numbers)
