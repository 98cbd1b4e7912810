"""Hard cases of the sum of splats."""

from typing import Final

from numpy.typing import NDArray

from gsvc_base.splats import Splats
from gsvc_conformance.operation import Values
from gsvc_ref import rendering
from gsvc_ref.rendering import Precision
from tests.hard_cases.catalogue import Entry, HardCase
from tests.hard_cases.measuring import Variant, mutated
from tests.hard_cases.naive import rendering as naive
from tests.hard_cases.oracle.rendering import render_sum


def of_precision(precision: Precision) -> Variant:
    """gsvc_ref's sum in another precision than ``fast``."""

    def variant(parameters: NDArray, width: int, height: int) -> Values:
        return {"sum": rendering.render_sum(Splats.from_array(parameters), width, height, precision=precision)}

    return variant


ALSO: Final = {precision: of_precision(precision) for precision in ("deterministic", "exact")}

INVERSE: Final = ("inverse covariance", mutated("render_sum", "determinant-by-cancellation"))
NORMALIZED: Final = ("coordinates in -1..1", naive.in_normalized_coordinates)
DEVIATIONS: Final = ("cut at 3 deviations", mutated("render_sum", "support-three-sigma"))
NO_END: Final = ("no cut", mutated("render_sum", "support-without-end"))
BINARY16: Final = ("sum in binary16", naive.in_binary16)
DIVIDING: Final = ("mask by a product", naive.dividing_by_anything)

CONDITION: Final = "Roundings of d_y and l21 u1 count (abs(d_y) + abs(l21 u1)) / l22 times in u2"
"""The condition by (13-6)."""


def _case(vector: str, naive: tuple[str, Variant], danger: str, condition: str) -> HardCase:
    return HardCase(vector, danger, condition, render_sum, naive, ALSO)


