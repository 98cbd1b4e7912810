"""Cases of reconstruction: the two columns of section 8, and checksums of what comes out."""

from typing import Any, Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import halves as half_cases  # their cases belong to this group, too
from gsvc_conformance.cases import work as work_cases
from gsvc_conformance.cases.building import Array, halves, result, same_bits

__all__ = ["half_cases", "work_cases"]

F4: Final = np.float32
TINY: Final = F4(2.0**-149)
"""The least positive binary32."""


def codes(count: int, rng: Draws, sizes: tuple[int, ...] = (5, 8), bits: int = 6) -> dict[str, Any]:
    """Random codes of a block, with a quantiser and codebooks of such sizes."""
    return {
        "positions": halves(rng.uniform(-1, 1, (count, 2))),
        "cholesky": rng.integers(0, 1 << bits, (count, 3)).astype(np.uint16),
        "scale": rng.uniform(0.01, 0.2, 3).astype(F4),
        "offset": rng.uniform(-2, 2, 3).astype(F4),
        "color_indices": np.column_stack([rng.integers(0, size, count) for size in sizes]).astype(np.uint16),
        "codebook_sizes": np.array(sizes, np.int64),
        "codewords": halves(rng.normal(0, 0.4, (sum(sizes), 3))),
    }


SHAPES: Final = {
    "one_stage": (7,),
    "three_stages": (3, 1, 6),
    "eight_stages": (2, 3, 4, 5, 4, 3, 2, 1),
    "large": (1, 1024),
}


@case("core", "reconstruct_intra", each=SHAPES, said={"large": "two stages, one of them large"})
def intra(value: tuple[int, ...], rng: Draws) -> Inputs:
    """Values of 23 splats, whose colours are sums of codewords of {key}."""
    expected = yield {"width": 37, "height": 22, **codes(23, rng, value)}
    assert len(result(expected, "parameters")) == 23


@case("core", "reconstruct_intra", flags=["odd-size"])
def intra_of_odd_size() -> Inputs:
    """W/2 and H/2 are not rounded: at W = 7, H = 5 the middle is at (3.5, 2.5)."""
    expected = yield {"width": 7, "height": 5, **_one([[0, 0]])}
    assert result(expected, "parameters")[0, :2].tolist() == [3.5, 2.5]


def _one(places: Any, *, code: Any = 0, scale: Any = 1, offset: Any = 1, words: Any = ((0.5, 0.25, 0.125),)) -> Any:
    """Codes of a few splats, all of the same colour."""
    count = len(places)
    return {
        "positions": halves(places),
        "cholesky": np.broadcast_to(np.asarray(code), (count, 3)).astype(np.uint16),
        "scale": np.full(3, scale, F4),
        "offset": np.full(3, offset, F4),
        "color_indices": np.zeros((count, len(words)), np.uint16),
        "codebook_sizes": np.ones(len(words), np.int64),
        "codewords": halves(words),
    }


@case("core", "reconstruct_intra", flags=["fused"], equations=["8-1", "8-2", "8-3"])
def intra_rounds_twice(rng: Draws) -> Inputs:
    """Numbers for which fl(fl(q s) + beta) and fl(fl(h + 1) W/2) are not what one rounding gives (R-3.3-1)."""
    block = codes(40, rng, bits=12)
    block["positions"] = halves(np.ldexp(rng.uniform(-1, 1, (40, 2)), rng.integers(-14, -8, (40, 2), np.int32)))
    expected = yield {"width": 37, "height": 1001, **block}
    found = result(expected, "parameters").astype(np.float64)
    once = block["cholesky"].astype(np.float64) * block["scale"] + block["offset"]
    assert (found[:, 2:5] != once.astype(F4)).any(axis=0).all()
    once = (block["positions"].view(np.float16).astype(np.float64) + 1) * [18.5, 500.5]
    assert (found[:, :2] != once.astype(F4)).any(axis=0).all()


@case("core", "reconstruct_intra", flags=["order"], equations=["8-4"])
def codewords_in_order() -> Inputs:
    """60000, -60000 and 2^-10 add up to 2^-10 in this order, and to 0 in the other."""
    words = ((60000, 1, 2.0**-10), (-60000, 2.0**-24, -60000), (2.0**-10, 2.0**-24, 60000))
    expected = yield {"width": 8, "height": 8, **_one([[0, 0]], words=words)}
    one = F4(1) + F4(2.0**-24)
    assert result(expected, "parameters")[0, 5:].tolist() == [2.0**-10, one + F4(2.0**-24), 0]


