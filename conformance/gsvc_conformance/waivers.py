"""Waivers: failures that are known, as data in TOML: which vectors, why, for how long.

[[waiver]]
vectors = ["core/render_sum/*"]     # ids or globs
reason = "driver bug: ..."
issue = "https://..."               # may be left out
until = 2027-01-31                  # may be left out; after that day the waiver counts no more
"""

import datetime
import json
import textwrap
from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from gsvc_base.errors import UsageError
from gsvc_conformance.causes import MEND, looks_like
from gsvc_conformance.globs import MAX_GLOB, Names
from gsvc_conformance.reading import read_toml
from gsvc_conformance.results import FAULTS, Result
from gsvc_conformance.schema import cut, shown
from gsvc_conformance.spelling import question

KEYS: Final = ("vectors", "reason", "issue", "until")
TABLE: Final = "waiver"
QUOTED: Final = 60
"""Characters of a reason that a sentence about its waiver quotes."""
MAX_NAMED: Final = 3
"""Maximum number of vectors that such a sentence names; more are counted."""
MAX_UNMATCHED: Final = 10
"""Maximum number of globs without a vector that get a sentence each; more are counted."""
FEWEST: Final = 3
"""Minimum number of vectors that a glob is written for."""
HEAD: Final = """\
# Known failures, written by `gsvc-conformance run --write-waivers` on {today}.
# Say in each reason why the failure may stay, and add issue = "https://..." and until = 2027-01-31, its last day.
"""


@dataclass(frozen=True)
class Waiver:
    """Vectors that may be wrong.

    Attributes
    ----------
    vectors
        Ids, or globs that match whole ids.
    reason
        Why they may.
    issue
        Where it is followed up; may be empty.
    until
        The last day on which the waiver counts; None if it has no end.
    """

    vectors: tuple[str, ...]
    reason: str
    issue: str = ""
    until: datetime.date | None = None

    def __str__(self) -> str:
        return f'the waiver "{textwrap.shorten(self.reason, QUOTED, placeholder="...")}"'

    @property
    def excuse(self) -> str:
        """The reason, and where it is followed up."""
        return f"{self.reason} ({self.issue})" if self.issue else self.reason


@dataclass(frozen=True)
class Matches:
    """Which vectors of a folder waivers name; one pass over their globs finds it.

    Attributes
    ----------
    counting, over
        By the id of a vector, the first waiver that names it and counts, and the first one that names it and is over.
    unmatched
        Each id or glob that matches no vector, with its waiver.
    """

    counting: dict[str, Waiver]
    over: dict[str, Waiver]
    unmatched: list[tuple[Waiver, str]]


@dataclass(frozen=True)
class Waivers:
    """The waivers of a file, as they count on some day.

    Attributes
    ----------
    entries
        In the order of the file; of several that name a vector, the first one that counts is taken.
    today
        The day.
    """

    entries: tuple[Waiver, ...] = ()
    today: datetime.date = datetime.date.min

    def of(self, name: str) -> Waiver | None:
        """The waiver of a vector that counts today."""
        return self.among([name]).counting.get(name)

    def among(self, names: Iterable[str]) -> Matches:
        """Which of some vectors they name."""
        return _matches(self, tuple(names))

    def counting(self) -> list[Waiver]:
        """Those that are not over."""
        return [waiver for waiver in self.entries if not self.is_over(waiver)]

    def ended(self, name: str) -> str:
        """A sentence about the waiver of a vector that counts no more; empty if there is none, or another counts."""
        found = self.among([name])
        return "" if name in found.counting or name not in found.over else _end(found.over[name])

    def reasons(self, names: Iterable[str]) -> dict[str, str]:
        """The reasons by id, of the vectors that are waived today."""
        names = tuple(names)
        counting = self.among(names).counting
        return {name: counting[name].excuse for name in names if name in counting}

    def unmatched(self, names: Sequence[str]) -> list[str]:
        """A sentence about each id or glob that matches no vector of a folder, if these are few."""
        found = self.among(names).unmatched
        sentences = [
            f"{waiver} names {pattern}, which matches no vector{question(pattern, names)}"
            for waiver, pattern in found[:MAX_UNMATCHED]
        ]
        more = len(found) - MAX_UNMATCHED
        return sentences + [f"{more:,} other ids or globs of waivers match no vector: take them out"] * (more > 0)

    def stale(self, results: Sequence[Result], names: Sequence[str]) -> list[str]:
        """A sentence about each waiver or glob to take out: it is over, matches no vector, or is not needed.

        Parameters
        ----------
        results
            Those of a run.
        names
            The ids of all vectors of the folder.
        """
        sentences = [_end(waiver) for waiver in self.entries if self.is_over(waiver)] + self.unmatched(names)
        counting = self.among(names).counting
        passing: dict[Waiver, list[str]] = {}
        for result in results:
            if result.outcome == "pass" and result.id in counting:
                passing.setdefault(counting[result.id], []).append(result.id)
        for waiver in self.entries:
            if found := passing.pop(waiver, None):
                sentences.append(f"{waiver} is not needed: {_listed(found)} {'pass' if found[1:] else 'passes'}")
        return sentences

    def is_over(self, waiver: Waiver) -> bool:
        """Whether its last day is past."""
        return waiver.until is not None and waiver.until < self.today


