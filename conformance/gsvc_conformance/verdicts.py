"""What follows from the results of a run: summaries of operations and classes, verdicts, and the report of it all."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Literal, get_args

from gsvc_base.cli.text import plural
from gsvc_base.rendering.error_models import FP32
from gsvc_conformance.claim import Claim
from gsvc_conformance.features import Features
from gsvc_conformance.level import LEVELS
from gsvc_conformance.names import dimensions, element
from gsvc_conformance.operation import DRAWING, DRAWN, Group, operations
from gsvc_conformance.profiles import ANY, PROFILES
from gsvc_conformance.results import FAULTS, NOT_ASKED, Outcome, OutputResult, Result, make_printable, simplest_first
from gsvc_conformance.sets import quoted

NAMED: Final = 3
"""Maximum number of vectors that a sentence names."""
Verdict = Literal["passed", "waived", "incomplete", "failed", "not claimed"]

Conclusion = Literal["passed", "incomplete", "failed", "nothing judged", "ended early"]
EXIT_CODES: Final[Mapping[Conclusion, int]] = {
    "passed": 0, "incomplete": 0, "failed": 1, "nothing judged": 2, "ended early": 2,
}  # fmt: skip
"""The conclusion of a run: incomplete is no fault, so that whoever has three operations can keep them right.

