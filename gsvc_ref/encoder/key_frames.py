"""Dynamic Key-frame Selection (DKS): which frames are trained from scratch (paper section 3.6).

Every frame is pre-trained twice, from scratch (loss I) and from the frame before (loss P). With D_t = P_t - I_t for
every frame t but the first, and the window W_t of the frames t - w..t + w that have a D (10-28), the paper makes t a
key frame if D_t exceeds the mean of the window by more than k = 3 times its standard deviation (dividing by
n = |W_t|)::

    n D_t - S > 0   and   (n D_t - S)^2 > k^2 (n Q - S^2),     S = sum of D, Q = sum of D^2 over W_t        (10-29)

which is the same without division and root (R-10.9-1). It is evaluated in rational numbers, so a tie is a tie on any
machine.

The paper's rule is blind in two ways: D_t is one of the n values, so it is never more than sqrt(n - 1) deviations from
the mean, and n <= 10 can never exceed 3; and a cut hides another (two equal cuts among 20 frames give exactly 3.0).
The *robust* rule, ours, leaves t out of its own statistics, as well as the key frames found before it, and guards
against noise: t is a key frame if P_t > g I_t (10-30), g = 2, and D_t exceeds the mean of the other frames of the
window by more than k of their standard deviations; without others, the guard decides. Under ``paper`` the robust rule
is used only in windows too short for the paper's, those with n - 1 <= k^2.

Frames are numbered from 0 here; the paper's t is the number plus 1.
"""

import math
from collections import deque
from collections.abc import Sequence
from fractions import Fraction
from typing import Final, Literal, NamedTuple

from gsvc_base.checks import door
from gsvc_base.errors import UsageError

Rule = Literal["paper", "robust"]

WINDOW: Final = 10
"""w, frames on either side; paper section 3.6."""

THRESHOLD: Final = 3.0
"""k, standard deviations; paper section 3.6."""

GUARD_RATIO: Final = 2.0
"""g: a key frame by the robust rule is worse by this factor when predicted; ours."""


class KeyFrameSelector:
    """Decides frame after frame, in constant memory."""

    def __init__(
        self,
        *,
        window: int = WINDOW,  # w
        threshold: float = THRESHOLD,  # k
        rule: Rule = "paper",
        # decide at once: the window is t - w..t and the rule robust; else a decision comes w frames later
        causal: bool = False,
        guard_ratio: float = GUARD_RATIO,  # g
    ) -> None:
        if window < 0 or not 0 <= threshold < math.inf or not 0 <= guard_ratio < math.inf:
            raise UsageError(f"window {window}, threshold {threshold} and guard_ratio {guard_ratio} must be at least 0")
        if rule not in ("paper", "robust"):
            raise UsageError(f"rule is {rule!r}; it must be 'paper' or 'robust'")
        self.window, self.causal = window, causal
        self._paper = rule == "paper" and not causal
        self._threshold, self._guard_ratio = Fraction(threshold), Fraction(guard_ratio)
        self._started = False
        self._decided: deque[_Frame] = deque(maxlen=window)  # the window's frames before the one to decide next
        self._waiting: deque[_Frame] = deque()

    def push(
        self,
        loss_i: float,  # after pre-training from scratch
        loss_p: float | None = None,  # after pre-training from the frame before; None for the first frame only
    ) -> list[bool]:
        """Take the losses of the next frame; whether each frame that can now be decided is a key frame, in order.

        The first frame always is one.
        """
        if self._started != (loss_p is not None):
            raise UsageError("every frame but the first has a loss_p, the loss after starting from the frame before")
        if not all(0 <= loss < math.inf for loss in (loss_i, loss_p or 0.0)):
            raise UsageError(f"losses {loss_i} and {loss_p} must be finite and at least 0")
        if loss_p is None:
            self._started = True
            return [True]
        i, p = Fraction(loss_i), Fraction(loss_p)
        self._waiting.append(_Frame(p - i, p > self._guard_ratio * i))  # (10-30)
        look_ahead = 0 if self.causal else self.window
        return [self._decide()] if len(self._waiting) > look_ahead else []

    def flush(self) -> list[bool]:
        """The decisions for all frames that wait, whose windows end with the last frame, since no other follows."""
        return [self._decide() for _ in range(len(self._waiting))]

    def _decide(self) -> bool:
        frame = self._waiting.popleft()
        values = [other.difference for other in (*self._decided, frame, *self._waiting)]  # (10-28)
        if self._paper and len(values) - 1 > self._threshold * self._threshold:
            is_key = exceeds(frame.difference, values, self._threshold)
        else:
            ordinary = [other.difference for other in (*self._decided, *self._waiting) if not other.is_key]
            is_key = frame.guarded and (not ordinary or exceeds(frame.difference, ordinary, self._threshold))
        self._decided.append(frame._replace(is_key=is_key))
        return is_key


# twin of spec.select_key_frames
@door
def select_key_frames(
    losses_i: Sequence[float],
    losses_p: Sequence[float],
    window: int = WINDOW,
    threshold: float = THRESHOLD,
    guard_ratio: float = GUARD_RATIO,
    robust: bool = False,
    *,
    causal: bool = False,
) -> list[int]:
    """The key frames of a whole sequence (R-10.9-1).

    Parameters
    ----------
    losses_i
        Loss I of each of T frames.
    losses_p
        Loss P of each frame but the first, T - 1.
    window, threshold, guard_ratio, causal
        The parameters of `KeyFrameSelector`.
    robust
        Whether the rule is ``robust``, not ``paper``.

    Returns
    -------
    list[int]
        Their numbers from 0, ascending.

    Raises
    ------
    UsageError
        The counts do not fit, or as for `KeyFrameSelector`.
    """
    if len(losses_i) and len(losses_p) != len(losses_i) - 1:
        raise UsageError(f"{len(losses_i)} losses I and {len(losses_p)} losses P; the first frame alone has no loss P")
    rule: Rule = "robust" if robust else "paper"
    selector = KeyFrameSelector(window=window, threshold=threshold, rule=rule, causal=causal, guard_ratio=guard_ratio)
    decisions: list[bool] = []
    for loss_i, loss_p in zip(losses_i, [None, *losses_p], strict=False):
        decisions += selector.push(loss_i, loss_p)
    decisions += selector.flush()
    return [number for number, is_key in enumerate(decisions) if is_key]


class _Frame(NamedTuple):
    difference: Fraction
    guarded: bool
    is_key: bool = False


def exceeds(value: Fraction, values: Sequence[Fraction], threshold: Fraction) -> bool:
    """Whether value > mean + threshold * standard deviation of the values, exactly."""
    unit = math.lcm(value.denominator, *(other.denominator for other in values))
    wholes = [other.numerator * (unit // other.denominator) for other in values]  # fewer operations than in fractions
    n, total, squares = len(wholes), sum(wholes), sum(whole * whole for whole in wholes)
    above = n * value.numerator * (unit // value.denominator) - total
    return above > 0 and above * above > threshold * threshold * (n * squares - total * total)  # (10-29)
