"""What other codecs need at the PSNR of a file, as the page tells it: a table, and how it was measured."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from gsvc_base.cli.text import plural
from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.pages.tables import Table
from gsvc_lab.bench import ffmpeg
from gsvc_lab.bench.tables import percent
from gsvc_lab.report.x264 import VARIANTS, X264, Peer, sample_frames, x264_at
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.video import open_video
from gsvc_ref.video.alpha import Background

OnStep = Callable[[str, float, float | None], None]
"""Called with what is done, how much of it, and of how much (None: unknown)."""


@dataclass(frozen=True)
class Against:
    """A table of coders with sentences on how it came about, or why there is none."""

    table: Table | None = None
    note: str = ""
    missing: str = ""


def against_x264(
    source: str,  # The source, and the frame of it that frame 0 shows
    start: int,
    header: SequenceHeader,  # the header of the file
    bits: Mapping[int, int],  # Bits and PSNR in dB of its frames, by their numbers
    levels: Mapping[int, float],
    on_step: OnStep,  # called before each encode
    background: Background | None = None,  # what is behind transparent pictures of the source
) -> Against:
    """What x264 needs at the PSNR of the first frames of a file."""
    frames = sample_frames(header.width, header.height, len(bits))
    if missing := _why_not(source, header, frames, levels):
        return Against(missing=missing)
    goal = math.fsum(levels[number] for number in range(frames)) / frames
    tries = 0

    def say(text: str) -> None:
        nonlocal tries
        tries += 1
        on_step(text, tries, None)

    try:
        with open_video(source, background=background) as reader:
            if (reader.format.width, reader.format.height) != (header.width, header.height):
                return Against(missing="x264 is not compared with a file that was resampled")
        peers, origin = x264_at(source, start, frames, goal, say, background)
    except (UsageError, GsvcError, OSError) as error:
        return Against(missing=f"x264 could not be compared: {error}")
    own = sum(bits[number] for number in range(frames))
    return Against(_table(peers, own, goal, header, frames), _note(origin, frames, len(bits)))


def _why_not(source: str, header: SequenceHeader, frames: int, levels: Mapping[int, float]) -> str:
    """Why the file cannot be compared, or nothing."""
    if not ffmpeg.available():
        return "the extra bench adds what x264 needs at equal PSNR: pip install 'gsvc_ref[bench]'"
    if header.bit_depth != 8:
        return "x264 is compared with files of 8 bits alone"
    if source == "-" or Path(source).suffix == ".gsvc":
        return "x264 is compared where the source is a video that can be read again"
    if any(number not in levels for number in range(frames)):
        return "x264 is not compared with a file that lacks frames"
    if not all(math.isfinite(levels[number]) for number in range(frames)):
        return "x264 is not compared where frames are identical to the source"
    return ""


def _table(peers: Sequence[Peer], own: int, goal: float, header: SequenceHeader, frames: int) -> Table:
    pixels, rate = header.width * header.height * frames, float(header.frame_rate) / frames / 1000
    rows = [("GSVC, this file", f"{own / pixels:.3f}", f"{own * rate:,.1f}", "", f"{goal:.2f} dB")]
    for peer in peers:
        if peer.bits is None:
            rows.append((peer.name, "–", "–", "does not reach it", peer.settings))
        else:
            more = f"{percent(own / peer.bits)} bits"
            rows.append((peer.name, f"{peer.bits / pixels:.3f}", f"{peer.bits * rate:,.1f}", more, peer.settings))
    return Table("Against x264 at the same PSNR", ("coder", "bits/pixel", "kbit/s", "GSVC against it", "at"), rows)


def _note(origin: str, frames: int, total: int) -> str:
    which = f"the first {frames} of {total:,} frames" if frames < total else f"all {plural(frames, 'frame')}"
    names = " and ".join(f"“{X264.variants[number].name}”" for number in VARIANTS)
    program = ffmpeg.description()[0].partition(" Copyright")[0]
    return (
        f"Over {which}. x264 is that of {program}, with the presets that gsvc bench uses, {names}, tuned for PSNR. "
        f"What it got: {origin}. Its bits are read off between two neighbouring settings, in the logarithm. Only what "
        "pictures need is counted: bare frames of both, without index, log and SEI. gsvc bench draws whole curves, "
        "against more codecs."
    )