CASES: Final[tuple[Entry, ...]] = (
    _case(
        "core/render_sum/a_determinant_that_cancels",
        INVERSE,
        "The determinant a c - b b of the covariance cancels to zero in binary32, and the splat vanishes.",
        "Only the pixel of the centre is covered, where u is exactly 0; beside it the weight is certainly 0.",
    ),
    *(
        _case(
            f"core/render_sum/needle_{slope}",
            INVERSE,
            "A needle thinner than a pixel loses its determinant, and with it the pixels that it passes exactly.",
            CONDITION
            + ", here up to 30,000; but on the line both cancel exactly, or but for a last digit (slope 1/3).",
        )
        for slope in ("slope_1", "slope_minus_half", "slope_2", "slope_third")
    ),
    _case(
        "stress/render_sum/hard_needles_that_lie",
        INVERSE,
        "A needle of aspect 10000 is thick, thin or gone, as the last digits of its covariance have it.",
        CONDITION + ", here up to 12: needles through the frame are accurate when d is taken from a near centre.",
    ),
    _case(
        "stress/render_sum/hard_needles_that_stand",
        INVERSE,
        "Nearly upright, l21 is much larger than l11, and the determinant is a small difference of large numbers.",
        CONDITION + ", here up to 10.",
    ),
    _case(
        "stress/render_sum/hard_specks",
        NORMALIZED,
        "A millionth of a pixel off the centre, a splat of a millionth of a pixel is missed, or seen in full.",
        "d = centre - position is exact, for both are multiples of 2^-25: condition 1. Other coordinates round first.",
    ),
    _case(
        "stress/render_sum/hard_thousands_of_frames",
        INVERSE,
        "Splats up to a million times as large as the frame have covariances of 10^14, whose inverse is rounded twice.",
        CONDITION + ", here up to 16: what is large on all sides is easy.",
    ),
    _case(
        "stress/render_sum/hard_leaning_bands",
        INVERSE,
        "Bands of two pixels that are a million frames long: the determinant keeps nothing of their width.",
        CONDITION + ", here up to 3: l21 u1 is small near the centre, however large l21 is.",
    ),
    _case(
        "stress/render_sum/hard_shear_of_1e6_to_1e30",
        INVERSE,
        "l21 up to 1e30: its square overflows.",
        CONDITION + ", here up to 5; squares of l21 are never formed.",
    ),
    _case(
        "stress/render_sum/extreme_steep",
        INVERSE,
        "l21 is 1e30 and l11 is 1: squares and products overflow, and infinity minus infinity is NaN.",
        "Where a step overflows u is infinite and the pixel is not covered; a NaN fails the comparison as well.",
    ),
    _case(
        "stress/render_sum/hard_smallest_l11_or_l22",
        INVERSE,
        "l11 or l22 is 2^-126: its square is 0, and the splat is a division by zero.",
        "On the pixel's centre u is exactly 0. Where l22 is 2^-126 and l21 is not 0, an underflow of u1 becomes a "
        "number of the order of l21: the bound (13-6) allows any weight from 0 to 1 there.",
    ),
    _case(
        "stress/render_sum/extreme_smallest_factors_on_a_centre",
        DIVIDING,
        "Both factors are 2^-126: off the centre u is infinite, and 0 times infinity is NaN.",
        "u is exactly 0 on the centre, and infinite on all other pixels, which are then not covered.",
    ),
    _case(
        "stress/render_sum/extreme_smallest_factors_off_the_centres",
        DIVIDING,
        "The same between the centres: no pixel is covered, and none is NaN.",
        "All u are infinite or near 1e37; nothing is covered.",
    ),
    _case(
        "stress/render_sum/extreme_a_vertical_line",
        INVERSE,
        "l11 is 1e-20: the variance underflows, and the line through a column of pixels with it.",
        "u1 is exactly 0 in the column and 1e20 beside it; condition 1.",
    ),
    _case(
        "stress/render_sum/extreme_a_horizontal_line",
        INVERSE,
        "l22 is 1e-30: the variance underflows, and the line along a row of pixels with it.",
        "u2 is exactly 0 in the row and 1e30 beside it; condition 1.",
    ),
    _case(
        "stress/render_sum/extreme_larger_than_any_integer",
        INVERSE,
        "Extents of 1e30 and 1e32: the box does not fit an integer, the covariance does not fit binary32.",
        "All weights are 1 to the last place. (13-5) counts an underflow of 1/l11 against a d of any size.",
    ),
    _case(
        "stress/render_sum/extreme_largest_factors",
        INVERSE,
        "All factors are 3e38, next to the largest binary32 number.",
        "Reciprocals are subnormal and may be flushed: u is then 0 and the weight 1, which it is anyway.",
    ),
    _case(
        "stress/render_sum/extreme_minus_zero",
        DEVIATIONS,
        "Position and shear are -0: a sign bit is taken for a negative number.",
        "-0 is 0 in every operation of (9-1); condition 1.",
    ),
    _case(
        "stress/render_sum/hard_a_million_pixels_away",
        DEVIATIONS,
        "A splat whose centre is 10^6 pixels away shows its edge in the frame: a box that is cut or wrapped loses it.",
        "Roundings count up to 3 times; at the edge the weight changes by 1e-5 of itself from pixel "
        "to pixel, as little as sigma's rounding, so that one column of pixels may be covered or not.",
    ),
    _case(
        "stress/render_sum/hard_a_line_from_a_million_pixels_away",
        INVERSE,
        "Narrow splats through the frame with centres 10^6 pixels away: d_y and l21 u1 cancel but for a pixel.",
        CONDITION + ", here up to 1.4 * 10^6: the line may lie a fraction of a pixel aside, and the bound is up to ten "
        "times the weight. No formula does better in binary32 with these parameters.",
    ),
    _case(
        "stress/render_sum/hard_ends_before_the_frame",
        NO_END,
        "Splats 10^6 pixels away that end a thousandth of their size before the frame tint all of it.",
        "sigma is 5.5445 or more, hundreds of its own errors beyond ln 255: the sum is certainly 0.",
    ),
    _case(
        "stress/render_sum/hard_coverage_on",
        DEVIATIONS,
        "sigma is ln 255 as nearly as binary32 positions allow.",
        "The decision is lost in the rounding of sigma: both are legal, and the bound has the weight 1/255 in it. "
        "Deterministic rendering decides by its own bits.",
    ),
    _case(
        "stress/render_sum/hard_coverage_inside",
        ("ln 255 to three digits", mutated("render_sum", "support-rounded")),
        "The nearest position for which sigma is certainly below ln 255: a rounded threshold drops the pixel.",
        "sigma is just more than its own error away from ln 255; roundings count up to 335 times (thin splat).",
    ),
    _case(
        "stress/render_sum/hard_coverage_outside",
        NO_END,
        "The nearest position for which sigma is certainly above ln 255: the pixel is not covered.",
        "As inside.",
    ),
    _case(
        "stress/render_sum/hard_parameters",
        DIVIDING,
        "Each parameter in turn is -0, subnormal, negative and subnormal: a degenerate splat is drawn as 0/0.",
        "Subnormal positions, shears and colours may be taken for 0, which moves nothing.",
    ),
    _case(
        "stress/render_sum/hard_splats_on_a_pixel_1024",
        ("256 splats a pixel", mutated("render_sum", "first-256-splats")),
        "1024 splats on one pixel exceed the list of a tile.",
        "The sum of magnitudes is up to 29 times the sum; the bound allows any order, gamma_1026 of it.",
    ),
    _case(
        "full/render_sum/hard_splats_on_a_pixel_2048",
        ("256 splats a pixel", mutated("render_sum", "first-256-splats")),
        "2048 splats on one pixel, of sizes from 1 to 1e-5.",
        "As with 1024, up to 46 times. The bound grows with the square of their number, errors far less.",
    ),
    _case(
        "stress/render_sum/hard_grey_of_colours_of_10000",
        BINARY16,
        "Twenty colours of 10000 and -10000 cancel in pairs to grey, in no order.",
        "Condition sum abs(c) g / abs(C), up to 370,000: the bound is as large as the grey; our errors are 0.003.",
    ),
    _case(
        "stress/render_sum/colours_of_another_order_huge",
        BINARY16,
        "Colours of 1e30: products overflow where halves are used.",
        "Condition 1 as long as no partial sum leaves binary32; where one does, the pixel is not bounded (9.2).",
    ),
)
