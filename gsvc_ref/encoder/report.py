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
    """The place where an encode is.

    Attributes
    ----------
    frame, frame_count
        Number of the frame in work, and the number of frames; None if the source does not say it, or has more than it
        said.
    stage
        ``detect`` (looking for key frames); in profile `main` ``encode``, with a quality to hold once for each try; in
        profile `paper` ``fit``, ``quantize``, and with a PSNR to hold ``rate`` (looking for the number of splats, with
        a short fit after each change). With several jobs ``groups`` in place of all but ``detect``: `frame` + 1 frames
        are encoded, of all groups of pictures.
    iteration, iterations
        The iteration of the stage, and their number; in profile `main` about. In ``groups`` the number of groups in
        work, and the most.
    psnr
        PSNR of the picture before it is rounded to bits, in dB; None if there is none yet. In ``groups`` that of the
        frame decoded last.
    elapsed_s
        Seconds since the encode began.
    step
        With a goal for the whole clip, what this pass over it is for.
    kept
        The number of frames so far that an earlier encode has kept (`resume`), which take no time.
    """

    frame: int
    frame_count: int | None
    stage: str
    iteration: int
    iterations: int
    psnr: float | None
    elapsed_s: float
    step: str = ""
    kept: int = 0


OnProgress = Callable[[Progress], None]


class ProgressReporter:
    """Tells a function of the caller where an encode is.

    Parameters
    ----------
    on_progress
        The function; None: nobody asks.
    frame_count
        The number of frames, or None if the source does not say it.

    Attributes
    ----------
    kept
        The number of frames so far that an earlier encode has kept.
    """

    def __init__(self, on_progress: OnProgress | None, frame_count: int | None) -> None:
        self._on_progress, self._frame_count = on_progress, frame_count
        self._begin = time.perf_counter()
        self.kept = 0

    def show(self, stage: str, frame: int, iteration: int = 0, iterations: int = 0, psnr: float | None = None) -> None:
        """Tell the stage of a frame."""
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
    """One layer of an encoded frame.

    Attributes
    ----------
    layer, type
        0 for the base, and I, P or R.
    splats, new_splats
        Its own splats, and those of them that the frame before does not have.
    psnr
        PSNR of the decoded frame with all layers up to this one, in dB.
    bits
        Bits of its chunk by category; none if the layer is repeated without one.
    """

    layer: int
    type: FrameType
    splats: int
    new_splats: int
    psnr: float
    bits: dict[str, int]


@dataclass(frozen=True)
class FrameReport:
    """One encoded frame.

    Attributes
    ----------
    number, type, reason
        Frame number, I, P or R, and why it is of that type.
    splats, new_splats, pruned_splats
        Splats of the frame, those that the frame before does not have, and those of the frame before that are gone.
    iterations
        The number of iterations for this frame, fine-tuning included.
    psnr
        PSNR of the decoded frame at its bit depth, with all of its layers, against the source, in dB; infinite if
        equal.
    bits
        Bits of the frame's chunk by category.
    seconds
        Time spent on the frame.
    decisions
        The decisions about each effect, in the order of `Effects`.
    layers
        The base and the layers above it; none of a frame that has no layers. All but `psnr` is about the base.
    """

    number: int
    type: FrameType
    reason: str
    splats: int
    new_splats: int
    pruned_splats: int
    iterations: int
    psnr: float
    bits: dict[str, int]
    seconds: float
    decisions: tuple[Decision, ...] = ()
    layers: tuple[LayerReport, ...] = ()


@dataclass(frozen=True)
class EncodeReport:
    """One encode.

    Attributes
    ----------
    header
        The sequence header as written.
    settings
        The settings used.
    frames
        A report of each frame written.
    file_bytes
        Size of the stream: its bits are the rate.
    seconds, seconds_by_stage
        Time in all, and of "read and detect", "write", and the stages of `EncodedFrame.seconds`.
    interrupted
        Whether it was stopped early (Ctrl-C); the stream then holds the frames until there.
    fault
        The fault that ended it early, or None; then too the stream holds the frames until there.
    notes
        Sentences on what was assumed about the source and what was not reached.
    """

    header: SequenceHeader
    settings: Settings
    frames: list[FrameReport]
    file_bytes: int
    seconds: float
    seconds_by_stage: dict[str, float] = field(default_factory=dict)
    interrupted: bool = False
    notes: list[str] = field(default_factory=list)
    fault: str | None = None

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
