"""The elements of a stream in the order of its bits, each by its full name, also up to a fault and after it."""

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np

from gsvc_base.arrays import I8
from gsvc_base.errors import GsvcError
from gsvc_base.syntax import Json, named
from gsvc_ref.bitstream.chunks import FRAMES
from gsvc_ref.bitstream.coder import Element
from gsvc_ref.bitstream.golomb import golomb_sizes
from gsvc_ref.bitstream.header import MAIN, PAPER
from gsvc_ref.stream.reader import StreamReader

PAIR: Final = ("frame_number_step", "offset_step")
ALONE: Final = ("cholesky_scale", "cholesky_offset")
"""Elements that the trace has as runs of one."""

NOT_LOOKED_AT: Final = "not looked at"


@dataclass(frozen=True, eq=False)
class Entry:
    """A syntax element of a stream, or a run of equal ones."""

    bit: int  # offset from the start of the stream
    bits: int  # size
    name: str  # that of spec.md; a run of pairs has both names, with a comma between
    of: str  # the plane, channel or stage that it is part of; may be empty
    block: str  # the kind of its splat block, intra or inter; may be empty
    chunk: str  # the type of its chunk, empty before the first; for one that is no ASCII letter, its code
    frame: int | None  # the number of the frame whose chunk, or whose layer's chunk, it is in; None outside of frames
    value: Any
    """An int, a float, bytes, or an array for a run; a sentence for a payload that is skipped; None for the element at
    fault, if the bits there are no such element."""
    first: int | None = None  # the index of the first one of a run, or of this one in a run; None outside of runs
    order: int | None = None  # k of the `eg(k)` of which the run consists; None for other runs
    profile: int = PAPER  # of the stream: some elements of both profiles have the same name

    @property
    def count(self) -> int:
        """The elements of a run; 1 for an element that stands alone."""
        return self.value.size if isinstance(self.value, np.ndarray) else 1

    @property
    def full_name(self) -> str:
        """The name with its place: ``frequency[3] of cholesky_code l21, intra block, frame 0``."""
        index = ""
        if self.first is not None and not isinstance(self.value, np.ndarray):
            index = f"[{self.first // 3}] {'RGB'[self.first % 3]}" if self.name == "codeword" else f"[{self.first}]"
        parts = [self.name + index + (f" of {self.of}" if self.of else "")]
        if self.block and self.chunk == "P":
            parts.append(f"{self.block} block")
        if self.frame is not None:
            parts += ["chunk n"] if self.chunk == "n" else []
            parts.append(f"frame {self.frame}")
        elif self.chunk:
            parts.append(f"chunk {self.chunk}")
        return ", ".join(parts)

    @property
    def syntax(self) -> Json | None:
        """What spec.md says about the element; None about padding and payloads."""
        name = self.name.partition(",")[0]
        structures = ("end",) if self.chunk == "E" else ("frame_body", "run") if self.profile == MAIN else ()
        found = (named().get(f"{name} ({structure})") for structure in structures)
        return next((syntax for syntax in found if syntax), None) or named().get(name)

    def items(self) -> Iterator["Entry"]:
        """The elements of a run one by one; an element that stands alone is itself."""
        if not isinstance(self.value, np.ndarray):
            yield self
            return
        bounds = self._bounds()
        for i in range(self.count):
            yield self._item(i, int(bounds[i]), int(bounds[i + 1]))

    def item_at(self, bit: int) -> "Entry":
        """The element of a run that holds a bit of the stream, or the last one before it; an empty run is itself."""
        if not isinstance(self.value, np.ndarray) or self.count == 0:
            return self
        bounds = self._bounds()
        i = min(int(np.searchsorted(bounds, bit - self.bit, "right")), self.count) - 1
        return self._item(i, int(bounds[i]), int(bounds[i + 1]))

    def neighbours(self, item: "Entry") -> tuple["Entry | None", "Entry | None"]:
        """The elements of a run on both sides of one of them."""
        end = item.bit + item.bits
        before = self.item_at(item.bit - 1) if item.bit > self.bit else None
        return before, self.item_at(end) if end < self.bit + self.bits else None

    def _bounds(self) -> I8:
        """Where the elements of a run begin, in bits from its start, and where the last ends: (count + 1,) i8."""
        if self.order is not None:
            sizes = golomb_sizes(self.value, self.order)
        elif self.name == ", ".join(PAIR):
            values = self.value.reshape(-1).astype(np.int64)
            sizes = 8 * (1 + sum((values >= 1 << shift).astype(np.int64) for shift in (7, 14, 21, 28)))
        else:
            sizes = np.full(self.count, self.bits // max(self.count, 1), np.int64)
        return np.concatenate([np.zeros(1, np.int64), np.cumsum(sizes)])

    def _item(self, i: int, start: int, end: int) -> "Entry":
        name, index = self.name, (self.first or 0) + i
        if name == ", ".join(PAIR):
            name, index = PAIR[i % 2], (self.first or 0) + i // 2
        value = self.value.reshape(-1)[i].item()
        return replace(self, bit=self.bit + start, bits=end - start, name=name, value=value, first=index, order=None)


class Listing:
    """The trace of a StreamReader, turned into entries in the order of their bits.

    `emit` is called with each entry as soon as all before it are known.
    """

    def __init__(self, emit: Callable[[Entry], None]) -> None:
        self._emit = emit
        self._head: list[Element] = []
        self._crc: Element | None = None
        self._chunk = ""
        self._frame: int | None = None
        self._next_frame: int | None = 0
        self._order: int | None = None
        self._profile = PAPER
        self._stage = 0
        self._pairs = 0
        self._end = 0
        self.chunk: list[Entry] = []  # the entries of the present chunk; of those of an index only the first

    def __call__(self, element: Element) -> None:
        """Take the next element of the trace."""
        if element.name == "chunk_type" and element.category == "container":
            self.finish()
            self._begin_chunk(element)
        if element.category != "container" or self._chunk == "":
            self._leave_head(element)
            self._put(self._entry(element))
        elif element.name == "chunk_crc":
            self._crc = element
        elif element.name == "payload":
            self._leave_head(None)
            self._put(self._entry(element))
        else:
            self._head.append(element)

    def finish(self) -> None:
        """Hand out what was held back: the chunk is over, or reading is."""
        self._leave_head(None)
        if self._crc is not None:
            if self._crc.bit > self._end:
                gap = Element(self._end, self._crc.bit - self._end, "container", "payload", NOT_LOOKED_AT)
                self._put(self._entry(gap))
            self._put(self._entry(self._crc))
            self._crc = None

    def at_fault(self, fault: GsvcError) -> Entry | None:
        """The element of the present chunk that a fault is about; None if nothing is there that has a name."""
        if fault.bit is None:
            return None
        holding = [entry for entry in self.chunk if entry.bit <= fault.bit < entry.bit + max(entry.bits, 1)]
        unread = [entry for entry in holding if entry.value is None]
        return next((entry.item_at(fault.bit) for entry in (*unread, *holding)), None)

    def _begin_chunk(self, element: Element) -> None:
        code = element.value
        self._chunk = chr(code) if code is not None and bytes([code]).isalpha() else "?" if code is None else f"{code}"
        self._head, self.chunk, self._pairs, self._frame = [], [], 0, None
        self._end = element.bit

    def _leave_head(self, first: Element | None) -> None:
        """Hand out type and length of the chunk, now that its first element may tell the frame's number."""
        if not self._head:
            return
        head, self._head = self._head, []
        if self._chunk and ord(self._chunk[0]) in FRAMES and len(self._chunk) == 1:
            if self._next_frame is None and first is not None and first.name == "frame_number":
                self._next_frame = first.value
            self._frame = self._next_frame
            self._next_frame = None if self._frame is None else self._frame + 1
        if first is not None and first.name == "layer" and self._next_frame is not None:
            self._frame = self._next_frame - 1  # a layer belongs to the frame before it
        for element in head:
            self._put(self._entry(element))

    def skip_to_frame(self) -> None:
        """Reading goes on at an I-frame, whose number its own element tells."""
        self._next_frame = None

    def _put(self, entry: Entry) -> None:
        self._end = entry.bit + entry.bits
        if not entry.name.startswith(PAIR[0]) or len(self.chunk) < 6:
            self.chunk.append(entry)
        self._emit(entry)

    def _entry(self, element: Element) -> Entry:
        part, _, name = element.name.rpartition(".")
        of = re.sub(r"\[(\w+)\]", r" \1", re.sub(r"\[(\d+)\]", r" of stage \1", part))
        first = 0 if isinstance(element.value, np.ndarray) else None
        if name == "golomb_order":
            self._order = element.value
        if name == "profile" and element.value is not None:
            self._profile = element.value
        if name == "stage_count":
            self._stage = 0
        if name == "codeword_count":
            self._stage += 1
        if name.startswith("codeword"):
            of = f"stage {self._stage}"
        if name.startswith(PAIR):
            first = self._pairs
            self._pairs += len(element.value) if isinstance(element.value, np.ndarray) else name == PAIR[1]
        if element.value is None and first is None and (run := self._run_before(name, of, element)) is not None:
            first = run
        order = self._order if name == "frequency" else None
        value = element.value
        if name in ALONE and value is not None:
            value, first = value.item(), None
        return Entry(
            element.bit, element.bits, "align()" if name == "align" else name, of, element.block, self._chunk,
            self._frame, value, first, order, self._profile,
        )  # fmt: skip

    def _run_before(self, name: str, of: str, element: Element) -> int | None:
        """The index of an element that cannot be read, if it would be one of a run."""
        if name in ("lane_state", "word", "codeword", "frequency"):
            last = self.chunk[-1] if self.chunk else None
            is_next = last is not None and (last.name, last.of, last.block) == (name, of, element.block)
            return last.count if is_next and last is not None else 0
        return None


def list_elements(
    source: str | Path | bytes | BinaryIO, emit: Callable[[Entry], None], start: int = 0, stop: int | None = None
) -> tuple[GsvcError | None, Entry | None]:
    """Hand out the elements of a stream in the order of their bits, in memory that does not grow with the stream.

    Only the chunks of frames `start` to `stop` - 1, to the last if None; (0, None) is the whole stream. What `emit`
    raises ends the reading. Returns the fault that ended the stream, and the element that it is about; None for what
    there is not.
    """
    whole = start == 0 and stop is None

    def emit_wanted(entry: Entry) -> None:
        number = entry.frame
        if whole or (number is not None and start <= number and (stop is None or number < stop)):
            emit(entry)

    listing = Listing(emit_wanted)
    fault: GsvcError | None = None
    try:
        with StreamReader(source, trace=listing, layer=None) as reader:
            listing.finish()
            if start:
                listing.skip_to_frame()
            for _ in reader.frames(start, stop):
                pass
    except GsvcError as error:
        fault = error
    listing.finish()
    return fault, None if fault is None else listing.at_fault(fault)


class _Found(Exception):  # noqa: N818  (no error: it ends the reading)
    """Enough was read."""


@dataclass(frozen=True)
class Place:
    """The element that holds a bit, and those on both sides; None where there is none, or none was reached."""

    before: Entry | None
    entry: Entry | None
    after: Entry | None
    fault: GsvcError | None = None
    at_fault: Entry | None = None


class _Search:
    """Looks for the entry that holds a bit, and stops after it."""

    def __init__(self, bit: int) -> None:
        self.bit = bit
        self.before: Entry | None = None
        self.found: Entry | None = None
        self.after: Entry | None = None

    def __call__(self, entry: Entry) -> None:
        if entry.bits == 0:
            return
        if self.found is not None:
            self.after = entry
            raise _Found
        if entry.bit <= self.bit < entry.bit + entry.bits:
            self.found = entry
        else:
            self.before = entry


def place_of(source: str | Path | bytes | BinaryIO, bit: int) -> Place:
    """The element of a stream that holds a bit, with its neighbours; reading ends after it."""
    search = _Search(bit)
    fault, at_fault = None, None
    with suppress(_Found):
        fault, at_fault = list_elements(source, search)
    before, found, after = search.before, search.found, search.after
    if found is None:
        return Place(before and before.item_at(before.bit + before.bits - 1), None, None, fault, at_fault)
    item = found.item_at(bit)
    inner_before, inner_after = found.neighbours(item)
    return Place(
        inner_before or (before and before.item_at(before.bit + before.bits - 1)),
        item,
        inner_after or (after and after.item_at(after.bit)),
        fault,
        at_fault,
    )


def name_at(stream: bytes, bit: int) -> str:
    """The full name of the element of a stream that holds a bit; '' if reading does not come there."""
    entry = place_of(stream, bit).entry
    return "" if entry is None else entry.full_name
