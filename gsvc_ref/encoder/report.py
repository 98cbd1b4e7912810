"""The progress of an encode while it runs, and its report when it is done."""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from gsvc_base.errors import ErrorKind, GsvcError
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.encoder.encoded_frame import OnStage
from gsvc_ref.encoder.log import Decision
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.paper import FrameType


@dataclass(frozen=True)
class Progress:
    """The place where an encode is."""

    # The number of frames is None if the source does not say it, or has more than it said.
    frame: int
    frame_count: int | None
    # ``detect`` (looking for key frames); in profile `main` ``encode``, with a PSNR to hold once for each try; in
    # profile `paper` ``fit``, ``quantize``, and with a PSNR to hold ``rate`` (looking for the number of splats, with a
    # short fit after each change). With several jobs ``groups`` in place of all but ``detect``: `frame` + 1 frames are
    # encoded, of all groups of pictures.
    stage: str
    # Of the stage, and about how many there are. In ``groups`` the number of groups in work, and its maximum.
    iteration: int
    iterations: int
    # PSNR of the picture before it is rounded to bits, in dB; None if there is none yet. In ``groups`` that of the
    # frame decoded last.
    psnr: float | None
    elapsed_s: float  # since the encode began
    step: str = ""  # with a goal for the whole clip, the purpose of this pass
    kept: int = 0  # frames so far that an earlier encode has kept (`resume`)


OnProgress = Callable[[Progress], None]


class ProgressReporter:
    """Reports to a function of the caller where an encode is."""

    def __init__(
        self,
        on_progress: OnProgress | None,  # None: nobody asks
        frame_count: int | None,  # None: the source does not say it
    ) -> None:
        self._on_progress, self._frame_count = on_progress, frame_count
        self._begin = time.perf_counter()
        self.kept = 0

    def show(self, stage: str, frame: int, iteration: int = 0, iterations: int = 0, psnr: float | None = None) -> None:
        """Report the stage of a frame."""
        if self._on_progress is None:
            return
        if self._frame_count is not None and frame >= self._frame_count:
            self._frame_count = None  # the source has more frames than it said
        elapsed = time.perf_counter() - self._begin
        self._on_progress(
            Progress(frame, self._frame_count, stage, iteration, iterations, psnr, elapsed, kept=self.kept)
        )

    def watch(self, number: int) -> OnStage:
        """What is called with the stages of a frame."""
        return lambda stage, iteration, iterations, psnr: self.show(stage, number, iteration, iterations, psnr)


@dataclass(frozen=True)
class LayerReport:
    """One layer of an encoded frame."""

    # 0: the base
    layer: int
    type: FrameType
    # of this layer alone; new are those that the frame before does not have
    splats: int
    new_splats: int
    psnr: float  # in dB, with all layers up to this one
    bits: dict[str, int]  # of its chunk, by category; empty if the layer is repeated without one


@dataclass(frozen=True)
class FrameReport:
    """One encoded frame."""

    number: int
    type: FrameType
    reason: str
    # All, those that the frame before does not have, and those of the frame before that are gone.
    splats: int
    new_splats: int
    pruned_splats: int
    iterations: int  # fine-tuning included
    # PSNR of the decoded frame at its bit depth, with all of its layers, against the source, in dB; infinite if equal
    psnr: float
    bits: dict[str, int]  # of its chunk, by category
    seconds: float
    decisions: tuple[Decision, ...] = ()  # one for each effect, in the order of `Effects`
    # The base and those above it; empty without layers. All other fields but `psnr` are about the base.
    layers: tuple[LayerReport, ...] = ()


@dataclass(frozen=True)
class EncodeReport:
    """One encode."""

    header: SequenceHeader  # as written
    settings: Settings
    frames: list[FrameReport]
    file_bytes: int  # of the whole stream
    # In all, and by stage: "read and detect", "write", and those of `EncodedFrame.seconds`.
    seconds: float
    seconds_by_stage: dict[str, float] = field(default_factory=dict)
    interrupted: bool = False  # by Ctrl-C; the stream then has the frames up to it
    # sentences on what was assumed about the source and what was not reached
    notes: list[str] = field(default_factory=list)
    fault: str | None = None  # what ended it early; the stream then has the frames up to it

    @property
    def bits_per_pixel(self) -> float:
        """All bits of the stream over all pixels of its frames."""
        return 8 * self.file_bytes / (self.header.width * self.header.height * len(self.frames))

    @property
    def mean_psnr(self) -> float:
        """Mean of the frames' PSNR in dB; infinite if any is."""
        return float(np.mean([frame.psnr for frame in self.frames]))

    @property
    def frame_types(self) -> dict[str, int]:
        """The number of frames of each type."""
        return dict(Counter(frame.type for frame in self.frames))


class IncompleteEncodeError(GsvcError):
    """Frames could not be read or written from some point on; those before are a valid stream, which is in place.

    `kind`, `rule` and `bit` are those of the fault, which is the cause of this exception; ``invalid`` if it has none.

    Attributes
    ----------
    report
        The report of the frames that were saved.
    """

    def __init__(
        self, kind: ErrorKind, message: str, report: EncodeReport, rule: str | None = None, bit: int | None = None
    ) -> None:
        super().__init__(kind, message, rule=rule, bit=bit)
        self.report = report

    def __reduce__(self) -> tuple[type[Self], tuple[ErrorKind, str, EncodeReport, str | None, int | None]]:
        return type(self), (self.kind, self.message, self.report, self.rule, self.bit)
