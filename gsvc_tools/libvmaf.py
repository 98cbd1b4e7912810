"""VMAF by the libvmaf of an ffmpeg program, fed frame by frame through one pipe.

Both frames of a pair travel as one picture, the reference above the distorted one; ffmpeg cuts it in two again. So the
two sides cannot run apart, nothing is written to disk but the log of scores, and memory stays constant.

VMAF's model is defined on limited-range Y'CbCr 4:2:0. ffmpeg converts both sides alike: BT.709 matrix, bicubic chroma,
8 bits for a peak up to 255 and 10 bits above. The model is vmaf_v0.6.1 (1080p at three picture heights).
"""

import json
import math
import os
import subprocess
import tempfile
from collections.abc import Iterable
from fractions import Fraction
from itertools import zip_longest
from pathlib import Path
from types import TracebackType
from typing import IO, Final, Self

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import Frame
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.metrics.comparison import Vmaf
from gsvc_ref.metrics.squared_error import check_pair

MODEL: Final = "vmaf_v0.6.1"
"""The model built into libvmaf that published figures use."""

MIN_SIDE: Final = 32
"""Shortest side that is scored: libvmaf's pyramid crashes at 16 samples, and under 32 a score says nothing."""

_LOG_NAME: Final = "vmaf.json"
_MAX_THREADS: Final = 8


def ffmpeg_with_libvmaf() -> tuple[str | None, str | None]:
    """The path of an ffmpeg program that has libvmaf and None, or None and the reason why there is none."""
    try:
        import imageio_ffmpeg  # an optional extra: absent in a plain installation
    except ImportError:
        return None, "VMAF needs the package imageio-ffmpeg: pip install 'gsvc_ref[bench]'"
    try:
        program = str(imageio_ffmpeg.get_ffmpeg_exe())
        filters = subprocess.run([program, "-hide_banner", "-filters"], capture_output=True, timeout=60, check=True)
    except (RuntimeError, OSError, subprocess.SubprocessError) as error:
        return None, f"VMAF needs an ffmpeg program, and imageio-ffmpeg's does not run here: {error}"
    if b" libvmaf " not in filters.stdout:
        return None, f"VMAF needs ffmpeg with libvmaf; {program} has none: set IMAGEIO_FFMPEG_EXE to one that has"
    return program, None


