"""What a file holds beside the samples of its pictures, found before its frames are read.

Other tracks and metadata get lost, and notes say so; time stamps and a display matrix are for the reader to use.
"""

from __future__ import annotations

import os
from array import array
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any, BinaryIO, Final

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_ref.video.stream import Damage

if TYPE_CHECKING:
    import av

OPEN_OPTIONS: Final = {"protocol_whitelist": "file"}
"""Options of opening: a playlist must not reach into the network."""

LOST_SIDE_DATA: Final = {
    "MASTERING_DISPLAY_METADATA": "mastering display",
    "CONTENT_LIGHT_LEVEL": "content light level",
    "DYNAMIC_HDR_PLUS": "HDR10+",
    "DYNAMIC_HDR_VIVID": "HDR Vivid",
    "DOVI_RPU_BUFFER": "Dolby Vision",
    "DOVI_METADATA": "Dolby Vision",
    "AMBIENT_VIEWING_ENVIRONMENT": "ambient viewing environment",
    "A53_CC": "closed captions",
    "ICC_PROFILE": "an ICC profile",
    "SPHERICAL": "a spherical projection",
    "STEREO3D": "the layout of both eyes",
    "S12M_TIMECODE": "time codes",
}
"""Names of FFmpeg's side data of frames that a stream has no place for, in words."""

MAX_RATE_DENOMINATOR: Final = 1001
"""A mean frame rate is rounded to a fraction with at most this denominator, which is that of 30000/1001."""

JITTER_S: Final = 0.002
"""Seconds by which a frame may be off its place and still count as evenly spaced: containers round, Matroska to 1 ms
and QuickTime often to 1/600 s."""


def open_container(av_module: Any, source: Path | BinaryIO) -> Any:
    """Open a file with PyAV; what that raises passes through."""
    name = "file:" + os.fspath(source) if isinstance(source, Path) else source
    return av_module.open(name, options=dict(OPEN_OPTIONS), metadata_errors="ignore")


@dataclass(frozen=True)
class Packets:
    """What the packets of the first video stream say; nothing is decoded."""

    # When frames are shown, ascending from the first on, (T,) i8, and the unit in seconds; None: not all have a stamp.
    times: tuple[np.ndarray[Any, Any], Fraction] | None
    corrupt: int  # packets that FFmpeg marks as damaged
    complaint: str | None  # the first error of the demuxer
    is_transport: bool  # a transport stream, in which a packet that is lost leaves nothing but a gap in time

    def damage(self, name: str) -> Damage | None:
        """A note about frames that are lost or damaged, as far as FFmpeg reports them."""
        parts = []
        if self.is_transport or self.corrupt or self.complaint:
            lost = 0 if self.times is None else missing_frames(self.times[0])
            if lost:
                parts.append(f"{_count(lost, 'frame')} missing, by the time stamps")
        if self.corrupt:
            parts.append(f"FFmpeg marks {_count(self.corrupt, 'packet')} as damaged")
        if parts and self.complaint:
            parts.append(f"FFmpeg says: {self.complaint}")
        return Damage(f"{name} is damaged: {'; '.join(parts)}; what is left is read as it is") if parts else None


def missing_frames(times: np.ndarray[Any, Any]) -> int:
    """The number of frames that fit into the gaps between ascending times (T,) i8; 0 if the times are uneven."""
    steps = np.diff(times)
    usual = int(np.median(steps)) if len(steps) else 0
    counts = np.rint(steps / usual).astype(np.int64) if usual > 0 else np.ones(0, np.int64)
    # A stamp is off by at most a unit of its container, and frames that are lost leave whole periods.
    if (counts < 1).any() or (np.abs(steps[: len(counts)] - counts * usual) > np.maximum(counts, usual / 8)).any():
        return 0
    return int((counts - 1).sum())


def read_packets(av_module: Any, source: Path | BinaryIO) -> Packets | None:
    """Read all packets; None if the file cannot be read, which the reader reports.

    A file object is left where it was.
    """
    start = None if isinstance(source, Path) else source.tell()
    logging, level = av_module.logging, av_module.logging.get_level()
    times, corrupt, stamped = array("q"), 0, True
    logging.set_level(logging.ERROR)
    try:
        with logging.Capture() as said, open_container(av_module, source) as container:
            if not container.streams.video:
                return None
            stream, kind = container.streams.video[0], container.format.name
            for packet in container.demux(stream):
                corrupt += packet.is_corrupt and packet.size > 0
                if packet.size == 0 or packet.is_discard:  # the mark of the end; what an edit list leaves out
                    continue
                stamped &= packet.pts is not None
                times.append(packet.pts or 0)
            unit = stream.time_base
    except (av_module.FFmpegError, ValueError, EOFError):
        return None
    finally:
        logging.set_level(level)
        if start is not None and not isinstance(source, Path):
            source.seek(start)
    complaint = next((" ".join(text.split()) for _, speaker, text in said if speaker == kind), None)
    found = None
    if stamped and times and unit:
        ascending = np.sort(np.frombuffer(times, np.int64))
        found = ascending - ascending[0], unit
    return Packets(found, corrupt, complaint, kind == "mpegts")


