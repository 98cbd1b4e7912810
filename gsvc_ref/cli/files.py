"""Inputs and outputs of the commands: checks of a name before anything is read or written."""

import os
import sys
from argparse import ArgumentTypeError
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from gsvc_base.cli.errors import say
from gsvc_base.cli.text import per_second, plural
from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.files import STREAM_SUFFIX
from gsvc_ref.plugins import source_by_prefix

if TYPE_CHECKING:
    from argparse import ArgumentParser
    from collections.abc import Iterator

    from gsvc_ref.stream import Stream
    from gsvc_ref.video import Frame, VideoFormat
    from gsvc_ref.video.alpha import Background

CHROMA_NAMES: Final = {"rgb": "R'G'B'", "420": "4:2:0", "422": "4:2:2", "444": "4:4:4"}
STDIO: Final = "-"
FOREIGN_SUFFIXES: Final = frozenset((
    ".aac", ".apng", ".avi", ".avif", ".bmp", ".flac", ".flv", ".gif", ".h264", ".h265", ".hevc", ".html", ".ivf",
    ".jpeg", ".jpg", ".json", ".m4a", ".m4v", ".mkv", ".mov", ".mp3", ".mp4", ".mpeg", ".mpg", ".mts", ".mxf", ".npz",
    ".ogg", ".ogv", ".opus", ".pdf", ".ply", ".png", ".svg", ".tif", ".tiff", ".toml", ".ts", ".txt", ".wav", ".webm",
    ".webp", ".wmv", ".y4m", ".yuv", ".zip",
))  # fmt: skip
"""Ends of names that say another format than a stream: most often the arguments are in the wrong order."""
CUT_RULE: Final = "R-6.2-4"
"""The requirement of spec.md that a file breaks which ends early."""
MAGIC_RULE: Final = "R-6.1-1"
"""The requirement that a file of another type breaks."""
VERSION_RULE: Final = "R-6.1-2"
"""The requirement by which another version is refused; the message says what to do."""
LEVEL_RULE: Final = "R-5-6"
"""The requirement by which a level above ``--max-level`` is refused."""


def display_name(name: str, standard: str = "standard input") -> str:
    """The name of a file in messages."""
    return standard if name == STDIO else name


def add_background(parser: "ArgumentParser") -> None:
    """Add ``--background`` to a command that reads source videos."""
    parser.add_argument(
        "--background", type=_color, metavar="COLOR",
        help="what transparent pictures are shown on, as white or #rrggbb; without it a frame that is not opaque is "
        "refused",
    )  # fmt: skip


def _color(text: str) -> "Background | None":
    from gsvc_ref.video.alpha import background_of

    try:
        return background_of(text)
    except UsageError as error:
        raise ArgumentTypeError(str(error)) from None


def say_damage(command: str, notes: list[str]) -> list[str]:
    """Write to standard error what the notes of a reader tell of frames that are lost, and return the other notes."""
    from gsvc_ref.video.stream import Damage

    for note in notes:
        if isinstance(note, Damage):
            say(command, note)
    return [note for note in notes if not isinstance(note, Damage)]


def check_input(name: str, *, folder_allowed: bool = False) -> None:
    """Refuse an input that cannot be one; where folders of pictures are allowed, built-in scenes are."""
    if name == STDIO:
        if sys.stdin is None:
            raise UsageError("- reads from standard input, which is closed: pipe something in, or give a file")
        if sys.stdin.isatty():
            raise UsageError("- reads from standard input, which is a terminal: pipe something in, or give a file")
        return
    if folder_allowed and source_by_prefix(name) is not None:
        return
    path = Path(name)
    if not name or not path.exists():
        raise UsageError(f"there is no file {name!r}; check the name (the current folder is {Path.cwd()})")
    if path.is_dir() and not folder_allowed:
        raise UsageError(f"{name} is a folder; give a {STREAM_SUFFIX} file")


def check_output(name: str, source: str, *, folder_allowed: bool = False) -> None:
    """Refuse an output that cannot be written, before work is done for it."""
    if name == STDIO:
        if sys.stdout is None:
            raise UsageError("- writes to standard output, which is closed: pipe it somewhere, or give a file")
        if sys.stdout.isatty():
            raise UsageError("- writes to standard output, which is a terminal: pipe it somewhere, or give a file")
        return
    path = Path(name)
    if not name or not path.parent.is_dir():
        raise UsageError(f"the folder {path.parent} does not exist; create it first (mkdir -p {path.parent})")
    if path.is_dir() and not folder_allowed:
        raise UsageError(f"{name} is a folder; give the name of a file to write, such as {path / 'out'}{STREAM_SUFFIX}")
    if path.is_file() and _is_read(path, source):
        raise UsageError(f"{name} is the input itself; give the output another name")


