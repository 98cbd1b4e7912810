"""A reader of profile `main` that lacks a check loses a claim of `main` alone, whichever check it is.

The reader is spec.md's code, and its checks are all places where that refuses a stream, calls what does, or has a
number to compare with; so a check that the document gains is demanded here of the vectors without a word.
"""

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from itertools import islice
from typing import Any, Final

import pytest
from forgetful import (
    OPERATIONS,
    Check,
    Reader,
    calls_of_checks,
    conditions,
    inequalities,
    refusals,
    reserved_bits,
)
from test_one_fault import HUGE

from gsvc_base.draws import Draws
from gsvc_conformance.case import TIERS, Case, cases
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.coverage import UNCOVERED
from gsvc_conformance.expectations import Expectation, Refusal
from gsvc_conformance.mutants import judge
from gsvc_conformance.profiles import ANY, profile_of
from gsvc_conformance.spec import namespace

CLAIMED: Final = ("main", ANY)
"""The profiles of the vectors that a claim of `main` asks."""

Vector = tuple[Case, Any, Mapping[str, Expectation]]


@cache
def faulty() -> dict[str, list[Case]]:
    """The faulty cases by the rule that they break, those of the class `bitstream` first, then the simplest."""
    found: dict[str, list[Case]] = {}
    for operation in sorted(OPERATIONS, key=OPERATIONS.index):
        for case in cases().values():
            slug = case.id.rpartition("/")[2]
            if case.tier == "faulty" and case.operation.name == operation and slug not in HUGE:
                found.setdefault(case.rules[0], []).append(case)
    return found


@cache
def vector(name: str) -> Vector | None:
    """A case with inputs and expectations, by the kind of a refusal; None where no claim of `main` asks it."""
    case = cases()[name]
    drawn = {} if case.seed is None else {"rng": Draws(case.seed)}
    inputs = next(case.function(**case.arguments, **drawn))
    if profile_of(case.operation, inputs) not in CLAIMED:
        return None
    by_kind = {
        key: replace(value, in_full=False) if isinstance(value, Refusal) else value
        for key, value in case.operation.oracle(**inputs).items()
    }
    return case, inputs, by_kind


def asked(rules: tuple[str, ...]) -> Iterator[Vector]:
    """The vectors of a claim of `main` that break one of some rules."""
    for rule in rules:
        yield from filter(None, (vector(case.id) for case in faulty().get(rule, ())))


def is_right(reader: Reader, asked: Vector) -> bool:
    """Whether a reader answers a vector as it must."""
    case, inputs, expected = asked
    outputs = reader.answer(case.operation.name, inputs)
    return outputs is not None and all(verdict.passed for verdict in judge(expected, outputs))


def loses(reader: Reader, rules: tuple[str, ...]) -> str:
    """A vector of a claim that a reader gives a wrong answer to; empty if there is none."""
    return next((case.id for case, *rest in asked(rules) if not is_right(reader, (case, *rest))), "")


REFUSALS: Final = [(check, rule) for check in refusals() for rule in check.rules if rule not in UNCOVERED]
"""Each refusal by a rule of which vectors can tell anything."""

SECOND_OF_TWO: Final = {
    ("need", "R-6.1-1"): "what is shorter than the magic number is not the magic number (R-6.1-1)",
    ("__init__", "R-15.6-5"): "words beyond the payload leave no room for where words and raw bits meet (R-7-1)",
    ("next", "R-7-1"): "a word beyond the last one is not where words and raw bits meet (R-7-1)",
    ("read_body_head", "R-15.5-3"): "an I-frame has forgotten the densities, so there are none to use (R-15.5-4)",
}
"""Refusals without which the same streams are refused by the same kind: who leaves one out has an equal decoder."""

OPTIONAL: Final = ("12.6", "15.13")
"""The sections about seeking and layers; who forgets what others say loses a claim of `bitstream` alone."""
LAYERS_TOGETHER: Final = ("check_limit", "R-5-2")
"""A refusal for layers alone, since the splats of a base are counted where they are read."""


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader()


def test_the_whole_reader_is_right(reader: Reader) -> None:
    reader.forget(())
    for rule in faulty():
        for one in islice(asked((rule,)), 1):
            assert is_right(reader, one), one[0].id