@lru_cache(maxsize=2)
def _matches(waivers: Waivers, names: tuple[str, ...]) -> Matches:
    index = Names(names)
    found = Matches({}, {}, [])
    for waiver in waivers.entries:
        first = found.over if waivers.is_over(waiver) else found.counting
        for pattern in waiver.vectors:
            matched = False
            for name in index.matching(pattern):
                matched = True
                first.setdefault(name, waiver)
            if not matched:
                found.unmatched.append((waiver, pattern))
    return found


def _end(waiver: Waiver) -> str:
    return f"{waiver} ended on {waiver.until}: it counts no more"


def _listed(names: Sequence[str]) -> str:
    more = len(names) - MAX_NAMED
    return ", ".join(names[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "")


def read_waivers(path: Path | None, today: datetime.date | None = None) -> Waivers:
    """The waivers of a TOML file; none of no file.

    Parameters
    ----------
    path
        The file.
    today
        The day by which `until` is judged; None: today.

    Raises
    ------
    UsageError
        It cannot be read, or says what no waiver can say.
    """
    today = today or datetime.date.today()
    if path is None:
        return Waivers((), today)
    try:
        value = read_toml(path)
    except OSError as error:
        raise UsageError(f"the waivers {path} cannot be read: {error.strerror}") from None
    except UsageError as error:
        raise UsageError(f"{error}; protocol.md shows what waivers look like") from None
    for key in value.keys() - {TABLE}:
        raise UsageError(f"{path} has {shown(key)} outside of a waiver; each waiver begins with [[waiver]]")
    tables = value.get(TABLE, [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise UsageError(f"{path} has one [waiver]; each of them begins with [[waiver]]")
    return Waivers(tuple(_waiver(f"waiver {n} of {path}", table) for n, table in enumerate(tables, 1)), today)


def _waiver(what: str, table: Mapping[str, Any]) -> Waiver:
    """A waiver from its table.

    Raises
    ------
    UsageError
        It is not one.
    """
    for key in table:
        if key not in KEYS:
            near = question(key, KEYS) or f"; it takes {', '.join(KEYS)}"
            raise UsageError(f"{what} has the key {shown(key)}{near}")
    vectors, until = table.get("vectors"), table.get("until")
    if not isinstance(vectors, list) or not vectors or not all(isinstance(name, str) and name for name in vectors):
        raise UsageError(f'{what} must have vectors = ["..."], ids of vectors or globs')
    if too_long := [name for name in vectors if len(name) > MAX_GLOB]:
        raise UsageError(f"{what} names {too_long[0][:QUOTED]!r}..., which is longer than any id: shorten it")
    if not _is_text(table.get("reason")):
        raise UsageError(f'{what} ({vectors[0]}) must have reason = "...", which says why these vectors may be wrong')
    if not _is_text(table.get("issue", "none")):
        raise UsageError(
            f"{what} ({vectors[0]}) has the issue {shown(table['issue'])}; it must be a text, or be left out"
        )
    if until is not None and type(until) is not datetime.date:
        given = shown(until) if isinstance(until, str) else cut(str(until))
        raise UsageError(f"{what} ({vectors[0]}) has until = {given}; it must be a date without quotes: 2027-01-31")
    return Waiver(tuple(vectors), table["reason"].strip(), table.get("issue", ""), until)


def _is_text(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip())


def renewed(
    waivers: Waivers, results: Sequence[Result], names: Sequence[str], examined: Container[str] = ()
) -> Waivers:
    """Waivers for all that is wrong in a run: those there are, as far as they are needed, and new ones.

    An id or glob that no result passes stays, so that a run of a part loses none. What is new is grouped by what it
    looks like, or by its message.

    Parameters
    ----------
    waivers
        Those that the run had.
    results, names
        As in `Waivers.stale`.
    examined
        The ids of the failures in which causes were looked for.
    """
    kept = []
    found = waivers.among(names)
    unmatched = {pattern for _, pattern in found.unmatched}
    of_each: dict[Waiver, list[Result]] = {}
    for result in results:
        if result.id in found.counting:
            of_each.setdefault(found.counting[result.id], []).append(result)
    for waiver in waivers.counting():
        mine = of_each.pop(waiver, [])
        needed = [result.id for result in mine if result.outcome != "pass"]
        passing = Names({result.id for result in mine} - set(needed))
        known = [p for p in waiver.vectors if p not in unmatched]
        globs = [p for p in known if not any(passing.matching(p))]
        index = Names(needed)
        covered = {name for glob in globs for name in index.matching(glob)}
        left = [name for name in needed if name not in covered]
        if globs or left:
            kept.append(replace(waiver, vectors=(*globs, *patterns(left, names))))
    groups: dict[tuple[str, str], list[str]] = {}
    for result in results:
        if result.outcome in FAULTS:
            groups.setdefault((result.operation, _why(result, results, examined)), []).append(result.id)
    new = [Waiver(tuple(patterns(chosen, names)), reason) for (_, reason), chosen in groups.items()]
    return Waivers((*kept, *new), waivers.today)


def _why(result: Result, results: Sequence[Result], examined: Container[str]) -> str:
    """A reason for a new waiver: what most failures of the operation look like, or the message."""
    like = Counter(cause for other in results if other.operation == result.operation for cause in other.causes)
    if result.outcome != "fail" or not like:
        return f"{result.outcome}: {result.message}"
    if not result.causes:
        known = "examined, no cause found" if result.id in examined else "not examined"
        most = like.most_common(1)[0][0]
        return f"{known}; " + (most if most.endswith(MEND) else f"others of {result.operation} look like {most}")
    return looks_like(max(result.causes, key=lambda cause: like[cause]))


def patterns(chosen: Iterable[str], names: Sequence[str]) -> list[str]:
    """Globs and ids that match some vectors and no others of a folder."""
    left = dict.fromkeys(chosen)
    wanted, found = set(left), []
    while left:
        name = next(iter(left))
        fitting = (entry for entry in _globs(name, names) if wanted.issuperset(entry[1]))
        glob, matched = next(fitting, (name, [name]))
        found.append(glob)
        left = {other: None for other in left if other not in matched}
    return found


def _globs(name: str, names: Sequence[str]) -> Iterable[tuple[str, list[str]]]:
    """Globs that match a vector and enough others, the widest first, with all that they match."""
    home, _, slug = name.rpartition("/")
    words = slug.split("_")
    for count in range(len(words)):
        start = f"{home}/" + "".join(f"{word}_" for word in words[:count])
        matched = [other for other in names if other.startswith(start)]
        if len(matched) >= FEWEST:
            yield f"{start}*", matched


def to_toml(waivers: Waivers, head: str = HEAD) -> str:
    """Waivers as the text of their file, below a comment that may name the day as ``{today}``."""
    return "\n".join([head.replace("{today}", str(waivers.today)), *map(_table, waivers.entries)])


def _table(waiver: Waiver) -> str:
    quoted = [json.dumps(name, ensure_ascii=False) for name in waiver.vectors]
    lines = [f"[[{TABLE}]]", f"vectors = [{quoted[0]}]"]
    if len(quoted) > 1:
        lines[1] = "\n".join(["vectors = [", *(f"    {name}," for name in quoted), "]"])
    lines.append(f"reason = {json.dumps(waiver.reason, ensure_ascii=False)}")
    lines += [f"issue = {json.dumps(waiver.issue, ensure_ascii=False)}"] * bool(waiver.issue)
    lines += [f"until = {waiver.until}"] * (waiver.until is not None)
    return "\n".join(lines) + "\n"
