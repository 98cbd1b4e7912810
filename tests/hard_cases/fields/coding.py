"""Hard cases of planes."""

from typing import Final

from tests.hard_cases.catalogue import Entry, HardCase
from tests.hard_cases.naive import coding as naive
from tests.hard_cases.oracle import coding as oracle

CASES: Final[tuple[Entry, ...]] = (
    HardCase(
        "core/decode_plane/states_of_32_bits",
        "States above 2^31 are negative in signed words of 32 bits.",
        "None: whole numbers; no state, product or sum of a decoder reaches 2^32.",
        oracle.decode_plane,
        ("signed words of 32 bits", naive.decode_in_signed_words),
    ),
    HardCase(
        "core/decode_plane/largest_state",
        "A state of 2^32 - 1 is -1 in a signed word.",
        "None: whole numbers; no state, product or sum of a decoder reaches 2^32.",
        oracle.decode_plane,
        ("signed words of 32 bits", naive.decode_in_signed_words),
    ),
    HardCase(
        "stress/encode_plane/one_symbol_has_all_frequency",
        "A plane of one symbol: its bound of 2^32 is 0 in words of 32 bits, and the encoder shifts forever.",
        "None: whole numbers, but the bound of an encoder needs 33 bits.",
        oracle.encode_plane,
        ("words of 32 bits", naive.encode_in_32_bits),
    ),
)
