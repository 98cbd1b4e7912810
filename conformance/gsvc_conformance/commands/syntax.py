"""``syntax``: write the syntax of spec.md as data, or compare it with what spec.md says."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from gsvc_base.cli.text import show
from gsvc_base.errors import UsageError
from gsvc_conformance.syntax_files import FILES, ROOT, stale, write


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument("--write", action="store_true", help=f"write {' and '.join(FILES)} anew")
    parser.add_argument(
        "--into", type=Path, default=ROOT, metavar="DIR",
        help="the folder that these lie below (default: that of the checkout; without one, the current folder)",
    )  # fmt: skip


def run(arguments: Namespace) -> int:
    """Write, or compare; 1 if a comparison finds differences.

    Raises
    ------
    UsageError
        There is nothing to compare.
    """
    if arguments.write:
        for name in write(arguments.into):
            show(f"wrote {name}")
        return 0
    if not any((arguments.into / name).is_file() for name in FILES):
        raise UsageError(f"{arguments.into.resolve()} has neither {' nor '.join(FILES)}: give the folder of a checkout "
                         "of GSVC's repository (--into DIR), or write them (--write)")  # fmt: skip
    names = stale(arguments.into)
    for name in names:
        show(f"{name} is not what spec.md gives; write it with: gsvc-conformance syntax --write")
    return 1 if names else 0
