"""``gsvc view``: the viewer in a browser of this machine, with a stream and its source."""

import os
import sys
import time
from argparse import Namespace
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NoReturn

from gsvc_base.cli.arguments import amount_of_bytes, whole
from gsvc_base.cli.errors import EXIT_INTERRUPTED, say
from gsvc_base.cli.text import plural, show
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.cli.encode import NamedInput
from gsvc_ref.cli.files import MAGIC_RULE, STDIO, add_background, check_input, display_name, open_stream

if TYPE_CHECKING:
    from gsvc_ref.video import VideoFormat
    from gsvc_tools.viewing.redirect_page import RedirectPage
    from gsvc_tools.viewing.server import Server
    from gsvc_tools.viewing.source_frames import SourceFrames
    from gsvc_tools.viewing.streams import StreamBytes

GSVC_VIEW: Final = "gsvc view"
LOOK_S: Final = 0.5
"""Seconds between two looks at what comes."""
BROWSER_S: Final = 15.0
"""Seconds after which a browser that has not asked for the page is no longer expected."""


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "view",
        help="look at a .gsvc file in a browser, beside its source",
        description="Look at a .gsvc file in a browser: its frames, splats and layers, and what is left of a damaged "
        "file. With the source: both side by side, their difference, and the PSNR of each frame. The page is served "
        "to this machine alone, until Ctrl-C.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument(
        "input", metavar="FILE", help="a .gsvc file, or - for standard input, which is live and read to its end chunk"
    )
    parser.add_argument(
        "source", metavar="SOURCE", nargs="?",
        help="the video that it was encoded from: anything that gsvc encode reads, except a pipe",
    )  # fmt: skip
    parser.add_argument(
        "--live", action="store_true", help="follow a file that gsvc encode --live is writing, or is going to write"
    )
    parser.add_argument("--no-browser", action="store_true", help="open no browser: print the address, and only that")
    parser.add_argument(
        "--source-from", type=whole, default=0, metavar="K",
        help="frame 0 of FILE is frame K of SOURCE, as after gsvc encode --frames K:",
    )  # fmt: skip
    add_background(parser)
    parser.add_argument("--port", type=whole, default=0, metavar="P", help="the port; default: one that is free")
    parser.add_argument(
        "--max-bytes", type=amount_of_bytes, metavar="BYTES",
        help="of standard input, keep at most this many bytes in a temporary file, as 500M (default 4Gi); of a longer "
        "one, the page shows these",
    )  # fmt: skip


def run(arguments: Namespace) -> int:
    """Serve until Ctrl-C; 130, as of every command that it ends."""
    _check(arguments)
    from gsvc_ref.cli.compilation import compilation_notice  # after the checks: it imports the compiler
    from gsvc_tools.viewing.redirect_page import RedirectPage
    from gsvc_tools.viewing.server import Viewing, serving

    with compilation_notice(GSVC_VIEW, silent=arguments.no_browser):
        stream, source = _opened(arguments)
    try:
        name = "standard input" if arguments.input == STDIO else Path(arguments.input).name
        with serving(Viewing(name, stream, source), arguments.port) as server, closing(RedirectPage()) as redirect:
            _introduce(arguments, server, redirect)
            _watch(arguments.input, stream, server, redirect)
    except KeyboardInterrupt:
        say(GSVC_VIEW, "ended; the page goes on with what it has read")
        return EXIT_INTERRUPTED
    finally:
        stream.close()
        if source is not None:
            source.close()


def _watch(name: str, stream: "StreamBytes", server: "Server", redirect: "RedirectPage") -> NoReturn:
    """Wait for Ctrl-C; check that what arrives is a stream, and that the browser asks for the page."""
    from gsvc_ref.bitstream.chunks import MAGIC

    known, limit_announced, patience = not stream.live, False, BROWSER_S
    while True:
        time.sleep(LOOK_S)
        if stream.fault is not None:
            raise stream.fault
        if not known and (known := stream.size() >= len(MAGIC)) and stream.read(0, len(MAGIC)) != MAGIC:
            message = f"{display_name(name)} is not a GSVC stream; encode a video first: gsvc encode IN - --live"
            raise GsvcError("malformed", message, rule=MAGIC_RULE, bit=0)
        if stream.is_full and not limit_announced:
            limit_announced = True
            kept = f"{display_name(name)} has more than {plural(stream.size(), 'byte')}"
            say(GSVC_VIEW, f"{kept}: the page shows these, and the rest is not read; a greater --max-bytes keeps more")
        if server.is_known.is_set():
            redirect.close()
        elif redirect.is_open() and 0 < patience <= LOOK_S:
            say(GSVC_VIEW, "no browser has asked for the page so far; if none shows it, open the address above in one")
        patience -= LOOK_S


