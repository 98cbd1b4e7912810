"""Hard cases of deterministic rendering: the bits of section 9.3, and within the bound of section 9.2."""

from collections.abc import Mapping
from typing import Any, Final

from gsvc_conformance.operation import operations
from tests.hard_cases.catalogue import Entry, HardCase
from tests.hard_cases.fields.rendering import BINARY16, DIVIDING, INVERSE, NORMALIZED
from tests.hard_cases.measuring import Truth, Variant
from tests.hard_cases.naive import rendering as naive
from tests.hard_cases.oracle.rendering import render_sum

BITS: Final = "The bits are fixed by (9-3) to (9-6)"


def truth(**inputs: Any) -> Mapping[str, Truth]:
    """(9-2), and the bound of section 13.4, which deterministic rendering has to keep as well."""
    bound = operations()["render_sum"].oracle(**inputs)["sum"].bound
    return {"sum": Truth(render_sum(**inputs)["sum"].value, bound)}


def _case(slug: str, naive: tuple[str, Variant], danger: str, condition: str) -> HardCase:
    return HardCase(f"stress/render_sum_deterministic/{slug}", danger, condition, truth, naive)


OTHER_ORDER: Final = ("division, exp", naive.renderer(naive.forward_substitution))

CASES: Final[tuple[Entry, ...]] = (
    _case(
        "hard_needles_that_lie",
        INVERSE,
        "The reciprocals of (9-3) of a needle lose its width.",
        BITS + "; roundings count up to 12 times.",
    ),
    _case("hard_specks", NORMALIZED, "1/l11 is a million: d must be exact before it is multiplied.", BITS + "."),
    _case(
        "hard_shear_of_1e6_to_1e30",
        INVERSE,
        "l21 / l22, or l21 u1, overflows in one of the two orders of (9-3).",
        BITS + ", which take the order that keeps products small: l22 <= 1 or above.",
    ),
    _case(
        "hard_a_line_from_a_million_pixels_away",
        OTHER_ORDER,
        "Where roundings count 10^6 times, each order of them puts the line elsewhere.",
        BITS + ": every machine puts it at the same place, a fraction of a pixel from the true one.",
    ),
    *(
        _case(
            f"hard_coverage_{side}",
            OTHER_ORDER,
            f"A pixel {words} the threshold is covered on one machine and not on another.",
            BITS + "; m is compared with K to the bit.",
        )
        for side, words in (("on", "on"), ("inside", "just inside"), ("outside", "just outside"))
    ),
    _case("hard_parameters", DIVIDING, "A degenerate splat is drawn, or a subnormal colour flushed.", BITS + "."),
    _case(
        "hard_grey_of_colours_of_10000",
        BINARY16,
        "Another order of adding gives another grey.",
        BITS + "; condition 370,000: the same grey everywhere, 0.003 off.",
    ),
    *(
        _case(f"extreme_{name}", naive, danger, BITS + ".")
        for name, naive, danger in (
            (
                "infinity_minus_infinity",
                DIVIDING,
                "u2 is infinity minus infinity: the comparison with a NaN must fail.",
            ),
            ("a_product_that_would_overflow", DIVIDING, "l21 u1 overflows unless l21 is divided first."),
            ("a_subnormal_shear", OTHER_ORDER, "l and r2 are next to subnormal numbers, which are kept."),
            ("smallest_factors_on_a_centre", DIVIDING, "1/l11 is 2^126; its square overflows off the centre."),
        )
    ),
)
