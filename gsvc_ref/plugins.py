"""What other packages add to gsvc_ref: names that are videos though no files, and commands of ``gsvc``.

A package names a module in the group of entry points "gsvc_ref.plugins". The module is imported when a command starts,
or when a video is opened by its name, and calls `add_source`, `add_command` and `set_page_writer`; it should import
little.
"""

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol

if TYPE_CHECKING:
    from gsvc_ref.encoder import EncodeReport
    from gsvc_ref.video.stream import VideoReader

GROUP: Final = "gsvc_ref.plugins"


class NamedSource(NamedTuple):
    """Videos that are opened by a name and drawn rather than read."""

    prefix: str
    """What the name of a built-in one begins with, such as ``scene:``."""
    suffix: str
    """What the name of a file ends with that describes one, such as ``.toml``."""
    open: Callable[[str], "VideoReader"]
    """A new reader by such a name."""


class PageWriter(Protocol):
    """Writes a page about an encode."""

    def __call__(
        self,
        file: str,
        source: str | None,
        start: int,
        page: str,
        encoded: "EncodeReport",
        command: str,
        *,
        quiet: bool,
    ) -> None:
        """Write `page` about `file`, whose frame 0 is frame `start` of the source (None: it cannot be read again)."""


_page_writers: Final[list[PageWriter]] = []
_sources: Final[list[NamedSource]] = []
_commands: Final[list[Callable[[Any], None]]] = []


def add_source(source: NamedSource) -> None:
    """Let `gsvc_ref.video.open_video` open what bears such names."""
    _sources.append(source)


def add_command(add: Callable[[Any], None]) -> None:
    """Give ``gsvc`` a command; `add` takes the subparsers of argparse and adds a parser that sets ``run``."""
    _commands.append(add)


def set_page_writer(write: PageWriter) -> None:
    """Let ``gsvc encode --report`` write its page by this function."""
    _page_writers.append(write)


def page_writer() -> PageWriter | None:
    """What was given to `set_page_writer` last, or None."""
    _load()
    return _page_writers[-1] if _page_writers else None


def source_by_prefix(name: str) -> NamedSource | None:
    """The source whose built-in videos are named so, or None."""
    _load()
    return next((source for source in _sources if name.startswith(source.prefix)), None)


def source_by_suffix(name: str) -> NamedSource | None:
    """The source that files of such a name describe, or None."""
    _load()
    return next((source for source in _sources if name.lower().endswith(source.suffix)), None)


def commands() -> tuple[Callable[[Any], None], ...]:
    """What was given to `add_command`, in that order."""
    _load()
    return tuple(_commands)


@cache
def _load() -> None:
    from importlib.metadata import entry_points  # with the mail and sockets of Python's library: 15 ms

    for entry in entry_points(group=GROUP):
        entry.load()
