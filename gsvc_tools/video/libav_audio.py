"""The sound of one file in another, packet by packet as it is: nothing is decoded or encoded again."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any, Final

from gsvc_base.errors import UsageError
from gsvc_tools.video.libav_probe import codec_name, open_container

LEAD_S: Final = 0.1
"""Seconds by which sound may begin before the pictures: encoders put a packet in front that a decoder warms up with."""


FIRST_PACKETS: Final = 32
"""Packets of a video among which the first picture is: they stand in the order of decoding."""


def first_picture(av_module: Any, source: Path) -> Fraction:
    """When the first picture of a file is shown, by its time stamps; 0 of a file of sound alone.

    What FFmpeg says of the start of a stream is that of another stream in some Matroska files.
    """
    with open_container(av_module, source) as container:
        if not container.streams.video:
            return Fraction(0)
        video = container.streams.video[0]
        packets = (packet for packet in container.demux(video) if packet.pts is not None and not packet.is_discard)
        stamps = [packet.pts for packet in islice(packets, FIRST_PACKETS)]
        return min(stamps, default=0) * Fraction(video.time_base or 0)


class Sound:
    """The audio tracks of a file, from a second `begin` of its pictures on; a UsageError says that there are none."""

    def __init__(self, av_module: Any, source: Path, begin: Fraction = Fraction(0)) -> None:
        self._av, self._source, self._begin = av_module, source, begin
        try:
            self._start = first_picture(av_module, source) + begin
            self._container = open_container(av_module, source)
        except av_module.FFmpegError as error:
            raise UsageError(
                f"no sound can be read from {source} ({error.strerror}); give a video with sound"
            ) from None
        self._tracks = list(self._container.streams.audio)
        if not self._tracks:
            self.close()
            raise UsageError(f"{source} has no sound; give the video that was encoded, or leave --audio-from away")
        self._copies: dict[int, Any] = {}
        self._packets = self._shifted()
        self._next: tuple[Fraction, Any] | None = None

    @property
    def codecs(self) -> list[str]:
        """The codec of each track, as FFmpeg calls it."""
        return [codec_name(track) for track in self._tracks]

    def add_to(self, container: Any, name: str) -> None:
        """Add the tracks to a container that is being written under a name; a UsageError says which it cannot hold."""
        for track, codec in zip(self._tracks, self.codecs, strict=True):
            if codec not in container.supported_codecs:
                raise self.refusal(name)
            try:
                copied = container.add_stream_from_template(track)
            except (self._av.FFmpegError, ValueError) as error:
                raise self.refusal(name) from error
            copied.metadata.update(track.metadata)
            self._copies[track.index] = copied

    def refusal(self, name: str) -> UsageError:
        """What is said where a container cannot hold a track."""
        kinds = ", ".join(dict.fromkeys(self.codecs))
        return UsageError(
            f"{name} cannot hold the sound of {self._source} ({kinds}); write .mkv, which holds every kind"
        )

    def before(self, time: Fraction) -> Iterator[Any]:
        """The packets that follow, up to a time in seconds of what is written."""
        while True:
            if self._next is None and (following := next(self._packets, None)) is not None:
                self._next = following
            if self._next is None or self._next[0] >= time:
                return
            packet, self._next = self._next[1], None
            yield packet

    def _shifted(self) -> Iterator[tuple[Fraction, Any]]:
        """The packets with the time of each from `begin` on; what is before that is left out."""
        start = self._start
        try:
            for packet in self._container.demux(self._tracks):
                if packet.size == 0 or packet.pts is None:
                    continue
                unit = packet.time_base
                time = packet.pts * unit - start
                if time < (0 if self._begin else -LEAD_S):
                    continue
                offset = round(start / unit)
                packet.dts = (packet.pts if packet.dts is None else packet.dts) - offset
                packet.pts -= offset
                packet.stream = self._copies[packet.stream_index]
                yield time, packet
        except self._av.FFmpegError:  # a file that is cut: what there is of it is sound
            return

    def close(self) -> None:
        """Close the file."""
        self._container.close()
