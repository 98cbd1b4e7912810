"""Encoding frame after frame in profile `main`, each against the reconstruction of the one before (closed loop)."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Final

import numpy as np

from gsvc_ref.arrays import F4, Frame
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.header import MAIN
from gsvc_ref.encoder.frame import EncodedFrame, OnStage
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.main_encoder.inter import InterEncoder, InterSettings, PFrame
from gsvc_ref.main_encoder.intra import IntraSettings, encode_intra
from gsvc_ref.main_profile.codes import MainCodes
from gsvc_ref.main_profile.frames import MainState, frame_body
from gsvc_ref.main_profile.tables import QUANTIZERS
from gsvc_ref.metrics import psnr
from gsvc_ref.reconstruction import FrameType
from gsvc_ref.rendering import Objective, Renderer

MOST_SPLATS: Final = max(level.splats for level in LEVELS.values())
"""No level allows more splats in a frame."""

COARSER: Final = 0
"""By how many steps of an eighth of an octave D is greater in P-frames than in the I-frame before them."""


class MainFrameEncoder:
    """Encodes frames in order.

    Parameters
    ----------
    settings
        All settings.
    width, height, bit_depth
        The size of the frames in pixels, and the bits of a sample.

    Attributes
    ----------
    settings
        The settings given.
    state
        The decoder's state after the frames so far.
    """

    def __init__(self, settings: Settings, width: int, height: int, bit_depth: int) -> None:
        self.settings, self.bit_depth = settings, bit_depth
        self.state = MainState.initial(width, height)
        self._total = settings.splat_count(width, height)
        self._renderer = Renderer(width, height, precision=settings.precision, threads=settings.threads)
        self._inter = InterEncoder(InterSettings.quick())
        self._quantizer = 0
        self._before: F4 | None = None

    def elements(self) -> dict[str, Any]:
        """The elements of the sequence header that the profile has."""
        return {"profile": MAIN, "lane_count": self.settings.lane_count}

    def encode(self, frame: Frame, frame_type: FrameType, number: int, progress: OnStage) -> EncodedFrame:
        """Encode a frame (H, W, 3) u1 or u2; the next one is predicted from its reconstruction."""
        peak = (1 << self.bit_depth) - 1
        picture: F4 = frame.astype(np.float32) / np.float32(peak)
        seconds: dict[str, float] = {}
        with _timed(seconds, "fit"):
            progress("fit", 0, 1, None)
            if self._before is not None and np.array_equal(picture, self._before):
                codes = MainCodes.repeated_frame()
            else:
                codes = self._intra(picture, number) if frame_type == "I" else self._predicted(picture)
        with _timed(seconds, "check"):
            if codes.type != "R":
                self.state = frame_body(Writer(), codes.type, self.state, 64, MOST_SPLATS, codes).after
            self._before = picture
            decoded = self._renderer.frame(self.state.splats, self.bit_depth)
            quality = psnr(frame, decoded, peak)
        return EncodedFrame(codes, self.state, quality, 0, seconds)

    def _intra(self, picture: F4, number: int) -> MainCodes:
        rng = np.random.default_rng([self.settings.seed, number])
        threads, precision = self.settings.threads, self.settings.precision
        found = encode_intra(
            picture, self._total, rng, settings=IntraSettings.quick(), threads=threads, precision=precision
        )
        self._quantizer, self._inter.past = found.codes.quantizer, None
        return self._with_lanes(found.codes)

    def _predicted(self, picture: F4) -> MainCodes:
        assert self._before is not None
        objective = Objective(picture, self.settings.threads, precision=self.settings.precision)
        quantizer = min(self._quantizer + COARSER, QUANTIZERS - 1)
        codes = self._inter.encode(PFrame(self.state, objective, self._before, picture, quantizer, self._total))
        return self._with_lanes(codes)

    def _with_lanes(self, codes: MainCodes) -> MainCodes:
        """The codes in as many lanes as the stream allows, a power of two."""
        return replace(codes, lane_exponent=self.settings.lane_count.bit_length() - 1)


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    begin = time.perf_counter()
    yield
    seconds[stage] = seconds.get(stage, 0.0) + time.perf_counter() - begin
