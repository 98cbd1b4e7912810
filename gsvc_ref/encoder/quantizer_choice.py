"""Choosing b, M and B of a stream by rate and quality, on its first frame."""

from io import BytesIO
from typing import Any, Final

import numpy as np

from gsvc_base.portable import log2
from gsvc_ref.bitstream import SequenceHeader, level_for
from gsvc_ref.encoder.rate import DB_PER_DOUBLING
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.paper import FrameCodes, State
from gsvc_ref.rendering import Objective
from gsvc_ref.stream import StreamWriter
from gsvc_ref.training import FitSettings, Population, RoundingSettings, psnr_of_loss, quantised

TRIAL_ITERATIONS: Final = 10
"""Number of fine-tuning iterations of each candidate; rounding in stages makes one evaluation."""

MAX_PSNR: Final = 59.0
"""PSNR in dB from which on a frame cannot tell one quantiser from another: rounding to 8 bits leaves 58.9 dB."""


def with_best_quantizer(
    population: Population, objective: Objective, settings: Settings, before: State, seed: list[int]
) -> Settings:
    """The settings with the candidate (b, M, B) that serves a fitted I-frame best; unchanged without candidates.

    They are unchanged as well if a candidate has next to no error: the smallest quantisers suffice for a black frame,
    but not for the frames after it. The best candidate has the highest PSNR after a short trial (`trial_of`), less
    the PSNR that its bits could have bought otherwise: DB_PER_DOUBLING for each doubling, since twice the splats bring
    that for about twice the bits.
    """
    best, highest = settings, -np.inf
    for choice in settings.intra.candidates:
        candidate = with_quantizer(settings, choice)
        blocks = candidate.intra.quantizer, candidate.inter.quantizer
        rng, tune = np.random.default_rng(seed), trial_of(candidate.intra.tune)
        codes, state, _ = quantised(population, objective, *blocks, before, rng, tune)
        psnr = psnr_of_loss(objective.loss(state.splats.to_array()))
        if psnr >= MAX_PSNR:
            return settings
        score = psnr - DB_PER_DOUBLING * log2(frame_bytes(codes, candidate, before))
        if score > highest:
            best, highest = candidate, score
    return best


def with_quantizer(settings: Settings, choice: tuple[int, ...]) -> Settings:
    """The settings with a candidate (b, M, B)."""
    bits, stages, codewords = choice
    intra = settings.intra.with_(cholesky_bits=bits, color_stages=stages, color_codewords=codewords)
    return settings.with_(intra=intra, inter=settings.inter.with_(cholesky_bits=bits))


def chosen_quantizer(settings: Settings) -> tuple[int, ...]:
    """The (b, M, B) of settings: what `with_quantizer` makes them of."""
    quantizer = settings.intra.quantizer
    codewords = quantizer.colors.codewords
    return quantizer.cholesky_bits, len(codewords), codewords[0]


def trial_of(tune: FitSettings | RoundingSettings) -> FitSettings | RoundingSettings:
    """The settings of a candidate's trial."""
    return tune.with_(iterations=0 if isinstance(tune, RoundingSettings) else TRIAL_ITERATIONS)


def quantizer_fields(settings: Settings) -> dict[str, Any]:
    """The elements of the sequence header that describe quantisers and entropy coding."""
    books = [*settings.intra.quantizer.colors.codewords, *settings.inter.quantizer.colors.codewords]
    stages = max(len(kind.quantizer.colors.codewords) for kind in (settings.intra, settings.inter))
    return {
        "cholesky_bits": settings.intra.quantizer.cholesky_bits,
        "color_stages": stages,
        "color_codewords": max(books),
        "entropy_precision": settings.entropy_precision,
        "lane_count": settings.lane_count,
    }


def frame_bytes(codes: FrameCodes, settings: Settings, before: State) -> int:
    """The size in bytes of an I-frame's chunk."""
    level = level_for(before.width, before.height, splats=codes.intra_count)
    header = SequenceHeader(level=level, width=before.width, height=before.height, **quantizer_fields(settings))
    return StreamWriter(BytesIO(), header).write_frame(codes).size
