"""One line on a terminal that shows the progress of a command; nothing anywhere else."""

import os
import shutil
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Any, Final, Protocol, Self, TextIO

from gsvc_base.cli.text import duration

DELAY_S: Final = 0.7
"""Commands that end sooner show nothing."""
INTERVAL_S: Final = 0.1
"""Minimum time between two updates."""


class Line(Protocol):
    """A place where one line can be shown again and again."""

    def show(self, text: str, share: float | None) -> None:
        """Replace the line; `share` 0..1 is how much is done, None unknown."""

    def clear(self) -> None:
        """Remove the line."""


class PlainLine:
    """A line by carriage return, for terminals without rich."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._shown = 0

    def show(self, text: str, share: float | None) -> None:
        """Replace the line."""
        columns = shutil.get_terminal_size().columns - 1
        text = (f"{share:4.0%}  {text}" if share is not None else text)[:columns]
        self._stream.write("\r" + text.ljust(min(self._shown, columns)))
        self._stream.flush()
        self._shown = len(text)

    def clear(self) -> None:
        """Overwrite the line with blanks."""
        self._stream.write("\r" + " " * self._shown + "\r")
        self._stream.flush()
        self._shown = 0


class RichLine:
    """A line with a bar, drawn by rich."""

    def __init__(self, stream: TextIO) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn

        self._progress = Progress(
            BarColumn(bar_width=24),
            TextColumn("{task.description}", markup=False),
            console=Console(file=stream),
            auto_refresh=False,
            transient=True,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        self._task = self._progress.add_task("", total=None)
        self._progress.start()

    def show(self, text: str, share: float | None) -> None:
        """Replace the line."""
        total = None if share is None else 1.0
        self._progress.update(self._task, description=text, total=total, completed=share or 0.0, refresh=True)

    def clear(self) -> None:
        """Remove the line and give the cursor back."""
        self._progress.stop()


def open_line(stream: TextIO) -> Line:
    """The best line that this terminal and installation offer."""
    if os.environ.get("TERM") == "dumb":
        return PlainLine(stream)
    try:
        return RichLine(stream)
    except ImportError:  # rich is an optional extra
        return PlainLine(stream)


class ProgressDisplay:
    """The display of a command's progress and remaining time; a context manager, which clears the line at its end.

    Nothing is shown in the first `DELAY_S`, with `quiet`, or when standard error is no terminal.
    """

    def __init__(
        self,
        *,
        quiet: bool = False,
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.monotonic,
        line: Callable[[TextIO], Line] = open_line,
    ) -> None:
        self._stream: Any = stream if stream is not None else sys.stderr
        # False: nothing will ever be shown, and callers can leave out what costs time.
        self.active = not quiet and self._stream is not None and self._stream.isatty()
        self._clock, self._open_line = clock, line
        self._start = clock()
        self._next = self._start + DELAY_S
        self._line: Line | None = None

    def status(self, text: str) -> None:
        """Show a sentence at once, however short the command will be."""
        if self.active:
            self._show(text, None)

    def update(
        self, text: str, done: float, total: float | None, *, left_s: float | None = None, guess: bool = True
    ) -> None:
        """Show that `done` of `total` (None: unknown) units of work are complete; with the first comes an estimate.

        `left_s` are the seconds left, where the caller knows better; without `guess` there is no other estimate.
        """
        now = self._clock()
        if not self.active or now < self._next:
            return
        share = min(done / total, 1.0) if total else None
        if left_s is not None:
            text = f"{text}  about {duration(left_s)} left"
        elif guess and share and done >= 1:  # before, compilation and start are most of the time
            left = (now - self._start) * (1 - share) / share
            text = f"{text}  {duration(left)} left"
        self._show(text, share)
        self._next = now + INTERVAL_S

    def _show(self, text: str, share: float | None) -> None:
        with suppress(OSError, ValueError):  # the terminal is gone, or code that is judged has closed the stream
            if self._line is None:
                self._line = self._open_line(self._stream)
            self._line.show(text, share)

    def close(self) -> None:
        """Clear the line; harmless when there is none."""
        if self._line is not None:
            with suppress(OSError, ValueError):
                self._line.clear()
            self._line = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
