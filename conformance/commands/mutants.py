"""``mutants``: check the suite itself: every named bug must be found by a vector."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable
from fnmatch import fnmatchcase
from functools import cache
from itertools import islice
from typing import TYPE_CHECKING

from conformance.commands import add_selection, add_vectors, selection
from conformance.selection import VectorFolder
from conformance.vectors import Vector
from gsvc_ref.cli.progress import ProgressDisplay
from gsvc_ref.cli.text import plural, print_json, show
from gsvc_ref.errors import UsageError

if TYPE_CHECKING:
    from conformance.mutants import Mutant


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = (
        "A mutant is the decoder inside spec.md with one bug. Exit code 1: one of them survives all vectors."
    )
    add_vectors(parser)
    add_selection(parser)
    parser.add_argument("--mutant", action="append", default=[], metavar="GLOB", help="only these mutants")
    parser.add_argument("--all", action="store_true", help="name every vector that finds a mutant, not only the first")
    parser.add_argument("--json", action="store_true", help="print the table as JSON")
    parser.add_argument("--quiet", action="store_true", help="show no progress")


def run(arguments: Namespace) -> int:
    """Run each mutant against the vectors that it can reach; 0 if all are found, else 1."""
    from conformance.mutants import all_mutants

    patterns = arguments.mutant or ["*"]
    mutants = [m for m in all_mutants() if any(fnmatchcase(m.name, pattern) for pattern in patterns)]
    if not mutants:
        raise UsageError(
            f"no mutant is called {' or '.join(patterns)}; there are {plural(len(all_mutants()), 'mutant')}"
        )
    folder = VectorFolder(arguments.vectors)
    vectors = list(folder.read(folder.select(selection(arguments))))
    found: dict[str, list[str]] = {}
    with ProgressDisplay(quiet=arguments.quiet) as display:
        for done, mutant in enumerate(mutants):
            display.update(mutant.name, done, len(mutants))
            found[mutant.name] = killers(mutant, vectors, everyone=arguments.all)
            if not (found[mutant.name] or arguments.json):
                show(f"{mutant.name} SURVIVES: {mutant.sentence}")
    if arguments.json:
        print_json(found)
    else:
        show(*describe(found))
    return 0 if all(found.values()) else 1


def killers(mutant: "Mutant", vectors: Iterable[Vector], *, everyone: bool) -> list[str]:
    """The vectors that find a mutant: all of them or the first, those that say they do before the others."""
    from conformance.mutants import kills

    order = sorted(vectors, key=lambda vector: mutant.name not in vector.manifest.get("kills", ()))
    found = (vector.id for vector in order if runs(vector) & mutant.touched() and kills(vector, mutant))
    return list(found) if everyone else list(islice(found, 1))


@cache
def runs(vector: Vector) -> frozenset[str]:
    """The functions of spec.md that a vector runs: only mutants of these can answer it differently."""
    from conformance.mutants import called

    return called(vector.stage, vector.inputs)


def describe(found: dict[str, list[str]]) -> list[str]:
    """Who found each mutant, and the verdict last."""
    lines = [f"{name}: {', '.join(names)}" for name, names in found.items() if names]
    alive = len(found) - len(lines)
    verdict = f"{alive} of {plural(len(found), 'mutant')} survive" if alive else "every mutant is found"
    return [*lines, "", f"{plural(len(found), 'mutant')}: {verdict}"]
