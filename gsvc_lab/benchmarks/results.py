"""The results of a section of the benchmarks: tables to read, goals, and the numbers behind them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from gsvc_base.pages.tables import Table as Table


@dataclass(frozen=True)
class Goal:
    """A goal, and what was measured."""

    work: str  # the work that the goal is about
    unit: str  # unit of the numbers, such as ``times`` or ``frames/s``
    must: float  # The goals; a larger number is better if `more_is_better`
    aim: float | None
    measured: float | None  # the number, or None with the reason in `note`
    more_is_better: bool = False
    note: str = ""

    def verdict(self) -> str:
        """Whether the goal is met, and else by how much it is missed."""
        if self.measured is None:
            return self.note
        if self.aim is not None and self._distance(self.aim) <= 1:
            return "aim met"
        distance = self._distance(self.must)
        if distance <= 1:
            return "must met"
        return f"missed by {100 * (distance - 1):.1f} %" if distance < 2 else f"missed by a factor of {distance:.1f}"

    def _distance(self, goal: float) -> float:
        assert self.measured is not None
        return goal / self.measured if self.more_is_better else self.measured / goal


@dataclass
class Section:
    """The outcome of one section."""

    title: str
    tables: list[Table] = field(default_factory=list)
    goals: list[Goal] = field(default_factory=list)
    numbers: list[dict[str, Any]] = field(default_factory=list)

    def markdown(self) -> str:
        """The title and all tables."""
        return "\n\n".join([f"## {self.title}", *(table.markdown() for table in self.tables)])


def goal_table(goals: Sequence[Goal]) -> Table:
    """All goals with their verdicts."""
    rows = [
        [
            goal.work,
            goal.unit,
            f"{goal.must:g}",
            "" if goal.aim is None else f"{goal.aim:g}",
            "" if goal.measured is None else f"{goal.measured:.3g}",
            goal.verdict(),
        ]
        for goal in goals
    ]
    return Table("Goals, and what this run measured:", ["work", "unit", "must", "aim", "measured", "verdict"], rows)
