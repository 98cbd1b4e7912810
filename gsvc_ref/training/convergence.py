"""The rule by which training stops early (paper section 4.1; R-10.10-1)."""

import math
from dataclasses import dataclass

from gsvc_base.checks import check_types
from gsvc_base.errors import UsageError


@dataclass(frozen=True)
class Convergence:
    """The rule: a number of iterations in a row whose loss differs from the one before by at most a tolerance."""

    patience: int = 100  # iterations in a row
    # Maximum difference of the loss between two iterations. The paper's 1e-7 is of a loss that sums the squares of the
    # three channels; a mean over channels would be a third of it.
    tolerance: float = 1e-7

    def __post_init__(self) -> None:
        check_types(self)
        if self.patience < 1 or not self.tolerance >= 0:
            raise UsageError(f"{self}: patience must be at least 1 and tolerance at least 0")

    def start(self) -> "ConvergenceTest":
        """A test for one run of training."""
        return ConvergenceTest(self)


class ConvergenceTest:
    """The test of one run of training, loss by loss."""

    def __init__(self, rule: Convergence) -> None:
        self.rule = rule
        self.small_changes = 0  # in a row
        self.previous = math.inf

    def update(self, loss: float) -> bool:
        """Take the loss of the next iteration; True once the rule is met."""
        if math.isnan(loss):
            raise UsageError("the loss is NaN; training has diverged, use lower learning rates")
        is_small = abs(loss - self.previous) <= self.rule.tolerance  # (10-31)
        self.small_changes = self.small_changes + 1 if is_small else 0
        self.previous = loss
        return self.small_changes >= self.rule.patience