class VmafMeter:
    """A meter that scores pairs of frames as they come; a context manager.

    `peak` is the largest sample value of the frames, 2^bit_depth - 1; scores do not depend on the frame rate. Where
    VMAF cannot be had, `add` does nothing and `finish` gives the reason.
    """

    def __init__(self, peak: int, frame_rate: Fraction) -> None:
        if frame_rate <= 0:
            raise UsageError(f"the frame rate is {frame_rate}; it must be positive")
        self._peak = peak
        self._frame_rate = frame_rate
        self._program, self._reason = ffmpeg_with_libvmaf()
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._errors: IO[bytes] | None = None
        self._count = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add(self, reference: Frame, distorted: Frame) -> None:
        """Hand over the next pair of (H, W, 3) u1 or u2 frames; a UsageError says that they do not fit."""
        check_pair(reference, distorted, self._peak)
        self._count += 1
        if min(reference.shape[:2]) < MIN_SIDE:
            self._reason = f"VMAF needs frames of at least {MIN_SIDE}x{MIN_SIDE} pixels"
        if self._reason is not None:
            return
        pair = np.concatenate([reference, distorted])  # (2H, W, 3) u1 or u2
        if self._peak <= 0xFF:
            samples = _stretch(pair, self._peak, 0xFF).astype(np.uint8)
        else:
            samples = _stretch(pair, self._peak, 0xFFFF).astype("<u2")
        try:
            if self._process is None:
                self._process = self._start(reference.shape[0], reference.shape[1])
            assert self._process.stdin is not None
            self._process.stdin.write(samples.tobytes())
        except OSError as error:  # ffmpeg has ended: its own words say why
            self._reason = self._complaint() or f"ffmpeg could not be fed for VMAF: {error}"

    def finish(self) -> Vmaf:
        """End the input and return the scores of all pairs so far, or the reason why there are none."""
        if self._reason is None and self._process is None:
            self._reason = "VMAF needs at least one frame"
        scores = self._scores() if self._reason is None else None
        self.close()
        if scores is None:
            return Vmaf(None, None, self._reason)
        return Vmaf(scores, math.fsum(scores) / len(scores), None)

    def close(self) -> None:
        """Stop ffmpeg and remove the temporary folder; harmless when done before."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None
        if self._errors is not None:
            self._errors.close()
            self._errors = None
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def _start(self, height: int, width: int) -> subprocess.Popen[bytes]:
        """Start ffmpeg for pairs of this size."""
        assert self._program is not None
        self._folder = tempfile.TemporaryDirectory(prefix="gsvc-vmaf-")
        self._errors = open(Path(self._folder.name) / "errors.txt", "w+b")  # noqa: SIM115 (closed by close)
        eight_bits = self._peak <= 0xFF
        convert = (
            f"scale=out_color_matrix=bt709:out_range=tv:flags=bicubic+accurate_rnd+full_chroma_int,"
            f"format={'yuv420p' if eight_bits else 'yuv420p10le'}"
        )
        graph = (
            f"split[a][b];[a]crop={width}:{height}:0:0:exact=1,{convert}[reference];"
            f"[b]crop={width}:{height}:0:{height}:exact=1,{convert}[distorted];"
            f"[distorted][reference]libvmaf=model=version={MODEL}:log_fmt=json:log_path={_LOG_NAME}"
            f":n_threads={min(os.cpu_count() or 1, _MAX_THREADS)}"
        )
        # The log's path would need escaping inside the graph: ffmpeg works in the folder instead.
        command = [self._program, "-hide_banner", "-nostats", "-loglevel", "error"]
        command += ["-f", "rawvideo", "-pixel_format", "rgb24" if eight_bits else "rgb48le"]
        command += ["-video_size", f"{width}x{2 * height}", "-framerate", str(self._frame_rate), "-i", "pipe:0"]
        command += ["-filter_complex", graph, "-f", "null", "-"]
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=self._errors,
            cwd=self._folder.name,
        )

    def _scores(self) -> tuple[float, ...] | None:
        """Wait for ffmpeg and read its log; None and a reason set when it failed."""
        assert self._process is not None
        assert self._folder is not None
        try:
            self._process.communicate()
            log = json.loads((Path(self._folder.name) / _LOG_NAME).read_text())
            scores = tuple(float(frame["metrics"]["vmaf"]) for frame in log["frames"])
        except (OSError, ValueError, KeyError) as error:
            status = self._process.returncode
            self._reason = self._complaint() or f"ffmpeg left no VMAF scores (exit status {status}): {error}"
            return None
        if len(scores) != self._count or not all(math.isfinite(score) for score in scores):
            self._reason = f"libvmaf scored {len(scores)} of {self._count} frames; VMAF is left out"
            return None
        return scores

    def _complaint(self) -> str | None:
        """The last words of ffmpeg on its error stream."""
        if self._process is not None:
            self._process.wait()
        if self._errors is None:
            return None
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        return f"ffmpeg could not compute VMAF: {lines[0]}" if lines else None


def vmaf(reference: Iterable[Frame], distorted: Iterable[Frame], frame_rate: Fraction, peak: int = 0xFF) -> Vmaf:
    """VMAF of every pair of frames (H, W, 3) u1 or u2 and its mean, or the reason why it could not be had.

    Frames are read once. A GsvcError says that the two sides have different numbers of them.
    """
    with VmafMeter(peak, frame_rate) as meter:
        for first, second in zip_longest(reference, distorted):
            if first is None or second is None:
                raise GsvcError("invalid", "the two videos have different numbers of frames; cut the longer one")
            meter.add(first, second)
        return meter.finish()


def _stretch(samples: Frame, peak: int, new_peak: int) -> NDArray[np.uint32]:
    """Samples of 0..peak on the scale 0..new_peak, rounded to nearest; at most 16 bits."""
    if peak == new_peak:
        return samples.astype(np.uint32)
    return (samples.astype(np.uint32) * np.uint32(new_peak) + np.uint32(peak // 2)) // np.uint32(peak)
