"""Many globs over many names: each is compiled at most once, and tried only on names with its rarest literal."""

import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator
from fnmatch import translate
from itertools import accumulate
from typing import Final

WILD: Final = re.compile(r"[*?\[]")
MAX_GLOB: Final = 1000
"""Characters of a glob; ids are shorter."""


class Names:
    """Names that globs are matched against, as by `fnmatch.fnmatchcase`."""

    def __init__(self, names: Iterable[str]) -> None:
        self._names = list(dict.fromkeys(names))
        self._known = frozenset(self._names)
        self._text = "\n".join(self._names)
        self._ends = list(accumulate(len(name) + 1 for name in self._names))

    def matching(self, glob: str) -> Iterator[str]:
        """The names that a glob matches, in their order."""
        if not WILD.search(glob):
            yield from (glob,) if glob in self._known else ()
            return
        matches: Callable[[str], bool] | None = None
        for name in self._having(literals(glob)):
            matches = matches or matcher(glob)
            if matches(name):
                yield name

    def _having(self, wanted: list[str]) -> Iterator[str]:
        """The names that contain the rarest of some texts; none if one of the texts occurs nowhere."""
        if not all(literal in self._text and "\n" not in literal for literal in wanted):
            return
        literal = min(wanted, key=self._text.count) if wanted[1:] else "".join(wanted)
        at = self._text.find(literal)
        while at >= 0:
            number = bisect_right(self._ends, at)
            if number == len(self._names):
                return
            yield self._names[number]
            at = self._text.find(literal, self._ends[number])


def literals(glob: str) -> list[str]:
    """Texts that every match of a glob contains: those before its first set of characters."""
    return sorted({*re.split(r"[*?]", glob.partition("[")[0])} - {""}, key=len, reverse=True)


def matcher(glob: str) -> Callable[[str], bool]:
    """A function that says whether a name matches a glob that has a wildcard."""
    if "?" in glob or "[" in glob:
        compiled = re.compile(translate(glob))
        return lambda name: compiled.match(name) is not None
    first, *middle, last = glob.split("*")

    def matches(name: str) -> bool:
        if not (name.startswith(first) and name.endswith(last) and len(name) >= len(first) + len(last)):
            return False
        at, end = len(first), len(name) - len(last)
        for part in middle:
            found = name.find(part, at, end)
            if found < 0:
                return False
            at = found + len(part)
        return True

    return matches
