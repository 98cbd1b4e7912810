"""The measurements, as plain data."""

from dataclasses import dataclass, replace
from typing import Final

from gsvc_lab.accuracy.encoding import Curve
from gsvc_lab.accuracy.groups import Group, Setting
from gsvc_lab.accuracy.measure import Errors, Spread, pareto
from gsvc_lab.accuracy.pictures import ErrorPicture
from gsvc_lab.accuracy.sources import Source
from gsvc_lab.accuracy.work import Quality, Work

FIELDS: Final = ("largest", "quantile", "rms", "psnr")
"""The fields of `Errors`."""


@dataclass(frozen=True)
class Measurement:
    """The measurement of one setting.

    Attributes
    ----------
    setting
        The setting.
    errors
        Errors against the reference of its group; medians where the runs have different seeds.
    source_psnr
        PSNR in dB against the source picture, over the seeds.
    bytes
        Size of the coded frame, or None.
    seconds
        Time of one run.
    ratio
        Its seconds over those of the base of its group.
    best
        Whether no other setting of the group is at least as good in RMS error and cost, and better in one.
    """

    setting: Setting
    errors: Errors
    source_psnr: Spread
    bytes: int | None
    seconds: Spread
    ratio: float
    best: bool


@dataclass(frozen=True)
class GroupResult:
    """A group and its measurements, in the order of its settings."""

    group: Group
    measurements: tuple[Measurement, ...]


@dataclass(frozen=True)
class AccuracyReport:
    """All that was measured.

    Attributes
    ----------
    source
        The picture that it was measured on.
    splats
        Number of splats that were rendered; 0 without a group that renders.
    fitted_psnr
        Their PSNR in dB against the source; None without.
    groups, curves
        The results.
    pictures
        The errors of a few settings as pictures.
    notes
        Sentences that a reader must know.
    machine
        Names and values that describe the machine.
    seconds
        Seconds that all of it took.
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


def measurements_of(
    group: Group, times: dict[Work, Spread], assessed: dict[Work, list[Quality]]
) -> tuple[Measurement, ...]:
    """The measurements of a group from the times and the qualities of its work."""
    base = next(times[setting.work].median for setting in group.settings if setting.base)
    measurements = []
    for setting in group.settings:
        all_of = assessed[setting.work]
        errors = Errors(*(Spread.of([getattr(one.errors, name) for one in all_of]).median for name in FIELDS))
        sizes = [one.bytes for one in all_of if one.bytes is not None]
        seconds = times[setting.work]
        source = Spread.of([one.source_psnr for one in all_of])
        size = round(Spread.of(sizes).median) if sizes else None
        ratio = seconds.median / base
        measurements.append(Measurement(setting, errors, source, size, seconds, ratio, best=False))
    points = [(one.errors.rms, one.seconds.median if one.bytes is None else one.bytes) for one in measurements]
    best = pareto(points)
    return tuple(replace(one, best=mark) for one, mark in zip(measurements, best, strict=True))
