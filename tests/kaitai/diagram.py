"""``python -m tests.kaitai.diagram`` draws docs/gsvc.svg: the structures of docs/gsvc.ksy, by Graphviz's dot.

Types that only help Kaitai Struct to read bits are left out, and so is what is calculated rather than read.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.kaitai.compiler import ROOT, compile_to, missing

HELPERS = ("align", "digit", "eg", "group", "prefix", "u", "uv")
TARGET = ROOT / "docs" / "gsvc.svg"


def readable(dot: str) -> str:
    """The graph without helpers, calculated values, parameters and elements that are never there."""
    dot = re.sub(r"\t*<TR>(?:(?!</TR>).)*PORT=\"never_pos\".*?</TR>\n(?:\t*<TR><TD COLSPAN.*\n)?", "", dot)
    dot = re.sub(
        r"^\t*\w+__(?:inst__\w+|params) \[label=<<TABLE.*?</TABLE>>\];\n", "", dot, flags=re.MULTILINE | re.DOTALL
    )
    for name in HELPERS:
        dot = re.sub(rf"^(\t+)subgraph cluster__{name} \{{\n.*?^\1\}}\n", "", dot, flags=re.MULTILINE | re.DOTALL)
    fonts = 'digraph gsvc {\n\tfontname="sans-serif";\n\tnode [fontname="sans-serif"];'
    dot = dot.replace("digraph {", fonts, 1)
    known = {*re.findall(r"^\t*(\w+) \[label", dot, re.MULTILINE)}
    lines = []
    for line in dot.splitlines(keepends=True):
        edge = re.match(r"\t*(\w+):(\w+) -> (\w+)(?::(\w+))?", line)
        if edge is None or ({edge[1], edge[3]} <= known and "bold" in line):
            lines.append(line.replace("Gsvc::", ""))
    return "".join(lines)


def main() -> int:
    """Write the picture; 2 if a tool is missing."""
    lacks = missing() or ("" if shutil.which("dot") else "there is no dot; it is in the package graphviz")
    if lacks:
        print(lacks, file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        compile_to("graphviz", Path(folder))
        dot = readable((Path(folder) / "gsvc.dot").read_text(encoding="utf-8"))
    subprocess.run(["dot", "-Tsvg", "-o", str(TARGET)], input=dot, text=True, check=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
