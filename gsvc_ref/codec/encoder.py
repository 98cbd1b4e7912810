"""Encoding: source frames in, a `.gsvc` stream out, one frame after the other."""

import signal
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BufferedWriter, FileIO
from itertools import islice
from pathlib import Path
from types import FrameType
from typing import Any, BinaryIO, Final, cast

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.bitstream import LEVELS, SequenceHeader, StreamWriter, level_for
from gsvc_ref.codec.detection import TypedFrame, typed_frames
from gsvc_ref.codec.formats import header_fields
from gsvc_ref.codec.frame_encoder import EncodedFrame, FrameEncoder
from gsvc_ref.codec.quantizer_choice import quantizer_fields
from gsvc_ref.codec.report import EncodeReport, FrameReport, OnProgress, Progress
from gsvc_ref.codec.settings import Settings
from gsvc_ref.errors import GsvcError, UsageError
from gsvc_ref.video import PartialFile, VideoFormat, VideoReader, open_video
from gsvc_ref.video.format import check_frame

Frame = NDArray[np.unsignedinteger[Any]]
Source = str | Path | BinaryIO | VideoReader | tuple[Iterable[Frame], VideoFormat]

MOST_SPLATS: Final = max(level.splats for level in LEVELS.values())
"""No level allows more splats in a frame."""


def encode(
    source: Source,
    target: str | Path | BinaryIO,
    settings: Settings | None = None,
    *,
    progress: OnProgress | None = None,
) -> EncodeReport:
    """Encode a video.

    Parameters
    ----------
    source
        A path to anything `gsvc_ref.video.open_video` reads, ``-`` for y4m from standard input, an open VideoReader, or
        a pair of frames ((H, W, 3) u1 or u2 each) and their VideoFormat.
    target
        A path, ``-`` for standard output, or a binary file. A path gets the stream under a temporary name in the same
        folder, and its own name when it is complete.
    settings
        Settings.quick() if not given.
    progress
        Called now and then with where the encode is.

    Returns
    -------
    What was encoded and how; `interrupted` is True if Ctrl-C stopped it after at least one complete frame.

    Raises
    ------
    GsvcError
        The source cannot be read, or has no frames.
    UsageError
        The settings do not fit the source.
    OSError
        The target cannot be written; nothing is left under its name.
    """
    chosen = Settings.quick() if settings is None else settings
    if isinstance(source, str | Path) and isinstance(target, str | Path) and _same_file(Path(source), Path(target)):
        raise UsageError(f"{target} is the source itself; give the stream another name")
    with _opened(source) as reader, _target_file(target) as file:
        return _Encode(reader, file, chosen, progress).run()


def _same_file(a: Path, b: Path) -> bool:
    return a.is_file() and b.is_file() and a.samefile(b)