A claim that is incomplete does not hold, which is a fault."""


@dataclass(frozen=True)
class Summary:
    """An operation or a class of operations in numbers.

    Attributes
    ----------
    name
        The name of the operation or class.
    counts
        Vectors by outcome.
    ratio, place
        The worst error/bound ratio of the bounded outputs, and where: ``id output element``.
    verdict
        The verdict on a class; None for an operation.
    reason
        A sentence that gives the reason of the verdict.
    level
        Of a class: the level of the claim that it passes; without a claim the highest level up to which every vector
        passes. 0 if there is none.
    profile
        Of a class with vectors of several profiles: the one that the verdict is about, beside vectors of any profile.
    """

    name: str
    counts: Mapping[Outcome, int]
    ratio: float | None
    place: str
    verdict: Verdict | None = None
    reason: str = ""
    level: int = 0
    profile: str = ""

    @property
    def title(self) -> str:
        """The name, with the profile if it is that of one."""
        return f"{self.name}, profile {self.profile}" if self.profile else self.name

    @property
    def total(self) -> int:
        """The number of vectors."""
        return sum(self.counts.values())

    @property
    def faults(self) -> int:
        """The number of wrong ones."""
        return sum(self.counts.get(outcome, 0) for outcome in FAULTS)

    @property
    def excused(self) -> int:
        """The number of waived and skipped ones."""
        return self.counts.get("waived", 0) + self.counts.get("skipped", 0)


@dataclass(frozen=True)
class Report:
    """A run of the suite.

    Attributes
    ----------
    environment
        The kit, the document, the vectors, the machine and the time, by name.
    command
        The command that ran it; with ``--case ID`` after it, it runs one vector again.
    selection
        The selection in words; empty for all.
    notes
        Sentences that a reader must know.
    results
        In the order of the vectors.
    runs_on
        The implementation's own environment as it says, such as device and driver.
    ended
        Why vectors that were selected are missing, a sentence; empty if none is.
    claim
        The claim that was judged, or None.
    whole
        Whether all vectors of each class that was judged were selected, so that verdicts can be quoted.
    features
        What the implementation is made for, by which it was judged, or None.
    stale
        Sentences about waivers that have to leave their file, where a run must have none.
    options
        The options that say which vectors were judged, as words of a command; empty for all.
    model
        The name of the error model by which they were.
    """

    environment: Mapping[str, str]
    command: str
    selection: str
    notes: Sequence[str]
    results: Sequence[Result] = field(default=())
    runs_on: Mapping[str, str] = field(default_factory=dict)
    ended: str = ""
    claim: Claim | None = None
    whole: bool = False
    features: Features | None = None
    stale: Sequence[str] = ()
    options: str = ""
    model: str = FP32.name

    def __post_init__(self) -> None:
        make_printable(self)

    @property
    def faults(self) -> list[Result]:
        """The wrong results."""
        return [result for result in self.results if result.outcome in FAULTS]

    @property
    def not_asked(self) -> int:
        """The number of vectors that are skipped for want of time."""
        return sum(result.outcome == "skipped" and result.message == NOT_ASKED for result in self.results)

    @property
    def features_hold(self) -> bool:
        """Whether every vector inside of its features passes or is waived, and none outside of them is wrong."""
        inside = [result for result in self.results if not result.outside]
        held = all(result.outcome in ("pass", "waived") for result in inside)
        return self.features is not None and not self.faults and held

    def simplest_first(self) -> list[Result]:
        """The wrong results in the order in which to look at them: leaf operations first, core tiers, small inputs."""
        return simplest_first(self.faults)

    @property
    def conclusion(self) -> Conclusion:
        """The conclusion of the verdicts of the classes; a class that is waived has to be accompanied by a pass."""
        if self.faults or self.stale:
            return "failed"
        if self.ended:
            return "ended early"
        if self.claim:
            held = all(group.verdict in ("passed", "waived") for group in self.groups())
            return "passed" if held else "incomplete"
        if all(result.outcome != "pass" for result in self.results):
            return "nothing judged"
        return "incomplete" if any(group.verdict == "incomplete" for group in self.groups()) else "passed"

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong, something passes, and each class of which anything does is complete."""
        return self.conclusion == "passed"

    @property
    def exit_code(self) -> int:
        """0 if nothing is wrong and something passes, or if the claim holds; 1 if not; 2 if nothing can be said."""
        return 1 if self.claim and self.conclusion == "incomplete" else EXIT_CODES[self.conclusion]

    @property
    def vectors(self) -> str:
        """The vectors in words, as verdicts quote them: the number of their set, and its hash."""
        return quoted(self.environment.get("vector set", ""), self.environment.get("vectors", ""))

    def quotes(self) -> list[str]:
        """The verdicts in words that can be quoted: on each class of the claim, or on each one that passes at a level.

        There are none without all vectors of the classes.
        """
        if not self.whole or self.ended or self.not_asked:
            return []
        groups = [group for group in self.groups() if self.claim or group.verdict in ("passed", "waived")]
        declared = self.claim.declared if self.claim else ()
        quoted = [self._quote(group, profile) for group in groups for profile in self._quoted_profiles(group)]
        return [*quoted, *(f"declares {option}, which no vector judges" for option in declared)]

    def _quoted_profiles(self, group: Summary) -> Sequence[str]:
        """The profiles for which a verdict on a class holds; on a class without one, all that have a verdict."""
        if self.claim or group.profile:
            return (self.claim.profile if self.claim else group.profile,)
        own = [result for result in self.results if result.group == group.name and result.profile != ANY]
        found = _there(own or self.results) or PROFILES[:1]
        return found if len(found) == 1 or not own else ()  # an encoder whose streams are of several profiles

    def _quote(self, group: Summary, profile: str) -> str:
        level = self.claim.level if self.claim else group.level
        what = f"{self.vectors}, class {group.name}, profile {profile}{self._model_of(group)}, level {level}"
        if group.verdict in ("passed", "waived"):
            passing, waived = group.counts["pass"], group.counts.get("waived", 0)
            if waived > passing:
                return f"answers {passing} of {plural(passing + waived, 'vector')} rightly, {waived} waived: {what}"
            return f"passes {what}, {plural(waived, 'waiver')}"
        return f"does not pass {what}: {group.reason}"

    def _model_of(self, group: Summary) -> str:
        """The error model in words, where it is not fp32/1 and the class has operations whose bounds depend on it."""
        depends = any(one.group == group.name and one.by_model for one in operations().values())
        return f", model {self.model}" if depends and self.model != FP32.name else ""

    @property
    def verdict(self) -> str:
        """The verdict in a sentence."""
        names: dict[str, list[str]] = {}
        for group in self.groups():
            names.setdefault(str(group.verdict), []).append(group.title)
        parts = [f"{verdict}: {', '.join(names[verdict])}" for verdict in get_args(Verdict) if verdict in names]
        of = f" (only {self.selection})" if self.selection else ""
        return f"{'; '.join(parts)}{of}"

    def refusals(self) -> dict[str, list[str]]:
        """By class what is right of each refusal that names a rule and a bit, of `REFUSED`."""
        found: dict[str, list[str]] = {}
        for result in self.results:
            found.setdefault(result.group, []).extend(output.refused for output in result.outputs if output.refused)
        return {name: refused for name, refused in found.items() if refused}

    def advice(self) -> list[tuple[Result, OutputResult]]:
        """The refusals of the right kind that name another rule than expected, with their vectors."""
        return [
            (result, output) for result in self.results for output in result.outputs
            if output.passed and output.advice
        ]  # fmt: skip

    def again(self, vector: str) -> str:
        """The command that runs one vector again."""
        return f"{self.command} --case {vector}"

    @property
    def whole_command(self) -> str:
        """The command that makes the whole run again."""
        return f"{self.command} {self.options}".rstrip()

    def operations(self) -> list[Summary]:
        """Each operation in numbers, in the order of spec.md."""
        names = [name for name in operations() if any(result.operation == name for result in self.results)]
        return [_summary(name, [result for result in self.results if result.operation == name]) for name in names]

    def _needed(self) -> list[Result]:
        """The results without those of operations that only a decoder that draws needs, where nothing is drawn.

        Nothing is drawn by a claim without a class that draws, or if all vectors of such classes are unsupported.
        """
        drawing = {result.outcome for result in self.results if result.group in DRAWING}
        if not {*DRAWING}.isdisjoint(self.claim.judged) if self.claim else drawing != {"unsupported"}:
            return list(self.results)
        return [one for one in self.results if one.operation not in DRAWN or one.outcome != "unsupported"]

    def groups(self) -> list[Summary]:
        """Each conformance class with its verdict, in the order of spec.md, section 13.1.

        Without a claim, a class with vectors of several profiles has one verdict for each of them, about its vectors
        and those of any profile; where nothing of any profile is answered, one verdict for all. In a run that ended
        early no class passes, since nobody knows about the vectors that are left.
        """
        results = self._needed()
        there = {result.group for result in results}
        names = [name for name in get_args(Group) if name in there]
        summaries = [
            summary
            for name in names
            for summary in _classes(name, [result for result in results if result.group == name], self.claim)
        ]
        if not self.ended:
            return summaries
        return [
            replace(one, verdict="incomplete", reason=f"{one.reason}; ended early", level=0)
            if one.verdict in ("passed", "waived")
            else one
            for one in summaries
        ]


