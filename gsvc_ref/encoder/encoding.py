"""The encode of anything, frame after frame, to a stream that is valid whatever ends it."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from shutil import copyfileobj
from tempfile import TemporaryFile
from typing import Any, BinaryIO, Generic, Protocol, TypeVar, cast

from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.interrupts import Interrupts
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.chunks import DECISIONS
from gsvc_ref.bitstream.times import TIMES
from gsvc_ref.encoder.encoded_frame import EncodedFrame, OnStage
from gsvc_ref.encoder.frame_types import TypedFrame
from gsvc_ref.encoder.log import Decision, write_log
from gsvc_ref.encoder.report import (
    EncodeReport,
    FrameReport,
    IncompleteEncodeError,
    LayerReport,
    OnProgress,
    Progress,
)
from gsvc_ref.encoder.resume import ChangedSourceError
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.encoder.source_and_target import Target, is_file, opened_target
from gsvc_ref.paper import FrameType
from gsvc_ref.stream import StreamWriter
from gsvc_ref.stream.formats import header_fields
from gsvc_ref.stream.profiles import AnyState
from gsvc_ref.stream.writer import can_go_back
from gsvc_ref.video import VideoFormat

FrameT = TypeVar("FrameT")
"""What a frame of the source is: a picture, or splats."""
CodedT = TypeVar("CodedT", contravariant=True)


class FrameCoder(Protocol[CodedT]):
    """What encodes one frame after the other, each against the reconstruction of the one before (closed loop)."""

    @property
    def settings(self) -> Settings:
        """The settings in use."""

    @property
    def state(self) -> AnyState:
        """The decoder's state after the frames so far."""

    def elements(self) -> dict[str, Any]:
        """The elements of the sequence header that belong to the profile."""

    def encode(self, frame: CodedT, frame_type: FrameType, number: int, progress: OnStage) -> EncodedFrame:
        """Encode a frame; the next one is predicted from its reconstruction."""


def completed(
    target: Target,
    make: "Callable[[BinaryIO, Interrupts], Encoding[Any]]",
    *,
    live: bool = False,
    corrected: bool = False,
) -> EncodeReport:
    """Run the encode that `make` makes for the opened target, and put the stream in its place.

    With `corrected` the file that `make` takes can go back, if need be by way of a temporary one.

    Raises
    ------
    IncompleteEncodeError
        A GsvcError or UsageError came after at least one complete frame; its `report` is about those that were saved.
    OSError
        The target cannot be written; what stood under its name still does, unless `live`.
    Exception
        Any other exception that ended the encode passes through, with a note if frames were saved.
    """
    patient = is_file(target)
    with Interrupts(patient=patient) as interrupts:
        interrupts.held = patient  # a file that is just being opened would be left behind; a pipe may wait for a reader
        with (
            opened_target(target, live=live) as opened,
            _correctable(opened) if corrected else nullcontext(opened) as file,
        ):
            interrupts.release()
            work = make(file, interrupts)
            report = work.run()
        report = replace(report, interrupted=report.interrupted or interrupts.seen)
    if work.fault is not None:
        _raise(work.fault, report, work.name)
    return report


@contextmanager
def _correctable(file: BinaryIO) -> Iterator[BinaryIO]:
    """The file itself if it can go back; otherwise a temporary one, whose bytes it gets when the block ends well."""
    if can_go_back(file):
        yield file
        return
    with TemporaryFile() as whole:
        yield cast(BinaryIO, whole)
        whole.seek(0)
        copyfileobj(whole, file)


def _raise(fault: BaseException, report: EncodeReport, name: str) -> None:
    """Raise what ended an encode early, now that the frames before it are saved."""
    count = len(report.frames)
    saved = f"saved: {count} complete frame{'' if count == 1 else 's'}, as a valid stream"
    if isinstance(fault, GsvcError):
        raise IncompleteEncodeError(fault.kind, f"{fault.message}; {saved}", report, fault.rule, fault.bit) from fault
    if isinstance(fault, UsageError):
        raise IncompleteEncodeError("invalid", f"{fault}; {saved}", report) from fault
    fault.add_note(f"{name} {saved}")
    raise fault