class _Encode:
    """One encode: the objects that its steps share."""

    def __init__(self, reader: VideoReader, file: BinaryIO, settings: Settings, progress: OnProgress | None) -> None:
        self.reader, self.settings, self.progress = reader, settings, progress
        self.format = reader.format
        self.begin = time.perf_counter()
        self.seconds: dict[str, float] = {}
        self.reports: list[FrameReport] = []
        start, stop = settings.frames
        count = reader.format.frame_count
        ends = [end for end in (count, stop) if end is not None]
        self.frame_count = max(0, min(ends) - start) if ends else None
        width, height = self.format.width, self.format.height
        most = settings.most_splats(width, height)
        # P-frames may pass N while they add before they prune.
        self.level = level_for(width, height, splats=min(most + most // 4, MOST_SPLATS))
        self.encoder = FrameEncoder(settings, width, height, self.format.bit_depth)
        self.file = file
        self.writer: StreamWriter | None = None  # its header takes what is chosen on the first frame

    def _header(self) -> SequenceHeader:
        settings, video = self.encoder.settings, self.format
        return SequenceHeader(
            level=self.level,
            parameter_checksum_flag=settings.checksums,
            **header_fields(video),
            **quantizer_fields(settings),
        )

    def run(self) -> EncodeReport:
        """Encode all frames; Ctrl-C ends it after the last complete frame."""
        interrupted = False
        try:
            for item in self._typed():
                self._encode(item)
        except KeyboardInterrupt:
            if not self.reports:
                raise
            interrupted = True
        if self.writer is None:
            raise GsvcError("malformed", "the source has no frames to encode; check the file and --frames")
        with interrupts_deferred() as interrupt:
            file_bytes = sum(self.writer.finish().values()) // 8
        interrupted |= interrupt.seen
        return EncodeReport(
            header=self.writer.header,
            settings=self.encoder.settings,
            frames=self.reports,
            file_bytes=file_bytes,
            seconds=time.perf_counter() - self.begin,
            seconds_by_stage=self.seconds,
            interrupted=interrupted,
            notes=[*self.reader.notes, *self._missed_quality()],
        )

    def _missed_quality(self) -> list[str]:
        """A sentence if frames have less than the quality asked for."""
        goal = self.settings.psnr
        if goal is None:
            return []
        missed = [frame for frame in self.reports if frame.psnr < goal]
        if not missed:
            return []
        worst = min(missed, key=lambda frame: frame.psnr)
        return [
            f"{len(missed)} of {len(self.reports)} frames have less than {goal:g} dB (frame {worst.number}, the worst, "
            f"has {worst.psnr:.2f} dB): allow more splats or iterations"
        ]

    def _typed(self) -> Iterator[TypedFrame]:
        """The frames with their types; the time between them is that of reading and detecting."""
        frames = islice(self.reader, *self.settings.frames)
        typed = typed_frames(frames, self.settings, self.format.peak, lambda number: self._tell("detect", number))
        while True:
            with self._timed("read and detect"):
                item = next(typed, None)
            if item is None:
                return
            yield item

    def _encode(self, item: TypedFrame) -> None:
        begin = time.perf_counter()
        before = len(self.encoder.state.splats)
        encoded = self.encoder.encode(
            item.frame, item.type, item.number,
            lambda stage, done, iterations, psnr: self._tell(stage, item.number, done, iterations, psnr),
        )  # fmt: skip
        with interrupts_deferred() as interrupt:
            with self._timed("write"):
                if self.writer is None:
                    self.writer = StreamWriter(self.file, self._header(), index=self.settings.index)
                written = self.writer.write_frame(encoded.codes)
            for stage, seconds in encoded.seconds.items():
                self.seconds[stage] = self.seconds.get(stage, 0.0) + seconds
            self.reports.append(self._report(item, encoded, before, written.bits, time.perf_counter() - begin))
        if interrupt.seen:
            raise KeyboardInterrupt

    def _report(
        self, item: TypedFrame, encoded: EncodedFrame, before: int, bits: dict[str, int], seconds: float
    ) -> FrameReport:
        codes = encoded.codes
        pruned = before - codes.survivor_count if item.type == "P" else 0
        return FrameReport(
            item.number, item.type, item.reason, len(encoded.state.splats), codes.intra_count, pruned,
            encoded.iterations, encoded.psnr, bits, seconds,
        )  # fmt: skip

    def _tell(self, stage: str, frame: int, iteration: int = 0, iterations: int = 0, psnr: float | None = None) -> None:
        if self.progress:
            elapsed = time.perf_counter() - self.begin
            self.progress(Progress(frame, self.frame_count, stage, iteration, iterations, psnr, elapsed))

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        begin = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begin


@dataclass
class Interrupt:
    """Whether Ctrl-C came."""

    seen: bool = False


@contextmanager
def interrupts_deferred() -> Iterator[Interrupt]:
    """Hold Ctrl-C back while a frame is written, which is quick, and say whether it came.

    Only the main thread gets Ctrl-C, and only Python's own handling of it is replaced.
    """
    interrupt = Interrupt()
    in_main = threading.current_thread() is threading.main_thread()
    if not in_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield interrupt
        return

    def note(number: int, frame: FrameType | None) -> None:
        interrupt.seen = True

    signal.signal(signal.SIGINT, note)
    try:
        yield interrupt
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def _opened(source: Source) -> Iterator[VideoReader]:
    if isinstance(source, VideoReader):
        yield source
    elif isinstance(source, tuple) and len(source) == 2 and isinstance(source[1], VideoFormat):
        yield FrameSource(*source)
    elif not isinstance(source, str | Path) and not hasattr(source, "read"):
        raise UsageError(
            f"a {type(source).__name__} is no source; give a path, a VideoReader, or frames with their format: "
            f"(frames, VideoFormat(...))"
        )
    else:
        with open_video(source) as reader:
            yield reader


class FrameSource(VideoReader):
    """Frames that the caller has, as a source."""

    def __init__(self, frames: Iterable[Frame], video: VideoFormat) -> None:
        super().__init__()
        self.format, self._source = video, frames

    def _read(self) -> Iterator[Frame]:
        for number, frame in enumerate(self._source):
            try:
                check_frame(np.asarray(frame), self.format)
            except UsageError as error:
                raise UsageError(f"frame {number}: {error}") from None
            yield np.array(frame)  # the caller may fill the same array again


class Device(FileIO):
    """A file that cannot go back, whatever it claims: /dev/null does, and then refuses to be cut to a length."""

    def seekable(self) -> bool:
        """Never."""
        return False


@contextmanager
def _target_file(target: str | Path | BinaryIO) -> Iterator[BinaryIO]:
    """The file to write to; a path stands under its own name only when the block has ended well."""
    if not isinstance(target, str | Path):
        if not hasattr(target, "write") or hasattr(target, "encoding"):
            raise UsageError(f"a {type(target).__name__} is no target; give a path or a file opened in mode 'wb'")
        yield target
        return
    if str(target) == "-":
        yield sys.stdout.buffer
        sys.stdout.buffer.flush()
        return
    path = Path(target)
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name the file to write, for instance {path / 'video.gsvc'}")
    if path.exists() and not path.is_file():  # a pipe or device has no name to take at the end
        with BufferedWriter(Device(path, "wb")) as file:
            yield cast(BinaryIO, file)
        return
    part = PartialFile(path)
    try:
        with part.path.open("w+b") as file:
            yield file
        part.commit()
    except BaseException:
        part.discard()
        raise
