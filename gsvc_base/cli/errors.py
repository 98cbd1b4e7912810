"""The translation of exceptions into one line on standard error and an exit code."""

import errno
import os
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from io import TextIOWrapper
from typing import Final

from gsvc_base.cli.text import show
from gsvc_base.errors import GsvcError, UsageError, naming

EXIT_DATA: Final = 1
EXIT_USAGE: Final = 2
EXIT_INTERNAL: Final = 70
"""``EX_SOFTWARE`` of sysexits.h."""
EXIT_INTERRUPTED: Final = 130
"""128 + SIGINT, as shells report it."""
EXIT_PIPE_CLOSED: Final = 141
"""128 + SIGPIPE, as shells report it."""

DEBUG_VARIABLE: Final = "GSVC_DEBUG"

WRONG_PATH: Final = (FileNotFoundError, FileExistsError, IsADirectoryError, NotADirectoryError, PermissionError)
"""Errors of the operating system that another argument cures."""

NO_ROOM: Final = "; free some space or write to another disk"

ADVICE: Final = {
    errno.ENOSPC: NO_ROOM,
    errno.EDQUOT: NO_ROOM,
    errno.EFBIG: "; files may not get so large here (ulimit -f, or the file system): write to another disk",
    errno.EACCES: "; check the permissions, or give another path",
}
"""Advice about an error of the operating system, by its number."""


def say(command: str, message: str) -> None:
    """Write a line to standard error that begins with the command."""
    with suppress(OSError, ValueError):  # nowhere is left to complain when standard error is closed
        show(f"{command}: {message}", file=sys.stderr)


def prepare_streams() -> None:
    """Let standard output and error take all that is printed, also if they cannot show it or are closed."""
    if sys.stderr is None:  # closed; `print` would take standard output, which may carry a stream
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115  (for as long as the process lives)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # a file name may hold what the terminal cannot show
            with suppress(OSError, ValueError):
                stream.reconfigure(errors="backslashreplace")


def guarded(command: str, action: Callable[[], int]) -> int:
    """Run an action and turn all that it raises into a message and an exit code; ``GSVC_DEBUG=1`` shows tracebacks.

    Messages begin with the command, such as ``gsvc encode``.
    """
    try:
        status = action()
        if sys.stdout is not None:
            with naming("standard output"):
                sys.stdout.flush()  # here, where a full disk or a closed pipe can still be reported
        return status
    except (Exception, KeyboardInterrupt) as error:
        if os.environ.get(DEBUG_VARIABLE, "0") not in ("", "0"):
            traceback.print_exc()
        return _explain(command, error)


def _explain(command: str, error: BaseException) -> int:
    """Say what went wrong; the exit code."""
    if isinstance(error, BrokenPipeError):  # the reader has enough, as in `gsvc decode x.gsvc - | head`
        _drop_stdout()
        return EXIT_PIPE_CLOSED
    if isinstance(error, KeyboardInterrupt):
        say(command, "interrupted")
        return EXIT_INTERRUPTED
    if isinstance(error, UsageError):
        say(command, str(error))
        return EXIT_USAGE
    if isinstance(error, GsvcError):
        say(command, str(error))
        return EXIT_DATA
    if isinstance(error, OSError):
        say(command, describe_os_error(error) + what_was_saved(error))
        _drop_stdout()
        return EXIT_USAGE if isinstance(error, WRONG_PATH) else EXIT_DATA
    if isinstance(error, MemoryError):
        advice = "use smaller frames or fewer splats, or a machine with more"
        say(command, f"there is not enough memory; {advice}{what_was_saved(error)}")
        return EXIT_DATA
    if (package := missing_package(error)) is not None:
        say(command, f"{package} is not installed: pip install .")
        return EXIT_USAGE
    summary = " ".join(f"{type(error).__name__}: {error}".split())
    say(
        command,
        f"stopped by a fault of gsvc_ref ({summary}). Please report this line with the command that you "
        f"gave; {DEBUG_VARIABLE}=1 shows where it happened{what_was_saved(error)}",
    )
    return EXIT_INTERNAL


def what_was_saved(error: BaseException) -> str:
    """What an encode that this error ended has noted about the frames that it saved, as the end of a sentence."""
    notes: list[str] = getattr(error, "__notes__", [])
    return "".join(f"; {note[note.index('saved: ') :]}" for note in notes if "saved: " in note)


def missing_package(error: BaseException) -> str | None:
    """The package of others whose absence is the error, if that is what it is."""
    if not isinstance(error, ModuleNotFoundError):
        return None
    package = (error.name or "").partition(".")[0]
    return None if package in ("", "gsvc_base", "gsvc_ref", *sys.stdlib_module_names) else package


def describe_os_error(error: OSError) -> str:
    """The refusal of the operating system with the file that it concerns, and advice where there is any."""
    if error.strerror is None:  # raised with a message of our own
        return str(error)
    place = f"{os.fsdecode(error.filename)}: " if isinstance(error.filename, str | bytes) else ""
    return f"{place}{error.strerror}{ADVICE.get(error.errno or 0, '')}"


def _drop_stdout() -> None:
    """Let Python's own flush at exit go nowhere, if standard output takes nothing any more."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, sys.stdout.fileno())
            os.close(nowhere)
