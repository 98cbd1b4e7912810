"""Choosing b, M and B of a stream by rate and quality, on its first frame."""

from dataclasses import replace
from io import BytesIO
from typing import Any, Final

import numpy as np

from gsvc_ref.bitstream import SequenceHeader, level_for
from gsvc_ref.encoder.rate import DB_PER_DOUBLING, psnr_of_loss
from gsvc_ref.encoder.settings import Settings, scaled
from gsvc_ref.portable import log2
from gsvc_ref.reconstruction import FrameCodes, State
from gsvc_ref.rendering import Objective
from gsvc_ref.stream import StreamWriter
from gsvc_ref.training.fine_tuning import FrameQuantizer, fine_tune
from gsvc_ref.training.fit import Population
from gsvc_ref.training.quantizer import with_codewords

TRIAL_ITERATIONS: Final = 10
"""Fine-tuning iterations that each candidate gets."""

NOTHING_TO_TELL: Final = 59.0
"""PSNR in dB from which on a frame tells no quantiser from another: rounding to 8 bits leaves 58.9 dB."""


def with_best_quantizer(
    population: Population, objective: Objective, settings: Settings, before: State, seed: list[int]
) -> Settings:
    """The settings with the candidate (b, M, B) that serves a fitted I-frame best; unchanged without candidates.

    Unchanged as well if a candidate has next to no error: a black frame is met by the smallest quantisers, which are no
    good for what follows it. Best is the highest PSNR after a short fine-tuning, less what the bits could have bought
    otherwise: DB_PER_DOUBLING for each doubling, since that is what twice the splats bring for about twice the bits.
    """
    best, highest = settings, -np.inf
    for bits, stages, codewords in settings.intra.candidates:
        candidate = with_quantizer(settings, bits, stages, codewords)
        quantizer = FrameQuantizer(population, objective, candidate, before, np.random.default_rng(seed))
        tune = scaled(candidate.intra.tune, TRIAL_ITERATIONS)
        codes, state, _ = fine_tune(population.parameters(), quantizer, objective, tune)
        psnr = psnr_of_loss(objective.loss(state.splats.to_array()))
        if psnr >= NOTHING_TO_TELL:
            return settings
        score = psnr - DB_PER_DOUBLING * log2(frame_bytes(codes, candidate, before))
        if score > highest:
            best, highest = candidate, score
    return best


def with_quantizer(settings: Settings, bits: int, stages: int, codewords: int) -> Settings:
    """The settings with b for all frames, and M and B for I-frames."""
    intra, inter = settings.intra, settings.inter
    block = with_codewords(replace(intra.quantizer, cholesky_bits=bits), stages, codewords)
    return replace(
        settings,
        intra=replace(intra, quantizer=block),
        inter=replace(inter, quantizer=replace(inter.quantizer, cholesky_bits=bits)),
    )


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
