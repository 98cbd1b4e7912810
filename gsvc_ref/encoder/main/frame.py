"""One frame at a time in profile `main`, each against the reconstruction of the one before (closed loop).

What is asked for decides N and D, the splats and the step of a frame:

- At constant rate, an I-frame has N splats, and `quantizer_for` says which D goes with them.
- With a `quality` D is given, and the N of an I-frame is that for which the rule gives this D (`splats_for`).
- With `Settings.psnr` an I-frame has as few splats as reach it, with their D by the rule. A P-frame has the coarsest D
  that reaches it; if none does, the frame becomes an I-frame. Where I-frames miss it as well, it becomes one only if it
  would be MAX_DROP (1 dB) below the last I-frame (`is_missed`).

In the first two P-frames have the D of their I-frame; at constant rate it becomes finer where P-frames sink (`drift`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Final

import numpy as np

from gsvc_base.arrays import F4, Frame
from gsvc_base.portable import power
from gsvc_base.splats import Splats
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.header import MAIN
from gsvc_ref.encoder.drift import Drift
from gsvc_ref.encoder.encoded_frame import EncodedFrame, OnStage, worked_on_again
from gsvc_ref.encoder.held_quality import (
    DB_PER_STEP,
    ENOUGH,
    is_missed,
    search_quantizer,
    search_removals,
    search_splat_count,
    visibility,
)
from gsvc_ref.encoder.log import OFF, FrameLog, percent
from gsvc_ref.encoder.main.densities import choose_densities
from gsvc_ref.encoder.main.field import Field
from gsvc_ref.encoder.main.inter import PFrame, encode_inter
from gsvc_ref.encoder.main.intra import encode_intra, intra_evaluations, splats_for
from gsvc_ref.encoder.main.pixels import PIXEL_SPLATS, encode_pixels
from gsvc_ref.encoder.main.target import SQUARE_OF_8_BITS, Target
from gsvc_ref.encoder.motion import estimated_motion
from gsvc_ref.encoder.settings import MainSettings
from gsvc_ref.encoder.settings.common import MAX_SPLATS, PIXELS_PER_SPLAT
from gsvc_ref.encoder.stages import StageSeconds
from gsvc_ref.encoder.watched import watched_objectives
from gsvc_ref.main.codes import REMOVED, SIDES, MainCodes
from gsvc_ref.main.codes import Field as Motion
from gsvc_ref.main.frames import frame_body
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.main.layers import carried
from gsvc_ref.main.tables import QUANTIZERS, step_of
from gsvc_ref.metrics import psnr
from gsvc_ref.paper import FrameType
from gsvc_ref.rendering import Renderer
from gsvc_ref.training import psnr_of_loss

D_TRIES: Final = 3  # constant quality: the most values of D that are tried for an I-frame after the numbers of splats
P_TRIES: Final = 8  # the most that are tried for a P-frame
LOSSLESS_PSNR: Final = 200.0  # stands for that of a frame equal to its source, in dB; no other frame has so much

FALLEN_DB: Final = 1.0  # where the source stays equal, a P-frame this far below its I-frame is worked on again
CHUNK_BITS: Final = 56  # those of a layer's chunk around its body
CARRY_PRICE: Final = 0.24
"""Squared error that a bit is worth where a layer may be carried, in D^2.

