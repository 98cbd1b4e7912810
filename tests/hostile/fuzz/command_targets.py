"""The commands of gsvc as they are run: any input ends with exit code 0, 1 or 2, and what is wrong is in a sentence."""

import io
import json
import resource
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.syntax import rules_of
from gsvc_ref.bitstream.work import rendering_work
from gsvc_ref.cli import main
from gsvc_ref.encoder.log import LOG_SIGNATURE, read_log
from gsvc_tools.listing import Entry, list_elements, place_of
from gsvc_tools.splat_files import NpzSplats

from .checks import declared_splats, read
from .targets import ACCEPTED, MAX_PIXELS, MAX_WORK, SKIPPED

MAX_SPLATS: Final = 2_000
"""Splats that a stream may declare; larger ones have tests of their own."""

MAX_MEMORY: Final = 1 << 30
"""Bytes that an execution may take beyond those that the process has."""

LONGEST_SENTENCE: Final = 4_000

Ways = tuple[tuple[str, ...], ...]

STREAMS: Final[dict[str, Ways]] = {
    "dump": ((), ("--json",), ("--all",), ("--all", "--json"), ("--frames", "1:3"), ("--at", "BIT"),
             ("--at", "BIT", "--json")),
    "info": ((), ("--json",), ("--frames-table",), ("--decisions",), ("--salvage",), ("--salvage", "--json")),
    "cut": (("OUT.gsvc", "--frames", "0:1"), ("OUT.gsvc", "--frames", "1:"), ("OUT.gsvc", "--layer", "0"),
            ("OUT.gsvc", "--layer", "2", "--json")),
    "concat": (("IN", "-o", "OUT.gsvc"), ("IN", "IN", "-o", "OUT.gsvc", "--json")),
    "export": (("OUT.npz",), ("OUT",), ("OUT.ply", "--frames", "1:2"), ("OUT.npz", "--frames", "1:", "--json")),
    "decode": (("OUT.y4m",), ("OUT.y4m", "--frames", "1:2"), ("OUT.y4m", "--layer", "0"), ("OUT", "--scale", "2")),
    "salvage": (("OUT.y4m", "--salvage"), ("OUT.y4m", "--salvage", "--quiet"), ("OUT", "--salvage")),
}  # fmt: skip
"""The ways in which a command is given a stream; `salvage` is ``decode --salvage``."""

IMPORTS: Final[Ways] = (
    ("OUT.gsvc", "--width", "16", "--height", "16"),
    ("OUT.gsvc", "--width", "16", "--height", "16", "--degenerate", "remove", "--profile", "paper", "--json"),
    ("OUT.gsvc", "--width", "16", "--height", "16", "--degenerate", "turn", "--key-frames", "1", "--quality", "30"),
    ("OUT.gsvc", "--level", "1", "--quiet"),
)
SCENES: Final[Ways] = (
    ("OUT.y4m", "--size", "16x12", "--frames", "2", "--quiet"),
    ("OUT.y4m", "--size", "8x8", "--frames", "3", "--json"),
)


def of_stream(command: str) -> Callable[[bytes], str]:
    """The target of a command that reads a stream."""

    def run(data: bytes) -> str:
        if declared_splats(data) > MAX_SPLATS or (command in ("decode", "salvage") and is_large(data)):
            return SKIPPED
        return outcome("decode" if command == "salvage" else command, STREAMS[command], data, ".gsvc")

    return run


def is_large(data: bytes) -> bool:
    """Whether the pictures of a stream take long."""
    header, frames, _ = read(data, layer=None)
    if header is None:
        return False
    size = header.width, header.height
    return size[0] * size[1] > MAX_PIXELS or sum(rendering_work(frame.splats, *size) for frame in frames) > MAX_WORK


def splat_files(data: bytes) -> str:
    """``gsvc import`` of an NPZ or a PLY file."""
    if data.startswith(b"ply"):
        return outcome("import", IMPORTS, data, ".ply")
    with emptied_folder() as folder, limited_memory():
        path = folder / "in.npz"
        path.write_bytes(data)
        try:
            with NpzSplats(path) as splats:
                if len(splats) > 64 or splats.counts.sum() > MAX_SPLATS:
                    return SKIPPED
                if (splats.width or 1) * (splats.height or 1) > MAX_PIXELS:
                    return SKIPPED
        except GsvcError:
            pass
    return outcome("import", IMPORTS, data, ".npz")


