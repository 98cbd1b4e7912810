"""``capacities``: whether the vectors are large enough, dimension by dimension."""

from argparse import ArgumentParser, Namespace

from gsvc_base.cli.text import show
from gsvc_conformance.capacities import CAPACITIES, Row, rows
from gsvc_conformance.commands import add_selection, add_vectors, selection
from gsvc_conformance.operation import operations
from gsvc_conformance.vector_folder import VectorFolder


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    add_vectors(parser)
    add_selection(parser)


def run(arguments: Namespace) -> int:
    """Print the table in Markdown; 0 if every capacity that is demanded is caught, else 1."""
    folder = VectorFolder(arguments.vectors)
    names = folder.select(selection(arguments))
    show("| operation | profile | dimension | largest | demanded | caught |", "|---|---|---|---|---|---|")
    missed = 0
    for name, operation in operations().items():
        of_operation = [vector for vector in names if vector.split("/")[1] == name]
        for row in rows(operation, folder.read(of_operation)) if of_operation else ():
            show(line(row))
            missed += len(row.missed)
    show("", f"not caught: {missed:,}" if missed else "every capacity is caught")
    return 1 if missed else 0


def line(row: Row) -> str:
    """A row of the table."""
    demanded = f"32 to {max(row.demanded):,}" if row.demanded else "none"
    because = f" ({row.reason})" if row.reason and row.demanded != CAPACITIES else ""
    missed = ", ".join(f"{k:,}" for k in row.missed)
    caught = f"not {missed}" if missed else "all" if row.demanded else ""
    return f"| `{row.operation}` | {row.profile} | {row.dimension} | {row.largest:,} | {demanded}{because} | {caught} |"
