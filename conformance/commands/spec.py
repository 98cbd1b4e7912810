"""``spec``: run the decoder inside spec.md over the vectors."""

from argparse import ArgumentParser, Namespace

from conformance.commands.judging import add_judging, judge
from conformance.commands.run import spec_implementation


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = "The same as: python -m conformance run --spec"
    add_judging(parser)


def run(arguments: Namespace) -> int:
    """Judge and report."""
    return judge(arguments, spec_implementation(), ["python", "-m", "conformance", "spec"])
