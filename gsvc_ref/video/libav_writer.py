"""Copies to look at in any player (.mp4, .mkv, .mov, .webm), written through PyAV (extra ``video``); they are lossy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from gsvc_ref.arrays import Frame
from gsvc_ref.errors import UsageError, naming
from gsvc_ref.files import PartialFile
from gsvc_ref.video.color import LUMA_WEIGHTS, to_planes
from gsvc_ref.video.format import ChromaFormat, VideoFormat, assumed_matrix
from gsvc_ref.video.libav import import_av
from gsvc_ref.video.stream import VideoWriter

CONTAINERS: Final = {".mp4": "mp4", ".mkv": "matroska", ".mov": "mov", ".webm": "webm"}
ENCODERS: Final = {
    "libx264": {"crf": "12", "preset": "medium"},
    "libvpx-vp9": {"crf": "15", "b": "0", "deadline": "good", "cpu-used": "4", "row-mt": "1"},
    "mpeg4": {"q": "2"},
}
"""Options for a quality at which coding artefacts are hard to see; in order of preference."""


def viewing_format(video: VideoFormat) -> VideoFormat:
    """The format that players show: 8 bits, limited range, left siting, 4:2:0, or 4:4:4 where a side is odd."""
    matrix = video.color.matrix if video.color.matrix in LUMA_WEIGHTS else assumed_matrix(video.height)
    color = replace(video.color, matrix=matrix, full_range=False, chroma_location=0)
    chroma: ChromaFormat = "444" if video.width % 2 or video.height % 2 else "420"
    return replace(video, bit_depth=8, chroma_format=chroma, color=color)


class LibavWriter(VideoWriter):
    """A writer of H.264 (VP9 for .webm) in 8 bits for viewing.

    Parameters
    ----------
    target
        A path whose suffix is one of CONTAINERS; written under a temporary name until `close`.
    video
        The format of the frames; see `viewing_format` for what becomes of it.

    Raises
    ------
    UsageError
        PyAV is not installed, or has no encoder for this size; on `close`, no frame was written.
    FileNotFoundError
        The folder of the target does not exist.
    """

    def __init__(self, target: Path, video: VideoFormat) -> None:
        super().__init__(video)
        self._av = import_av()
        self._viewing = viewing_format(video)
        self._target = target
        self._partial = PartialFile(target)
        container = CONTAINERS[target.suffix.lower()]
        try:
            with self._explained_errors():
                self._container = self._av.open(str(self._partial.path), "w", format=container)
                self._stream = self._add_stream(container)
                self._container.start_encoding()
        except BaseException:
            self.abort()
            raise
        self.notes.append(f"{target.name} is a lossy copy for viewing; y4m and PNG hold the decoded frames exactly")
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

    def _add_stream(self, container: str) -> Any:
        video = self._viewing
        candidates = ["libvpx-vp9"] if container == "webm" else ["libx264", "mpeg4"]
        encoder = next((name for name in candidates if name in self._av.codecs_available), candidates[-1])
        stream = self._container.add_stream(encoder, rate=video.frame_rate, options=dict(ENCODERS[encoder]))
        stream.width, stream.height = video.width, video.height
        stream.pix_fmt = f"yuv{video.chroma_format}p"
        codec = stream.codec_context
        codec.sample_aspect_ratio = video.sample_aspect_ratio
        codec.color_primaries, codec.color_trc = video.color.primaries, video.color.transfer
        codec.colorspace, codec.color_range = video.color.matrix, 1
        return stream

    def _write(self, frame: Frame) -> None:
        video = self._viewing
        scaled = np.rint(frame * (255 / self.format.peak)).astype(np.uint8)
        picture = self._av.VideoFrame(video.width, video.height, self._stream.pix_fmt)
        picture.pts, picture.time_base = self.frames_written, 1 / video.frame_rate
        picture.colorspace, picture.color_range = video.color.matrix, 1
        for plane, samples in zip(picture.planes, to_planes(scaled, video), strict=True):
            lines = np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size)
            lines[: samples.shape[0], : samples.shape[1]] = samples
        with self._explained_errors():
            self._container.mux(self._stream.encode(picture))

    def _finish(self) -> None:
        if not self.frames_written:
            raise UsageError(f"there is no frame to write as {self._target}")
        with self._explained_errors():
            self._container.mux(self._stream.encode(None))
            self._container.close()
        self._partial.commit()

    def _discard(self) -> None:
        container = getattr(self, "_container", None)
        if container is not None:
            with suppress(self._av.FFmpegError, OSError):  # closing writes a trailer, which fails on a full disk
                container.close()
        self._partial.discard()
