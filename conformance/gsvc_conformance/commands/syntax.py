"""``syntax``: write the syntax of spec.md as data, or compare it with what spec.md says."""

from argparse import ArgumentParser, Namespace

from gsvc_conformance.syntax_files import FILES, stale, write
from gsvc_ref.cli.text import show


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument("--write", action="store_true", help=f"write {' and '.join(FILES)} anew")


def run(arguments: Namespace) -> int:
    """Write, or compare; 1 if a comparison finds differences."""
    if arguments.write:
        for name in write():
            show(f"wrote {name}")
        return 0
    names = stale()
    for name in names:
        show(f"{name} is not what spec.md gives; write it with: gsvc-conformance syntax --write")
    return 1 if names else 0
