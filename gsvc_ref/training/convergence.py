"""When training stops early (paper section 4.1; R-10.10-1)."""

import math
from dataclasses import dataclass

from gsvc_ref.checks import check_types
from gsvc_ref.errors import UsageError


@dataclass(frozen=True)
class Convergence:
    """The rule: so many iterations in a row whose loss differs from the one before by no more than a tolerance.

    Attributes
    ----------
    patience
        Iterations in a row; the paper has 100.
    tolerance
        Largest absolute difference of the loss between two iterations; the paper has 1e-7, for the L2 loss that sums
        the squares of the three channels (a mean over channels would be a third of it).

    Raises
    ------
    UsageError
        Patience is below 1, or the tolerance negative or NaN.
    """

    patience: int = 100
    tolerance: float = 1e-7

    def __post_init__(self) -> None:
        check_types(self)
        if self.patience < 1 or not self.tolerance >= 0:
            raise UsageError(f"{self}: patience must be at least 1 and tolerance at least 0")

    def start(self) -> "ConvergenceTest":
        """A test for one run of training."""
        return ConvergenceTest(self)


class ConvergenceTest:
    """Counts the calm iterations of one run of training."""

    def __init__(self, rule: Convergence) -> None:
        self.rule = rule
        self.calm = 0
        self.previous = math.inf

    def update(self, loss: float) -> bool:
        """Take the loss of the next iteration; True once the rule is met.

        Raises
        ------
        UsageError
            The loss is NaN: training has diverged, and no later loss would tell.
        """
        if math.isnan(loss):
            raise UsageError("the loss is NaN; training has diverged, use lower learning rates")
        self.calm = self.calm + 1 if abs(loss - self.previous) <= self.rule.tolerance else 0  # (10-31)
        self.previous = loss
        return self.calm >= self.rule.patience
