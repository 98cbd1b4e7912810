"""``export``: write the vectors in the form of other tools."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from gsvc_conformance.commands import add_vectors
from gsvc_ref.cli.text import show


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    add_vectors(parser)
    form = parser.add_mutually_exclusive_group(required=True)
    form.add_argument(
        "--fluster", type=Path, metavar="OUT",
        help="write a test suite, its streams and a decoder class for fluster to a new folder",
    )  # fmt: skip


def run(arguments: Namespace) -> int:
    """Write what is asked for; 0."""
    from gsvc_conformance.fluster import export, lines

    count = export(arguments.vectors, arguments.fluster)
    show(*lines(arguments.fluster, count))
    return 0
