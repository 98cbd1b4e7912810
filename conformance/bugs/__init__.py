"""The named mutants, area by area (`conformance.mutants` says what they are for)."""

from typing import Final

from conformance.bugs import (
    bitstream,
    color,
    errors,
    gradients,
    quantization,
    reconstruction,
    reductions,
    rendering,
    training,
)
from conformance.mutants import Mutant

MUTANTS: Final[tuple[Mutant, ...]] = (
    *bitstream.MUTANTS,
    *errors.MUTANTS,
    *reconstruction.MUTANTS,
    *rendering.MUTANTS,
    *gradients.MUTANTS,
    *reductions.MUTANTS,
    *training.MUTANTS,
    *quantization.MUTANTS,
    *color.MUTANTS,
)
