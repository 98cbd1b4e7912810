"""``sets``: show the sets of vectors, or write the next one."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Mapping
from pathlib import Path

from gsvc_base.cli.text import plural, show
from gsvc_base.errors import UsageError
from gsvc_conformance.commands import PROTOCOL, add_vectors
from gsvc_conformance.sets import FOLDER, VectorSet, next_list, read_sets, withdrawn
from gsvc_conformance.vector import files_in
from gsvc_conformance.vector_folder import VectorFolder


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = f"A set never changes. What it is, and what an erratum does, stands in {PROTOCOL}.".replace(
        "%", "%%"
    )
    add_vectors(parser)
    parser.add_argument(
        "--new", action="store_true",
        help="write the next set: the vectors of the folder that the cases make, as `generate` wrote them",
    )  # fmt: skip


def run(arguments: Namespace) -> int:
    """Show or write; 0."""
    if arguments.new:
        write_next(arguments.vectors)
    sets = read_sets(files_in(arguments.vectors))
    show(*(lines(sets) or [f"{arguments.vectors} has no sets"]))
    return 0


def lines(sets: Mapping[int, VectorSet]) -> Iterable[str]:
    """A line for each set: its number, how many vectors it has and what is new, and its hash."""
    found, before = [], None
    for one in sets.values():
        news = "" if before is None else _news(before, one)
        found.append(f"set {one.number}: {plural(len(one.digests), 'vector')}{news}, SHA-256 {one.sha256}")
        before = one
    return found


def _news(before: VectorSet, after: VectorSet) -> str:
    """The difference between two sets, in brackets."""
    added, gone = after.digests.keys() - before.digests.keys(), sorted(before.digests.keys() - after.digests.keys())
    withdrawals = f"; withdrawn: {', '.join(gone)}" if gone else ""
    return f" ({len(added)} new{withdrawals})"


def write_next(folder: Path) -> None:
    """Write the list of the next set into a folder of vectors.

    Raises
    ------
    UsageError
        It is an archive, a vector that the cases make is missing, or no set can be made of them.
    """
    from gsvc_conformance.case import FULL, cases

    if folder.is_file():
        raise UsageError(f"{folder} is an archive: name a folder with --vectors")
    vectors, sets = VectorFolder(folder), read_sets(files_in(folder))
    names = [name for name, case in cases().items() if case.tier != FULL]
    if gone := set(names) - set(vectors.names) - withdrawn(sets):
        raise UsageError(f"{folder} lacks {min(gone)}: write the vectors first, with gsvc-conformance generate")
    number, text = next_list(sets, {name: vectors.manifest(name) for name in names})
    (folder / FOLDER).mkdir(exist_ok=True)
    (folder / FOLDER / f"{number}.txt").write_bytes(text)
