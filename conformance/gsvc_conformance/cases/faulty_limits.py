"""Faults of limits: splats and rendering work of a frame beyond those of the level, in `main` of every one."""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from gsvc_conformance.cases.building import operated, predicted, quantizer_of
from gsvc_conformance.cases.container import equal_splats
from gsvc_conformance.cases.faults import MAIN, SMALL_HEADER, Broken, each_of, flat, overview
from gsvc_conformance.cases.main_streams import crowd
from gsvc_ref.bitstream import LEVELS, SequenceHeader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.header import LANE_EXPONENTS
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.frames import frame_body
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.paper import FrameCodes, SplatBlock
from gsvc_ref.testing import OVERVIEW_HEADER, Lie, write_stream


def limit_faults() -> Iterator[Broken]:
    """All of them."""
    yield from _splats()
    yield from _rendering_work()


def _splats() -> Iterator[Broken]:
    most = LEVELS[1].splats
    counts = {"one_more": most + 1, "four_billion": 2**32 - 1}
    yield from each_of("R-5-2", "limit", f"level 1 allows {most}",
                     {f"splats_{k}": (f"splat_count is {n}", (Lie("splat_count", n),)) for k, n in counts.items()},
                     overview)  # fmt: skip
    yield from each_of("R-5-2", "limit", f"level 1 allows {most}",
                     {f"new_splats_{k}": (f"new_splat_count is {n}", (Lie("new_splat_count", n),))
                      for k, n in counts.items()},
                     _two, 1)  # fmt: skip
    together = {"survivors_and_new": (f"one splat stays and {most} come", (Lie("new_splat_count", most),))}
    yield from each_of("R-5-2", "limit", f"level 1 allows {most}", together, _two, 1)
    for level in range(2, 6):
        splats = LEVELS[level].splats
        yield Broken("R-5-2", "limit", f"splats_of_level_{level}", f"splat_count is {splats + 1}",
                     f"level {level} allows {splats}",
                     partial(overview, Lie("splat_count", splats + 1), level=level))  # fmt: skip


def _two(*lies: Lie) -> bytes:
    """One splat, and another one that comes; every plane is one symbol, so that there may be any number of them."""
    frames = [FrameCodes.intra_frame(equal_splats(1)), predicted([1], SplatBlock(), equal_splats(1))]
    return write_stream(OVERVIEW_HEADER, frames, lies=lies)


def _rendering_work() -> Iterator[Broken]:
    yield Broken("R-5-4", "limit", "one_splat_more", "513 splats cover 256x256 pixels: 2^25 + 2^16 pairs",
                 "level 1 allows 2^25", lambda: _work(513, 256, 256))  # fmt: skip
    yield Broken("R-5-4", "limit", "one_pixel_more", "a splat covers one pixel, 512 cover 256x256: 2^25 + 1 pairs",
                 "level 1 allows 2^25", _one_pair_more)  # fmt: skip
    yield Broken("R-5-4", "limit", "new_splats", "256 splats cover 256x256 pixels, then 257 more",
                 "level 1 allows 2^25", _more_in_a_p_frame, 1)  # fmt: skip
    yield Broken("R-5-4", "limit", "splats_that_grow", "600 splats of a few pixels grow beyond the frame",
                 "level 1 allows 2^25", _grown_in_a_p_frame, 1)  # fmt: skip
    yield Broken("R-5-4", "limit", "beyond_32_bits", "4097 splats cover 1024x1024 pixels: 2^32 + 2^20 pairs",
                 "level 2 allows 2^28", lambda: _work(4097, 1024, 1024, level=2))  # fmt: skip


def _large(block: int) -> tuple[Lie, ...]:
    """Lies that make the splats of a block cover the frame, where every block has a quantiser."""
    return Lie("cholesky_offset", [1e30], 3 * block), Lie("cholesky_offset", [1e30], 3 * block + 2)


def _work(count: int, width: int, height: int, **header: Any) -> bytes:
    return flat(count, *_large(0), width=width, height=height, **header)


def _more_in_a_p_frame() -> bytes:
    """An I-frame within the limit, and new splats within it, which are too much together."""
    frames = [FrameCodes.intra_frame(equal_splats(256, 1e30)), predicted([1] * 256, SplatBlock(), equal_splats(257))]
    return write_stream(replace(OVERVIEW_HEADER, width=256, height=256), frames, lies=_large(1))


