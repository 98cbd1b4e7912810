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
    """The measurement of one setting."""

    setting: Setting  # the setting
    errors: Errors  # errors against the reference of its group; medians where the runs have different seeds
    source_psnr: Spread  # PSNR in dB against the source picture, over the seeds
    bytes: int | None  # size of the coded frame, or None
    seconds: Spread  # time of one run
    ratio: float  # its seconds over those of the base of its group
    best: bool  # whether no other setting of the group is at least as good in RMS error and cost, and better in one


@dataclass(frozen=True)
class GroupResult:
    """A group and its measurements, in the order of its settings."""

    group: Group
    measurements: tuple[Measurement, ...]


@dataclass(frozen=True)
class AccuracyReport:
    """All that was measured."""

    source: Source  # the picture that it was measured on
    splats: int  # number of splats that were rendered; 0 without a group that renders
    fitted_psnr: float | None  # their PSNR in dB against the source; None without
    groups: tuple[GroupResult, ...]  # The results
    curves: tuple[Curve, ...]
    pictures: tuple[ErrorPicture, ...]  # the errors of a few settings as pictures
    notes: tuple[str, ...]  # sentences that a reader must know
    machine: dict[str, str]  # names and values that describe the machine
    seconds: float  # seconds that all of it took


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
