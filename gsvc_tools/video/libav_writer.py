"""Copies to look at in any player (.mp4, .mkv, .mov, .webm), written through PyAV (extra ``video``); they are lossy."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.constants import LUMA_WEIGHTS
from gsvc_base.errors import UsageError, naming
from gsvc_base.files import PartialFile
from gsvc_ref.video.color import to_planes
from gsvc_ref.video.format import ChromaFormat, VideoFormat, assumed_matrix
from gsvc_ref.video.stream import NO_EXTRAS, Extras, VideoWriter
from gsvc_tools.video.libav import import_av
from gsvc_tools.video.libav_audio import Sound
from gsvc_tools.video.suffixes import CONTAINERS

ENCODERS: Final = {
    "libx264": {"crf": "12", "preset": "medium"},
    "libvpx-vp9": {"crf": "15", "b": "0", "deadline": "good", "cpu-used": "4", "row-mt": "1"},
    "mpeg4": {"q": "2"},
}
"""Options for a quality at which coding artefacts are hard to see; in order of preference."""


FINEST_UNIT: Final = 1_000_000
"""Maximum number of ticks of a second: containers count time in numbers of 32 bits."""


def viewing_format(video: VideoFormat, bit_depth: int = 8) -> VideoFormat:
    """The format that players show: 8 or 10 bits, limited range, left siting, 4:2:0, or 4:4:4 where a side is odd."""
    matrix = video.color.matrix if video.color.matrix in LUMA_WEIGHTS else assumed_matrix(video.height)
    color = replace(video.color, matrix=matrix, full_range=False, chroma_location=0)
    chroma: ChromaFormat = "444" if video.width % 2 or video.height % 2 else "420"
    return replace(video, bit_depth=bit_depth, chroma_format=chroma, color=color)


class LibavWriter(VideoWriter):
    """A writer of H.264 (VP9 for .webm) for viewing, in 8 bits, or in 10 where frames have more and the encoder can.

    `viewing_format` says what becomes of the format. A UsageError says that PyAV is missing or has no encoder for this
    size, that the sound cannot be copied, or, on `close`, that there is no frame.
    """

    carries_times = True

    def __init__(self, target: Path, video: VideoFormat, extras: Extras = NO_EXTRAS) -> None:
        super().__init__(video, extras)
        self._av = import_av()
        self._target = target
        self._sound: Sound | None = None
        self._durations: dict[int, int] = {}
        self._partial = PartialFile(target)
        container = CONTAINERS[target.suffix.lower()]
        self._encoder = self._find_encoder(container)
        self._viewing = viewing_format(video, self._find_depth())
        self.written_depth = self._viewing.bit_depth
        try:
            with self._explained_errors():
                self._container = self._av.open(str(self._partial.path), "w", format=container)
                self._stream = self._add_stream()
                if extras.audio_from is not None:
                    self._sound = Sound(self._av, extras.audio_from, self.start_time)
                    self._sound.add_to(self._container, target.name)
                self._start()
        except BaseException:
            self.abort()
            raise
        kind = f"{self.written_depth} bits, {self._encoder}"
        self.notes.append(f"{target.name} is a lossy copy for viewing ({kind}); y4m and PNG hold the frames exactly")
        if self._sound is not None:
            tracks = ", ".join(self._sound.codecs)
            self.notes.append(f"{target.name} has the sound of {extras.audio_from}, not encoded again ({tracks})")
        if container == "webm" and video.sample_aspect_ratio != 1:
            self.notes.append(f"{target.name} does not carry the pixel shape {video.sample_aspect_ratio}")

    @contextmanager
    def _explained_errors(self) -> Iterator[None]:
        """Pass on errors of the system, such as a full disk; the rest means that the encoder refuses the format."""
        try:
            with naming(str(self._target)):
                yield
        except OSError:
            raise
        except self._av.FFmpegError as error:
            raise UsageError(
                f"the encoder for {self._target.name} does not take {self.format.width}x{self.format.height} at "
                f"{self.format.frame_rate} frames per second ({error.strerror}); write y4m (.y4m) or PNG files"
            ) from error

    def _start(self) -> None:
        """Write what precedes the first packet; here a container looks at its tracks."""
        try:
            self._container.start_encoding()
        except self._av.FFmpegError as error:
            if self._sound is None or isinstance(error, OSError):
                raise
            raise self._sound.refusal(self._target.name) from error

    def _find_encoder(self, container: str) -> str:
        candidates = ["libvpx-vp9"] if container == "webm" else ["libx264", "mpeg4"]
        return next((name for name in candidates if name in self._av.codecs_available), candidates[-1])

    def _find_depth(self) -> int:
        """10 bits where frames have more than 8 and the encoder takes them."""
        wanted = _pixel_format(viewing_format(self.format, 10))
        known = self._av.Codec(self._encoder, "w").video_formats or ()
        return 10 if self.format.bit_depth > 8 and any(one.name == wanted for one in known) else 8

    def _add_stream(self) -> Any:
        video, encoder = self._viewing, self._encoder
        options = dict(ENCODERS[encoder])
        if encoder == "libx264" and self.times is not None:
            options["bf"] = (
                "0"  # MP4 says how long the packet that is stored last is shown: it must be the last picture
            )
        stream = self._container.add_stream(encoder, rate=video.frame_rate, options=options)
        stream.width, stream.height = video.width, video.height
        stream.pix_fmt = _pixel_format(video)
        codec = stream.codec_context
        ticks = None if self.times is None else self.times.ticks_per_second
        self._unit = 1 / video.frame_rate if ticks is None else Fraction(1, min(ticks, FINEST_UNIT))
        codec.time_base = stream.time_base = self._unit
        codec.sample_aspect_ratio = video.sample_aspect_ratio
        codec.color_primaries, codec.color_trc = video.color.primaries, video.color.transfer
        codec.colorspace, codec.color_range = video.color.matrix, 1
        return stream

    def _write(self, frame: Frame) -> None:
        video = self._viewing
        scaled = np.rint(frame * (video.peak / self.format.peak)).astype(video.dtype)
        picture = self._av.VideoFrame(video.width, video.height, self._stream.pix_fmt)
        time, end = self.span()
        picture.pts, picture.time_base = round(time / self._unit), self._unit
        self._durations[picture.pts] = max(1, round(end / self._unit) - picture.pts)
        picture.colorspace, picture.color_range = video.color.matrix, 1
        for plane, samples in zip(picture.planes, to_planes(scaled, video), strict=True):
            lines = np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size).view(video.dtype)
            lines[: samples.shape[0], : samples.shape[1]] = samples
        with self._explained_errors():
            self._mux(self._stream.encode(picture))
            if self._sound is not None:
                self._container.mux(self._sound.before(end))

    def _mux(self, packets: Iterable[Any]) -> None:
        """Write packets of pictures, each with the time for which its picture is shown."""
        for packet in packets:
            packet.duration = self._durations.pop(packet.pts, packet.duration)
            self._container.mux(packet)

    def _finish(self) -> None:
        if not self.frames_written:
            raise UsageError(f"there is no frame to write as {self._target}")
        with self._explained_errors():
            self._mux(self._stream.encode(None))
            self._container.close()
        self._close_sound()
        self._partial.commit()

    def _discard(self) -> None:
        container = getattr(self, "_container", None)
        if container is not None:
            with suppress(self._av.FFmpegError, OSError):  # closing writes a trailer, which fails on a full disk
                container.close()
        self._close_sound()
        self._partial.discard()

    def _close_sound(self) -> None:
        if self._sound is not None:
            self._sound.close()


def _pixel_format(video: VideoFormat) -> str:
    """FFmpeg's name of planes in memory."""
    return f"yuv{video.chroma_format}p" + ("10le" if video.bit_depth == 10 else "")
