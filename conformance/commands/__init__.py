"""The commands of ``python -m conformance``, each with `add_arguments` and `run`, and what they share."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import get_args

from conformance.selection import ALL_LEVELS, Selection
from conformance.stage import Group, stages
from conformance.vectors import VECTORS
from gsvc_ref.errors import UsageError


def add_vectors(parser: ArgumentParser) -> None:
    """The folder of the vectors."""
    parser.add_argument("--vectors", type=Path, default=VECTORS, metavar="DIR", help="the vectors (default: vectors/)")


def add_selection(parser: ArgumentParser) -> None:
    """Options that select vectors or cases; each may be given several times."""
    options = parser.add_argument_group("selection", "each may be given several times; all kinds must hold")
    options.add_argument("--level", action="append", default=[], choices=ALL_LEVELS, help="of this level")
    options.add_argument("--stage", action="append", default=[], metavar="NAME", help="of this stage")
    options.add_argument(
        "--class", action="append", default=[], choices=get_args(Group), dest="group", help="of this conformance class"
    )
    options.add_argument(
        "--case", action="append", default=[], metavar="GLOB", help="whose id, or its last part, matches: '*needle*'"
    )


def selection(arguments: Namespace) -> Selection:
    """What is selected.

    Raises
    ------
    UsageError
        A stage does not exist.
    """
    for name in arguments.stage:
        if name not in stages():
            raise UsageError(f"there is no stage {name!r}; the stages are {', '.join(stages())}")
    return Selection(tuple(arguments.level), tuple(arguments.stage), tuple(arguments.group), tuple(arguments.case))


def selection_words(arguments: Namespace, *, cases: bool = True) -> list[str]:
    """The options that select the same again."""
    kinds = [("--level", arguments.level), ("--stage", arguments.stage), ("--class", arguments.group)]
    kinds += [("--case", arguments.case)] if cases else []
    return [word for option, values in kinds for value in values for word in (option, value)]


def check_writable(path: Path | None) -> None:
    """Refuse a file that cannot be written, before work is done for it.

    Raises
    ------
    UsageError
        It is a folder, or its folder does not exist.
    """
    if path is not None and (path.is_dir() or not path.parent.is_dir()):
        raise UsageError(f"{path} cannot be written: give a file name in a folder that exists")
