"""One encode: source frames in, a `.gsvc` stream out, one frame after the other."""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from gsvc_base.arrays import Frame
from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.interrupts import Interrupts
from gsvc_ref.bitstream import LEVELS, level_for
from gsvc_ref.bitstream.header import I_FRAME_SECONDS
from gsvc_ref.encoder.encoded_frame import EncodedFrame
from gsvc_ref.encoder.encoding import Encoding, completed
from gsvc_ref.encoder.frame import FrameEncoder
from gsvc_ref.encoder.frame_types import TypedFrame, typed_frames, with_i_frames
from gsvc_ref.encoder.groups import GroupCoder
from gsvc_ref.encoder.log import Decision, FrameLog
from gsvc_ref.encoder.main.frame import MainFrameEncoder
from gsvc_ref.encoder.main.layers import LayeredFrameEncoder
from gsvc_ref.encoder.report import EncodeReport, OnProgress
from gsvc_ref.encoder.resume import GroupInWork, Keeper, about_encode
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.encoder.side_by_side import SideBySide
from gsvc_ref.encoder.source_and_target import Source, Target, opened_source
from gsvc_ref.encoder.times import SourceTimes
from gsvc_ref.stream.pace import second_limits
from gsvc_ref.video import VideoFormat, VideoReader
from gsvc_ref.video.format import FrameRate

LedBy = Callable[[GroupCoder, VideoFormat], GroupCoder]
"""What gives a coder that leads another one, of a source with a format."""


def encode_once(
    source: Source,
    target: Target,
    settings: Settings,
    frame_rate: FrameRate | None = None,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: OnProgress | None = None,
    *,
    live: bool = False,
    resume: str | Path | None = None,
    led_by: LedBy | None = None,
) -> EncodeReport:
    """Encode with settings that have no goal for the whole clip; parameters, results and errors are those of `encode`.

    `led_by` gives a coder in place of the one that it is given, which is to lead that from frame to frame.
    """
    with opened_source(source, frame_rate) as reader, opened_keeper(resume, reader, settings) as keeper:
        report = completed(
            target,
            lambda file, interrupts: _Encode(
                reader, file, settings, progress, interrupts, jobs, executor, keeper, led_by, live=live
            ),
            live=live,
        )
        if keeper is not None and not report.interrupted:
            keeper.remove()
        return report


def coder_of(settings: Settings, video: VideoFormat) -> GroupCoder:
    """What encodes the frames of a source."""
    make: Callable[..., GroupCoder] = MainFrameEncoder if settings.profile == "main" else FrameEncoder
    if settings.layer_count > 1:
        make = LayeredFrameEncoder
    return make(settings, video.width, video.height, video.bit_depth)


def frame_count_of(settings: Settings, video: VideoFormat) -> int | None:
    """The number of frames to be encoded; None if the source does not tell."""
    start, stop = settings.frames
    ends = [end for end in (video.frame_count, stop) if end is not None]
    return max(0, min(ends) - start) if ends else None


def no_frames(settings: Settings) -> GsvcError:
    """The error of a source that gave no frame."""
    if start := settings.frames[0]:
        return GsvcError(
            "malformed", f"the source ends before frame {start}, with which --frames begins; frames count from 0"
        )
    return GsvcError("malformed", "the source has no frames to encode; check the file")


@contextmanager
def opened_keeper(folder: str | Path | None, reader: VideoReader, settings: Settings) -> Iterator[Keeper | None]:
    """What keeps groups of pictures in a folder, if there is one, closed at the end."""
    if folder is None:
        yield None
        return
    keeper = Keeper(Path(folder), about_encode(reader.format, settings))
    try:
        yield keeper
    finally:
        keeper.close()


