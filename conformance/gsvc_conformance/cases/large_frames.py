"""Frames of many columns, rows, tiles or splats: places and counts that fit no fixed block, list or index type."""

from typing import Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.building import BOOKS, halves, on, quantizer_of, result, stream_of
from gsvc_conformance.cases.container import equal_splats
from gsvc_conformance.cases.gradients import noise
from gsvc_conformance.cases.splat_sets import population
from gsvc_ref.paper import FrameCodes, SplatBlock

FLAGS: Final = ("large-frame", "tile-edge")


def beads(count: int, width: int, height: int) -> SplatBlock:
    """`count` small splats along a narrow frame at equal distances, none alike."""
    n = np.arange(count)
    along, across = (2 * n + 1) / count - 1, 5 * n % 7 / 8 - 3 / 8
    places = np.column_stack([along, across] if width > height else [across, along])
    cholesky = np.column_stack([5 * n % 9 + 5, 7 * n % 5 + 6, 3 * n % 7 + 6]).astype(np.uint16)
    colors = np.column_stack([(k + 2) * n % len(book) for k, book in enumerate(BOOKS)]).astype(np.uint16)
    return SplatBlock(halves(places), cholesky, colors, quantizer_of([0.25, 0.5, 0.25], [0.5, -4, 0.5]), BOOKS)


@on("core", "decode_stream_deterministic", flags=FLAGS, each={"wide": (4113, 2), "high": (2, 2061)},
    said={"wide": "4113 columns: more than 256 tiles of 16, and two blocks of 2048",
          "high": "2061 rows: more than a block of 2048"})  # fmt: skip
def large(value: tuple[int, int]) -> Inputs:
    """A frame of {key}; splats all along it."""
    width, height = value
    frames = [FrameCodes.intra_frame(beads(max(value) // 15, width, height))]
    expected = yield {"stream": stream_of(frames, width=width, height=height)}
    assert result(expected, "frames").any(axis=(0, 1 if width > height else 2, 3)).mean() > 0.9


@on("stress", "decode_stream", "decode_stream_deterministic", flags=[*FLAGS, CAPACITY],
    each={"wide": (35_003, 1), "high": (1, 35_003)},
    said={"wide": "35,003 columns", "high": "35,003 rows"})  # fmt: skip
def longest(value: tuple[int, int]) -> Inputs:
    """A frame of {key}, more than 2^15; splats all along it."""
    width, height = value
    stream = stream_of([FrameCodes.intra_frame(beads(97, width, height))], width=width, height=height)
    expected = yield {"stream": stream}
    assert result(expected, "frames").reshape(-1, 3)[2**15 :].any()


@on("core", "decode_stream", flags=FLAGS)
def large_wide() -> Inputs:
    """A frame of 4113 columns, more than 256 tiles of 16, and two blocks of 2048; splats all along it."""
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(beads(274, 4113, 1))], width=4113, height=1)}
    assert result(expected, "frames").any(axis=(0, 1, 3)).mean() > 0.9


@case("core", "render_frame", flags=FLAGS)
def large_high(rng: Draws) -> Inputs:
    """A frame of 2061 rows, more than a block of 2048; splats all along it."""
    expected = yield {"parameters": population(rng, 160, 1, 2061, radius=5.0), "width": 1, "height": 2061,
                      "bit_depth": 8}  # fmt: skip
    assert expected["frame"].value[2048:].any()


@case("core", "render_sum", flags=FLAGS)
def more_than_512_columns(rng: Draws) -> Inputs:
    """A frame of 523 columns; splats all along it."""
    expected = yield {"parameters": population(rng, 60, 523, 1, radius=4.0), "width": 523, "height": 1}
    assert expected["sum"].value[0, 512:].any()


@case("core", "render_gradients", flags=FLAGS, each={"columns": (1051, 1), "rows": (1, 1051)}, draw=2)
def more_than_1024(value: tuple[int, int], rng: Draws) -> Inputs:
    """A residual of 1051 {key}; splats all along it."""
    parameters = population(rng, 40, *value, radius=5.0)
    expected = yield {"parameters": parameters, "residual": noise(rng, *value)}
    beyond = parameters[:, np.argmax(value)] > 1024
    assert expected["gradients"].value[beyond].any()


@on("core", "decode_stream", "decode_stream_deterministic", flags=["many"])
def more_than_1024_splats_on_a_tile() -> Inputs:
    """An I-frame of 1040 faint splats at one place and then a bright one: a tile that keeps 1024 loses it."""
    faint = equal_splats(1041)
    assert faint.colors is not None
    colors = (np.arange(1041)[:, None] == 1040).astype(np.uint16)
    book = np.array([[2.0**-14] * 3, [0.5] * 3], np.float16)
    block = SplatBlock(faint.positions, faint.cholesky, colors, faint.quantizer, (book,))
    expected = yield {"stream": stream_of([FrameCodes.intra_frame(block)], width=5, height=3)}
    assert result(expected, "frames")[0, 1, 2, 0] >= 127
