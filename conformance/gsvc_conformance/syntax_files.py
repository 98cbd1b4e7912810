"""The files in spec/ that are made of spec.md: its syntax, its constants and its tables."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from gsvc_base.syntax import syntax
from gsvc_conformance.c_header import c_header
from gsvc_conformance.tables import tables_header, tables_json

CHECKOUT: Final = Path(__file__).parents[2]
ROOT: Final = CHECKOUT if (CHECKOUT / "spec.md").is_file() else Path()
"""The folder that the files lie below: the checkout of an editable kit, else the current folder."""


def syntax_json() -> str:
    """The text of spec/syntax.json, whose shape is that of spec/syntax.schema.json."""
    return json.dumps(syntax(), ensure_ascii=False, indent=1) + "\n"


FILES: Final[Mapping[str, Callable[[], str]]] = {
    "spec/syntax.json": syntax_json,
    "spec/gsvc.h": c_header,
    "spec/tables.json": tables_json,
    "spec/gsvc_tables.h": tables_header,
}


def stale(folder: Path = ROOT) -> list[str]:
    """The files that are not, or not as spec.md gives them."""
    return [
        name for name, text in FILES.items()
        if not (folder / name).is_file() or (folder / name).read_text(encoding="utf-8") != text()
    ]  # fmt: skip


def write(folder: Path = ROOT) -> list[str]:
    """Write the files that are not as spec.md gives them; their names."""
    names = stale(folder)
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(FILES[name](), encoding="utf-8")
    return names
