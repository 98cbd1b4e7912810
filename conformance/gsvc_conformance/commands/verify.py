"""``verify``: check the vectors themselves."""

from argparse import ArgumentParser, Namespace
from collections import Counter
from importlib import import_module

from gsvc_base.cli.text import plural, show, table
from gsvc_conformance import reference
from gsvc_conformance.commands import add_vectors
from gsvc_conformance.operation import operations
from gsvc_conformance.vector import SUMS, files_in
from gsvc_conformance.vector_folder import ALL_TIERS, VectorFolder


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    add_vectors(parser)


def run(arguments: Namespace) -> int:
    """Print counts, the hashes and what is wrong; 0 if nothing is, else 1."""
    import_module("jsonschema")  # if it is missing, this is said before any work
    from gsvc_conformance.coverage import verify

    folder = VectorFolder(arguments.vectors)
    names = folder.names
    show(*counts(names))
    files = files_in(arguments.vectors)
    size = sum(map(files.size, files))
    show(f"\n{plural(len(names), 'vector')}, {size / 1e6:.2f} MB", f"SHA-256 of {SUMS}: {folder.sha256}")
    if (last := VectorFolder(arguments.vectors, "newest")).set:
        show(f"SHA-256 of set {last.set.number}, which verdicts quote: {last.sha256}")
    whole = reference.is_installed()
    problems = verify(arguments.vectors, whole=whole)
    for problem in problems:
        show(problem)
    if not whole:
        show("syntax elements and COVERAGE.md were not checked: that needs gsvc_ref, the extra `reference`")
    show(f"{plural(len(problems), 'problem')}" if problems else "nothing is wrong")
    return 1 if problems else 0


def counts(names: list[str]) -> list[str]:
    """A table of vectors by operation and tier."""
    count = Counter(tuple(name.split("/")[:2]) for name in names)
    tiers = [tier for tier in ALL_TIERS if any(key[0] == tier for key in count)]
    rows = [[name, *(str(count[tier, name] or "") for tier in tiers)] for name in operations()]
    total = ["all", *(str(sum(n for key, n in count.items() if key[0] == tier)) for tier in tiers)]
    return table(["operation", *tiers], [*rows, total])
