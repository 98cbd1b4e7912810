"""Animated WebP, which FFmpeg does not read: pictures through Pillow, their delays from the file itself."""

import io
from collections.abc import Iterator
from contextlib import ExitStack, nullcontext
from fractions import Fraction
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.video.alpha import Background, check_alpha, flattened, flattening_note
from gsvc_ref.video.format import UNSPECIFIED, ColorDescription, VideoFormat, check_size
from gsvc_ref.video.images import MAX_FILE
from gsvc_ref.video.stream import VideoReader
from gsvc_tools.video.libav_probe import MAX_RATE_DENOMINATOR, is_even, uneven

MILLISECOND: Final = Fraction(1, 1000)

ANIMATED: Final = 2
"""The flag in the chunk VP8X that says that a file has the chunks ANIM and ANMF."""

MAX_CHUNKS: Final = 1 << 20
"""Maximum number of chunks: a gigabyte of empty ones would take most of a minute."""


def picture_delays(source: Path | BinaryIO) -> list[int] | None:
    """For how many milliseconds each picture of an animated WebP is shown; None of any other file.

    Chunks are read up to the first that is cut off, as far as the file states its size. A file object is left where it
    was. A GsvcError ``limit`` refuses more than MAX_FILE bytes, which would all be held in memory, and more than
    MAX_CHUNKS chunks.
    """
    with ExitStack() as stack:
        file = stack.enter_context(source.open("rb")) if isinstance(source, Path) else source
        start = file.tell()
        stack.callback(lambda: None if isinstance(source, Path) else file.seek(start))
        head = file.read(21)
        if head[:4] != b"RIFF" or head[8:16] != b"WEBPVP8X" or len(head) < 21 or not head[20] & ANIMATED:
            return None
        end = start + 8 + int.from_bytes(head[4:8], "little")
        if end - start > MAX_FILE:
            raise GsvcError(
                "limit", f"an animated WebP has {end - start} bytes; at most {MAX_FILE} are read: shorten it"
            )
        delays: list[int] = []
        position = start + 12
        for _ in range(MAX_CHUNKS):
            if position >= end or len(header := _at(file, position, 24)) < 8:
                return delays
            size = int.from_bytes(header[4:8], "little")
            if header[:4] == b"ANMF" and len(header) == 24:
                delays.append(int.from_bytes(header[20:23], "little"))
            position += 8 + size + size % 2
        raise GsvcError("limit", f"an animated WebP has more than {MAX_CHUNKS} chunks: shorten it")


def _at(file: BinaryIO, position: int, count: int) -> bytes:
    file.seek(position)
    return file.read(count)


class AnimatedWebpReader(VideoReader):
    """A reader of an animated WebP, given the delays of its pictures; repetitions are left out.

    A GsvcError is ``malformed`` (cut off or damaged), ``limit`` (the size) or ``unsupported`` (transparent).
    """

    def __init__(
        self, source: Path | BinaryIO, name: str, delays: list[int], background: Background | None = None
    ) -> None:
        super().__init__()
        from PIL import WebPImagePlugin, features

        if not features.check("webp"):
            raise UsageError(
                f"{name} is a WebP, which this Pillow cannot read; convert it to GIF, or to y4m with ffmpeg"
            )
        self._name, self._background, self._delays = name, background, delays
        try:
            # Image.open warns of large pictures, and warnings belong to the process.
            with source.open("rb") if isinstance(source, Path) else nullcontext(source) as file:
                data = file.read(MAX_FILE)
            self._animation: Any = WebPImagePlugin.WebPImageFile(io.BytesIO(data))
        except (OSError, SyntaxError, ValueError) as error:
            raise self._damaged("the start", error) from error
        check_size(*self._animation.size, name)
        if not delays:
            raise self._damaged("the start", "it has no picture")
        color = ColorDescription(UNSPECIFIED, UNSPECIFIED, 0, full_range=True, chroma_location=0)
        self.format = VideoFormat(*self._animation.size, self._find_rate(), 8, "rgb", color, frame_count=len(delays))

    def _damaged(self, place: str, error: object) -> GsvcError:
        return GsvcError(
            "malformed", f"{self._name} is damaged or cut off after {place} ({error}); give an intact file"
        )

    def _find_rate(self) -> Fraction:
        """The frame rate that all times keep to, or else their mean; then each frame has a time stamp."""
        if not any(self._delays):
            self.note(f"frame rate not stated by {self._name}, so assumed: 25 per second")
            return Fraction(25)
        self._delays = [max(delay, 1) for delay in self._delays]  # times must grow
        begins = np.array([0, *accumulate(self._delays)])
        mean = Fraction(1000 * len(self._delays), int(begins[-1]))
        exact = mean.limit_denominator(MAX_RATE_DENOMINATOR)
        for rate in (Fraction(max(1, round(mean))), exact):
            if is_even(begins, MILLISECOND, rate):
                return rate
        self.time_base = MILLISECOND
        self.note(uneven(self._name, mean))
        return exact

    def _read(self) -> Iterator[Frame]:
        ends = [MILLISECOND * end for end in (0, *accumulate(self._delays))]
        for number, (begin, end) in enumerate(pairwise(ends)):
            try:
                self._animation.seek(number)
                picture = np.asarray(self._animation.convert("RGBA"))
            except (EOFError, OSError, SyntaxError, ValueError) as error:
                raise self._damaged(f"frame {number - 1}" if number else "the start", error) from error
            if self.time_base is not None:
                self.frame_time, self.end_time = begin, end
            yield self._opaque(picture, number)

    def _opaque(self, picture: Frame, number: int) -> Frame:
        frame, alpha = np.ascontiguousarray(picture[..., :3]), picture[..., 3]
        if check_alpha(alpha, 255, self._background, f"frame {number} of {self._name}") or self._background is None:
            return frame
        self.note(flattening_note(self._name, self._background))
        return flattened(frame, alpha, 255, self._background)

    def close(self) -> None:
        """Release the file."""
        super().close()
        self._animation.close()
