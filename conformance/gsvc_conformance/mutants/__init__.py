"""Mutants: spec.md's code with one plausible mistake each. Vectors must find them all; a report names those it meets.

`mutant` says what one is and runs it; the other modules list them, area by area. To add one:

1. Write `mutant(area, "name", "words that stand after 'looks like'", (text of spec.md's code, text in its place))` into
   the tuple of its area's module. The old text stands exactly once in the Python blocks of spec.md.
2. ``gsvc-conformance mutants --mutant name --all`` prints the vectors that find it, or that it survives. If it
   survives, add a `case` to a module of `gsvc_conformance.cases`.
3. ``make vectors`` writes its name into the manifests and vectors/COVERAGE.md.
"""

from typing import Final

from gsvc_conformance.mutants import (
    bitstream,
    color,
    errors,
    gradients,
    main_profile,
    quantization,
    reconstruction,
    reductions,
    rendering,
    seeking,
    training,
)
from gsvc_conformance.mutants.mutant import Mutant, answer, called, judge, killed_by, kills, mutant, time_limit

__all__ = ["MUTANTS", "Mutant", "answer", "called", "judge", "killed_by", "kills", "mutant", "time_limit"]

MUTANTS: Final[tuple[Mutant, ...]] = (
    *bitstream.MUTANTS,
    *errors.MUTANTS,
    *seeking.MUTANTS,
    *reconstruction.MUTANTS,
    *rendering.MUTANTS,
    *gradients.MUTANTS,
    *reductions.MUTANTS,
    *training.MUTANTS,
    *quantization.MUTANTS,
    *color.MUTANTS,
    *main_profile.MUTANTS,
)
"""All mutants, area by area."""
