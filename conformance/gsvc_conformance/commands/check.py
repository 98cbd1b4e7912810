"""``check``: whether files are legal streams, by the decoder inside spec.md and by gsvc_ref, and what they ask for."""

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import plural, print_json, show
from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.syntax import syntax
from gsvc_conformance import reference
from gsvc_conformance.encoding import Decoding
from gsvc_conformance.level import LEVELS
from gsvc_conformance.profiles import PROFILES
from gsvc_conformance.reading import MAX_STREAM, read_bytes, read_pipe
from gsvc_conformance.spec import namespace

SPEC, REFERENCE = "spec", "gsvc_ref"
DECODERS: Final = (SPEC, REFERENCE)
AMOUNTS: Final = ("pixels", "splats", "work", "payload")
"""What a level limits, by the names of spec.md's code; the bytes of a second have the limit of a payload."""

STDIN: Final = Path("-")
MAX_SHOWN: Final = 8
"""I-frames whose numbers a sentence has."""

Counted = tuple[str, int, int]
"""What a decoder counts of a frame, as in a `Frame`."""

OnFrame = Callable[[str, int], object]
"""Called with the name of the decoder and the number of the frame that it has read."""


@dataclass(frozen=True)
class Frame:
    """A frame of a stream: its type, splats, rendering work (5-1), and its bytes as section 5 counts them.

    Of a stream with layers they count those of the quality that was read last, and all bytes (R-15.13-3).
    """

    type: str
    splats: int
    work: int
    bytes: int


@dataclass(frozen=True)
class Outcome:
    """What a decoder says of a file.

    Attributes
    ----------
    frames
        Type, splats and rendering work of each complete frame.
    error
        ``KIND RULE BIT``; empty if it accepts the file.
    element, message
        The syntax element at fault, and the fault in words, as far as the decoder says.
    """

    frames: tuple[Counted, ...]
    error: str
    element: str = ""
    message: str = ""

    @property
    def verdict(self) -> tuple[Any, ...]:
        """What two decoders must agree on."""
        return self.frames, self.error

    @property
    def words(self) -> str:
        """The verdict in words."""
        count = plural(len(self.frames), "frame")
        return f"refused ({self.error}) after {count}" if self.error else f"legal with {count}"


@dataclass(frozen=True)
class Finding:
    """What is said of a file.

    Attributes
    ----------
    file
        Its name.
    legal
        Whether each decoder that was asked accepts it, in every quality.
    quality
        The greatest quality of which it is legal (R-13-9), 0 for a stream without layers; None if it is legal of none.
    layer
        The layer that is at fault where the qualities below it are legal; None without such a fault.
    decoders
        The decoders that were asked.
    error
        ``KIND RULE BIT`` by the first of them; empty if it accepts the file.
    element
        The name of the syntax element at fault; empty without a fault, or where there is none.
    message
        The fault in gsvc_ref's words, or without gsvc_ref the rule in those of spec.md; empty without a fault.
    other
        What gsvc_ref says where it says something else than spec.md: a fault of this project.
    profile, level, paced
        As the sequence header says; None where it cannot be read.
    least_level
        The least level whose limits the stream keeps, those of a second too if it is paced; None if it is not legal.
    bytes
        The size of the file.
    i_frames
        The numbers of the I-frames.
    frames
        Each complete frame.
    """

    file: str
    legal: bool
    quality: int | None
    layer: int | None
    decoders: tuple[str, ...]
    error: str
    element: str
    message: str
    other: str
    profile: str | None
    level: int | None
    paced: bool | None
    least_level: int | None
    bytes: int
    i_frames: tuple[int, ...]
    frames: tuple[Frame, ...]


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = (
        "Each file is read by the decoder inside spec.md, which is slow, and by gsvc_ref where that is installed. "
        "Legal is what both accept: a stream by sections 3 to 8. No frame is rendered, as legality does not depend on "
        "pixels. A stream with layers is read in each quality, and may be legal of the lower ones alone. "
        "What no decoder checks is not checked here, such as the contents of ancillary chunks. Exit code 0: all files "
        "are legal; 1: one is not; 2: one cannot be read."
    )
    parser.add_argument(
        "files", type=Path, nargs="+", metavar="FILE", help="a file that an encoder wrote; - is standard input"
    )
    parser.add_argument(
        "--only", choices=DECODERS, help="ask this decoder only: spec is the normative one, gsvc_ref is fast"
    )
    parser.add_argument("--frames", action="store_true", help="list each frame with its type, splats, work and bytes")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON, with all frames")


