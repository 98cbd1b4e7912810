"""Passes over a clip that is encoded several times: the source read again, temporary files, the stream that is kept."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import replace
from shutil import copyfileobj
from tempfile import TemporaryFile
from typing import IO, cast

from gsvc_base.errors import UsageError
from gsvc_base.files import opened_output
from gsvc_base.portable import log2, power
from gsvc_ref.encoder.report import EncodeReport, IncompleteEncodeError, OnProgress, Progress
from gsvc_ref.encoder.settings import MIN_PIXELS_PER_SPLAT, Settings
from gsvc_ref.encoder.setup import CoderMaker, coder_of
from gsvc_ref.encoder.source_and_target import Target
from gsvc_ref.video import VideoReader
from gsvc_tools.jobs.encode_once import encode_once
from gsvc_tools.libvmaf import MIN_SIDE


class Passes:
    """The passes over a clip: what they share.

    `low` and `high` are limits of log2 of the number of splats.
    """

    def __init__(
        self,
        opened: Callable[[], VideoReader],
        target: Target,
        settings: Settings,  # with their goal; `base` without it
        jobs: int,
        executor: Executor | None,
        progress: OnProgress | None,
    ) -> None:
        self._opened, self.target, self.settings = opened, target, settings
        self._jobs, self._executor, self._progress = jobs, executor, progress
        self.begin = time.perf_counter()  # when the first one began, by `time.perf_counter`
        self.fault: IncompleteEncodeError | None = None  # what ended the last pass early, if anything did
        self.base = settings.with_(bitrate=None, size=None, mean_psnr=None, vmaf=None)
        with opened() as reader:
            self.format = reader.format
        if settings.vmaf is not None and min(self.format.width, self.format.height) < MIN_SIDE:
            raise UsageError(f"a VMAF cannot be held: VMAF needs frames of at least {MIN_SIDE}x{MIN_SIDE} pixels")
        pixels = self.format.width * self.format.height
        self.most = max(1, pixels // MIN_PIXELS_PER_SPLAT) if settings.splats is None else settings.splats
        self.base.with_(splats=self.most).splat_count(self.format.width, self.format.height)  # refuses too many
        self.low, self.high = 0.0, float(log2(self.most))

    def frames(self) -> VideoReader:
        """A new reader of the source."""
        return self._opened()

    def run(
        self, reader: VideoReader, target: Target, settings: Settings, pass_name: str, make_coder: CoderMaker = coder_of
    ) -> EncodeReport:
        """Encode once; a fault of the source ends it early, as it will end the last pass."""

        def show(progress: Progress) -> None:
            if self._progress is not None:
                elapsed = time.perf_counter() - self.begin
                self._progress(replace(progress, step=pass_name, elapsed_s=elapsed))

        with reader:
            try:
                return encode_once(
                    reader, target, settings, None, self._jobs, self._executor, show if self._progress else None,
                    make_coder=make_coder,
                )  # fmt: skip
            except IncompleteEncodeError as error:
                self.fault = error
                return error.report

    def run_to_file(
        self,
        reader: VideoReader,
        file: IO[bytes],
        settings: Settings,
        pass_name: str,
        make_coder: CoderMaker = coder_of,
    ) -> EncodeReport:
        """Encode once to a temporary file.

        A KeyboardInterrupt passes through.
        """
        report = self.run(reader, cast("Target", file), settings, pass_name, make_coder)
        if report.interrupted:
            raise KeyboardInterrupt
        return report

    def put(self, file: IO[bytes]) -> None:
        """Put a stream from a temporary file in the target's place."""
        file.seek(0)
        with opened_output(self.target) as target:
            copyfileobj(file, target)


def splats_of(octave: float) -> int:
    """The number of splats with this logarithm to base 2, at least 1."""
    return max(1, round(float(power(2.0, octave))))


@contextmanager
def temporary_files() -> Iterator[Callable[[], IO[bytes]]]:
    """What opens temporary files, which are closed and removed at the end of the block."""
    files: list[IO[bytes]] = []

    def new() -> IO[bytes]:
        files.append(cast("IO[bytes]", TemporaryFile()))  # noqa: SIM115 (closed below)
        return files[-1]

    try:
        yield new
    finally:
        for file in files:
            file.close()
