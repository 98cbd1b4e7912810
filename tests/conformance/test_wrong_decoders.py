"""Decoders that a stranger to this project made wrong, and that all vectors of then let pass: each is told now.

Most are mutants of the catalogue, and a named vector judges them wrong by the kind of an error and the frames before
it. What no stream tells by its kind, the rule and the bit of the error tell, where a decoder reports them.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any, Final

import pytest

from gsvc_conformance import spec
from gsvc_conformance.case import cases
from gsvc_conformance.cases.faulty import faults
from gsvc_conformance.expectations import Refusal
from gsvc_conformance.mutants import MUTANTS, Mutant, answer, judge, mutant

READ: Final = "core/read_stream/"
LEGAL: Final = "core/reconstruct_stream/"
FAULTY: Final = "faulty/reconstruct_stream/"

DECODERS: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "quantisers and codebooks of inter blocks survive an I-frame": {
        "kept-inter-over-i-frames": (
            FAULTY + "r_6_5_4_second_i_frame_inter_quantizer", FAULTY + "r_6_5_4_second_i_frame_inter_codebooks",
        ),
    },
    "rendering work is checked in I-frames only": {
        "work-of-p-frames-unchecked": (FAULTY + "r_5_4_splats_that_grow", FAULTY + "r_5_4_new_splats"),
    },
    "an attribute is not demanded in intra blocks": {
        "colors-not-demanded": (FAULTY + "r_6_5_2_colors",),
        "cholesky-not-demanded": (FAULTY + "r_6_5_2_cholesky",),
    },
    "a table of one symbol is accepted": {"one-symbol-accepted": (FAULTY + "r_6_6_4_one_symbol",)},
    "padding after a raw plane is not looked at": {
        "raw-padding-unchecked": (FAULTY + "r_3_1_4_behind_a_raw_plane",),
    },
    "a header may say fewer frames than there are": {
        "fewer-frames-in-header": (FAULTY + "r_6_3_2_frame_count_2",),
    },
    "frame numbers are compared by their lowest bits": {
        "frame-number-8-bits": (FAULTY + "r_6_4_1_beyond_8_bits",),
        "frame-number-14-bits": (FAULTY + "r_6_4_1_beyond_14_bits",),
        "frame-number-16-bits": (FAULTY + "r_6_4_1_beyond_16_bits",),
    },
    "a large frame count of the header is refused": {
        "large-frame-count-refused": (
            FAULTY + "r_6_3_2_frame_count_two_to_the_31", FAULTY + "r_6_3_2_frame_count_most",
        ),
    },
    "a later minor version lets what is refused pass": {
        "later-version-left-over": (
            FAULTY + "r_6_2_3_later_version_i_frame_too_long", FAULTY + "r_6_2_3_later_version_p_frame_too_long",
            FAULTY + "r_6_2_3_later_version_r_frame_too_long",
        ),
        "later-version-flags": (FAULTY + "r_3_2_1_later_version_flags_4",),
        "later-version-critical-chunks": (FAULTY + "r_3_2_1_later_version_chunk_b",),
        "later-version-short-header": (FAULTY + "r_6_2_3_later_version_header_too_short",),
    },
    "a later minor version is refused": {
        "minor-version-refused": (
            READ + "later_minor_version_nothing_new", LEGAL + "later_minor_version_nothing_new",
            LEGAL + "later_minor_version_an_element", LEGAL + "later_minor_version_many",
        ),
        "minor-version-ignored": (READ + "later_minor_version_an_element", LEGAL + "later_minor_version_many"),
    },
    "a long header is refused": {
        "header-of-512-bytes": (READ + "header_of_1024_bytes", LEGAL + "header_of_1024_bytes"),
        "header-limit-one-off": (READ + "header_of_1024_bytes", LEGAL + "header_of_1024_bytes"),
    },
    "Cholesky codes of 13 bits are accepted": {"cholesky-bits-13": (FAULTY + "r_6_3_1_cholesky_bits_13",)},
    "the length of the first chunk is held against its own type's limit": {
        "first-chunk-of-any-length": (FAULTY + "r_5_3_first_chunk",),
    },
    "runs are not held against the payload before they are read": {
        "codewords-one-by-one": (FAULTY + "r_6_2_3_before_codewords",),
        "states-one-by-one": (FAULTY + "r_6_2_3_before_lane_state",),
        "symbols-one-by-one": (FAULTY + "r_6_2_3_before_symbols",),
    },
    "an index is held against what it need not keep": {
        "index-numbers-32-bits": (
            READ + "index_with_numbers_of_33_bits", LEGAL + "index_with_numbers_of_33_bits",
        ),
        "second-index-refused": (READ + "index_behind_an_index", LEGAL + "index_behind_an_index"),
    },
    "counters have 32 bits": {
        "work-32-bits": (FAULTY + "r_5_4_beyond_32_bits",),
        "word-bytes-32-bits": (FAULTY + "r_6_6_6_two_to_the_31",),
    },
    "positions that are not finite are refused later, or not at all": {
        "r-6.5-7-unchecked": (FAULTY + "r_6_5_7_before_next_axis",),
        "position-x-unchecked": (FAULTY + "r_6_5_7_before_next_axis",),
        "position-y-unchecked": (FAULTY + "r_6_5_7_before_cholesky_code",),
        "first-position-alone": (FAULTY + "r_6_5_7_before_next_axis_of_a_splat",),
        "position-nan-accepted": (FAULTY + "r_6_5_7_before_next_axis_not_a_number",),
        "position-infinite-accepted": (
            FAULTY + "r_6_5_7_before_next_axis", FAULTY + "r_6_5_7_before_cholesky_code",
            FAULTY + "r_6_5_7_before_next_axis_of_differences",
        ),
        "position-differences-unchecked": (FAULTY + "r_6_5_7_before_next_axis_of_differences",),
    },
    "numbers that are not finite are refused later, or not at all": {
        "r-3.1-2-unchecked": (
            FAULTY + "r_3_1_2_before_cholesky_code_scale", FAULTY + "r_3_1_2_before_cholesky_code_offset",
        ),
        "number-infinite-accepted": (FAULTY + "r_3_1_2_before_cholesky_code_scale",),
        "number-nan-accepted": (FAULTY + "r_3_1_2_before_cholesky_code_offset",),
        "codeword-nan-accepted": (FAULTY + "r_3_1_2_unused_codeword_not_a_number",),
    },
    "a table of no bits, or one that begins beyond the alphabet, is refused later": {
        "table-bits-zero-accepted": (FAULTY + "r_6_6_3_before_frequency",),
        "first-symbol-unchecked": (FAULTY + "r_6_6_2_before_last_symbol",),
    },
    "codebooks of nothing are accepted": {
        "no-stages-accepted": (FAULTY + "r_6_5_6_stage_count_zero",),
        "no-codewords-accepted": (FAULTY + "r_6_5_6_before_color_index",),
    },
}  # fmt: skip
"""What is wrong; the mutants that have it so; vectors that judge them wrong."""

TOLD_BY_THE_RULE: Final = {
    "a scale that is not a number breaks R-6.5-5": (
        FAULTY + "r_3_1_2_scale_not_a_number",
        mutant("errors", "scale-nan-no-scale", "scales that are not a number taken for scales that are not positive",
               ("            scale.append(p.f32())\n",
                '            scale.append(struct.unpack("<f", p.raw(4))[0])\n'
                '            if math.isinf(scale[-1]):\n                raise Fault("R-3.1-2", p.element)\n')),
    ),
}  # fmt: skip
"""What no stream tells by its kind: the vector whose rule tells it, and the decoder."""

PAIRS: Final = [
    (decoder, vector) for mutants in DECODERS.values() for decoder, vectors in mutants.items() for vector in vectors
]


def named(name: str) -> Mutant:
    """A mutant of the catalogue."""
    return next(mutant for mutant in MUTANTS if mutant.name == name)


@cache
def vector(name: str) -> tuple[Any, Any, Any]:
    """The operation, the inputs and the expectations of a vector, made from its case; of refusals the kind counts."""
    entry = cases()[name]
    inputs, expected = entry.run()
    by_kind = {n: replace(e, in_full=False) if isinstance(e, Refusal) else e for n, e in expected.items()}
    return entry.operation, inputs, by_kind


@pytest.mark.parametrize(("decoder", "name"), PAIRS)
def test_a_vector_judges_a_wrong_decoder_wrong(decoder: str, name: str) -> None:
    operation, inputs, expected = vector(name)
    outputs = answer(named(decoder), operation, inputs)
    assert outputs is None or not all(verdict.passed for verdict in judge(expected, outputs))
    sound = spec.namespace()[operation.name](**inputs)
    assert all(verdict.passed for verdict in judge(expected, sound))


@pytest.mark.parametrize("decoder", sorted({decoder for decoder, _ in PAIRS}))
def test_a_wrong_decoder_is_right_about_ordinary_streams(decoder: str) -> None:
    operation, inputs, expected = vector(LEGAL + "overview")
    outputs = answer(named(decoder), operation, inputs)
    assert outputs is not None
    assert all(verdict.passed for verdict in judge(expected, outputs))


@pytest.mark.parametrize("what", TOLD_BY_THE_RULE)
def test_a_rule_tells_what_a_kind_does_not(what: str) -> None:
    name, decoder = TOLD_BY_THE_RULE[what]
    operation, inputs, expected = vector(name)
    outputs = answer(decoder, operation, inputs)
    assert outputs is not None
    assert all(verdict.passed for verdict in judge(expected, outputs))
    assert outputs["error"] != expected["error"].value


def test_no_other_fault_tells_it_by_its_kind() -> None:
    """So the rule, and nothing less, is what a report has to compare."""
    for _, decoder in TOLD_BY_THE_RULE.values():
        wrong = decoder.namespace()["reconstruct_stream"]
        for fault in faults():
            if fault.rule in ("R-3.1-2", "R-6.5-5"):
                outputs = wrong(stream=fault.make())
                assert (outputs["error"].split()[0], len(outputs["counts"])) == (fault.kind, fault.complete), fault.slug