@case("core", "reconstruct_intra", flags=["signed-zero"])
def intra_signed_zeros() -> Inputs:
    """A colour of one codeword -0 stays -0; fl(-1 + 1) W/2 and 0 s + -0 are +0."""
    block = _one([[-1, -1]], offset=-0.0, words=((-0.0, 0.0, -0.0),))
    expected = yield {"width": 9, "height": 9, **block}
    assert np.signbit(result(expected, "parameters")[0]).tolist() == [False] * 5 + [True, False, True]


@case("core", "reconstruct_intra", flags=["subnormal"])
def intra_subnormals() -> Inputs:
    """Cholesky factors that are subnormal binary32: kept, not flushed to zero."""
    block = _one([[0, 0], [0.5, 0.5]], code=[[1, 1, 1], [3, 2, 1]], scale=2.0**-126)
    block["offset"] = np.array([-(2.0**-126) + 2.0**-149, -(2.0**-127), 2.0**-149], F4)
    expected = yield {"width": 8, "height": 8, **block}
    assert result(expected, "parameters")[0, 2:5].tolist() == [2.0**-149, 2.0**-127, 2.0**-126 + 2.0**-149]


@case("stress", "reconstruct_intra", flags=["overflow"], each={"wide": (65535, 1), "high": (1, 65535)})
def far_and_huge(value: tuple[int, int]) -> Inputs:
    """Positions of +-65504 half sizes on a frame that is 65535 pixels {key}; Cholesky factors near 3e38."""
    places = [[65504, -65504], [-65504, 65504], [-1, 1]]
    block = _one(places, code=4095, scale=8e34, offset=-1e37, words=((65504, -65504, 0),) * 8)
    expected = yield {"width": value[0], "height": value[1], **block}
    found = result(expected, "parameters")
    assert np.isfinite(found).all()
    assert abs(found[:, :2]).max() > 2e9


def reference(count: int, rng: Draws) -> Array:
    """Parameters (count, 8) f4 of a frame before."""
    return rng.normal(0, 3, (count, 8)).astype(F4) + np.array([10, 7, 4, 0, 4, 0, 0, 0], F4)


NOTHING: Final = {
    "positions": np.zeros((0, 2), np.uint16),
    "cholesky": np.zeros((0, 3), np.uint16),
    "scale": np.ones(3, F4),
    "offset": np.zeros(3, F4),
    "color_indices": np.zeros((0, 0), np.uint16),
    "codebook_sizes": np.zeros(0, np.int64),
    "codewords": np.zeros((0, 3), np.uint16),
}
"""A block in which no attribute is present."""

ATTRIBUTES: Final = {
    "positions": ("positions",),
    "cholesky": ("cholesky", "scale", "offset"),
    "colors": ("color_indices", "codebook_sizes", "codewords"),
}
COLUMNS: Final = {"positions": slice(0, 2), "cholesky": slice(2, 5), "colors": slice(5, 8)}


@case("core", "reconstruct_inter", flags=["survivors"], each={"all_stay": 1.0, "some_stay": 0.6, "one_stays": 0.0})
def inter(value: float, rng: Draws) -> Inputs:
    """Differences of survivors: {key}, and splat n of the differences is the n-th survivor."""
    survivors = (rng.random(29) < value).astype(np.uint8)
    survivors[17] = 1
    before = reference(29, rng)
    expected = yield {"width": 37, "height": 22, "reference": before, "survivors": survivors,
                      **codes(int(survivors.sum()), rng)}  # fmt: skip
    found = result(expected, "parameters")
    assert len(found) == survivors.sum()
    assert (found != before[survivors == 1]).all()


@case("core", "reconstruct_inter", flags=["empty"])
def none_survives(rng: Draws) -> Inputs:
    """All splats go: nothing is left."""
    expected = yield {"width": 8, "height": 8, "reference": reference(3, rng), "survivors": np.zeros(3, np.uint8),
                      **NOTHING}  # fmt: skip
    assert result(expected, "parameters").shape == (0, 8)


@case("core", "reconstruct_inter", flags=["signed-zero"], each={name: name for name in (*ATTRIBUTES, "nothing")},
      said={"positions": "Only positions are present", "cholesky": "Only Cholesky factors are present",
            "colors": "Only colours are present", "nothing": "No attribute is present"})  # fmt: skip
def only(value: str, rng: Draws) -> Inputs:
    """{key}: what is not keeps its bits, also those of -0 and of subnormal numbers."""
    before = reference(5, rng)
    before[1], before[2], before[3] = F4(-0.0), TINY, -TINY
    block = codes(4, rng)
    parts = {name: block[name] for name in ATTRIBUTES.get(value, ())}
    survivors = np.array([1, 1, 1, 1, 0], np.uint8)
    expected = yield {"width": 9, "height": 9, "reference": before, "survivors": survivors, **NOTHING, **parts}
    for name, columns in COLUMNS.items():
        assert same_bits(result(expected, "parameters")[:, columns], before[:4, columns]) == (name != value)


