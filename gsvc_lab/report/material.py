"""One pass over a file with its source beside it: scores, a few frames to look at, and a short preview."""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

import gsvc_ref
from gsvc_base.arrays import Frame
from gsvc_base.splats import Splats
from gsvc_lab.pages.data import Detail, PictureRow
from gsvc_lab.pages.pictures import MAX_PREVIEW_FRAMES
from gsvc_ref.metrics import Comparison, compare_frames, psnr
from gsvc_ref.metrics.comparison import FrameComparison
from gsvc_ref.stream import DecodedFrame, Gap, Stream
from gsvc_ref.stream.decoder import rendered

MAX_PIXELS: Final = 110_000
"""Pixels of a frame that is shown as it is, those of 352x288 and a little more; a larger one is shown smaller."""

DETAIL: Final = (240, 160)
"""Width and height of the part of a larger frame that is shown pixel for pixel."""

WORST: Final = "the frame with the lowest PSNR"


@dataclass
class Material:
    """What one pass found."""

    numbers: list[int] = field(default_factory=list)  # the numbers of the frames that were decoded, in their order
    # PSNR in dB of those that have a counterpart in the source, by their number
    levels: dict[int, float] = field(default_factory=dict)
    comparison: Comparison | None = None  # the scores; None without a source
    pictures: list[PictureRow] = field(default_factory=list)  # frames to look at, by their numbers
    # The first frames, made smaller if they are large; no original ones without a
    # source
    preview_original: list[Frame] = field(default_factory=list)
    preview_decoded: list[Frame] = field(default_factory=list)
    # Mean PSNR with the base, with layer 1, ..., in dB; empty without a source or layers
    layers: list[float] = field(default_factory=list)


OnFrame = Callable[[int], None]
"""Called with the number of frames that are done."""


def gather(
    path: Path,  # the `.gsvc` file
    # The numbers of the frames to look at, with the reason; with a source the worst frame is added
    captions: Mapping[int, str],
    # The frames of the source from that of frame 0 on, of the file's size and depth; None without
    source: Iterator[Frame] | None = None,
    *,
    damaged: bool = False,  # whether to salvage what is left of the file
    with_vmaf: bool = True,  # As of `compare_frames` and `gsvc_ref.render`
    threads: int | None = None,
    on_frame: OnFrame = lambda count: None,  # called after each frame
) -> Material:
    """Decode a file once, beside its source.

    A GsvcError says that the sizes differ, or the file is damaged although `damaged` is False.
    """
    with ExitStack() as stack:
        stream = stack.enter_context(gsvc_ref.open(path))
        lower = [
            gsvc_ref.decode(stack.enter_context(gsvc_ref.open(path, layer=layer)), threads=threads)
            for layer in range(0 if source is None or damaged else stream.layer)
        ]
        walk = _Walk(stream, captions, source, lower, damaged, threads, on_frame)
        if source is None:
            for _ in walk.frames():
                walk.keep(None)
        else:
            header = stream.header
            peak = (1 << header.bit_depth) - 1
            walk.found.comparison = compare_frames(
                walk.originals(), walk.pictures(), peak,
                frame_rate=header.frame_rate, with_vmaf=with_vmaf, on_frame=walk.compared,
            )  # fmt: skip
        return walk.result()


