"""Every format that FFmpeg reads, through PyAV (extra ``video``): planes from there, colours converted here."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final

import numpy as np

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.video.alpha import Background, check_alpha, flattened, flattening_note
from gsvc_ref.video.color import to_rgb
from gsvc_ref.video.format import (
    MAX_RATIO_TERM,
    UNSPECIFIED,
    Frame,
    VideoFormat,
    check_size,
    complete_color,
)
from gsvc_ref.video.stream import VideoReader
from gsvc_tools.video.libav_probe import (
    MAX_RATE_DENOMINATOR,
    Orientation,
    has_alpha_track,
    interlaced,
    is_even,
    lost_tracks,
    lost_with_picture,
    open_container,
    orientation,
    read_packets,
    uneven,
)
from gsvc_tools.video.pixel_layout import PixelLayout, plain_layout, plain_name, stand_in, take

if TYPE_CHECKING:
    import av

TEXT_DECODERS: Final = ("ansi", "bintext", "xbin", "idf")
"""FFmpeg draws text files as pictures with these; nobody means that."""

RANGES: Final = {1: False, 2: True}
"""AVColorRange as full_range."""
LIBVPX: Final = {"vp8": "libvpx", "vp9": "libvpx-vp9"}
"""The decoder that gives alpha, by the codec whose own decoder in FFmpeg leaves it out."""

CENTRED_CHROMA: Final = ("mjpeg", "mpeg1video")
"""Codecs whose standards put chroma in the centre."""


def import_av() -> Any:
    """PyAV; a UsageError says how to install it, or do without."""
    try:
        import av
    except ImportError as error:
        raise UsageError(
            "this format is read and written through PyAV, which is not installed: pip install 'gsvc_ref[video]', or "
            "use y4m (ffmpeg -i IN OUT.y4m) or a folder of PNG files"
        ) from error
    return av


def _fair_ratio(ratio: Fraction | None) -> Fraction | None:
    return ratio if ratio and ratio > 0 and max(ratio.numerator, ratio.denominator) <= MAX_RATIO_TERM else None


def _mean_rate(times: np.ndarray[Any, Any], unit: Fraction) -> Fraction | None:
    """Frames per second on average, from the first time to the last; None if there is no time between them."""
    span = int(times[-1]) - int(times[0])
    return ((len(times) - 1) / (span * unit)).limit_denominator(MAX_RATE_DENOMINATOR) if span > 0 else None


class LibavReader(VideoReader):
    """A reader of the first video stream of a file through PyAV, turned as its display matrix says.

    The source is a path, or a binary file that can seek. What gets lost is in the notes before the first frame is read.
    A GsvcError is ``malformed`` (FFmpeg cannot read it, it holds no video, a damaged frame), ``unsupported`` (matrix,
    transparency) or ``invalid`` (frames that change size or depth).
    """

    def __init__(self, source: Path | BinaryIO, name: str, background: Background | None = None) -> None:
        super().__init__()
        self._av = import_av()
        self._name, self._background = name, background
        self._decoded = 0
        self._begin: Fraction | None = None  # the stamp of the first frame
        self._last_time = Fraction(0)
        packets = read_packets(self._av, source)
        self._times = None if packets is None else packets.times
        self._is_uneven = False
        self._turned = Orientation()
        try:
            self._container = open_container(self._av, source)
        except self._av.FFmpegError as error:
            raise self._unreadable(error) from error
        try:
            self._stream = self._open_stream()
            self._decoder = self._open_decoder()
            if packets is not None and (damage := packets.damage(self._name)) is not None:
                self.note(damage)
            self._queue = self._decode()
            self._first = next(self._queue, None)
            self.format = self._find_format(self._first)
        except BaseException:
            self.close()
            raise

    def _unreadable(self, error: Exception) -> GsvcError:
        reason = getattr(error, "strerror", error)
        return GsvcError(
            "malformed",
            f"{self._name} is not a video that FFmpeg can read ({reason}), or it is cut off (its index may be at the "
            f"end); give a whole video file, a y4m file or a folder of PNG files",
        )

    def _open_stream(self) -> av.VideoStream:
        streams = self._container.streams.video
        if not streams or streams[0].codec_context is None:
            raise GsvcError("malformed", f"{self._name} holds no video that FFmpeg can decode; give another file")
        stream: av.VideoStream = streams[0]
        if stream.codec_context.name in TEXT_DECODERS:
            raise GsvcError("malformed", f"{self._name} is a text file, not a video; give a video file")
        for sentence in lost_tracks(self._container, stream, self._name):
            self.note(sentence)
        return stream

    def _open_decoder(self) -> av.VideoCodecContext:
        """The decoder: FFmpeg's choice, or libvpx where a background needs the alpha that FFmpeg's own leaves out."""
        decoder: av.VideoCodecContext = self._stream.codec_context
        if has_alpha_track(self._stream):
            named = LIBVPX.get(decoder.name)
            if self._background is None or named is None:
                remedy = "" if named is None else "; --background COLOR shows it on a color"
                self.note(
                    f"{self._name} has a track of transparency (alpha_mode 1), which is left out; its colours are read"
                    + remedy
                )
            else:
                decoder, extradata = self._av.CodecContext.create(named, "r"), decoder.extradata
                decoder.extradata = extradata
        decoder.thread_type = "NONE"  # with threads FFmpeg loses reports of damage
        decoder.thread_count = 1
        return decoder

    def _decode(self) -> Iterator[av.VideoFrame]:
        """Pictures in order; an error comes after the pictures before it."""
        try:
            for packet in self._container.demux(self._stream):
                yield from self._decoder.decode(packet)
        except self._av.FFmpegError as error:
            yield from self._drain()
            if self._decoded == 0:
                raise self._unreadable(error) from error
            raise GsvcError(
                "malformed",
                f"{self._name} is damaged or cut off after frame {self._decoded - 1} ({error.strerror}); give an "
                f"intact file, or convert the part before with ffmpeg",
            ) from error

    def _drain(self) -> Iterator[av.VideoFrame]:
        """Pictures that the decoder still holds."""
        try:
            yield from self._decoder.decode(None)
        except self._av.FFmpegError:
            return

    def _find_format(self, first: av.VideoFrame | None) -> VideoFormat:
        stream = self._stream
        if first is None:
            raise GsvcError("malformed", f"{self._name} holds no frame that FFmpeg can decode; give another file")
        check_size(first.width, first.height, self._name)
        rate = self._find_rate()
        aspect = _fair_ratio(stream.sample_aspect_ratio) or Fraction(1)
        video = self._source_format(first)
        for sentence in lost_with_picture(first, self._name):
            self.note(sentence)
        self._alpha(*self._buffers(first, 0), video, 0)
        turned = orientation(first)
        if turned is None:
            self.note(f"{self._name} asks players to rotate it by {first.rotation} degrees; frames are as coded")
        elif turned != self._turned:
            self._turned, self.is_turned = turned, True
            self.note(f"{self._name} is {turned}, as its display matrix says")
        width, height = video.width, video.height
        if self._turned.swapped:
            width, height, aspect = height, width, 1 / aspect
        count = stream.frames if stream.frames > 0 else None
        return replace(
            video, width=width, height=height, frame_rate=rate, sample_aspect_ratio=aspect, frame_count=count
        )

    def _find_rate(self) -> Fraction:
        """The frame rate: that which all time stamps keep to, or else their mean."""
        rates = [_fair_ratio(self._stream.average_rate), _fair_ratio(self._stream.guessed_rate)]
        if self._times is not None:
            times, unit = self._times
            rates.append(_fair_ratio(_mean_rate(times, unit)))
        known = [rate for rate in rates if rate is not None]
        if not known:
            self.note(f"frame rate not stated by {self._name}, so assumed: 25 per second")
            return Fraction(25)
        if self._times is None:
            return known[0]
        kept = next((rate for rate in known if is_even(times, unit, rate)), None)
        if kept is None:
            self._is_uneven = True
            self.time_base = unit
            self.note(uneven(self._name, known[-1]))
        return kept or known[-1]

    def _source_format(self, picture: av.VideoFrame) -> VideoFormat:
        """The format of one picture as its own tags say."""
        pixels = plain_layout(plain_name(picture))
        rgb, grey = pixels.chroma_format == "rgb", len(pixels.places) == 1
        matrix, siting = int(picture.colorspace), 0
        if rgb:
            matrix = 0
        elif grey:
            matrix = 6  # grey has no chroma for a matrix to act on
        elif matrix == 0 and pixels.chroma_format != "444":
            matrix = UNSPECIFIED  # older files hold 0 where nothing was meant
        if pixels.chroma_format in ("420", "422") and not grey:
            if self._stream.codec_context.name in CENTRED_CHROMA:
                siting = 1
            else:
                self.note("PyAV does not tell the chroma siting, so assumed: left")
        color, notes = complete_color(
            self._name,
            picture.height,
            pixels.chroma_format,
            primaries=int(picture.color_primaries),
            transfer=int(picture.color_trc),
            matrix=matrix,
            full_range=RANGES.get(picture.color_range, True if rgb or picture.format.name.startswith("yuvj") else None),
            chroma_location=siting,
        )
        for sentence in notes:
            self.note(sentence)
        chroma_format = "444" if rgb and not color.full_range else pixels.chroma_format
        return VideoFormat(picture.width, picture.height, Fraction(25), pixels.bit_depth, chroma_format, color)

    def _buffers(self, picture: av.VideoFrame, number: int) -> tuple[list[Any], PixelLayout]:
        """The planes in memory as (rows, bytes of a line) u1, and their layout."""
        found, name = picture.format.name, plain_name(picture)
        pixels = plain_layout(name)
        if name == found and any(plane.line_size < 0 for plane in picture.planes):
            if pixels.chroma_format != "rgb":
                raise GsvcError(
                    "unsupported",
                    f"frame {number} of {self._name} is stored bottom-up as {found}; convert the video to y4m first",
                )
            # PyAV's buffers cannot express bottom-up lines; a planar copy is top-down.
            name = stand_in(rgb=True, alpha=pixels.alpha is not None, deep=pixels.bit_depth > 8)
            pixels = plain_layout(name)
        if name != found:
            picture = self._reformat(picture, name, number)
        views = (np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size) for plane in picture.planes)
        return list(views), pixels

    def _reformat(self, picture: av.VideoFrame, name: str, number: int) -> av.VideoFrame:
        found = picture.format.name
        span = 2 if self._source_format(picture).color.full_range else 1  # AVColorRange, the same on both sides
        try:
            copy = picture.reformat(format=name, src_color_range=span, dst_color_range=span)
        except (self._av.FFmpegError, ValueError) as error:
            raise GsvcError(
                "unsupported",
                f"frame {number} of {self._name} has the pixel format {found}, which cannot be converted; convert the "
                f"video to yuv420p first",
            ) from error
        self.note(f"pixel format {found} is read through libswscale as {name}")
        return copy

    def _convert(self, picture: av.VideoFrame, number: int) -> Frame:
        buffers, pixels = self._buffers(picture, number)
        video = self._source_format(picture)
        if video.color != self.format.color:
            self.note(f"{self._name} changes its colour tags at frame {number}; each frame is converted by its own")
        shapes = video.plane_shapes
        alpha = self._alpha(buffers, pixels, video, number)
        planes = [take(place, buffers, shapes[i], pixels) for i, place in enumerate(pixels.places)]
        if pixels.chroma_format == "rgb":
            if video.color.full_range:
                return self._flattened(np.stack(planes, axis=-1), alpha)
            planes = [planes[1], planes[2], planes[0]]  # matrix 0 carries G', B', R'
        elif len(planes) == 1:
            planes += [np.full(shape, 1 << (video.bit_depth - 1), video.dtype) for shape in shapes[1:]]
        return self._flattened(to_rgb(planes, video), alpha)

    def _alpha(self, buffers: list[Any], pixels: PixelLayout, video: VideoFormat, number: int) -> Frame | None:
        """The alpha channel (H, W) of a picture, if it has one; without a background it must be opaque."""
        if pixels.alpha is None:
            return None
        alpha = take(pixels.alpha, buffers, video.plane_shapes[0], pixels)
        if not check_alpha(alpha, video.peak, self._background, f"frame {number} of {self._name}"):
            self.note(flattening_note(self._name, self._background))
        elif self._background is None:
            self.note(
                f"the alpha channel of {self._name} is left out; a frame that is not opaque ends the reading, unless "
                f"--background COLOR is given"
            )
        return alpha

    def _flattened(self, frame: Frame, alpha: Frame | None) -> Frame:
        background = self._background
        return frame if alpha is None or background is None else flattened(frame, alpha, self.format.peak, background)

    def _check(self, picture: av.VideoFrame, number: int) -> None:
        if picture.is_corrupt:
            raise GsvcError(
                "malformed", f"frame {number} of {self._name} is damaged; give an intact file, or repair it with ffmpeg"
            )
        width, height = picture.width, picture.height
        if self._turned.swapped:
            width, height = height, width
        found = (width, height, plain_layout(plain_name(picture)).bit_depth)
        expected = (self.format.width, self.format.height, self.format.bit_depth)
        if found != expected:
            raise GsvcError(
                "invalid",
                f"frame {number} of {self._name} is {found[0]}x{found[1]} with {found[2]} bits, the frames before are "
                f"{expected[0]}x{expected[1]} with {expected[2]}: scale the video to one size and depth first",
            )
        if picture.interlaced_frame:
            self.note(interlaced(self._name))
        if orientation(picture) not in (self._turned, None):
            self.note(f"{self._name} changes its display matrix at frame {number}; frames are turned as the first one")

    def _keep_time(self, picture: av.VideoFrame) -> None:
        """Note when a frame is shown, and when it ends, if frames are not evenly spaced."""
        if not self._is_uneven:
            return
        unit, usual = picture.time_base, 1 / self.format.frame_rate
        stamp = None if picture.pts is None or unit is None else picture.pts * unit
        if self._begin is None:
            self._begin, time = stamp or Fraction(0), Fraction(0)
        else:
            time = self._last_time + usual if stamp is None else stamp - self._begin
            if time <= self._last_time:
                self.note(f"time stamps of {self._name} do not grow from frame to frame; frames are taken in order")
                time = self._last_time + usual
        self._last_time = self.frame_time = time
        self.end_time = time + (picture.duration * unit if picture.duration and unit else usual)

    def _read(self) -> Iterator[Frame]:
        pictures = self._queue if self._first is None else chain([self._first], self._queue)
        self._first = None
        for number, picture in enumerate(pictures):
            self._check(picture, number)
            self._decoded = number + 1
            frame = self._turned.apply(self._convert(picture, number))
            self._keep_time(picture)
            yield frame
        if self.format.frame_count is not None and self.format.frame_count != self._decoded:
            self.note(f"{self._name} states {self.format.frame_count} frames, but {self._decoded} could be read")

    def close(self) -> None:
        """Close the file."""
        super().close()
        self._container.close()
