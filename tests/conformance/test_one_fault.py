"""Each faulty stream has the one fault that it names: a decoder that has forgotten the check is judged wrong by it.

A second fault of the same kind would be refused in its place, and the stream would test neither.
"""

from collections.abc import Callable
from typing import Any, Final

import pytest

from conformance import spec
from conformance.cases.faulty import faults

Outcome = tuple[str, int]
"""The judged parts of a refusal: the kind of the error, and how many frames precede it."""

HUGE: Final = {
    "r_5_2_splats_four_billion", "r_5_2_new_splats_four_billion", "r_5_2_splats_of_level_3", "r_5_2_splats_of_level_4",
    "r_5_2_splats_of_level_5", "r_6_6_4_sum_beyond_16_bits", "r_6_6_4_frequency_beyond_16_bits",
    "r_6_6_4_sum_beyond_32_bits",
}  # fmt: skip
"""A decoder that believes these takes seconds or gigabytes."""

ALIKE: Final = {
    "what is not finite makes parameters that are not (R-8-1), or is no scale (R-6.5-5)": {
        "r_3_1_2_offset_infinite", "r_3_1_2_offset_not_a_number", "r_3_1_2_scale_infinite",
        "r_3_1_2_scale_not_a_number", "r_3_1_2_codeword_infinite", "r_3_1_2_codeword_not_a_number",
        "r_6_5_7_x_infinite", "r_6_5_7_y_infinite", "r_6_5_7_x_not_a_number", "r_6_5_7_difference",
    },
    "what does not fit as a whole does not fit one by one": {
        "r_6_1_1_nothing", "r_6_1_1_seven_bytes", "r_6_6_6_one_more", "r_6_6_6_most",
    },
    "a decoder of 64 bits sees so many elements, which do not follow; one of 32 bits is told by its vector": {
        "r_3_1_1_entry_count_plus_two_to_the_32", "r_3_1_1_word_count_plus_two_to_the_32", "r_6_6_6_two_to_the_31",
    },
    "there is no number of six bytes that would be right": {
        "r_3_1_1_splat_count_six_bytes", "r_3_1_1_chunk_length_six_bytes",
    },
    "a table that begins beyond the alphabet ends beyond it, and nothing adds up to that of no bits": {
        "r_6_6_2_first_symbol", "r_6_6_3_table_bits_0",
    },
    "the same frequencies do not add up to another power of two; r_6_6_3_table_of_13_bits has others": {
        "r_6_6_3_table_bits_13", "r_6_6_3_table_bits_31",
    },
    "no index is below a count of 0": {"r_6_5_6_codeword_count_zero"},
}  # fmt: skip
"""Streams that a decoder without the check refuses with the same kind, and why no other stream would do."""


@pytest.fixture(scope="module")
def forgetful() -> Callable[[bytes, str], Outcome]:
    """spec.md's decoder without the checks of one rule: it goes on where it would report it."""
    names: dict[str, Any] = {"__name__": "spec"}
    forgotten = ""

    def refuse(rule: str, bit: int) -> None:
        if rule != forgotten:
            raise names["Fault"](rule, bit)

    names["refuse"] = refuse
    exec(compile(spec.source().replace("raise Fault(", "refuse("), str(spec.SPEC), "exec"), names)

    def outcome(stream: bytes, rule: str) -> Outcome:
        nonlocal forgotten
        forgotten = rule
        found = names["reconstruct_stream"](stream)
        return found["error"].partition(" ")[0], len(found["counts"])

    return outcome


def alike(forgetful: Callable[[bytes, str], Outcome]) -> set[str]:
    """The faulty streams that the decoder without the check answers as they must be answered."""
    found = set()
    for fault in faults():
        if fault.also or fault.slug in HUGE or "_cut_" in fault.slug:  # what was cut cannot be read
            continue
        try:
            outcome = forgetful(fault.make(), fault.rule)
        except (ArithmeticError, LookupError, UnboundLocalError, ValueError):  # it crashes where the check would stand
            continue
        if outcome == (fault.kind, fault.complete):
            found.add(fault.slug)
    return found


def test_a_decoder_without_the_check_is_judged_wrong(forgetful: Callable[[bytes, str], Outcome]) -> None:
    assert alike(forgetful) == set().union(*ALIKE.values())


def test_no_stream_is_exempt_that_is_not_there() -> None:
    assert {fault.slug for fault in faults()} >= HUGE
