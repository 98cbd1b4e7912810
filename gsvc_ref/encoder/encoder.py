"""Encoding: source frames in, a `.gsvc` stream out, one frame after the other."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import islice
from typing import BinaryIO, Final

from gsvc_ref.bitstream import LEVELS, SequenceHeader, level_for
from gsvc_ref.bitstream.chunks import DECISIONS
from gsvc_ref.bitstream.header import I_FRAME_SECONDS
from gsvc_ref.encoder.frame import EncodedFrame, FrameEncoder
from gsvc_ref.encoder.frame_types import TypedFrame, typed_frames, with_i_frames
from gsvc_ref.encoder.log import FrameLog, write_log
from gsvc_ref.encoder.quantizer_choice import quantizer_fields
from gsvc_ref.encoder.report import EncodeReport, FrameReport, IncompleteEncodeError, OnProgress, Progress
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.encoder.source_and_target import Frame, Source, Target, is_file, opened_source, opened_target, same_file
from gsvc_ref.errors import GsvcError, UsageError
from gsvc_ref.interrupts import Interrupts
from gsvc_ref.stream import StreamWriter
from gsvc_ref.stream.formats import header_fields
from gsvc_ref.stream.pace import second_limits
from gsvc_ref.video import VideoReader

MAX_SPLATS: Final = max(level.splats for level in LEVELS.values())
"""No level allows more splats in a frame."""


def encode(
    source: Source,
    target: Target,
    settings: Settings | None = None,
    *,
    live: bool = False,
    progress: OnProgress | None = None,
) -> EncodeReport:
    """Encode a video.

    Whatever ends it early after at least one complete frame, the frames so far become a valid stream in the target's
    place. Only a target that cannot be written leaves what stood there before.

    Parameters
    ----------
    source
        A path to anything `gsvc_ref.video.open_video` reads, ``-`` for y4m from standard input, ``scene:NAME`` or a
        Scene of `gsvc_lab.scenes`, an open VideoReader, or a pair of frames ((H, W, 3) u1 or u2 each) and their
        VideoFormat.
    target
        A path, ``-`` for standard output, or a binary file. A path gets the stream under a temporary name in the same
        folder, ``.NAME.NUMBER.part``, and its own name when it is complete and on the disk: at every moment it
        is the old file or the new one, also if the process is killed.
    settings
        Settings.quick() if not given.
    live
        Write under the final name from the first frame on, frame by frame, and never go back: at every moment the file
        can be decoded up to its last complete frame. Its header does not tell the number of frames.
    progress
        Called now and then with the place where the encode is.

    Returns
    -------
    The report; its `interrupted` is True if Ctrl-C stopped the encode after at least one complete frame.

    Raises
    ------
    GsvcError
        The source cannot be read, or has no frames.
    UsageError
        The settings do not fit the source, or a frame its format; with `live`, another encode writes to the target.
    IncompleteEncodeError
        One of these two came after at least one complete frame; its `report` is about the frames that were saved.
    OSError
        The target cannot be written; what stood under its name still does, unless `live`.
    Exception
        Exceptions of the caller's frames or of `progress` pass through, with a note if frames were saved.
    """
    chosen = Settings.quick() if settings is None else settings
    if same_file(source, target):
        raise UsageError(f"{target} is the source itself; give the stream another name")
    with opened_source(source) as reader, Interrupts(patient=is_file(target)) as interrupts:
        with opened_target(target, live=live) as file:
            work = _Encode(reader, file, chosen, progress, interrupts, live=live)
            report = work.run()
        report = replace(report, interrupted=report.interrupted or interrupts.seen)
    if work.fault is not None:
        _raise(work.fault, report)
    return report


def _raise(fault: BaseException, report: EncodeReport) -> None:
    """Raise what ended an encode early, now that the frames before it are saved."""
    count = len(report.frames)
    saved = f"saved: {count} complete frame{'' if count == 1 else 's'}, as a valid stream"
    if isinstance(fault, GsvcError):
        raise IncompleteEncodeError(fault.kind, f"{fault.message}; {saved}", report, fault.rule, fault.bit) from fault
    if isinstance(fault, UsageError):
        raise IncompleteEncodeError("invalid", f"{fault}; {saved}", report) from fault
    fault.add_note(f"gsvc_ref.encode {saved}")
    raise fault


class _Encode:
    """One encode: the objects that its steps share.

    Attributes
    ----------
    fault
        The fault that ended it early, other than Ctrl-C; None if nothing did.
    """

    def __init__(
        self,
        reader: VideoReader,
        file: BinaryIO,
        settings: Settings,
        progress: OnProgress | None,
        interrupts: Interrupts,
        *,
        live: bool,
    ) -> None:
        self.reader, self.settings, self.progress = reader, settings, progress
        self.interrupts, self.live = interrupts, live
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
        self.level = level_for(width, height, splats=min(most + most // 4, MAX_SPLATS))
        self.encoder = FrameEncoder(settings, width, height, self.format.bit_depth)
        if settings.paced:
            self.level = self._paced_level(most if settings.psnr is None else 0)  # with a quality to hold, nobody knows
        self.file = file
        self.writer: StreamWriter | None = None  # its header takes what is chosen on the first frame
        self.fault: BaseException | None = None
        self.target_failed = False

    def _paced_level(self, splats: int) -> int:
        """The least level, not below that of a frame, that allows a second of frames of so many splats."""
        width, height = self.format.width, self.format.height
        for level in range(self.level, max(LEVELS) + 1):
            header = replace(self._header(), level=level)
            frames, allowed = header.frames_of_second, second_limits(header)
            if frames * width * height <= allowed.pixels and frames * splats <= allowed.splats:
                return level
        raise UsageError(
            f"no level allows {frames} frames of {width}x{height} pixels and {splats} splats in a second of a paced "
            "stream (R-5-7); encode at a lower frame rate, smaller, with fewer splats, or without pacing"
        )

    def _header(self) -> SequenceHeader:
        settings, video = self.encoder.settings, self.format
        return SequenceHeader(
            level=self.level,
            parameter_checksum_flag=settings.checksums,
            paced_flag=settings.paced,
            **header_fields(video),
            **quantizer_fields(settings),
        )

    def run(self) -> EncodeReport:
        """Encode all frames, or those until it is ended early; only then is the stream finished."""
        interrupted = False
        try:
            for item in self._typed():
                self._encode(item)
        except BaseException as error:
            self.interrupts.held = True  # from here on nothing may get lost
            if not self.reports or self.target_failed:
                raise
            if isinstance(error, KeyboardInterrupt):
                interrupted = True
            else:
                self.fault = error
        self.interrupts.held = True
        if self.writer is None:
            nothing = "the source has no frames to encode; check the file and --frames"
            raise self.fault or GsvcError("malformed", nothing)
        log = (DECISIONS, write_log([frame.decisions for frame in self.reports])) if self.settings.decisions else None
        file_bytes = sum(self.writer.finish(log).values()) // 8
        return EncodeReport(
            header=self.writer.header,
            settings=self.encoder.settings,
            frames=self.reports,
            file_bytes=file_bytes,
            seconds=time.perf_counter() - self.begin,
            seconds_by_stage=self.seconds,
            interrupted=interrupted,
            notes=[*self.reader.notes, *self._missed_quality()],
            fault=None if self.fault is None else str(self.fault) or type(self.fault).__name__,
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
        typed = typed_frames(
            self._frames(), self.settings, self.format.peak, lambda number: self._show_progress("detect", number)
        )
        if self.settings.paced:
            rate = self.format.frame_rate
            typed = with_i_frames(typed, I_FRAME_SECONDS * -(-rate.numerator // rate.denominator))
        while True:
            with self._timed("read and detect"):
                item = next(typed, None)
            if item is None:
                return
            yield item

    def _frames(self) -> Iterator[Frame]:
        """The frames of the source; a fault ends them like their end, so that those read ahead are still encoded."""
        frames = islice(self.reader, *self.settings.frames)
        while True:
            try:
                frame = next(frames, None)
            except Exception as error:
                self.fault = error
                return
            if frame is None:
                return
            yield frame

    def _encode(self, item: TypedFrame) -> None:
        begin = time.perf_counter()
        before = len(self.encoder.state.splats)
        encoded = self.encoder.encode(
            item.frame, item.type, item.number,
            lambda stage, done, iterations, psnr: self._show_progress(stage, item.number, done, iterations, psnr),
        )  # fmt: skip
        self.interrupts.held = True
        with self._timed("write"):
            bits = self._write(encoded)
        for stage, seconds in encoded.seconds.items():
            self.seconds[stage] = self.seconds.get(stage, 0.0) + seconds
        self.reports.append(self._report(item, encoded, before, bits, time.perf_counter() - begin))
        self.interrupts.release()

    def _write(self, encoded: EncodedFrame) -> dict[str, int]:
        """Write a frame, the first with the header before it; the bits that it took."""
        try:
            if self.writer is None:
                self.writer = StreamWriter(self.file, self._header(), index=self.settings.index, live=self.live)
            return self.writer.write_frame(encoded.codes, encoded.state).bits
        except (GsvcError, UsageError):  # the frame is at fault
            raise
        except BaseException as error:  # part of a chunk may be written
            self.target_failed = isinstance(error, OSError) or self.writer is None or not self.writer.goes_back
            raise

    def _report(
        self, item: TypedFrame, encoded: EncodedFrame, before: int, bits: dict[str, int], seconds: float
    ) -> FrameReport:
        codes = encoded.codes
        pruned = before - codes.survivor_count if codes.type == "P" else 0
        reason = item.reason if codes.type == item.type else "nothing to see of what changed"
        log = FrameLog((*item.decisions, *encoded.decisions))
        log.measured("frames", encoded.iterations, sum(encoded.seconds.values()))
        return FrameReport(
            item.number, codes.type, reason, len(encoded.state.splats), codes.intra_count, pruned, encoded.iterations,
            encoded.psnr, bits, seconds, log.completed(self.settings.effects, codes.type),
        )  # fmt: skip

    def _show_progress(
        self, stage: str, frame: int, iteration: int = 0, iterations: int = 0, psnr: float | None = None
    ) -> None:
        if self.progress:
            elapsed = time.perf_counter() - self.begin
            if self.frame_count is not None and frame >= self.frame_count:
                self.frame_count = None  # the source has more frames than it said
            self.progress(Progress(frame, self.frame_count, stage, iteration, iterations, psnr, elapsed))

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        begin = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begin
