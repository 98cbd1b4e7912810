"""Section 8 of spec.md: every parameter against the formula in binary64, rounded to binary32 after each operation."""

import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.splats import Splats
from gsvc_ref import spec
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.paper import (
    FrameCodes,
    Quantizer,
    SplatBlock,
    State,
    reconstruct,
    reconstruct_inter,
    reconstruct_intra,
)
from gsvc_ref.testing import frames, headers

BOOKS = (np.array([[0.5, 0, -1], [2.0**-10, 3, 0]], np.float16), np.array([[2.0**-24, 1, 1]], np.float16))


def fl(value: float) -> float:
    """Rounding to binary32; innocuous after one operation in binary64, which has more than twice the bits."""
    result: float = struct.unpack("<f", struct.pack("<f", value))[0]
    return result


def half(bits: int) -> float:
    result: float = struct.unpack("<e", struct.pack("<H", bits))[0]
    return result


def difference(value: float, reference: float | None) -> float:
    return value if reference is None else fl(reference + value)


def expected_splat(block: SplatBlock, n: int, quantizer: Any, books: Any, state: State, ref: Any) -> list[float]:
    """One splat by (8-1) to (8-4), `ref` being its reference parameters or None in an intra block."""
    parameters = list(ref) if ref is not None else [0.0] * 8
    if block.positions is not None:
        for axis, size in enumerate((state.width, state.height)):
            h = half(int(block.positions[n, axis]))
            scaled = fl(fl(h + 1) * (size / 2)) if ref is None else fl(ref[axis] + fl(h * (size / 2)))
            parameters[axis] = scaled
    if block.cholesky is not None:
        for channel in range(3):
            q = float(block.cholesky[n, channel])
            value = fl(fl(q * float(quantizer.scale[channel])) + float(quantizer.offset[channel]))
            parameters[2 + channel] = difference(value, ref and ref[2 + channel])
    if block.colors is not None:
        for channel in range(3):
            total = None
            for index, book in zip(block.colors[n].tolist(), books, strict=True):
                total = difference(float(book[index, channel]), total)
            assert total is not None
            parameters[5 + channel] = difference(total, ref and ref[5 + channel])
    return parameters


def expected(codes: FrameCodes, state: State) -> Splats:
    """The splats of a frame, one parameter at a time."""
    if codes.type == "R":
        return state.splats
    rows = []
    if codes.inter is not None:
        kept = state.inter
        quantizer, books = codes.inter.quantizer or kept.quantizer, codes.inter.codebooks or kept.codebooks
        stay = [row for row, stays in zip(state.splats.to_array().tolist(), codes.survivors, strict=True) if stays]
        rows += [expected_splat(codes.inter, n, quantizer, books, state, ref) for n, ref in enumerate(stay)]
    if codes.intra is not None:
        kept = state.intra
        quantizer, books = codes.intra.quantizer or kept.quantizer, codes.intra.codebooks or kept.codebooks
        count = codes.intra.count or 0
        rows += [expected_splat(codes.intra, n, quantizer, books, state, None) for n in range(count)]
    return Splats.from_array(np.array(rows, np.float64).reshape(-1, 8).astype(np.float32))


@given(headers(), st.data())
@settings(max_examples=30)
def test_formulas(header: SequenceHeader, data: st.DataObject) -> None:
    state = State.initial(header.width, header.height)
    for number in range(4):
        codes = data.draw(frames(header, state, types="IPR" if number else "I", max_count=12))
        after = reconstruct(codes, state)
        assert after.splats == expected(codes, state)
        state = after


def one_splat(**changes: Any) -> SplatBlock:
    parts: dict[str, Any] = {
        "positions": np.array([[0x3C00, 0xBC00]], np.uint16),
        "cholesky": np.array([[1, 2, 3]], np.uint16),
        "colors": np.array([[1, 0]], np.uint16),
        "quantizer": Quantizer(np.array([0.5, 0.25, 2]), np.array([1, -1, 0])),
        "codebooks": BOOKS,
    }
    return SplatBlock(**{**parts, **changes})


def test_by_hand() -> None:
    state = reconstruct(FrameCodes.intra_frame(one_splat()), State.initial(101, 50))
    # x = (1 + 1) * 50.5, y = (-1 + 1) * 25; colours 2^-10 + 2^-24, 3 + 1, 0 + 1
    assert state.splats.to_array().tolist() == [[101, 0, 1.5, -0.5, 6, 2.0**-10 + 2.0**-24, 4, 1]]
    moved = SplatBlock(positions=np.array([[0xB800, 0x0001]], np.uint16))  # -1/2, the smallest subnormal
    state = reconstruct(FrameCodes.predicted_frame(np.ones(1, np.bool_), moved), state)
    assert state.splats.positions.tolist() == [[101 - 25.25, 25 * 2.0**-24]]
    assert state.splats.cholesky.tolist() == [[1.5, -0.5, 6]]


def test_subnormals_are_kept() -> None:
    tiny = one_splat(quantizer=Quantizer(np.full(3, 2.0**-126), np.array([-(2.0**-126) * 1.5, 0, 0])))
    state = reconstruct(FrameCodes.intra_frame(tiny), State.initial(8, 8))
    assert state.splats.cholesky[0, 0] == np.float32(-(2.0**-127))