def _summary(name: str, results: Sequence[Result]) -> Summary:
    counts = Counter(result.outcome for result in results)
    measured = [(out.ratio, result, out) for result in results for out in result.outputs if out.ratio is not None]
    if not measured:
        return Summary(name, counts, None, "")
    ratio, result, output = max(measured, key=lambda entry: entry[0])
    index = f" {_element(result.operation, output)}" if output.place else ""
    return Summary(name, counts, ratio, f"{result.id} {output.name}{index}")


def _element(operation: str, output: OutputResult) -> str:
    """The name of the worst element, or its indices where this kit does not know the operation or form of a report."""
    known, place = operations().get(operation), output.place or ()
    if known is None or len(place) != len(dimensions(known, output.name)):
        return str(list(place))
    return element(known, output.name, place)


def _there(results: Iterable[Result]) -> tuple[str, ...]:
    """The profiles of which any vector is answered, rightly or wrongly."""
    found = {result.profile for result in results if result.outcome not in ("unsupported", "skipped")}
    return tuple(profile for profile in PROFILES if profile in found)


def _classes(name: str, results: Sequence[Result], claim: Claim | None) -> list[Summary]:
    """The verdicts of a class, without a claim one for each profile that it has vectors of."""
    profiles = [profile for profile in PROFILES if any(result.profile == profile for result in results)]
    answered = _there(results)
    if claim or len(profiles) < 2 or not answered or name == "encoder":
        return [_class(name, results, claim)]
    return [
        replace(
            _class(
                name,
                [one for one in results if one.profile == profile or (profile in answered and one.profile == ANY)],
            ),
            profile=profile,
        )
        for profile in profiles
    ]


