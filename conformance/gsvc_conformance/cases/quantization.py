"""Cases of LSQ+."""

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.training import f4
from gsvc_conformance.operation import Values


def channels(scale: float, offset: float) -> Values:
    """Scale and offset of one channel."""
    return {"scale": f4(scale), "offset": f4(offset)}


def random_values(rng: Draws, count: int, bits: int) -> Values:
    """Values of three unlike channels, a fifth of them beyond the range of codes, and none near a tie."""
    scale, offset = f4(0.11, 0.73, 1.9), f4(0.31, -7.7, -21)
    codes = rng.uniform(-0.2, 1.2, (count, 3)) * (2**bits - 1)
    fraction = codes - np.rint(codes)
    codes = np.rint(codes) + np.clip(fraction, -0.45, 0.45)  # far from ties, and from the ends of the range
    codes = np.where(abs(codes - (2**bits - 1)) < 0.05, codes - 0.1, np.where(abs(codes) < 0.05, 0.1, codes))
    return {"x": (codes * scale + offset).astype(np.float32), "scale": scale, "offset": offset, "bits": bits}


@case("core", "lsq_quantize", flags=["region"], each={"1_bit": 1, "6_bits": 6, "12_bits": 12})
def codes_below_inside_and_above(rng: Draws, value: int) -> Inputs:
    """Three channels with scales and offsets of their own, values below, inside and above the range of {key}."""
    expected = yield random_values(rng, 40, value)
    codes = expected["codes"].value
    assert np.array_equal(codes, expected["codes"].alternative)
    assert codes.min() == 0
    assert codes.max() == 2**value - 1


@case("core", "lsq_quantize", flags=["ties"])
def codes_of_exact_ties() -> Inputs:
    """Ties with a scale of 1/4, so that there is no rounding error: each goes to the even code.

    Half up has 1, 3, 5; half down 0, 2, 4; a floor the lower of each.
    """
    expected = yield {"x": f4([0.125], [0.375], [0.625], [0.875], [1.125], [1.375]), **channels(0.25, 0), "bits": 6}
    assert expected["codes"].value.ravel().tolist() == [0, 2, 2, 4, 4, 6]


@case("core", "lsq_quantize", flags=["ties", "region"])
def codes_at_the_ends() -> Inputs:
    """Values at, just inside and just outside the ends of the range of 3 bits, with an offset of -2."""
    t = f4([-100], [-0.625], [-0.5], [-0.25], [0], [0.25], [6.5], [6.75], [7], [7.25], [7.5], [7.625], [1000])
    expected = yield {"x": t * np.float32(0.5) - np.float32(2), **channels(0.5, -2), "bits": 3}
    assert expected["codes"].value.ravel().tolist() == [0, 0, 0, 0, 0, 0, 6, 7, 7, 7, 7, 7, 7]


@case("core", "lsq_quantize", flags=["region"])
def codes_floor_would_miss() -> Inputs:
    """Values three quarters of a step above a code: they round up, where a floor or a truncation stays."""
    expected = yield {"x": f4([0.75], [1.75], [-0.75], [62.75], [61.75]), **channels(1, 0), "bits": 6}
    assert expected["codes"].value.ravel().tolist() == [1, 2, 0, 63, 62]


@case("core", "lsq_quantize", flags=["region"])
def codes_with_a_positive_offset() -> Inputs:
    """The offset is subtracted, before the division."""
    expected = yield {"x": f4([3], [4.5], [0], [-3]), **channels(0.5, 3), "bits": 4}
    assert expected["codes"].value.ravel().tolist() == [0, 3, 0, 0]


@case("uncommon", "lsq_quantize", flags=["ties"])
def codes_next_to_ties() -> Inputs:
    """A scale that is not a power of two and values that are products near ties: either code is legal."""
    x = (np.arange(1, 40, 2)[:, None] * np.float32(0.05)).astype(np.float32)
    expected = yield {"x": x, **channels(0.1, 0), "bits": 6}
    assert np.all(expected["codes"].alternative != expected["codes"].value)


@case("uncommon", "lsq_quantize", flags=["empty"])
def codes_of_nothing() -> Inputs:
    """A block without splats."""
    none = np.zeros((0, 3), np.float32)
    expected = yield {"x": none, "scale": f4(1, 2, 3), "offset": f4(0, 0, 0), "bits": 6}
    assert expected["codes"].value.shape == (0, 3)


@case("uncommon", "lsq_quantize", flags=["region"])
def codes_of_16_bits() -> Inputs:
    """The most bits: the largest code is 65,535 and fits the type."""
    expected = yield {"x": f4([0], [32767], [32768], [65535], [70000]), **channels(1, 0), "bits": 16}
    assert expected["codes"].value.ravel().tolist() == [0, 32767, 32768, 65535, 65535]


@case("stress", "lsq_quantize", flags=["overflow"])
def codes_of_extreme_scales() -> Inputs:
    """Scales of 2^-24 and 2^100, and differences and quotients beyond binary32: infinity clamps to the end."""
    x = f4([0, 0, 3e38], [1, 2.0**101, -3e38], [-1, -(2.0**101), 0], [2.0**-23, 3e38, 1])
    expected = yield {"x": x, "scale": f4(2.0**-24, 2.0**100, 2.0**-24), "offset": f4(0, 0, -3e38), "bits": 6}
    assert expected["codes"].value.tolist() == [[0, 0, 63], [63, 2, 0], [0, 0, 63], [2, 63, 63]]