def _grown_in_a_p_frame() -> bytes:
    """Splats of one pixel, and differences of their factors; nothing new comes."""
    zeros = np.zeros((600, 3), np.uint16)
    grown = SplatBlock(cholesky=zeros, quantizer=quantizer_of([1, 1, 1], [0, 0, 0]))
    frames = [FrameCodes.intra_frame(equal_splats(600)), predicted([1] * 600, grown)]
    return write_stream(replace(OVERVIEW_HEADER, width=256, height=256), frames, lies=_large(1))


def _one_pair_more() -> bytes:
    """512 splats that cover the frame and one of 0.01 pixels; with its own step the code of the small one is 0."""
    codes = np.zeros((513, 3), np.uint16)
    codes[:512] = 1, 0, 1
    quantizer = quantizer_of([1, 1, 1], [0.01, 0, 0.01])
    zeros = np.zeros((513, 2), np.uint16)
    zeros[512] = np.array([2.0**-9, 2.0**-9], np.float16).view(np.uint16)
    block = SplatBlock(zeros, codes, np.zeros((513, 1), np.uint16), quantizer, (np.zeros((1, 3), np.float16),))
    lies = [Lie("cholesky_scale", [1e30]), Lie("cholesky_scale", [1e30], 2)]
    header = replace(OVERVIEW_HEADER, width=256, height=256)
    return write_stream(header, [FrameCodes.intra_frame(block)], lies=lies)


def main_limits() -> Iterator[Broken]:
    """Those of streams of profile `main`."""
    most = LEVELS[1].splats
    yield from each_of("R-5-2", "limit", f"level 1 allows {most}",
                     {"splats_of_2_to_the_31": ("splat_number says 2^31 splats", (Lie("splat_number", 2**32 - 1),))},
                     MAIN.overview)  # fmt: skip
    for level, limits in LEVELS.items():
        allowed = partial("level {} allows {}".format, level)
        side = math.isqrt(limits.pixels)
        if level in (2, 3, 4):
            yield Broken("R-5-1", "limit", f"pixels_of_level_{level}", f"a frame has {side}x{side + 1} pixels",
                         allowed(limits.pixels), partial(MAIN.overview, Lie("width", side), Lie("height", side + 1),
                                                         level=level))  # fmt: skip
        if level > 1:
            yield Broken("R-5-2", "limit", f"splats_of_level_{level}", f"an I-frame has {limits.splats + 1} splats",
                         allowed(limits.splats),
                         partial(MAIN.overview, Lie("splat_number", 2 * limits.splats + 1), level=level))  # fmt: skip
        if level in (2, 3):
            lanes = LANE_EXPONENTS[level]
            yield Broken("R-5-11", "limit", f"max_lane_exponent_{lanes + 1}", f"max_lane_exponent is {lanes + 1}",
                         allowed(lanes), partial(MAIN.overview, Lie("max_lane_exponent", lanes + 1),
                                                 level=level))  # fmt: skip
        height = 256 if level == 1 else side
        width = limits.pixels // height
        yield Broken("R-5-4", "limit", f"work_of_level_{level}",
                     f"257 splats cover {width}x{height} pixels each", allowed(limits.work),
                     partial(_covered, replace(SMALL_HEADER, level=level, width=width, height=height)))  # fmt: skip
    yield Broken("R-5-4", "limit", "new_splats", "256 splats cover 512x256 pixels, and one more comes",
                 "level 1 allows 2^25", partial(_covered, replace(SMALL_HEADER, width=512, height=256), 1),
                 1)  # fmt: skip


def _covered(header: SequenceHeader, later: int = 0) -> bytes:
    """An I-frame of 257 splats that cover the frame, of which `later` ones come in a P-frame after it."""
    state = MainState.initial(header.width, header.height)
    intra = crowd(header, (33, 0), 257 - later)
    frames = [(b"I", intra)]
    if later:
        still = np.zeros(257 - later, np.int64), np.zeros((257 - later, 8), np.int64)
        new = crowd(header, (33, 0), later)
        frames.append((b"P", replace(new, type="P", modes=still[0], differences=still[1])))
    chunks = []
    for number, (letter, codes) in enumerate(frames):
        p = Writer()
        state = frame_body(p, codes.type, state, header.max_lane_exponent, header.limits.splats, codes).after
        chunks.append((letter, bytes([number]) + p.getvalue()))
    empty = [MainCodes(type="I", quantizer=24)] * len(frames)
    return operated(lambda c: [c[0], *chunks, c[-1]], write_stream(header, empty, index=False))