def test_multiplication_and_addition_are_not_fused() -> None:
    """R-3.3-1: q · s is rounded before the offset takes it away; fused, the rounding error 2^-23 would be left."""
    scale = np.float32(1 + 2.0**-23)
    q = 4095
    exact = q * float(scale)
    product = fl(exact)
    assert exact != product
    block = one_splat(
        cholesky=np.full((1, 3), q, np.uint16), quantizer=Quantizer(np.full(3, scale), np.full(3, -product))
    )
    state = reconstruct(FrameCodes.intra_frame(block), State.initial(8, 8))
    assert state.splats.cholesky.tolist() == [[0, 0, 0]]


def test_an_absent_attribute_keeps_its_bits() -> None:
    """Also the sign of a zero, which adding +0 would lose."""
    quantizer = Quantizer(np.ones(3), np.array([-0.0, 1, 1]))
    negative = one_splat(
        cholesky=np.zeros((1, 3), np.uint16), quantizer=quantizer, positions=np.array([[0xBC00, 0]], np.uint16)
    )
    state = State(8, 8, Splats.from_array([[-0.0] * 8]))
    after = reconstruct(FrameCodes.predicted_frame(np.ones(1, np.bool_), SplatBlock()), state)
    assert after.splats == state.splats
    assert np.signbit(after.splats.to_array()).all()
    assert not np.signbit(reconstruct(FrameCodes.intra_frame(negative), State.initial(8, 8)).splats.cholesky[0, 0])


def test_survivors_keep_their_order_and_new_ones_follow() -> None:
    positions = np.arange(5, dtype=np.float16)[:, None].repeat(2, axis=1).view(np.uint16)
    block = SplatBlock(
        positions, np.zeros((5, 3), np.uint16), np.zeros((5, 2), np.uint16), one_splat().quantizer, BOOKS
    )
    state = reconstruct(FrameCodes.intra_frame(block), State.initial(2, 2))
    survivors = np.array([False, True, False, True, True])
    codes = FrameCodes.predicted_frame(survivors, SplatBlock(), one_splat(quantizer=None, codebooks=None))
    after = reconstruct(codes, state)
    assert after.splats.positions[:, 0].tolist() == [2, 4, 5, 2]
    assert after.splats.take(np.arange(3)) == state.splats.take(np.flatnonzero(survivors))


def test_state_is_not_changed_and_i_frames_forget() -> None:
    state = reconstruct(FrameCodes.intra_frame(one_splat()), State.initial(8, 8))
    assert state.intra.codebooks is not None
    assert state.inter.codebooks is None
    bare = one_splat(quantizer=None, codebooks=None)
    twice = reconstruct(FrameCodes.predicted_frame(np.zeros(1, np.bool_), None, bare), state)
    assert twice.splats == state.splats
    with pytest.raises(UsageError, match=r"R-6\.5-4"):
        reconstruct(FrameCodes.intra_frame(bare), state)
    colored = SplatBlock(colors=np.zeros((1, 2), np.uint16))
    with pytest.raises(UsageError, match=r"R-6\.5-4"):
        reconstruct(FrameCodes.predicted_frame(np.ones(1, np.bool_), colored), state)
    assert reconstruct(FrameCodes.repeated_frame(), state) is state
    empty = reconstruct(FrameCodes.intra_frame(None), state)
    assert len(empty.splats) == 0
    assert empty.intra.quantizer is None


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"positions": np.array([[0, 0x7C00]], np.uint16)}, "position"),
        ({"quantizer": Quantizer(np.full(3, 3e38), np.zeros(3))}, "Cholesky"),
        ({"codebooks": (BOOKS[0], np.array([[np.inf, 0, 0]], np.float16))}, "colour"),
    ],
)
def test_overflow(changes: dict[str, Any], what: str) -> None:
    with pytest.raises(GsvcError, match=what) as caught:
        reconstruct(FrameCodes.intra_frame(one_splat(**changes)), State.initial(8, 8))
    assert (caught.value.kind, caught.value.rule) == ("invalid", "R-8-1")


@pytest.mark.parametrize(
    "changes",
    [
        {"positions": None},
        {"colors": None},
        {"colors": np.zeros((1, 1), np.uint16)},
        {"colors": np.full((1, 2), 2, np.uint16)},
    ],
)
def test_codes_that_do_not_fit(changes: dict[str, Any]) -> None:
    with pytest.raises(UsageError):
        reconstruct(FrameCodes.intra_frame(one_splat(**changes)), State.initial(8, 8))


def test_survivors_that_do_not_fit() -> None:
    with pytest.raises(UsageError, match="the frame before has 0"):
        reconstruct(FrameCodes.predicted_frame(np.zeros(3, np.bool_), None), State.initial(8, 8))


def test_positions_are_those_of_the_spec_for_every_finite_pattern():
    patterns = np.arange(1 << 16, dtype=np.uint16).reshape(-1, 2)
    bits = patterns[(patterns & 0x7C00 != 0x7C00).all(axis=1)]
    codes = {"cholesky": np.zeros((len(bits), 3), np.uint16), "scale": np.ones(3, np.float32),
             "offset": np.zeros(3, np.float32), "color_indices": np.zeros((len(bits), 1), np.uint16),
             "codebook_sizes": np.ones(1, np.int64), "codewords": np.zeros((1, 3), np.uint16)}  # fmt: skip
    given = {"width": 65535, "height": 1, "positions": bits, **codes}
    expected = spec.reconstruct_intra(**given)["parameters"]
    assert reconstruct_intra(**given).to_array().tobytes() == expected.tobytes()
    given["reference"], given["survivors"] = expected, np.ones(len(bits), np.uint8)
    expected = spec.reconstruct_inter(**given)["parameters"]
    assert reconstruct_inter(**given).to_array().tobytes() == expected.tobytes()
