"""Each faulty stream has the one fault that it names: a decoder that has forgotten the check is judged wrong by it.

A second fault of the same kind would be refused in its place, and the stream would test neither. Where no other stream
would do, the rule and the bit tell: they are judged of gsvc_ref and of spec.md's code, and advice for others.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

import pytest

from gsvc_conformance import spec
from gsvc_conformance.cases.faulty import faults
from gsvc_conformance.runner import judge_outputs
from gsvc_conformance.vector import VECTORS, read

HUGE: Final = {
    "r_5_2_splats_four_billion", "r_5_2_new_splats_four_billion", "r_5_2_splats_of_level_3", "r_5_2_splats_of_level_4",
    "r_5_2_splats_of_level_5", "r_6_6_4_sum_beyond_16_bits", "r_6_6_4_frequency_beyond_16_bits",
    "r_6_6_4_sum_beyond_32_bits", "r_5_2_main_splats_of_2_to_the_31",
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
        "r_15_6_5_word_count_one_too_many", "r_15_6_5_word_count_beyond_the_payload",
    },
    "a decoder of 64 bits sees so many elements, which do not follow; one of 32 bits is told by its vector": {
        "r_3_1_1_entry_count_plus_two_to_the_32", "r_3_1_1_word_count_plus_two_to_the_32", "r_6_6_6_two_to_the_31",
        "r_3_1_1_main_entry_count_plus_two_to_the_32",
    },
    "there is no number of six bytes that would be right": {
        "r_3_1_1_splat_count_six_bytes", "r_3_1_1_chunk_length_six_bytes", "r_3_1_1_main_chunk_length_six_bytes",
    },
    "a table that begins beyond the alphabet ends beyond it, and nothing adds up to that of no bits": {
        "r_6_6_2_first_symbol", "r_6_6_3_table_bits_0",
    },
    "the same frequencies do not add up to another power of two; r_6_6_3_table_of_13_bits has others": {
        "r_6_6_3_table_bits_13", "r_6_6_3_table_bits_31",
    },
    "a level that nobody defines is above every claim (R-5-6)": {
        "r_3_2_1_level_6", "r_3_2_1_level_255", "r_3_2_1_later_version_level_6", "r_3_2_1_before_width",
    },
    "no index is below a count of 0": {"r_6_5_6_codeword_count_zero"},
    "what was cut cannot be read, but where zeros in its place do": {
        fault.slug for fault in faults() if "_cut_" in fault.slug and "_zero_" not in fault.slug and not fault.also
    },
    "the fault that is checked later is of the same kind": {
        "r_15_5_3_no_densities",
        "r_6_2_4_before_known_type", "r_6_1_5_before_frame_count", "r_6_4_2_before_frame_number",
        "r_6_5_4_before_colors_present", "r_6_5_5_before_offset",
        "r_8_1_before_checksum",
        "r_6_6_2_before_order_of_ends", "r_6_6_3_before_symbols", "r_6_2_3_words_beyond_the_states",
        "r_6_8_1_before_header", "r_6_3_2_before_index_length", "r_6_8_2_before_what_follows",
        "r_6_2_4_main_before_known_type", "r_6_1_5_main_before_frame_count", "r_6_4_2_main_before_frame_number",
        "r_6_8_1_main_before_header", "r_6_3_2_main_before_index_length", "r_6_8_2_main_before_what_follows",
    },
}  # fmt: skip
"""Streams that a decoder without the check refuses with the same kind, and why no other stream would do."""


Decoder = Callable[[bytes, str], dict[str, Any]]


@pytest.fixture(scope="module")
def forgetful() -> Decoder:
    """spec.md's reconstruct_stream without the checks of one rule: it goes on where it would report it."""
    names: dict[str, Any] = {"__name__": "spec"}
    forgotten = ""

    def refuse(rule: str, bit: int) -> None:
        if rule != forgotten and not (rule == "R-5-9" and forgotten.startswith("R-5-")):  # the same, of the quality
            raise names["Fault"](rule, bit)

    names["refuse"] = refuse
    exec(compile(spec.source().replace("raise Fault(", "refuse("), str(spec.SPEC), "exec"), names)

    def decode(stream: bytes, rule: str) -> dict[str, Any]:
        nonlocal forgotten
        forgotten = rule
        found: dict[str, Any] = names["reconstruct_stream"](stream)
        return found

    return decode


@pytest.mark.exhaustive
def test_a_decoder_without_the_check_is_judged_wrong(forgetful: Decoder) -> None:
    alike = set()
    for fault in faults():
        if fault.slug not in HUGE:
            with suppress(ArithmeticError, LookupError, TypeError, UnboundLocalError, ValueError):  # it crashes
                answer = forgetful(fault.make(), fault.rule)
                outcome = answer["error"].partition(" ")[0], len(answer["counts"])
                alike |= {fault.slug} if outcome == (fault.kind, fault.complete) else set()
    assert alike == set().union(*ALIKE.values())


def test_rule_and_bit_tell_where_the_kind_does_not(forgetful: Decoder) -> None:
    """So that a check that spec.md's code or gsvc_ref loses is noticed, though another rule refuses the stream."""
    for slug in sorted(set().union(*ALIKE.values())):
        vector = read(VECTORS / "faulty" / "reconstruct_stream" / slug)
        rule = vector.expected["error"].value.split()[1]
        answer = forgetful(vector.inputs["stream"], rule)
        assert judge_outputs(vector, answer, in_full=True).outcome == "fail", slug
        result = judge_outputs(vector, answer)
        (error,) = (output for output in result.outputs if output.name == "error")
        assert error.passed, slug
        assert error.advice == f"names {answer['error'].split()[1]}, expected {rule}", slug


def test_no_stream_is_exempt_that_is_not_there() -> None:
    assert {fault.slug for fault in faults()} >= HUGE
