"""spec/gsvc.h: the constants of spec.md for C and C++, written from its syntax as data."""

import re
from collections.abc import Iterable, Iterator
from typing import Final

from gsvc_base.syntax import Json, syntax

HEAD: Final = """\
/* Constants of GSVC {version}, by spec.md. Do not edit: `gsvc-conformance syntax --write` writes this file.
 * C99 or C++17: numbers with a fraction are hexadecimal, so that they have all their bits.
 */
#ifndef GSVC_H
#define GSVC_H
"""
FILLING: Final = ("of", "a", "the")


def c_header() -> str:
    """The text of spec/gsvc.h."""
    parts = (
        ("First bytes of a stream, as an initialiser", _magic()),
        ("Types of chunks", _chunk_types()),
        ("Ranges of elements: the least and the greatest legal value, where these are numbers", _ranges()),
        ("Values with a name", _values()),
        ("Limits of levels", _limits()),
        ("Constants of Annex A", _constants()),
    )
    names: set[str] = set()
    lines = [HEAD.format(version=syntax()["version"])]
    for title, macros in parts:
        lines.append(f"/* {title}. */")
        for name, value, comment in macros:
            if name in names:
                raise ValueError(f"two constants would be {name}; one of them needs another name in spec.md")
            names.add(name)
            lines.append(f"#define {name} {value}" + (f" /* {comment} */" if comment else ""))
        lines.append("")
    return "\n".join([*lines, "#endif", ""])


Macros = Iterator[tuple[str, str, str]]
"""Name, value and comment."""


def _magic() -> Macros:
    magic = next(e["value"] for e in _all_elements() if e["name"] == "magic").split()
    yield "GSVC_MAGIC", "{" + ", ".join(f"0x{byte}" for byte in magic) + "}", ""
    yield "GSVC_MAGIC_SIZE", str(len(magic)), "bytes"


def _chunk_types() -> Macros:
    for row in syntax()["chunk_types"]:
        if row["status"] != "planned":
            kind = "" if row["letter"].isupper() else "_ANCILLARY"
            yield f"GSVC_CHUNK{kind}_{row['letter'].upper()}", f"0x{row['value']:02X}", row["name"]


def _ranges() -> Macros:
    done = set()
    for element in _all_elements():
        name = element.get("heading")
        if name is not None and name not in done:
            done.add(name)
            lowest, highest = element.get("minimum"), element.get("maximum")
            if isinstance(lowest, int) and isinstance(highest, int):
                yield f"{_identifier(name)}_MIN", _integer(lowest), ""
                yield f"{_identifier(name)}_MAX", _integer(highest), ""


def _values() -> Macros:
    for element in _all_elements():
        for value, meaning in element.get("values", {}).items():
            yield _identifier(f"{element['name']} {meaning}"), value, ""
        for flag, bit in element.get("bits", {}).items():
            yield _identifier(f"{element['name']} {flag}"), f"(1u << {bit})", ""


def _limits() -> Macros:
    for row in syntax()["levels"]:
        for what, limit in row["limits"].items():
            if isinstance(limit, int):
                yield _identifier(f"level {row['level']} {what}"), _integer(limit), ""


def _constants() -> Macros:
    for constant in syntax()["constants"]:
        name, value = constant["name"], constant["value"]
        if name is None or not re.fullmatch(r"[A-Z][A-Z0-9_]*", name) or name == "MAGIC":
            continue
        written = constant["hexadecimal"] or _integer(int(value, 0))
        yield f"GSVC_{name}", f"({written})" if written.startswith("-") else written, constant["meaning"] or ""


def _all_elements() -> Iterable[Json]:
    return (element for structure in syntax()["structures"] for element in structure["elements"])


def _identifier(text: str) -> str:
    """Words as a name of C: without words that only fill, symbols and marks."""
    words = re.sub(r"[′:()]", "", text).split()
    return "_".join(["GSVC", *(word.upper() for word in words if word.isascii() and word not in FILLING)])


def _integer(value: int) -> str:
    if value < 1 << 16:
        return str(value)
    return f"0x{value:X}" + ("ULL" if value >= 1 << 32 else "u")
