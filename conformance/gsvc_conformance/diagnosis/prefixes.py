"""Outputs that end too early or too late, compared as far as both go: the place where a decoder left the stream."""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from gsvc_base import spec
from gsvc_conformance.diagnosis.coded import OTHER_TABLE, RIGHT_TABLE, SYMBOLS, WRONG_TABLE, table_evidence
from gsvc_conformance.diagnosis.failures import Array, Failure
from gsvc_conformance.expectations import NO_ARRAYS
from gsvc_conformance.names import SYMBOL, columns, item
from gsvc_conformance.operation import Operation
from gsvc_conformance.spec import header_rows

FIRST_WRONG: Final = "first wrong: "
RIGHT_SO_FAR: Final = "right as far as it goes: "
"""Beginnings of the sentences."""

CODED_FIRST: Final = SYMBOLS
"""The output that is decoded before all others: the first wrong one of it says most."""

NOTHING: Final = np.zeros((0, 4))

FEWEST: Final = 2
"""Minimum number of vectors before the lanes of their first wrong symbols are told of."""

SHARED: Final = 0.4
"""Minimum fraction of the failures with something wrong that share a sentence; else a more general one is said."""

MODES: Final = 3
OLD_PASSES: Final = ("V_x", "V_y", "modes", "first components", "second components", "third components")
"""Passes about the splats of the frame before, from 1 on (spec.md sections 15.10 and 15.11)."""
NEW_PASSES: Final = ("k0", "chroma", "size, aspect and shear")
"""Passes about new splats, behind those of the halvings (spec.md section 15.9)."""
HALVINGS: Final = "halvings"
CONTEXT: Final = "context", "the model, the contexts, and what was adapted in frames before"
TABLES: Final = {
    HALVINGS: ("part", "the splats of the part (with raw low bits), its cells inside of the frame, and alpha"),
    "k0": ("plane", "the density alone"),
    "chroma": ("class of k0", "the densities and the class of k0"),
    "size, aspect and shear": ("class", "the densities and the class, so the colours with their raw low bits, and D"),
    **dict.fromkeys(OLD_PASSES, CONTEXT),
    "V_y": ("context", "the model and the class of V_x"),
    "modes": ("context", "the model, the past of the splat, its place after its motion, and the field around it"),
    "first components": ("context", "the model and the modes"),
}
"""What the tables of a pass are of, and what they depend on."""


def prefix_sentences(failures: Sequence[Failure]) -> dict[str, list[str]]:
    """What is wrong first, in general and of each vector, or how far all is right, by id; none where lengths are right.

    In general so much is said as many failures share.
    """
    found = {failure.vector.id: _sentences(failure) for failure in failures}
    firsts = [general for general, _ in found.values() if general]
    shared = Counter(words for general in firsts for words in general)
    lanes = _lanes(failures)
    said = {}
    for name, (general, precise) in found.items():
        common = [words for words in general if shared[words] >= SHARED * len(firsts)] or general[-1:]
        said[name] = [*(f"{words}{lanes}" for words in common[:1]), *precise]
    return said


def _lanes(failures: Sequence[Failure]) -> str:
    """Words about the lanes of all first symbols that are wrong or missing, if none is in the first group."""
    rows = [row for failure in failures if (row := _first_symbol(failure)) is not None]
    group = spec.GROUP_LANES
    if len(rows) < FEWEST or min(row[3] for row in rows) < group:
        return ""
    return f", in lanes from {group} on: with the words of the first group all is right"


def _first_symbol(failure: Failure) -> Array | None:
    """The row of the first symbol that is wrong or missing, as it must be."""
    right, mine = dict(_pairs(failure)).get(CODED_FIRST, (NOTHING, NOTHING))
    place = _first_wrong(right, mine) or (len(mine),)
    return right[place[0]] if place[0] < len(right) else None