@case("core", "reconstruct_inter", flags=["fused", "order"])
def inter_rounds_each_time(rng: Draws) -> Inputs:
    """Numbers for which ref + q s + beta and ref + h W/2 in another order, or rounded less often, differ (R-3.3-1)."""
    block = codes(60, rng, bits=12)
    before = reference(60, rng)
    expected = yield {"width": 60001, "height": 37, "reference": before, "survivors": np.ones(60, np.uint8), **block}
    found = result(expected, "parameters")
    product = block["cholesky"].astype(F4) * block["scale"]
    fused = (block["cholesky"].astype(np.float64) * block["scale"] + block["offset"]).astype(F4)
    ref = before[:, 2:5]
    for other in ((ref + product) + block["offset"], (ref + block["offset"]) + product, ref + fused):
        assert (found[:, 2:5] != other).any()
    h = block["positions"].view(np.float16).astype(np.float64)
    assert (found[:, 0] != (before[:, 0] + h[:, 0] * 30000.5).astype(F4)).any()
    words = block["codewords"].view(np.float16).astype(F4)
    first, second = (words[start + block["color_indices"][:, k]] for k, start in enumerate((0, 5)))
    assert (found[:, 5:] != (before[:, 5:] + first) + second).any()


@case("core", "reconstruct_inter", flags=["fused"])
def inter_rounds_rows_each_time(rng: Draws) -> Inputs:
    """Numbers for which ref + h H/2, rounded once, differs, and ref + h W/2 cannot (R-3.3-1)."""
    positions = codes(20, rng)["positions"]
    before = reference(20, rng)
    expected = yield {"width": 37, "height": 60001, "reference": before, "survivors": np.ones(20, np.uint8),
                      **NOTHING, "positions": positions}  # fmt: skip
    found = result(expected, "parameters")
    h = positions.view(np.float16).astype(np.float64)
    once = (before[:, :2] + h * (18.5, 30000.5)).astype(F4)
    assert np.array_equal(found[:, 0], once[:, 0])
    assert (found[:, 1] != once[:, 1]).any()


@case("core", "reconstruct_inter", flags=["signed-zero"])
def inter_signed_zeros() -> Inputs:
    """-0 + -0 is -0, -0 + +0 and 1 - 1 are +0."""
    before = np.full((3, 8), -0.0, F4)
    before[2, :2] = 4
    block = _one([[-0.0, -0.0], [0.0, 0.0], [-1, -1]], offset=-0.0, words=((-0.0, 0.0, -0.0),))
    expected = yield {"width": 8, "height": 8, "reference": before, "survivors": np.ones(3, np.uint8), **block}
    signs = np.signbit(result(expected, "parameters"))
    assert signs[:, 0].tolist() == [True, False, False]
    assert signs[0].tolist() == [True, True, False, False, False, True, False, True]


@case("core", "reconstruct_inter", flags=["subnormal"])
def inter_subnormals() -> Inputs:
    """Sums that are subnormal: 2^-126 - 2^-149 - 2^-126 leaves -2^-149."""
    before = np.full((1, 8), 2.0**-126, F4) - TINY
    block = _one([[0, 0]], code=0, scale=2.0**-126, offset=-(2.0**-126))
    expected = yield {"width": 8, "height": 8, "reference": before, "survivors": np.ones(1, np.uint8), **block}
    assert result(expected, "parameters")[0, 2:5].tolist() == [-(2.0**-149)] * 3


@case("core", "parameter_checksum", each={"none": 0, "one": 1, "many": 19},
      said={"none": "no splats", "one": "one splat", "many": "19 splats"})  # fmt: skip
def checksum(value: int, rng: Draws) -> Inputs:
    """CRC-32C of all positions, then all Cholesky factors, then all colours of {key}; of none it is 0."""
    expected = yield {"parameters": reference(value, rng)}
    assert (result(expected, "checksum") == 0) == (value == 0)


@case(
    "core",
    "parameter_checksum",
    flags=["signed-zero"],
    each={"plus": 0.0, "minus": -0.0},
    said={"plus": "+0", "minus": "-0"},
)
def checksum_of_zeros(value: float) -> Inputs:
    """Eight numbers, each {key}: the sign counts. RFC 3720 has the checksum of 32 bytes of zero."""
    expected = yield {"parameters": np.full((1, 8), value, F4)}
    assert (result(expected, "checksum") == 0x8A9136AA) != np.signbit(value)
