"""The corpus: few and short inputs that together reach all that has been reached."""

import sys
from collections.abc import Hashable, Iterable
from pathlib import Path
from types import FrameType
from typing import Any, Final

import gsvc_ref

from .fuzzing import CORPUS, TARGETS, Target, name_of
from .layout import elements
from .seeded import execute

PACKAGE: Final = Path(gsvc_ref.__file__).parent
LOOKED_AT: Final = tuple(str(PACKAGE / name) for name in ("bitstream", "main", "paper", "video"))
LONGEST: Final = 1200
"""Bytes of an input that is worth keeping."""


def reached(target: Target, data: bytes) -> set[Hashable]:
    """The outcome of an input, where it came to its end, and the steps from line to line that it took.

    Of kernels the steps are seen if they are not compiled.
    """
    found: set[Hashable] = set()

    def follow(frame: FrameType, event: str, _argument: Any) -> Any:
        if not frame.f_code.co_filename.startswith(LOOKED_AT):
            return None
        last = frame.f_lineno

        def line(frame: FrameType, event: str, _argument: Any) -> Any:
            nonlocal last
            found.add((frame.f_code.co_filename, last, frame.f_lineno, event))
            last = frame.f_lineno
            return line

        return line

    sys.settrace(follow)
    try:
        outcome = execute(target, data)
    finally:
        sys.settrace(None)
    return found | {(outcome, last_element(data) if target.folder == "streams" else "")}


def last_element(data: bytes) -> str:
    """The name of the last element of a stream that could be read, without its plane or channel."""
    last = max((runs[-1] for runs in elements(data).values()), key=lambda element: element.bit, default=None)
    return last.name.rpartition(".")[2] if last else ""


def minimised(target: Target, inputs: Iterable[bytes]) -> list[bytes]:
    """Of the inputs, the shortest first, those that reach something that no shorter one does and all others do not."""
    reach = {data: reached(target, data) for data in sorted(set(inputs), key=lambda data: (len(data), data))}
    kept: dict[bytes, set[Hashable]] = {}
    seen: set[Hashable] = set()
    for data, found in reach.items():
        if found - seen:
            kept[data] = found
            seen |= found
    for data in list(kept):
        others = set().union(*(found for other, found in kept.items() if other is not data))
        if kept[data] <= others:
            del kept[data]
    return list(kept)


def minimise(name: str, folder: Path) -> None:
    """Replace the corpus of a target by the minimised union of what it has and of what a folder has.

    A file's origin is the folder, or the folder in it, where it was found.
    """
    target = TARGETS[name]
    origins = {path.read_bytes(): path.name.rpartition("-")[0] for path in target.corpus()}
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        data = path.read_bytes()
        if len(data) <= LONGEST:
            origins.setdefault(data, path.relative_to(folder.parent).parts[0 if path.parent == folder else 1])
    made = set(target.seeds())  # these are there anyway
    kept = [data for data in minimised(target, origins) if data not in made]
    home = CORPUS / target.folder
    home.mkdir(parents=True, exist_ok=True)
    for path in target.corpus():
        path.unlink()
    for data in kept:
        (home / name_of(origins[data], data)).write_bytes(data)
    print(f"{home}: {len(kept)} inputs of {sum(map(len, kept))} bytes, out of {len(origins)}")
