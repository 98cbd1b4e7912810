"""Videos made smaller or larger, and at another frame rate, frame by frame.

Frames are resampled by Pillow with Lanczos' kernel of three lobes, which is widened where a picture gets smaller, so
that nothing aliases. Pictures of 8 bits are computed in Pillow's fixed-point numbers, deeper ones in binary32.
"""

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from typing import Final, Protocol

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.video.format import MAX_DIMENSION, MAX_PIXELS, FrameRate, VideoFormat, exact_frame_rate
from gsvc_ref.video.stream import PassingReader, VideoReader

Scale = float | tuple[int, int]
"""A factor, or width and height in pixels."""

MAX_FACTOR: Final = 16.0
"""Maximum factor of a size, and of a frame rate."""

MIN_SCALING: Final = 1 / 256
"""Minimum factor of a size, and of a frame rate."""

LONGEST_REPEAT_S: Final = 3600
"""Seconds for which a frame is repeated at most: times that are damaged may be years apart."""


class _Changed(PassingReader):
    """A reader that changes what another one gives, and closes it."""

    def __init__(self, reader: VideoReader) -> None:
        super().__init__()
        self._reader = reader
        self.format = reader.format
        self.notes = reader.notes

    def close(self) -> None:
        """Release the source."""
        super().close()
        self._reader.close()


class ScaledReader(_Changed):
    """The frames of another reader, which is closed with this one, at another size.

    Pixels keep their shape with a factor; with width and height the whole picture is kept, and the sample aspect ratio
    changes with it.
    """

    def __init__(self, reader: VideoReader, scale: Scale) -> None:
        super().__init__(reader)
        video = reader.format
        width, height = scaled_size(video.width, video.height, scale)
        aspect = video.sample_aspect_ratio
        if isinstance(scale, tuple):
            aspect *= Fraction(video.width * height, width * video.height)
            aspect = Fraction(1) if abs(aspect - 1) < Fraction(1, 100) else aspect.limit_denominator(1000)
        self.format = replace(video, width=width, height=height, sample_aspect_ratio=aspect)
        if (width, height) != (video.width, video.height):
            self.note(f"scaled from {video.width}x{video.height} to {width}x{height} by Lanczos' kernel")

        self.take_times(reader)

    def _read(self) -> Iterator[Frame]:
        for frame in self._reader:
            self.take_times(self._reader)
            yield resampled(frame, self.format.width, self.format.height, self.format.peak)


