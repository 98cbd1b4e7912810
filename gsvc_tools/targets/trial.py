"""What an encode would take, by some frames of it: a trial.

At up to three places of the clip a frame is encoded as an I-frame, and those after it as P-frames. Size and PSNR of
the whole follow from these, and a range, which is wider where the places differ.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from io import BytesIO
from itertools import islice
from typing import Final

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.portable import log2, power
from gsvc_ref.bitstream import level_for
from gsvc_ref.encoder.encoded_frame import EncodedFrame
from gsvc_ref.encoder.loop import GroupCoder, silent
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.encoder.setup import coder_of, frame_count_of, no_frames
from gsvc_ref.stream import StreamWriter
from gsvc_ref.stream.profiles import work_after
from gsvc_ref.video import ColorDescription, VideoFormat, VideoReader
from gsvc_tools.targets.budget import header_so_far
from gsvc_tools.targets.curves import FrameCost, GroupCurve, same_for_all
from gsvc_tools.targets.passes import splats_of
from gsvc_tools.targets.screen_content import screen_note
from gsvc_tools.targets.targets import NEAR_TARGET

PLACES: Final = 3
"""Where frames are encoded: at the beginning, after a third and after two thirds."""

FRAMES_OF_PLACE: Final = 5
"""The frames of a place, the first of them an I-frame."""

BUDGET_S: Final = 8.0
"""Seconds after which no place is begun, and no P-frame but the first; reading has the same time."""

FIXED_BYTES: Final = 420
"""Header, index, end chunk, and the log of what was decided, and..."""

LOG_BYTES: Final = 10
"""...what the log takes for each frame: both guesses."""

SIZE_RANGE: Final = 1.6
"""The size is likely to be the estimate divided by this, to multiplied by it, and more where places differ: a guess, as
are the other ranges. docs/encode-and-look.md says how many of nine encodes were within them."""

TIME_RANGE: Final = 1.5
"""The same of the time, a guess as well."""

PSNR_BELOW, PSNR_ABOVE = 2.5, 1.0
"""The mean PSNR is likely to be at most this far below the estimate, since P-frames get worse as they go on, and above
it, in dB: guesses as well."""

PASSES: Final = {"bitrate": 2.3, "size": 2.3, "mean_psnr": 4.0, "vmaf": 4.5}
"""The time of an encode with a goal for the whole clip, in encodes: that of a size has two passes, and some frames of a
third; the passes for a mean, up to five, are guessed."""

DB_PER_DOUBLING: Final = 3.4
"""What twice the splats gain, in dB, where a goal needs other numbers of splats than were tried."""


_COLOR: Final = ColorDescription(2, 2, 0, full_range=True, chroma_location=0)


@dataclass(frozen=True)
class Range:
    """What a number is likely to be, and its likely limits."""

    low: float
    likely: float
    high: float

    def times(self, factor: float) -> "Range":
        """All three multiplied."""
        return Range(self.low * factor, self.likely * factor, self.high * factor)


@dataclass(frozen=True)
class Estimate:
    """What an encode would take."""

    format: VideoFormat  # the format of the source
    frames: int | None  # the number of frames; None if the source does not tell
    frames_tried: int  # the number of frames that were encoded
    # Of the whole; without a number of frames, seconds and bytes are those of one second of the video
    seconds: Range
    file_bytes: Range
    bits_per_pixel: Range
    mean_psnr: Range
    splats: int  # the number of splats of an I-frame with its layers
    level: int  # the level that the stream needs, by the frames tried
    notes: tuple[str, ...]  # sentences on the source, and on what to expect


@dataclass(frozen=True)
class _Trial:
    """A frame that was encoded."""

    cost: FrameCost
    seconds: float
    psnr: float
    splats: int
    work: int


def estimate(opened: Callable[[], VideoReader], settings: Settings, jobs: int = 1) -> Estimate:
    """Encode some frames of a source, and say what the whole is likely to take.

    `opened` gives a new reader of the source, and is called once. A GsvcError says that the source cannot be read or
    has no frames, a UsageError that the settings do not fit it.
    """
    with opened() as reader:
        video = reader.format
        count = frame_count_of(settings, video)
        base = settings.with_(bitrate=None, size=None, mean_psnr=None, vmaf=None)
        if jobs > 1 and base.threads is None:  # as each of them will have
            base = base.with_(threads=1)
        coder = coder_of(base, video)
        _warm_up(base)
        places: list[list[_Trial]] = []
        begin = time.perf_counter()
        first: Frame | None = None
        for frames in _places(reader, settings.frames[0], count):
            if first is None:
                first = frames[0]
            elif time.perf_counter() - begin > BUDGET_S:
                break
            places.append(_encode_place(coder, frames, video, begin + BUDGET_S))
            coder = coder.for_group()
        if first is None:
            raise no_frames(settings)
        notes = list(reader.notes)
    note = screen_note(first, video.peak, settings)
    return _whole(places, video, count, settings, jobs, [*notes, *([note] if note else [])])


def _warm_up(settings: Settings) -> None:
    """Load or compile the kernels, so that their time does not count."""
    coder = coder_of(settings.with_splats(4), VideoFormat(16, 16, Fraction(25), 8, "rgb", _COLOR))
    picture = np.arange(16 * 16 * 3, dtype=np.uint8).reshape(16, 16, 3)
    for number in range(2):
        coder.encode(picture + np.uint8(number), "I" if number == 0 else "P", number, silent)


def _places(reader: VideoReader, start: int, count: int | None) -> Iterator[list[Frame]]:
    """The frames of each place, as far as they are read within BUDGET_S."""
    begin = time.perf_counter()
    frames = islice(reader, start, None)
    at = 0
    for place in range(PLACES):
        start_of_place = 0 if count is None else place * count // PLACES
        if place and (count is None or count < PLACES * FRAMES_OF_PLACE):
            return
        while at < start_of_place:
            if next(frames, None) is None or time.perf_counter() - begin > BUDGET_S:
                return
            at += 1
        found = list(islice(frames, FRAMES_OF_PLACE if count is None else min(FRAMES_OF_PLACE, count)))
        at += len(found)
        if not found:
            return
        yield found


def _encode_place(coder: GroupCoder, frames: Sequence[Frame], video: VideoFormat, end: float) -> list[_Trial]:
    """The frames of a place, encoded."""
    trials, writer = [], _Written(video)
    for number, frame in enumerate(frames):
        if number > 1 and time.perf_counter() > end:
            break
        begin = time.perf_counter()
        is_equal = number > 0 and np.array_equal(frame, frames[number - 1])
        encoded = coder.encode(frame, "I" if number == 0 else "R" if is_equal else "P", number, silent)
        seconds = time.perf_counter() - begin
        error = 0.0 if math.isinf(encoded.psnr) else float(power(10.0, -encoded.psnr / 10))
        cost = FrameCost(number, encoded.codes.type, writer.bits(coder, encoded), error)
        states = [encoded.state, *(layer.state for layer in encoded.layers[1:])]
        splats, work = sum(len(state.splats) for state in states), sum(map(work_after, states))
        trials.append(_Trial(cost, seconds, min(encoded.psnr, 100.0), splats, work))
    return trials


class _Written:
    """A stream that the frames of a place are written to, for their size."""

    def __init__(self, video: VideoFormat) -> None:
        self._video = video
        self._writer: StreamWriter | None = None

    def bits(self, coder: GroupCoder, encoded: EncodedFrame) -> float:
        """The bits of the next frame with its layers."""
        if self._writer is None:  # what the header says of a coder is known after its first frame
            self._writer = StreamWriter(BytesIO(), header_so_far(coder, self._video), index=False)
        begin = self._writer.offset
        self._writer.write_frame(encoded.codes, encoded.state, encoded.chunks)
        return 8.0 * (self._writer.offset - begin)


def _whole(
    places: list[list[_Trial]], video: VideoFormat, count: int | None, settings: Settings, jobs: int, notes: list[str]
) -> Estimate:
    """What follows from the frames that were tried."""
    frames = max(1, round(video.frame_rate)) if count is None else count
    groups = _groups(settings, frames)
    later = frames - groups
    bits = [groups * place[0].cost.bits + later * _later([one.cost.bits for one in place]) for place in places]
    seconds = [groups * place[0].seconds + later * _later([one.seconds for one in place]) for place in places]
    psnrs = [_mean([one.psnr for one in place[-2:]]) for place in places]
    fixed = FIXED_BYTES + LOG_BYTES * frames if settings.decisions else FIXED_BYTES // 4
    size = _range(bits, SIZE_RANGE).times(1 / 8)
    size = Range(size.low + fixed, size.likely + fixed, size.high + fixed)
    psnr = Range(min(psnrs) - PSNR_BELOW, _mean(psnrs), max(psnrs) + PSNR_ABOVE)
    splats = round(_mean([place[0].splats for place in places]))
    if settings.goal is not None and splats:
        inter = later * _mean([_later([one.cost.bits for one in place]) for place in places])
        intra = groups * _mean([place[0].cost.bits for place in places])
        costs = FrameCost(0, "I", intra, 0.0), FrameCost(1, "P", inter, 0.0)
        curve = GroupCurve(costs, float(log2(splats)))
        size, psnr, splats = _with_goal(curve, settings, video, frames, fixed, size, psnr)
    share = PASSES.get(settings.goal or "", 1.0) / min(jobs, groups)
    every = [one for place in places for one in place]
    needed = round(1.1 * max(one.splats for one in every))
    if settings.profile == "paper":
        needed = settings.counted_splats(video.width, video.height)
    return Estimate(
        format=video,
        frames=count,
        frames_tried=len(every),
        seconds=_range(seconds, TIME_RANGE).times(share),
        file_bytes=size,
        bits_per_pixel=size.times(8 / (video.width * video.height * frames)),
        mean_psnr=psnr,
        splats=splats,
        level=level_for(video.width, video.height, splats=needed, work=max(one.work for one in every)),
        notes=tuple(notes),
    )


def _with_goal(
    curve: GroupCurve, settings: Settings, video: VideoFormat, frames: int, fixed: int, size: Range, psnr: Range
) -> tuple[Range, Range, int]:
    """Size, PSNR and number of splats with which a goal of the whole clip is likely to be met."""
    if settings.goal in ("bitrate", "size"):
        goal = 8.0 * settings.size if settings.size else float((settings.bitrate or 1.0) * frames / video.frame_rate)
        high = float(log2(settings.most_splats(video.width, video.height)))
        octave = same_for_all([curve], max(goal - 8 * fixed, 1.0), 0.0, high)
        change = DB_PER_DOUBLING * (octave - curve.octave)
        reached = (float(curve.bits(np.array([octave]))[0]) + 8 * fixed) / 8
        factor = SIZE_RANGE if octave in (0.0, high) else 1 + NEAR_TARGET
        size = Range(reached / factor, reached, reached * factor)
        wide = abs(change) / 4
        return size, Range(psnr.low + change - wide, psnr.likely + change, psnr.high + change + wide), splats_of(octave)
    if settings.mean_psnr is None:  # nobody knows how many splats a VMAF takes
        return Range(size.low / 2, size.likely, size.high * 2), psnr, splats_of(curve.octave)
    octave = curve.octave + (settings.mean_psnr - psnr.likely) / DB_PER_DOUBLING
    reached = float(curve.bits(np.array([octave]))[0]) / 8 + fixed
    wide = SIZE_RANGE * float(power(1.25, abs(octave - curve.octave)))
    size = Range(reached / wide, reached, reached * wide)
    return size, Range(settings.mean_psnr, settings.mean_psnr, settings.mean_psnr + 0.5), splats_of(octave)


def _groups(settings: Settings, frames: int) -> int:
    """The number of groups of pictures; with ``auto`` one, since nobody has looked for cuts."""
    keys = settings.key_frames
    if isinstance(keys, int):
        return -(-frames // keys)
    if isinstance(keys, tuple):
        return len({0, *(key for key in keys if key < frames)})
    return 1


def _later(values: Sequence[float]) -> float:
    """The mean of the last two of what the frames of a place took, without the I-frame if there is another."""
    return _mean(values[1:][-2:] or values)


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def _range(values: Sequence[float], factor: float) -> Range:
    """The mean, and limits that are further away where the values differ."""
    likely = _mean(values)
    return Range(min(values) / factor, likely, max(values) * factor)
