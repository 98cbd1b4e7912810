"""Cases of binary16: every exponent, subnormal numbers, ties and their neighbours, both ends of the range."""

from typing import Final

import numpy as np

from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.building import Array, result

F4: Final = np.float32


@case("core", "from_half", flags=["signed-zero"])
def every_exponent() -> Inputs:
    """All exponents with a few fractions, both signs, and the infinities."""
    fractions = (0, 1, 2, 0x155, 0x1FF, 0x200, 0x3FE, 0x3FF)
    bits = [e << 10 | f for e in range(31) for f in fractions] + [31 << 10]
    expected = yield {"bits": np.array(bits + [0x8000 | b for b in bits], np.uint16)}
    values = result(expected, "values")
    assert np.signbit(values).sum() == len(values) // 2
    assert values[30 * 8 + 7] == 65504


@case("core", "from_half", flags=["subnormal"])
def subnormal_halves() -> Inputs:
    """Subnormal binary16: multiples of 2^-24, which binary32 holds as normal numbers."""
    fractions = [*range(1, 40), *(1 << k for k in range(6, 10)), 0x3FD, 0x3FE, 0x3FF]
    expected = yield {"bits": np.array(fractions, np.uint16)}
    assert np.array_equal(result(expected, "values"), np.array(fractions) * 2.0**-24)


def _ties() -> Array:
    """For many neighbours among the binary16 the number in the middle, (n,) f4, exact."""
    lower = np.array([e << 10 | f for e in range(31) for f in (0, 1, 2, 0x3FE, 0x3FF)], np.uint16)[:-1]
    ends = [bits.view(np.float16).astype(np.float32) for bits in (lower, lower + np.uint16(1))]
    return (ends[0] + ends[1]) / 2


@case("core", "to_half", flags=["ties"])
def ties_to_even() -> Inputs:
    """Numbers in the middle between two binary16, of both signs: each goes to the even fraction."""
    ties = _ties()
    expected = yield {"values": np.concatenate([ties, -ties])}
    assert (result(expected, "bits") % 2 == 0).all()


@case("core", "to_half", flags=["ties"], each={"below": -np.inf, "above": np.inf})
def beside_a_tie(value: float) -> Inputs:
    """The neighbours {key}, in binary32, of the numbers in the middle: each goes to the nearer binary16.

    A conversion that cuts bits off before it rounds takes them for ties.
    """
    ties = _ties()
    expected = yield {"values": np.nextafter(ties, F4(value))}
    above = np.asarray(result(expected, "bits").view(np.float16), np.float32) > ties
    assert (above == (value > 0)).all()


@case("core", "to_half", flags=["overflow"])
def largest_half() -> Inputs:
    """Up to just below 65520 everything rounds to 65504."""
    below = np.nextafter(F4(65520), F4(0))
    expected = yield {"values": np.array([65504, 65505, 65519, below, -65504, -below], F4)}
    assert result(expected, "bits").tolist() == [0x7BFF] * 4 + [0xFBFF] * 2


@case("core", "to_half", flags=["subnormal", "signed-zero"])
def down_to_zero() -> Inputs:
    """2^-25 is a tie and becomes 0, what is more becomes 2^-24; subnormal binary32 become zeros with their sign."""
    tie = F4(2.0**-25)
    values = [
        tie,
        np.nextafter(tie, F4(1)),
        np.nextafter(tie, F4(0)),
        F4(2.0**-126),
        F4(2.0**-149),
        F4(0),
        F4(1.5 * 2.0**-24),
    ]
    expected = yield {"values": np.concatenate([values, -np.array(values)]).astype(F4)}
    plus = [0, 1, 0, 0, 0, 0, 2]
    assert result(expected, "bits").tolist() == plus + [0x8000 | bits for bits in plus]
