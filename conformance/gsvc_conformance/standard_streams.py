"""Standard output and standard error of the kit, which code of others shares while a module is judged."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final, TextIO

NUMBERS: Final = {"stdout": 1, "stderr": 2}


@contextmanager
def kept_streams() -> Iterator[None]:
    """Let what is printed in the block go to standard error, for standard output may carry a report.

    At the end the kit has its streams back, also if they were closed or replaced.
    """
    before = {name: getattr(sys, name) for name in NUMBERS}
    spares = {}
    for number in NUMBERS.values():
        with suppress(OSError):  # it was closed when the kit started
            spares[number] = os.dup(number)
    if len(spares) == len(NUMBERS):
        _flush(sys.stdout)
        os.dup2(NUMBERS["stderr"], NUMBERS["stdout"])
    try:
        yield
    finally:
        _flush(sys.stdout)
        for number, spare in spares.items():
            os.dup2(spare, number)
            os.close(spare)
        for name, stream in before.items():
            closed = getattr(stream, "closed", False) and NUMBERS[name] in spares
            again = open(NUMBERS[name], "w", errors="backslashreplace", closefd=False) if closed else stream  # noqa: SIM115
            setattr(sys, name, again)


def _flush(stream: TextIO | None) -> None:
    with suppress(OSError, ValueError, AttributeError):  # closed, or replaced by something else
        if stream is not None:
            stream.flush()