@case("core", "lsq_dequantize", flags=["fused"])
def values_where_fusing_differs(rng: Draws) -> Inputs:
    """Codes whose product and sum, each rounded, differ from a fused multiply-add in nearly half of the values."""
    codes = rng.integers(0, 4096, (60, 3)).astype(np.uint16)
    scale, offset = f4(0.0123, 0.00271, 1.37), f4(-13.1, 0.37, -2000.3)
    expected = yield {"codes": codes, "scale": scale, "offset": offset}
    fused = (codes * scale.astype(np.float64) + offset).astype(np.float32)
    assert np.mean(fused != expected["values"].value) > 0.2


@case("core", "lsq_dequantize", flags=["region"])
def values_of_the_ends() -> Inputs:
    """Code 0 is the offset and the largest code p s + beta; the offset is added and not subtracted."""
    expected = yield {"codes": np.array([[0], [1], [63]], np.uint16), **channels(0.25, -3)}
    assert expected["values"].value.ravel().tolist() == [-3, -2.75, 12.75]


@case("uncommon", "lsq_dequantize", flags=["overflow"])
def values_of_large_codes() -> Inputs:
    """Codes up to 65,535, which neither a signed 16-bit integer nor binary16 holds."""
    expected = yield {"codes": np.array([[32767], [32768], [65535]], np.uint16), **channels(1, 0.5)}
    assert expected["values"].value.ravel().tolist() == [32767.5, 32768.5, 65535.5]


@case("core", "lsq_gradients", flags=["region", "straight-through"], each={"1_bit": 1, "6_bits": 6, "12_bits": 12})
def gradients_of_all_regions(rng: Draws, value: int) -> Inputs:
    """Values below, inside and above the range of {key} in three channels.

    Sums over the splats of a channel, without the factor 1/sqrt(N p) that the literature offers.
    """
    inputs = random_values(rng, 40, value)
    inputs["grad_output"] = rng.normal(size=(40, 3)).astype(np.float32)
    expected = yield inputs
    grad, found = inputs["grad_output"], expected["grad_x"].value
    assert set(np.unique(found == grad)) == {False, True}
    assert np.allclose(expected["grad_offset"].value, np.where(found == grad, 0, grad).sum(axis=0, dtype=np.float64))


@case("core", "lsq_gradients", flags=["region", "ties"])
def gradients_at_the_ends() -> Inputs:
    """Values exactly at both ends of 3 bits count as inside; just beyond them they do not.

    t = 0 and t = 7 pass the gradient on and give scale and offset nothing.
    """
    x = f4([0], [-(2.0**-20)], [7], [7 + 2.0**-20])
    expected = yield {"x": x, **channels(1, 0), "bits": 3, "grad_output": f4([1], [2], [4], [8])}
    assert expected["grad_x"].value.ravel().tolist() == [1, 0, 4, 0]
    assert expected["grad_offset"].value.tolist() == [10]
    assert expected["grad_scale"].value.tolist() == [56]


@case("core", "lsq_gradients", flags=["straight-through", "ties"])
def gradients_inside() -> Inputs:
    """Inside, the scale's gradient is q - t, with the code rounded half to even: -1/4, 1/4, -1/2, 1/2."""
    x = f4([1.25], [1.75], [2.5], [3.5])
    expected = yield {"x": x, **channels(1, 0), "bits": 4, "grad_output": f4([1], [2], [4], [8])}
    assert expected["grad_scale"].value.tolist() == [-0.25 + 0.5 - 2 + 4]
    assert expected["grad_offset"].value.tolist() == [0]


@case("core", "lsq_gradients", flags=["region"])
def gradients_below_and_above() -> Inputs:
    """Below, only the offset is pulled; above, the offset and, p times as much, the scale."""
    x = f4([-5, 100], [-1.5, 2])
    expected = yield {
        "x": x, "scale": f4(1, 2), "offset": f4(0, 1), "bits": 2, "grad_output": f4([3, 5], [0.5, 0.25])
    }  # fmt: skip
    assert expected["grad_x"].value.tolist() == [[0, 0], [0, 0.25]]
    assert expected["grad_scale"].value.tolist() == [0, 15 - 0.125]
    assert expected["grad_offset"].value.tolist() == [3.5, 5]


@case("uncommon", "lsq_gradients", flags=["empty"])
def gradients_of_nothing() -> Inputs:
    """A block without splats: the sums are 0."""
    none = np.zeros((0, 3), np.float32)
    expected = yield {"x": none, "scale": f4(1, 2, 3), "offset": f4(0, 0, 0), "bits": 6, "grad_output": none}
    assert expected["grad_scale"].value.tolist() == [0, 0, 0]


@case("stress", "lsq_gradients", flags=["overflow", "region"])
def gradients_beyond_binary32() -> Inputs:
    """Quotients beyond binary32 are above and below, with no infinity in any sum."""
    expected = yield {"x": f4([3e38], [-3e38]), **channels(2.0**-24, 0), "bits": 6, "grad_output": f4([1], [2])}
    assert expected["grad_scale"].value.tolist() == [63]
    assert expected["grad_offset"].value.tolist() == [3]
