"""Encoded frames as a stream and a report; the stream is valid even if the encode ends early."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from typing import Any, BinaryIO

from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.interrupts import Interrupts
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.chunks import DECISIONS
from gsvc_ref.bitstream.header import Quality
from gsvc_ref.bitstream.times import TIMES
from gsvc_ref.encoder.encoded_frame import EncodedFrame
from gsvc_ref.encoder.log import write_log
from gsvc_ref.encoder.loop import FrameCoder
from gsvc_ref.encoder.report import EncodeReport, FrameReport, IncompleteEncodeError, LayerReport
from gsvc_ref.encoder.source_and_target import Target, is_file, opened_target
from gsvc_ref.encoder.stages import StageSeconds
from gsvc_ref.stream import DecodedFrame, StreamWriter
from gsvc_ref.stream.formats import header_fields
from gsvc_ref.video import VideoFormat


class NothingSavedError(UsageError):
    """The target stays as it was, although frames were encoded."""


@dataclass
class StreamPlan:
    """What a stream is to be like."""

    coder: FrameCoder[Any]  # gives the elements of the header, after the first frame
    video: VideoFormat
    # With `least_level`, `level` is the highest allowed, and the header gets the least that fits at the end.
    level: int
    least_level: bool = False
    qualities: tuple[Quality, ...] = ()  # what each quality of a stream with layers promises; empty: `level`
    live: bool = False  # write under the final name, and never go back
    # Gives a file to write in place of the opened one, which has all bytes when the block ends well.
    wrapped: Callable[[BinaryIO], AbstractContextManager[BinaryIO]] = nullcontext
    # the payload of the chunk `t` before a frame, if any
    times_before: Callable[[int], bytes | None] = lambda number: None
    # sentences on what was assumed about the source, and what the frames did not reach
    notes: Callable[[list[FrameReport]], list[str]] = lambda frames: []
    threads: int | None = None  # as asked for; the report has it
    stages: StageSeconds = field(default_factory=StageSeconds)
    name: str = "gsvc_ref.encode"  # for messages

    def header(self) -> SequenceHeader:
        """The sequence header; final when the first frame is encoded."""
        return replace(header_of(self.coder, self.video, self.level), qualities=self.qualities)


def header_of(coder: FrameCoder[Any], video: VideoFormat, level: int) -> SequenceHeader:
    """The sequence header of the frames of a coder."""
    elements: dict[str, Any] = {**header_fields(video), **coder.elements()}
    return SequenceHeader(
        level=level,
        parameter_checksum_flag=coder.settings.checksums,
        paced_flag=coder.settings.paced,
        **elements,
    )


def record(target: Target, plan: StreamPlan, encode: "Callable[[Recording], None]") -> EncodeReport:
    """Call `encode`, which hands encoded frames to a recording, and put their stream in the target's place.

    After at least one complete frame a GsvcError or UsageError becomes an IncompleteEncodeError; any other exception
    passes through, with a note that frames were saved.
    """
    patient = is_file(target)
    with Interrupts(patient=patient) as interrupts:
        interrupts.held = patient  # a file that is just being opened would be left behind; a pipe may wait for a reader
        with opened_target(target, live=plan.live) as opened, plan.wrapped(opened) as file:
            interrupts.release()
            recording = Recording(file, plan, interrupts)
            ended: BaseException | None = None
            try:
                encode(recording)
            except BaseException as error:
                interrupts.held = True  # from here on nothing may get lost
                if not recording.frames or recording.is_broken or isinstance(error, NothingSavedError):
                    raise
                ended = error
            interrupts.held = True
            report = recording.finish(ended)
        if interrupts.seen:
            report = replace(report, interrupted=True)
    if ended is not None and not isinstance(ended, KeyboardInterrupt):
        _raise(ended, report, plan.name)
    return report


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


class Recording:
    """Writes encoded frames, and reports each."""

    def __init__(self, file: BinaryIO, plan: StreamPlan, interrupts: Interrupts) -> None:
        self.plan, self.interrupts = plan, interrupts
        self.frames: list[FrameReport] = []
        self.is_broken = False  # the stream ends, or may end, with part of a chunk that cannot be taken back
        self._file = file
        self._begin = time.perf_counter()
        self._writer: StreamWriter | None = None  # its header takes what is chosen on the first frame

    def put(self, encoded: EncodedFrame) -> None:
        """Write a frame; Ctrl-C waits until it is complete."""
        self.interrupts.held = True
        self.write(encoded)
        self.interrupts.release()

    def write(self, encoded: EncodedFrame) -> None:
        """Write a frame with its layers."""
        begin = time.perf_counter()
        with self.plan.stages.timed("write"):
            written = self._write_frame(encoded)
        self.plan.stages.add(encoded.seconds)
        seconds = encoded.elapsed_s + time.perf_counter() - begin
        bits = {0: written.bits, **{chunk.layer: chunk.bits for chunk in written.chunks}}
        layers = tuple(
            LayerReport(part.layer, part.codes.type, len(part.state.splats), part.codes.intra_count, part.psnr,
                        bits.get(part.layer, {}))
            for part in encoded.layers
        )  # fmt: skip
        self.frames.append(self._report(encoded, written.bits, layers, seconds))

    def _write_frame(self, encoded: EncodedFrame) -> DecodedFrame:
        """Write a frame, the first with the header before it."""
        plan = self.plan
        with self._watched():
            if self._writer is None:
                self._writer = StreamWriter(
                    self._file, plan.header(), index=plan.coder.settings.index, live=plan.live,
                    least_level=plan.least_level,
                )  # fmt: skip
            if (times := plan.times_before(self._writer.frame_count)) is not None:
                self._writer.write_ancillary(TIMES, times)
            return self._writer.write_frame(encoded.codes, encoded.state, encoded.chunks)

    @contextmanager
    def _watched(self) -> Iterator[None]:
        """Note where part of a chunk may have been written that cannot be taken back."""
        try:
            yield
        except (GsvcError, UsageError):  # the frame is at fault
            raise
        except BaseException as error:
            self.is_broken = isinstance(error, OSError) or self._writer is None or not self._writer.goes_back
            raise

    def _report(
        self, encoded: EncodedFrame, bits: dict[str, int], layers: tuple[LayerReport, ...], seconds: float
    ) -> FrameReport:
        codes = encoded.codes
        pruned = self.frames[-1].splats - codes.survivor_count if codes.type == "P" else 0
        return FrameReport(
            encoded.number, codes.type, encoded.reason or "", len(encoded.state.splats), codes.intra_count, pruned,
            encoded.iterations, encoded.psnr, bits, seconds, encoded.decisions, layers,
        )  # fmt: skip

    def finish(self, ended: BaseException | None) -> EncodeReport:
        """Complete the stream, with at least one frame; `ended` is what ended the encode early."""
        assert self._writer is not None
        settings = self.plan.coder.settings
        log = (DECISIONS, write_log([frame.decisions for frame in self.frames])) if settings.decisions else None
        file_bytes = sum(self._writer.finish(log).values()) // 8
        interrupted = isinstance(ended, KeyboardInterrupt)
        return EncodeReport(
            header=self._writer.header,
            settings=replace(settings, threads=self.plan.threads),
            frames=self.frames,
            file_bytes=file_bytes,
            seconds=time.perf_counter() - self._begin,
            seconds_by_stage=dict(self.plan.stages),
            interrupted=interrupted,
            notes=self.plan.notes(self.frames),
            fault=None if ended is None or interrupted else str(ended) or type(ended).__name__,
        )