def _class(name: str, results: Sequence[Result], claim: Claim | None = None) -> Summary:
    """The verdict of a class by R-13-1: every vector of the claim passes, and none of the others is wrong (R-13-5).

    Without a claim the level is the highest one up to which every vector passes.
    """
    summary = _summary(name, results)
    level = claim.level if claim else _highest(results)
    needed = [result for result in results if not claim or result.profile in (ANY, claim.profile)]
    inside = [result for result in needed if result.level <= level] if level else needed
    missing = [result for result in inside if result.outcome in ("unsupported", "skipped")]
    passing = sum(result.outcome == "pass" for result in inside)
    waived = summary.counts.get("waived", 0)
    unsupported = summary.counts.get("unsupported", 0)
    verdict: Verdict
    if summary.faults:
        verdict, reason = "failed", f"{summary.faults} of {len(results)} vectors are wrong"
        reason += f"; without {_without(missing, results)}" if missing else ""
        reason += f"; every one up to level {level} passes" if level and not claim else ""
    elif not summary.counts.get("pass", 0):
        verdict, reason = "not claimed", f"{plural(unsupported, 'vector')} unsupported"
        excused = waived + summary.counts.get("skipped", 0)
        reason += f", {excused} waived or skipped" if excused else ""
    elif missing:
        verdict, reason = "incomplete", f"{plural(passing, 'vector')} pass, none is wrong"
        reason += f"; without {_without(missing, results)}"
        reason += ", outside of its features" if all(result.outside for result in missing) else ""
        reason += f"; {waived} waived" if waived else ""
    elif waived:
        verdict, reason = "waived", f"{plural(passing, 'vector')} pass, {waived} are waived"
    else:
        verdict, reason = "passed", f"{plural(passing, 'vector')} pass"
    held = verdict in ("passed", "waived")
    above = Counter(result.outcome for result in needed if result.level > level)
    if held and above:
        said = ", ".join(f"{number} {outcome}" for outcome, number in above.items())
        reason += f" up to level {level}; above it {said}"
    return Summary(name, summary.counts, summary.ratio, summary.place, verdict, reason, level if held else 0)


def _highest(results: Sequence[Result]) -> int:
    """The highest level up to which every vector passes or is waived; 0 if there is none."""
    short = (result.level for result in results if result.outcome not in ("pass", "waived"))
    return min(short, default=max(LEVELS) + 1) - 1


def _without(missing: Sequence[Result], results: Sequence[Result]) -> str:
    """The operations of vectors that must pass and are unsupported or skipped, and how many vectors.

    Some vectors are named if their operation is answered otherwise.
    """
    answered = {result.operation for result in results if result.outcome not in ("unsupported", "skipped")}
    names = dict.fromkeys(result.operation for result in missing)
    parts = [f"part of {name}" if name in answered else name for name in names]
    strange = [result.id for result in missing if result.operation in answered]
    named = ", ".join([*strange[:NAMED], *(["..."] if len(strange) > NAMED else [])])
    return f"{', '.join(parts)} ({plural(len(missing), 'vector')}{f': {named}' if named else ''})"
