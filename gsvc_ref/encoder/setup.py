"""The setup of an encode of a video: its coder, the level of its stream, its frames with their types and times."""

from collections.abc import Callable, Iterator

from gsvc_base.arrays import Frame
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.bitstream import LEVELS, level_for
from gsvc_ref.bitstream.header import I_FRAME_SECONDS, Quality
from gsvc_ref.encoder.frame_types import TypedFrame, typed_frames, with_i_frames
from gsvc_ref.encoder.loop import GroupCoder
from gsvc_ref.encoder.main.frame import MainFrameEncoder
from gsvc_ref.encoder.main.layers import LayeredFrameEncoder
from gsvc_ref.encoder.paper import FrameEncoder
from gsvc_ref.encoder.recording import Recording, StreamPlan, header_of
from gsvc_ref.encoder.report import FrameReport, OnProgress, ProgressReporter
from gsvc_ref.encoder.settings import MainSettings, PaperSettings, Settings
from gsvc_ref.encoder.source_and_target import SoundFrames
from gsvc_ref.encoder.times import SourceTimes
from gsvc_ref.stream.pace import second_limits
from gsvc_ref.video import VideoFormat, VideoReader

CoderMaker = Callable[[Settings, VideoFormat], GroupCoder]
"""What makes the coder of a video."""


def coder_of(settings: Settings, video: VideoFormat) -> GroupCoder:
    """What encodes the frames of a source."""
    form = video.width, video.height, video.bit_depth
    if isinstance(settings, PaperSettings):
        return FrameEncoder(settings, *form)
    assert isinstance(settings, MainSettings)
    return LayeredFrameEncoder(settings, *form) if settings.layer_count > 1 else MainFrameEncoder(settings, *form)


class EncodeSetup:
    """The parts of an encode of a video: coder, plan of the stream, progress, and source."""

    def __init__(
        self,
        reader: VideoReader,
        settings: Settings,
        on_progress: OnProgress | None,
        *,
        live: bool = False,  # write frame by frame, and never go back
        make_coder: CoderMaker = coder_of,
    ) -> None:
        self._reader, self._settings = reader, settings
        video = reader.format
        times = SourceTimes(reader, *settings.frames, least_delay=live or settings.low_latency)
        self.coder = make_coder(settings, video)
        level = first_level(settings, video, self.coder)
        self.plan = StreamPlan(
            self.coder, video, level, least_level=is_level_open(settings), live=live, times_before=times.before,
            qualities=first_qualities(settings, video, self.coder, level), notes=self.notes, threads=settings.threads,
        )  # fmt: skip
        self.progress = ProgressReporter(on_progress, frame_count_of(settings, video))
        self.source = SoundFrames(times.frames())

    def frames(self) -> Iterator[TypedFrame[Frame]]:
        """The frames of the source with their types."""
        settings, video = self._settings, self._reader.format
        typed = typed_frames(self.source, settings, video.peak, lambda number: self.progress.show("detect", number))
        if settings.paced:
            rate = video.frame_rate
            typed = with_i_frames(typed, I_FRAME_SECONDS * -(-rate.numerator // rate.denominator))
        return self.plan.stages.timed_items("read and detect", typed)

    def check_end(self, recording: Recording) -> None:
        """Raise the fault of the source that ended its frames; a source without frames has one, too."""
        self.source.check()
        if not recording.frames:
            raise no_frames(self._settings)

    def notes(self, frames: list[FrameReport]) -> list[str]:
        """Sentences on what was assumed about the source, and on a quality that frames do not reach."""
        return [*self._reader.notes, *missed_quality(frames, self._settings, self._reader.format)]


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


def is_level_open(settings: Settings) -> bool:
    """Whether only the encoded frames tell their level: by the rendering work of splats of profile `main`."""
    return settings.profile == "main" and not settings.paced


def first_level(settings: Settings, video: VideoFormat, coder: GroupCoder) -> int:
    """The level in the header of a stream that begins; where it is open, the highest that it may become."""
    splats, lane_exponent = (
        settings.counted_splats(video.width, video.height),
        coder.elements().get("max_lane_exponent", 0),
    )
    level = level_for(video.width, video.height, splats=splats, lane_exponent=lane_exponent)
    if settings.paced:
        return paced_level(settings, video, coder, level)
    return min(level + 1, max(LEVELS)) if is_level_open(settings) else level


def first_qualities(settings: Settings, video: VideoFormat, coder: GroupCoder, level: int) -> tuple[Quality, ...]:
    """The operating points in the header of a stream that begins (R-5-9): a level more than the splats of each ask for.

    Nobody knows beforehand how many splats a PSNR takes; then each quality is of the stream's level.
    """
    if not isinstance(settings, MainSettings) or not settings.layer_splats:
        return ()
    levels = []
    for count in settings.layer_splats[:-1]:
        least = first_level(settings.with_splats(count), video, coder) + (not is_level_open(settings))
        levels.append(min(least, level))
    return tuple(map(Quality, (*levels, level)))


def paced_level(settings: Settings, video: VideoFormat, coder: GroupCoder, least: int) -> int:
    """The lowest level from `least` on that allows a second of frames with the splats that they are meant to have."""
    width, height = video.width, video.height
    size = settings.counted_splats if settings.profile == "main" else settings.most_splats
    splats = 0 if settings.has_quality else size(width, height)  # with a quality nobody knows them beforehand
    for level in range(least, max(LEVELS) + 1):
        header = header_of(coder, video, level)
        frames, allowed = header.frames_of_second, second_limits(level)
        if frames * width * height <= allowed.pixels and frames * splats <= allowed.splats:
            return level
    raise UsageError(
        f"no level allows {frames} frames of {width}x{height} pixels and {splats} splats in a second of a paced "
        "stream (R-5-7); encode at a lower frame rate, smaller, with fewer splats, or without pacing"
    )


def missed_quality(frames: list[FrameReport], settings: Settings, video: VideoFormat) -> list[str]:
    """Sentences on frames that have less than the quality asked for."""
    if isinstance(settings, MainSettings) and settings.layer_goals:
        return _missed_layers(frames, settings)
    goal = settings.psnr
    if goal is None:
        return []
    missed = [frame for frame in frames if frame.psnr < goal]
    if not missed:
        return []
    worst = min(missed, key=lambda frame: frame.psnr)
    most = settings.most_splats(video.width, video.height)
    if settings.profile == "main":
        why = f"allow more splats than {most:,}"
    elif all(frame.splats >= most for frame in missed):
        why = f"the {most:,} splats that a frame may have are all in use, so allow more splats"
    else:
        why = "splats are left, so quantisers or iterations are the limit: allow finer ones, or more"
    return [
        f"{len(missed)} of {len(frames)} frames have less than {goal:g} dB (frame {worst.number}, the worst, "
        f"has {worst.psnr:.2f} dB): {why}"
    ]


def _missed_layers(frames: list[FrameReport], settings: MainSettings) -> list[str]:
    """A sentence for each layer with which frames have less than the quality asked for."""
    notes = []
    for layer, goal in enumerate(settings.layer_goals):
        reached = [frame.layers[layer].psnr for frame in frames if frame.layers]
        missed = [psnr for psnr in reached if psnr < goal]
        if missed:
            notes.append(
                f"up to layer {layer} {len(missed)} of {len(reached)} frames have less than {goal:g} dB (the worst "
                f"has {min(missed):.2f} dB)"
            )
    return notes
