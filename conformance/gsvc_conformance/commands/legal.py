"""``legal``: whether files are streams by spec.md, for those who write an encoder."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gsvc_conformance.vectors import PROFILE
from gsvc_ref.cli.text import plural, print_json, show
from gsvc_ref.errors import GsvcError, UsageError


@dataclass(frozen=True)
class Finding:
    """What the code of spec.md and gsvc_ref say of a file.

    Attributes
    ----------
    file
        Its name.
    legal
        Whether both accept it.
    frames
        The number of frames before its end, or before the fault.
    error
        ``KIND RULE BIT`` by the code of spec.md; empty if it accepts the file.
    element
        The name of the syntax element at fault; empty without a fault, or where none is reached.
    message
        The fault in gsvc_ref's words; empty without one.
    other
        What gsvc_ref says where it says something else: a fault of this project.
    profile, level, paced
        As the sequence header says; None where it cannot be read, or has no such flag.
    """

    file: str
    legal: bool
    frames: int
    error: str
    element: str
    message: str
    other: str
    profile: str | None
    level: int | None
    paced: bool | None


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = (
        "Each file is decoded twice, by the code inside spec.md (slowly) and by gsvc_ref. Legal is what both accept: "
        "a stream by sections 3 to 8. What no decoder checks is not checked here, such as the contents of ancillary "
        "chunks. Exit code 0: all files are legal; 1: one is not; 2: one cannot be read."
    )
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help="a file that an encoder wrote")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")


def run(arguments: Namespace) -> int:
    """Judge the files; 0 if all are legal, else 1.

    Raises
    ------
    UsageError
        A file cannot be read.
    """
    findings = [examine(str(path), _data(path)) for path in arguments.files]
    if arguments.json:
        print_json([asdict(finding) for finding in findings])
    else:
        show(*map(sentence, findings))
    return 0 if all(finding.legal for finding in findings) else 1


def _data(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from None


def examine(file: str, data: bytes) -> Finding:
    """Decode a stream by the code of spec.md and by gsvc_ref."""
    from gsvc_conformance.diagnosis.streams import element_at

    frames, error, _ = _outcome(data, _frames_by_spec)
    their_frames, their_error, message = _outcome(data, _frames_by_reference)
    other = "" if (their_frames, their_error) == (frames, error) else _words(their_frames, their_error)
    element = element_at(data, int(error.split()[2])) if error else ""
    return Finding(file, not (error or other), frames, error, element, message, other, *_header(data))


def _outcome(data: bytes, each_frame: Callable[[bytes], Any]) -> tuple[int, str, str]:
    """The number of frames, and the error and its message or nothing."""
    from gsvc_conformance.spec import namespace

    frames = 0
    try:
        for _ in each_frame(data):
            frames += 1
    except (namespace()["Fault"], GsvcError) as fault:
        return frames, f"{fault.kind} {fault.rule} {fault.bit}", getattr(fault, "message", "")
    return frames, "", ""


def _frames_by_spec(data: bytes) -> Any:
    from gsvc_conformance.spec import namespace

    names = namespace()
    yield from names["read_frames"](*names["open_stream"](data))


def _frames_by_reference(data: bytes) -> Any:
    from gsvc_ref.stream import StreamReader

    yield from StreamReader(data)


def _header(data: bytes) -> tuple[str | None, int | None, bool | None]:
    """Profile, level and whether it is paced, of a sequence header that can be read."""
    from gsvc_ref.stream import StreamReader

    try:
        header = StreamReader(data).header
    except GsvcError:
        return None, None, None
    return PROFILE, header.level, getattr(header, "paced_flag", None)


def sentence(finding: Finding) -> str:
    """A finding in words."""
    if finding.other:
        own = _words(finding.frames, finding.error)
        return f"{finding.file}: {own} by spec.md, {finding.other} by gsvc_ref: please report it with the file"
    if not finding.legal:
        at = f", at {finding.element}" if finding.element else ""
        return f"{finding.file}: {_words(finding.frames, finding.error)}{at}: {finding.message}"
    paced = "" if finding.paced is None else ", paced" if finding.paced else ", not paced"
    return (
        f"{finding.file}: legal, class stream, profile {finding.profile}, level {finding.level}{paced}: "
        f"{plural(finding.frames, 'frame')}"
    )


def _words(frames: int, error: str) -> str:
    return f"refused ({error}) after {plural(frames, 'frame')}" if error else f"legal with {plural(frames, 'frame')}"