def scenes(data: bytes) -> str:
    """``gsvc scene`` of a TOML file."""
    return outcome("scene", SCENES, data, ".toml")


def outcome(command: str, ways: Ways, data: bytes, suffix: str) -> str:
    """Run a command on a file, in one of its ways; how it ended."""
    number = zlib.crc32(data)  # of the input, so that replaying it goes the same way
    with emptied_folder() as folder:
        path = folder / f"in{suffix}"
        path.write_bytes(data)
        named = {"IN": str(path), "BIT": str(number % (8 * len(data) + 9))}
        way = [named.get(word, word.replace("OUT", f"{folder}/out")) for word in ways[number % len(ways)]]
        status, said, complaint = ran(command, str(path), *way)
        left = [path.name for path in folder.rglob("*") if path.name.startswith(".") or path.suffix == ".part"]
        assert not left, f"left behind: {left}"
    lines = complaint.splitlines()
    assert status in (0, 1, 2), f"exit code {status}: {complaint}"
    assert status == 0 or any(line.startswith(f"gsvc {command}: ") for line in lines), f"no sentence: {complaint!r}"
    assert len(complaint) < LONGEST_SENTENCE, complaint
    assert "not enough memory" not in complaint, complaint
    assert "Traceback" not in complaint, complaint
    if "--json" in way and status == 0:
        for text in said.splitlines() if command == "dump" else [said]:
            json.loads(text, parse_constant=_no_json)
    return ACCEPTED if status == 0 else f"exit {status}"


@cache
def own_folder() -> TemporaryDirectory[str]:
    """The folder of this process, which goes with it: to make and remove one takes longer than an execution."""
    return TemporaryDirectory(ignore_cleanup_errors=True)


@contextmanager
def emptied_folder() -> Iterator[Path]:
    """A folder that is empty again after the block."""
    folder = Path(own_folder().name)
    try:
        yield folder
    finally:
        for path in folder.iterdir():
            if path.is_dir():
                rmtree(path)
            else:
                path.unlink()


def _no_json(constant: str) -> Any:
    raise AssertionError(f"{constant} is no JSON")


def ran(*arguments: str) -> tuple[int, str, str]:
    """A command's exit code, and what it wrote to standard output and standard error."""
    said, complaint = io.StringIO(), io.StringIO()
    with redirect_stdout(said), redirect_stderr(complaint), limited_memory():
        status = main(arguments)
    return status, said.getvalue(), complaint.getvalue()


@contextmanager
def limited_memory() -> Iterator[None]:
    """Let the process take at most MAX_MEMORY more; where its memory cannot be told, nothing is limited."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[5])
    except OSError:
        yield
        return
    before = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (pages * resource.getpagesize() + MAX_MEMORY, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


def listing(data: bytes) -> str:
    """The elements of a stream follow each other, are all described, and hold the bits that they are found by."""
    if declared_splats(data) > MAX_SPLATS:
        return SKIPPED
    found: list[Entry] = []
    fault, at_fault = list_elements(data, found.append)
    end = 0
    for entry in found:
        assert entry.bit == end, entry.full_name
        end += entry.bits
        assert entry.full_name
        assert entry.syntax is None or rules_of(entry.syntax) is not None
    assert fault is not None or end == 8 * len(data)
    if at_fault is not None:
        assert at_fault.full_name
    bit = zlib.crc32(data) % (8 * len(data) + 1)
    place = place_of(data, bit)
    if bit < end:
        assert place.entry is not None
        assert place.entry.bit <= bit < place.entry.bit + place.entry.bits
        assert not isinstance(place.entry.value, np.ndarray)
    return ACCEPTED if fault is None else str(fault.rule)


def logs(data: bytes) -> str:
    """The log of decisions of a stream of two frames."""
    try:
        read_log(LOG_SIGNATURE + data, 2)
    except UsageError:
        return "refused"
    return ACCEPTED
