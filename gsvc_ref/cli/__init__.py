"""The command ``gsvc``: one module per command, each with `add_command`; heavy imports happen inside a command's `run`.

Exit codes: 0 done; 1 bad data, or a file that cannot be read or written (what was saved is said); 2 wrong use;
70 a fault of gsvc_ref itself; interrupted: 130 with Ctrl-C, 143 with SIGTERM, 129 with SIGHUP; 141 the reader of
standard output went away.
"""

import gc
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Final

from gsvc_base.cli.errors import EXIT_USAGE, guarded, prepare_streams, say
from gsvc_base.cli.parser import Parser, suggestion
from gsvc_base.interrupts import termination_as_ctrl_c
from gsvc_ref import __version__, plugins

MODULES: Final = {"encode": "gsvc_ref.cli.encode", "decode": "gsvc_ref.cli.decode"}
"""The module of each command of this package."""

ORDER: Final = ("encode", "decode", "view", "info", "dump", "compare", "concat", "cut", "import", "export")
"""The order of ``gsvc --help``. Commands of plug-ins that are not named here come last."""

EXTENDED: Final = ("encode",)
"""Commands of this package that a plug-in may replace by one that does more."""

COLLECT_AFTER: Final = 100_000
"""Objects after which Python looks for cyclic garbage; by default 700. Loading a thousand modules makes none."""


def build_parser(named: str | None = None) -> Parser:
    """The parser of all commands, or of the one that is named, so that its start does not wait for the others.

    Parsing sets `command` and `run`, the function that takes the parsed arguments.
    """
    parser = Parser(prog="gsvc", description="GSVC: video as sums of 2D Gaussian splats.", allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"gsvc {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    is_known = named in MODULES and named not in EXTENDED
    modules = MODULES if is_known else {**MODULES, **plugins.commands()}
    for command in [named] if named in modules else sorted(modules, key=_place):
        import_module(modules[command]).add_command(commands)
    parser.commands = commands.choices
    parser.epilog = "gsvc COMMAND --help tells the options of a command. Start with: gsvc demo"
    return parser


def _place(command: str) -> int:
    """The place of a command in `ORDER`; sorting keeps the order of those that come last."""
    return ORDER.index(command) if command in ORDER else len(ORDER)


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code (see the package's docstring); None takes the arguments of the process."""
    prepare_streams()
    with rare_collections():
        return guarded("gsvc", lambda: _run(argv))


@contextmanager
def rare_collections() -> Iterator[None]:
    """Let Python look for garbage rarely: a fifth of a command's start went there."""
    before = gc.get_threshold()
    gc.set_threshold(COLLECT_AFTER, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


def _run(argv: Sequence[str] | None) -> int:
    given = sys.argv[1:] if argv is None else argv
    parser = build_parser(given[0] if given else None)
    if given and not given[0].startswith("-") and given[0] not in parser.commands:
        say("gsvc", f"there is no command {given[0]!r}{suggestion(given[0], parser.commands)}; see gsvc --help")
        return EXIT_USAGE
    try:
        arguments, unknown = parser.parse_known_args(given)
    except SystemExit as end:  # argparse has said why
        return int(end.code or 0)
    command = f"gsvc {arguments.command}" if arguments.command else "gsvc"
    if unknown:
        say(command, f"{parser.unknown(unknown[0], arguments.command)}; see {command} --help")
        return EXIT_USAGE
    if arguments.command is None:
        parser.print_help(sys.stderr)
        return EXIT_USAGE
    with termination_as_ctrl_c() as exit_code:
        return exit_code(guarded(command, lambda: int(arguments.run(arguments))))
