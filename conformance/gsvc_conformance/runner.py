"""The judgement of an implementation, vector by vector."""

import math
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, TypeVar

import numpy as np

from gsvc_base.errors import UsageError
from gsvc_conformance.diagnosis.streams import elements_named
from gsvc_conformance.expectations import Expectation, Rate, Refusal
from gsvc_conformance.features import Features
from gsvc_conformance.implementations import Answer, Failure, Implementation, Unsupported
from gsvc_conformance.level import header_payload
from gsvc_conformance.names import with_names
from gsvc_conformance.operation import Operation, Values, input_size, is_unusual
from gsvc_conformance.profiles import stated_profile
from gsvc_conformance.results import FAULTS, NOT_ASKED, REFUSED, Outcome, OutputResult, Result
from gsvc_conformance.side_by_side import comparison
from gsvc_conformance.vector import Vector

T = TypeVar("T")
U = TypeVar("U")

PROFILE_REASONS: Final[Mapping[str, Sequence[list[str]]]] = {
    "main": ([], ["R-5-6"], ["R-5-6", "profile"], ["R-3.2-1", "profile"]),
    "paper": (["R-5-6"], ["R-5-6", "profile"]),
}
"""What follows `unsupported` where a stream of a profile is refused for its profile, with the bit of that element."""


@dataclass(frozen=True, eq=False)
class Judged:
    """A vector, what was answered (None: nothing) and what became of it."""

    vector: Vector
    outputs: Values | None
    result: Result


class Answered(NamedTuple):
    """An answer and the seconds that it took."""

    answer: Answer
    seconds: float


def run_suite(
    implementation: Implementation,
    vectors: Iterable[Vector],
    *,
    waivers: Mapping[str, str] | None = None,
    skips: Mapping[str, str] | None = None,
    on_result: Callable[[Judged], object] | None = None,
    jobs: int = 1,
    repeat: int = 1,
    level: int = 1,
    features: Features | None = None,
    profile: str = "",
    seconds: float = math.inf,
) -> list[Result]:
    """Judge an implementation by vectors.

    Parameters
    ----------
    implementation
        Is given copies of the inputs.
    vectors
        In the order in which they are run.
    waivers, skips
        Reasons by id: why a wrong vector does not count, and why one is not run.
    on_result
        Is called after each vector, in their order.
    jobs
        Number of vectors that are asked for at the same time; they are judged one after the other.
    repeat
        Number of times that each is asked for, one after the other.
    level
        The level up to which no stream may be refused as unsupported: that of the claim, or the lowest.
    profile
        The profile of the claim, which streams of encoders must state; empty without a claim.
    features
        What the implementation is made for: it must answer every vector inside, and may refuse every other one.
    seconds
        The time after which no more vectors are asked for: the rest is skipped.
    """
    skips = skips or {}
    end = time.monotonic() + seconds

    def skipped_for(vector: Vector) -> str:
        return skips.get(vector.id, NOT_ASKED if time.monotonic() >= end else "")

    def judged_vector(vector: Vector) -> Callable[[], Judged]:
        if reason := skipped_for(vector):
            skipped = _result(vector, "skipped", reason)
            return lambda: Judged(vector, None, by_features(skipped, features.outside(vector)) if features else skipped)
        answers = list(_asked(implementation, vector, repeat))
        return lambda: judge_answers(vector, answers, implementation.in_full, level, features, profile)

    results = []
    with closing(_mapped(judged_vector, vectors, jobs)) as mapped:  # no vector is begun after a fault or Ctrl-C
        for judge in mapped:
            judged = judge()
            if judged.vector.id in (waivers or {}) and judged.result.outcome in FAULTS:
                judged = excused(judged, (waivers or {})[judged.vector.id])
            results.append(judged.result)
            if on_result:
                on_result(judged)
    return results


def excused(judged: Judged, reason: str) -> Judged:
    """A vector that is wrong, and waived for a reason."""
    message = f"{reason} (waived {judged.result.outcome}: {judged.result.message})"
    return replace(judged, result=replace(judged.result, outcome="waived", message=message))


def judge_vector(implementation: Implementation, vector: Vector, features: Features | None = None) -> Judged:
    """Ask for one vector's outputs and judge them, by what the implementation is made for if that is said."""
    return judge_answers(vector, [ask(implementation, vector)], implementation.in_full, features=features)


def _asked(implementation: Implementation, vector: Vector, times: int) -> Iterator[Answered]:
    """The answers to one vector; what is not supported, or takes too long, is not asked again."""
    for turn in range(times):
        answered = ask(implementation, vector, turn)
        yield answered
        if isinstance(answered.answer, Unsupported) or getattr(answered.answer, "outcome", "") == "timeout":
            return


def _mapped(function: Callable[[T], U], values: Iterable[T], jobs: int) -> Generator[U]:
    """The results in the order of the values; with several jobs these are all taken at the beginning."""
    if jobs == 1:
        yield from map(function, values)
        return
    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(function, values)


