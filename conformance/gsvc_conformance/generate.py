"""Write the golden vectors, or compare them with what is there: `gsvc-conformance generate`.

Every file comes out byte for byte, on every machine: what a machine may compute in its own way (its mathematical
library, vector units, BLAS, the number of threads or processes) has no part in it. One number says so, the SHA-256 of
the set.
"""

import json
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Final

from gsvc_base.errors import UsageError
from gsvc_conformance.case import FULL, TIERS, cases
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.coverage import PARTS, coverage_page
from gsvc_conformance.element_values import used
from gsvc_conformance.mutants import MUTANTS, killed_by
from gsvc_conformance.sets import check_made, read_sets
from gsvc_conformance.vector import (
    MANIFEST,
    SUMS,
    VECTORS,
    files_in,
    files_of,
    from_files,
    manifest_bytes,
    sums_of,
    write,
)

Files = Mapping[str, Mapping[str, bytes]]
"""The files of each vector, by its id."""

OnCase = Callable[[int, int], object]
"""Called with the number of cases done and of all."""

AGAIN: Final = "gsvc-conformance generate"
CHUNK: Final = 4
"""Cases that a process takes at once."""
FULL_SUMS: Final = Path(__file__).with_name("full.sha256")
"""The hashes of the full set: the lines that `generate --full` prints while they are not known."""


def make(
    tiers: Iterable[str] = TIERS,
    on_case: OnCase | None = None,
    *,
    jobs: int = 0,
    kills_in: Path | None = None,
) -> dict[str, dict[str, bytes]]:
    """The files of all vectors of some tiers, by id.

    Parameters
    ----------
    tiers
        Which.
    on_case
        A function that is called after each case.
    jobs
        Number of processes; 0: one for each processor that this one may use. The files do not depend on it.
    kills_in
        The folder whose manifests say what each vector kills, instead of running all mutants, which takes most of the
        time; None: they are run.

    Raises
    ------
    UsageError
        The processes could not start, or one was ended.
    """
    names = [name for name, case in cases().items() if case.tier in tiers]
    made: dict[str, dict[str, bytes]] = {}
    for name, files in _each(partial(vector_files, kills_in=kills_in), names, jobs or processors()):
        made[name] = files
        if on_case:
            on_case(len(made), len(names))
    return made


def processors() -> int:
    """The number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _each(
    function: Callable[[str], tuple[str, dict[str, bytes]]], names: Sequence[str], jobs: int
) -> Iterator[tuple[str, dict[str, bytes]]]:
    """The results of a function for each name, in their order, from `jobs` processes; from this one if that is 1."""
    if jobs == 1:
        yield from map(function, names)
        return
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        try:
            yield from pool.map(function, names, chunksize=CHUNK)
        except BrokenProcessPool:
            raise UsageError(
                "a process that makes vectors could not start, or was ended (perhaps for want of memory). Processes "
                'start from a command or from a script in a file, below `if __name__ == "__main__":`, not from '
                f"standard input; `{AGAIN} --jobs 1` needs none of them and little memory"
            ) from None


def vector_files(name: str, kills_in: Path | None = None) -> tuple[str, dict[str, bytes]]:
    """The id and the files of a case's vector, its manifest with what it kills and the elements that it has."""
    case = cases()[name]
    files = files_of(case, *case.run())
    manifest = json.loads(files["manifest.json"])
    if case.tier != FULL:
        if CAPACITY in case.flags:  # a mutant would take a minute
            manifest["kills"] = []
        elif kills_in is None:
            manifest["kills"] = killed_by([from_files(files)], MUTANTS)[name]
        else:
            manifest["kills"] = _known_kills(kills_in / name)
    streams = [data for part, data in files.items() if part.endswith(".gsvc")]
    if streams and case.tier != "faulty":
        manifest["elements"] = sorted({element for data in streams for element in used(data)})
    files["manifest.json"] = manifest_bytes(manifest)
    return name, files