It is twice the price elsewhere: what a carried frame leaves over is made good once, later. At 0.12 hardly any is.
"""

PASS_GAIN: Final = 0.3  # each further pass follows only if the last one gained more than this many dB


@dataclass(frozen=True)
class _Coded:
    """A frame in codes, with what a decoder makes of it."""

    codes: MainCodes
    state: MainState
    psnr: float  # in dB, at most LOSSLESS_PSNR
    bits: int  # of its body
    field: Field | None  # of a P-frame


class MainFrameEncoder:
    """Encodes frames in order; `corrects_drift` lets D become finer where P-frames sink, at constant rate."""

    def __init__(
        self, settings: MainSettings, width: int, height: int, bit_depth: int, *, corrects_drift: bool = True
    ) -> None:
        self.settings, self.bit_depth = settings, bit_depth
        self.state = MainState.initial(width, height)  # the decoder's, after the frames so far
        # The splats that an I-frame begins its search with, the most it may be given, and the most a frame may count.
        # The first is N until an I-frame with a quality or PSNR to hold, `decide`, or a search for a size sets it.
        self.intra_splats, self.most = settings.splat_count(width, height), settings.most_splats(width, height)
        self.room = settings.counted_splats(width, height)
        self.max_lane_exponent = settings.max_lane_exponent(width, height)
        self.lane_bits = 0  # what the frames since the last I-frame left of what lanes may cost
        # Whether each pixel may have a splat, in a picture of so few that it would have one splat by the usual share.
        self.has_pixel_splats = (
            settings.quality is None and settings.goal is None and self.most == width * height < PIXELS_PER_SPLAT
        )
        self.renderer = Renderer(width, height, precision=settings.precision, threads=settings.threads)
        self.inter = settings.inter  # with the effects that are switched on
        if settings.effects.motion == "off":
            self.inter = replace(self.inter, cells=())
        if settings.effects.gsa == "off":
            self.inter = replace(self.inter, new_share=0.0)
        self.field: Field | None = None  # of the frame before, if that is a P-frame
        self.quantizer = 0  # that of the next P-frame, or the first that is tried for it
        self.intra_bits = 0  # of the last I-frame: a P-frame that misses a PSNR with more ends the search over D
        self.picture_before: F4 | None = None  # (H, W, 3), the source of the frame before
        self.intra_psnr, self.last_psnr = 0.0, 0.0  # of the last I-frame and of the last frame, in dB
        # Whether the frame before is worse than its I-frame and was still becoming better, so that another pass over it
        # is worth it if the source stays the same.
        self.is_catching_up = False
        # Of a layer: the splats of the base and the layers below it in the next frame, and those of the layers above it
        # in the frame before. A P-frame is fitted to the picture with them all, those above moved by the optical flow,
        # so that this layer moves with those above it. If the base is a P-frame, its field is what the layer may take.
        self.below, self.above = Splats.empty(), Splats.empty()
        self.moves: Motion | None = None
        self.corrects_drift = corrects_drift and settings.psnr is None and settings.quality is None
        self._drift = Drift(settings.inter.fall, 0)

    def elements(self) -> dict[str, Any]:
        """The elements of the sequence header that the profile has."""
        return {"profile": MAIN, "max_lane_exponent": self.max_lane_exponent}

    @property
    def decides_first(self) -> bool:
        """Whether the first frame decides on the number of splats from which each I-frame begins its search."""
        settings = self.settings
        return settings.psnr is not None or (settings.quality is not None and settings.splats is None)

    def decided(self) -> tuple[int, ...]:
        """The number of splats from which each I-frame begins its search."""
        return (self.intra_splats,)

    def decide(self, decided: tuple[int, ...]) -> None:
        """Take what the first frame of the stream has decided, as `decided` said it."""
        (splats,) = decided
        self.intra_splats = min(max(1, splats), self.most)

    def as_written(self, codes: MainCodes, before: MainState) -> tuple[MainCodes, MainState, int]:
        """Codes in their lanes, the state after them, and about the bits of their body."""
        body, present = Writer(), codes.type == "I" or codes.quantizer != before.quantizer
        codes = replace(codes, quantizer_present=present, lane_exponent=0)
        made = frame_body(body, codes.type, before, self.max_lane_exponent, MAX_SPLATS, codes)
        bits, left = body.position, 0 if codes.type == "I" else self.lane_bits
        exponent = self.settings.lane_exponent(bits, made.symbols, left, self.max_lane_exponent)
        return replace(codes, lane_exponent=exponent), made.after, bits

    def for_group(self) -> "MainFrameEncoder":
        """An encoder for another group of pictures, which looks for numbers of splats from where this one has come."""
        state = self.state
        other = type(self)(self.settings, state.width, state.height, self.bit_depth, corrects_drift=self.corrects_drift)
        other.intra_splats, other.most, other.room = self.intra_splats, self.most, self.room
        return other

    def encode(self, frame: Frame, frame_type: FrameType, number: int, progress: OnStage) -> EncodedFrame:
        """Encode a frame (H, W, 3) u1 or u2; the next one is predicted from its reconstruction."""
        return self.encode_frame(MainFrame(self, frame, number, progress), frame_type)

    def encode_frame(self, work: "MainFrame", frame_type: FrameType) -> EncodedFrame:
        """As `encode`, of a frame of this encoder."""
        is_equal = frame_type == "R"
        is_again = is_equal and self.is_catching_up
        if is_again:
            frame_type = "P"
        result = {"I": work.intra, "P": work.inter, "R": work.repeat}[frame_type]()
        if is_again:
            result = worked_on_again(result)
        assert isinstance(result.state, MainState)
        self.state, self.picture_before = result.state, work.picture
        self._remember(result, is_equal)
        return result

    def _remember(self, result: EncodedFrame, is_equal: bool) -> None:
        """Note whether the next frame, if its source is equal, is worth another pass, and choose D for the next one."""
        if result.codes.type == "I":
            self.intra_psnr = result.psnr
            self._drift = Drift(self.settings.inter.fall, self.quantizer)
        elif result.codes.type == "P" and self.corrects_drift:
            self._drift = self._drift.after(result.psnr)
            self.quantizer = self._drift.following(self.quantizer)
        gained = result.codes.type == "P" and (not is_equal or result.psnr > self.last_psnr + PASS_GAIN)
        self.is_catching_up = self.settings.psnr is None and gained and result.psnr < self.intra_psnr - FALLEN_DB
        self.last_psnr = result.psnr


class MainFrame:
    """The work on one frame: what its steps share, and the time that each takes."""

    def __init__(self, encoder: MainFrameEncoder, frame: Frame, number: int, progress: OnStage) -> None:
        self.encoder, self.settings, self.frame = encoder, encoder.settings, frame
        self.number, self.progress = number, progress
        self.joint: Callable[[], MainCodes] | None = None  # gives the codes of an I-frame that is made with its layers
        self.state = encoder.state if encoder.moves is None else replace(encoder.state, inherited=encoder.moves)
        self.peak = (1 << encoder.bit_depth) - 1
        self.picture: F4 = frame.astype(np.float32) / np.float32(self.peak)  # (H, W, 3) f4
        self.seconds = StageSeconds()
        self.iterations = 0
        self.log = FrameLog()

    @cached_property
    def target(self) -> Target:
        """What the splats of an I-frame are fitted to."""
        return self.new_target(intra_evaluations(self.settings.intra))

    def new_target(self, evaluations: int) -> Target:
        """What splats are fitted to in about so many evaluations."""
        below, watch = self.encoder.below.to_array(), self._watch(evaluations)
        return Target(self.picture, below, on_evaluation=watch, **self.settings.computing)

    def repeat(self, reason: str | None = None) -> EncodedFrame:
        """An R-frame: nothing changes; `reason` is why a P-frame became one, None where it was to be one."""
        codes, state = MainCodes.repeated_frame(), self.encoder.state
        if reason is not None:
            self.log.add("frames", reason, done=False)
        with self.seconds.timed("check"):
            achieved = self._psnr_of(state)
        return EncodedFrame(codes, state, achieved, self.iterations, self.seconds, self.log.decisions, reason)

    def intra(self, reason: str | None = None) -> EncodedFrame:
        """An I-frame; `reason` is why a P-frame became one, None where it was to be one."""
        encoder, settings = self.encoder, self.settings
        with self.seconds.timed("intra"):
            if self.joint is not None:
                coded = self._decoded(self.joint())
            elif settings.psnr is not None:
                coded = self._held_intra(settings.psnr)
                if encoder.has_pixel_splats and coded.psnr < settings.psnr:
                    coded = max(coded, self._coded_pixels(), key=lambda one: one.psnr)
            elif encoder.has_pixel_splats:
                coded = self._coded_pixels()
            else:
                quantizer = None if settings.quality is None else QUANTIZERS - 1 - settings.quality
                if quantizer is not None and settings.splats is None:
                    encoder.intra_splats = splats_for(
                        self.target, quantizer, self.rng(), settings.intra, encoder.intra_splats, encoder.most
                    )
                coded = self._coded_intra(encoder.intra_splats, quantizer)
        if settings.psnr is not None:
            encoder.intra_splats = max(1, len(coded.state.values))
            encoder.intra_bits = coded.bits
        self.log.add("gsp", f"the {len(coded.state.values):,} splats that are worth their bits stay", done=True)
        if reason is not None:
            self.log.add("frames", f"an I-frame: {reason}", done=True)
        return self._finished(coded, reason)

    def inter(self) -> EncodedFrame:
        """A P-frame, or an I- or R-frame where that is better."""
        encoder, settings, state_before = self.encoder, self.settings, self.encoder.state
        if len(state_before.values) == 0:
            return self.intra("the frame before has no splats")
        if encoder.has_pixel_splats and settings.psnr is None:
            return self.intra(PIXEL_SPLATS)
        with self.seconds.timed("inter"):
            kept = None if encoder.moves is None else self._carried(encoder.moves)
            if kept is not None and self._is_enough(kept):
                return kept
            coded = (
                self._coded_inter(encoder.quantizer)
                if settings.psnr is None
                else search_quantizer(self._coded_inter, encoder.quantizer, settings.psnr, P_TRIES, encoder.intra_bits)
            )
        if kept is not None and settings.psnr is None and self._cost(kept.psnr) <= self._cost(coded.psnr, coded.bits):
            return kept
        if len(coded.codes.modes) + coded.codes.intra_count > encoder.room:
            return self.intra("no room for more splats in the level of the stream")
        if settings.psnr is not None and is_missed(coded.psnr, settings.psnr, encoder.intra_psnr):
            return self.intra("a P-frame does not reach the quality")
        if settings.effects.frames == "auto" and np.array_equal(coded.state.values, state_before.values):
            return self.repeat("no splat changes, so the frame before is repeated")
        self._log_inter(coded.codes)
        return self._finished(coded)

    def _carried(self, moves: Motion) -> EncodedFrame:
        """A layer that moves with the base, without a chunk."""
        state = carried(self.encoder.state, moves)
        achieved = self._psnr_of(state)
        reason = "moving with the base is worth more than the bits of a chunk"
        return EncodedFrame(
            MainCodes.repeated_frame(), state, achieved, self.iterations, self.seconds, reason=reason, carried=True
        )

    def _is_enough(self, kept: EncodedFrame) -> bool:
        """Whether a layer that is carried needs no look at others."""
        goal = self.settings.psnr
        return self._cost(kept.psnr) <= CHUNK_BITS if goal is None else kept.psnr >= goal

    def _cost(self, achieved: float, bits: int | None = None) -> float:
        """The squared error of a frame with this PSNR in dB, in what a bit is worth, and the bits of its chunk."""
        D, values = step_of(self.encoder.quantizer) / 16, 3 * self.frame.shape[0] * self.frame.shape[1]
        error = values * SQUARE_OF_8_BITS * power(10.0, -min(achieved, LOSSLESS_PSNR) / 10)
        return float(error / (CARRY_PRICE * D * D)) + (0 if bits is None else bits + CHUNK_BITS)

    def _coded_intra(self, splats: int, quantizer: int | None) -> _Coded:
        """An I-frame of about this number of splats."""
        return self._decoded(encode_intra(self.target, splats, self.rng(), quantizer, self.settings.intra))

    def _coded_pixels(self) -> _Coded:
        """An I-frame with a splat on each pixel."""
        return self._decoded(encode_pixels(self.picture, self.encoder.bit_depth))

    def rng(self) -> np.random.Generator:
        """Randomness of the frame: each try begins with the same draws."""
        return np.random.default_rng([self.settings.seed, self.number])

    def _held_intra(self, goal: float) -> _Coded:
        """An I-frame with the fewest splats, of the numbers that are tried, that reaches a PSNR; otherwise the best.

        If the result is still too good, its weakest splats go; where they do not suffice, D becomes coarser.
        """
        encoder = self.encoder
        by_count = partial(self._coded_intra, quantizer=None)
        number, whole = search_splat_count(by_count, encoder.intra_splats, encoder.most, goal)
        if not whole.psnr - goal > ENOUGH:
            return whole
        best = self._thinned(whole, goal)
        if best.psnr - goal <= ENOUGH:
            return best
        steps = max(1, round((whole.psnr - goal) / DB_PER_STEP))
        first = min(whole.codes.quantizer + steps, QUANTIZERS - 1)
        tries = {whole.codes.quantizer: whole}
        by_step = partial(self._coded_intra, number)
        return self._thinned(search_quantizer(by_step, first, goal, D_TRIES, tried=tries), goal)

    def _thinned(self, coded: _Coded, goal: float) -> _Coded:
        """An I-frame without as many of its weakest splats as it can spare for a PSNR that it has."""
        new, state = coded.codes.new, coded.state
        weakest = np.argsort(visibility(state.splats.to_array()), kind="stable")

        def without(count: int) -> _Coded:
            kept = new.take(np.sort(weakest[count:]))
            densities = choose_densities(kept, step_of(coded.codes.quantizer), state.width, state.height)
            return self._decoded(replace(coded.codes, new=kept, densities=densities))

        return search_removals(without, coded, len(weakest), goal)

    def _coded_inter(self, quantizer: int) -> _Coded:
        """A P-frame with a quantizer."""
        encoder, settings = self.encoder, self.settings
        assert encoder.picture_before is not None
        above = encoder.above.to_array()
        if len(above) and settings.effects.motion != "off":
            above[:, :2] += estimated_motion(encoder.picture_before, self.picture, above[:, :2])
        beside = np.concatenate([encoder.below.to_array(), above])
        splats = len(encoder.state.values) + len(beside)
        watch = self._watch(settings.inter.evaluations)
        objective, sampled = watched_objectives(self.picture, beside, splats, settings, watch)
        frame = PFrame(
            self.state, objective, sampled, encoder.picture_before, self.picture, quantizer, encoder.intra_splats,
            encoder.field,
        )  # fmt: skip
        coded = self._decoded(*encode_inter(frame, encoder.inter))
        if encoder.moves is None or coded.codes.motion_cell == 0:
            return coded
        other = self._decoded(*encode_inter(frame, replace(encoder.inter, cells=())))
        return min(coded, other, key=lambda one: self._cost(one.psnr, one.bits))

    def _decoded(self, codes: MainCodes, field: Field | None = None) -> _Coded:
        """The codes, in their lanes and with what a decoder makes of them."""
        codes, state, bits = self.encoder.as_written(codes, self.state)
        return _Coded(codes, state, min(self._psnr_of(state), LOSSLESS_PSNR), bits, field)

    def _psnr_of(self, state: MainState) -> float:
        """PSNR of a decoded frame, in dB."""
        splats = self.encoder.below.append(state.splats)
        return psnr(self.frame, self.encoder.renderer.frame(splats, self.encoder.bit_depth), self.peak)

    def _finished(self, coded: _Coded, reason: str | None = None) -> EncodedFrame:
        encoder = self.encoder
        encoder.field, encoder.quantizer = coded.field, coded.codes.quantizer
        left = 0 if coded.codes.type == "I" else encoder.lane_bits
        encoder.lane_bits = self.settings.lane_bits_left(coded.bits, left, coded.codes.lane_exponent)
        achieved = math.inf if coded.psnr == LOSSLESS_PSNR else coded.psnr
        return EncodedFrame(
            coded.codes, coded.state, achieved, self.iterations, self.seconds, self.log.decisions, reason
        )

    def _log_inter(self, codes: MainCodes) -> None:
        """Log what became of the splats of the frame before."""
        effects, log, new = self.settings.effects, self.log, codes.intra_count
        same, removed = float((codes.modes == 0).mean()), int((codes.modes == REMOVED).sum())
        regions = f"changing {percent(same)} of the splats is not worth its bits" if same else "every splat changes"
        log.add("regions", regions, done=not same)
        gsa = f"new splats that are worth their bits: {new:,}" if new else "no new splat is worth its bits"
        log.add("gsa", OFF if effects.gsa == "off" else gsa, done=new > 0)
        gsp = f"splats removed, since they left the frame: {removed:,}" if removed else "no splat has left the frame"
        log.add("gsp", gsp, done=removed > 0)
        cell = SIDES[codes.motion_cell]
        motion = f"a field in cells of {cell} pixels moves the splats" if cell else "no field is worth its bits"
        log.add("motion", OFF if effects.motion == "off" else motion, done=cell > 0)

    def _watch(self, count: int) -> Callable[[float], None]:
        """What is called after each of about `count` evaluations."""
        done = 0

        def evaluated(loss: float) -> None:
            nonlocal done
            self.iterations += 1
            done = done % count + 1
            self.progress("encode", done, count, psnr_of_loss(loss))

        return evaluated
