"""The commands of ``gsvc-conformance``, each with `add_arguments` and `run`, and what they share."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path
from typing import Final, get_args

from gsvc_base.cli.arguments import whole
from gsvc_base.errors import UsageError
from gsvc_conformance.operation import Group, checked_operations
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector_folder import ALL_TIERS, Selection, VectorFolder, Wanted

_HERE: Final = Path(__file__).parents[1]
PROTOCOL: Final = next(
    (path for path in (_HERE / "protocol.md", _HERE.parent / "protocol.md") if path.exists()), Path("protocol.md")
)
"""The document that says how an implementation is asked: in the package where that is installed, else beside it."""


def add_vectors(parser: ArgumentParser) -> None:
    """The folder of the vectors."""
    parser.add_argument(
        "--vectors", type=Path, default=VECTORS, metavar="DIR",
        help="a folder of vectors, or an archive (zip) of one (default: those of the project)",
    )  # fmt: skip


def add_set(parser: ArgumentParser) -> None:
    """The set of the vectors."""
    parser.add_argument(
        "--set", type=_set_argument, default="newest", metavar="N",
        help="the vectors of this set (default: the newest); all: also those that no set lists yet",
    )  # fmt: skip


def _set_argument(text: str) -> Wanted:
    """The same for a parser of arguments."""
    try:
        return wanted_set(text)
    except UsageError as error:
        raise ArgumentTypeError(str(error)) from None


def wanted_set(text: str) -> Wanted:
    """The number of a set, ``newest`` or ``all``.

    Raises
    ------
    UsageError
        It is none of these.
    """
    if text in ("newest", "all"):
        return text  # type: ignore[return-value]
    if not text.isdecimal() or int(text) < 1:
        raise UsageError(f"a set is named by its number, such as 1, newest or all, not {text!r}")
    return int(text)


def vectors_of(arguments: Namespace) -> VectorFolder:
    """The vectors that `add_vectors` and `add_set` name."""
    return VectorFolder(arguments.vectors, arguments.set)


def add_selection(parser: ArgumentParser) -> None:
    """Options that select vectors or cases; each may be given several times."""
    options = parser.add_argument_group(
        "selection", "each may be given several times, for any of the values; what different options say must all hold"
    )
    options.add_argument("--tier", action="append", default=[], choices=ALL_TIERS, help="of this tier")
    options.add_argument("--operation", action="append", default=[], metavar="NAME", help="of this operation")
    options.add_argument(
        "--class", action="append", default=[], choices=get_args(Group), dest="group", help="of this conformance class"
    )
    options.add_argument(
        "--case", action="append", default=[], metavar="GLOB", help="whose id, or its last part, matches: '*needle*'"
    )
    options.add_argument("--rule", action="append", default=[], metavar="ID", help="that exercise it: R-10.3-1")
    options.add_argument("--equation", action="append", default=[], metavar="NUMBER", help="that exercise it: 9-4")
    options.add_argument(
        "--flag",
        action="append",
        default=[],
        metavar="NAME",
        help="for this class of mistakes: needle; list --json shows which each vector has",
    )


def selection(arguments: Namespace) -> Selection:
    """The selection that the options make.

    Raises
    ------
    UsageError
        An operation does not exist.
    """
    return Selection(
        tiers=tuple(arguments.tier),
        operations=checked_operations(arguments.operation),
        groups=tuple(arguments.group),
        patterns=tuple(arguments.case),
        rules=tuple(arguments.rule),
        equations=tuple(equation.strip("()") for equation in arguments.equation),
        flags=tuple(arguments.flag),
    )


def count(text: str) -> int:
    """A whole number that is not negative."""
    if (value := whole(text)) < 0:
        raise ArgumentTypeError(f"{text!r} is less than 0")
    return value


def times(text: str) -> int:
    """A whole number of times, at least once."""
    if (value := count(text)) < 1:
        raise ArgumentTypeError(f"{text!r} is less than 1")
    return value
