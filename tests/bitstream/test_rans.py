"""Entropy coding (spec.md section 7): the kernels against spec.md, for any plane, precision and lanes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_ref import spec
from gsvc_ref.bitstream.frequencies import (
    MAX_UNITS,
    all_frequencies,
    log2_table,
    normalized_frequencies,
    savings,
)
from gsvc_ref.bitstream.rans import LOWEST_STATE, decode_kernel, encode_plane
from gsvc_ref.testing import Plane, planes

PLANES = planes(max_count=120, alphabets=st.sampled_from((2, 3, 16, 64, 300)))


def table_of(plane: Plane, precision: int) -> tuple[int, np.ndarray]:
    """First symbol and scaled frequencies; a plane of one symbol gets a second that never occurs."""
    first, last = int(plane.symbols.min()), int(plane.symbols.max())
    counts = np.bincount(plane.symbols, minlength=last + 1)[first:].astype(np.int64)
    if first == last:
        return first, np.array([2**precision - 1, 1])
    return first, normalized_frequencies(counts, precision)


@given(PLANES, st.integers(12, 16), st.integers(1, 64))
def test_round_trip_and_twins(plane: Plane, precision: int, lanes: int) -> None:
    first, frequencies = table_of(plane, precision)
    count = len(plane.symbols)
    states, words = encode_plane(plane.symbols, frequencies, precision, lanes, first)
    plain = spec.encode_plane(plane.symbols - first, frequencies, precision, lanes)
    assert states.tobytes() == plain["lane_states"].tobytes()
    assert words.tobytes() == plain["words"].tobytes()
    assert (states >= LOWEST_STATE).all()

    final, decoded = states.astype(np.int64), np.empty(count, np.uint16)
    assert decode_kernel(frequencies, first, precision, final, words, decoded) == len(words)
    np.testing.assert_array_equal(decoded, plane.symbols)
    assert (final == LOWEST_STATE).all()
    final_plain = states.tolist()
    symbols, taken = spec.decode_symbols(count, frequencies.tolist(), precision, final_plain, words.tolist(), 0)
    assert (symbols + first).tolist() == plane.symbols.tolist()
    assert (taken, final_plain) == (len(words), final.tolist())


@given(st.data(), st.integers(12, 16), st.integers(1, 5), st.integers(1, 60))
def test_decoders_agree_on_any_states_and_words(data: st.DataObject, precision: int, lanes: int, count: int) -> None:
    """Hostile input: whatever passes the checks of the table decodes alike, and no word is read that is not there."""
    state = st.integers(LOWEST_STATE, 2**32 - 1)
    states = data.draw(st.lists(state, min_size=min(lanes, count), max_size=min(lanes, count)))
    words = data.draw(st.lists(st.integers(0, 65535), max_size=40))
    shares = data.draw(st.lists(st.integers(0, 100), min_size=2, max_size=9).filter(any))
    frequencies = normalized_frequencies(np.array(shares), precision)
    final, decoded = np.array(states), np.empty(count, np.uint16)
    taken = decode_kernel(frequencies, 7, precision, final, np.array(words, np.uint16), decoded)
    if taken < 0:
        with pytest.raises(spec.Fault):
            spec.decode_symbols(count, frequencies.tolist(), precision, states, words, 0)
    else:
        symbols, taken_plain = spec.decode_symbols(count, frequencies.tolist(), precision, states, words, 0)
        assert taken == taken_plain
        assert decoded.tolist() == (symbols + 7).tolist()
        assert final.tolist() == states
        assert (final >= LOWEST_STATE).all()
        assert (final < 2**32).all()


@pytest.mark.parametrize("precision", [12, 16])
@pytest.mark.parametrize("state", [LOWEST_STATE, 2**32 - 1])
def test_extreme_frequencies_and_states(precision: int, state: int) -> None:
    """f = 1 and f = 2^R - 1 from the lowest and the highest state."""
    for frequencies in ([1, 2**precision - 1], [2**precision - 1, 1]):
        final, decoded = np.array([state]), np.empty(40, np.uint16)
        words = np.full(40, 65535, np.uint16)
        taken = decode_kernel(np.array(frequencies), 0, precision, final, words, decoded)
        states = [state]
        symbols, taken_plain = spec.decode_symbols(40, frequencies, precision, states, words.tolist(), 0)
        assert (symbols.tolist(), taken_plain) == (decoded.tolist(), taken)
        assert states == final.tolist()


def test_worked_example() -> None:
    """Symbols 0 1 0 with f = (3, 1)/4 scaled to 2^12, by hand: only the last step of each state is below 2^16."""
    frequencies = np.array([3072, 1024])
    states, words = encode_plane(np.array([0, 1, 0], np.uint16), frequencies, 12, 1)
    # Backwards from 65536: 0 -> (65536 div 3072) * 4096 + 65536 mod 3072 = 21 * 4096 + 1024 = 87040;
    # 1 -> 85 * 4096 + 0 + 3072 = 351232; 0 -> 114 * 4096 + 1024 = 467968.
    assert states.tolist() == [467968]
    assert words.tolist() == []


@given(st.lists(st.integers(0, 5000), min_size=1, max_size=6).filter(any), st.integers(3, 5))
def test_frequencies_cost_the_least(counts: list[int], table_bits: int) -> None:
    """No exchange of one unit between two symbols saves bits; for a convex cost that is the optimum."""
    n = np.array(counts)
    f = normalized_frequencies(n, table_bits)
    used = np.flatnonzero(n)
    assert f.sum() == 2**table_bits
    assert (f[used] >= 1).all()
    assert (f[n == 0] == 0).all()
    for up in used:
        for down in used[f[used] > 1]:
            if up != down:
                saved = n[up] * np.log2((f[up] + 1) / f[up]) - n[down] * np.log2(f[down] / (f[down] - 1))
                assert saved <= 1e-9 * n.sum()


def test_savings_are_logarithms() -> None:
    f = np.arange(1, MAX_UNITS + 1)
    np.testing.assert_allclose(savings()[1:], np.log1p(1 / f) / np.log(2), rtol=1e-14)
    np.testing.assert_allclose(log2_table()[1:], np.log2(f), atol=1e-11)
    assert (np.diff(savings()[1:]) < 0).all()


@given(st.lists(st.integers(0, 5000), min_size=1, max_size=40).filter(any), st.integers(1, 12))
def test_tables_of_all_sizes_are_those_of_the_definition(counts: list[int], most_bits: int) -> None:
    n = np.array(counts)
    tables = dict(all_frequencies(n, most_bits))
    least_bits = max(1, int(np.count_nonzero(n) - 1).bit_length())
    assert list(tables) == list(range(least_bits, most_bits + 1))
    for table_bits, f in tables.items():
        assert f.tolist() == normalized_frequencies(n, table_bits).tolist()


@given(planes(max_count=400), st.integers(12, 16))
def test_frequencies_of_any_plane(plane: Plane, table_bits: int) -> None:
    counts = np.bincount(plane.symbols).astype(np.int64)
    f = normalized_frequencies(counts, table_bits)
    assert f.sum() == 2**table_bits
    np.testing.assert_array_equal(f > 0, counts > 0)
