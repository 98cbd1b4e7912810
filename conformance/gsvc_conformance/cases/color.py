"""Cases of colour conversion."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.titles import in_words
from gsvc_conformance.operation import Values

Samples = NDArray[np.unsignedinteger[Any]]

PHASES = {0: (0.5, 0), 1: (0.5, 0.5), 2: (0, 0), 3: (0, 0.5), 4: (1, 0), 5: (1, 0.5)}
"""Where a chroma sample lies among its rows and columns of luma, by chroma_sample_loc_type."""

SITED = {f"type_{k}": f"chroma_sample_loc_type {k}" for k in PHASES}
"""Words for them in titles."""

PRIMARIES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 1, 1]])


def described(
    chroma_format: int = 3, matrix: int = 1, full_range: int = 0, location: int = 0, bit_depth: int = 8
) -> Values:
    """The elements that a conversion follows from."""
    return {
        "chroma_format": chroma_format,
        "matrix_coefficients": matrix,
        "video_full_range_flag": full_range,
        "chroma_sample_loc_type": location,
        "bit_depth": bit_depth,
    }


def samples(values: Any, bit_depth: int = 8) -> Samples:
    """Sample values in the type of their depth."""
    return np.asarray(values).astype(np.uint8 if bit_depth == 8 else np.uint16)


def plane_shape(height: int, width: int, chroma_format: int) -> tuple[int, int]:
    """Rows and columns of a chroma plane."""
    return (height + 1) // 2 if chroma_format == 1 else height, (width + 1) // 2 if chroma_format < 3 else width


def random_planes(rng: Draws, height: int, width: int, **elements: int) -> Values:
    """Planes with any sample values, those beyond the nominal range included."""
    description = described(**elements)
    depth = description["bit_depth"]
    shape = plane_shape(height, width, description["chroma_format"])
    y, cb, cr = (samples(rng.integers(0, 1 << depth, size), depth) for size in ((height, width), shape, shape))
    return {"y": y, "cb": cb, "cr": cr, **description}


def random_frame(rng: Draws, height: int, width: int, **elements: int) -> Values:
    """A frame with any sample values."""
    description = described(**elements)
    depth = description["bit_depth"]
    return {"frame": samples(rng.integers(0, 1 << depth, (height, width, 3)), depth), **description}


COMMON = {
    "bt709_limited_420": {"matrix": 1, "chroma_format": 1},
    "bt709_full_420": {"matrix": 1, "chroma_format": 1, "full_range": 1},
    "bt601_limited_420": {"matrix": 6, "chroma_format": 1},
    "bt2020_limited_420_10_bits": {"matrix": 9, "chroma_format": 1, "location": 2, "bit_depth": 10},
    "bt709_limited_444": {"matrix": 1},
    "bt709_limited_422": {"matrix": 1, "chroma_format": 2},
}

RARE = {
    "fcc_limited_420": {"matrix": 4, "chroma_format": 1},
    "bt470_full_420": {"matrix": 5, "chroma_format": 1, "full_range": 1, "location": 1},
    "smpte240m_limited_422": {"matrix": 7, "chroma_format": 2},
    "smpte240m_full_444": {"matrix": 7, "full_range": 1},
    "bt2020_full_422_10_bits": {"matrix": 9, "chroma_format": 2, "full_range": 1, "bit_depth": 10, "location": 3},
    "bt2020_limited_444_12_bits": {"matrix": 9, "bit_depth": 12},
    "bt709_limited_420_16_bits": {"matrix": 1, "chroma_format": 1, "bit_depth": 16},
    "bt601_full_444_16_bits": {"matrix": 6, "full_range": 1, "bit_depth": 16},
    "identity_full_444": {"matrix": 0, "full_range": 1},
    "identity_limited_444": {"matrix": 0},
    "identity_limited_444_10_bits": {"matrix": 0, "bit_depth": 10},
    "ycgco_full_444": {"matrix": 8, "full_range": 1},
    "ycgco_limited_420": {"matrix": 8, "chroma_format": 1},
    "ycgco_full_422_10_bits": {"matrix": 8, "chroma_format": 2, "full_range": 1, "bit_depth": 10},
}


@case("core", "planes_to_frame", flags=["matrix", "range", "odd-size"], each=COMMON, said=in_words(COMMON))
def any_planes(rng: Draws, value: dict[str, int]) -> Inputs:
    """Random planes of 7x5 pixels, many of whose results are clipped: {key}."""
    expected = yield random_planes(rng, 5, 7, **value)
    peak = (1 << value.get("bit_depth", 8)) - 1
    assert {0, peak} < set(expected["frame"].value.ravel().tolist())


@case("uncommon", "planes_to_frame", flags=["matrix", "range", "bit-depth"], each=RARE, said=in_words(RARE))
def any_rare_planes(rng: Draws, value: dict[str, int]) -> Inputs:
    """Random planes of 5x6 pixels: {key}."""
    expected = yield random_planes(rng, 6, 5, **value)
    assert expected["frame"].value.shape == (6, 5, 3)


@case("core", "frame_to_planes", flags=["matrix", "range", "odd-size"], each=COMMON, said=in_words(COMMON))
def any_frame(rng: Draws, value: dict[str, int]) -> Inputs:
    """A random frame of 7x5 pixels: {key}."""
    expected = yield random_frame(rng, 5, 7, **value)
    unit = 1 << (value.get("bit_depth", 8) - 8)
    luma = expected["y"].value
    assert value.get("full_range") or (luma.min() >= 16 * unit and luma.max() <= 235 * unit)


@case("uncommon", "frame_to_planes", flags=["matrix", "range", "bit-depth"], each=RARE, said=in_words(RARE))
def any_rare_frame(rng: Draws, value: dict[str, int]) -> Inputs:
    """A random frame of 5x6 pixels: {key}."""
    expected = yield random_frame(rng, 6, 5, **value)
    assert expected["cb"].value.shape == plane_shape(6, 5, value.get("chroma_format", 3))


RED = {
    "bt709_limited": ({"matrix": 1}, (63, 102, 240)),
    "bt709_full": ({"matrix": 1, "full_range": 1}, (54, 99, 255)),
    "bt601_limited": ({"matrix": 6}, (81, 90, 240)),
    "bt601_full": ({"matrix": 5, "full_range": 1}, (76, 85, 255)),
    "bt2020_limited_10_bits": ({"matrix": 9, "bit_depth": 10}, (294, 387, 960)),
}


@case("core", "frame_to_planes", flags=["matrix", "range"], each=RED, said=in_words(RED))
def red(value: tuple[dict[str, int], tuple[int, int, int]]) -> Inputs:
    """One pixel of full red, whose codes are well known: {key}."""
    elements, codes = value
    depth = elements.get("bit_depth", 8)
    frame = samples(np.array([[[(1 << depth) - 1, 0, 0]]]), depth)
    expected = yield {"frame": frame, **described(**elements)}
    assert tuple(int(expected[name].value[0, 0]) for name in ("y", "cb", "cr")) == codes


@case("core", "planes_to_frame", flags=["matrix", "range"], each=RED, said=in_words(RED))
def red_again(value: tuple[dict[str, int], tuple[int, int, int]]) -> Inputs:
    """The codes of full red ({key}) and back: what is left of green and blue is the rounding of the codes."""
    elements, codes = value
    depth = elements.get("bit_depth", 8)
    y, cb, cr = (samples([[code]], depth) for code in codes)
    expected = yield {"y": y, "cb": cb, "cr": cr, **described(**elements)}
    found = expected["frame"].value[0, 0].astype(int)
    assert np.all(abs(found - np.array([(1 << depth) - 1, 0, 0])) <= 2)


@case("core", "frame_to_planes", flags=["matrix"], each={"bt709": 1, "bt601": 6}, said=in_words(["bt709", "bt601"]))
def primaries_of(value: int) -> Inputs:
    """Black, the six corners of the cube of colours, and white: {key}."""
    expected = yield {"frame": samples(255 * PRIMARIES[None]), **described(matrix=value)}
    assert expected["y"].value[0, [0, 7]].tolist() == [16, 235]
    assert expected["cr"].value[0, [0, 7]].tolist() == [128, 128]


@case("core", "planes_to_frame", flags=["range"], each={"limited": 0, "full": 1})
def greys(value: int) -> Inputs:
    """Neutral chroma: grey stays grey, black and white of the {key} range are 0 and 255, and beyond is clipped."""
    luma = np.array([[0, 15, 16, 17, 126, 234, 235, 236, 255]])
    neutral = np.full(luma.shape, 128)
    expected = yield {
        "y": samples(luma), "cb": samples(neutral), "cr": samples(neutral), **described(full_range=value)
    }  # fmt: skip
    frame = expected["frame"].value[0].astype(int)
    assert np.all(frame == frame[:, :1])
    assert frame[:, 0].tolist() == (luma[0].tolist() if value else [0, 0, 0, 1, 128, 254, 255, 255, 255])


@case("core", "frame_to_planes", flags=["range"], each={"limited": 0, "full": 1})
def grey_frames(value: int) -> Inputs:
    """Grey pixels have neutral chroma: {key} range, 4:2:0, 4x4 pixels."""
    grey = np.array([0, 1, 2, 64, 127, 128, 129, 191, 200, 220, 235, 240, 252, 253, 254, 255]).reshape(4, 4, 1)
    expected = yield {"frame": samples(np.tile(grey, 3)), **described(chroma_format=1, full_range=value)}
    assert np.all(expected["cb"].value == 128)
    assert expected["y"].value[0, 0] == (0 if value else 16)


@case("core", "planes_to_frame", flags=["siting"], each={f"type_{k}": k for k in PHASES}, said=SITED)
def chroma_impulse(value: int) -> Inputs:
    """One chroma sample among neutral ones spreads over the luma samples around its place, {key}.

    Y, Cg, Co in full range, so that red shows the interpolated Co itself and nothing is rounded but the end.
    """
    cr = np.full((4, 4), 128)
    cr[1, 1] += 64
    y, neutral = np.full((7, 7), 128), np.full((4, 4), 128)
    expected = yield {
        "y": samples(y), "cb": samples(neutral), "cr": samples(cr),
        **described(chroma_format=1, matrix=8, full_range=1, location=value),
    }  # fmt: skip
    rows, columns = (np.maximum(1 - abs(np.arange(7) - 2 - phase) / 2, 0) for phase in PHASES[value])
    assert np.array_equal(expected["frame"].value[..., 0], 128 + np.rint(64 * np.outer(rows, columns)))


@case("core", "frame_to_planes", flags=["siting"], each={f"type_{k}": k for k in PHASES}, said=SITED)
def pixel_impulse(value: int) -> Inputs:
    """One red pixel on black is seen by the chroma samples whose cell it lies in, {key}."""
    frame = np.zeros((6, 6, 3))
    frame[3, 2, 0] = 128
    expected = yield {"frame": samples(frame), **described(chroma_format=1, matrix=8, full_range=1, location=value)}
    weights = []
    for place, phase in zip((3, 2), PHASES[value], strict=True):
        distance = abs(2 * np.arange(3) + phase - place)
        weights.append(np.clip(1.5 - distance, 0, 1) / 2)
    assert np.array_equal(expected["cr"].value, 128 + 64 * np.outer(*weights))


@case("core", "planes_to_frame", flags=["siting", "odd-size"], each={"420": 1, "422": 2},
      said=in_words(["420", "422"]))  # fmt: skip
def chroma_at_the_edges(value: int) -> Inputs:
    """A ramp of chroma on odd sides, {key}: beyond the outermost samples the ramp does not go on."""
    shape = plane_shape(5, 7, value)
    ramp = np.add.outer(20 * np.arange(shape[0]), 40 * np.arange(shape[1]))
    expected = yield {
        "y": samples(np.full((5, 7), 128)), "cb": samples(np.full(shape, 128)), "cr": samples(ramp + 28),
        **described(chroma_format=value, matrix=8, full_range=1, location=1),
    }  # fmt: skip
    red_row = expected["frame"].value[0, :, 0].astype(int)
    assert red_row.tolist() == [28, 38, 58, 78, 98, 118, 138]


@case("core", "frame_to_planes", flags=["ties"])
def ties_of_quarters() -> Inputs:
    """Y, Cg and Co of full range in exact halves and quarters: ties go to the even sample.

    Y is (R + 2 G + B) / 4: 0.5, 1.5, 2.5 and 3.5 become 0, 2, 2 and 4; H.273 itself rounds ties away from zero.
    """
    frame = np.array([[[2, 0, 0], [0, 3, 0], [0, 4, 2], [4, 5, 0], [1, 0, 0], [3, 0, 0], [0, 0, 1], [0, 0, 3]]])
    expected = yield {"frame": samples(frame), **described(matrix=8, full_range=1)}
    assert expected["y"].value[0, :4].tolist() == [0, 2, 2, 4]
    assert expected["cr"].value[0, 4:].tolist() == [128, 130, 128, 126]


@case("core", "planes_to_frame", flags=["ties", "siting"])
def ties_of_interpolated_chroma() -> Inputs:
    """Halfway between chroma samples, in full-range Y, Cg, Co: ties go to the even sample, after the sum."""
    cr = np.array([[128, 129, 130, 129]])
    expected = yield {
        "y": samples([[100, 100, 100, 101, 100, 100, 100]]), "cb": samples(np.full((1, 4), 128)), "cr": samples(cr),
        **described(chroma_format=2, matrix=8, full_range=1),
    }  # fmt: skip
    assert expected["frame"].value[0, :, 0].tolist() == [100, 100, 101, 102, 102, 102, 101]


@case("core", "planes_to_frame", flags=["odd-size"], each={"420": 1, "422": 2, "444": 3},
      said=in_words(["420", "422", "444"]))  # fmt: skip
def one_pixel(value: int) -> Inputs:
    """A frame of one pixel: {key}."""
    y, cb, cr = (samples([[code]]) for code in (63, 102, 240))
    expected = yield {"y": y, "cb": cb, "cr": cr, **described(chroma_format=value)}
    assert expected["frame"].value[0, 0, 0] == 255


@case("core", "frame_to_planes", flags=["odd-size", "siting"], each={"one_row": (1, 5), "one_column": (5, 1)})
def thin_frames(rng: Draws, value: tuple[int, int]) -> Inputs:
    """A frame of {key}, 4:2:0: what lies beyond an edge is its outermost pixel."""
    inputs = random_frame(rng, *value, chroma_format=1, location=2)
    expected = yield inputs
    assert expected["cb"].value.shape == plane_shape(*value, 1)


HEIGHTS = {"up_to_576_rows": 576, "from_577_rows": 577}
ROWS = {key: f"{rows} rows" for key, rows in HEIGHTS.items()}


@case("core", "planes_to_frame", flags=["matrix"], each=HEIGHTS, said=ROWS)
def matrix_that_is_not_stated(rng: Draws, value: int) -> Inputs:
    """Matrix 2, not stated, of a frame of {key}: BT.601 up to 576 rows, else BT.709."""
    inputs = random_planes(rng, value, 1, matrix=2)
    inputs["cr"][:] = 200
    expected = yield inputs
    shift = (200 - 128) * 255 / 224 * (1.402 if value == 576 else 1.5748)
    luma = (inputs["y"].astype(float) - 16) * 255 / 219
    middle = (luma + shift > 0) & (luma + shift < 255)
    assert np.allclose(expected["frame"].value[..., 0][middle], (luma + shift)[middle], atol=0.51)


@case("core", "frame_to_planes", flags=["matrix"], each=HEIGHTS, said=ROWS)
def planes_of_a_matrix_that_is_not_stated(value: int) -> Inputs:
    """Matrix 2, not stated, of a frame of {key}: full red is 81 or 63."""
    frame = np.zeros((value, 1, 3))
    frame[..., 0] = 255
    expected = yield {"frame": samples(frame), **described(matrix=2)}
    assert np.all(expected["y"].value == (81 if value == 576 else 63))