def _known_kills(home: Path) -> list[str]:
    """The mutants that the manifest in a folder says its vector kills; none without a manifest."""
    path = home / "manifest.json"
    kills: list[str] = json.loads(path.read_bytes())["kills"] if path.exists() else []
    return kills


def generate(folder: Path = VECTORS, on_case: OnCase | None = None, *, jobs: int = 0) -> int:
    """Write all vectors and COVERAGE.md to a folder; returns how many the cases make.

    Files that SHA256SUMS lists and no case makes any more are removed; vectors of a set stay as they are.

    Raises
    ------
    UsageError
        A case makes another vector than a set means by its id. Nothing is written then.
    """
    made = make(on_case=on_case, jobs=jobs)
    many = len(made)
    _check_sets(folder, made)
    made |= kept(folder, made)
    for name in _listed(folder) - {f"{name}/{part}" for name, parts in made.items() for part in parts}:
        (folder / name).unlink()
        with suppress(OSError):  # other files are in it
            (folder / name).parent.rmdir()
    write(folder, made)
    (folder / "COVERAGE.md").write_text(coverage_page(folder), encoding="utf-8")
    return many


def _listed(folder: Path) -> set[str]:
    """The files in a folder that its SHA256SUMS lists."""
    files = files_in(folder)
    lines = files[SUMS].decode().splitlines() if SUMS in files else []
    return {line.partition("  ")[2] for line in lines} & set(files)


def kept(folder: Path, made: Files) -> dict[str, dict[str, bytes]]:
    """The files of vectors that stand in sets of a folder and that no case makes any more, by id."""
    files = files_in(folder)
    listed = {name for one in read_sets(files).values() for name in one.digests} - made.keys()
    return {
        name: {part.rpartition("/")[2]: files[part] for part in files if part.rpartition("/")[0] == name}
        for name in sorted(listed)
    }


def _check_sets(folder: Path, made: Files) -> None:
    """Refuse vectors that are others than the sets of a folder mean by their ids.

    Raises
    ------
    UsageError
        There are some.
    """
    if sets := read_sets(files_in(folder)):
        check_made(sets, {name: json.loads(files[MANIFEST]) for name, files in made.items()})


def differences(folder: Path = VECTORS, made: Files | None = None) -> list[str]:
    """The files that would change if the vectors were generated again, and how to do that; none if no byte differs.

    Parameters
    ----------
    folder
        The folder of the vectors.
    made
        The result of `make`, if it was called already.

    Raises
    ------
    UsageError
        A case makes another vector than a set means by its id.
    """
    made = make() if made is None else made
    _check_sets(folder, made)
    made = {**made, **kept(folder, made)}
    files = files_in(folder)
    there = {name for name in files if name.count("/") == PARTS - 1}
    wanted = {f"{name}/{part}": data for name, parts in made.items() for part, data in parts.items()}
    found = [f"{name} is not made by any case" for name in sorted(there - wanted.keys())]
    found += [f"{name} is missing" for name in sorted(wanted.keys() - there)]
    found += [f"{name} differs" for name in sorted(there & wanted.keys()) if files[name] != wanted[name]]
    if files[SUMS] != sums_of(made):
        found.append(f"{SUMS} is not that of what the cases make")
    if files.get("COVERAGE.md") != coverage_page(folder).encode():
        found.append("COVERAGE.md is not that of these vectors")
    return [*found, f"to write them again: {AGAIN}"] if found else []


def generate_full(folder: Path, on_case: OnCase | None = None, *, jobs: int = 0) -> list[str]:
    """Write the full set (large frames, long sequences); returns the hashes of its files that are not known."""
    made = make([FULL], on_case, jobs=jobs)
    write(folder, made)
    known = FULL_SUMS.read_text(encoding="utf-8") if FULL_SUMS.exists() else ""
    return [line for line in sums_of(made).decode().splitlines() if line not in known.splitlines()]
