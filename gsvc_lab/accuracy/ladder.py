"""Measuring the ladder: the groups that are asked for, within a time."""

import math
import time
from collections.abc import Callable, Sequence
from typing import Any, Final, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from gsvc_lab.accuracy.choices import Judgement, Subject
from gsvc_lab.accuracy.encoding import Curve, encoding_curve
from gsvc_lab.accuracy.machine import machine
from gsvc_lab.accuracy.measure import Spread, take_turns, timed, visit
from gsvc_lab.accuracy.pictures import error_pictures
from gsvc_lab.accuracy.results import GroupResult, Ladder, Step, steps_of
from gsvc_lab.accuracy.rungs import ENCODING, GROUP_NAMES, GROUPS, Group, Kind, check_names
from gsvc_lab.accuracy.sources import Source
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.errors import UsageError

SECONDS: Final = 110.0
"""Time to measure in, by default."""

REPEATS: Final = 9
"""Most rounds of each rung, by default."""

PAPER_S: Final = 60.0
"""The curve of the preset paper ends there at the latest."""

MIN_PAPER: Final = 0.3
"""It gets this fraction of all time even if the groups before it took longer than they should."""

SHARES: Final[dict[str, float]] = {"rendering": 1.0, "coding": 1.0, "training": 2.0, ENCODING: 4.0}
"""How the time is shared among what is asked for."""

MAX_TRAINING_PIXELS: Final = 270_000
"""Of a larger picture, coding and training take the middle with so many pixels."""

P = TypeVar("P", bound=NDArray[Any])

OnProgress = Callable[[str, float, float], None]
"""Called with what is being done, the seconds so far and the seconds in all, roughly."""


def measure_ladder(
    source: Source,
    names: Sequence[str] = GROUP_NAMES,
    *,
    seconds: float = SECONDS,
    repeats: int = REPEATS,
    on_progress: OnProgress = lambda text, done, total: None,
) -> Ladder:
    """Measure groups of the ladder on a picture.

    Parameters
    ----------
    source
        The picture.
    names
        Of the groups.
    seconds
        About how long to measure. Every rung runs at least three times, whatever that takes, and at first the splats
        are fitted and the renderers compiled.
    repeats
        Most rounds in which each rung runs, at least 1.
    on_progress
        Called now and then.

    Raises
    ------
    UsageError
        There is no such group, or a number is out of its range.
    """
    check_names(tuple(names))
    if not 0 < seconds < math.inf or repeats < 1:
        raise UsageError(f"seconds is {seconds} and repeats {repeats}; they must be above 0 and at least 1")
    return _Measuring(source, tuple(names), seconds, repeats, on_progress).run()


class _Measuring:
    """One run of `measure_ladder`."""

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
        self.whole = Subject(whole, self._on_fit)
        self.middle = self.whole if middle is whole else Subject(middle, self._on_fit)

    def run(self) -> Ladder:
        kinds: tuple[Kind, ...] = ("rendering", "coding", "training")
        steps: dict[str, tuple[Step, ...]] = {}
        for kind in kinds:
            groups = [group for group in GROUPS if group.kind == kind and group.name in self.names]
            share = self._share(kind, wanted=bool(groups))
            if groups:
                subject = self.whole if kind == "rendering" else self.middle
                steps |= self._measure(groups, subject, share)
        share = self._share(ENCODING, wanted=ENCODING in self.names)
        curves = self._curves(share) if ENCODING in self.names else ()
        if self.middle is not self.whole:
            size = f"{self.middle.width}x{self.middle.height}"
            self.notes.append(f"the rungs that code and train took the middle {size} pixels of the picture")
        fitted = "population" in vars(self.whole)
        return Ladder(
            self.source,
            len(self.whole.splats) if fitted else 0,
            self.whole.source_psnr(self.whole.exact) if fitted else None,
            tuple(GroupResult(group, steps[group.name]) for group in GROUPS if group.name in steps),
            curves,
            error_pictures(self.whole, tuple(group for group in GROUPS if group.name in self.names)),
            tuple(self.notes),
            machine(),
            time.perf_counter() - self.begin,
        )

    def _share(self, kind: str, *, wanted: bool) -> float:
        """The seconds that this kind may take of those left, which the kinds after it share as well."""
        left = max(self.total - (time.perf_counter() - self.begin), 0)
        wanted_kinds = {group.kind for group in GROUPS if group.name in self.names}
        after = sum(share for name, share in self.shares.items() if name in (*wanted_kinds, *self.names))
        mine = self.shares.pop(kind)
        return left * mine / after if wanted else 0.0

    def _measure(self, groups: list[Group], subject: Subject, seconds: float) -> dict[str, tuple[Step, ...]]:
        """Run the rungs of groups of one kind in turns; equal choices of several groups run once."""
        seeded = groups[0].kind != "rendering"
        rungs = {rung.choice: rung.name for group in groups for rung in group.rungs}
        choices = list(rungs)
        judged: list[list[Judgement]] = [[] for _ in choices]
        self._tell(f"{groups[0].kind}: getting ready")
        for index, choice in enumerate(choices if not seeded else choices[:1]):  # what is compiled, compiles here
            outcome = choice.run(subject, 0)
            if not seeded:
                judged[index].append(choice.judge(subject, outcome))
            self._tell(f"{groups[0].kind}: {rungs[choice]}, getting ready")

        def turn(index: int) -> Callable[[int], float]:
            choice = choices[index]
            if not seeded:
                return lambda number: visit(lambda: choice.run(subject, number))

            def run_and_judge(number: int) -> float:
                outcome, taken = timed(lambda: choice.run(subject, number))
                judged[index].append(choice.judge(subject, outcome))
                return taken

            return run_and_judge

        taken = take_turns(
            [turn(index) for index in range(len(choices))],
            self.repeats,
            time.perf_counter() + seconds,
            lambda index: self._tell(f"{groups[0].kind}: {rungs[choices[index]]}"),
        )
        times = {choice: Spread.of(values) for choice, values in zip(choices, taken, strict=True)}
        results = dict(zip(choices, judged, strict=True))
        return {group.name: steps_of(group, times, results) for group in groups}

    def _curves(self, seconds: float) -> tuple[Curve, ...]:
        """One curve per preset; the first encode only compiles."""
        encoding_curve(Settings.quick(iterations=2), self.source, math.inf)
        begin = time.perf_counter()
        quick = encoding_curve(Settings.quick(), self.source, math.inf, lambda _: self._tell("encoding, preset quick"))
        limit = min(PAPER_S, max(seconds - (time.perf_counter() - begin), MIN_PAPER * self.total))
        paper = encoding_curve(Settings.paper(), self.source, limit, lambda _: self._tell("encoding, preset paper"))
        return quick, paper

    def _on_fit(self, iteration: int, iterations: int, loss: float) -> None:
        self._tell(f"fitting splats, iteration {iteration}/{iterations}")

    def _tell(self, text: str) -> None:
        self.on_progress(text, time.perf_counter() - self.begin, self.total)


def central(picture: P, most: int) -> P:
    """The middle of a picture (H, W, 3) with at most so many pixels and its aspect; the picture itself if it fits."""
    height, width = picture.shape[:2]
    if height * width <= most:
        return picture
    factor = math.sqrt(most / (height * width))
    rows, columns = max(1, int(height * factor)), max(1, int(width * factor))
    top, left = (height - rows) // 2, (width - columns) // 2
    return cast(P, np.ascontiguousarray(picture[top : top + rows, left : left + columns]))