class _Walk:
    """File and source side by side: three frames in memory, and what is kept of them."""

    def __init__(
        self,
        stream: Stream,
        captions: Mapping[int, str],
        source: Iterator[Frame] | None,
        lower: list[Iterator[Frame]],
        damaged: bool,
        threads: int | None,
        on_frame: OnFrame,
    ) -> None:
        self.stream, self.captions, self.source, self.lower = stream, captions, source, lower
        self.damaged, self.threads, self.on_frame = damaged, threads, on_frame
        self.found = Material()
        self.size = shrinking(stream.header.width, stream.header.height)
        self.decoded: DecodedFrame | None = None
        self.picture: Frame | None = None
        self.original: Frame | None = None
        self._sums = [0.0] * len(lower)
        self._worst: tuple[float, PictureRow] | None = None

    def _taken(self) -> Iterator[DecodedFrame]:
        parts = self.stream.salvage() if self.damaged else self.stream.frames()
        for part in parts:
            if not isinstance(part, Gap):
                self.decoded = part
                yield part

    def frames(self) -> Iterator[Frame]:
        """The pictures, one by one; `decoded` is the frame of the last."""
        for picture in rendered(self._taken(), self.stream.header, 1.0, "fast", self.threads):
            self.picture = picture
            assert self.decoded is not None
            self.found.numbers.append(self.decoded.number)
            yield picture

    def originals(self) -> Iterator[Frame]:
        """The frames of the source that the file has, each once its picture is there."""
        assert self.source is not None
        place = 0
        for _ in self.frames():
            assert self.decoded is not None
            for original in self.source:
                place += 1
                if place > self.decoded.number:  # those before are missing in a damaged file
                    self.original = original
                    yield original
                    break
            else:  # the source is shorter
                self.original = None
                self.keep(None)
        self.original = None

    def pictures(self) -> Iterator[Frame]:
        """The picture that stands beside what `originals` gave last."""
        while self.original is not None:
            assert self.picture is not None
            yield self.picture

    def compared(self, scores: FrameComparison) -> None:
        """Keep what is wanted of a pair of frames."""
        assert self.decoded is not None
        assert self.original is not None
        self.found.levels[self.decoded.number] = scores.psnr
        peak = (1 << self.stream.header.bit_depth) - 1
        for layer, frames in enumerate(self.lower):
            self._sums[layer] += psnr(self.original, next(frames), peak)
        self.keep(scores.psnr)

    def keep(self, level: float | None) -> None:
        """Keep what is wanted of the frame at hand; `level` is its PSNR, None without an original."""
        assert self.decoded is not None
        assert self.picture is not None
        number, original = self.decoded.number, None if level is None else self.original
        if len(self.found.preview_decoded) < MAX_PREVIEW_FRAMES:
            self.found.preview_decoded.append(smaller(self.picture, self.size))
            if original is not None:
                self.found.preview_original.append(smaller(original, self.size))
        if number in self.captions:
            self.found.pictures.append(self._row(self.captions[number], original))
        elif level is not None and (self._worst is None or level < self._worst[0]):
            self._worst = (level, self._row(WORST, original))
        self.on_frame(len(self.found.numbers))

    def _row(self, caption: str, original: Frame | None) -> PictureRow:
        assert self.decoded is not None
        assert self.picture is not None
        return picture_row(self.decoded.number, original, self.picture, self.decoded.splats, caption)

    def result(self) -> Material:
        """What was found."""
        found = self.found
        if found.preview_original:  # of a source that ended early
            del found.preview_decoded[len(found.preview_original) :]
        if self._worst is not None and self._worst[0] < min(
            (found.levels[row.number] for row in found.pictures if row.number in found.levels), default=math.inf
        ):
            found.pictures.append(self._worst[1])
            found.pictures.sort(key=lambda row: row.number)
        if self.lower and found.levels:
            count = len(found.levels)
            found.layers = [*(total / count for total in self._sums), math.fsum(found.levels.values()) / count]
        return found


def shrinking(width: int, height: int) -> int:
    """How many times smaller on a side a frame is shown: 1 up to MAX_PIXELS."""
    return max(1, math.ceil(math.sqrt(width * height / MAX_PIXELS)))


def smaller(frame: Frame, times: int) -> Frame:
    """A frame (H, W, 3) so many times smaller on a side, each pixel a mean; what is over at the edges is left out."""
    if times == 1:
        return frame.copy()
    height, width = (max(side // times, 1) for side in frame.shape[:2])
    cut = frame[: height * times, : width * times]
    blocks = cut.reshape(height, cut.shape[0] // height, width, cut.shape[1] // width, 3)
    return np.asarray(np.rint(blocks.mean(axis=(1, 3))), frame.dtype)


def picture_row(number: int, original: Frame | None, picture: Frame, splats: Splats, caption: str) -> PictureRow:
    """A frame to look at, with a part pixel for pixel where it is shown smaller."""
    height, width = picture.shape[:2]
    times = shrinking(width, height)
    values = splats.to_array()
    return PictureRow(
        number,
        None if original is None else smaller(original, times),
        smaller(picture, times),
        values[:, :2] / np.float32(times),
        values[:, 2:5] / np.float32(times),
        caption,
        None if times == 1 else _detail(original, picture),
    )


def _detail(original: Frame | None, picture: Frame) -> Detail:
    """The part of a frame with the largest squared error, or its middle."""
    height, width = picture.shape[:2]
    wide, high = min(DETAIL[0], width), min(DETAIL[1], height)
    left, top = (width - wide) // 2, (height - high) // 2
    if original is not None:
        columns, rows = ({*range(0, all_ - part, part), all_ - part} for all_, part in ((width, wide), (height, high)))
        places = [(x, y) for y in sorted(rows) for x in sorted(columns)]

        def error(place: tuple[int, int]) -> float:
            part = np.s_[place[1] : place[1] + high, place[0] : place[0] + wide]
            return float(np.square(picture[part].astype(np.int64) - original[part]).sum())

        left, top = max(places, key=error)
    part = np.s_[top : top + high, left : left + wide]
    before = None if original is None else original[part].copy()
    return Detail(left, top, before, picture[part].copy(), width, height)
