"""``mutants``: check the suite itself: every mutant must be found by a vector."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable
from fnmatch import fnmatchcase
from functools import cache
from itertools import islice
from typing import TYPE_CHECKING, Final

from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import plural, print_json, show
from gsvc_base.errors import UsageError
from gsvc_conformance.commands import add_selection, add_vectors, selection
from gsvc_conformance.vector import Vector
from gsvc_conformance.vector_folder import VectorFolder

if TYPE_CHECKING:
    from gsvc_conformance.mutants import Mutant


UNREACHED: Final = "  No vector runs what it changes: add a case, and write vectors by `gsvc-conformance generate`."


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = (
        "A mutant is the decoder inside spec.md with one mistake. Exit code 1: one of them survives all vectors. "
        "With a selection, only those count that change what its vectors run and that no other vector says to find."
    )
    add_vectors(parser)
    add_selection(parser)
    parser.add_argument("--mutant", action="append", default=[], metavar="GLOB", help="only these mutants")
    parser.add_argument("--all", action="store_true", help="name every vector that finds a mutant, not only the first")
    parser.add_argument("--json", action="store_true", help="print the table as JSON")
    parser.add_argument("--quiet", action="store_true", help="show no progress")


def run(arguments: Namespace) -> int:
    """Run each mutant against the vectors that it can reach; 0 if all are found that count, else 1.

    Raises
    ------
    UsageError
        No mutant has such a name, or none changes what the selected vectors run.
    """
    from gsvc_conformance.mutants import MUTANTS

    patterns = arguments.mutant or ["*"]
    mutants = [m for m in MUTANTS if any(fnmatchcase(m.name, pattern) for pattern in patterns)]
    if not mutants:
        raise UsageError(f"no mutant is called {' or '.join(patterns)}; there are {plural(len(MUTANTS), 'mutant')}")
    folder = VectorFolder(arguments.vectors)
    names = folder.select(selection(arguments))
    vectors = list(folder.read(names))
    others = [name for name in folder.names if name not in set(names)]
    elsewhere = folder.killed_by(others)
    found: dict[str, list[str]] = {}
    left: list[str] = []
    with ProgressDisplay(quiet=arguments.quiet) as display:
        for done, mutant in enumerate(mutants):
            display.update(mutant.name, done, len(mutants))
            by = killers(mutant, vectors, everyone=arguments.all)
            if not by and others and (mutant.name in elsewhere or not _reached(mutant, vectors)):
                left.append(mutant.name)
                continue
            found[mutant.name] = by
            if not (by or arguments.json):
                show(f"{mutant.name} SURVIVES: {mutant.sentence}", *([] if _reached(mutant, vectors) else [UNREACHED]))
    if not found:
        raise UsageError(f"none of {plural(len(mutants), 'mutant')} is one that the selected vectors are to find")
    if arguments.json:
        print_json(found)
    else:
        show(*describe(found))
        if left:
            show(f"{plural(len(left), 'mutant')} left out: the vectors that are not selected are to find them")
    return 0 if all(found.values()) else 1


def _reached(mutant: "Mutant", vectors: Iterable[Vector]) -> bool:
    """Whether a mutant changes what some of the vectors run."""
    return any(runs(vector) & mutant.touched() for vector in vectors)


def killers(mutant: "Mutant", vectors: Iterable[Vector], *, everyone: bool) -> list[str]:
    """The vectors that find a mutant: all of them or the first, those that say they do before the others."""
    from gsvc_conformance.mutants import kills

    order = sorted(vectors, key=lambda vector: mutant.name not in vector.manifest.get("kills", ()))
    found = (vector.id for vector in order if runs(vector) & mutant.touched() and kills(vector, mutant))
    return list(found) if everyone else list(islice(found, 1))


@cache
def runs(vector: Vector) -> frozenset[str]:
    """The functions of spec.md that a vector runs: only mutants of these can answer it differently."""
    from gsvc_conformance.mutants import called

    return called(vector.operation, vector.inputs)


def describe(found: dict[str, list[str]]) -> list[str]:
    """Who found each mutant, and the verdict last."""
    lines = [f"{name}: {', '.join(names)}" for name, names in found.items() if names]
    alive = len(found) - len(lines)
    verdict = f"{alive} of {plural(len(found), 'mutant')} survive" if alive else "every mutant is found"
    return [*lines, "", f"{plural(len(found), 'mutant')}: {verdict}"]
