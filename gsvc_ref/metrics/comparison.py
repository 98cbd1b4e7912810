"""Two videos compared frame by frame, as a stream: only the scores are kept."""

import math
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from fractions import Fraction
from itertools import zip_longest
from typing import Any, Final, Protocol

from gsvc_base.arrays import Frame
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.metrics.squared_error import check_pair, mse, psnr_from_mse
from gsvc_ref.metrics.ssim import ms_ssim, ms_ssim_scales
from gsvc_ref.plugins import vmaf_meter


@dataclass(frozen=True)
class Vmaf:
    """The scores of a comparison, or why there are none.

    A score is about 0..100; by the model's own making, identical frames without motion score about 97.4, not 100.
    """

    scores: tuple[float, ...] | None  # one for each frame, in order
    mean: float | None  # arithmetic
    reason: str | None  # why there are no scores and what to do about it


class VmafMeter(Protocol):
    """A meter that scores pairs of frames as they come."""

    def add(self, reference: Frame, distorted: Frame) -> None:
        """Hand over the next pair."""

    def finish(self) -> Vmaf:
        """The scores of all pairs so far, or the reason why there are none."""


@dataclass(frozen=True)
class FrameComparison:
    """The scores of one pair of frames."""

    number: int  # from 0
    mse: float  # in squared sample steps
    psnr: float  # dB; infinite for identical frames
    ms_ssim: float  # 0..1

    @property
    def identical(self) -> bool:
        """Whether every sample is equal."""
        return self.mse == 0


