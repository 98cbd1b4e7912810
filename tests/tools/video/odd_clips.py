"""Tiny clips with what phones, cameras and screen recorders put into files beside even pictures."""

import io
from collections.abc import Sequence
from contextlib import closing
from fractions import Fraction

import av
import numpy as np

SIZE = (32, 24)


def pictures(count, name="yuv420p", size=SIZE):
    """Pictures of a bright corner, top left, over a gradient that moves."""
    width, height = size
    y, x = np.mgrid[:height, :width]
    for number in range(count):
        frame = np.stack([40 + 2 * x + number, 60 + 2 * y, 90 + 0 * x], axis=-1).astype(np.uint8)
        frame[: height // 3, : width // 3] = [250, 240, 20]
        yield av.VideoFrame.from_ndarray(frame, format="rgb24").reformat(format=name)


def write_clip(
    path, *, times: Sequence[int] = range(0, 250, 40), unit=Fraction(1, 1000), rate=25, sound=(), codec="libx264",
    pix_fmt="yuv420p", options=None, tags=None, subtitles=False, chapters=False, rotation=0, seconds=None,
):  # fmt: skip
    """A clip whose frames are shown at `times`, in units of time; `sound` has the codecs of tracks as long as it."""
    length = seconds or float((times[-1] + 40 * 25 / rate) * unit)
    with closing(av.open(str(path), "w")) as container:
        if chapters:
            container.set_chapters([{"id": 1, "start": 0, "end": 100, "time_base": unit, "metadata": {"title": "a"}}])
        video = container.add_stream(codec, rate=rate, options=options or {})
        video.width, video.height, video.pix_fmt = *SIZE, pix_fmt
        video.codec_context.time_base = unit
        video.time_base = unit
        if rotation:
            video.set_display_rotation(rotation)
        for name, value in (tags or {}).items():
            setattr(video.codec_context, name, value)
        tracks = [container.add_stream(name, rate=48000, layout="mono") for name in sound]
        srt = av.open(io.BytesIO(b"1\n00:00:00,000 --> 00:00:00,100\nhello\n"), format="srt") if subtitles else None
        text = container.add_stream_from_template(srt.streams.subtitles[0]) if srt else None
        for picture, time in zip(pictures(len(times), pix_fmt), times, strict=True):
            picture.pts, picture.time_base = time, unit
            container.mux(video.encode(picture))
        container.mux(video.encode(None))
        for number, track in enumerate(tracks):
            container.mux(track.encode(tone(length, 440 * (number + 1), track.codec_context.format.name)))
            container.mux(track.encode(None))
        for packet in srt.demux() if srt else ():
            if packet.size:
                packet.stream = text
                container.mux(packet)


def tone(seconds, hertz, sample_format):
    """A sine of one channel at 48 kHz as one frame of sound."""
    count = int(48000 * seconds)
    samples = np.sin(np.arange(count) * (2 * np.pi * hertz / 48000)) * 0.5
    wave = (samples * 32767).astype(np.int16)[None]
    frame = av.AudioFrame.from_ndarray(wave, format="s16", layout="mono")
    frame.sample_rate, frame.pts, frame.time_base = 48000, 0, Fraction(1, 48000)
    (frame,) = av.AudioResampler(format=sample_format, layout="mono", rate=48000).resample(frame)
    return frame
