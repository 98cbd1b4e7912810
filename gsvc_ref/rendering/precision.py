"""The three precisions of one definition."""

from typing import Final, Literal, get_args

from gsvc_base.errors import UsageError

Precision = Literal["fast", "deterministic", "exact"]
"""
``fast``
    Binary32 within the bound of `bounds`; multiplications and additions may be fused, so that the last bits depend on
    the CPU.
``deterministic``
    Binary32 with every operation stated (spec.md section 9.3): the same bits on every machine.
``exact``
    The definition in binary64, the oracle: slow.
"""

PRECISIONS: Final[tuple[Precision, ...]] = get_args(Precision)


def check_precision(precision: str, allowed: tuple[str, ...] = PRECISIONS) -> None:
    """Raise UsageError unless the precision is one of those allowed."""
    if precision not in allowed:
        raise UsageError(f"the precision is {precision!r}; it must be one of {', '.join(allowed)}")
