"""One frame at a time, as in the paper's algorithm 1: start, fit, quantise (`quantised`), reconstruct."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, Frame
from gsvc_ref.encoder.blocks import block_errors, errors_left
from gsvc_ref.encoder.encoded_frame import EncodedFrame, OnStage, worked_on_again
from gsvc_ref.encoder.frame_settings import FrameSettings
from gsvc_ref.encoder.held_quality import (
    ENOUGH,
    FIRST_MARGIN,
    coarser,
    fewest_splats,
    held,
    is_missed,
    most_spared,
)
from gsvc_ref.encoder.log import FrameLog
from gsvc_ref.encoder.prediction import SAME_RATIO, Past, PFrame, predict
from gsvc_ref.encoder.quantizer_choice import (
    chosen_quantizer,
    quantizer_fields,
    with_best_quantizer,
    with_quantizer,
)
from gsvc_ref.encoder.rate import hold_quality, visibility
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.encoder.thinning import thinned
from gsvc_ref.metrics import psnr
from gsvc_ref.paper import FrameCodes, FrameType, State, reconstruct
from gsvc_ref.rendering import Objective, Renderer
from gsvc_ref.training import (
    KEPT_WEIGHT,
    NEW,
    NEW_WEIGHT,
    AnyFit,
    DescentSettings,
    OnIteration,
    Population,
    fit,
    image_start,
    loss_of_psnr,
    psnr_of_loss,
    quantised,
    random_splats,
    uniform_numbers,
)
from gsvc_ref.training.coarse import Sizes
from gsvc_ref.training.settings import MOST_THRESHOLD

BEHIND: Final = 1.25
"""A P-frame with so many times the error of its I-frame, 1 dB, is worked on again where the source stays the same..."""

GAIN: Final = 0.9
"""...as long as each pass leaves at most this part of the error that it began with, 0.5 dB."""

FEWER: Final = 1 / 3
"""The fraction of its iterations that a P-frame gets if it is predicted about as well as the frame before was left."""

LONGER: Final = 5 / 3
"""How many times the evaluations a P-frame may take if the frame before was so far behind, each for half of the gain.
On 30 frames of `bikes` from frame 150 on, N = 1000, the last third is 1.5 dB below the first in place of 2.1."""


class FrameEncoder:
    """Encodes frames in order, each against the reconstruction of the one before (closed loop).

    Parameters
    ----------
    settings
        All settings.
    width, height, bit_depth
        The size of the frames in pixels, and the bits of a sample.

    Attributes
    ----------
    settings
        The settings given; from the first frame on with the quantisers that were chosen for the stream.
    state
        The decoder's state after the frames so far.
    total, most
        The number of splats that a frame is meant to have, and the maximum that it may get.
    margin
        Constant quality: the dB that quantisation took from the last frame.
    level
        PSNR of the last I-frame, in dB.
    chosen_for
        The number of splats for which quantisers were chosen last.
    """

    def __init__(self, settings: Settings, width: int, height: int, bit_depth: int) -> None:
        self.settings, self.bit_depth = settings, bit_depth
        self.state = State.initial(width, height)
        self.past: Past | None = None
        self.is_first = True
        self.renderer = Renderer(width, height, precision=settings.precision, threads=settings.threads)
        self.total = settings.splat_count(width, height)
        self.most = settings.most_splats(width, height)
        self.margin, self.level, self.chosen_for = FIRST_MARGIN, math.inf, 0

    def elements(self) -> dict[str, Any]:
        """The elements of the sequence header that belong to the profile."""
        return quantizer_fields(self.settings)

    @property
    def looks_for_splats(self) -> bool:
        """Whether I-frames look for the number of splats that holds a quality."""
        return self.settings.psnr is not None and self.settings.intra.fit.growth is not None

    @property
    def decides_first(self) -> bool:
        """Whether the first frame chooses quantisers for the stream, or from which number of splats searches begin."""
        return bool(self.settings.intra.candidates) or self.looks_for_splats

    def decided(self) -> tuple[int, ...]:
        """The quantisers (b, M, B), if the first frame chooses them, and N, if I-frames look for it."""
        quantizer = chosen_quantizer(self.settings) if self.settings.intra.candidates else ()
        return (*quantizer, self.total) if self.looks_for_splats else quantizer

    def decide(self, decided: tuple[int, ...]) -> None:
        """Take what the first frame of the stream has decided, as `decided` said it."""
        quantizer = decided
        if self.looks_for_splats:
            quantizer, self.total = decided[:-1], min(max(1, decided[-1]), self.most)
        if self.settings.intra.candidates:
            self.settings = with_quantizer(self.settings, quantizer)
        self.is_first = False

    def for_group(self) -> "FrameEncoder":
        """An encoder for another group of pictures, with the quantisers and N that were chosen."""
        other = type(self)(self.settings, self.state.width, self.state.height, self.bit_depth)
        other.is_first = self.is_first
        other.total = self.total
        return other

    def encode(self, frame: Frame, frame_type: FrameType, number: int, progress: OnStage) -> EncodedFrame:
        """Encode a frame (H, W, 3) u1 or u2; the next one is predicted from its reconstruction."""
        work = _FrameWork(self, frame, number, progress)
        is_again = self.past is not None and self.past.is_catching_up and frame_type == "R"
        if is_again:
            frame_type = "P"
        elif self.past is not None:
            self.past = replace(self.past, is_catching_up=False)
        result = {"I": work.intra, "P": work.inter, "R": work.repeat}[frame_type]()
        if is_again:
            result = worked_on_again(result)
        self.past = work.remembered(result)
        assert isinstance(result.state, State)
        self.state, self.is_first = result.state, False
        return result


class _FrameWork:
    """The work on one frame: the objects that its steps share, and the time that each takes."""

    def __init__(self, encoder: FrameEncoder, frame: Frame, number: int, progress: OnStage) -> None:
        self.encoder, self.settings = encoder, encoder.settings
        self.frame, self.seed, self.progress = frame, [encoder.settings.seed, number], progress
        self.rng = np.random.default_rng(self.seed)
        self.before, self.total, self.bit_depth = encoder.state, encoder.total, encoder.bit_depth
        self.candidates = encoder.settings
        self.settings_of: dict[int, Settings] = {}  # with the quantisers of each number of splats that was tried
        self.height, self.width = frame.shape[:2]
        self.peak = (1 << encoder.bit_depth) - 1
        self.picture: F4 = frame.astype(np.float32) / np.float32(self.peak)  # (H, W, 3) f4
        threads, precision = self.settings.threads, self.settings.precision
        self.objective = Objective(self.picture, threads, precision=precision)
        self.sizes = Sizes(self.picture, threads, precision=precision, full=self.objective)
        self.seconds: dict[str, float] = {}
        self.iterations = 0
        self.log = FrameLog()
        self.worse: NDArray[np.bool_] | None = None  # (rows, columns) of blocks, as of Prediction
        self.predicted_error = 0.0

    def remembered(self, result: EncodedFrame) -> Past:
        """The past of the next frame."""
        past = self.encoder.past
        if result.codes.type == "R" and past is not None:
            return Past(self.picture, past.left, past.level)
        self.objective.loss(result.state.splats.to_array())
        errors = block_errors(self.objective.residual())
        left = errors_left(errors, self.height, self.width)
        if past is not None and self.worse is not None and self.settings.psnr is None:
            left = np.where(self.worse, left, past.left)  # slow changes add up until they count
        if past is None or result.codes.type == "I":
            return Past(self.picture, left, float(left.sum()))
        error = float(errors.sum())
        is_behind = self.settings.psnr is None and error > BEHIND * past.level
        return Past(self.picture, left, past.level, is_behind and error < GAIN * self.predicted_error)

    def repeat(self) -> EncodedFrame:
        """An R-frame: nothing changes."""
        return self._finish(FrameCodes.repeated_frame(), self.before)

    def intra(self, reason: str | None = None) -> EncodedFrame:
        """An I-frame: fit from scratch, then quantise; with a quality to hold as few splats as reach it."""
        encoder, psnr = self.encoder, self.settings.psnr
        if psnr is None or not encoder.looks_for_splats:
            frame = self._intra(encoder.total)
        else:
            encoder.total, frame = fewest_splats(self._tried, min(encoder.total, encoder.most), encoder.most, psnr)
            encoder.settings = self.settings = self.settings_of[encoder.total]
            frame = self._thinned(frame, self.before.forget(), psnr)
        encoder.level = frame.psnr
        return replace(frame, reason=reason)

    def _tried(self, total: int) -> EncodedFrame:
        """An I-frame of a number of splats; each begins with the same draws."""
        self.rng = np.random.default_rng(self.seed)
        frame = self._intra(total)
        self.settings_of[total] = self.settings
        return frame

    def _intra(self, total: int) -> EncodedFrame:
        """An I-frame of a number of splats."""
        settings = self.settings.intra
        fit_settings = self.settings.pruned(settings.fit)
        with self._timed("start"):
            count = settings.fit.growth.start(total) if settings.fit.growth else total
            if settings.start == "image":
                splats, weight = image_start(self.picture, count, self.rng), KEPT_WEIGHT
            else:
                splats = random_splats(uniform_numbers(count, self.rng), self.width, self.height)
                weight = KEPT_WEIGHT if fit_settings.pruning is None else NEW_WEIGHT  # w is learnt only for pruning
            population = Population(splats, weight, np.full(count, NEW, np.int64), settings.fit)
        if fit_settings.pruning is not None:
            pruned = sum(fit_settings.pruning.counts(total, fit_settings.iterations).values())
            self.log.add("gsp", f"{pruned:,} splats removed during the fit", done=True)
        return self._encode(population, replace(settings, fit=fit_settings), self.before.forget(), total)

    def inter(self) -> EncodedFrame:
        """A P-frame: begin with the decoded splats of the frame before, add, prune, and code the difference to them."""
        settings, effects, past = self.settings.inter, self.settings.effects, self.encoder.past
        goal = self.settings.psnr
        assert past is not None
        if goal is not None and effects.frames == "auto" and (repeated := self.repeat()).psnr >= goal:
            self.log.add("frames", "the frame before has the quality", done=False, saved=_steps(settings))
            return replace(repeated, decisions=self.log.decisions)
        with self._timed("start"):
            reference = self.before.splats
            total = self.total if self.settings.psnr is None else len(reference)
            frame = PFrame(
                self.settings, self.picture, self.objective, reference, past, total, self.encoder.most, self.rng,
                self.sizes,
            )  # fmt: skip
            prediction = predict(frame, self.log)
            self.worse, self.predicted_error = prediction.worse, prediction.error
        if effects.frames == "auto" and self.settings.psnr is None:
            if prediction.is_static:
                reason = "all splats are static, so the frame before is repeated"
                self.log.add("frames", reason, done=False, saved=_steps(settings))
                return self.repeat()
            if (ratio := prediction.error_ratio) <= SAME_RATIO:
                less = fewer(replace(settings, fit=prediction.fit))
                reason = f"fewer iterations: predicted with {ratio:.2f} times the error of the frame before"
                self.log.add("frames", reason, done=True, saved=_steps(settings) - _steps(less))
                return self._encode(prediction.population, less, self.before, total)
        behind = float(past.left.sum()) > BEHIND * past.level
        fit_settings = longer(prediction.fit) if behind else prediction.fit
        result = self._encode(prediction.population, replace(settings, fit=fit_settings), self.before, total)
        if goal is not None and is_missed(result.psnr, goal, self.encoder.level):
            self.log = FrameLog()
            return self.intra("a P-frame does not reach the quality")
        return result

    def _encode(self, population: Population, settings: FrameSettings, before: State, total: int) -> EncodedFrame:
        """Fit and quantise; with a quality to hold, until the decoded frame holds it."""
        with self._timed("fit"):
            _, done = fit(
                population, self.objective, settings.fit, self.rng, total=total, sizes=self.sizes,
                on_iteration=self._report("fit"),
            )  # fmt: skip
            self.iterations += done
        if self.encoder.is_first and not self.encoder.chosen_for / 2 < total < 2 * self.encoder.chosen_for:
            self.encoder.chosen_for = total
            with self._timed("choose"):
                self.encoder.settings = self.settings = with_best_quantizer(
                    population, self.objective, self.candidates, before, [self.settings.seed]
                )
        if self.settings.psnr is None or settings.fit.growth is not None:
            return self._finish(*self._quantize(population, settings, before))
        return self._held(population, settings, before, self.settings.psnr)

    def _held(self, population: Population, settings: FrameSettings, before: State, goal: float) -> EncodedFrame:
        """The frame of fitted splats that holds a quality: some go or come, and changes need be worth more or less."""
        encoder, fitted, may_prune = self.encoder, len(population), self.settings.effects.gsp != "off"

        def change(aim: float) -> int:
            with self._timed("rate"):
                done = hold_quality(
                    population, self.objective, loss_of_psnr(aim), encoder.most, settings.short_fit, self.rng,
                    self._report("rate"), may_prune=may_prune,
                )  # fmt: skip
            self.iterations += done
            return done

        def code() -> tuple[EncodedFrame, float]:
            frame = self._finish(*self._quantize(population, settings, before))
            return frame, psnr_of_loss(self.objective.loss(population.parameters())) - frame.psnr

        frame, encoder.margin = held(change, code, goal, encoder.margin)
        if frame.codes.type == "P" and self.settings.inter.quantizer.static_threshold > 0:
            frame = coarser(
                lambda scale: self._finish(*self._quantize(population, settings, before, scale)), frame, goal
            )  # fmt: skip
        if may_prune:
            frame = self._thinned(frame, before, goal)
        if self.settings.effects.gsp == "auto":
            fewer_splats = fitted - len(frame.state.splats)
            spare = f"{fewer_splats:,} splats fewer hold the quality"
            self.log.add(
                "gsp", spare if fewer_splats > 0 else "the quality has nothing to spare", done=fewer_splats > 0
            )
        return replace(frame, iterations=self.iterations, decisions=self.log.decisions)

    def _thinned(self, frame: EncodedFrame, before: State, goal: float) -> EncodedFrame:
        """A frame without as many of its weakest splats as it can spare for a PSNR, if that is more than it needs."""
        if not frame.psnr - goal > ENOUGH:
            return replace(frame, iterations=self.iterations, decisions=self.log.decisions)
        codes = frame.codes
        assert isinstance(codes, FrameCodes)
        weakest = np.argsort(visibility(frame.state.splats.to_array()), kind="stable")

        def without(count: int) -> EncodedFrame:
            kept = np.ones(len(weakest), np.bool_)
            kept[weakest[:count]] = False
            fewer = thinned(codes, kept)
            return self._finish(fewer, reconstruct(fewer, before))

        return most_spared(without, frame, len(weakest), goal)

    def _quantize(
        self, population: Population, settings: FrameSettings, before: State, scale: float = 1.0
    ) -> tuple[FrameCodes, State]:
        """Codes; a change must be worth `scale` times what the settings say."""
        with self._timed("quantize"):
            intra, inter = self.settings.intra.quantizer, self.settings.inter.quantizer
            inter = inter.with_(static_threshold=min(scale * inter.static_threshold, MOST_THRESHOLD))
            codes, state, done = quantised(
                population, self.objective, intra, inter, before, self.rng, settings.tune, self._report("quantize")
            )
            self.iterations += done
            return codes, state

    def _finish(self, codes: FrameCodes, state: State) -> EncodedFrame:
        with self._timed("check"):
            decoded = self.encoder.renderer.frame(state.splats, self.bit_depth)
            quality = psnr(self.frame, decoded, self.peak)
        return EncodedFrame(codes, state, quality, self.iterations, self.seconds, self.log.decisions)

    def _report(self, stage: str) -> OnIteration:
        return lambda done, iterations, loss: self.progress(stage, done, iterations, psnr_of_loss(loss))

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        begin = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begin


def _steps(settings: FrameSettings) -> int:
    """The iterations of fit and quantisation."""
    return settings.fit.iterations + settings.tune.iterations


def fewer(settings: FrameSettings) -> FrameSettings:
    """The settings with a part of the iterations."""
    fit, tune = settings.fit, settings.tune
    return replace(
        settings, fit=fit.with_(iterations=_part(fit.iterations)), tune=tune.with_(iterations=_part(tune.iterations))
    )


def longer(fit_settings: AnyFit) -> AnyFit:
    """The settings of a fit that goes on for longer and for less gain, if it is one by L-BFGS."""
    if not isinstance(fit_settings, DescentSettings):
        return fit_settings
    return fit_settings.with_(
        iterations=round(LONGER * fit_settings.iterations), least_gain=fit_settings.least_gain / 2
    )  # fmt: skip


def _part(iterations: int) -> int:
    return max(1, round(FEWER * iterations))
