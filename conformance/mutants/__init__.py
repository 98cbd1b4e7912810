"""Mutants: spec.md's code with one plausible mistake each. Vectors must find them all; a report names those it meets.

`mutant` says what one is and runs it; the other modules list them, area by area.
"""

from typing import Final

from conformance.mutants import (
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
from conformance.mutants.mutant import Mutant, answer, called, judge, killed_by, kills, mutant, time_limit

__all__ = ["MUTANTS", "Mutant", "answer", "called", "judge", "killed_by", "kills", "mutant", "time_limit"]

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
"""All mutants, area by area."""
