"""Pictures as video: a folder of PNG or JPEG files in natural order, or a single file as a video of one frame."""

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
from PIL.Image import Transpose
from PIL.JpegImagePlugin import JpegImageFile

from gsvc_base.arrays import Frame
from gsvc_base.errors import GsvcError, UsageError, naming
from gsvc_base.files import PartialFile, check_parent, remove_leftovers
from gsvc_ref.video.alpha import Background
from gsvc_ref.video.format import UNSPECIFIED, ColorDescription, VideoFormat, check_size
from gsvc_ref.video.png import PNG_SIGNATURE, PngImage, decode_png, encode_png
from gsvc_ref.video.stream import VideoReader, VideoWriter

JPEG_SIGNATURE: Final = b"\xff\xd8\xff"
SUFFIXES: Final = (".png", ".jpg", ".jpeg")
MAX_FILE: Final = 1 << 30
"""Maximum number of bytes of a picture's file, which is read at once."""
GAPS_NAMED: Final = 4
"""Gaps in the numbers of pictures that a note names."""
ASSUMED_RATE: Final = Fraction(25)
"""Frames per second of pictures, which state none."""
EXIF_ORIENTATION: Final = 0x0112
EXIF_TURNS: Final = {
    2: Transpose.FLIP_LEFT_RIGHT,
    3: Transpose.ROTATE_180,
    4: Transpose.FLIP_TOP_BOTTOM,
    5: Transpose.TRANSPOSE,
    6: Transpose.ROTATE_270,  # counterclockwise, so a quarter clockwise
    7: Transpose.TRANSVERSE,
    8: Transpose.ROTATE_90,
}
"""What makes a picture upright, by its EXIF orientation."""


def natural_key(name: str) -> tuple[tuple[int, str], ...]:
    """Sort key under which ``frame10`` follows ``frame9``."""
    parts = ((int(part), "") if part.isdecimal() else (0, part) for part in re.split(r"(\d+)", name))
    return (*parts, (0, name))


def list_images(folder: Path) -> list[Path]:
    """The PNG and JPEG files of a folder in natural order, hidden ones left out."""
    files = (path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES and path.name[0] != ".")
    return sorted((path for path in files if path.is_file()), key=lambda path: natural_key(path.name))


def decode_image(data: bytes, name: str, background: Background | None = None) -> PngImage:
    """Decode a PNG or JPEG file by its content, what is transparent in it on a background.

    A GsvcError is ``malformed``, ``limit``, or ``unsupported`` (neither format, transparency, CMYK).
    """
    if data.startswith(PNG_SIGNATURE):
        return decode_png(data, name, background)
    if not data.startswith(JPEG_SIGNATURE):
        raise GsvcError("unsupported", f"{name} is neither a PNG nor a JPEG picture; convert it to PNG")
    try:
        picture = JpegImageFile(io.BytesIO(data))  # Image.open warns of large ones, and warnings belong to the process
        check_size(picture.width, picture.height, name)
        if picture.mode not in ("L", "RGB"):
            raise GsvcError("unsupported", f"{name} is a JPEG in {picture.mode}; convert it to RGB first")
        orientation = picture.getexif().get(EXIF_ORIENTATION, 1)
        turn = EXIF_TURNS.get(orientation)
        upright = picture if turn is None else picture.transpose(turn)
        frame = np.array(upright.convert("RGB"))  # (H, W, 3) u1
    except (OSError, SyntaxError, ValueError, Warning) as error:  # the process may turn warnings into errors
        raise GsvcError("malformed", f"{name} is not a valid JPEG ({error}); export the picture again") from error
    notes = ["a JPEG is turned as its EXIF orientation says"] if turn is not None else []
    return PngImage(frame, 8, ColorDescription(UNSPECIFIED, UNSPECIFIED, 0, True, 0), notes)


def read_image(path: Path, name: str, background: Background | None = None) -> PngImage:
    """Decode a PNG or JPEG file, which is called `name`; what is no file, or larger than MAX_FILE, is not read."""
    if not path.is_file():
        raise UsageError(f"{name} is not a regular file; give a PNG or JPEG picture")
    if (size := path.stat().st_size) > MAX_FILE:
        raise GsvcError("limit", f"{name} has {size} bytes; a picture takes at most {MAX_FILE}: export it again")
    return decode_image(path.read_bytes(), name, background)


