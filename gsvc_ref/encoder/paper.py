"""One frame at a time in profile `paper`, as in the paper's algorithm 1: start, fit, prune, augment, fine-tune.

`_PaperFrame` has a method for each type of frame, and then the steps in this order. Preset `paper` fits as the paper
does (`gsvc_ref.training`), preset `quick` by L-BFGS (`quick`); all else is the same for both.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from gsvc_base.arrays import F4, Frame
from gsvc_base.splats import Splats
from gsvc_ref.encoder.encoded_frame import EncodedFrame, OnStage
from gsvc_ref.encoder.held_quality import (
    BEST,
    ENOUGH,
    is_missed,
    search_removals,
    search_splat_count,
    search_threshold,
    visibility,
)
from gsvc_ref.encoder.log import FrameLog
from gsvc_ref.encoder.main.pixels import PIXEL_SPLATS, pixel_splats
from gsvc_ref.encoder.main.target import Target
from gsvc_ref.encoder.prediction import exchange_counts, moved_along_flow
from gsvc_ref.encoder.quick import exchanged, grown, refitted
from gsvc_ref.encoder.settings import PaperSettings
from gsvc_ref.encoder.settings.common import PIXELS_PER_SPLAT
from gsvc_ref.encoder.settings.paper import FrameSettings, QuickFit
from gsvc_ref.encoder.stages import StageSeconds
from gsvc_ref.metrics import psnr
from gsvc_ref.paper import FrameCodes, FrameType, State
from gsvc_ref.rendering import Objective, Renderer
from gsvc_ref.training import (
    KEPT_WEIGHT,
    NEW,
    NEW_WEIGHT,
    BlockSettings,
    FitSettings,
    FrameQuantizer,
    OnIteration,
    Population,
    fine_tune,
    fit,
    psnr_of_loss,
    random_splats,
    uniform_numbers,
)
from gsvc_ref.training.settings import MAX_THRESHOLD


class FrameEncoder:
    """Encodes frames in order, each against the reconstruction of the one before (closed loop)."""

    def __init__(self, settings: PaperSettings, width: int, height: int, bit_depth: int) -> None:
        self.settings, self.bit_depth = settings, bit_depth
        self.state = State.initial(width, height)
        self.renderer = Renderer(width, height, precision=settings.precision, threads=settings.threads)
        # The splats that an I-frame begins with are N until one with a PSNR, `decide` or a search for a size sets it.
        self.intra_splats, self.most = settings.splat_count(width, height), settings.most_splats(width, height)
        self.intra_psnr = self.last_psnr = math.inf
        self.picture_before: F4 | None = None  # (H, W, 3), the source of the frame before

    def elements(self) -> dict[str, Any]:
        """The elements of the sequence header that belong to the profile."""
        return self.settings.quantizer_elements()

    @property
    def decides_first(self) -> bool:
        """Whether the first frame decides from which number of splats the search of other I-frames begins."""
        return self.settings.psnr is not None

    def decided(self) -> tuple[int, ...]:
        """That number."""
        return (self.intra_splats,)

    def decide(self, decided: tuple[int, ...]) -> None:
        """Take what the first frame of the stream has decided, as `decided` said it."""
        (splats,) = decided
        self.intra_splats = min(max(1, splats), self.most)

    def for_group(self) -> "FrameEncoder":
        """An encoder for another group of pictures, whose search begins with the number of splats of this one."""
        other = type(self)(self.settings, self.state.width, self.state.height, self.bit_depth)
        other.intra_splats = self.intra_splats
        return other

    def encode(self, frame: Frame, frame_type: FrameType, number: int, progress: OnStage) -> EncodedFrame:
        """Encode a frame (H, W, 3) u1 or u2; the next one is predicted from its reconstruction."""
        work = _PaperFrame(self, frame, number, progress)
        result = {"I": work.intra, "P": work.inter, "R": work.repeat}[frame_type]()
        assert isinstance(result.state, State)
        self.state, self.picture_before, self.last_psnr = result.state, work.picture, result.psnr
        if result.codes.type == "I":
            self.intra_psnr = result.psnr
        return result


class _PaperFrame:
    """The work on one frame: what its steps share, and the time that each takes."""

    def __init__(self, encoder: FrameEncoder, frame: Frame, number: int, progress: OnStage) -> None:
        self.encoder, self.settings, self.state_before = encoder, encoder.settings, encoder.state
        self.frame, self.number, self.progress = frame, number, progress
        self.rng = np.random.default_rng([self.settings.seed, number])
        self.height, self.width = frame.shape[:2]
        self.peak = (1 << encoder.bit_depth) - 1
        self.picture: F4 = frame.astype(np.float32) / np.float32(self.peak)  # (H, W, 3) f4
        self.objective = Objective(self.picture, **self.settings.computing)
        self.seconds = StageSeconds()
        self.iterations = 0
        self.log = FrameLog()

    # ---- the types of frames ----
    def repeat(self) -> EncodedFrame:
        """An R-frame: nothing changes."""
        return self._reconstructed(FrameCodes.repeated_frame(), self.state_before)

    def intra(self, reason: str | None = None) -> EncodedFrame:
        """An I-frame."""
        goal, splats = self.settings.psnr, self.encoder.intra_splats
        if reason is not None:
            self.log.add("frames", f"an I-frame: {reason}", done=True)
        frame = self._coded_intra(self._fitted_intra(splats)) if goal is None else self._held_intra(goal)
        return replace(frame, iterations=self.iterations, reason=reason)

    def inter(self) -> EncodedFrame:
        """A P-frame; for a PSNR that it does not reach an I-frame, and an R-frame where nothing needs to change."""
        goal = self.settings.psnr
        if goal is None and self._has_pixel_splats(self.encoder.intra_splats):
            return self.intra(PIXEL_SPLATS)
        if goal is None:
            return self._coded_inter(self._fitted_inter(self.encoder.intra_splats))
        if self.settings.effects.frames == "auto" and (repeated := self.repeat()).psnr >= goal:
            reason = "the frame before has the quality"
            self.log.add("frames", reason, done=False, saved=self.settings.inter.iterations)
            return replace(repeated, decisions=self.log.decisions, reason=reason)
        frame = self._held_inter(goal)
        if is_missed(frame.psnr, goal, self.encoder.intra_psnr):
            self.log = FrameLog()
            return self.intra("a P-frame does not reach the quality")
        return replace(frame, iterations=self.iterations)

    def _held_intra(self, goal: float) -> EncodedFrame:
        """The I-frame with the fewest splats, of the numbers that are tried, that reaches a PSNR."""
        encoder, fitted = self.encoder, dict[int, Population]()

        def tried(total: int) -> EncodedFrame:
            fitted[total] = self._fitted_intra(total)
            return self._coded_intra(fitted[total])

        first = min(encoder.intra_splats, encoder.most)
        encoder.intra_splats, frame = search_splat_count(tried, first, encoder.most, goal)
        if frame.psnr - goal <= ENOUGH:
            return frame
        parameters = fitted[encoder.intra_splats].parameters()
        weakest = np.argsort(visibility(parameters), kind="stable")

        def without(count: int) -> EncodedFrame:
            return self._coded_intra(_new_population(parameters[np.sort(weakest[count:])]))

        return search_removals(without, frame, len(parameters), goal)

    def _held_inter(self, goal: float) -> EncodedFrame:
        """The P-frame with the fewest splats of those tried that reaches a PSNR, and then with the fewest changes."""
        encoder, fitted = self.encoder, dict[int, Population]()

        def tried(total: int) -> EncodedFrame:
            fitted[total] = self._fitted_inter(total)
            return self._coded_inter(fitted[total])

        total, frame = search_splat_count(tried, min(len(self.state_before.splats), encoder.most), encoder.most, goal)
        if self.settings.inter.quantizer.static_threshold == 0:
            return frame
        return search_threshold(lambda scale: self._coded_inter(fitted[total], scale), frame, goal)

    # ---- start, fit and prune (I) ----
    def _fitted_intra(self, total: int) -> Population:
        """The splats of an I-frame of N splats; each number that is tried begins with the same draws."""
        self.rng = np.random.default_rng([self.settings.seed, self.number])
        settings = self.settings.intra.fit
        if self._has_pixel_splats(total):
            return _new_population(pixel_splats(self.picture, self.encoder.bit_depth))
        if isinstance(settings, QuickFit):
            with self.seconds.timed("fit"):
                return _new_population(grown(self._target(settings), total, settings.iterations, self.rng))
        settings = self._with_gsp(settings)
        start = random_splats(uniform_numbers(total, self.rng), self.width, self.height)
        weight = KEPT_WEIGHT if settings.pruning is None else NEW_WEIGHT  # w is learnt only for pruning
        population = self._fitted(
            Population(start, weight, np.full(total, NEW, np.int64), settings.optimizer), settings
        )
        if settings.pruning is not None:
            self.log.add("gsp", f"{total - len(population):,} splats removed during the fit", done=True)
        return population

    def _has_pixel_splats(self, total: int) -> bool:
        """Whether each of a few pixels has a splat, so that there is nothing for preset `quick` to search."""
        is_quick = isinstance(self.settings.intra.fit, QuickFit)
        return is_quick and total == self.width * self.height < PIXELS_PER_SPLAT

    # ---- start, augment, fit and prune (P) ----
    def _fitted_inter(self, total: int) -> Population:
        """The splats of a P-frame of N splats: those of the frame before, moved, without some, with new ones."""
        self.rng = np.random.default_rng([self.settings.seed, self.number])
        settings = self.settings.inter.fit
        with self.seconds.timed("start"):
            picture_before = self.encoder.picture_before if self.settings.effects.motion == "auto" else None
            parameters, predicted = moved_along_flow(
                self.state_before.splats.to_array(), picture_before, self.picture, self.objective, self.log
            )
            old, drop = len(parameters), min(self.encoder.last_psnr, BEST) - predicted
            new, removed = exchange_counts(self.settings, old, total, self.encoder.most, drop, self.log)
        if isinstance(settings, QuickFit):
            with self.seconds.timed("fit"):
                target = self._target(settings)
                parameters, origins = exchanged(target, parameters, old - removed, new, self.rng)
                parameters = refitted(target, parameters, settings.iterations)
            return Population(Splats.from_array(parameters), KEPT_WEIGHT, origins)
        settings, stay = self._with_gsp(settings), np.arange(old)
        if settings.pruning is not None and removed:
            settings = settings.pruning_of(removed / (old + new))
        else:
            settings = replace(settings, pruning=None)
            stay = np.sort(np.argsort(-visibility(parameters), kind="stable")[: old - removed])
        population = Population(Splats.from_array(parameters[stay]), KEPT_WEIGHT, stay, settings.optimizer)
        self._augment(population, new, learn_weights=settings.pruning is not None)
        return self._fitted(population, settings)

    def _augment(self, population: Population, count: int, *, learn_weights: bool) -> None:
        """GSA: nearly invisible splats anywhere; where w is not learnt, their colours are faint."""
        uniforms = uniform_numbers(count, self.rng)
        if learn_weights:
            population.augment(uniforms, self.width, self.height)
        else:
            splats = random_splats(uniforms, self.width, self.height)
            faint = Splats(splats.positions, splats.cholesky, splats.colors * np.float32(NEW_WEIGHT))
            population.append(faint, KEPT_WEIGHT)

    def _with_gsp(self, settings: FitSettings) -> FitSettings:
        """The settings of a fit, with pruning only where the paper's is asked for."""
        return settings if self.settings.effects.gsp == "all" else replace(settings, pruning=None)

    def _fitted(self, population: Population, settings: FitSettings) -> Population:
        """The population after its fit by Adan, with GSP where the settings have it."""
        with self.seconds.timed("fit"):
            _, done = fit(population, self.objective, settings, on_iteration=self._report("fit"))
            self.iterations += done
        return population

    # ---- fine-tune and reconstruct ----
    def _coded_intra(self, population: Population) -> EncodedFrame:
        """The I-frame of fitted splats."""
        return self._fine_tuned(
            population, self.settings.intra, self.settings.inter.quantizer, self.state_before.forget()
        )

    def _coded_inter(self, population: Population, scale: float = 1.0) -> EncodedFrame:
        """The P-frame of fitted splats; a change must be worth `scale` times what the settings say."""
        inter, least = self.settings.inter, 0.0
        if self.settings.effects.regions == "all":
            self.log.add("regions", "asked for", done=True)
        else:
            self.log.add("regions", "what changes too little to be seen stays as it is", done=False)
            least = scale * inter.quantizer.static_threshold
        quantizer = inter.quantizer.with_(static_threshold=min(least, MAX_THRESHOLD))
        return self._fine_tuned(population, inter, quantizer, self.state_before)

    def _fine_tuned(
        self, population: Population, settings: FrameSettings, inter: BlockSettings, state_before: State
    ) -> EncodedFrame:
        """The frame of fitted splats after quantisation-aware fine-tuning, with `inter` for differences."""
        with self.seconds.timed("quantize"):
            intra = self._intra_quantizer(int(np.count_nonzero(population.origins == NEW)))
            quantizer = FrameQuantizer(population, self.objective, intra, inter, state_before, self.rng)
            codes, state, done = fine_tune(
                population.parameters(), quantizer, self.objective, settings.tune, self._report("quantize")
            )
            self.iterations += done
        return self._reconstructed(codes, state)

    def _intra_quantizer(self, count: int) -> BlockSettings:
        """The quantisers of `count` new splats: in preset `quick` they have no more codewords in all than splats."""
        settings, block = self.settings.intra, self.settings.intra.quantizer
        if not isinstance(settings.fit, QuickFit):
            return block
        stages, codewords = len(block.colors.codewords), block.colors.codewords[0]
        return block.with_(color_codewords=min(codewords, max(1, count // stages)))

    def _reconstructed(self, codes: FrameCodes, state: State) -> EncodedFrame:
        """The frame, with the PSNR of what a decoder will show."""
        with self.seconds.timed("check"):
            decoded = self.encoder.renderer.frame(state.splats, self.encoder.bit_depth)
            reached = psnr(self.frame, decoded, self.peak)
        return EncodedFrame(codes, state, reached, self.iterations, self.seconds, self.log.decisions)

    # ---- time and progress ----
    def _report(self, stage: str) -> OnIteration:
        return lambda done, iterations, loss: self.progress(stage, done, iterations, psnr_of_loss(loss))

    def _target(self, fit_settings: QuickFit) -> Target:
        """The picture for a fit by L-BFGS."""
        done, iterations = 0, fit_settings.iterations

        def evaluated(loss: float) -> None:
            nonlocal done
            self.iterations, done = self.iterations + 1, done + 1
            self.progress("fit", done, max(done, iterations), psnr_of_loss(loss))

        return Target(self.picture, on_evaluation=evaluated, **self.settings.computing)


def _new_population(parameters: F4) -> Population:
    """Splats (N, 8) f4 that no frame before has."""
    return Population(Splats.from_array(parameters), KEPT_WEIGHT, np.full(len(parameters), NEW, np.int64))