def _check(arguments: Namespace) -> None:
    if not 0 <= arguments.port <= 65535:
        raise UsageError(f"--port is {arguments.port}; a port is a number from 1 to 65535")
    if arguments.source_from < 0 or (arguments.source_from and arguments.source is None):
        raise UsageError(f"--source-from is {arguments.source_from}; it is the number of a frame of SOURCE, 0 or more")
    if arguments.max_bytes is not None and arguments.input != STDIO:
        raise UsageError("--max-bytes is about standard input; a file is read where it is, so leave it out")
    waits = arguments.live and arguments.input != STDIO and not Path(arguments.input).exists()
    if not waits:
        check_input(arguments.input)
    elif not Path(arguments.input).absolute().parent.is_dir():
        raise UsageError(f"the folder of {arguments.input} does not exist; check the name")
    if arguments.input != STDIO and _is_device(arguments.input):
        raise UsageError(
            f"{arguments.input} is a pipe or a device, which is read once only: give gsvc view - < {arguments.input}"
        )
    if arguments.source is not None:
        if arguments.source == STDIO or _is_device(arguments.source):
            raise UsageError("the source is read more than once, so it cannot be a pipe: give a file")
        check_input(arguments.source, folder_allowed=True)


def _is_device(name: str) -> bool:
    path = Path(name)
    return path.exists() and not path.is_file() and not path.is_dir()


def _opened(arguments: Namespace) -> "tuple[StreamBytes, SourceFrames | None]":
    """The stream, which must be one unless it is live, and the source, which must fit it."""
    from gsvc_tools.video.resampling import resampled_like
    from gsvc_tools.viewing.source_frames import SourceFrames
    from gsvc_tools.viewing.streams import MAX_PIPED_BYTES, GrowingFile, Pipe, WholeFile

    live = arguments.live or arguments.input == STDIO
    opened_source = NamedInput(arguments.source, arguments.background).open_video
    if not live:
        with open_stream(arguments.input) as opened:
            video = opened.format
        if arguments.source is not None:
            opened_source = resampled_like(opened_source, video).open_video
            with opened_source() as reader:
                _check_fits(arguments, video, reader.format)
    source = None
    if arguments.source is not None:
        source = SourceFrames(arguments.source, arguments.source_from, opened=opened_source)
    if arguments.input == STDIO:
        return Pipe(sys.stdin.buffer, arguments.max_bytes or MAX_PIPED_BYTES), source
    return (GrowingFile if live else WholeFile)(Path(arguments.input)), source


def _check_fits(arguments: Namespace, video: "VideoFormat", source: "VideoFormat") -> None:
    for what, ours, other in (
        ("pixels", f"{video.width}x{video.height}", f"{source.width}x{source.height}"),
        ("bits per sample", str(video.bit_depth), str(source.bit_depth)),
    ):
        if ours != other:
            raise UsageError(
                f"{arguments.source} has {other} {what} and {arguments.input} {ours}, which cannot be compared: "
                "give the video that it was encoded from, or leave it out"
            )


def _introduce(arguments: Namespace, server: "Server", redirect: "RedirectPage") -> None:
    """Say where it is, and open the browser."""
    if arguments.no_browser:
        show(server.url)
        return
    beside = f" beside {display_name(arguments.source)}" if arguments.source else ""
    show(f"{display_name(arguments.input)}{beside}: {server.url}", "  Ctrl-C ends it")
    if arguments.live and not Path(arguments.input).exists() and arguments.input != STDIO:
        show(f"  note: {arguments.input} is not there yet; it is shown as soon as gsvc encode --live writes it")
    for note in _open_browser(server, redirect):
        show(f"  note: {note}")


def _open_browser(server: "Server", redirect: "RedirectPage") -> list[str]:
    """Open it, if there is one here for people to see; else sentences that say what to do."""
    import webbrowser

    if reason := elsewhere():
        port = server.server_port
        return [
            f"no browser is opened, since {reason}; on the machine that you sit at, "
            f"ssh -L {port}:127.0.0.1:{port} HOST, and open the address there"
        ]
    try:
        page = redirect.write(server.url)
    except OSError as error:
        return [
            f"no browser is opened, since its page cannot be written ({error.strerror}): open the address above in one"
        ]
    if not webbrowser.open(page.as_uri()):
        redirect.close()
        return ["no browser was found: open the address above in one"]
    return []


def elsewhere() -> str:
    """Why a browser of this machine would not be seen by who gave the command; empty: it would."""
    if sys.platform in ("win32", "darwin"):
        return "this is a session of SSH" if os.environ.get("SSH_CONNECTION") else ""
    display = os.environ.get("DISPLAY", "")
    if not display and not os.environ.get("WAYLAND_DISPLAY"):
        return "there is no display here"
    host = display.rpartition(":")[0]
    if host not in ("", "unix") and not os.environ.get("WAYLAND_DISPLAY"):
        return f"the display {display} is that of another machine"
    return ""