class _Encode(Encoding[Frame]):
    """One encode of a video."""

    encoder: GroupCoder

    def __init__(
        self,
        reader: VideoReader,
        file: BinaryIO,
        settings: Settings,
        progress: OnProgress | None,
        interrupts: Interrupts,
        jobs: int,
        executor: Executor | None,
        keeper: Keeper | None = None,
        led_by: LedBy | None = None,
        *,
        live: bool,
    ) -> None:
        self.reader, self.asked = reader, settings
        self.jobs, self.executor, self.keeper = jobs, executor, keeper
        self.group: GroupInWork | None = None
        if keeper is not None:
            keeper.header, keeper.is_sound = self._header, lambda: self.fault is None
        if self.is_side_by_side and settings.threads is None:
            settings = settings.with_(threads=1)
        self.settings = settings
        video = reader.format
        most = settings.most_splats(video.width, video.height)
        room = settings.counted_splats(video.width, video.height)
        level = level_for(video.width, video.height, splats=room)
        unforeseen = settings.profile == "main" and not settings.paced  # the rendering work of its splats
        if unforeseen:
            level = min(level + 1, max(LEVELS))
        coder = coder_of(settings, video)
        if led_by is not None:
            coder = led_by(coder, video)
        super().__init__(file, video, coder, level, progress, interrupts, live=live, least_level=unforeseen)
        self.times = SourceTimes(reader, *settings.frames, least_delay=live or settings.low_latency)
        self.frame_count = frame_count_of(settings, video)
        if settings.paced:
            usual = room if settings.profile == "main" else most
            holds_quality = settings.psnr is not None or settings.quality is not None
            self.level = self._paced_level(0 if holds_quality else usual)  # with a quality to hold, nobody knows

    @property
    def is_side_by_side(self) -> bool:
        """Whether groups of pictures are encoded elsewhere than here."""
        return self.jobs > 1 or self.executor is not None

    def _encode_all(self) -> None:
        """Encode all frames, each group of pictures with a coder of its own."""
        if self.is_side_by_side:
            self._encode_side_by_side()
            return
        first: GroupCoder | None = None
        for item in self._timed_frames():
            if item.type == "I":
                if first is not None:
                    self.encoder = first.for_group()
                self._begin_group(item.number, is_first=first is None)
            kept = None if self.group is None else self.group.take(item.frame)
            if kept is None:
                self._encode(item)
            else:
                self._put_kept(item, *kept)
            first = first or self.encoder.for_group()
        self._end_group(is_last=True)

    def _begin_group(self, number: int, *, is_first: bool) -> None:
        """Begin to keep a group of pictures, or to take it from what was kept."""
        self._end_group(is_last=False)
        if self.keeper is not None:
            self.group = self.keeper.group(number)
            if is_first:
                self.group.decide(self.encoder)

    def _end_group(self, *, is_last: bool) -> None:
        if self.group is not None:
            self.group.end(is_last=is_last)

    def _put_kept(self, item: TypedFrame[Frame], encoded: EncodedFrame, seconds: float) -> None:
        """Write a frame that was kept."""
        self.kept += 1
        self._show_progress("encode", item.number)
        self.interrupts.held = True
        super()._put(item, encoded, seconds)
        self.interrupts.release()

    def _put(self, item: TypedFrame[Frame], encoded: EncodedFrame, seconds: float) -> None:
        super()._put(item, encoded, seconds)
        if self.group is not None:
            self.group.add(encoded, seconds, self.encoder.decided())

    def _encode_side_by_side(self) -> None:
        """Encode groups of pictures in tasks for an executor."""

        def decided(coder: GroupCoder) -> None:
            self.encoder = coder

        def encoded(frames: int, groups: int, psnr: float) -> None:
            self.kept = side.kept
            self._show_progress("groups", frames - 1, groups, self.jobs, psnr)

        run_s: float | None = getattr(self.executor, "run_s", None)  # a cluster says how long tasks are best
        side = SideBySide(
            self.encoder, self.jobs, self.executor, decided, self._put, encoded, self.keeper,
            run_s=run_s, longest_first=run_s is not None,
        )  # fmt: skip
        try:
            with side:
                try:
                    for item in self._timed_frames():
                        side.put(item)
                    side.finish()
                except BaseException:
                    self.interrupts.held = True  # processes are being ended
                    raise
        finally:
            self.target_failed |= not side.is_over

    def _settings_used(self) -> Settings:
        return self.encoder.settings.with_(threads=self.asked.threads)

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

    def _frames(self) -> Iterator[Frame]:
        return self.times.frames()

    def _times_before(self, number: int) -> bytes | None:
        return self.times.before(number)

    def _typed(self, frames: Iterator[Frame]) -> Iterator[TypedFrame[Frame]]:
        typed = typed_frames(
            frames, self.settings, self.format.peak, lambda number: self._show_progress("detect", number)
        )
        if self.settings.paced:
            rate = self.format.frame_rate
            typed = with_i_frames(typed, I_FRAME_SECONDS * -(-rate.numerator // rate.denominator))
        return typed

    def _no_frames(self) -> GsvcError:
        return no_frames(self.settings)

    def _notes(self) -> list[str]:
        kept = [] if self.keeper is None else self.keeper.notes
        return [*self.reader.notes, *kept, *self._missed_quality()]

    def _missed_quality(self) -> list[str]:
        """A sentence if frames have less than the quality asked for."""
        if self.settings.layers:
            return self._missed_layers()
        goal = self.settings.psnr
        if goal is None:
            return []
        missed = [frame for frame in self.reports if frame.psnr < goal]
        if not missed:
            return []
        worst = min(missed, key=lambda frame: frame.psnr)
        most = self.settings.most_splats(self.format.width, self.format.height)
        if self.settings.profile == "main":
            why = f"allow more splats than {most:,}"
        elif all(frame.splats >= most for frame in missed):
            why = f"the {most:,} splats that a frame may have are all in use, so allow more splats"
        else:
            why = "splats are left, so quantisers or iterations are the limit: allow finer ones, or more"
        return [
            f"{len(missed)} of {len(self.reports)} frames have less than {goal:g} dB (frame {worst.number}, the worst, "
            f"has {worst.psnr:.2f} dB): {why}"
        ]

    def _missed_layers(self) -> list[str]:
        """A sentence for each layer with which frames have less than the quality asked for."""
        notes = []
        for layer, goal in enumerate(self.settings.layers):
            reached = [frame.layers[layer].psnr for frame in self.reports if frame.layers]
            missed = [quality for quality in reached if quality < goal]
            if missed:
                notes.append(
                    f"up to layer {layer} {len(missed)} of {len(reached)} frames have less than {goal:g} dB (the worst "
                    f"has {min(missed):.2f} dB)"
                )
        return notes

    def _decisions(self, item: TypedFrame[Frame], encoded: EncodedFrame) -> tuple[Decision, ...]:
        log = FrameLog((*item.decisions, *encoded.decisions))
        log.measured("frames", encoded.iterations, sum(encoded.seconds.values()))
        return log.completed(self.settings.effects, encoded.codes.type)
