"""Mistakes that nobody chose: an operator or a comparison in the code of spec.md's section 15, drawn by a seed.

    python -m planted.drawn 38 10          # from tests/conformance: what `main_profile.FRESH` was made of

The functions of the encoder and `read_main_stream`, which lists what was read, are left out.
"""

import ast
import random
import sys

from gsvc_base.document import PATH, blocks
from gsvc_conformance import spec

SECTION = "\n## 15 "
OTHERS = ("encode_run", "bits_of_values", "read_main_stream")
OPERATORS = {"+": "-", "-": "+", "*": "+", "//": "%", "%": "//", ">>": "<<", "<<": ">>", "&": "|", "|": "&"}
COMPARISONS = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}


def sites(block):
    """Each mistake in a block as first and last place of its text, and what stands there instead."""
    lines = [0]
    for line in block.splitlines(keepends=True):
        lines.append(lines[-1] + len(line.encode()))
    data = block.encode()

    def place(line, column):
        return lines[line - 1] + column

    for function in ast.walk(ast.parse(block)):
        if not isinstance(function, ast.FunctionDef) or function.name in OTHERS:
            continue
        for node in ast.walk(function):
            if isinstance(node, ast.BinOp):
                yield from between(data, place, node.left, node.right, OPERATORS)
            elif isinstance(node, ast.Compare) and len(node.ops) == 1:
                yield from between(data, place, node.left, node.comparators[0], COMPARISONS)


def between(data, place, left, right, words):
    """The operator between two operands, if it is one of some words."""
    start, end = place(left.end_lineno, left.end_col_offset), place(right.lineno, right.col_offset)
    operator = data[start:end].decode().strip("() \n")
    if operator in words:
        at = start + data[start:end].index(operator.encode())
        yield at, at + len(operator), words[operator]


def drawn(seed, count):
    """Patches of so many statements, and the statements before and after."""
    text, code = PATH.read_text(encoding="utf-8"), spec.source()
    own = [block.lstrip("\n") for block in blocks()]
    own = [block for block in own if text.index(block) > text.index(SECTION)]
    found = sorted({(number, *site) for number, block in enumerate(own) for site in sites(block)})
    for number, start, end, new in random.Random(seed).sample(found, count):
        data = own[number].encode()
        first = data.rindex(b"\n", 0, start) + 1
        last = data.index(b"\n", end) + 1
        while code.encode().count(data[first:last]) > 1:
            first = data.rindex(b"\n", 0, first - 1) + 1
        yield data[first:last].decode(), (data[first:start] + new.encode() + data[end:last]).decode()


if __name__ == "__main__":
    for old, new in drawn(*map(int, sys.argv[1:])):
        print(f"- {old}+ {new}", end="")