class ImageReader(VideoReader):
    """A reader of pictures as the frames of a video: files in order, or the contents of one; at least one.

    A picture of another size or depth than the first is a GsvcError ``invalid`` when iterating.
    """

    def __init__(self, sources: Sequence[Path | bytes], name: str, background: Background | None = None) -> None:
        super().__init__()
        self._sources, self._background = sources, background
        self._name = name
        first = self._load(0)
        height, width, _ = first.frame.shape
        count = len(sources)
        self.format = VideoFormat(width, height, ASSUMED_RATE, first.bit_depth, "rgb", first.color, frame_count=count)
        if count > 1:
            self.note(f"pictures state no frame rate, so assumed: {ASSUMED_RATE} per second")

    def _label(self, index: int) -> str:
        source = self._sources[index]
        return str(source) if isinstance(source, Path) else self._name

    def _load(self, index: int) -> PngImage:
        source = self._sources[index]
        name, background = self._label(index), self._background
        if isinstance(source, Path):
            image = read_image(source, name, background)
        else:
            image = decode_image(source, name, background)
        for sentence in image.notes:
            self.note(sentence)
        return image

    def _read(self) -> Iterator[Frame]:
        for index in range(len(self._sources)):
            image = self._load(index)
            height, width, _ = image.frame.shape
            expected = (self.format.width, self.format.height, self.format.bit_depth)
            if (width, height, image.bit_depth) != expected:
                raise GsvcError(
                    "invalid",
                    f"the pictures differ: {self._label(0)} is {expected[0]}x{expected[1]} with {expected[2]} bits, "
                    f"{self._label(index)} is {width}x{height} with {image.bit_depth}; all frames of a video must have "
                    f"the same size and depth: scale them, or move the odd ones out of the folder",
                )
            yield image.frame


def open_folder(folder: Path, background: Background | None = None) -> ImageReader:
    """Read a folder of pictures; a GsvcError ``invalid`` says that it holds none."""
    paths = list_images(folder)
    if not paths:
        raise GsvcError("invalid", f"the folder {folder} holds no {', '.join(SUFFIXES)} files; give one that does")
    reader = ImageReader(paths, str(folder), background)
    if left_out := missing_numbers([path.stem for path in paths]):
        runs = ", ".join([*left_out[:GAPS_NAMED], *(["..."] if len(left_out) > GAPS_NAMED else [])])
        reader.note(f"the numbers in {folder} have gaps ({runs}); frames are counted without them")
    return reader


def missing_numbers(names: Sequence[str]) -> list[str]:
    """Numbers left out between those at the end of names that are equal otherwise, in runs: ``2-5``, ``9``."""
    parts = [re.fullmatch(r"(.*?)(\d+)", name) for name in names]
    if None in parts or len({part[1] for part in parts if part}) > 1:
        return []
    numbers = [int(part[2]) for part in parts if part]
    runs = [(a + 1, b - 1) for a, b in pairwise(numbers) if b - a > 1]
    return [str(first) if first == last else f"{first}-{last}" for first, last in runs]


def _write_png(target: Path, frame: Frame, video: VideoFormat) -> None:
    partial = PartialFile(target)
    try:
        with naming(str(target)):
            partial.path.write_bytes(encode_png(frame, video.bit_depth, video.color))
        partial.commit()
    except BaseException:
        partial.discard()
        raise


class ImageFolderWriter(VideoWriter):
    """A writer of ``frame_000000.png`` and so on into a folder, each file complete before it has its name.

    The folder is created if it is missing. A folder with pictures is refused, which would mix with the new ones.
    """

    def __init__(self, folder: Path, video: VideoFormat) -> None:
        super().__init__(video)
        check_parent(folder)
        self._created = not folder.exists()
        if self._created:
            folder.mkdir()
        elif list_images(folder):
            raise UsageError(f"the folder {folder} holds pictures already; give a new or empty folder, or remove them")
        else:
            remove_leftovers(folder, "frame_*.png")
        self._folder = folder
        self._written: list[Path] = []

    def _write(self, frame: Frame) -> None:
        path = self._folder / f"frame_{self.frames_written + self.frames_skipped:06d}.png"
        self._written.append(path)  # before it is, so that an interrupt leaves none behind
        _write_png(path, frame, self.format)

    def _finish(self) -> None:
        """Every file is in place already."""

    def _discard(self) -> None:
        for path in self._written:
            path.unlink(missing_ok=True)
        if self._created:
            with suppress(OSError):  # somebody else's file in it keeps the folder
                self._folder.rmdir()


class ImageFileWriter(VideoWriter):
    """A writer of a video of one frame as one PNG file; no frame, or a second one, raises a UsageError."""

    def __init__(self, target: Path, video: VideoFormat) -> None:
        super().__init__(video)
        check_parent(target)
        self._target = target
        self._frame: Frame | None = None

    def _write(self, frame: Frame) -> None:
        if self._frame is not None:
            raise UsageError(f"{self._target} holds one frame; give a folder as the target to write more")
        self._frame = frame.copy()

    def _finish(self) -> None:
        if self._frame is None:
            raise UsageError(f"there is no frame to write as {self._target}")
        _write_png(self._target, self._frame, self.format)

    def _discard(self) -> None:
        self._frame = None
