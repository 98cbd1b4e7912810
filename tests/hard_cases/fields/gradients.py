"""Hard cases of the gradients of a splat's eight parameters."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.splats import Splats
from gsvc_conformance.case import cases
from gsvc_conformance.operation import Values, operations
from gsvc_ref import rendering
from gsvc_ref.rendering import Precision
from tests.hard_cases.catalogue import Entry, HardCase, LongRun
from tests.hard_cases.measuring import Measurement, Variant, implementations, measure, mutated
from tests.hard_cases.naive import gradients as naive
from tests.hard_cases.oracle.rendering import render_gradients


def of_precision(precision: Precision) -> Variant:
    """gsvc_ref's gradients in another precision than ``fast``."""

    def variant(parameters: NDArray, residual: NDArray) -> Values:
        return {"gradients": rendering.render_gradients(Splats.from_array(parameters), residual, precision=precision)}

    return variant


ALSO: Final = {precision: of_precision(precision) for precision in ("deterministic", "exact")}

CONIC: Final = ("by the inverse covariance", naive.by_the_conic)
DIFFERENCES: Final = ("finite differences", naive.by_differences)
MASKED: Final = ("mask by a product", naive.masked_by_product)
BINARY16: Final = ("binary16", naive.in_binary16)

MOMENTS: Final = (
    "dL/dx and dL/dl11 are differences of two moments, with the condition (S1 + S2 l21/l22) / abs(S1 - S2 l21/l22)"
)
"""The condition by (13-12)."""


def _case(vector: str, naive: tuple[str, Variant], danger: str, condition: str) -> HardCase:
    return HardCase(vector, danger, condition, render_gradients, naive, ALSO)


def _of_thousands() -> Measurement:
    """The gradients of 2048 splats by one pixel."""
    parameters = cases()["full/render_sum/hard_splats_on_a_pixel_2048"].run()[0]["parameters"]
    inputs = {"parameters": parameters, "residual": np.array([[[1.0, -2.0, 0.5]]], np.float32)}
    ours = implementations("render_gradients")
    expected = operations()["render_gradients"].oracle(**inputs)
    return measure(
        inputs, expected, render_gradients(**inputs), ours, mutated("render_gradients", "gradient-first-256")
    )


