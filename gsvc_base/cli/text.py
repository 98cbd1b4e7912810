"""Numbers, tables and JSON as the commands print them, and the escaping of text of unknown origin."""

import json
import math
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, TextIO

from gsvc_base.errors import naming

COMMANDING: Final = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""Characters that tell a terminal what to do, turn the direction of writing, or are none (bytes in names of files)."""


def printable(text: str) -> str:
    r"""Text of unknown origin (logs, titles, tags, names of files) for a terminal or a report: ESC becomes ``\x1b``.

    Only newlines and tabs are let through of what is no visible character.
    """
    return COMMANDING.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def show(*lines: str, file: TextIO | None = None) -> None:
    """Print lines with all that could control the terminal escaped; all output of commands goes through here."""
    with naming("standard output" if file in (None, sys.stdout) else "standard error"):
        print(printable("\n".join(lines)), file=file, flush=True)


def plural(count: int, noun: str) -> str:
    """A count with its noun: ``1 frame``, ``1,200 frames``."""
    return f"{count:,} {noun}" + ("" if count == 1 else "s")


def duration(seconds: float) -> str:
    """A time span: ``0.8 s``, ``41 s``, ``3:05 min``, ``2:10 h``."""
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60}:{whole % 60:02} min"
    return f"{whole // 3600}:{whole % 3600 // 60:02} h"


def decibel(value: float | None, infinite: str = "identical") -> str:
    """A PSNR: ``34.56 dB``; an infinite one, or JSON's null in its place, is `infinite`."""
    return f"{value:.2f} dB" if value is not None and math.isfinite(value) else infinite


def per_second(rate: Fraction) -> str:
    """A frame rate: ``25 frames/s``, ``29.97 frames/s``."""
    return f"{float(rate):.5g} frames/s"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a table: the first column to the left, the others to the right."""
    cells = [header, *rows]
    widths = [max(len(row[column]) for row in cells) for column in range(len(header))]
    return [
        "  ".join(
            cell.rjust(width) if column else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in cells
    ]


def frame_runs(types: Sequence[str], numbers: Iterable[int]) -> str:
    """Types of frames of growing numbers in runs: ``frame 0: I, frames 1-11: P``; many runs are cut short."""
    runs: list[tuple[int, int, str]] = []
    for number, kind in zip(numbers, types, strict=True):
        if runs and runs[-1][1:] == (number - 1, kind):
            runs[-1] = (runs[-1][0], number, kind)
        else:
            runs.append((number, number, kind))
    texts = [f"frame {a}: {kind}" if a == b else f"frames {a}-{b}: {kind}" for a, b, kind in runs]
    return ", ".join(texts if len(texts) <= 24 else [*texts[:20], f"and {len(texts) - 20} more runs"])


def to_json(value: Any) -> Any:
    """Any result as strict JSON knows it: a number that is not finite is null, a ratio an object of two integers."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_json(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Fraction):
        return {"numerator": value.numerator, "denominator": value.denominator}
    if isinstance(value, Mapping):
        return {str(key): to_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_json(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, str | Path):  # a file name may have bytes that are no characters
        return str(value).encode("utf-8", "backslashreplace").decode("utf-8")
    if value is None or isinstance(value, bool | int):
        return value
    return to_json(value.item())  # a NumPy number


def print_json(value: Any) -> None:
    """Print a result as strict JSON on standard output."""
    show(json.dumps(to_json(value), allow_nan=False, indent=2))
