"""The judgement of an implementation, vector by vector."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np

from conformance.expectations import Expectation, Refusal
from conformance.implementations import Answer, Failure, Implementation, Unsupported
from conformance.names import told
from conformance.results import FAULTS, REFUSED, Outcome, OutputResult, Result
from conformance.side_by_side import comparison
from conformance.stage import Stage, Values, input_size
from conformance.vectors import Vector

T = TypeVar("T")
U = TypeVar("U")


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
) -> list[Result]:
    """Judge an implementation by vectors.

    Parameters
    ----------
    implementation
        Is given copies of the inputs.
    vectors
        In the order in which they are run.
    waivers, skips
        By id, why a vector that is wrong does not count, and why one is not run.
    on_result
        Is called after each vector, in their order.
    jobs
        How many vectors are asked for at the same time; they are judged one after the other.
    """
    skips = skips or {}

    def answered(vector: Vector) -> tuple[Vector, Answered | None]:
        return vector, None if vector.id in skips else ask(implementation, vector)

    results = []
    for vector, answer in _mapped(answered, vectors, jobs):
        if answer is None:
            judged = Judged(vector, None, _result(vector, "skipped", skips[vector.id]))
        else:
            judged = judge_answer(vector, answer, implementation.in_full)
        if vector.id in (waivers or {}) and judged.result.outcome in FAULTS:
            message = f"{(waivers or {})[vector.id]} (waived {judged.result.outcome}: {judged.result.message})"
            judged = replace(judged, result=replace(judged.result, outcome="waived", message=message))
        results.append(judged.result)
        if on_result:
            on_result(judged)
    return results


def judge_vector(implementation: Implementation, vector: Vector) -> Judged:
    """Ask for one vector's outputs and judge them."""
    return judge_answer(vector, ask(implementation, vector), implementation.in_full)


def _mapped(function: Callable[[T], U], values: Iterable[T], jobs: int) -> Iterator[U]:
    """The results in the order of the values; with several jobs these are all taken at the beginning."""
    if jobs == 1:
        yield from map(function, values)
        return
    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(function, values)


def ask(implementation: Implementation, vector: Vector) -> Answered:
    """What an implementation answers to one vector."""
    start = time.perf_counter()
    answer = implementation.run(vector.stage, _copies(vector.inputs))
    return Answered(answer, time.perf_counter() - start)


def judge_answer(vector: Vector, answered: Answered, in_full: bool = False) -> Judged:
    """Judge an answer to one vector."""
    answer, seconds = answered
    if isinstance(answer, Unsupported):
        return Judged(vector, None, _result(vector, "unsupported", answer.reason, seconds=seconds))
    if isinstance(answer, Failure):
        result = replace(_result(vector, answer.outcome, answer.message, seconds=seconds), log=answer.log)
        return Judged(vector, None, result)
    return Judged(vector, answer, judge_outputs(vector, answer, in_full, seconds))


def judge_outputs(vector: Vector, outputs: Values, in_full: bool = False, seconds: float = 0.0) -> Result:
    """The result of a vector whose outputs are there.

    Parameters
    ----------
    vector, outputs
        The vector and all its outputs.
    in_full
        Whether rule and bit offset of refusals are judged, too.
    seconds
        What they took.
    """
    if refusal := _legal_refusal(vector, outputs):
        return _result(vector, "unsupported", refusal, seconds=seconds)
    judged = tuple(
        _judge(vector.stage, name, expected, outputs[name], in_full) for name, expected in vector.expected.items()
    )
    wrong = [output for output in judged if not output.passed]
    if not wrong:
        return _result(vector, "pass", "", judged, seconds)
    message = "; ".join(f"output {output.name} {output.message}" for output in wrong)
    result = _result(vector, "fail", message, judged, seconds)
    return replace(result, table=comparison(vector, outputs), size=input_size(vector.inputs))


def _judge(stage: Stage, name: str, expectation: Expectation, actual: object, in_full: bool) -> OutputResult:
    if in_full and isinstance(expectation, Refusal):
        expectation = replace(expectation, in_full=True)
    judgement = expectation.judge(actual)
    message = told(stage, name, judgement.message, judgement.place, np.shape(expectation.value))
    return OutputResult(
        name, expectation.check, judgement.passed, message, judgement.ratio, judgement.place, judgement.wrong,
        _refused(expectation, actual),
    )  # fmt: skip


def _refused(expectation: Expectation, actual: object) -> str:
    """What of a refusal is right, of those who tell the rule and the bit."""
    if not isinstance(expectation, Refusal) or not isinstance(actual, str) or len(actual.split()) < 3:
        return ""
    expected, given = expectation.value.split(), actual.split()[:3]
    same = sum(expected[:n] == given[:n] for n in (1, 2, 3))
    return REFUSED[3 - same] if expected else ""


def _legal_refusal(vector: Vector, outputs: Values) -> str:
    """What is said of an uncommon stream that a decoder need not support; empty if it is not refused as unsupported."""
    for name, expected in vector.expected.items():
        if vector.level == "uncommon" and isinstance(expected, Refusal) and not expected.value:
            given = outputs[name]
            if isinstance(given, str) and given.split()[:1] == ["unsupported"]:
                return f"{name} is {given!r}"
    return ""


def _result(
    vector: Vector, outcome: Outcome, message: str, outputs: tuple[OutputResult, ...] = (), seconds: float = 0.0
) -> Result:
    title = str(vector.manifest["title"])
    return Result(vector.id, title, vector.stage.group, outcome, message, outputs, seconds=seconds)


def _copies(inputs: Values) -> Values:
    return {name: value.copy() if isinstance(value, np.ndarray) else value for name, value in inputs.items()}