@dataclass(frozen=True)
class Comparison:
    """The scores of all pairs of frames of two videos, and what was left over."""

    width: int
    height: int
    peak: int  # 2^bit_depth - 1
    frames: tuple[FrameComparison, ...]  # one entry per pair
    frames_missing_a: int  # frames of the other video beyond this one's end; they enter no mean
    frames_missing_b: int
    vmaf: Vmaf | None  # or why there is none; None when it was not asked for

    @property
    def mean_psnr(self) -> float:
        """Mean of the frames' PSNR in dB, as papers quote it; infinite as soon as one pair is identical."""
        return math.fsum(frame.psnr for frame in self.frames) / len(self.frames)

    @property
    def psnr_of_mean_mse(self) -> float:
        """PSNR in dB of the mean squared error over all frames; infinite only when all pairs are identical."""
        return psnr_from_mse(math.fsum(frame.mse for frame in self.frames) / len(self.frames), self.peak)

    @property
    def mean_ms_ssim(self) -> float:
        """Mean of the frames' MS-SSIM."""
        return math.fsum(frame.ms_ssim for frame in self.frames) / len(self.frames)

    @property
    def identical_frames(self) -> int:
        """Number of pairs that are equal in every sample."""
        return sum(frame.identical for frame in self.frames)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences that a reader of the means must know."""
        compared = f"only the first {len(self.frames)} frames of both are compared"
        notes = [
            f"the {name} video ends {missing} frames before the other one: {compared}"
            for name, missing in (("first", self.frames_missing_a), ("second", self.frames_missing_b))
            if missing
        ]
        if (scales := ms_ssim_scales(self.height, self.width)) < 5:
            notes.append(f"MS-SSIM has {scales} of its 5 scales at this size: not comparable with larger frames")
        if self.vmaf is not None and self.vmaf.reason is not None:
            notes.append(self.vmaf.reason)
        return tuple(notes)

    def to_json(self) -> dict[str, Any]:
        """The comparison for strict JSON: an infinite PSNR is null, beside `identical` or `identical_frames`."""
        scores = self.vmaf.scores if self.vmaf is not None else None
        return {
            "width": self.width,
            "height": self.height,
            "peak": self.peak,
            "frame_count": len(self.frames),
            "frames_missing": {"a": self.frames_missing_a, "b": self.frames_missing_b},
            "identical_frames": self.identical_frames,
            "ms_ssim_scales": ms_ssim_scales(self.height, self.width),
            "mean": {
                "psnr": _finite(self.mean_psnr),
                "psnr_of_mean_mse": _finite(self.psnr_of_mean_mse),
                "ms_ssim": self.mean_ms_ssim,
                "vmaf": self.vmaf.mean if self.vmaf is not None else None,
            },
            "frames": [
                {
                    "number": frame.number,
                    "identical": frame.identical,
                    "mse": frame.mse,
                    "psnr": _finite(frame.psnr),
                    "ms_ssim": frame.ms_ssim,
                    "vmaf": scores[index] if scores is not None else None,
                }
                for index, frame in enumerate(self.frames)
            ],
            "notes": list(self.notes),
        }


NO_METER: Final = Vmaf(None, None, "VMAF needs gsvc_tools, which comes with gsvc_ref: pip install .")


def compare_frames(
    a: Iterable[Frame],
    b: Iterable[Frame],
    peak: int,
    *,
    frame_rate: Fraction = Fraction(25),
    with_vmaf: bool = False,
    on_frame: Callable[[FrameComparison], None] | None = None,
) -> Comparison:
    """Compare two videos frame by frame, (H, W, 3) u1 or u2, in memory that grows with the scores alone.

    When one video is longer, the pairs are compared, the rest is counted and the result's notes say so. `a` is the
    original, which VMAF calls the reference; gsvc_tools finds an ffmpeg with libvmaf for it. A GsvcError ``invalid``
    says that a video has no frames, or that the sizes of two frames differ.
    """
    frames: list[FrameComparison] = []
    missing_a = missing_b = 0
    size: tuple[int, int] | None = None
    with ExitStack() as stack:
        make_meter = vmaf_meter() if with_vmaf else None
        meter = stack.enter_context(make_meter(peak, frame_rate)) if make_meter is not None else None
        for number, (first, second) in enumerate(zip_longest(a, b)):
            if first is None or second is None:
                missing_a += first is None
                missing_b += second is None
                continue
            size = _common_size(number, first, second, size)
            frames.append(_compare_pair(number, first, second, peak))
            if meter is not None:
                meter.add(first, second)
            if on_frame is not None:
                on_frame(frames[-1])
        if size is None:
            empty = "second" if missing_b else "first" if missing_a else "first and the second"
            raise GsvcError("invalid", f"the {empty} video has no frames; there is nothing to compare")
        scores = meter.finish() if meter is not None else NO_METER if with_vmaf else None
    height, width = size
    return Comparison(width, height, peak, tuple(frames), missing_a, missing_b, scores)


def _compare_pair(number: int, first: Frame, second: Frame, peak: int) -> FrameComparison:
    """All scores of one pair but VMAF, which needs its neighbours."""
    try:
        check_pair(first, second, peak)
    except UsageError as error:
        raise UsageError(f"frame {number}: {error}") from None
    squared = mse(first, second, peak)
    return FrameComparison(number, squared, psnr_from_mse(squared, peak), ms_ssim(first, second, peak))


def _common_size(number: int, first: Frame, second: Frame, size: tuple[int, int] | None) -> tuple[int, int]:
    """(height, width) of a pair, which must be that of the pairs before."""
    (height, width), (other_height, other_width) = first.shape[:2], second.shape[:2]
    if (height, width) != (other_height, other_width):
        raise GsvcError(
            "invalid",
            f"frame {number} is {width}x{height} in the first video and {other_width}x{other_height} in the second; "
            "only equal sizes can be compared: decode at scale 1, or bring one video to the other's size first",
        )
    if size is not None and size != (height, width):
        raise GsvcError(
            "invalid",
            f"the frames change size from {size[1]}x{size[0]} to {width}x{height} at frame {number}; "
            "compare the parts of equal size one by one",
        )
    return height, width


def _finite(value: float) -> float | None:
    """A number that strict JSON can hold, or None."""
    return value if math.isfinite(value) else None
