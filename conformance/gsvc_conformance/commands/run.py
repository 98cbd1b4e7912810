"""``run``: judge an implementation by the vectors."""

from argparse import ArgumentParser, Namespace
from contextlib import ExitStack
from typing import Final

from gsvc_base.cli.arguments import positive, whole
from gsvc_base.errors import UsageError
from gsvc_base.interrupts import sparing_children
from gsvc_conformance import implementations, process, server
from gsvc_conformance.commands import PROTOCOL
from gsvc_conformance.commands.judging import add_judging, judge

TIMEOUT: Final = 60.0


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = (
        f"Results are explained in {PROTOCOL}. Exit code 0: nothing is wrong and something passes; "
        "1: something is wrong; 2: nothing was judged."
    ).replace("%", "%%")
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--impl", metavar="CMD", help="a command, started as: CMD OPERATION IN_DIR OUT_DIR")
    which.add_argument(
        "--serve", metavar="CMD", help="a command that is started once, and answers one vector after the other"
    )
    which.add_argument(
        "--module",
        metavar="NAME",
        help="a Python module (mine, not mine.py) with functions named as the operations; from the current folder, "
        "installed, or in PYTHONPATH",
    )
    which.add_argument("--reference", action="store_true", help="gsvc_ref itself")
    which.add_argument("--spec", action="store_true", help="the decoder inside spec.md")
    parser.add_argument(
        "--timeout",
        type=positive,
        default=TIMEOUT,
        metavar="S",
        help=f"seconds for one vector, with --impl and --serve ({TIMEOUT:g})",
    )
    parser.add_argument(
        "--start-timeout",
        type=positive,
        default=server.START_S,
        metavar="S",
        help=f"seconds from the start of a server to its hello, with --serve ({server.START_S:g})",
    )
    parser.add_argument(
        "--environment",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="what it runs on, for reports: device=..., driver=...; a module tells it by a function `environment`, a "
        "server by its hello",
    )
    parser.add_argument(
        "--jobs", type=whole, default=1, metavar="N", help="processes at the same time, with --impl and --serve (1)"
    )
    add_judging(parser)


def run(arguments: Namespace) -> int:
    """Judge and report."""
    if arguments.jobs < 1 or (arguments.jobs > 1 and arguments.impl is None and arguments.serve is None):
        raise UsageError(
            "--jobs must be at least 1, and needs --impl or --serve: a module answers one vector after the other"
        )
    with ExitStack() as stack:
        return judge(arguments, _implementation(arguments, stack), _command(arguments))


def _implementation(arguments: Namespace, stack: ExitStack) -> implementations.Implementation:
    """The implementation that the options name; what has to be ended goes onto the stack."""
    if arguments.impl is not None:
        return process.ProcessImplementation(arguments.impl, arguments.timeout)
    if arguments.serve is not None:
        served = server.ServerImplementation(arguments.serve, arguments.timeout, arguments.start_timeout)
        return stack.enter_context(served)
    if arguments.module is not None:
        stack.enter_context(sparing_children())
        return implementations.load_module(arguments.module)
    return spec_implementation() if arguments.spec else reference_implementation()


def reference_implementation() -> implementations.Implementation:
    """The project's own reference."""
    from gsvc_conformance import reference

    return implementations.from_namespace("gsvc_ref", reference.namespace())


def spec_implementation() -> implementations.Implementation:
    """The decoder inside spec.md."""
    from gsvc_conformance import spec

    return implementations.from_namespace("spec.md", spec.namespace())


def _command(arguments: Namespace) -> list[str]:
    words = ["gsvc-conformance", "run"]
    if (program := arguments.impl or arguments.serve) is not None:
        words += ["--impl" if arguments.impl else "--serve", program]
        words += ["--timeout", f"{arguments.timeout:g}"] * (arguments.timeout != TIMEOUT)
        waits = arguments.serve is not None and arguments.start_timeout != server.START_S
        words += ["--start-timeout", f"{arguments.start_timeout:g}"] * waits
    elif arguments.module is not None:
        words += ["--module", arguments.module]
    else:
        words.append("--spec" if arguments.spec else "--reference")
    return [*words, *(["--repeat", str(arguments.repeat)] * (arguments.repeat > 1))]
