"""Guesses at a name that does not exist."""

from collections.abc import Iterable
from difflib import get_close_matches


def meant(word: str, names: Iterable[str], most: int = 3) -> list[str]:
    """The names that are nearest to a word, the nearest first; none if none is near."""
    return get_close_matches(word, list(names), most)


def question(word: str, names: Iterable[str]) -> str:
    """``; did you mean A or B?``, or nothing."""
    near = meant(word, names)
    return f"; did you mean {' or '.join(near)}?" if near else ""
