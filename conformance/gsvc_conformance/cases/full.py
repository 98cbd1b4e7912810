"""The full set: real sizes, too large for the repository; `gsvc-conformance generate --full FOLDER` writes it."""

import numpy as np

from gsvc_base.draws import Draws
from gsvc_base.splats import F4
from gsvc_conformance.case import FULL, Inputs, case
from gsvc_conformance.cases.building import on, operated, predicted, result, stream_of
from gsvc_conformance.cases.container import UUID, equal_splats
from gsvc_ref.bitstream import LEVELS, SequenceHeader, level_for
from gsvc_ref.paper import FrameCodes, Quantizer, SplatBlock
from gsvc_ref.testing import write_stream

STAGES = 2
CODEWORDS = 64
CHOLESKY_BITS = 8


@case(FULL, "render_frame", flags=["many"])
def full_hd_frame(rng: Draws) -> Inputs:
    """A frame of 1920x1080 pixels with 10,000 splats."""
    expected = yield {"parameters": crowd(rng, 1920, 1080, 10_000), "width": 1920, "height": 1080, "bit_depth": 8}
    assert np.ptp(expected["frame"].value) == 255


@case(FULL, "render_gradients", flags=["many"])
def full_hd_gradients(rng: Draws) -> Inputs:
    """The gradients of 10,000 splats on a frame of 1920x1080 pixels."""
    residual = rng.normal(0, 1e-6, (1080, 1920, 3)).astype(np.float32)
    expected = yield {"parameters": crowd(rng, 1920, 1080, 10_000), "residual": residual}
    assert np.count_nonzero(expected["gradients"].value) > 0


@case(FULL, "decode_stream_deterministic", flags=["survivors"])
def full_hd_stream(rng: Draws) -> Inputs:
    """Three frames of 1920x1080 pixels with 10,000 splats each."""
    expected = yield {"stream": sequence(rng, 1920, 1080, 10_000, 3)}
    assert len(expected["frames"].value) == 3


@case(FULL, "decode_stream_deterministic", flags=["survivors", "kept"])
def long_stream(rng: Draws) -> Inputs:
    """Two hundred frames of 176x144 pixels, nearly all predicted: an error in any of them lasts."""
    expected = yield {"stream": sequence(rng, 176, 144, 500, 200)}
    assert len(expected["frames"].value) == 200


@case(FULL, "reconstruct_stream", flags=["survivors", "kept"])
def thousands_of_frames(rng: Draws) -> Inputs:
    """Ten thousand frames with 20 splats each: predictions of predictions, exact to the last one."""
    expected = yield {"stream": sequence(rng, 64, 48, 20, 10_000)}
    assert len(expected["counts"].value) == 10_000


@on(FULL, "decode_stream", "decode_stream_deterministic", flags=["limit", "many"])
def more_than_65536_splats() -> Inputs:
    """An I-frame of 65,550 degenerate splats; then a visible one comes, whose index does not fit into 16 bits."""
    count = 65_550
    frames = [FrameCodes.intra_frame(equal_splats(count, 0)),
              predicted([1] * count, SplatBlock(), equal_splats(1, color=1))]  # fmt: skip
    expected = yield {"stream": stream_of(frames, width=5, height=3, level=3)}
    assert result(expected, "frames").max(axis=(1, 2, 3)).tolist() == [0, 255]


@case(FULL, "reconstruct_stream", flags=["limit"], rules=["R-5-3"])
def payload_as_long_as_allowed() -> Inputs:
    """An ancillary chunk of 2^20 bytes, the most that level 1 allows, after the first frame."""
    extra = b"q", UUID.ljust(LEVELS[1].payload, b"\0")
    expected = yield {"stream": operated(lambda chunks: [*chunks[:2], extra, *chunks[2:]])}
    assert len(expected["counts"].value) == 3


def crowd(rng: Draws, width: int, height: int, count: int) -> F4:
    """Splats (count, 8) f4 that fill a frame as those of a trained one do: many small ones, few large ones."""
    size = rng.lognormal(0, 0.7, (count, 2)) * 0.6 * np.sqrt(width * height / count)  # pixels
    shear = rng.normal(0, 0.5, count) * size.mean(axis=1)
    position = rng.uniform(-0.02, 1.02, (count, 2)) * (width, height)
    color = rng.normal(0.15, 0.25, (count, 3))
    return np.column_stack([position, size[:, 0], shear, size[:, 1], color]).astype(np.float32)


def sequence(rng: Draws, width: int, height: int, count: int, frames: int) -> bytes:
    """A stream of P-frames that move, lose a few splats and get as many; now and then an I-frame or an R-frame."""
    header = SequenceHeader(
        level=level_for(width, height, splats=count, work=100 * width * height),
        parameter_checksum_flag=True,
        width=width,
        height=height,
        cholesky_bits=CHOLESKY_BITS,
        color_stages=STAGES,
        color_codewords=CODEWORDS,
        lane_count=4,
    )
    return write_stream(header, [_frame(rng, number, width, height, count) for number in range(frames)])


def _frame(rng: Draws, number: int, width: int, height: int, count: int) -> FrameCodes:
    if number % 150 == 0:
        return FrameCodes.intra_frame(_intra(rng, width, height, count, own=True))
    if number % 17 == 16:
        return FrameCodes.repeated_frame()
    survivors = rng.random(count) < 0.97
    stay = int(np.count_nonzero(survivors))
    own = number % 150 in (1, 2) or number % 40 == 0  # the first after an I-frame may be repeated
    return FrameCodes.predicted_frame(
        survivors, _inter(rng, stay, own=own), _intra(rng, width, height, count - stay, own=False)
    )


def _intra(rng: Draws, width: int, height: int, count: int, *, own: bool) -> SplatBlock:
    size = np.float32(0.05 * np.sqrt(width * height / count)) if own else None  # a step of the codes, in pixels
    quantizer = None if size is None else Quantizer(np.full(3, size / 16), np.array([size * 4, -size * 8, size * 4]))
    books = tuple(rng.normal(0.1, spread, (CODEWORDS, 3)).astype(np.float16) for spread in (0.3, 0.05))
    return SplatBlock(
        rng.uniform(-1, 1, (count, 2)).astype(np.float16).view(np.uint16),
        np.clip(rng.normal(128, 50, (count, 3)), 0, 255).astype(np.uint16),
        rng.integers(0, CODEWORDS, (count, STAGES), np.uint16),
        quantizer,
        books if own else None,
    )


def _inter(rng: Draws, count: int, *, own: bool) -> SplatBlock:
    quantizer = Quantizer(np.full(3, 2.0**-9), np.full(3, -(2.0**-2))) if own else None
    books = tuple(rng.normal(0, spread, (CODEWORDS, 3)).astype(np.float16) for spread in (0.01, 0.002))
    return SplatBlock(
        rng.normal(0, 2.0**-10, (count, 2)).astype(np.float16).view(np.uint16),
        np.clip(rng.normal(128, 2, (count, 3)), 0, 255).astype(np.uint16),
        np.floor(CODEWORDS * rng.random((count, STAGES)) ** 2).astype(np.uint16),
        quantizer,
        books if own else None,
    )
