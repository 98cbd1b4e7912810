"""Sources of random data: one interface over Hypothesis, which shrinks what fails, and over a plain seed."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TypeVar

from gsvc_base.draws import Draws

T = TypeVar("T")


class Choices(ABC):
    """The questions of a generator of random data; the answers to all follow from `integer`."""

    @abstractmethod
    def integer(self, lowest: int, highest: int) -> int:
        """An integer in lowest..highest."""

    def pick(self, options: Sequence[T]) -> T:
        """One of some options; Hypothesis shrinks towards the first."""
        return options[self.integer(0, len(options) - 1)]

    def boolean(self) -> bool:
        """False or true."""
        return self.pick((False, True))

    def generator(self) -> Draws:
        """A generator of another seed, to paint bulk data with."""
        return Draws(self.integer(0, 2**32 - 1))

    def binary(self, longest: int) -> bytes:
        """At most `longest` bytes."""
        return bytes(self.integer(0, 255) for _ in range(self.integer(0, longest)))


class SeededChoices(Choices):
    """Choices that a seed determines."""

    def __init__(self, seed: int) -> None:
        self._rng = Draws(seed)

    def integer(self, lowest: int, highest: int) -> int:
        """An integer in lowest..highest."""
        return self._rng.integers(lowest, highest + 1)
