"""A part of a stream as another stream, without decoding a splat: some of its frames, or its lower quality layers.

That is R-6.10-8 of spec.md, and the end of its section 15.13.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from gsvc_base.errors import UsageError
from gsvc_base.files import opened_output
from gsvc_ref.bitstream import chunks
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.header import Quality, SequenceHeader
from gsvc_tools.editing.copying import (
    ConcatReport,
    CopiedStream,
    OnPart,
    OpenedPart,
    Part,
    belongs_to_frame,
    sound_chunks,
)


def cut(
    source: Part,
    target: str | Path | BinaryIO,
    layer: int | None = None,
    *,
    start: int = 0,
    stop: int | None = None,
    progress: OnPart | None = None,
) -> ConcatReport:
    """Write some frames of a stream, or a stream of profile `main` without its layers above one.

    Parameters
    ----------
    source
        A path, bytes, or a binary file that stands at the start of a stream, which must be without a fault in its
        container up to frame `stop`.
    target
        As in `concat`.
    layer
        The highest layer that stays; 0 is the base alone. `layer_count` becomes one more, and `level` that of what
        stays. None: all stay.
    start, stop
        The frames that stay are those from `start` to `stop` - 1, or to the end. The first one must be an I-frame.
    progress
        Called with each chunk.

    Returns
    -------
    ConcatReport
        Of one part. Chunks of dropped layers are among those `left_out`, as type ``n``.

    Raises
    ------
    GsvcError
        The stream has a fault.
    UsageError
        The stream has no such layer or frame, or frame `start` is not an I-frame; the message names those beside it.
    OSError
        The source cannot be read, or the target not written; what stood under its name still does.
    """
    if start < 0 or (stop is not None and stop <= start):
        raise UsageError(f"start is {start} and stop is {stop}; they must be frame numbers with 0 <= start < stop")
    part = OpenedPart(source, 0)
    header = part.opening.header
    highest = header.layer_count - 1
    if layer is not None and not 0 <= layer <= highest:
        raise UsageError(f"{part.name} has the layers 0 (the base) to {highest}; {layer} is none of them")
    count = header.frame_count or None
    if count is not None and stop is not None and stop >= count:
        stop = None
    opening = replace(part.opening, header=_header(header, highest if layer is None else layer, start, stop))
    with opened_output(target) as file, part.again() as stream:
        result = CopiedStream(file, opening, same_frames=start == 0 and stop is None)
        timed = result.times.of_part(sound_chunks(stream), start, stop, 0)
        selection = _selection(part.name, timed, start, stop)
        for offset in result.copy(part.name, stream, selection, start=start):
            if progress is not None:
                progress(0, offset, part.size)
        return result.finish()


def _header(header: SequenceHeader, layer: int, start: int, stop: int | None) -> SequenceHeader:
    """The sequence header of the result (R-6.10-8)."""
    count = header.frame_count
    if count:
        count = max(1, (count if stop is None else stop) - start)  # fewer than one are refused when the end is read
    same_seconds = start % header.frames_of_second == 0
    return replace(up_to(header, layer), frame_count=count, paced_flag=header.paced_flag and same_seconds)


def up_to(header: SequenceHeader, layer: int) -> SequenceHeader:
    """The sequence header of a stream whose layers above one are dropped (spec.md section 15.13)."""
    if layer + 1 >= header.layer_count:
        return header
    points, level = header.operating_points[: layer + 1], header.level
    if not any(point.halvings for point in points):
        level = max(point.level for point in points)
    elif max(point.level for point in points) < level:
        points = (*points[:-1], Quality(level, points[-1].halvings))
    return replace(header, layer_count=layer + 1, level=level, qualities=points if layer else ())


def _selection(
    name: str, all_chunks: Iterable[tuple[int, Reader]], start: int, stop: int | None
) -> Iterator[tuple[int, Reader]]:
    """The chunks of frames `start` to `stop` - 1, and those that belong to the whole stream."""
    number, i_frame = -1, 0
    for chunk_type, p in all_chunks:
        if chunk_type in chunks.FRAMES:
            number += 1
            if number == stop:
                return
            if number == start and chunk_type != chunks.I_TYPE:
                following = _next_i_frame(all_chunks, number)
                raise UsageError(
                    f"frame {start} of {name} is a {chr(chunk_type)}-frame, which needs those before it; begin with "
                    f"an I-frame: {i_frame}" + (f" or {following}" if following is not None else "")
                )
            if chunk_type == chunks.I_TYPE:
                i_frame = number
            of_dropped_frame = number < start
        else:
            of_dropped_frame = 0 <= number < start and belongs_to_frame(chunk_type)
        if not of_dropped_frame:
            yield chunk_type, p
    if number < start:
        raise UsageError(f"{name} has {number + 1} frames, 0 to {number}; there is no frame {start}")


def _next_i_frame(rest: Iterable[tuple[int, Reader]], number: int) -> int | None:
    """The number of the first I-frame after frame `number`; None if there is none."""
    for chunk_type, _ in rest:
        if chunk_type in chunks.FRAMES:
            number += 1
            if chunk_type == chunks.I_TYPE:
                return number
    return None
