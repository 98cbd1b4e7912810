"""``gsvc-conformance``: one module per command in `gsvc_conformance.commands`, imported when it is asked for.

Exit codes: 0 nothing is wrong, or done; 1 something is wrong with the implementation or the vectors; 2 wrong use, or
nothing was judged; 70, 129, 130, 141, 143 as ``gsvc``.
"""

import importlib
import sys
from argparse import Action
from collections.abc import Sequence
from typing import Any, Final

from gsvc_base.cli.errors import EXIT_USAGE, guarded, prepare_streams, say
from gsvc_base.cli.parser import Parser
from gsvc_base.cli.text import show
from gsvc_base.errors import UsageError
from gsvc_base.interrupts import termination_as_ctrl_c
from gsvc_conformance import __version__

PROGRAM: Final = "gsvc-conformance"
USING: Final = {
    "run": "judge an implementation by the vectors",
    "list": "show the operations, with their inputs and outputs, or the vectors",
    "report": "make the page, the summary, the badge or JUnit XML again from the JSON of a run",
    "compare": "name what passed in one report and not in a later one, or show several beside each other",
    "make": "make a vector of your own from inputs of an operation",
    "check": "say whether files are legal streams, which level they need, and where their I-frames are",
    "streams": "write random legal streams with what they decode to",
    "export": "write vectors in the forms of other projects: glTF, fluster",
}
MAINTAINING: Final = {
    "verify": "check the vectors: schemas, hashes, coverage, counts",
    "capacities": "show how large the vectors are, and what they catch",
    "spec": "run the decoder inside spec.md over the vectors",
    "mutants": "check the suite: every mutant must be found",
    "generate": "write the vectors, or compare them with what the cases make",
    "sets": "show the sets of vectors that verdicts name, or write the next one",
    "syntax": "write the syntax of spec.md as data for programs, or compare it with spec.md",
}
"""Commands for those who maintain the vectors."""
COMMANDS: Final = USING | MAINTAINING

OURS: Final = ("gsvc_conformance",)
INSTALLS: Final = {"numpy": "pip install gsvc-conformance", "jsonschema": "pip install 'gsvc-conformance[verify]'"}
"""What brings a package."""
REFERENCE: Final = "in a checkout of the repository, pip install . './conformance[reference]'"
"""What brings any other: gsvc_ref and what it needs. pip takes both of ours from the checkout."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code.

    Parameters
    ----------
    argv
        The arguments without the program's name; None takes those of the process.
    """
    prepare_streams()
    words = list(sys.argv[1:] if argv is None else argv)
    named = words[0] if words and words[0] in COMMANDS else None
    command = f"{PROGRAM} {named}" if named else PROGRAM
    with termination_as_ctrl_c() as exit_code:
        return exit_code(guarded(command, lambda: _with_packages(words, named)))


def build_parser(named: str | None) -> Parser:
    """The parser; only the command that is named gets its arguments, so that only its module is imported."""
    parser = Parser(prog=PROGRAM, description="The conformance kit of GSVC.", allow_abbrev=False)
    parser.add_argument("--version", action=_Version, nargs=0, help="show the versions of the kit, vectors and spec.md")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    for name, sentence in COMMANDS.items():
        description = f"{sentence[0].upper()}{sentence[1:]}."
        mark = "for maintainers: " if name in MAINTAINING else ""
        command = commands.add_parser(name, help=f"{mark}{sentence}", description=description, allow_abbrev=False)
        if name == named:
            module = importlib.import_module(f"gsvc_conformance.commands.{name}")
            module.add_arguments(command)
            command.set_defaults(run=module.run)
    parser.epilog = (
        f"{PROGRAM} COMMAND --help tells the options. Start with: {PROGRAM} run --spec --operation from_half"
    )
    return parser


class _Version(Action):
    """Shows the versions that a verdict depends on, and ends."""

    def __call__(self, parser: Any, *_: object) -> None:
        from gsvc_conformance.sets import quoted
        from gsvc_conformance.vector import SPEC_VERSION, VECTORS
        from gsvc_conformance.vector_folder import VectorFolder

        vectors = VectorFolder(VECTORS, "newest")
        number = str(vectors.set.number) if vectors.set else ""
        show(f"{PROGRAM} {__version__}", quoted(number, vectors.sha256), f"spec.md {SPEC_VERSION}")
        parser.exit()


def _with_packages(words: list[str], named: str | None) -> int:
    """Run a command; a package that is missing is wrong use, and the message says what to install."""
    try:
        return _run(words, named)
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package in ("", *OURS):
            raise
        raise UsageError(f"needs {package}: {INSTALLS.get(package, REFERENCE)}") from None


def _run(words: list[str], named: str | None) -> int:
    parser = build_parser(named)
    try:
        arguments = parser.parse_args(words)
    except SystemExit as end:  # argparse has said why
        return int(end.code or 0)
    if arguments.command is None:
        parser.print_help(sys.stderr)
        return EXIT_USAGE
    if "run" not in arguments:
        say(PROGRAM, f"the command comes first: {PROGRAM} {arguments.command} ...")
        return EXIT_USAGE
    return int(arguments.run(arguments))


if __name__ == "__main__":
    raise SystemExit(main())
