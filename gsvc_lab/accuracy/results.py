"""What a ladder found, as plain data."""

from dataclasses import dataclass, replace
from typing import Any, Final

from gsvc_lab.accuracy.choices import Judgement
from gsvc_lab.accuracy.encoding import Curve
from gsvc_lab.accuracy.measure import Errors, Spread, pareto
from gsvc_lab.accuracy.pictures import ErrorPicture
from gsvc_lab.accuracy.rungs import Group, Rung
from gsvc_lab.accuracy.sources import Source

FIELDS: Final = ("largest", "quantile", "rms", "psnr")
"""Of `Errors`."""


@dataclass(frozen=True)
class Step:
    """What one rung gave.

    Attributes
    ----------
    rung
        The rung.
    errors
        Against the reference of its group; medians where the runs have different seeds.
    source_psnr
        PSNR in dB against the source picture, over the seeds.
    bytes
        Of the coded frame, or None.
    seconds
        Of one run.
    ratio
        Its seconds over those of the base of its group.
    best
        Whether no other rung of the group is at least as good in RMS error and cost, and better in one.
    """

    rung: Rung
    errors: Errors
    source_psnr: Spread
    bytes: int | None
    seconds: Spread
    ratio: float
    best: bool


@dataclass(frozen=True)
class GroupResult:
    """A group and its steps, in the order of its rungs."""

    group: Group
    steps: tuple[Step, ...]


@dataclass(frozen=True)
class Ladder:
    """All that was measured.

    Attributes
    ----------
    source
        What it was measured on.
    splats
        Splats that were rendered; 0 without a group that renders.
    fitted_psnr
        Their PSNR in dB against the source; None without.
    groups, curves
        The results.
    pictures
        Where the errors of a few rungs lie.
    notes
        Sentences that a reader must know.
    machine
        What it ran on.
    seconds
        How long it took.
    """

    source: Source
    splats: int
    fitted_psnr: float | None
    groups: tuple[GroupResult, ...]
    curves: tuple[Curve, ...]
    pictures: tuple[ErrorPicture, ...]
    notes: tuple[str, ...]
    machine: dict[str, str]
    seconds: float


def steps_of(group: Group, times: dict[Any, Spread], judged: dict[Any, list[Judgement]]) -> tuple[Step, ...]:
    """The steps of a group from the times and the judgements of its choices."""
    base = next(times[rung.choice].median for rung in group.rungs if rung.base)
    steps = []
    for rung in group.rungs:
        all_of = judged[rung.choice]
        errors = Errors(*(Spread.of([getattr(one.errors, name) for one in all_of]).median for name in FIELDS))
        sizes = [one.bytes for one in all_of if one.bytes is not None]
        seconds = times[rung.choice]
        source = Spread.of([one.source_psnr for one in all_of])
        size = round(Spread.of(sizes).median) if sizes else None
        steps.append(Step(rung, errors, source, size, seconds, seconds.median / base, best=False))
    costs = [step.seconds.median if step.bytes is None else step.bytes for step in steps]
    best = pareto([(step.errors.rms, cost) for step, cost in zip(steps, costs, strict=True)])
    return tuple(replace(step, best=mark) for step, mark in zip(steps, best, strict=True))
