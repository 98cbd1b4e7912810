"""Measuring the groups that are asked for, within a time."""

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from gsvc_base.errors import UsageError
from gsvc_lab import machine
from gsvc_lab.accuracy.encoding import Curve, encoding_curve
from gsvc_lab.accuracy.groups import ENCODING, GROUP_NAMES, GROUPS, Group, Kind, check_names
from gsvc_lab.accuracy.measure import Spread, take_turns, timed, visit
from gsvc_lab.accuracy.pictures import error_pictures
from gsvc_lab.accuracy.results import AccuracyReport, GroupResult, Measurement, measurements_of
from gsvc_lab.accuracy.sources import Source
from gsvc_lab.accuracy.work import Quality, SourcePicture, Work
from gsvc_ref.encoder.settings import PaperSettings

SECONDS: Final = 110.0
"""Time to measure in by default."""

REPEATS: Final = 9
"""Maximum number of rounds by default."""

PAPER_S: Final = 60.0
"""Seconds after which the curve of the preset paper ends."""

MIN_PAPER: Final = 0.3
"""Fraction of all time that it gets even if the groups before it took longer than they should."""

SHARES: Final[dict[str, float]] = {"rendering": 1.0, "coding": 1.0, "training": 2.0, ENCODING: 4.0}
"""Shares of the time for what is asked for."""

MAX_TRAINING_PIXELS: Final = 270_000
"""Maximum number of pixels for coding and training, which take the middle of a larger picture."""

P = TypeVar("P", bound=NDArray[Any])

OnProgress = Callable[[str, float, float], None]
"""Called with what is being done, the seconds so far and the seconds in all, roughly."""


def measure_accuracy(
    source: Source,  # the picture
    names: Sequence[str] = GROUP_NAMES,  # names of the groups
    *,
    # About how long to measure. Every setting runs at least three times, whatever that takes, and at first the splats
    # are fitted and the kernels compiled.
    seconds: float = SECONDS,
    repeats: int = REPEATS,  # maximum number of rounds in which each setting runs, at least 1
    on_progress: OnProgress = lambda text, done, total: None,  # called now and then
) -> AccuracyReport:
    """Measure groups of settings on a picture.

    A UsageError says that there is no such group, or a number is out of its range.
    """
    check_names(tuple(names))
    if not 0 < seconds < math.inf or repeats < 1:
        raise UsageError(f"seconds is {seconds} and repeats {repeats}; they must be above 0 and at least 1")
    return _Measuring(source, tuple(names), seconds, repeats, on_progress).run()


