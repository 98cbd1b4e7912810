"""Streams beyond counters of some bits: decoders with such counters, for which mutants are not tried, are found."""

from collections.abc import Mapping
from typing import Any, Final

import pytest

from gsvc_conformance import spec
from gsvc_conformance.case import cases
from gsvc_conformance.expectations import Expectation
from gsvc_conformance.mutants import judge
from gsvc_conformance.operation import Values

SURVIVORS: Final = "    parameters = reference[survivors == 1]  # R-6.4-5\n"
WORK: Final = (
    ("    if amounts[0] > state.limits[name]:", "    if amounts[0] + (name == 'work') > state.limits[name]:"),
)
WRONG: Final = {
    "frames counted in 14 bits": (
        "core/reconstruct_stream/frames_beyond_14_bits",
        (("    state.next_number += 1\n", "    state.next_number = (state.next_number + 1) % 2**14\n"),),
    ),
    "frames of profile main counted in 14 bits": (
        "core/reconstruct_stream/main_frames_beyond_14_bits",
        (("    state.next_number += 1\n", "    state.next_number = (state.next_number + 1) % 2**14\n"),),
    ),
    "splats of profile main that stay, whose indices have 16 bits": (
        "core/reconstruct_stream/main_survivors_beyond_16_bits",
        (("add_differences(main.splats[stay], ", "add_differences(main.splats[np.flatnonzero(stay) % 2**16], "),),
    ),
    "a level of 2^14 splats of profile main that may not be reached": (
        "core/reconstruct_stream/main_as_many_splats_as_allowed",
        (('    if count + len(main.splats) > limits["splats"]:',
          '    if count + len(main.splats) >= limits["splats"]:'),),
    ),
    "a frame of profile main halved at most 26 times": (
        "stress/reconstruct_stream/main_most_halvings_columns",
        (("    return 2 * max(columns - 1, rows - 1).bit_length()\n",
          "    return min(26, 2 * max(columns - 1, rows - 1).bit_length())\n"),),
    ),
    "a level of 2^16 splats that may not be reached": (
        "core/{operation}/as_many_splats_as_level_2_allows",
        (('    if splat_count > state.limits["splats"]:', '    if splat_count >= state.limits["splats"]:'),),
    ),
    "survivors whose indices have 16 bits": (
        "core/reconstruct_stream/splats_beyond_16_bits",
        ((SURVIVORS, "    parameters = reference[np.flatnonzero(survivors == 1) % 2**16]\n"),),
    ),
    "65,536 splats drawn": (
        "core/decode_stream_deterministic/the_splat_beyond_16_bits",
        (("for splat, (left, right, top, bottom) in zip(parameters, reach):",
          "for splat, (left, right, top, bottom) in zip(parameters[: 2**16], reach):"),),
    ),
    "planes of 4,096 symbols": (
        "core/read_stream/planes_of_thousands_one_lane",
        (("        symbols[i] = s\n", "        symbols[i % 4096] = s\n"),),
    ),
    "1,024 words of a plane": (
        "core/read_stream/planes_of_thousands_64_lanes",
        (("x = x * 2**16 + words[taken]", "x = x * 2**16 + words[taken % 1024]"),),
    ),
    "a limit of payloads that may not be reached": (
        "full/reconstruct_stream/payload_as_long_as_allowed",
        (('    if chunk_length > (LONGEST_HEADER if chunk_type == "H" else longest):',
          '    if chunk_length >= (LONGEST_HEADER if chunk_type == "H" else longest):'),),
    ),
    "rendering work that may not be reached": (
        "core/decode_stream_deterministic/as_much_work_as_may_be_drawn",
        WORK,
    ),
    "rendering work that layers together may not reach": (
        "uncommon/reconstruct_layers/layers_of_as_much_work_as_allowed",
        WORK,
    ),
}  # fmt: skip
"""What is wrong, the case that finds it, and the patches of spec.md's code."""


@pytest.mark.exhaustive
@pytest.mark.parametrize("sentence", WRONG)
def test_what_ends_at_a_size_is_found(sentence: str) -> None:
    name, patches = WRONG[sentence]
    for operation in ("read_stream", "reconstruct_stream", "decode_stream") if "{" in name else ("",):
        case = cases()[name.format(operation=operation)]
        inputs, expected = case.run()
        assert right(spec.namespace(), case.operation.name, inputs, expected)
        assert not right(spec.namespace(patches), case.operation.name, inputs, expected)


def right(code: dict[str, Any], operation: str, inputs: Values, expected: Mapping[str, Expectation]) -> bool:
    """Whether the answer of code like that of spec.md is judged as right."""
    try:
        outputs = code[operation](**inputs)
    except (code["Fault"], IndexError):  # it refuses the stream, or counts beyond its arrays
        return False
    return all(verdict.passed for verdict in judge(expected, outputs))
