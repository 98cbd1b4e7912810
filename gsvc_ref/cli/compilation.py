"""The notice that kernels are being compiled."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from gsvc_base.cli.errors import say

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