class Encoding(ABC, Generic[FrameT]):
    """One encode: the objects that its steps share.

    Parameters
    ----------
    file
        The opened target.
    video
        The format of the source.
    coder
        Encodes each frame.
    level
        The level of the stream, or the highest that it may have.
    progress
        Called now and then with the place where the encode is.
    interrupts
        Hold Ctrl-C back while a frame is written.
    live
        Never go back in the file.
    least_level
        Lower the level to the least that fits once all frames are written.

    Attributes
    ----------
    fault
        The fault that ended it early, other than Ctrl-C; None if nothing did.
    frame_count
        The number of frames as far as it is known.
    kept
        The number of frames so far that were taken from an earlier encode.
    """

    name = "gsvc_ref.encode"
    """The function that is at work."""

    def __init__(
        self,
        file: BinaryIO,
        video: VideoFormat,
        coder: FrameCoder[FrameT],
        level: int,
        progress: OnProgress | None,
        interrupts: Interrupts,
        *,
        live: bool = False,
        least_level: bool = False,
    ) -> None:
        self.file, self.format, self.encoder, self.level = file, video, coder, level
        self.progress, self.interrupts = progress, interrupts
        self.live, self.least_level = live, least_level
        self.begin = time.perf_counter()
        self.seconds: dict[str, float] = {}
        self.reports: list[FrameReport] = []
        self.frame_count = video.frame_count
        self.kept = 0
        self.writer: StreamWriter | None = None  # its header takes what is chosen on the first frame
        self.fault: BaseException | None = None
        self.target_failed = False

    @abstractmethod
    def _frames(self) -> Iterator[FrameT]:
        """The frames of the source."""

    @abstractmethod
    def _typed(self, frames: Iterator[FrameT]) -> Iterator[TypedFrame[FrameT]]:
        """The frames with their numbers and types."""

    @abstractmethod
    def _no_frames(self) -> Exception:
        """What is raised for a source without frames."""

    @abstractmethod
    def _notes(self) -> list[str]:
        """Sentences on what was assumed about the source and what was not reached."""

    @abstractmethod
    def _decisions(self, item: TypedFrame[FrameT], encoded: EncodedFrame) -> tuple[Decision, ...]:
        """The decisions made about a frame."""

    def _times_before(self, number: int) -> bytes | None:
        """The payload of the chunk `t` before a frame; None if there is none."""
        return None

    def _header(self) -> SequenceHeader:
        settings = self.encoder.settings
        return SequenceHeader(
            level=self.level,
            parameter_checksum_flag=settings.checksums,
            paced_flag=settings.paced,
            **header_fields(self.format),
            **self.encoder.elements(),
        )

    def run(self) -> EncodeReport:
        """Encode all frames, or those until it is ended early; only then is the stream finished."""
        interrupted = False
        try:
            self._encode_all()
        except BaseException as error:
            self.interrupts.held = True  # from here on nothing may get lost
            if not self.reports or self.target_failed or isinstance(error, ChangedSourceError):
                raise
            if isinstance(error, KeyboardInterrupt):
                interrupted = True
            else:
                self.fault = error
        self.interrupts.held = True
        if self.writer is None:
            raise self.fault or self._no_frames()
        settings = self.encoder.settings
        log = (DECISIONS, write_log([frame.decisions for frame in self.reports])) if settings.decisions else None
        file_bytes = sum(self.writer.finish(log).values()) // 8
        return EncodeReport(
            header=self.writer.header,
            settings=self._settings_used(),
            frames=self.reports,
            file_bytes=file_bytes,
            seconds=time.perf_counter() - self.begin,
            seconds_by_stage=self.seconds,
            interrupted=interrupted,
            notes=self._notes(),
            fault=None if self.fault is None else str(self.fault) or type(self.fault).__name__,
        )

    def _encode_all(self) -> None:
        """Encode all frames."""
        for item in self._timed_frames():
            self._encode(item)

    def _settings_used(self) -> Settings:
        """The settings for the report."""
        return self.encoder.settings

    def _timed_frames(self) -> Iterator[TypedFrame[FrameT]]:
        """The frames with their types; the time between them is that of reading and detecting."""
        typed = self._typed(self._frames_until_fault())
        while True:
            with self._timed("read and detect"):
                item = next(typed, None)
            if item is None:
                return
            yield item

    def _frames_until_fault(self) -> Iterator[FrameT]:
        """The frames of the source; a fault ends them like their end, so that those read ahead are still encoded."""
        frames = self._frames()
        while True:
            try:
                frame = next(frames, None)
            except Exception as error:
                self.fault = error
                return
            if frame is None:
                return
            yield frame

    def _encode(self, item: TypedFrame[FrameT]) -> None:
        begin = time.perf_counter()
        encoded = self.encoder.encode(
            item.frame, item.type, item.number,
            lambda stage, done, iterations, psnr: self._show_progress(stage, item.number, done, iterations, psnr),
        )  # fmt: skip
        self.interrupts.held = True
        self._put(item, encoded, time.perf_counter() - begin)
        self.interrupts.release()

    def _put(self, item: TypedFrame[FrameT], encoded: EncodedFrame, seconds: float) -> None:
        """Write a frame that took so many seconds, and note what was done.

        A frame of which a layer is at fault is complete without that one and those above it.
        """
        begin = time.perf_counter()
        layers: list[LayerReport] = []
        fault: GsvcError | UsageError | None = None
        with self._timed("write"):
            bits = self._write(encoded)
            try:
                self._write_layers(encoded, bits, layers)
            except (GsvcError, UsageError) as error:
                fault, encoded = error, replace(encoded, psnr=layers[-1].psnr)
        for stage, spent in encoded.seconds.items():
            self.seconds[stage] = self.seconds.get(stage, 0.0) + spent
        self.reports.append(self._report(item, encoded, bits, tuple(layers), seconds + time.perf_counter() - begin))
        if fault is not None:
            raise fault

    def _write(self, encoded: EncodedFrame) -> dict[str, int]:
        """Write a frame without its layers, the first with the header before it; the bits that it took."""
        with self._target_watched():
            if self.writer is None:
                self.writer = StreamWriter(
                    self.file, self._header(), index=self.encoder.settings.index, live=self.live,
                    least_level=self.least_level,
                )  # fmt: skip
            if (times := self._times_before(self.writer.frame_count)) is not None:
                self.writer.write_ancillary(TIMES, times)
            return self.writer.write_frame(encoded.codes, encoded.state).bits

    def _write_layers(self, encoded: EncodedFrame, bits: dict[str, int], layers: list[LayerReport]) -> None:
        """Write the layers of a frame, of which the first is its base; what is said of each goes to `layers`."""
        assert self.writer is not None
        with self._target_watched():
            for part in encoded.layers:
                codes, spent = part.codes, bits if part.layer == 0 else {}
                if encoded.has_chunk(part):
                    spent = self.writer.write_layer(part.layer, codes).bits
                count = len(part.state.splats)
                layers.append(LayerReport(part.layer, codes.type, count, codes.intra_count, part.psnr, spent))

    @contextmanager
    def _target_watched(self) -> Iterator[None]:
        """Note where part of a chunk may have been written that cannot be taken back."""
        try:
            yield
        except (GsvcError, UsageError):  # the frame is at fault
            raise
        except BaseException as error:
            self.target_failed = isinstance(error, OSError) or self.writer is None or not self.writer.goes_back
            raise

    def _report(
        self,
        item: TypedFrame[FrameT],
        encoded: EncodedFrame,
        bits: dict[str, int],
        layers: tuple[LayerReport, ...],
        seconds: float,
    ) -> FrameReport:
        codes = encoded.codes
        pruned = self.reports[-1].splats - codes.survivor_count if codes.type == "P" else 0
        reason = item.reason if codes.type == item.type else "nothing to see of what changed"
        return FrameReport(
            item.number, codes.type, encoded.reason or reason, len(encoded.state.splats), codes.intra_count,
            pruned, encoded.iterations, encoded.psnr, bits, seconds, self._decisions(item, encoded), layers,
        )  # fmt: skip

    def _show_progress(
        self, stage: str, frame: int, iteration: int = 0, iterations: int = 0, psnr: float | None = None
    ) -> None:
        if self.progress:
            elapsed = time.perf_counter() - self.begin
            if self.frame_count is not None and frame >= self.frame_count:
                self.frame_count = None  # the source has more frames than it said
            self.progress(
                Progress(frame, self.frame_count, stage, iteration, iterations, psnr, elapsed, kept=self.kept)
            )

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        begin = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begin
