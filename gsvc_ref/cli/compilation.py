"""The notice that kernels are being compiled, and the choice to do without the compiler where little is to be read."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from gsvc_base.cli.errors import say
from gsvc_ref._jit import SMALL_TO_READ, plain_kernels
from gsvc_ref.cli.files import STDIO

COMPILE_EVENT: Final = "numba:compile"
"""Name of the event that Numba broadcasts when it compiles, and not when it finds a kernel in its cache."""


class CompilationNotice:
    """Says once, on standard error, that the compiler works, at the moment when it begins to."""

    def __init__(self, command: str) -> None:
        self._command = command
        self.said = False  # once it has, the time of the command is not that of its work alone

    def say(self) -> None:
        """Numba begins to compile a kernel."""
        if not self.said:
            self.said = True
            say(self._command, "compiling kernels for this command, once for this version (up to 30 seconds)")


@contextmanager
def compilation_notice(command: str, *, silent: bool) -> Iterator[CompilationNotice]:
    """Say so if a kernel has to be compiled inside the block, unless `silent`. This loads the compiler."""
    import gsvc_ref._compiler  # noqa: F401  (before Numba: it says what is wrong with Numba's variables)

    # isort: split
    from numba.core import event

    notice = CompilationNotice(command)

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            notice.say()

        def on_end(self, event: Any) -> None:
            pass

    if silent:
        yield notice
    else:
        with event.install_listener(COMPILE_EVENT, Listener()):
            yield notice


@contextmanager
def reading(command: str, *names: str, silent: bool, small: int = SMALL_TO_READ) -> Iterator[None]:
    """Read streams: without the compiler if they are files of `small` bytes at most, else with `compilation_notice`."""
    files = [Path(name) for name in names]
    if STDIO not in names and all(map(Path.is_file, files)) and sum(file.stat().st_size for file in files) <= small:
        with plain_kernels():
            yield
    else:
        with compilation_notice(command, silent=silent):
            yield
