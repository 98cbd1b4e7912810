"""The tables of docs/encoding.md, made of the cases that `gsvc_lab.benchmarks.encoding` measured."""

import platform
import statistics
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from gsvc_base.files import write_text
from gsvc_base.pages.tables import markdown_table
from gsvc_base.processors import processors
from gsvc_lab.benchmarks.pictures import SIZES
from gsvc_lab.benchmarks.report import filled
from gsvc_lab.machine import cpu_model

DOCUMENT: Final = Path(__file__).parents[2] / "docs" / "encoding.md"


def spread(numbers: Iterable[float], digits: int) -> str:
    """``median (least to most)``; a dash for none."""
    found = sorted(numbers)
    if not found:
        return "–"
    middle, least, most = (f"{number:,.{digits}f}" for number in (statistics.median(found), found[0], found[-1]))
    return middle if len(found) == 1 else f"{middle} ({least}–{most})"


FITS: Final = (
    "frame", "cases", "the paper's PSNR, dB", "its iterations", "its seconds", "quick's iterations to it",
    "its seconds", "ratio", "quick's default: dB above the paper", "its seconds", "cases below it",
)  # fmt: skip


def fit_rows(cases: dict[str, dict[str, Any]]) -> Iterator[list[str]]:
    """The rows of the fits before quantisation, under FITS."""
    for size in SIZES:
        for kind in "IP":
            parts = [note[kind] for name, note in cases.items() if name.startswith(size) and kind in note]
            timed = [part["measured"] for part in parts if "measured" in part]
            gains = [part["quick"]["psnr"] - part["paper"]["psnr"] for part in parts]
            short = sorted(gain for gain in gains if gain < 0)
            yield [
                f"{size} {kind}",
                str(len(parts)),
                spread((part["paper"]["psnr"] for part in parts), 2),
                spread((part["paper"]["iterations"] for part in parts), 0),
                spread((found["paper"] for found in timed), 1),
                spread((part["climb"][-1]["iterations"] for part in parts), 0),
                spread((found["climb"]["wall_seconds"] for found in timed), 3),
                spread((found["paper"] / found["climb"]["wall_seconds"] for found in timed), 0),
                spread(gains, 2),
                spread((found["quick"]["wall_seconds"] for found in timed), 3),
                f"{len(short)}{f' (by up to {-short[0]:.2f} dB)' if short else ''}",
            ]


FRAMES: Final = ("frame", "cases", "decoded PSNR, dB", "above the paper's fit, dB", "iterations", "seconds")


def frame_rows(cases: dict[str, dict[str, Any]]) -> Iterator[list[str]]:
    """The rows of whole frames, under FRAMES."""
    for size in SIZES:
        notes = [note for name, note in cases.items() if name.startswith(size) and "whole" in note]
        for label, kind in (("first I", "I"), ("I", "I"), ("I to the PSNR", "I"), ("P", "P"), ("P to the PSNR", "P")):
            found = [note["whole"][label] for note in notes if label in note["whole"]]
            gains = [
                note["whole"][label]["psnr"] - note[kind]["paper"]["psnr"]
                for note in notes
                if label in note["whole"] and kind in note
            ]
            psnr, made, taken = ([one[key] for one in found] for key in ("psnr", "iterations", "seconds"))
            numbers = [spread(psnr, 2), spread(gains, 2), spread(made, 0), spread(taken, 2)]
            yield [f"{size} {label}", str(len(found)), *numbers]


def report(cases: dict[str, dict[str, Any]]) -> None:
    """Write the tables of cases by name into the document."""
    threads = sorted({note["threads"] for note in cases.values() if "threads" in note})
    machine = f"{processors()} CPUs ({cpu_model()}), {platform.machine()}, Python {platform.python_version()}, threads"
    texts = {
        "machine": f"{machine} {', '.join(map(str, threads))}.",
        "fits": markdown_table(FITS, fit_rows(cases)),
        "frames": markdown_table(FRAMES, frame_rows(cases)),
    }
    write_text(filled(DOCUMENT.read_text(encoding="utf-8"), texts), DOCUMENT)
    print("\n\n".join(texts.values()))
