"""The parser of a command line."""

from argparse import ArgumentParser
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NoReturn

from gsvc_base.cli.errors import EXIT_USAGE, say


class Parser(ArgumentParser):
    """A parser whose complaints look like all other messages: the command, what is wrong, what to do."""

    commands: "Mapping[str, Parser]" = MappingProxyType({})

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
    """The known word that is nearest to one that is not, as a part of a sentence; nothing if none is near."""
    from difflib import get_close_matches  # only a mistake needs it

    near = get_close_matches(word.partition("=")[0], [*known], n=1)
    return f" (did you mean {near[0]}?)" if near else ""
