"""Outputs that end too early or too late, compared as far as both go: the place where a decoder left the stream."""

import math
from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from gsvc_base import spec
from gsvc_conformance.diagnosis.failures import Array, Failure
from gsvc_conformance.expectations import NO_ARRAYS
from gsvc_conformance.names import columns, item
from gsvc_conformance.operation import Operation
from gsvc_conformance.spec import header_rows

FIRST_WRONG: Final = "first wrong: "
RIGHT_SO_FAR: Final = "right as far as it goes: "
"""Beginnings of the sentences."""

CODED_FIRST: Final = "symbols"
"""The output that is decoded before all others: the first wrong one of it says most."""

MODES: Final = 3
OLD_PASSES: Final = ("V_x", "V_y", "modes", "first components", "second components", "third components")
"""Passes about the splats of the frame before, from 1 on (spec.md sections 15.10 and 15.11)."""
NEW_PASSES: Final = ("k0", "chroma", "size, aspect and shear")
"""Passes about new splats, behind those of the halvings (spec.md section 15.9)."""


def prefix_sentences(failure: Failure) -> list[str]:
    """What is wrong first, in general and of this vector, or how far all is right; none if lengths are right."""
    pairs = dict(_pairs(failure))
    short = [name for name, (right, mine) in pairs.items() if len(right) != len(mine)]
    if not short:
        return []
    places = {name: place for name, (right, mine) in pairs.items() if (place := _first_wrong(right, mine)) is not None}
    if not places:
        right, mine = pairs[short[0]]
        return [f"{RIGHT_SO_FAR}{len(mine)} of {len(right)} items of {short[0]}"]
    name = CODED_FIRST if CODED_FIRST in places else next(iter(places))
    right, mine = pairs[name]
    home = _Home(failure.vector.operation, {output: right for output, (right, _) in pairs.items()})
    where = ", ".join(home.words(name, places[name]))
    others = [output for output in pairs if output not in places]
    so_far = f"; {', '.join(others)} right as far as {'they go' if others[1:] else 'it goes'}" if others else ""
    given, expected = mine[places[name]], right[places[name]]
    about = home.pass_of(places[name][0]) if name == CODED_FIRST else ""
    return [
        f"{FIRST_WRONG}{name}{f' of {about}' if about else ''}",
        f"{FIRST_WRONG}{name} {places[name][0]} of {len(right)} ({where}): {given}, expected {expected}{so_far}",
    ]


def _pairs(failure: Failure) -> Iterator[tuple[str, tuple[Array, Array]]]:
    """The outputs that have items, as they must be and as they were given."""
    for name, expectation in failure.vector.expected.items():
        mine = failure.outputs.get(name)
        if isinstance(expectation, NO_ARRAYS) or not isinstance(mine, np.ndarray):
            continue
        right = expectation.value
        if 0 < mine.ndim == right.ndim and mine.shape[1:] == right.shape[1:] and mine.dtype.kind in "biuf":
            yield name, (right, mine)


def _first_wrong(right: Array, mine: Array) -> tuple[int, ...] | None:
    """The first element that differs of those that both have."""
    common = min(len(right), len(mine))
    wrong = np.argwhere(right[:common].astype(mine.dtype) != mine[:common])
    return tuple(int(index) for index in wrong[0]) if len(wrong) else None


class _Home:
    """The frame, and what else is to be told, of the items of the outputs that a vector expects."""

    def __init__(self, operation: Operation, expected: Mapping[str, Array]) -> None:
        self.operation, self.expected = operation, expected
        self.frames = {}
        if "counts" in expected and expected["counts"].ndim == 1:
            numbers = np.arange(len(expected["counts"]))
            frames = {name: np.repeat(numbers, expected["counts"]) for name in ("parameters", "states")}
            frames |= self._coded() if {"bodies", "frame_types", "header", CODED_FIRST} <= {*expected} else {}
            self.frames = {
                name: home for name, home in frames.items() if name in expected and len(home) == len(expected[name])
            }

    def _coded(self) -> dict[str, Array]:
        """The frames of what the bodies of frames say."""
        numbers, new = self.expected["bodies"][:, 0], self.expected["bodies"][:, 5]
        counts, types = self.expected["counts"], self.expected["frame_types"]
        old = np.where(types[numbers] == ord("P"), counts[np.maximum(numbers - 1, 0)], 0)
        self.old, self.new = (dict(zip(numbers.tolist(), some.tolist(), strict=True)) for some in (old, new))
        homes = {name: np.repeat(numbers, old) for name in ("modes", "differences")}
        return {**homes, CODED_FIRST: self._of_symbols()}

    def _of_symbols(self) -> Array:
        """The frame of each symbol: passes go up in a frame, and one without new splats has a mode for each old one."""
        passes = self.expected[CODED_FIRST][:, 2].astype(np.int64)
        homes = np.full(len(passes), -1)
        start = 0
        for frame in self.old:
            if self.old[frame] + self.new[frame] == 0:
                continue
            falls = np.flatnonzero(np.diff(passes[start:]) < 0)
            end = start + int(falls[0]) + 1 if len(falls) else len(passes)
            modes = start + np.flatnonzero(passes[start:end] == MODES)
            if self.new[frame] == 0 and len(modes) > self.old[frame]:
                end = int(modes[self.old[frame]])
            homes[start:end] = frame
            start = end
        return homes

    def words(self, name: str, place: tuple[int, ...]) -> Iterator[str]:
        """The frame and the item of an element, and its column."""
        number, home = place[0], self.frames.get(name)
        if home is not None and home[number] >= 0:
            yield f"frame {home[number]}"
            number -= int(np.flatnonzero(home == home[number])[0])
        if name == CODED_FIRST:
            _, _, turn, lane = (int(value) for value in self.expected[name][place[0]])
            yield f"pass {turn}, lane {lane}"
        else:
            yield f"{item(self.operation, name)} {number}"
        names = columns(self.operation, name, self.expected[name].shape[-1])
        if len(place) > 1:
            yield names[place[-1]] if place[-1] < len(names) else f"column {place[-1]}"

    def pass_of(self, row: int) -> str:
        """What the pass of a symbol is about; '' if that cannot be told."""
        home = self.frames.get(CODED_FIRST)
        if home is None or home[row] < 0:
            return ""
        frame, turn = int(home[row]), int(self.expected[CODED_FIRST][row, 2])
        same = (home[:row] == frame) & (self.expected[CODED_FIRST][:row, 2] == turn)
        is_old = self.old[frame] > 0 and turn <= len(OLD_PASSES)
        if is_old and (self.new[frame] == 0 or same.sum() < self._old_symbols(frame, turn)):
            return OLD_PASSES[turn - 1]
        if is_old and turn > MODES:
            return ""
        halvings = spec.halving_count(*self._size())
        return "halvings" if turn <= halvings else NEW_PASSES[min(turn - halvings, len(NEW_PASSES)) - 1]

    def _old_symbols(self, frame: int, turn: int) -> int:
        """The number of symbols of a pass about the splats of the frame before; 0 where it is not known."""
        if turn == MODES:
            return int(self.old[frame])
        cell = int(self.expected["bodies"][self.expected["bodies"][:, 0] == frame, 3][0])
        side = spec.SIDES[cell]
        return math.prod(-(-length // side) for length in self._size()) if side and turn < MODES else 0

    def _size(self) -> tuple[int, int]:
        names = [name for name, *_ in header_rows("main")]
        width, height = (int(self.expected["header"][names.index(side)]) for side in ("width", "height"))
        return width, height
