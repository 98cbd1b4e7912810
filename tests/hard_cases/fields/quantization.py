"""Hard cases of binary16, LSQ+ and residual vector quantisation."""

from typing import Final

from tests.hard_cases.catalogue import Entry, HardCase
from tests.hard_cases.measuring import mutated
from tests.hard_cases.naive import quantization as naive
from tests.hard_cases.oracle import quantization as oracle

EXACT: Final = "None: every step is exact or stated to the bit."

OF_MUTANTS: Final = {
    "half up": mutated("to_half", "to-half-ties-up"),
    "subnormal numbers are zero": mutated("to_half", "to-half-flushes"),
    "floor": mutated("lsq_quantize", "lsq-floor"),
    "floor(t + 1/2)": mutated("lsq_quantize", "lsq-half-up"),
    "the last of equals": mutated("rvq_assign", "rvq-last-of-ties"),
    "expanded": mutated("rvq_assign", "rvq-expanded-square"),
}
"""Naive formulas that are mutants of the kit."""


def halves(vector: str, danger: str, form: str) -> HardCase:
    """A conversion to binary16."""
    condition = "None: every number has one nearest binary16, or two of which one is even."
    return HardCase(vector, danger, condition, oracle.to_half, (form, OF_MUTANTS.get(form) or naive.to_half(form)))


def codes(vector: str, danger: str, condition: str, form: str) -> HardCase:
    """Codes of LSQ+."""
    return HardCase(
        vector, danger, condition, oracle.lsq_quantize, (form, OF_MUTANTS.get(form) or naive.lsq_quantizer(form))
    )


def gradients(vector: str, danger: str, condition: str, form: str) -> HardCase:
    """Gradients of LSQ+."""
    return HardCase(vector, danger, condition, oracle.lsq_gradients, (form, naive.lsq_gradient(form)))


def nearest(vector: str, danger: str, condition: str, form: str) -> HardCase:
    """Codewords."""
    return HardCase(
        vector, danger, condition, oracle.rvq_assign, (form, OF_MUTANTS.get(form) or naive.rvq_assigner(form))
    )


def update(vector: str, danger: str, condition: str) -> HardCase:
    """Moving averages of codebooks."""
    return HardCase(vector, danger, condition, oracle.rvq_update, ("probabilities e / E, any count", naive.rvq_update))


HALVES: Final[tuple[Entry, ...]] = (
    HardCase(
        "core/from_half/subnormal_halves",
        "Subnormal binary16, all of them normal in binary32, are flushed to zero.",
        EXACT,
        oracle.from_half,
        ("subnormal numbers are zero", mutated("from_half", "half-no-subnormals")),
    ),
    halves("core/to_half/ties_to_even", "Ties are rounded up.", "half up"),
    halves(
        "core/to_half/beside_a_tie_above",
        "Bits are cut off before the rounding, and a number just above a tie becomes one.",
        "cut, then rounded",
    ),
    halves(
        "core/to_half/largest_half", "What is below 65520 rounds to 65504, not to infinity.", "beyond 65504 is infinity"
    ),
    halves("core/to_half/down_to_zero", "Subnormal results are flushed to zero.", "subnormal numbers are zero"),
)

LSQ: Final[tuple[Entry, ...]] = (
    codes("core/lsq_quantize/codes_of_exact_ties", "Exact ties go the wrong way.", EXACT, "floor"),
    codes(
        "stress/lsq_quantize/codes_beside_a_half",
        "The number below a tie is rounded twice: 0.49999997 + 0.5 is 1.",
        "None with a scale of 1; with a scale that is no power of two, the quotient's error of 3.5 eps t decides ties, "
        "and either code is legal.",
        "floor(t + 1/2)",
    ),
    codes(
        "stress/lsq_quantize/codes_far_from_zero",
        "x / s - beta / s is a difference of millions that is a few thousand.",
        "x - beta is exact for neighbours; t has an error of 3.5 eps t, 0.002 steps at code 4095.",
        "x / s - beta / s",
    ),
    codes(
        "stress/lsq_quantize/codes_of_extreme_scales",
        "A quotient beyond binary32, or beyond any integer, is converted before it is clamped.",
        "None: infinity clamps to the end on its side.",
        "an integer before the clamp",
    ),
    HardCase(
        "core/lsq_dequantize/values_where_fusing_differs",
        "Product and sum are fused, and half of all values have another last bit than the encoder's.",
        "Two roundings, which are part of the definition: the bits must be equal, not only close.",
        oracle.lsq_dequantize,
        ("fused", mutated("lsq_dequantize", "lsq-fused")),
    ),
    HardCase(
        "stress/lsq_dequantize/zero_that_fusing_misses",
        "q s + beta of a splat that does not change is the rounding error of q s in place of 0, and adds up.",
        "The condition of the sum is infinite; it is exactly 0 because beta is minus the rounded product.",
        oracle.lsq_dequantize,
        ("fused", mutated("lsq_dequantize", "lsq-fused")),
    ),
    gradients(
        "stress/lsq_gradients/gradients_of_large_codes",
        "The sums of g q and g t, each in the ten thousands, differ by the gradient.",
        "q - t is exact once t is known; t itself has an error of 3.5 eps t where the scale is no power of two.",
        "two sums",
    ),
    gradients(
        "stress/lsq_gradients/gradients_of_signed_zeros",
        "-0 is taken to be below 0, and its gradient goes to the offset.",
        EXACT,
        "the sign of t",
    ),
    gradients(
        "stress/lsq_gradients/gradients_beyond_binary32",
        "A mask of 0 times an infinite q - t is NaN.",
        EXACT,
        "masks as factors",
    ),
)

CODEBOOKS: Final[tuple[Entry, ...]] = (
    nearest("core/rvq_assign/equal_codewords", "Of equal codewords the last is taken.", EXACT, "the last of equals"),
    nearest(
        "stress/rvq_assign/identical_codewords",
        "A codebook of one codeword again and again has ties everywhere, in every stage.",
        "None: equal codewords have equal distances, whatever their errors.",
        "the last of equals",
    ),
    nearest(
        "core/rvq_assign/codewords_side_by_side",
        "Neighbouring codewords far from zero differ by a millionth of their squares.",
        "e = r - C is exact for neighbours; the distance has 6 roundings of its own size.",
        "expanded",
    ),
    nearest(
        "stress/rvq_assign/large_vectors",
        "Squares of colours at the ends of binary16 do not fit it.",
        "None below 1.8e19, where squares leave binary32; infinite distances are never the least.",
        "squares in binary16",
    ),
    update(
        "core/rvq_update/codewords_without_users",
        "A codeword of count 0 without smoothing is 0 / 0.",
        "None: it stays as it is.",
    ),
    update(
        "stress/rvq_update/fewer_colours_than_codewords",
        "Every colour is met exactly, and errors divided by their sum are 0 / 0.",
        "None: with nothing to gain, nothing is drawn and no uniform number is taken.",
    ),
    HardCase(
        "stress/commitment/residuals_that_cancel",
        "The residuals of the stages, of either sign, add up to a hundredth of the first.",
        "Each residual is exact for near codewords; their sum has the condition sum abs(r) / abs(sum r), 130 to 600.",
        oracle.commitment,
        ("M x - M C1 - (M - 1) C2", naive.commitment_expanded),
    ),
)

CASES: Final[tuple[Entry, ...]] = (*HALVES, *LSQ, *CODEBOOKS)
