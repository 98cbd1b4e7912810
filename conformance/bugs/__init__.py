"""The named mutants, area by area (`conformance.mutants` says what they are for)."""

from typing import Final

from conformance.bugs import bitstream, color, gradients, quantization, reconstruction, reductions, rendering, training
from conformance.mutants import Mutant

MUTANTS: Final[tuple[Mutant, ...]] = (
    *bitstream.MUTANTS,
    *reconstruction.MUTANTS,
    *rendering.MUTANTS,
    *gradients.MUTANTS,
    *reductions.MUTANTS,
    *training.MUTANTS,
    *quantization.MUTANTS,
    *color.MUTANTS,
)