def run(arguments: Namespace) -> int:
    """Judge the files; 0 if all are legal, else 1.

    Raises
    ------
    UsageError
        A file cannot be read, which is said when the others are judged; or gsvc_ref is asked for and not installed.
    """
    decoders = chosen_decoders(arguments.only)
    findings, unread = [], []
    for number, path in enumerate(arguments.files):
        file = "standard input" if path == STDIN else str(path)
        try:
            data = _data(path)
        except UsageError as error:
            unread.append(error)
            continue
        with ProgressDisplay() as display:
            of = f" (file {number + 1} of {len(arguments.files)})" if len(arguments.files) > 1 else ""
            findings.append(examine(file, data, decoders, _progress(display, f"{file}{of}", data)))
    if arguments.json:
        print_json([asdict(finding) for finding in findings])
    else:
        for finding in findings:
            show(*lines(finding, all_frames=arguments.frames))
    if unread:
        raise UsageError("; ".join(map(str, unread)))
    return 0 if all(finding.legal for finding in findings) else 1


def chosen_decoders(only: str | None) -> tuple[str, ...]:
    """The decoders to ask: the one that is named, else spec.md's, and gsvc_ref where it is installed."""
    if only:
        return (only,)
    return DECODERS if reference.is_installed() else (SPEC,)


def _progress(display: ProgressDisplay, title: str, data: bytes) -> OnFrame:
    """A function that shows how many of the frames of a file are read."""
    count = sum(1 for _ in _frame_sizes(_chunks(data), with_layers=False)) if display.active else 0
    return lambda decoder, frame: display.update(f"{title}, {decoder}: frame {frame}", frame + 1, count)


def _data(path: Path) -> bytes:
    try:
        return read_pipe(sys.stdin.buffer, MAX_STREAM) if path == STDIN else read_bytes(path, MAX_STREAM)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}; give the path of a file") from None


def examine(file: str, data: bytes, decoders: tuple[str, ...] = DECODERS, on_frame: OnFrame | None = None) -> Finding:
    """Read a stream by each decoder.

    Parameters
    ----------
    file, data
        Its name and its bytes.
    decoders
        Those to ask, of `DECODERS`.
    on_frame
        Is called with the decoder and the number of each frame that it has read.
    """
    asked = {SPEC: _by_spec, REFERENCE: _by_reference}
    header, chunks = Decoding(data).header, _chunks(data)
    for quality in range(_qualities(header, chunks)):
        outcomes = {name: asked[name](data, quality, on_frame or _nothing) for name in decoders}
        first, last = outcomes[decoders[0]], outcomes[decoders[-1]]
        other = "" if first.verdict == last.verdict else last.words
        legal = not first.error and not other
        if not legal:
            break
    greatest = min(quality - (not legal), header.get("layer_count", 1) - 1)
    sizes = _frame_sizes(chunks, with_layers=header.get("layer_count", 1) > 1)
    frames = tuple(Frame(*frame, size) for frame, size in zip(first.frames, sizes, strict=False))
    return Finding(
        file, legal, greatest if greatest >= 0 else None, quality if not legal and quality > 0 else None,
        decoders, first.error, first.element, last.message or _rule(first.error), other,
        PROFILES[header["profile"]] if header else None, header.get("level"),
        bool(header["flags"] & 2) if header else None,
        least_level(header, frames, max(size for _, size, _ in chunks)) if legal else None, len(data),
        tuple(number for number, frame in enumerate(frames) if frame.type == "I"), frames,
    )  # fmt: skip


def _qualities(header: Any, chunks: list[tuple[str, int, int]]) -> int:
    """The number of qualities to decode: each, and where there is one alone, that of a layer that must not be there."""
    count = int(header.get("layer_count", 1))
    stray = count == 1 and "layer_count" in header and any(chunk_type == "n" for chunk_type, _, _ in chunks)
    return count + stray


def _rule(error: str) -> str:
    """The sentence of spec.md that a stream breaks, by ``KIND RULE BIT``; empty without an error."""
    return str(syntax()["rules"][error.split()[1]]["text"]) if error else ""


def _nothing(decoder: str, frame: int) -> None:
    """Nobody wants to know."""


def _by_spec(data: bytes, quality: int, on_frame: OnFrame) -> Outcome:
    decoding = Decoding(data, quality=quality)
    found = []
    for number, frame in enumerate(decoding.frames()):
        found.append((frame.type, len(frame.parameters), frame.work))
        on_frame(SPEC, number)
    fault = decoding.fault
    return Outcome(
        tuple(found), f"{fault.kind} {fault.rule} {fault.bit}" if fault else "", fault.element if fault else ""
    )


def _by_reference(data: bytes, quality: int, on_frame: OnFrame) -> Outcome:
    from gsvc_conformance.diagnosis.streams import element_at
    from gsvc_ref._jit import SMALL_TO_READ, plain_kernels

    found = []
    try:
        with plain_kernels() if len(data) <= SMALL_TO_READ else nullcontext():
            for number, frame in enumerate(_reference_frames(data, quality)):
                found.append(frame)
                on_frame(REFERENCE, number)
    except GsvcError as fault:
        error = f"{fault.kind} {fault.rule} {fault.bit}"
        return Outcome(tuple(found), error, element_at(data, fault.bit or 0).partition(" of ")[0], fault.message)
    return Outcome(tuple(found), "")


