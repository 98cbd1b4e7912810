"""Clips as raw 8-bit 4:2:0 planes in a file: what every coder gets, GSVC as R'G'B' made from the same planes."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import Frame
from gsvc_base.errors import UsageError
from gsvc_lab.bench import ffmpeg
from gsvc_lab.clips import as_frame, as_picture
from gsvc_ref.video import VideoFormat, VideoReader, open_video, to_planes, to_rgb
from gsvc_ref.video.alpha import Background
from gsvc_ref.video.color import Plane
from gsvc_ref.video.format import MAX_DIMENSION
from gsvc_ref.video.y4m_header import planar_format

NO_CROP: Final = (MAX_DIMENSION, MAX_DIMENSION)

RAW: Final = ("-fps_mode", "passthrough", "-pix_fmt", "yuv420p", "-f", "rawvideo")
"""Ffmpeg's options for a file of raw planes."""


@dataclass(frozen=True)
class PlanarClip:
    """The frames of a clip."""

    title: str  # title for tables and figures
    note: str  # origin of the planes, and what was done to them
    path: Path  # raw planes, frame after frame
    format: VideoFormat  # 8-bit 4:2:0, its frame count known

    @property
    def frame_count(self) -> int:
        """Number of frames."""
        assert self.format.frame_count is not None
        return self.format.frame_count

    @property
    def pixels(self) -> int:
        """Luma samples of all frames."""
        return self.format.width * self.format.height * self.frame_count

    @property
    def frame_bytes(self) -> int:
        """Bytes of a frame's planes."""
        return sum(rows * columns for rows, columns in self.format.plane_shapes)

    def as_input(self) -> list[str]:
        """The arguments by which ffmpeg reads the clip."""
        video = self.format
        return [
            "-f", "rawvideo", "-pixel_format", "yuv420p", "-video_size", f"{video.width}x{video.height}",
            "-framerate", str(video.frame_rate), "-i", ffmpeg.file_url(self.path),
        ]  # fmt: skip

    def split(self, samples: NDArray[np.uint8]) -> tuple[Plane, Plane, Plane]:
        """The planes of a frame out of its (frame_bytes,) u1 samples."""
        luma, cb, cr = self.format.plane_shapes
        first, second = luma[0] * luma[1], luma[0] * luma[1] + cb[0] * cb[1]
        parts = samples[:first].reshape(luma), samples[first:second].reshape(cb), samples[second:].reshape(cr)
        return parts[0], parts[1], parts[2]

    def planes(self) -> Iterator[tuple[Plane, Plane, Plane]]:
        """The planes of each frame, read when asked for."""
        data = np.memmap(self.path, np.uint8, "r", shape=(self.frame_count, self.frame_bytes))
        for frame in data:
            yield self.split(np.asarray(frame))

    def frames(self) -> Iterator[Frame]:
        """The frames as R'G'B', (H, W, 3) u1."""
        for planes in self.planes():
            yield to_rgb(planes, self.format)


def from_file(path: Path, target: Path, frames: int, crop: tuple[int, int] | None = None, start: int = 0) -> PlanarClip:
    """Frames of a video file, as its own planes where it is 8-bit 4:2:0 of limited range, and no picture is turned.

    `path`: anything `open_video` reads. `target`: file for the raw planes. `frames`: the most frames. `crop`: the
    largest (width, height) that is taken, out of the middle; None: all of the picture. `start`: the first of them. A
    UsageError or GsvcError says that the file cannot be read. An FfmpegError says that ffmpeg cannot read it.
    """
    with open_video(path) as reader:
        video = reader.format
        plain = (video.chroma_format, video.bit_depth, video.color.full_range) == ("420", 8, False)
        if reader.is_turned or not (plain and path.is_file() and ffmpeg.available()):
            return from_reader(reader, _titled(path, start), target, frames, crop, start)
    part = _part(video, crop, path.name)
    ffmpeg.run(
        [
            "-noautorotate", "-protocol_whitelist", "file", "-i", ffmpeg.file_url(path), "-map", "0:v:0",
            *part.filter(start, frames), *RAW, ffmpeg.file_url(target),
        ]
    )  # fmt: skip
    note = f"the file's own planes{part.note}{_beginning(start)}"
    return _counted(_titled(path, start), note, target, part.format(video))