def default_output(source: str) -> str:
    """The name of the stream that a source makes: beside it, or in the current folder for a built-in scene."""
    if source == STDIO:
        raise UsageError("there is no output; give the name of a file to write, such as OUT.gsvc")
    by_prefix = None if Path(source).exists() else source_by_prefix(source)
    path = Path(source.partition(":")[2] if by_prefix else source.rstrip(os.sep))
    output = Path(f"{path}{STREAM_SUFFIX}") if path.is_dir() else path.with_suffix(STREAM_SUFFIX)
    if output.exists():
        raise UsageError(f"{output} exists already; to overwrite it, name it as the output")
    return str(output)


def check_stream_name(name: str, *, force: bool) -> None:
    """Refuse to write a stream under a name that says another format, unless that is wanted (R-1.1-1)."""
    suffix = Path(name).suffix.lower()
    if not force and suffix in FOREIGN_SUFFIXES:
        raise UsageError(
            f"{name} would hold a GSVC stream under the name of another format; name it {Path(name).stem}"
            f"{STREAM_SUFFIX} (gsvc decode makes {suffix} of it where it can), or give --force"
        )


def _is_read(path: Path, source: str) -> bool:
    """Whether a file is the input, or a picture in the folder that is."""
    if source == STDIO:
        with suppress(OSError, AttributeError):  # there may be none, or no file behind it
            return os.path.samestat(os.fstat(sys.stdin.fileno()), path.stat())
        return False
    if not Path(source).exists():  # a built-in scene
        return False
    if Path(source).is_dir():
        from gsvc_ref.video.images import list_images

        return any(os.path.samefile(path, picture) for picture in list_images(Path(source)))
    return os.path.samefile(path, source)


def open_stream(name: str, *, salvage: bool = False, max_level: int = 5, layer: int | None = None) -> "Stream":
    """Open a GSVC stream of a level up to `max_level`, or standard input, which is read as it comes.

    `layer` is the highest layer that is decoded; None: all. The message of an error names the file and says what to
    do.
    """
    import gsvc_ref

    if salvage and name == STDIO and not sys.stdin.buffer.seekable():
        raise UsageError(
            "--salvage goes back and forth in a file, and standard input is a pipe; save it to a file first"
        )
    try:
        return gsvc_ref.open(sys.stdin.buffer if name == STDIO else name, max_level=max_level, layer=layer)
    except UsageError as error:
        raise UsageError(f"{display_name(name)}: {error}") from None
    except GsvcError as error:
        if name != STDIO and Path(name).is_file() and Path(name).stat().st_size == 0:
            message = f"{name} is empty; if it is still being written, try again later"
            raise GsvcError(error.kind, message, rule=error.rule, bit=error.bit) from None
        advice = "" if error.rule == VERSION_RULE else f"; {_advice(error, name)}"
        if salvage and advice:
            advice += "; nothing can be salvaged without a sound beginning, which ends with the sequence header"
        message = f"{display_name(name)}: {error.message}{advice}"
        raise GsvcError(error.kind, message, rule=error.rule, bit=error.bit) from None


def _advice(error: GsvcError, name: str) -> str:
    if error.rule == CUT_RULE or (error.rule == MAGIC_RULE and _begins_like_stream(name)):
        return "if it is still being written, try again later; otherwise fetch it again"
    if error.rule == MAGIC_RULE:
        return f"if it is a video, encode it first: gsvc encode {name} OUT.gsvc"
    if error.rule == LEVEL_RULE:
        return "a greater --max-level reads it"
    if error.kind == "unsupported":
        return "a newer version of gsvc may read it"
    return "without its header nothing can be decoded: fetch the file again if you can"


def _begins_like_stream(name: str) -> bool:
    """Whether a file ends inside the magic number."""
    from gsvc_ref.bitstream.chunks import MAGIC

    path = Path(name)
    return name != STDIO and path.is_file() and path.stat().st_size < len(MAGIC) and MAGIC.startswith(path.read_bytes())


class CompleteFrames:
    """The frames of a stream up to a fault, which is kept instead of raised."""

    def __init__(self, frames: "Iterator[Frame]") -> None:
        self._frames = frames
        self.damage: GsvcError | None = None  # the fault, once all frames before it have been taken
        self.count = 0  # frames taken so far

    def __iter__(self) -> "Iterator[Frame]":
        return self

    def __next__(self) -> "Frame":
        if self.damage is not None:
            raise StopIteration
        try:
            frame = next(self._frames)
        except GsvcError as error:
            self.damage = error
            raise StopIteration from None
        self.count += 1
        return frame


def describe_format(video: "VideoFormat") -> str:
    """A video's format in one line: size, number of frames, rate, bit depth, chroma format and colour."""
    from gsvc_ref.video.format import MATRIX_NAMES

    frames = f"{plural(video.frame_count, 'frame')}, " if video.frame_count is not None else ""
    if video.chroma_format == "rgb":
        color = ""
    else:
        name = MATRIX_NAMES.get(video.color.matrix, f"matrix {video.color.matrix}")
        color = f", {name}, {'full' if video.color.full_range else 'limited'} range"
    rate = "" if video.frame_count == 1 else f"{per_second(video.frame_rate)}, "
    return (
        f"{video.width}x{video.height}, {frames}{rate}{video.bit_depth} bits, "
        f"{CHROMA_NAMES[video.chroma_format]}{color}"
    )
