"""Runs of profile `main`: inputs of `encode_run`, and what a decoder gets back from its outputs."""

from collections.abc import Generator, Mapping
from typing import Any, Final

import numpy as np

from gsvc_base import spec
from gsvc_base.draws import Draws
from gsvc_base.portable import power
from gsvc_conformance.cases.building import Array, result
from gsvc_conformance.cases.states import ints

TOTAL: Final = spec.TOTAL
MIN_STATE: Final = spec.LOWEST_STATE


def run_of(symbols: Any, lane_count: int, lanes: Any = None, early: Any = (), late: Any = ()) -> dict[str, Any]:
    """Inputs of encode_run: c(s) and f(s) of each symbol, in one pass unless lanes are given; raw values and sizes."""
    rows, first, last = (ints(pairs).reshape(-1, 2) for pairs in (symbols, early, late))
    of_one_pass = np.arange(len(rows)) % lane_count
    return {"starts": rows[:, 0].copy(), "frequencies": rows[:, 1].copy(),
            "lanes": of_one_pass if lanes is None else ints(lanes), "lane_count": lane_count,
            "early": first[:, 0].copy(), "early_sizes": first[:, 1].copy(),
            "late": last[:, 0].copy(), "late_sizes": last[:, 1].copy()}  # fmt: skip


def decoded(inputs: dict[str, Any], states: Array, counts: Array, words: Array) -> tuple[list[int], list[int]]:
    """The slots that a decoder finds by (7-1), which takes all words of each group, and the states it ends with."""
    lanes, slots = states.astype(np.int64).tolist(), []
    ends = np.cumsum(counts)
    left = [words[end - count : end].tolist() for count, end in zip(counts, ends, strict=True)]
    columns = (inputs[name].tolist() for name in ("starts", "frequencies", "lanes"))
    for start, frequency, lane in zip(*columns, strict=True):
        slots.append(lanes[lane] % TOTAL)
        lanes[lane] = frequency * (lanes[lane] // TOTAL) + slots[-1] - start
        if lanes[lane] < MIN_STATE:
            lanes[lane] = lanes[lane] * 2**16 + left[lane // 32].pop(0)
    assert not any(left)
    return slots, lanes


def bits_of(values: Array, sizes: Array) -> list[int]:
    """Raw values as bits."""
    return [int(value) >> i & 1 for value, size in zip(values, sizes, strict=True) for i in range(size)]


def encoded(inputs: dict[str, Any]) -> Generator[Any, Mapping[str, Any], Mapping[str, Any]]:
    """A run, from which a decoder gets its symbols and raw bits back."""
    expected = yield inputs
    parts = (result(expected, name) for name in ("lane_states", "word_counts", "words"))
    slots, states = decoded(inputs, *parts)
    assert (ints(slots) >= inputs["starts"]).all()
    assert (ints(slots) < inputs["starts"] + inputs["frequencies"]).all()
    late = bits_of(inputs["late"], inputs["late_sizes"])
    carried = min(len(states), len(late) // 16)
    assert states[carried:] == [MIN_STATE] * (len(states) - carried)
    halves = [state - MIN_STATE >> i & 1 for state in states[:carried] for i in range(16)]
    string = np.unpackbits(result(expected, "tail")[::-1], bitorder="little").tolist()
    early = bits_of(inputs["early"], inputs["early_sizes"])
    found = string[: len(early)], halves + string[len(early) : len(early) + len(late) - len(halves)]
    assert found == (early, late)
    assert not any(string[len(early) + len(late) - len(halves) :])
    return expected


def random_symbols(rng: Draws, count: int) -> Array:
    """Starts and frequencies, (count, 2), from rare symbols to frequent ones."""
    frequencies = np.maximum(power(2.0, rng.uniform(0, 14, (count,))).astype(np.int64), 1)
    return np.stack([rng.integers(0, TOTAL + 1 - frequencies), frequencies], axis=1)


def random_raw(rng: Draws, count: int) -> Array:
    """Raw values and their sizes, (count, 2), of 0 to 28 bits."""
    sizes = rng.integers(0, 29, (count,))
    return np.stack([rng.integers(np.zeros(count, np.int64), np.int64(1) << sizes), sizes], axis=1)
