"""The parser of a command line."""

from argparse import ArgumentParser
from typing import NoReturn

from gsvc_ref.cli.errors import EXIT_USAGE, say


class Parser(ArgumentParser):
    """A parser whose complaints look like all other messages: the command, what is wrong, what to do."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line and exit."""
        say(self.prog, f"{message}; see {self.prog} --help")
        self.exit(EXIT_USAGE)