CASES: Final[tuple[Entry, ...]] = (
    *(
        _case(
            f"core/render_gradients/needle_{slope}",
            CONIC,
            "A needle thinner than a pixel: derivatives of the inverse divide by the square of a determinant of 0.",
            MOMENTS + ".",
        )
        for slope in ("slope_1", "slope_minus_half", "slope_2", "slope_third")
    ),
    _case(
        "stress/render_gradients/hard_needles_that_lie",
        CONIC,
        "Needles of aspect 10000: derivatives by the covariance are differences of numbers 10^8 times as large.",
        MOMENTS + ".",
    ),
    _case(
        "stress/render_gradients/hard_needles_that_stand",
        CONIC,
        "Nearly upright needles, where l21 is large beside l11.",
        MOMENTS + "; it grows with l21/l22.",
    ),
    _case(
        "stress/render_gradients/hard_specks",
        CONIC,
        "Splats of a millionth of a pixel: determinants of 10^-24, gradients of 400,000.",
        "Condition 1: one pixel, and each gradient is a product.",
    ),
    _case(
        "stress/render_gradients/hard_thousands_of_frames",
        CONIC,
        "Splats a million times as large as the frame: gradients of 10^-6, squares of determinants beyond 10^38.",
        "The residual's signs cancel in each sum, by its own condition sum abs(q m) / abs(sum q m).",
    ),
    _case(
        "stress/render_gradients/hard_leaning_bands",
        CONIC,
        "Bands of two pixels, a million frames long.",
        MOMENTS + ".",
    ),
    _case(
        "stress/render_gradients/hard_shear_of_1e6_to_1e30",
        CONIC,
        "l21 up to 1e30: the gradient of l11 has l21/(l11 l22) in it, and the covariance overflows.",
        MOMENTS + ".",
    ),
    _case(
        "stress/render_gradients/hard_smallest_l11_or_l22",
        MASKED,
        "l11 or l22 is 2^-126: v = u / l22 is infinite off the centre, and 0 times infinity is NaN.",
        "On the centre u = 0 and the geometry has no gradient. The bound divides what may underflow by l22 once and "
        "again and is beyond any use (up to 10^103): only finiteness and the colours' gradients are judged.",
    ),
    _case(
        "stress/render_gradients/hard_a_million_pixels_away",
        CONIC,
        "The tail of a splat 10^6 pixels away: gradients of 10^-7 from moments of 3.",
        "The residual's signs cancel; u is nearly the same in all pixels.",
    ),
    _case(
        "stress/render_gradients/hard_a_line_from_a_million_pixels_away",
        CONIC,
        "Narrow splats through the frame with centres 10^6 pixels away.",
        "The error of u2, 10^6 roundings, goes into every moment: one splat's bounds are 10^5 times its gradients.",
    ),
    _case(
        "stress/render_gradients/hard_ends_before_the_frame",
        CONIC,
        "Splats that end just before the frame pull all the same.",
        "Certainly not covered: exactly 0.",
    ),
    _case(
        "stress/render_gradients/hard_coverage_on",
        DIFFERENCES,
        "The only pixel with a residual has sigma = ln 255: the gradient is there, or is 0; differences see a jump.",
        "Both decisions are legal: the bound is the gradient itself. The jump has no share in the derivative (10.3).",
    ),
    _case(
        "stress/render_gradients/hard_coverage_inside",
        DIFFERENCES,
        "The same where the pixel is certainly covered: a step of 2^-10 leaves the support.",
        "Condition 1: one pixel.",
    ),
    _case(
        "stress/render_gradients/hard_coverage_outside",
        DIFFERENCES,
        "The same where the pixel is certainly not covered: the gradient is exactly 0.",
        "No error.",
    ),
    _case(
        "stress/render_gradients/hard_parameters",
        MASKED,
        "Each parameter in turn is -0, subnormal, negative and subnormal: degenerate splats get NaN.",
        "Subnormal parameters may be taken for 0; degenerate splats have the gradient 0.",
    ),
    _case(
        "stress/render_gradients/hard_colours_of_10000",
        BINARY16,
        "e . c cancels: colours of 10000, 10000 and -20000 under a grey residual.",
        "Condition sum abs(e c) / abs(e . c), 10^4 and more: bounds are as large as gradients, our errors a fiftieth.",
    ),
    _case(
        "stress/render_gradients/hard_residual_that_cancels",
        DIFFERENCES,
        "An antisymmetric residual of 10^5: six of eight gradients are 0, as sums of numbers of 10^5.",
        "Infinite relative condition where the sum is 0: the error is a few 10^-7 of the sum of magnitudes.",
    ),
    *(
        _case(
            f"stress/render_gradients/hard_products_{order}",
            BINARY16,
            f"Residuals of {order} over colours of the inverse: products are of order 1, neither factor fits binary16.",
            "Condition 1 for the product.",
        )
        for order in ("1e30", "1e-30")
    ),
    *(
        _case(f"stress/render_gradients/extreme_{name}", variant, danger, condition)
        for name, variant, danger, condition in (
            (
                "further_than_any_integer",
                MASKED,
                "A splat 1e38 pixels away: u is infinite, and 0 times infinity is NaN.",
                "Not covered: exactly 0.",
            ),
            (
                "larger_than_any_integer",
                CONIC,
                "Extents of 1e30 and 1e32: the covariance overflows.",
                "The weight is 1; gradients of the geometry underflow to 0.",
            ),
            (
                "largest_factors",
                CONIC,
                "Factors of 3e38: the covariance is infinite.",
                "As above; reciprocals are subnormal.",
            ),
            (
                "a_vertical_line",
                MASKED,
                "l11 is 1e-20, so that u1 is 1e20 beside the line.",
                "Condition 1 on the line.",
            ),
            ("a_horizontal_line", MASKED, "l22 is 1e-30, so that v2 overflows beside the line.", "As above."),
        )
    ),
    LongRun(
        "2048_splats_on_a_pixel",
        "render_gradients",
        "2048 splats on one pixel: those beyond the list of a tile get no gradient.",
        "Condition 1: one pixel, each gradient is a product.",
        "256 splats a pixel",
        _of_thousands,
    ),
)
