"""Write the golden vectors, or compare them with what is there: `python -m conformance generate`.

Exact parts must come out byte for byte; what an oracle computed in binary64 may differ in the last bits between
machines, by 1e-12 of its value, and a bound by 1e-5.
"""

import hashlib
import io
import json
import multiprocessing
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from conformance.case import FULL, LEVELS, cases
from conformance.cases import CAPACITY
from conformance.coverage import coverage_page
from conformance.elements import used
from conformance.mutants import all_mutants, killed_by
from conformance.vectors import VECTORS, files_of, from_files, manifest_bytes, write

Files = Mapping[str, Mapping[str, bytes]]
"""By id, the files of each vector."""

OnCase = Callable[[int, int], object]
"""Called with the number of cases done and of all."""

AGAIN: Final = "python -m conformance generate"
ORACLE_TOLERANCE: Final = 1e-12
BOUND_TOLERANCE: Final = 1e-5
FULL_SUMS: Final = Path(__file__).with_name("full.sha256")
"""The hashes of the exact parts of the full set: the lines that `generate --full` prints while they are not known."""


def make(levels: Iterable[str] = LEVELS, on_case: OnCase | None = None) -> dict[str, dict[str, bytes]]:
    """The files of all vectors of some levels, by id."""
    names = [name for name, case in cases().items() if case.level in levels]
    made: dict[str, dict[str, bytes]] = {}
    with multiprocessing.get_context("spawn").Pool(min(2, os.cpu_count() or 1)) as pool:
        for done, (name, files) in enumerate(pool.imap(vector_files, names, chunksize=4), 1):
            made[name] = files
            if on_case:
                on_case(done, len(names))
    return made


def vector_files(name: str) -> tuple[str, dict[str, bytes]]:
    """The id and the files of a case's vector, its manifest with what it kills and the elements that it has."""
    case = cases()[name]
    files = files_of(case, *case.run())
    manifest = json.loads(files["manifest.json"])
    if case.level != FULL:
        large = CAPACITY in case.flags  # a minute for each mutant
        manifest["kills"] = [] if large else killed_by([from_files(files)], all_mutants())[name]
    streams = [data for part, data in files.items() if part.endswith(".gsvc")]
    if streams and case.level != "faulty":
        manifest["elements"] = sorted({element for data in streams for element in used(data)})
    files["manifest.json"] = manifest_bytes(manifest)
    return name, files


def generate(folder: Path = VECTORS, on_case: OnCase | None = None) -> int:
    """Write all vectors and COVERAGE.md to a folder; returns how many.

    What a case no longer makes is removed.
    """
    made = make(on_case=on_case)
    for path in sorted(folder.glob("*/*/*/*")):
        if path.name not in made.get("/".join(path.relative_to(folder).parts[:3]), {}):
            path.unlink()
    for path in sorted(folder.glob("*/*/*"), reverse=True):
        if not any(path.iterdir()):
            path.rmdir()
    write(folder, made)
    (folder / "COVERAGE.md").write_text(coverage_page(folder), encoding="utf-8")
    return len(made)


def differences(folder: Path = VECTORS, on_case: OnCase | None = None) -> list[str]:
    """What would change if the vectors were generated again, one sentence each, and how to do that."""
    made = make(on_case=on_case)
    there = {
        str(path.relative_to(folder)): path for path in folder.glob("*/*/*/*") if path.is_file()
    }  # fmt: skip
    wanted = {f"{name}/{part}": data for name, files in made.items() for part, data in files.items()}
    found = [f"{name} is not made by any case" for name in sorted(there.keys() - wanted.keys())]
    found += [f"{name} is missing" for name in sorted(wanted.keys() - there.keys())]
    for name in sorted(there.keys() & wanted.keys()):
        if not same(name, there[name].read_bytes(), wanted[name], _oracle_parts(made[name.rpartition("/")[0]])):
            found.append(f"{name} differs")
    if (folder / "COVERAGE.md").read_text(encoding="utf-8") != coverage_page(folder):
        found.append("COVERAGE.md is not that of these vectors")
    return [*found, f"to write them again: {AGAIN}"] if found else []


def _oracle_parts(files: Mapping[str, bytes]) -> set[str]:
    """The parts of a vector that an oracle computed in binary64."""
    outputs = json.loads(files["manifest.json"])["outputs"].values()
    return {entry[part]["file"] for entry in outputs if entry["check"] == "bounded" for part in ("expected", "bound")}


def same(name: str, there: bytes, wanted: bytes, oracle_parts: set[str]) -> bool:
    """Whether a file is what it must be: to the byte, but for what an oracle computed."""
    if there == wanted:
        return True
    part = name.rpartition("/")[2]
    if part == "manifest.json":
        return bool(_without_oracle_hashes(there) == _without_oracle_hashes(wanted))
    if part not in oracle_parts:
        return False
    a, b = (np.load(io.BytesIO(data), allow_pickle=False) for data in (there, wanted))
    tolerance = BOUND_TOLERANCE if part.endswith(".bound.npy") else ORACLE_TOLERANCE
    return a.shape == b.shape and a.dtype == b.dtype and bool(np.allclose(a, b, rtol=tolerance, atol=0))


def _without_oracle_hashes(data: bytes) -> Any:
    manifest = json.loads(data)
    for entry in manifest["outputs"].values():
        if entry["check"] == "bounded":
            for part in ("expected", "bound"):
                del entry[part]["sha256"]
    return manifest


def generate_full(folder: Path, on_case: OnCase | None = None) -> list[str]:
    """Write the full set (large frames, long sequences); returns what differs from the known hashes of exact parts."""
    made = make([FULL], on_case)
    write(folder, made)
    known = FULL_SUMS.read_text(encoding="utf-8") if FULL_SUMS.exists() else ""
    return [line for line in full_sums(made).splitlines() if line not in known.splitlines()]


def full_sums(made: Files) -> str:
    """The hashes of all parts that are exact, a line each."""
    lines = []
    for name, files in sorted(made.items()):
        inexact = {*_oracle_parts(files), "manifest.json"}
        for part in sorted(files.keys() - inexact):
            lines.append(f"{hashlib.sha256(files[part]).hexdigest()}  {name}/{part}\n")
    return "".join(lines)