def ask(implementation: Implementation, vector: Vector, turn: int = 0) -> Answered:
    """The answer of an implementation to one vector that it was asked for `turn` times before."""
    start = time.perf_counter()
    answer: Answer
    try:
        answer = implementation.run(vector.operation, _copies(vector.inputs), turn, vector.id)
    except (UsageError, OSError):  # nothing more can be asked
        raise
    except Exception as error:  # an answer may break its reader: the other vectors are judged all the same
        answer = Failure("error", f"its answer cannot be read ({_named(error)})")
    return Answered(answer, time.perf_counter() - start)


def _named(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def judge_answers(
    vector: Vector,
    answers: Sequence[Answered],
    in_full: bool = False,
    level: int = 1,
    features: Features | None = None,
    profile: str = "",
) -> Judged:
    """Judge all answers to one vector: the first wrong one stands for them, and the message says how they differ."""
    try:
        return _judged(vector, answers, in_full, level, features, profile)
    except Exception as error:  # an answer may break its judge: the other vectors are judged all the same
        message = f"its answer cannot be judged ({_named(error)}): please report it with what --keep leaves"
        return Judged(vector, None, _result(vector, "error", message, seconds=sum(one.seconds for one in answers)))


def _judged(
    vector: Vector, answers: Sequence[Answered], in_full: bool, level: int, features: Features | None, profile: str
) -> Judged:
    outside = features.outside(vector) if features else ""
    judged = [judge_answer(vector, answer, in_full, level, outside) for answer in answers]
    if vector.operation.name == "encode_video":
        judged = [replace(one, result=_by_profile(one, profile)) for one in judged]
    if features:
        judged = [replace(one, result=by_features(one.result, outside)) for one in judged]
    wrong = [number for number, one in enumerate(judged) if one.result.outcome in FAULTS]
    worst = judged[wrong[0]] if wrong else judged[0]
    seconds = sum(one.result.seconds for one in judged)
    keys = [_key(answer.answer) for answer in answers]
    difference = _difference(keys, len(wrong), len(judged)) if len(set(keys)) > 1 else ""
    message = "; ".join(part for part in (difference, worst.result.message) if part)
    return replace(worst, result=replace(worst.result, message=message, seconds=seconds))


def _by_profile(judged: Judged, claimed: str) -> Result:
    """The result of an encoder, whose streams must be of the profile that is claimed, if one is (R-13-7)."""
    if judged.outputs is None or judged.result.outcome != "pass":
        return judged.result
    stated = stated_profile(judged.outputs["stream"])
    if claimed in ("", stated):
        return replace(judged.result, profile=stated)
    return replace(
        judged.result, outcome="fail", message=f"output stream is of profile {stated}, and the claim is {claimed}"
    )


def _difference(keys: Sequence[object], wrong: int, times: int) -> str:
    """The difference of the answers to one vector in words, and what may cause it."""
    what = f"gave {len(set(keys))} different answers in {times} runs"
    if not wrong:
        return f"{what}, each within what is allowed: an order of summation that changes from run to run does that"
    what += f", of which {wrong} {'is' if wrong == 1 else 'are'} wrong" if wrong < times else ""
    if times > 2 and len(set(keys[1:])) == 1:
        return f"{what}: only the first differs, so it has something of the vector before, or of what is done once"
    return f"{what}: a race, or memory that is read before it is written"


def _key(answer: Answer) -> object:
    """Something that is equal for answers that are the same."""
    if isinstance(answer, Unsupported | Failure):
        return type(answer), getattr(answer, "outcome", "")
    return tuple((name, _bytes(value)) for name, value in sorted(answer.items()))


def _bytes(value: object) -> object:
    if isinstance(value, bytes):
        return value
    array = np.asarray(value)
    return array.dtype.str, array.shape, array.tobytes() if array.dtype.kind != "O" else repr(value)


def by_features(result: Result, outside: str) -> Result:
    """The result of a vector for an implementation that says what it is made for.

    Parameters
    ----------
    result
        The result without that.
    outside
        What the vector needs beside the features, in words; empty if nothing.
    """
    if outside:
        if result.outcome == "unsupported":
            message = f"{result.message}: outside of its features ({outside})"
        elif result.outcome in FAULTS:
            message = f"outside of its features ({outside}), where it must be right or unsupported: {result.message}"
        else:
            message = result.message
        return replace(result, outside=outside, message=message)
    if result.outcome == "unsupported":
        return replace(result, outcome="fail", message=f"inside of its features, and unsupported: {result.message}")
    return result


def judge_answer(
    vector: Vector, answered: Answered, in_full: bool = False, level: int = 1, outside: str = ""
) -> Judged:
    """Judge an answer to one vector."""
    answer, seconds = answered
    if isinstance(answer, Unsupported):
        return Judged(vector, None, _result(vector, "unsupported", answer.reason, seconds=seconds))
    if isinstance(answer, Failure):
        result = replace(_result(vector, answer.outcome, answer.message, seconds=seconds), log=answer.log)
        return Judged(vector, None, result)
    return Judged(vector, answer, judge_outputs(vector, answer, in_full, seconds, level, outside))


def judge_outputs(
    vector: Vector,
    outputs: Values,
    in_full: bool = False,
    seconds: float = 0.0,
    level: int = 1,
    outside: str = "",
) -> Result:
    """The result of a vector whose outputs are there.

    Parameters
    ----------
    vector, outputs
        The vector and all its outputs.
    in_full
        Whether rule and bit offset of refusals are judged, too.
    seconds
        The time that they took, in seconds.
    level
        The level above which a stream may be refused as unsupported (R-13-5).
    outside
        Why it may be refused as unsupported at any level, in words; empty for no reason.
    """
    judged = tuple(
        _judge(
            vector.operation,
            name,
            expected.beside(outputs) if isinstance(expected, Rate) else expected,
            outputs[name],
            in_full,
        )
        for name, expected in vector.expected.items()
    )
    wrong = [output for output in judged if not output.passed]
    refusal = _refusal_as_unsupported(vector, outputs, allowed=bool(outside) or vector.level > level)
    if refusal and (wrong or _is_not_claimed(outputs)):
        above = vector.level > level and not outside
        why = f"{refusal}: its level is {vector.level}" if above else refusal
        return _result(vector, "unsupported", why, seconds=seconds)
    if not wrong:
        return _result(vector, "pass", "", judged, seconds)
    message = "; ".join(
        f"output {output.name} {output.message}{_elements(vector, output.name, outputs)}" for output in wrong
    )
    result = _result(vector, "fail", message, judged, seconds)
    return replace(result, table=comparison(vector, outputs))


def _judge(operation: Operation, name: str, expectation: Expectation, actual: object, in_full: bool) -> OutputResult:
    if in_full and isinstance(expectation, Refusal):
        expectation = replace(expectation, in_full=True)
    judgement = expectation.judge(actual)
    message = with_names(operation, name, judgement.message, np.shape(expectation.value))
    refused = _refused(expectation, actual)
    return OutputResult(
        name, expectation.check, judgement.passed, message, judgement.ratio, judgement.place, judgement.wrong,
        refused, _advice(expectation, actual, refused),
    )  # fmt: skip


def _refused(expectation: Expectation, actual: object) -> str:
    """The right part of a refusal that names the rule and the bit."""
    if not isinstance(expectation, Refusal) or not isinstance(actual, str) or len(actual.split()) < 3:
        return ""
    expected, given = expectation.value.split(), actual.split()[:3]
    same = sum(expected[:n] == given[:n] for n in (1, 2, 3))
    return REFUSED[3 - same] if expected else ""


def _advice(expectation: Expectation, actual: object, refused: str) -> str:
    """Both rules of a refusal of the right kind by another rule, in words."""
    if refused != "kind" or not isinstance(expectation, Refusal) or not isinstance(actual, str):
        return ""
    return f"names {actual.split()[1]}, expected {expectation.value.split()[1]}"


def _elements(vector: Vector, name: str, outputs: Values) -> str:
    """The elements of a stream that a wrong refusal and the right one are about."""
    expectation = vector.expected[name]
    return elements_named(vector, outputs[name], expectation.value) if isinstance(expectation, Refusal) else ""


def _refusal_as_unsupported(vector: Vector, outputs: Values, *, allowed: bool) -> str:
    """The sentence about a stream that is refused as unsupported, without frames; empty if it is not.

    It is `allowed` for any reason, or its profile must be the reason.
    """
    for name, expected in vector.expected.items():
        given = outputs[name]
        if not isinstance(expected, Refusal) or not isinstance(given, str) or given.split()[:1] != ["unsupported"]:
            continue
        reason = ["profile" if word == _profile_bit(vector) else word for word in given.split()[1:]]
        if allowed or reason in PROFILE_REASONS.get(vector.profile, ()):
            others = [value for other, value in outputs.items() if other != name]
            return f"{name} is {given!r}" if all(map(_is_nothing, others)) else ""
    return ""


def _is_not_claimed(outputs: Values) -> bool:
    """Whether an output says that the decoder does not claim the profile or level of the stream (R-5-6)."""
    return any(isinstance(value, str) and value.split()[1:2] == ["R-5-6"] for value in outputs.values())


def _profile_bit(vector: Vector) -> str:
    """The offset of `profile`, the first element of the sequence header: 96, unless `chunk_length` has two bytes."""
    streams = [value for value in vector.inputs.values() if isinstance(value, bytes)]
    return str(8 * (len(streams[0]) - len(header_payload(streams[0])))) if streams else ""


def _is_nothing(value: object) -> bool:
    """Whether an output has no elements, or is a single zero."""
    return bool(np.size(value) == 0 if np.ndim(value) else not value)  # type: ignore[arg-type]


def _result(
    vector: Vector, outcome: Outcome, message: str, outputs: tuple[OutputResult, ...] = (), seconds: float = 0.0
) -> Result:
    wrong = outcome in FAULTS
    return Result(
        vector.id, vector.title, vector.operation.group, outcome, message, outputs, seconds=seconds, level=vector.level,
        profile=vector.profile, size=input_size(vector.inputs) if wrong else 0,
        unusual=wrong and is_unusual(vector.inputs),
    )  # fmt: skip


def _copies(inputs: Values) -> Values:
    return {name: value.copy() if isinstance(value, np.ndarray) else value for name, value in inputs.items()}
