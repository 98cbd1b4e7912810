"""spec.md itself: where it lies, and the blocks of Python code in it."""

import re
from functools import cache
from pathlib import Path
from typing import Final

_HERE: Final = Path(__file__).parent

PATH: Final = _HERE / "spec.md" if (_HERE / "spec.md").exists() else _HERE.parent / "spec.md"
"""The document: in the package where that is installed from a wheel, beside the package's folder in a checkout."""

_PYTHON_BLOCK: Final = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@cache
def blocks() -> tuple[str, ...]:
    """The blocks in order, each after as many empty lines as precede it in spec.md, so that tracebacks fit."""
    text = PATH.read_text(encoding="utf-8")
    return tuple("\n" * text.count("\n", 0, block.start(1)) + block[1] for block in _PYTHON_BLOCK.finditer(text))


def as_python() -> list[str]:
    """The lines of spec.md, each in its place and with its line end; what is no code has become a comment."""
    lines = [f"# {line}\n" if line else "\n" for line in PATH.read_text(encoding="utf-8").split("\n")]
    for block in blocks():
        end = block.count("\n")
        first = end - block.lstrip("\n").count("\n")
        lines[first:end] = block.splitlines(keepends=True)[first:]
    return ["\n" if line.startswith("# ```") else line for line in lines]
