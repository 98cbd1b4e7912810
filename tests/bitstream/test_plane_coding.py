"""Planes (spec.md section 6.6): any symbols come back, and the writer takes the smallest form that it knows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.plane_coding import CODED, CONSTANT, RAW, choose_plane_code
from gsvc_ref.bitstream.planes import plane as plane_syntax
from gsvc_ref.testing import Plane, planes


def header(precision: int = 14, lanes: int = 1) -> SequenceHeader:
    return SequenceHeader(level=1, width=8, height=8, entropy_precision=precision, lane_count=lanes)


def raw_size(plane: Plane) -> int:
    return (2 + (plane.alphabet - 1).bit_length() * len(plane.symbols) + 7) // 8


@given(planes(), st.integers(12, 16), st.integers(1, 64), st.integers(0, 7))
def test_round_trip(plane: Plane, precision: int, lanes: int, offset: int) -> None:
    s = Writer()
    s.u("offset", offset, 0)
    plane_syntax(s, header(precision, lanes), "colors", "p", len(plane.symbols), plane.alphabet, plane.symbols)
    reader = Reader(s.getvalue())
    reader.u("offset", offset)
    read = plane_syntax(reader, header(precision, lanes), "colors", "p", len(plane.symbols), plane.alphabet)
    np.testing.assert_array_equal(read, plane.symbols, strict=True)
    assert reader.bits_left == 0
    assert reader.bits == s.bits


@given(planes(), st.integers(1, 8))
def test_size_is_the_size_and_never_above_raw(plane: Plane, lanes: int) -> None:
    code = choose_plane_code(plane.symbols, plane.alphabet, header(lanes=lanes))
    s = Writer()
    plane_syntax(s, header(lanes=lanes), "colors", "p", len(plane.symbols), plane.alphabet, plane.symbols)
    assert code.size(plane.alphabet) == len(s.getvalue())
    assert code.size(plane.alphabet) <= raw_size(plane)


def test_modes() -> None:
    rng = np.random.default_rng(1)
    noise = rng.integers(0, 64, 500, np.uint16)
    peaked = np.clip(rng.normal(30, 2, 500), 0, 63).astype(np.uint16)
    assert choose_plane_code(np.full(500, 9), 64, header()).plane_mode == CONSTANT
    assert choose_plane_code(noise, 64, header()).plane_mode == RAW
    assert choose_plane_code(peaked, 64, header()).plane_mode == CODED
    assert choose_plane_code(peaked[:4], 64, header(lanes=4)).plane_mode == RAW


def test_coded_size_is_near_the_entropy() -> None:
    """10,000 symbols of a known distribution: within 1.5 % of their entropy, table included."""
    symbols = np.clip(np.random.default_rng(2).normal(32, 5, 10_000), 0, 63).astype(np.uint16)
    shares = np.bincount(symbols) / len(symbols)
    entropy = -np.sum(shares[shares > 0] * np.log2(shares[shares > 0])) * len(symbols)
    code = choose_plane_code(symbols, 64, header())
    assert entropy < 8 * code.size(64) < 1.015 * entropy


def test_a_rare_symbol_costs_little() -> None:
    """A survivor map of 10,000 splats of which one goes."""
    survivors = np.ones(10_000, np.uint16)
    survivors[77] = 0
    assert choose_plane_code(survivors, 2, header()).size(2) <= 16
    assert choose_plane_code(np.ones(10_000, np.uint16), 2, header()).size(2) == 1


def test_symbols_outside_of_the_alphabet_are_refused() -> None:
    with pytest.raises(UsageError, match=r"R-6\.6-2"):
        choose_plane_code(np.array([1, 64]), 64, header())
