"""Numerically hard cases of quantisation and entropy coding: ties, cancellation, codewords that nobody needs."""

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.quantization import channels
from gsvc_conformance.cases.training import f4

# --- LSQ+ ------------------------------------------------------------------------------------------------------------


@case("stress", "lsq_quantize", flags=["ties", "signed-zero"])
def codes_beside_a_half() -> Inputs:
    """Ties of small and of the largest codes with their neighbours in binary32, -0, and a subnormal number.

    The number below 1/2 plus 1/2 is 1 in binary32, so a floor after adding a half gives code 1 for it.
    """
    ties = np.array([0.5, 1.5, 2.5, 32_768.5, 65_533.5, 65_534.5], np.float32)
    beside = [np.nextafter(ties, np.float32(end)) for end in (-np.inf, np.inf)]
    x = np.concatenate([ties, *beside, f4(-0.0, 1e-45, -1e-45)])[:, None]
    expected = yield {"x": x, **channels(1, 0), "bits": 16}
    codes = expected["codes"].value.ravel().tolist()
    assert codes[:6] == [0, 2, 2, 32_768, 65_534, 65_534]
    assert codes[6:12] == [0, 1, 2, 32_768, 65_533, 65_534]
    assert codes[12:] == [1, 2, 3, 32_769, 65_534, 65_535, 0, 0, 0]


@case("stress", "lsq_quantize", flags=["cancellation"])
def codes_far_from_zero(rng: Draws) -> Inputs:
    """Values and an offset near 1000 with a scale of 0.000244: x - beta is exact, and t has its full accuracy.

    x / s - beta / s is the same in real numbers, and four million less four million in binary32.
    """
    scale, offset = np.float32(0.000244), np.float32(1000)
    codes = rng.integers(1, 4095, 40) + rng.uniform(-0.45, 0.45, 40)
    x = (offset + codes * np.float64(scale)).astype(np.float32)[:, None]
    fraction = (x.astype(np.float64) - 1000) / np.float64(scale)
    x = x[abs(fraction - np.rint(fraction)) < 0.45].reshape(-1, 1)
    expected = yield {"x": x, **channels(float(scale), 1000), "bits": 12}
    assert np.array_equal(expected["codes"].alternative, expected["codes"].value)
    assert np.any(np.rint(x / scale - offset / scale) != expected["codes"].value)


@case("stress", "lsq_dequantize", flags=["fused", "cancellation"])
def zero_that_fusing_misses() -> Inputs:
    """Offsets that are minus the rounded product of a code and the scale: the value is exactly 0.

    Differences of nothing rely on it. A fused multiply-add keeps the rounding error of the product instead.
    """
    scale, codes = f4(0.1, 0.3, 1 / 3), np.array([[37, 101, 4095], [0, 1, 4000]], np.uint16)
    offset = -(codes[0].astype(np.float32) * scale)
    expected = yield {"codes": codes, "scale": scale, "offset": offset}
    assert not expected["values"].value[0].any()
    assert np.all(codes[0] * scale.astype(np.float64) + offset != 0)


@case("stress", "lsq_gradients", flags=["cancellation"])
def gradients_of_large_codes(rng: Draws) -> Inputs:
    """64 codes of 16 bits whose values lie at most half a step away: dL/ds is a sum of g (q - t).

    The sums of g q and g t, which differ by it, are a hundred thousand times larger.
    """
    codes, fraction = rng.integers(50_000, 65_535, 64), rng.integers(-60, 61, 64) / 128
    x = ((codes + fraction) / 64).astype(np.float32)[:, None]
    grad = rng.normal(size=(64, 1)).astype(np.float32)
    expected = yield {"x": x, **channels(1 / 64, 0), "bits": 16, "grad_output": grad}
    assert np.isclose(expected["grad_scale"].value[0], -np.sum(grad[:, 0] * fraction), rtol=1e-9)


