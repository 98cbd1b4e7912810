"""Streams one after the other as one stream, without decoding a splat (spec.md section 6.10)."""

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, BinaryIO, Final

from gsvc_base.errors import UsageError
from gsvc_base.files import opened_output
from gsvc_ref.bitstream.coder import UV_LIMIT
from gsvc_ref.bitstream.header import SequenceHeader, header_elements
from gsvc_ref.stream.seeking import read_end
from gsvc_tools.editing.copying import ConcatReport, CopiedStream, OnPart, OpenedPart, Opening, Part, sound_chunks

MAY_DIFFER: Final = ("level", "qualities", "frame_count", "paced_flag")
"""Elements of the sequence header that need not be the same in all parts (R-6.10-1)."""

CHOSEN: Final = ("cholesky_bits", "color_stages", "color_codewords")
"""Elements that an encode chooses by itself, unless an option of the same name says them."""


def concat(sources: Sequence[Part], target: str | Path | BinaryIO, *, progress: OnPart | None = None) -> ConcatReport:
    """Write the frames of streams one after the other as one stream (R-6.10-7).

    Parameters
    ----------
    sources
        The parts in their order: paths, bytes, or binary files that stand at the start of a stream. Each must be
        whole and without a fault in its container, with the sequence header of the first one; `level`, `frame_count`
        and `paced_flag` may differ.
    target
        A path, ``-`` for standard output, or a binary file. A path gets the stream under a temporary name in the same
        folder, and its own name when it is complete: at every moment it is the old file or the new one.
    progress
        Called with each chunk.

    Returns
    -------
    ConcatReport

    Raises
    ------
    GsvcError
        A part has a fault; the message names it, and `bit` counts from its start. Splats are not looked at: a fault
        that only they show comes along with its frame.
    UsageError
        The parts do not go together; the message names the part and the element, and says what to do.
    OSError
        A part cannot be read, or the target not written; what stood under its name still does.
    """
    if isinstance(sources, str | bytes | Path) or not hasattr(sources, "__len__") or len(sources) == 0:
        raise UsageError("give a list of one stream or more to concatenate")
    parts = [OpenedPart(source, number) for number, source in enumerate(sources)]
    opening = _joined_opening(parts)
    sizes = [part.size for part in parts if part.size is not None]
    total = sum(sizes) if len(sizes) == len(parts) else None
    begun = 0
    with opened_output(target) as file:
        result = CopiedStream(file, opening)
        for number, part in enumerate(parts):
            with part.again() as stream:
                last = number == len(parts) - 1
                count = None if last else stream.header.frame_count or read_end(stream)
                kept, known = sound_chunks(stream), last or count is not None
                if known:  # else time stamps could be about frames of the next part
                    kept = result.times.of_part(kept, 0, count, result.frame_count)
                for offset in result.copy(part.name, stream, kept, with_times=known):
                    if progress is not None:
                        progress(number, begun + offset, total)
                begun += stream.source.offset
        return result.finish()


def _joined_opening(parts: Sequence[OpenedPart]) -> Opening:
    """The opening of the result (R-6.10-2) of parts that go together."""
    first = parts[0]
    for part in parts[1:]:
        _check_goes_with(first, part)
    headers = [part.opening.header for part in parts]
    counts = [header.frame_count for header in headers]
    if sum(counts) >= UV_LIMIT:
        raise UsageError(f"together the parts have {sum(counts)} frames; a stream may have {UV_LIMIT - 1}: join fewer")
    level, frame_count = max(header.level for header in headers), sum(counts) if all(counts) else 0
    points = zip(*(header.operating_points for header in headers), strict=True)
    qualities = tuple(max(of_parts) for of_parts in points)  # by their levels: the halvings are the same
    header = replace(
        headers[0], level=level, qualities=qualities, frame_count=frame_count, paced_flag=False
    )  # R-6.10-2
    return replace(first.opening, header=header)


def _check_goes_with(first: OpenedPart, part: OpenedPart) -> None:
    """R-6.10-1."""
    ours, theirs = first.opening, part.opening
    pairs: list[tuple[str, Any, Any]] = [("version_minor", ours.version_minor, theirs.version_minor)]
    for element in fields(SequenceHeader):
        if element.name not in MAY_DIFFER:
            pairs.append((element.name, getattr(ours.header, element.name), getattr(theirs.header, element.name)))
    a, b = ([point.halvings for point in opening.header.operating_points] for opening in (ours, theirs))
    pairs.append(("quality_halvings", a, b))
    last = header_elements(ours.header.profile)[-1]
    pairs.append((f"what follows `{last}`", ours.later.hex(" "), theirs.later.hex(" ")))
    for name, a, b in pairs:
        if a != b:
            element_name = name if " " in name else f"`{name}`"
            option = f" (--{name.replace('_', '-')} {a})" if name in CHOSEN else ""
            raise UsageError(
                f"{element_name} is {a} in {first.name} and {b} in {part.name}; only streams with the same header "
                f"can be joined (R-6.10-1): encode one of them again with the settings of the other{option}"
            )