class FrameRateReader(_Changed):
    """The frames of another reader at another frame rate: at each time the frame that is shown then, none is blended.

    A frame is shown from its own time until that of the next one. Times are those of the reader, where it tells them
    (`frame_time`), else those of its frame rate. At a lower rate frames are left out, and at a higher one repeated.
    """

    def __init__(self, reader: VideoReader, frame_rate: FrameRate) -> None:
        super().__init__(reader)
        rate = exact_frame_rate(frame_rate)
        video = reader.format
        factor = rate / video.frame_rate
        if not MIN_SCALING <= factor <= MAX_FACTOR:
            raise UsageError(
                f"{rate} frames per second are {float(factor):.3g} times the {video.frame_rate} of the source; it must "
                f"be 1/{round(1 / MIN_SCALING)} to {MAX_FACTOR:g} times"
            )
        count = video.frame_count
        if count is not None:
            count = -(-count * rate // video.frame_rate)
        self.format = replace(video, frame_rate=rate, frame_count=None if count is None else int(count))
        if rate != video.frame_rate:
            done = "left out" if rate < video.frame_rate else "repeated"
            self.note(f"from {video.frame_rate} to {rate} frames per second: frames are {done}, and none is blended")

    def _read(self) -> Iterator[Frame]:
        period, shown_count = 1 / self.format.frame_rate, 0
        shown: Frame | None = None
        begin = end = Fraction(0)
        for number, frame in enumerate(self._reader):
            time = self._reader.frame_time
            at = Fraction(number) / self._reader.format.frame_rate if time is None else time
            if shown is None:
                begin = at
            elif at - end > LONGEST_REPEAT_S:
                raise GsvcError(
                    "limit",
                    f"frame {number - 1} would be shown for more than {LONGEST_REPEAT_S} seconds; cut the video",
                )
            while shown is not None and begin + shown_count * period < at:
                yield shown
                shown_count += 1
            end_time = self._reader.end_time
            shown = frame
            end = at + 1 / self._reader.format.frame_rate if end_time is None else min(end_time, at + LONGEST_REPEAT_S)
        while shown is not None and begin + shown_count * period < end:
            yield shown
            shown_count += 1


class VideoOpener(Protocol):
    """What gives a new reader each time."""

    def __call__(self) -> VideoReader:
        """A new reader."""


class Resampled:
    """A source that can be opened again and again, at another size and frame rate: what `gsvc_ref.encode` takes."""

    def __init__(self, opened: VideoOpener, scale: Scale | None = None, frame_rate: FrameRate | None = None) -> None:
        self._opened, self._scale, self._frame_rate = opened, scale, frame_rate

    def open_video(self) -> VideoReader:
        """A new reader; frames that are left out are not resampled."""
        reader = self._opened()
        try:
            if self._frame_rate is not None:
                reader = FrameRateReader(reader, self._frame_rate)
            if self._scale is not None:
                reader = ScaledReader(reader, self._scale)
        except BaseException:
            reader.close()
            raise
        return reader


def resampled_like(opened: VideoOpener, video: VideoFormat) -> Resampled:
    """A source as ``gsvc encode --scale F --fps R`` resampled it for a stream of format `video`.

    A source of another shape is left as it is. So is the frame rate, unless it explains the stream's number of frames.
    """
    with opened() as reader:
        source = reader.format
    wide, high = source.width, source.height
    has_its_shape = 2 * abs(video.width * high - video.height * wide) <= wide + high
    is_other_size = (video.width, video.height) != (wide, high)
    rate = None
    if source.frame_count is not None and video.frame_count not in (None, source.frame_count):
        count = -(-source.frame_count * video.frame_rate // source.frame_rate)
        rate = video.frame_rate if count == video.frame_count else None
    return Resampled(opened, (video.width, video.height) if has_its_shape and is_other_size else None, rate)


def scaled_size(width: int, height: int, scale: Scale) -> tuple[int, int]:
    """Width and height by a factor, rounded to the nearest whole numbers and at least 1, or as they are given."""
    if isinstance(scale, tuple):
        wide, high = scale
    else:
        if not MIN_SCALING <= scale <= MAX_FACTOR:
            raise UsageError(
                f"the scale is {scale:g}; it must be 1/{round(1 / MIN_SCALING)} to {MAX_FACTOR:g}, or WIDTHxHEIGHT"
            )
        wide, high = max(1, round(width * scale)), max(1, round(height * scale))
    if not (1 <= wide <= MAX_DIMENSION and 1 <= high <= MAX_DIMENSION and wide * high <= MAX_PIXELS):
        raise UsageError(
            f"the scaled size is {wide}x{high}; sides must be 1 to {MAX_DIMENSION}, with at most {MAX_PIXELS} pixels"
        )
    return wide, high


def resampled(frame: Frame, width: int, height: int, peak: int) -> Frame:
    """A frame (H, W, 3) u1 or u2 at another size, of the same type, with samples of 0..peak."""
    from PIL import Image

    if frame.shape[:2] == (height, width):
        return frame
    if frame.dtype == np.uint8:
        picture = Image.fromarray(np.ascontiguousarray(frame))
        return np.asarray(picture.resize((width, height), Image.Resampling.LANCZOS))
    channels = []
    for channel in range(3):
        plane = Image.fromarray(np.ascontiguousarray(frame[..., channel], np.float32))
        channels.append(np.asarray(plane.resize((width, height), Image.Resampling.LANCZOS)))
    return np.asarray(np.clip(np.rint(np.stack(channels, axis=-1)), 0, peak), frame.dtype)