def _sentences(failure: Failure) -> tuple[list[str], list[str]]:
    """The sentences about the first thing that is wrong, the most special one first, and that about its place."""
    pairs = dict(_pairs(failure))
    short = [name for name, (right, mine) in pairs.items() if len(right) != len(mine)]
    if not short:
        return [], []
    places = {name: place for name, (right, mine) in pairs.items() if (place := _first_wrong(right, mine)) is not None}
    if not places:
        name = CODED_FIRST if CODED_FIRST in pairs else short[0]
        right, mine = pairs[name]
        so_far = f"{RIGHT_SO_FAR}{len(mine)} of {len(right)} items of {name}"
        home = _Home(failure.vector.operation, {output: right for output, (right, _) in pairs.items()})
        if name != CODED_FIRST or len(mine) > len(right):
            return [], [so_far]
        frames = len(pairs["frame_types"][1]) if "frame_types" in pairs else 0
        ends = [f"{RIGHT_SO_FAR}{end}" for end in home.ends(len(mine), frames)]
        more = f", up to {', '.join(home.words(name, (len(mine),)))}" if len(mine) < len(right) else ""
        return ends, [f"{so_far}{more}"]
    name = CODED_FIRST if CODED_FIRST in places else next(iter(places))
    right, mine = pairs[name]
    home = _Home(failure.vector.operation, {output: right for output, (right, _) in pairs.items()})
    where = ", ".join(home.words(name, places[name]))
    others = [output for output in pairs if output not in places]
    so_far = f"; {', '.join(others)} right as far as {'they go' if others[1:] else 'it goes'}" if others else ""
    given, expected = mine[places[name]], right[places[name]]
    precise = f"{FIRST_WRONG}{name} {places[name][0]} of {len(right)} ({where}): {given}, expected {expected}{so_far}"
    if name != CODED_FIRST:
        return [f"{FIRST_WRONG}{name}, given as {given}", f"{FIRST_WRONG}{name}"], [precise]
    return list(_of_symbol(failure, places[name], home)), [precise]


def _of_symbol(failure: Failure, place: tuple[int, ...], home: "_Home") -> Iterator[str]:
    """What is wrong with the first wrong symbol, the most special words first."""
    row, column = place
    about = home.pass_of(row)
    symbols = f"{FIRST_WRONG}{CODED_FIRST}"
    if column > 1:
        what = SYMBOL[column]
        yield f"{FIRST_WRONG}{what} of symbols{f' of {about}' if about else ''}"
        yield f"{FIRST_WRONG}{what} of symbols"
        return
    c, f = (int(value) for value in failure.outputs[CODED_FIRST][row, :2])
    evidence = table_evidence(failure.vector, row, c, f)
    if about:
        kind, depends = TABLES[about]
        words = {OTHER_TABLE: f"{OTHER_TABLE} {kind}", WRONG_TABLE: f"{WRONG_TABLE}; it depends on {depends}"}
        yield f"{symbols} of {about}, {words.get(evidence, evidence)}"
    if evidence == RIGHT_TABLE:
        yield f"{symbols}, {evidence}"
    yield f"{symbols} of {about}" if about else symbols


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

    def ends(self, row: int, frames: int) -> Iterator[str]:
        """Where a decoder ended whose symbols are all right up to a row, and which gave so many frames."""
        homes = self.frames.get(CODED_FIRST, NOTHING)
        if not 0 < row < len(homes) or homes[row] != homes[row - 1]:
            if row and frames <= homes[row - 1]:
                yield "a run is refused behind its last symbol (words, final states or raw bits)"
            else:
                yield "a frame is refused in front of its symbols"
        else:
            if about := self.pass_of(row):
                yield f"a run ends inside of the symbols of {about}"
            yield "a run ends inside of its symbols"

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
        halvings = spec.halving_count(*self._size())
        return HALVINGS if turn <= halvings else NEW_PASSES[min(turn - halvings, len(NEW_PASSES)) - 1]

    def _old_symbols(self, frame: int, turn: int) -> int:
        """The number of symbols of a pass about the splats of the frame before."""
        if turn == MODES:
            return int(self.old[frame])
        if turn > MODES:
            modes = self.expected["modes"][self.frames["modes"] == frame]
            stay, i = modes != spec.REMOVED, turn - MODES - 1
            groups = [bit for bit, (_, first, end) in enumerate(spec.GROUPS) if first + i < end]
            return sum(int(np.sum(stay & (modes >> bit & 1 == 1))) for bit in groups)
        cell = int(self.expected["bodies"][self.expected["bodies"][:, 0] == frame, 3][0])
        side = spec.SIDES[cell]
        return math.prod(-(-length // side) for length in self._size()) if side and turn < MODES else 0

    def _size(self) -> tuple[int, int]:
        names = [name for name, *_ in header_rows("main")]
        width, height = (int(self.expected["header"][names.index(side)]) for side in ("width", "height"))
        return width, height