def _reference_frames(data: bytes, quality: int) -> Iterator[Counted]:
    from gsvc_ref.stream import StreamReader
    from gsvc_ref.stream.profiles import work_after

    for frame in StreamReader(data, layer=quality):
        work = work_after(frame.state) if frame.layers is None else frame.layers.work()
        yield frame.type, len(frame.splats), work


def _chunks(data: bytes) -> list[tuple[str, int, int]]:
    """Type, bytes of the payload and bytes in all of each chunk after the sequence header, as far as there are any."""
    spec = namespace()
    found: list[tuple[str, int, int]] = []
    try:
        bits, _ = spec["open_stream"](data)
        while bits.bits_left() and (not found or found[-1][0] != "E"):
            begin = bits.position()
            chunk_type, payload = spec["read_chunk"](bits, len(data), compare_crc=False)
            found.append((chunk_type, len(payload.data), (bits.position() - begin) // 8))
    except spec["Fault"]:
        pass
    return found


def _frame_sizes(chunks: list[tuple[str, int, int]], *, with_layers: bool) -> Iterator[int]:
    """The bytes of each frame: its chunk, ancillary chunks before it, and its layers with those between."""
    sizes: list[int] = []
    waiting = 0
    for chunk_type, _, size in chunks:
        waiting += size
        if chunk_type in namespace()["FRAMES"]:
            sizes.append(waiting)
            waiting = 0
        elif chunk_type == "n" and with_layers and sizes:
            sizes[-1] += waiting
            waiting = 0
    return iter(sizes)


def least_level(header: Any, frames: tuple[Frame, ...], payload: int) -> int:
    """The least level whose limits a legal stream keeps; those of a second too if it is paced."""
    spec = namespace()
    pixels = header["width"] * header["height"]
    each = [{"pixels": pixels, "splats": frame.splats, "work": frame.work, "payload": frame.bytes} for frame in frames]
    needed = {name: max(amounts[name] for amounts in each) for name in AMOUNTS} | {"payload": payload}
    if header["flags"] & 2:
        k = spec["frames_of_second"](header)
        for name, share in spec["PER_SECOND"].items():
            seconds = (sum(amounts[name] for amounts in each[first : first + k]) for first in range(0, len(each), k))
            needed[name] = max(needed[name], -(-max(seconds) // share))
    return next(level for level in LEVELS if all(needed[name] <= spec["LEVELS"][level][name] for name in AMOUNTS))


def lines(finding: Finding, *, all_frames: bool = False) -> Iterator[str]:
    """A finding in words, and each of its frames if they are asked for."""
    yield sentence(finding)
    if all_frames:
        for number, frame in enumerate(finding.frames):
            size = f"{plural(frame.splats, 'splat')}, work {frame.work:,}, {plural(frame.bytes, 'byte')}"
            yield f"  frame {number}: {frame.type}, {size}"


def sentence(finding: Finding) -> str:
    """A finding in words."""
    count = plural(len(finding.frames), "frame")
    if finding.other:
        own = f"refused ({finding.error}) after {count}" if finding.error else f"legal with {count}"
        return f"{finding.file}: {own} by spec.md, {finding.other} by gsvc_ref: please report it with the file"
    if not finding.legal:
        at = f", at {finding.element}" if finding.element else ""
        message = f": {finding.message}" if finding.message else ""
        said = f"refused ({finding.error}) after {count}{at}{message}"
        if finding.layer is None:
            return f"{finding.file}: {said}"
        return f"{finding.file}: legal of quality {finding.quality}; with layer {finding.layer} {said}"
    of_quality = f" of every quality up to {finding.quality}" if finding.quality else ""
    paced = "paced" if finding.paced else "not paced"
    level = f"level {finding.level}" + (
        f" ({finding.least_level} would do)" if finding.least_level != finding.level else ""
    )
    return (
        f"{finding.file}: legal{of_quality}, class stream, profile {finding.profile}, {level}, {paced}: {count}, "
        f"{_i_frames(finding.i_frames)}, {plural(finding.bytes, 'byte')}"
    )


def _i_frames(numbers: tuple[int, ...]) -> str:
    """I-frames in words: the first few, and how many there are."""
    shown = ", ".join(map(str, numbers[:MAX_SHOWN]))
    rest = len(numbers) - MAX_SHOWN
    return f"{plural(len(numbers), 'I-frame')} ({shown}{f' and {rest} more' if rest > 0 else ''})"
