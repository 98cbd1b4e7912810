"""Decoding: a `.gsvc` stream in, frames or splats out, one after the other."""

import math
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, nullcontext
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, BinaryIO, Final, Self

from gsvc_base.arrays import Frame
from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.splats import Splats, scale_parameters, scale_parameters_filtered
from gsvc_ref.bitstream import LEVELS, SequenceHeader
from gsvc_ref.bitstream.chunks import DECISIONS
from gsvc_ref.bitstream.header import HIGHEST_LEVEL
from gsvc_ref.bitstream.times import FrameTimes
from gsvc_ref.bitstream.work import rendering_work
from gsvc_ref.stream.ahead import read_ahead
from gsvc_ref.stream.decoded import DecodedFrame, Gap, StreamSummary
from gsvc_ref.stream.formats import format_notes, video_format
from gsvc_ref.stream.reader import StreamReader
from gsvc_ref.video import VideoFormat

if TYPE_CHECKING:
    from gsvc_ref.rendering import Precision

HIGHEST: Final = LEVELS[max(LEVELS)]
"""The level up to which other sizes than the coded one are rendered (R-9.4-2)."""

SPLATS_AHEAD: Final = 1 << 16
"""Maximum number of splats of a frame while whose rendering the next one is read: two larger ones take memory."""

Source = str | Path | bytes | bytearray | memoryview | BinaryIO


class Stream:
    """An open `.gsvc` stream: ``for frame in gsvc_ref.open("a.gsvc"): frame.splats``.

    Frames are decoded one at a time as they are asked for. A damaged stream yields all complete frames before the
    damage, then raises GsvcError. Several threads may read one open file, each with its own iterator; a pipe
    takes one.

    Parameters
    ----------
    source
        A path, bytes, or a binary file.
    max_level
        Highest level that is decoded (spec.md section 5); a stream of a greater one is refused (R-5-6).
    layer
        The highest layer that is decoded, from 0, the base alone, to `header.layer_count` - 1; None: all.

    Attributes
    ----------
    header
        The sequence header.
    layer
        The highest layer that is decoded.

    Raises
    ------
    GsvcError
        The stream breaks a rule of spec.md.
    UsageError
        There is no such level, or the stream has no such layer.
    """

    def __init__(self, source: Source, *, max_level: int = HIGHEST_LEVEL, layer: int | None = None) -> None:
        self._reader = StreamReader(source, max_level=max_level, layer=layer)
        self.header: SequenceHeader = self._reader.header
        self.layer = self.header.layer_count - 1 if layer is None else layer
        if self.layer >= self.header.layer_count:
            self._reader.close()
            highest = self.header.layer_count - 1
            have = f"layers 0 (the base) to {highest}" if highest else "no layer but the base, which is layer 0"
            raise UsageError(f"layer {layer} was asked for; the stream has {have}")

    @property
    def format(self) -> VideoFormat:
        """The format of the source that was encoded, with the number of frames if it is known."""
        return replace(video_format(self.header), frame_count=self.frame_count)

    @property
    def notes(self) -> list[str]:
        """Sentences on where `format` differs from the header, since no file can be like that."""
        return format_notes(self.header)

    @property
    def frame_count(self) -> int | None:
        """The number of frames that the header or, in a file, the end chunk states; None if neither does."""
        return self._reader.frame_count

    def times(self) -> FrameTimes:
        """When frames are shown: ``times().time_of(n)`` in seconds from frame 0, ``duration_of(n)``, ``is_even``.

        Of a file that is all that it says up to its end or its first fault, found without decoding; of a pipe what was
        read so far, and each frame's before it comes. Frames of which nothing is said are evenly spaced.
        """
        return self._reader.times()

    def __iter__(self) -> Iterator[DecodedFrame]:
        return self._reader.frames()

    def frames(self, start: int = 0, stop: int | None = None) -> Iterator[DecodedFrame]:
        """Frames `start` to `stop` - 1 with their splats, beginning to decode at the last I-frame at or before `start`.

        It is found by hopping from chunk to chunk; the index is not believed (spec.md section 12.6).
        """
        return self._reader.frames(start, stop)

    def salvage(self, start: int = 0, stop: int | None = None) -> Iterator[DecodedFrame | Gap]:
        """The frames that are left of frames `start` to `stop` - 1 of a damaged file, and the gaps, in their order.

        Raises
        ------
        UsageError
            The source is a pipe, which can be read only once.
        """
        return self._reader.salvage(start, stop)

    @property
    def has_end(self) -> bool:
        """Whether the last bytes of a file are an end chunk, so that it was not cut; False for a pipe."""
        return self._reader.has_end

    def info(self, *, salvage: bool = False) -> StreamSummary:
        """All frames and where every bit of the stream went; a fault is in it, not raised.

        With `salvage`, of a damaged file, everything that is left and all gaps. `ancillary` is the log of the encoder's
        decisions, for `gsvc_ref.encoder.log.read_log`.
        """
        return self._reader.summary(salvage=salvage, ancillary=DECISIONS)

    def close(self) -> None:
        """Close the file, if a path was given."""
        self._reader.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def decode(
    source: Source | Stream,
    *,
    start: int = 0,
    stop: int | None = None,
    scale: float = 1.0,
    precision: "Precision" = "fast",
    threads: int | None = None,
    on_gap: Callable[[Gap], None] | None = None,
    on_incomplete: Callable[[int, tuple[int, ...]], None] | None = None,
    max_level: int = HIGHEST_LEVEL,
    layer: int | None = None,
) -> Iterator[Frame]:
    """Decode a stream to frames, lazily.

    Parameters
    ----------
    source
        A path, bytes, a binary file (a pipe is decoded as it comes), or an open Stream, which stays open.
    start, stop
        Half-open range of frames; decoding begins at the nearest I-frame at or before `start`.
    scale
        Render at this many times the coded size (spec.md section 9.4). A smaller picture is filtered by the area of its
        pixels, but with precision ``deterministic`` sampled, as the filter takes roots.
    precision, threads
        The parameters of `gsvc_ref.render`.
    on_gap
        Salvage what is left of a damaged file: called with each gap, before the frame after it is yielded, and at the
        end. Frames that are missing are left out, so count `Gap.missing_count` to know the number of a frame.
    on_incomplete
        With `on_gap`: called with the number of each frame from which damage has taken layers, and with these, before
        it is yielded.
    max_level, layer
        The highest level and the highest layer that are decoded, as in `Stream`; an open Stream keeps its own.

    Yields
    ------
    Frames (H, W, 3), R'G'B' at full range: u1 for 8 bits, else u2. With more than one thread the next frame is read
    while one is rendered, if all bytes are there: in a file that ends with an end chunk, not in a pipe or a file that
    may still grow.

    Raises
    ------
    GsvcError
        The stream is damaged; all complete frames before the damage have been yielded. With `on_gap` only if not even
        the sequence header is sound. Or ``limit``, R-9.4-2: at this scale a frame takes more rendering work than the
        highest level allows.
    UsageError
        An argument is out of range, or a pipe is to be salvaged.
    """
    from gsvc_ref.rendering.fast.threads import thread_count

    opened = nullcontext(source) if isinstance(source, Stream) else Stream(source, max_level=max_level, layer=layer)
    with opened as stream:
        if on_gap is not None:
            frames = _frames_of(stream.salvage(start, stop), on_gap, on_incomplete)
        elif thread_count(threads) > 1 and stream.has_end:
            frames = read_ahead(stream.frames(start, stop), lambda frame: len(frame.splats) <= SPLATS_AHEAD)
        else:
            frames = stream.frames(start, stop)
        with closing(rendered(frames, stream.header, scale, precision, threads)) as shown:
            yield from shown