@pytest.mark.parametrize(("check", "rule"), REFUSALS, ids=[f"{check}-{rule}" for check, rule in REFUSALS])
def test_a_refusal(reader: Reader, check: Check, rule: str) -> None:
    reader.forget([(check.line, rule)])
    lost = loses(reader, (rule,))
    assert bool(lost) != ((check.function, rule) in SECOND_OF_TWO)
    if lost and check.section not in OPTIONAL and (check.function, rule) != LAYERS_TOGETHER:
        assert lost.startswith("faulty/reconstruct_stream/"), lost


@pytest.mark.parametrize(("function", "rule"), SECOND_OF_TWO)
def test_a_refusal_that_is_the_second_of_two_is_met(reader: Reader, function: str, rule: str) -> None:
    """Some stream gets there, and another refusal takes its place."""
    reader.forget([(check.line, rule) for check, other in REFUSALS if (check.function, other) == (function, rule)])
    met = 0
    for one in asked((rule,)):
        assert is_right(reader, one)
        met += reader.left_out
    assert met > 0


def test_all_at_once(reader: Reader) -> None:
    reader.forget(None)
    for rule in {rule for _, rule in REFUSALS}:
        one = next(asked((rule,)))
        assert not is_right(reader, one), one[0].id


@pytest.mark.parametrize(
    ("check", "rule"), [(check, rule) for check in calls_of_checks() for rule in check.rules if rule not in UNCOVERED]
)
def test_a_call_of_checks(reader: Reader, check: Check, rule: str) -> None:
    """By one of its rules; a limit with R-5-9, which is nearly the same."""
    also = ["R-5-9"] * ("R-5-9" in check.rules)
    reader.forget((), [(check.line, left_out) for left_out in (rule, *also)])
    assert loses(reader, (rule,))


