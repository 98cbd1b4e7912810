"""What WGSL, or its way to a driver, leaves open on some operands: every such place in our shaders is known.

An operation passes whose operand is a literal that is in range. Any other operand is made of names, and where one is
declared stands its range, in a comment that begins with ``range:`` and that a reader can check. `select` is no way
out: it is a function, so what it does not choose is computed, too.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ADAPTERS = ROOT / "conformance" / "gsvc_conformance" / "adapters"
IN_JAVASCRIPT = re.compile(r"/\* wgsl \*/ `([^`]*)`")
NAME = r"[A-Za-z_]\w*"
CONSTANT = re.compile(rf"const ({NAME}) = ([\w.+-]+);")
LITERAL = r"(?:0x[0-9a-f]+|\d+)u\b"
BITS = 32

RULES = {
    "remainder": "Arithmetic Expressions: e1 - truncate(e1 / e2) * e2, 'when non-zero, the result has the same sign "
    "as e1'; 0 where e2 is 0. naga makes OpSRem of a signed one, which Vulkan leaves undefined where an operand is "
    "negative; NVIDIA's driver takes it as unsigned. Of floats it is 'inherited from x - y * trunc(x/y)'.",
    "quotient": "Arithmetic Expressions: e1 where e2 is zero, or where 'e1 is most negative value in T, and e2 is -1'; "
    "SPIR-V leaves both undefined. Floating Point Accuracy: '2.5 ULP for |y| in the range [2^-126, 2^126]'.",
    "shift": "Bit Expressions: 'the number of bits to shift is the value of e2, modulo the bit width of e1'; SPIR-V "
    "leaves it undefined from the bit width on.",
    "conversion": "Floating Point Conversion: clamped, then truncated; 'if X is a NaN, the result is an "
    "indeterminate value'. SPIR-V leaves what is out of range undefined.",
    "comparison": "Differences from IEEE-754: 'some functions (e.g. min and max) may not return the expected "
    "result due to optimizations about the presence of NaNs and infinities'.",
}
"""What is looked for, and what the WGSL specification says of it (https://www.w3.org/TR/WGSL/)."""

FLOATS = {
    "render.wgsl.js": "bounded rendering: (13-3) has an eta for every operation; what is finite is told by bits",
    "gradients.wgsl": "bounded gradients, likewise",
    "values.wgsl": "(9-9), which is bounded, likewise",
    "deterministic.wgsl": "the peak alone, 255 to 65535, an integer",
}
"""Sources that have floats, and why subnormal numbers may be lost there.

Differences from IEEE-754: 'any inputs or outputs of operations listed in Floating Point Accuracy may be flushed
to zero', and so may what is bitcast.
"""


@dataclass(frozen=True)
class Found:
    """An operation whose operands could leave the result to a driver."""

    rule: str
    line: int
    operand: str


def sources() -> dict[str, str]:
    """All texts in WGSL of the repository, by file name."""
    texts = {path.name: path.read_text(encoding="utf-8") for path in ADAPTERS.rglob("*.wgsl")}
    for path in [*ADAPTERS.rglob("*.js"), *(ROOT / "viewer").glob("*.js"), *(ROOT / "viewer").glob("*.html")]:
        text = path.read_text(encoding="utf-8")
        if found := "".join(IN_JAVASCRIPT.findall(text)):
            texts[path.name] = found
        assert text.count("@compute") == found.count("@compute"), f"{path}: WGSL that is not marked as such"
    return texts


def code_of(line: str) -> str:
    return line.partition("//")[0]


def operand(text: str) -> str:
    """The unary expression that a text begins with: a literal, or a name with members, indices and arguments."""
    start = re.match(r"vec\d<\w+>", text)
    end, depth = start.end() if start else 0, 0
    while end < len(text) and (depth or text[end] in "([" or text[end].isalnum() or text[end] in "_."):
        depth += (text[end] in "([") - (text[end] in ")]")
        end += 1
        if not depth and text[0] == "(" and text[end - 1] == ")":
            break
    return text[:end]


def uses(lines: list[str]) -> Iterator[Found]:
    """Every operation of a source that a rule is about, with the operands that decide."""
    floats = any("f32" in code_of(line) for line in lines)
    for number, line in enumerate(lines):
        code = code_of(line)
        for match in re.finditer(r" (%|/|<<|>>)=? ", code):
            rule = {"%": "remainder", "/": "quotient"}.get(match[1], "shift")
            yield Found(rule, number, operand(code[match.end() :]))
        if floats:
            for match in re.finditer(r"\b(?:[ui]32|vec\d<[ui]32>)(?=\()", code):
                inside = operand(code[match.end() :])[1:-1]
                if not has_commas(inside):  # several numbers make a vector of their own type
                    yield Found("conversion", number, inside)
            for match in re.finditer(r"\b(?:min|max|clamp|sign)(?=\()", code):
                yield Found("comparison", number, operand(code[match.end() :])[1:-1])


def has_commas(text: str) -> bool:
    """Whether a list of arguments has several."""
    return "," in re.sub(r"\([^()]*\)", "", re.sub(r"\([^()]*\)", "", text))


def is_harmless(found: Found, lines: list[str], everywhere: dict[str, str]) -> bool:
    """Whether an operand is a literal in range, or all names in it are declared with a range."""
    text = found.operand
    for text_of_source in everywhere.values():
        for name, value in CONSTANT.findall(text_of_source):
            text = re.sub(rf"\b{name}\b", value, text)
    text = re.sub(r"\bvec\d<\w+>", "", text)
    text = re.sub(rf"{NAME}(?:\.\w+)* % (\d+)u", lambda match: f"{int(match[1]) - 1}u", text)
    text = re.sub(rf"{NAME}(?:\.\w+)* & (\d+)u", r"\1u", text)
    text = re.sub(r"clamp\([^()]*, (\d+)\)", r"\1", text)
    if found.rule in ("conversion", "comparison") and re.search(rf"\b{LITERAL}", text):
        return True  # integers: a literal with a u goes with no float
    if found.rule == "conversion" and text.startswith("clamp("):
        return True
    names = names_in(text)
    if names:
        return all(has_range(name, found.line, lines, everywhere) for name in names)
    if found.rule == "remainder":
        return text.endswith("u")
    return found.rule != "shift" or all(int(number) < BITS for number in re.findall(r"\b(\d+)", text))


def names_in(text: str) -> set[str]:
    """The names that decide what an expression is; of members the last one, with a point."""
    text = re.sub(r"\.[xyzwrgb]{1,3}\b", "", text)
    text = re.sub(rf"\b{NAME}(?:\[[^\[\]]*\])?(?=\.{NAME})", "", text)
    text = re.sub(rf"(?<!\.)\b({NAME})\[[^\[\]]*\]", r"\1", text)
    return set(re.findall(rf"(?<![\w.])\.?{NAME}(?![\w<(])", text))


def has_range(name: str, line: int, lines: list[str], everywhere: dict[str, str]) -> bool:
    """Whether the last declaration of a name before its use has a range; that of a member in any source."""
    member = name.startswith(".")
    declares = re.compile(rf"\b(?:let|var|const) {name}\b|(?:^\s*|[(,)] ?|> ){name.removeprefix('.')}: ")
    texts = [text.splitlines() for text in everywhere.values()] if member else [lines[: line + 1]]
    for text in texts:
        for number in reversed(range(len(text))):
            if declares.search(code_of(text[number])):
                above = text[number - 1].strip() if number else ""
                if not member or "range:" in text[number]:
                    return "range:" in text[number] or above.startswith("// range:")
    return False


def left_open(text: str, everywhere: dict[str, str]) -> list[str]:
    """The places of a source that neither a literal nor a range makes harmless."""
    lines = text.splitlines()
    return [
        f"{found.line + 1}: {found.rule}, {found.operand}: {lines[found.line].strip()} ({RULES[found.rule]})"
        for found in uses(lines)
        if not is_harmless(found, lines, everywhere)
    ]


@pytest.mark.parametrize("name", sorted(sources()))
def test_nothing_is_left_to_the_driver(name):
    texts = sources()
    assert left_open(texts[name], texts) == []


@pytest.mark.parametrize("name", sorted(sources()))
def test_floats_are_only_where_subnormal_numbers_may_be_lost(name):
    code = "\n".join(code_of(line) for line in sources()[name].splitlines())
    assert bool(re.search(r"\bf32\b|\d\.\d", code)) == (name in FLOATS)


OPEN = {
    "return a / b - select(0, 1, a % b < 0);": {"remainder", "quotient"},  # floor_quotient, as NVIDIA had it wrong
    "return a % 7;": {"remainder"},
    "return 1u << a;": {"shift"},
    "return 1u << 32u;": {"shift"},
    "return select(a >> b, 0u, b > 31u);": {"shift"},
    "return i32(f32(a));": {"conversion"},
    "return vec2<u32>(f32(a) * place);": {"conversion"},
    "return max(f32(a), 0.5);": {"comparison"},
}
"""Lines, and what is found in them."""
CLOSED = (
    "return a / 3 + a % 3u;", "return a >> 31u;", "return 1u << (a % 32u);", "return a >> vec2<u32>(6u);",
    "return f32(max(a, 1u));", "return u32(clamp(f32(a), 0.0, 9.0));",
)  # fmt: skip


def function_of(line: str, said: str = "") -> str:
    return f"{said}\nfn f(a: i32, b: i32, place: f32) -> i32 {{\n    {line}\n}}"


@pytest.mark.parametrize("line", OPEN)
def test_what_is_left_open_is_found_unless_a_range_is_said(line):
    found = left_open(function_of(line), {})
    assert {place.split(": ")[1].partition(",")[0] for place in found} == OPEN[line]
    said = "// range: of a, b and place"
    assert bool(left_open(function_of(line, said), {})) == (line in ("return a % 7;", "return 1u << 32u;"))


@pytest.mark.parametrize("line", CLOSED)
def test_literals_in_range_need_no_words(line):
    assert [place for place in left_open(function_of(line), {}) if "comparison" not in place] == []