def _frames_of(
    parts: Iterator[DecodedFrame | Gap],
    on_gap: Callable[[Gap], None],
    on_incomplete: Callable[[int, tuple[int, ...]], None] | None,
) -> Iterator[DecodedFrame]:
    for part in parts:
        if isinstance(part, Gap):
            on_gap(part)
            continue
        if part.lacking and on_incomplete is not None:
            on_incomplete(part.number, part.lacking)
        yield part


def rendered(
    frames: Iterator[DecodedFrame],
    header: SequenceHeader,
    scale: float,
    precision: "Precision",
    threads: int | None,
) -> Generator[Frame, None, None]:
    """The picture of each frame as it is taken from `frames`; all else as of `decode`."""
    from gsvc_ref.rendering import SequenceRenderer

    width, height = scaled_size(header, scale)
    renderer = SequenceRenderer(width, height, precision=precision, threads=threads)
    scaled = scale_parameters if precision == "deterministic" else scale_parameters_filtered  # R-9.4-3
    last: Frame | None = None
    before: DecodedFrame | None = None
    for decoded in frames:
        if last is None or before is None or not decoded.repeats(before):
            origins = None if before is None else decoded.origins(before)  # those of splats that were not rendered
            splats = decoded.splats
            if (width, height) != (header.width, header.height):
                splats = scaled(splats, header.width, header.height, width, height)
                _check_scaled_work(splats, width, height, decoded.number)
            last = renderer.next_frame(splats, header.bit_depth, origins)
        before = decoded
        yield last.copy()  # the renderer changes it, and an R-frame shows it again


def scaled_size(header: SequenceHeader, scale: float) -> tuple[int, int]:
    """Width and height in pixels at a scale, each rounded, at least 1.

    A UsageError says that the scale is not positive, a side exceeds 65535, or the highest level does not allow as many
    pixels (R-9.4-2).
    """
    if not 0 < scale <= 65535:
        raise UsageError(f"scale is {scale}; it must be a positive number, for instance 2")
    width, height = max(1, round(header.width * scale)), max(1, round(header.height * scale))
    if max(width, height) > 65535:
        raise UsageError(f"scale {scale} gives {width}x{height} pixels; at most 65535 on a side")
    if width * height > HIGHEST.pixels:
        most = math.sqrt(HIGHEST.pixels / (header.width * header.height))
        raise UsageError(
            f"scale {scale} gives {width}x{height} pixels; at most {HIGHEST.pixels} can be rendered (R-9.4-2): "
            f"take a scale of at most {int(100 * most) / 100}"
        )
    return width, height


def _check_scaled_work(splats: Splats, width: int, height: int, number: int) -> None:
    """R-9.4-2 of a frame at another size than the coded one."""
    work = rendering_work(splats, width, height)
    if work > HIGHEST.work:
        raise GsvcError(
            "limit",
            f"rendering frame {number} at {width}x{height} takes {work} pairs; at most {HIGHEST.work} can be rendered: "
            "take a smaller scale",
            rule="R-9.4-2",
        )