class _Measuring:
    """One run of `measure_accuracy`."""

    def __init__(
        self, source: Source, names: tuple[str, ...], seconds: float, repeats: int, on_progress: OnProgress
    ) -> None:
        self.source, self.names, self.repeats, self.on_progress = source, names, repeats, on_progress
        self.begin = time.perf_counter()
        self.total = seconds
        self.shares = dict(SHARES)
        self.notes: list[str] = []
        whole = source.picture
        middle = central(whole, MAX_TRAINING_PIXELS)
        self.whole = SourcePicture(whole, self._on_fit)
        self.middle = self.whole if middle is whole else SourcePicture(middle, self._on_fit)

    def run(self) -> AccuracyReport:
        kinds: tuple[Kind, ...] = ("rendering", "coding", "training")
        measurements: dict[str, tuple[Measurement, ...]] = {}
        for kind in kinds:
            groups = [group for group in GROUPS if group.kind == kind and group.name in self.names]
            share = self._share(kind, wanted=bool(groups))
            if groups:
                picture = self.whole if kind == "rendering" else self.middle
                measurements |= self._measure(groups, picture, share)
        share = self._share(ENCODING, wanted=ENCODING in self.names)
        curves = self._curves(share) if ENCODING in self.names else ()
        if self.middle is not self.whole:
            size = f"{self.middle.width}x{self.middle.height}"
            self.notes.append(f"the settings that code and train took the middle {size} pixels of the picture")
        fitted = "population" in vars(self.whole)
        return AccuracyReport(
            self.source,
            len(self.whole.splats) if fitted else 0,
            self.whole.source_psnr(self.whole.exact) if fitted else None,
            tuple(GroupResult(group, measurements[group.name]) for group in GROUPS if group.name in measurements),
            curves,
            error_pictures(self.whole, tuple(group for group in GROUPS if group.name in self.names)),
            tuple(self.notes),
            machine.named(),
            time.perf_counter() - self.begin,
        )

    def _share(self, kind: str, *, wanted: bool) -> float:
        """The seconds that this kind may take of those left, which the kinds after it share as well."""
        left = max(self.total - (time.perf_counter() - self.begin), 0)
        wanted_kinds = {group.kind for group in GROUPS if group.name in self.names}
        after = sum(share for name, share in self.shares.items() if name in (*wanted_kinds, *self.names))
        mine = self.shares.pop(kind)
        return left * mine / after if wanted else 0.0

    def _measure(
        self, groups: list[Group], picture: SourcePicture, seconds: float
    ) -> dict[str, tuple[Measurement, ...]]:
        """Run the work of groups of one kind in turns; work that several groups share runs once."""
        kind = groups[0].kind
        seeded = kind != "rendering"  # every run has another outcome to assess
        names = {setting.work: setting.name for group in groups for setting in group.settings}
        assessed: dict[Work, list[Quality]] = {work: [] for work in names}
        self._report(f"{kind}: getting ready")
        for work in list(names)[: 1 if seeded else None]:  # what is compiled, compiles here
            outcome = work.run(picture, 0)
            if not seeded:
                assessed[work].append(work.assess(picture, outcome))
            self._report(f"{kind}: {names[work]}, getting ready")

        def turn(work: Work, number: int) -> float:
            if not seeded:
                return visit(lambda: work.run(picture, number))
            outcome, taken = timed(lambda: work.run(picture, number))
            assessed[work].append(work.assess(picture, outcome))
            return taken

        taken = take_turns(
            [partial(turn, work) for work in names],
            self.repeats,
            time.perf_counter() + seconds,
            lambda index: self._report(f"{kind}: {list(names.values())[index]}"),
        )
        times = {work: Spread.of(values) for work, values in zip(names, taken, strict=True)}
        return {group.name: measurements_of(group, times, assessed) for group in groups}

    def _curves(self, seconds: float) -> tuple[Curve, ...]:
        """One curve per preset; the first encode only compiles."""
        encoding_curve(PaperSettings.quick(iterations=2), self.source, math.inf)
        begin = time.perf_counter()
        quick = encoding_curve(
            PaperSettings.quick(), self.source, math.inf, lambda _: self._report("encoding, preset quick")
        )
        limit = min(PAPER_S, max(seconds - (time.perf_counter() - begin), MIN_PAPER * self.total))
        paper = encoding_curve(
            PaperSettings.paper(), self.source, limit, lambda _: self._report("encoding, preset paper")
        )
        return quick, paper

    def _on_fit(self, iteration: int, iterations: int, loss: float) -> None:
        self._report(f"fitting splats, iteration {iteration}/{iterations}")

    def _report(self, text: str) -> None:
        self.on_progress(text, time.perf_counter() - self.begin, self.total)


def central(picture: P, most: int) -> P:
    """The middle of a picture (H, W, 3) with at most `most` pixels and its aspect; the picture itself if it fits."""
    height, width = picture.shape[:2]
    if height * width <= most:
        return picture
    factor = math.sqrt(most / (height * width))
    rows, columns = max(1, int(height * factor)), max(1, int(width * factor))
    top, left = (height - rows) // 2, (width - columns) // 2
    return cast(P, np.ascontiguousarray(picture[top : top + rows, left : left + columns]))