@case("stress", "lsq_gradients", flags=["signed-zero", "region"])
def gradients_of_signed_zeros() -> Inputs:
    """T = -0 is not below 0: by its sign alone it would be, and its gradient would go to the offset."""
    x = f4([-0.0, 2.5], [0.0, -2.5], [-0.0, 2.5])
    expected = yield {
        "x": x, "scale": f4(0.5, 0.25), "offset": f4(0, 2.5), "bits": 6, "grad_output": f4([1, -2], [4, 8], [16, -32]),
    }  # fmt: skip
    assert expected["grad_x"].value.tolist() == [[1, -2], [4, 0], [16, -32]]
    assert expected["grad_offset"].value.tolist() == [0, 8]


# --- Residual vector quantisation ------------------------------------------------------------------------------------


@case("stress", "rvq_assign", flags=["ties", "stages"])
def identical_codewords() -> Inputs:
    """Codebooks of one codeword seven times over, in three stages: every index is 0."""
    books = np.repeat(f4([0.1, 0.2, 0.3], [1e-3, 0, -1e-3], [0, 0, 0]), 7, axis=0).astype(np.float16)
    x = f4([0.1, 0.2, 0.3], [-5, 0.7, 1e4], [0, 0, 0], [2.0**-24, -(2.0**-24), 0.125])
    expected = yield {
        "x": x, "codebook_sizes": np.array([7, 7, 7], np.int64), "codebooks": books.astype(np.float32)
    }  # fmt: skip
    assert not expected["indices"].value.any()


@case("stress", "rvq_update", flags=["dead"])
def fewer_colours_than_codewords() -> Inputs:
    """Two colours and six codewords, both colours met exactly: there is nothing to draw from, and the others fade.

    Errors divided by their sum, for probabilities, are 0 / 0.
    """
    colors = f4([0.5, 0.25, 1], [1, 0, -2])
    counts = np.array([4.0, 6, 0.375, 0.25, 0.125, 2.0**-20])
    books = f4(*colors, [1, 1, 1], [1, 1, 1], [0, 0, 0], [-3, 0, 3])
    expected = yield {
        "x": np.resize(colors, (10, 3)), "indices": np.resize(np.array([0, 1], np.uint16), (10, 1)),
        "codebook_sizes": np.array([6], np.int64), "codebooks": books, "counts": counts,
        "sums": counts[:, None] * books, "uniforms": np.array([0, 0.25, 0.5, 0.75]), "decay": 0.5, "smoothing": 1e-5,
        "dead_count": 0.5,
    }  # fmt: skip
    assert np.array_equal(expected["codebooks"].value[:2], colors)
    assert np.array_equal(expected["counts"].value[2:], counts[2:] / 2)


@case("stress", "commitment", flags=["cancellation", "stages"])
def residuals_that_cancel() -> Inputs:
    """Colours near 1000 of which the stages leave 3/8, then -3/8, then nothing but a little: the gradient is little.

    M x - M C1 - (M - 1) C2 - ... is the same sum in real numbers, formed of terms of 3000.
    """
    near, little = f4(1000, -900, 1020), f4([5, -7, 9], [-11, 13, 15], [17, -19, 23]) * np.float32(2.0**-13)
    expected = yield {
        "x": near + np.float32(0.375) + little, "indices": np.array([[1, 0, 0]] * 3, np.uint16),
        "codebook_sizes": np.array([2, 1, 1], np.int64),
        "codebooks": np.concatenate([f4([0, 0, 0]), near[None], f4([0.75] * 3, [-0.375] * 3)]),
    }  # fmt: skip
    assert np.allclose(expected["grad_x"].value, 2 / 9 * 3 * little, rtol=1e-9)
    assert np.all(expected["grad_x"].bound < 1e-3 * abs(expected["grad_x"].value))


# --- Entropy coding --------------------------------------------------------------------------------------------------


@case("stress", "encode_plane", flags=["overflow", "table"])
def one_symbol_has_all_frequency() -> Inputs:
    """A plane of one symbol with the frequency 2^16 of 2^16: the states stay where they begin, and no word comes.

    The bound f 2^(32 - R) is 2^32, which is 0 in 32 bits: every state would be above it forever.
    """
    expected = yield {"symbols": np.ones(10, np.uint16), "frequencies": np.array([0, 1 << 16, 0]),
                      "entropy_precision": 16, "lane_count": 3}  # fmt: skip
    assert expected["lane_states"].value.tolist() == [1 << 16] * 3
    assert expected["words"].value.size == 0
