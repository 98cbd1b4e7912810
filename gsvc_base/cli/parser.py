"""The parser of a command line."""

from argparse import SUPPRESS, Action, ArgumentParser, Namespace
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, NoReturn

from gsvc_base.cli.errors import EXIT_USAGE, say

OTHER_NAMES: Final[Mapping[str, tuple[str, ...]]] = {
    "convert": ("encode", "decode"), "compress": ("encode",), "transcode": ("encode",), "extract": ("decode",),
    "play": ("view",), "show": ("view",), "open": ("view",), "probe": ("info",), "trim": ("cut",), "join": ("concat",),
    "-crf": ("--quality",), "--crf": ("--quality",), "--qp": ("--quality",), "-q": ("--quality",), "-b": ("--bitrate",),
    "-r": ("--fps",), "-s": ("--scale",), "-j": ("--jobs",), "-g": ("--key-frames",), "--gop": ("--key-frames",),
}  # fmt: skip
"""What other tools call our commands and options."""


class Parser(ArgumentParser):
    """A parser whose complaints look like all other messages: the command, what is wrong, what to do.

    Options may stand anywhere between the names of files.
    """

    commands: "Mapping[str, Parser]" = MappingProxyType({})
    _intermixed = False  # whether it is inside `parse_known_intermixed_args`, which may call `parse_known_args`

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> tuple[Any, list[str]]:  # type: ignore[override]
        """Parse options and names in any order; a parser of commands takes its own options first."""
        if self._subparsers is not None or self._intermixed:
            return super().parse_known_args(args, namespace)
        self._intermixed = True
        try:
            return self.parse_known_intermixed_args(args, namespace or Namespace())
        finally:
            self._intermixed = False

    def unknown(self, word: str, command: str | None) -> str:
        """What is said of an argument that the program, or its command, does not know."""
        parser = self.commands.get(command or "", self)
        near = suggestion(word, parser._option_string_actions) if word.startswith("-") else ""
        return f"unknown argument {word}{near}"

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line and exit."""
        say(self.prog, f"{message}; see {self.prog} --help")
        self.exit(EXIT_USAGE)


def suggestion(word: str, known: Iterable[str]) -> str:
    """The known words that an unknown one may stand for, as a part of a sentence; nothing if none is near."""
    from difflib import get_close_matches  # only a mistake needs it

    word, names = word.partition("=")[0], [*known]
    near = [name for name in OTHER_NAMES.get(word, ()) if name in names]
    near = near or [name for name in names if len(word) > 2 and name.startswith(word)][:3]
    near = near or get_close_matches(word, names, n=1)
    return f" (did you mean {' or '.join(near)}?)" if near else ""


def add_output(parser: ArgumentParser, metavar: str, meaning: str) -> None:
    """Add the name of the output, after that of the input or with ``-o``; `output` is None where it is not given."""
    parser.add_argument("output", action=_Once, metavar=metavar, nargs="?", default=SUPPRESS, help=meaning)
    parser.add_argument("-o", "--output", action=_Once, dest="output", metavar=metavar, help="the same")


class _Once(Action):
    """Store a value, unless there is another one."""

    def __call__(self, parser: ArgumentParser, namespace: Namespace, values: Any, option_string: Any = None) -> None:
        if (before := getattr(namespace, self.dest, None)) not in (None, values):
            parser.error(f"two names of the {self.dest}: {before} and {values}")
        setattr(namespace, self.dest, values)