def is_even(times: np.ndarray[Any, Any], unit: Fraction, rate: Fraction) -> bool:
    """Whether frames shown at these times, in units, are where a constant rate puts them."""
    period = 1 / float(rate)
    allowed = min(max(JITTER_S, float(unit)), period / 4)
    return bool((np.abs(times * float(unit) - np.arange(len(times)) * period) <= allowed + 1e-9).all())


def lost_tracks(container: Any, stream: av.VideoStream, name: str) -> list[str]:
    """A sentence for each kind of track that is not read."""
    streams = container.streams
    notes = []
    if len(streams.video) > 1:
        notes.append(f"{name} holds {len(streams.video)} video streams; the first one is read")
    if streams.audio:
        notes.append(
            f"{name} has sound ({_tracks(streams.audio)}), and GSVC has none; to put it back: "
            f"gsvc decode FILE.gsvc OUT.mp4 --audio-from {quote(name)}"
        )
    if streams.subtitles:
        notes.append(f"{name} has subtitles ({_tracks(streams.subtitles)}), which are left out")
    others = [*streams.data, *streams.attachments]
    if others:
        notes.append(f"{name} has {_count(len(others), 'other track')} (data or attachments), left out")
    if chapters := len(container.chapters()):
        notes.append(f"{name} has {_count(chapters, 'chapter mark')}, left out")
    return notes


def has_alpha_track(stream: av.VideoStream) -> bool:
    """Whether a WebM has a second picture beside each, of its opacity."""
    return stream.metadata.get("alpha_mode", stream.metadata.get("ALPHA_MODE")) == "1"


def _tracks(streams: Any) -> str:
    """Number and codecs of tracks, as ``2 tracks: aac, opus``."""
    return f"{_count(len(streams), 'track')}: {', '.join(dict.fromkeys(map(codec_name, streams)))}"


def codec_name(stream: Any) -> str:
    """The codec of a track, as FFmpeg calls it; ``unknown`` where FFmpeg has no decoder."""
    context = stream.codec_context
    return str(context.codec.canonical_name) if context else "unknown"


def interlaced(name: str) -> str:
    """A sentence about a source with interlaced pictures."""
    return f"{name} is interlaced; its frames are read as if progressive"


def uneven(name: str, rate: Fraction) -> str:
    """A note about a source whose frames are unevenly spaced, with this mean rate."""
    return (
        f"frames of {name} are not evenly spaced in time ({float(rate):.5g} per second on average); their time stamps "
        f"go along with them"
    )


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def lost_with_picture(picture: av.VideoFrame, name: str) -> list[str]:
    """A sentence about the side data of a frame that get lost, if it has any; and one if it is interlaced."""
    found = dict.fromkeys(LOST_SIDE_DATA[kind] for kind in _side_data(picture) if kind in LOST_SIDE_DATA)
    notes = []
    if found:
        notes.append(
            f"{name} has metadata with its pictures that are left out: {', '.join(found)}; primaries, transfer and "
            f"matrix are kept"
        )
    if picture.interlaced_frame:
        notes.append(interlaced(name))
    return notes


def _side_data(picture: Any) -> dict[str, Any]:
    """The side data of a frame by FFmpeg's name of its kind; kinds that this PyAV does not know have a number."""
    return {getattr(data.type, "name", str(data.type)): data for data in picture.side_data}


@dataclass(frozen=True)
class Orientation:
    """How the samples of a picture are turned to be shown: rows and columns change places first, then sides do."""

    swapped: bool = False  # rows become columns
    mirrored: bool = False  # then left and right change sides
    flipped: bool = False  # and top and bottom

    def apply(self, frame: Frame) -> Frame:
        """The frame as it is shown, (H, W, 3) or, swapped, (W, H, 3)."""
        if self == Orientation():
            return frame
        turned = frame.transpose(1, 0, 2) if self.swapped else frame
        return np.ascontiguousarray(turned[:: -1 if self.flipped else 1, :: -1 if self.mirrored else 1])

    def __str__(self) -> str:
        """What was done, in words."""
        if not self.swapped:
            both = "rotated by 180 degrees" if self.mirrored and self.flipped else ""
            return both or ("mirrored left to right" if self.mirrored else "turned upside down")
        if self.mirrored != self.flipped:
            return f"rotated by 90 degrees {'clockwise' if self.mirrored else 'counterclockwise'}"
        return "mirrored along a diagonal"


def orientation(picture: av.VideoFrame) -> Orientation | None:
    """How the display matrix of a frame turns it; None where that is no multiple of 90 degrees."""
    matrix = _side_data(picture).get("DISPLAYMATRIX")
    if matrix is None:
        return Orientation()
    a, b, _, c, d = np.frombuffer(bytes(matrix), np.int32)[:5].tolist()
    if b == c == 0 and a and d:  # x' = a x, y' = d y
        return Orientation(mirrored=a < 0, flipped=d < 0)
    if a == d == 0 and b and c:  # x' = c y, y' = b x
        return Orientation(swapped=True, mirrored=c < 0, flipped=b < 0)
    return None
