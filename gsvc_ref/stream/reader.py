"""Reading streams, frame by frame, in constant memory."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.bitstream.coder import Element, categories_of
from gsvc_ref.bitstream.header import HIGHEST_LEVEL, LEVELS, MAX_LAYERS, SequenceHeader
from gsvc_ref.bitstream.times import TIMES, FrameTimes
from gsvc_ref.stream.chunk_decoder import ChunkDecoder, DecodedChunk, Place
from gsvc_ref.stream.decoded import DecodedFrame, FrameSummary, Gap, LayerSummary, StreamSummary
from gsvc_ref.stream.salvage import Salvage
from gsvc_ref.stream.seeking import find_frame, find_whole_frame, read_end
from gsvc_ref.stream.source import READ_AT_ONCE, Source
from gsvc_ref.stream.times import find_times, no_times


class StreamReader:
    """A `.gsvc` stream, read lazily: ``for frame in StreamReader(path): frame.splats``.

    Frames come one at a time and only one chunk is held, however long the stream is. All complete frames before a fault
    are yielded before the fault is raised. Several iterations of one file may be under way at once, also in several
    threads. A stream that breaks a rule of spec.md raises a GsvcError, whose `kind`, `rule` and `bit` say which one and
    where.
    """

    def __init__(
        self,
        source: str | Path | bytes | bytearray | memoryview | BinaryIO,  # a file from where it stands; may be a pipe
        *,
        trace: Callable[[Element], None] | None = None,  # gets each element, a chunk's type, length and checksum first
        max_level: int = HIGHEST_LEVEL,  # a stream of a higher one is refused (R-5-6)
        layer: int | None = 0,  # the highest layer that is decoded, 0 (layers are skipped) to 3; None: all
    ) -> None:
        if max_level not in LEVELS:
            raise UsageError(f"max_level is {max_level}; it must be 1 to {HIGHEST_LEVEL}")
        if layer is not None and layer not in range(MAX_LAYERS):
            raise UsageError(f"layer is {layer}; it must be 0 (the base) to {MAX_LAYERS - 1}")
        self._source = Source(source)
        try:
            self._decoder = ChunkDecoder(self._source, trace, max_level=max_level, layer=layer)
        except BaseException:
            self._source.close()
            raise
        self._times = no_times(self._decoder)  # those of a pipe

    @property
    def header(self) -> SequenceHeader:
        """The sequence header, read on construction."""
        return self._decoder.header

    @property
    def frame_count(self) -> int | None:
        """The number of frames that the header or, in a file, the end chunk states; None if neither does."""
        if self.header.frame_count:
            return self.header.frame_count
        return read_end(self._decoder)

    @property
    def has_end(self) -> bool:
        """Whether the last bytes of a file are an end chunk, so that it was not cut; False for a pipe."""
        return read_end(self._decoder) is not None

    def times(self) -> FrameTimes:
        """When frames are shown; of a pipe as far as it has been read, which grows with each frame."""
        return find_times(self._decoder) if self._source.seekable else self._times

    def __iter__(self) -> Iterator[DecodedFrame]:
        return self.frames()

    def frames(self, start: int = 0, stop: int | None = None) -> Iterator[DecodedFrame]:
        """Frames `start` to `stop` - 1 (to the last, if None); fewer if the stream has fewer.

        Decoding begins at the last I-frame at or before `start`, which is found by hopping from chunk to chunk (spec.md
        section 12.6): payloads before it are not looked at, but a wrong type or length of a chunk passed is
        raised. A pipe is decoded from its start.
        """
        _check_range(start, stop)
        return self._frames(start, stop)

    def salvage(self, start: int = 0, stop: int | None = None) -> Iterator[DecodedFrame | Gap]:
        """Frames `start` to `stop` - 1 of a damaged file, and the gaps between them, in the order of the stream.

        A damaged frame is skipped, and all frames after it up to the next I-frame (spec.md section 12.5). No fault is
        raised: which of these frames are missing, and why, is in the gaps. A stream without a fault has none. A pipe is
        a UsageError: salvaging goes back and forth.
        """
        _check_range(start, stop)
        self._check_salvage()
        return self._salvaged(start, stop)

    def _check_salvage(self) -> None:
        if not self._source.seekable:
            raise UsageError("salvaging reads parts of a stream more than once, so it needs a file, not a pipe")

    def _salvaged(self, start: int, stop: int | None) -> Iterator[DecodedFrame | Gap]:
        if stop == start:
            return
        for part in self._whole_frames(iter(Salvage(self._decoder, find_whole_frame(self._decoder, start)))):
            if isinstance(part, Gap):
                if part.reaches(start):
                    yield part.clipped(start, stop)
            elif part.number >= start:
                if stop is None or part.number < stop:
                    yield part
                if stop is not None and part.number + 1 >= stop:
                    return

    def _frames(self, start: int, stop: int | None) -> Iterator[DecodedFrame]:
        if stop == start:
            return
        for frame in self._whole_frames(self._chunks(find_frame(self._decoder, start))):
            assert isinstance(frame, DecodedFrame)  # there are gaps in salvage alone
            if frame.number >= start:
                yield frame
                if frame.number + 1 == stop:
                    return  # R-12.6-5

    def _whole_frames(
        self, parts: Iterator[DecodedChunk] | Iterator[DecodedChunk | Gap]
    ) -> Iterator[DecodedFrame | Gap]:
        """The frames with their layers, and the gaps; each frame as soon as none of its layers can follow.

        A fault that is raised after a frame comes after it, as one in a layer takes nothing from what was before it.
        """
        frame: DecodedFrame | None = None  # one that may get more layers
        while True:
            try:
                part = next(parts, None)
            except GsvcError:
                if frame is not None:
                    yield frame
                raise
            if isinstance(part, DecodedChunk) and part.frame is None and frame is not None:
                frame = frame if part.layer is None else frame.with_layer(part.layer)
            elif frame is not None:
                yield frame
                frame = None
            if part is None:
                return
            if isinstance(part, Gap):
                yield part
                continue
            frame = part.frame or frame
            if frame is not None and not (part.after.layers and part.after.layers.due):
                yield frame
                frame = None

    def _chunks(self, place: Place) -> Iterator[DecodedChunk]:
        while True:
            decoded = self._decoder.decode(place)
            if not self._source.seekable:
                _note_times(self._times, decoded)
            place = decoded.after
            yield decoded
            if decoded.is_end:
                break
        self._decoder.check_nothing_follows(place)

    def summary(self, *, salvage: bool = False, ancillary: str | None = None) -> StreamSummary:
        """Decode everything, keep no splats, and account for every bit; a fault is returned, not raised.

        With `salvage`, which needs a file, as `salvage` does it, and all faults are returned in the gaps. With
        `ancillary`, the payload of the last chunk of that type is kept.
        """
        bits = Counter(self._decoder.opening_bits)
        frames: list[FrameSummary] = []
        gaps: list[Gap] = []
        error, payload = None, None
        times = no_times(self._decoder)
        parts: Iterator[DecodedChunk | Gap]
        if salvage:
            self._check_salvage()
            parts = iter(Salvage(self._decoder, self._decoder.first))
        else:
            parts = self._chunks(self._decoder.first)
        try:
            for part in parts:
                if isinstance(part, Gap):
                    gaps.append(part)
                    continue
                bits += part.bits
                _note_times(times, part)
                if part.ancillary is not None and part.ancillary[0] == ancillary:
                    payload = bytes(part.ancillary[1])
                if (f := part.frame) is not None:
                    frames.append(FrameSummary(f.number, f.type, len(f.state.splats), f.bits, f.offset, f.size))
                if (n := part.layer) is not None:
                    layer = LayerSummary(n.layer, n.type, len(n.splats), n.bits, n.offset, n.size)
                    frames[-1] = replace(frames[-1], layers=(*frames[-1].layers, layer))
                if frames and (layers := part.after.layers) is not None:
                    frames[-1] = replace(frames[-1], lacking=layers.lacking)
        except GsvcError as fault:
            error = fault
        file_bytes = self._source.size
        if file_bytes is None:
            while self._source.read(READ_AT_ONCE):
                pass
            file_bytes = self._source.offset
        file_bytes = max(file_bytes, bits.total() // 8)  # it may have grown since it was opened
        counted = {category: bits[category] for category in categories_of(self.header.profile)}
        counted["skipped" if salvage else "unread"] = 8 * file_bytes - sum(counted.values())
        return StreamSummary(self.header, frames, counted, file_bytes, error, times, gaps, payload)

    def close(self) -> None:
        """Close the file, if a path was given."""
        self._source.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


def _note_times(times: FrameTimes, part: DecodedChunk) -> None:
    """Take what a chunk says about the times of frames, if it is one that does."""
    if part.ancillary is not None and part.ancillary[0] == TIMES:
        times.add(part.ancillary[1], part.after.next_number)


def _check_range(start: int, stop: int | None) -> None:
    if start < 0 or (stop is not None and stop < start):
        raise UsageError(f"frames {start}:{stop} were asked for; it must be 0 <= start <= stop")
