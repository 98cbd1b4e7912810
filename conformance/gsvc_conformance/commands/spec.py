"""``spec``: run the decoder inside spec.md over the vectors."""

from argparse import ArgumentParser, Namespace

from gsvc_conformance.commands.judging import add_judging, judge
from gsvc_conformance.commands.run import spec_implementation


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = "The same as: gsvc-conformance run --spec"
    add_judging(parser)


def run(arguments: Namespace) -> int:
    """Judge and report."""
    return judge(arguments, spec_implementation(), ["gsvc-conformance", "spec"])
