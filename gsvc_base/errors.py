"""The two exceptions that gsvc_ref raises on purpose, bad data and wrong use, and a name for those of the system."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, Final, Literal

ErrorKind = Literal["malformed", "invalid", "unsupported", "limit"]

ERROR_KINDS: Final[tuple[ErrorKind, ...]] = ("malformed", "invalid", "unsupported", "limit")


class GsvcError(Exception):
    """Data that cannot be read: a `.gsvc` stream or a source video.

    Attributes
    ----------
    kind
        ``malformed`` (cannot be parsed), ``invalid`` (parsed, breaks a rule), ``unsupported`` (legal, beyond this
        decoder) or ``limit`` (a stated limit is exceeded); spec.md section 12.
    message
        Sentence that says what was wrong, what is allowed, and what to do.
    rule
        Requirement id of spec.md that the data breaks (``R-6.2-2``), or None for other files than streams.
    bit
        Offset in bits from the start of the stream of the element at fault, or None.
    """

    def __init__(self, kind: ErrorKind, message: str, *, rule: str | None = None, bit: int | None = None) -> None:
        self.kind: ErrorKind = kind
        self.message = message
        self.rule = rule
        self.bit = bit
        super().__init__(kind, message, rule, bit)

    def __reduce__(self) -> Any:
        """An exception is made again from its arguments by position; other processes hand it back so."""
        return partial(type(self), self.kind, self.message, rule=self.rule, bit=self.bit), ()

    def __str__(self) -> str:
        place = ", ".join(
            part
            for part in (self.rule, f"byte {self.bit // 8} bit {self.bit % 8}" if self.bit is not None else None)
            if part
        )
        return f"{self.kind}: {self.message}" + (f" [{place}]" if place else "")


class UsageError(ValueError):
    """A wrong argument: the message says what is allowed."""


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Let errors of the operating system that name no file, as those of writing, name this one."""
    try:
        yield
    except OSError as error:
        if error.errno is not None and error.filename is None:
            error.filename = name
        raise