def lax_about(letter: str, whole: Callable[..., Any], *, by_length: bool) -> Callable[..., Any]:
    """A `read_chunk` that believes the length, or the checksum, of chunks of a type."""

    def read_chunk(s: Any, longest: int, *rest: Any, **named: Any) -> Any:
        if s.data[s.at // 8 : s.at // 8 + 1] != letter.encode():
            return whole(s, longest, *rest, **named)
        return whole(s, 2**32, *rest, **named) if by_length else whole(s, longest, compare_crc=False)

    return read_chunk


@pytest.mark.parametrize(
    ("letter", "by_length"), [(letter, False) for letter in "HIPREanx"] + [(letter, True) for letter in "IPan"]
)
def test_a_type_of_chunk(letter: str, by_length: bool) -> None:
    reader = Reader()
    reader.names["read_chunk"] = lax_about(letter, reader.names["read_chunk"], by_length=by_length)
    assert loses(reader, ("R-5-3",) if by_length else ("R-6.2-2",))


@pytest.mark.parametrize(("check", "condition"), conditions())
def test_a_condition(reader: Reader, check: Check, condition: str) -> None:
    reader.forget(())
    reader.untold = check.line, condition
    assert loses(reader, check.rules)


@pytest.mark.parametrize(("check", "bit"), reserved_bits())
def test_a_reserved_bit(reader: Reader, check: Check, bit: int) -> None:
    reader.forget(())
    reader.unseen = check.line, bit
    assert loses(reader, check.rules)


# Numbers that elements are held against

ROWS: Final = [
    (table, row, side)
    for table in ("HEADER", "MAIN_HEADER")
    for row, (_, size, lowest, highest) in enumerate(namespace()[table])
    for side, bounded in (("lowest", lowest > 0), ("highest", highest < 2 ** (8 * size) - 1))
    if bounded
]
"""The bounds of the elements of the sequence header."""


@pytest.mark.parametrize(("table", "row", "side"), ROWS)
def test_a_bound_of_the_header(table: str, row: int, side: str) -> None:
    reader = Reader()
    name, size, lowest, highest = reader.names[table][row]
    free = (name, size, 0, highest) if side == "lowest" else (name, size, lowest, 2 ** (8 * size) - 1)
    reader.names[table] = [free if n == row else other for n, other in enumerate(reader.names[table])]
    assert loses(reader, ("R-6.3-1", "R-3.2-1"))


class Blind(int):
    """A highest value, for who does not look at a bit above it."""

    bit: int

    def __ge__(self, value: int) -> bool:
        return value & ~self.bit <= int(self)


BITS: Final = [
    (table, row, bit)
    for table in ("HEADER", "MAIN_HEADER")
    for row, (name, size, _, highest) in enumerate(namespace()[table])
    if name in ("flags", "main_tools")
    for bit in range(highest.bit_length(), 8 * size)
]
"""The reserved bits of the sequence header."""


@pytest.mark.parametrize(("table", "row", "bit"), BITS)
def test_a_reserved_bit_of_the_header(table: str, row: int, bit: int) -> None:
    reader = Reader()
    name, size, lowest, highest = reader.names[table][row]
    blind = Blind(highest)
    blind.bit = 1 << bit
    reader.names[table] = [
        (name, size, lowest, blind) if n == row else other for n, other in enumerate(reader.names[table])
    ]
    assert loses(reader, ("R-3.2-1",))


LIMITS: Final = {
    "pixels": ("R-5-1",), "splats": ("R-5-2",), "work": ("R-5-4",), "payload": ("R-5-3",)
}  # fmt: skip
"""The rules by the names of the limits."""


@pytest.mark.parametrize("name", LIMITS)
@pytest.mark.parametrize("level", namespace()["LEVELS"])
def test_a_limit_of_a_level(level: int, name: str) -> None:
    reader = Reader()
    reader.names["LEVELS"][level][name] = sys.maxsize
    assert loses(reader, LIMITS[name])


@pytest.mark.parametrize("name", namespace()["PER_SECOND"])
def test_a_limit_of_a_second(name: str) -> None:
    reader = Reader()
    reader.names["PER_SECOND"][name] = sys.maxsize
    assert loses(reader, ("R-5-7",))


@pytest.mark.parametrize("name", namespace()["PER_SECOND"])
def test_a_limit_of_a_second_of_a_quality(name: str) -> None:
    reader = Reader()
    whole = reader.names["add_to_second"]

    def add_to_second(splats: Any, works: Any, chunk_bit: int, state: Any) -> None:
        own, state.own = state.own, {**state.own, name: sys.maxsize}
        whole(splats, works, chunk_bit, state)
        state.own = own

    reader.names["add_to_second"] = add_to_second
    assert loses(reader, ("R-5-9",))


@pytest.mark.parametrize("level", namespace()["LEVELS"])
def test_a_limit_of_lanes(level: int) -> None:
    """Of the levels whose limit is not that of the element itself."""
    reader = Reader()
    reader.names["LANE_EXPONENTS"][level] = sys.maxsize
    (highest,) = (row[3] for row in reader.names["MAIN_HEADER"] if row[0] == "max_lane_exponent")
    assert bool(loses(reader, ("R-5-11",))) == (namespace()["LANE_EXPONENTS"][level] < highest)


# Inequalities that are one off

AT_A_MEGABYTE: Final = {("read_chunk", "R-5-9"), ("read_wanted_layer", "R-5-9")}
"""What tells these is a legal frame, or layer, of as many bytes of splats as level 1 allows."""


@cache
def legal() -> list[Vector]:
    """The legal streams of `main` with some kilobytes at most, the short ones first."""
    every = (case for case in cases().values() if case.tier in TIERS[:3] and case.operation.name in OPERATIONS)
    found = filter(None, (vector(case.id) for case in every if CAPACITY not in case.flags or "R-5-2" in case.rules))
    streams = [one for one in found if len(one[1]["stream"]) < 1 << 17]
    return sorted(streams, key=lambda one: len(one[1]["stream"]))


@pytest.mark.exhaustive
@pytest.mark.parametrize(("check", "number"), inequalities(), ids=map(str, range(len(inequalities()))))
def test_an_inequality(reader: Reader, check: Check, number: int) -> None:
    """`>` in place of `>=` accepts what is one beyond, and `>=` in place of `>` refuses what is just allowed."""
    reader.forget(())
    reader.one_off = check.line, number
    wrong = loses(reader, check.rules) or any(not is_right(reader, one) for one in legal())
    untold = {(check.function, rule) for rule in check.rules} & AT_A_MEGABYTE
    assert bool(wrong) != bool(untold), check.rules