def from_any(
    source: str,
    target: Path,
    frames: int,
    crop: tuple[int, int] | None = None,
    start: int = 0,
    background: Background | None = None,
) -> PlanarClip:
    """Frames of a file, as `from_file`; of a scene or a folder, or on a background, as `open_video` reads them."""
    if background is None and Path(source).is_file():
        return from_file(Path(source), target, frames, crop, start)
    with open_video(source, background=background) as reader:
        return from_reader(reader, _titled(Path(source), start), target, frames, crop, start)


def from_raw(
    path: Path, target: Path, frames: int, video: VideoFormat, crop: tuple[int, int] | None = None
) -> PlanarClip:
    """The first frames of a file of raw planes, such as UVG's; what is no whole frame at its end is left out.

    An FfmpegError says that ffmpeg cannot read it.
    """
    part = _part(video, crop, path.name)
    whole = PlanarClip(path.stem, "", path, video)
    ffmpeg.run([*whole.as_input(), *part.filter(0, frames), *RAW, ffmpeg.file_url(target)])
    return _counted(path.stem, f"the file's own planes{part.note}", target, part.format(video))


def from_reader(
    reader: VideoReader, title: str, target: Path, frames: int, crop: tuple[int, int] | None = None, start: int = 0
) -> PlanarClip:
    """Frames of any reader, turned into 8-bit 4:2:0 of limited range; the reader stays open."""
    part = _part(reader.format, crop, title)
    color = planar_format(replace(reader.format, chroma_format="rgb")).color
    video = replace(part.format(reader.format), chroma_format="420", bit_depth=8, color=color)
    peak = reader.format.peak
    pictures = (as_frame(as_picture(part.of(frame), peak)) for frame in islice(iter(reader), start, start + frames))
    note = f"R′G′B′ turned into 4:2:0{part.note}{_beginning(start)}"
    return from_frames(pictures, title, note, target, video)


def from_frames(frames: Iterable[Frame], title: str, note: str, target: Path, video: VideoFormat) -> PlanarClip:
    """Frames, (H, W, 3) u1, as planes of a format."""
    with target.open("wb") as file:
        for frame in frames:
            for plane in to_planes(np.ascontiguousarray(frame), video):
                file.write(plane.tobytes())
    return _counted(title, note, target, video)


@dataclass(frozen=True)
class _Part:
    """A part of a picture."""

    left: int
    top: int
    width: int
    height: int
    note: str

    def of(self, frame: Frame) -> Frame:
        return frame[self.top : self.top + self.height, self.left : self.left + self.width]

    def filter(self, start: int, frames: int) -> list[str]:
        """Ffmpeg's filter that takes this part of some frames."""
        trim = f"trim=start_frame={start}:end_frame={start + frames}"
        return ["-vf", f"{trim},crop={self.width}:{self.height}:{self.left}:{self.top}:exact=1"]

    def format(self, video: VideoFormat) -> VideoFormat:
        return replace(video, width=self.width, height=self.height)


def _part(video: VideoFormat, crop: tuple[int, int] | None, name: str) -> _Part:
    """The middle of a picture, of even size at even places, so that chroma samples stay what they are."""
    width, height = (
        min(side, most) // 2 * 2 for side, most in zip((video.width, video.height), crop or NO_CROP, strict=True)
    )
    if not width or not height:
        raise UsageError(f"{name} is {video.width}x{video.height}; codecs for 4:2:0 want at least 2x2 pixels")
    left, top = (video.width - width) // 4 * 2, (video.height - height) // 4 * 2
    note = "" if (width, height) == (video.width, video.height) else f", {width}x{height} out of the middle"
    return _Part(left, top, width, height, note)


def _titled(path: Path, start: int) -> str:
    return f"{path.name} from frame {start}" if start else path.name


def _beginning(start: int) -> str:
    return f", from frame {start} on" if start else ""


def _counted(title: str, note: str, path: Path, video: VideoFormat) -> PlanarClip:
    """The clip, its frames counted by the size of its file."""
    clip = PlanarClip(title, note, path, video)
    count, rest = divmod(path.stat().st_size, clip.frame_bytes)
    if rest or not count:
        raise UsageError(f"{title} gives no whole frame of {video.width}x{video.height}; give another clip")
    return replace(clip, format=replace(video, frame_count=count))
