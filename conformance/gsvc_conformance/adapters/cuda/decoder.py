"""Frames of a stream of profile `main`, from their bytes to pixels on the device, without waiting for the device.

    decoder = Decoder(Path("clip.gsvc").read_bytes())
    for picture in decoder.pictures():
        picture.frame            # a buffer on the device
        picture.samples()        # an array; it waits, and raises the fault of the stream if there is one so far

The host walks from chunk to chunk and reads what stands in front of a frame_body(). It hands the bytes of the chunk to
the kernel `read_body`, which finds everything else, the checksum of the chunk included; what follows is launched for
as many splats as there may be. So the host never asks how many there are. It hears of a fault, of the rendering work
and of a wrong `parameter_checksum` when a picture is asked for, or when a slot is used again, DEPTH frames later.

    reading    | frame 0 | frame 1 | frame 2 |          bytes -> states -> parameters
    rendering            | frame 0 | frame 1 | frame 2 |          parameters -> samples

These are two streams of the device. Frames follow one another in both, but a frame is read while the one before is
rendered.
"""

import ctypes
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Final, cast

import numpy as np

from gsvc_conformance.adapters.cuda import device
from gsvc_conformance.adapters.cuda.device import Array, Buffer, Launch, clear, download, launch, storage
from gsvc_conformance.adapters.cuda.main_profile import (
    FIELD_HEAD,
    LAYER,
    MAIN,
    RULES,
    STATUS,
    THREADS,
    TOLD,
    Layer,
    field_cells,
    new_splats,
    no_splats,
    reading_threads,
    workspace_size,
)
from gsvc_conformance.adapters.cuda.reconstruction import CHECKSUM_WORDS
from gsvc_conformance.adapters.cuda.rendering import Scene
from gsvc_conformance.adapters.host import code_of_spec
from gsvc_conformance.adapters.main_operations import groups

DEPTH: Final = 4
"""Frames that are on the device at the same time: a picture is there until so many others were launched after it."""
PARAMETER_CHECKSUM: Final = 1
PACED: Final = 2
"""Bits of `flags`."""


class Slot:
    """What a frame needs on the device, for so many splats and bytes; frames take the slots in turn."""

    def __init__(self, most: int, text_size: int, frame_size: int) -> None:
        self.most, self.text_size = most, text_size
        self.told_bytes = (ctypes.c_ubyte * TOLD.itemsize)()
        self.told = np.frombuffer(memoryview(self.told_bytes), TOLD)[0:1].reshape(())
        self.layer = Layer(most, storage(LAYER.itemsize), storage(32 * most), storage(most))
        self.parameters, self.checksum = storage(32 * most), storage(4)
        self.text, self.text_on_host = storage(text_size), device.pinned(text_size)
        self.status, self.status_on_host = storage(STATUS.itemsize), device.pinned(STATUS.itemsize + 4)
        self.frame = storage(frame_size)
        self.show: Callable[[], None] | None = None
        """It launches what makes a picture of the parameters."""
        self.done: Any = None

    @property
    def found(self) -> Any:
        """The `STATUS` of the frame, once it is done."""
        return self.status_on_host[: STATUS.itemsize].view(STATUS)[0]

    @property
    def found_checksum(self) -> int:
        """The `parameter_checksum` of the frame, once it is done."""
        turned = int(self.status_on_host[STATUS.itemsize :].view(np.uint32)[0])
        return turned ^ 0xFFFFFFFF if self.found["count"] > 0 else 0


class Room:
    """What decoders need on the device: its streams, slots, and arrays that one frame after the other uses.

    One decoder at a time may use it. It grows with what the streams ask for; a decoder that finds it large enough
    allocates nothing.
    """

    def __init__(self, header: dict[str, int], *, exact: bool) -> None:
        self.kind = _kind(header, exact)
        self.width, self.height, self.bit_depth, self.exact, self.checksums = self.kind
        self.reading, self.rendering = device.stream(), device.stream()
        self.slots: deque[Slot | None] = deque([None] * DEPTH)
        self.cells = field_cells(self.width, self.height)
        self._field = storage(FIELD_HEAD.itemsize + 8 * self.cells)
        self._workspace, self._modes, self._differences = storage(1), storage(1), storage(1)
        self._scene = Scene(self.width, self.height, 0, exact=exact)
        self._readers: dict[tuple[Slot, Slot | None], tuple[Launch, Launch]] = {}
        self._tables, self._most, self._text_size = MAIN.tables, 0, 0
        device.synchronize()  # what was uploaded is there for both streams

    def fits(self, header: dict[str, int], *, exact: bool) -> bool:
        """Whether it is made for such a stream."""
        return self.kind == _kind(header, exact)

    def take(self, most: int, text_size: int, before: int, count: int) -> Slot:
        """The slot that was taken longest ago, or a larger one in its place.

        Parameters
        ----------
        most, text_size
            The splats of the frame, and the bytes of its chunk, at most.
        before, count
            The splats of the frame before, and the new ones, at most.
        """
        slot = self.slots.popleft()
        if slot is None or slot.most < most or slot.text_size < text_size:
            self._most, self._text_size = max(self._most, most + most // 4), max(self._text_size, 2 * text_size)
            slot = Slot(self._most, self._text_size, 3 * self.width * self.height * (1 if self.bit_depth == 8 else 2))
            self._readers.clear()
        self.slots.append(slot)
        size = workspace_size(before, count, self.cells)
        if len(self._workspace) < size:
            self._workspace = storage(2 * size)
            self._readers.clear()
        if len(self._differences) < 32 * before:
            self._modes, self._differences = storage(2 * before), storage(64 * before)
            self._readers.clear()
        return slot

    def reader(self, slot: Slot, before: Slot | None) -> tuple[Launch, Launch]:
        """What reads a frame into a slot, after that of another one, and makes parameters of its states."""
        made = self._readers.get((slot, before))
        if made is None:
            layer, after = before.layer if before else no_splats(), slot.layer
            made = self._readers[slot, before] = (
                Launch(
                    "read_body", 1, reading_threads(), slot.text, slot.told_bytes, self._tables, layer.head,
                    layer.states, layer.past, None, after.head, after.states, after.past, self._field, self._modes,
                    self._differences, self._workspace, None, slot.status,
                ),
                Launch(
                    "frame_parameters", groups(slot.most), THREADS, self._tables, after.states, after.head,
                    np.uint32(slot.most), slot.parameters,
                ),
            )  # fmt: skip
        return made

    def shower(self, slot: Slot) -> Callable[[], None]:
        """What makes a picture of the parameters in a slot, and their checksum if the stream states it."""
        if self._scene.most_splats < slot.most:
            self._scene = Scene(self.width, self.height, slot.most, exact=self.exact)
        scene, threads = self._scene, groups(8 * slot.most, CHECKSUM_WORDS)

        def show() -> None:
            if self.checksums:
                clear(slot.checksum)
                launch(
                    "parameter_checksum", groups(threads), THREADS, slot.parameters, slot.layer.head, slot.checksum,
                    exact=True,
                )  # fmt: skip
            scene.fill(slot.parameters, slot.most)
            scene.frame(slot.frame, self.bit_depth)

        return device.replay(show)


def _kind(header: dict[str, int], exact: bool) -> tuple[int, int, int, bool, bool]:
    checksums = bool(header["flags"] & PARAMETER_CHECKSUM)
    return header["width"], header["height"], header["bit_depth"], exact, checksums


@dataclass(frozen=True)
class Picture:
    """A frame that was launched.

    Attributes
    ----------
    number
        Its `frame_number`.
    slot
        Where it is; an R-frame has that of the frame before.
    """

    decoder: "Decoder"
    number: int
    slot: Slot

    @property
    def frame(self) -> Buffer:
        """Its samples on the device, u1 or u2 (H, W, 3), once `slot.done` has happened."""
        return self.slot.frame

    def samples(self) -> Array:
        """The samples u1 or u2 (H, W, 3).

        Raises
        ------
        Fault
            A rule is broken by this frame, or by one before it.
        """
        self.decoder.confirm(self.number)
        header = self.decoder.header
        shape = header["height"], header["width"], 3
        return download(self.frame, shape, np.uint8 if header["bit_depth"] == 8 else np.uint16)


@dataclass(frozen=True)
class Check:
    """What is left to be checked once the device has a frame; of a chunk `n` it has the number of the next frame."""

    number: int
    run: Callable[[], None]
    slot: Slot | None = None


@dataclass
class Bound:
    """How many splats the last frame has at most: those of the last one that is known, and what came after it."""

    splats: int = 0
    added: deque[tuple[int, int]] = field(default_factory=deque)
    """Number and new splats of each frame after it."""

    def add(self, number: int, count: int, intra: bool) -> None:
        """A frame was launched."""
        if intra:
            self.splats = 0
            self.added.clear()
        self.added.append((number, count))

    def learn(self, number: int, count: int) -> None:
        """The splats of a frame are known."""
        if self.added and self.added[0][0] <= number:
            while self.added and self.added[0][0] <= number:
                self.added.popleft()
            self.splats = count

    @property
    def most(self) -> int:
        """How many there are at most."""
        return self.splats + sum(count for _, count in self.added)


class Decoder:
    """The frames of a stream, or of quality 0 if it has layers.

    Parameters
    ----------
    stream
        All of it.
    exact
        Whether frames are rendered as section 9.3 says.
    room
        That of a decoder which has decoded all that it will, or none. If the frames are of another size or kind, it
        is not used.

    Attributes
    ----------
    header
        The elements of the sequence header by name.
    room
        For another decoder.

    Raises
    ------
    Fault
        The first chunk breaks a rule.
    ValueError
        The stream is of another profile.
    """

    def __init__(self, stream: bytes, *, exact: bool = False, room: Room | None = None) -> None:
        self._bits, self._state = names()["open_stream"](stream)
        self.header: dict[str, int] = self._state.header
        if self.header["profile"] != names()["MAIN"]:
            raise ValueError("the stream is of profile paper, whose planes the host reads")
        self._bits.of_decoder = self._state.main.decoder = self
        self._bits.chunk = None
        if room is None or not room.fits(self.header, exact=exact):
            room = Room(self.header, exact=exact)
        self.room = room
        self._slot: Slot | None = None
        self._bound = Bound()
        self._checks: deque[Check] = deque()
        self._fault: tuple[int, Exception] | None = None
        self._pacing = names()["State"](self.header)

    def pictures(self) -> Iterator[Picture]:
        """Each frame as soon as it is launched. A fault of a frame may come with a later one, as late as at the end.

        Raises
        ------
        Fault
            The first rule that the stream breaks.
        """
        try:
            for frame in names()["read_frames"](self._bits, self._state):
                yield frame["picture"]
        except names()["Fault"]:
            self.confirm(2**32)
            _compare_checksum(self._bits.chunk, names())
            raise
        self.confirm(2**32)

    def confirm(self, number: int) -> None:
        """Wait for the frames up to a number, and see whether they are sound.

        Raises
        ------
        Fault
            The first rule that one of them breaks.
        """
        while self._checks and self._checks[0].number <= number and self._fault is None:
            check = self._checks.popleft()
            try:
                check.run()
            except names()["Fault"] as fault:
                self._fault = check.number, fault
        if self._fault is not None and self._fault[0] <= number:
            raise self._fault[1]

    # ---- What the code of spec.md calls

    def read(self, p: Any, frame_type: str, limits: dict[str, int]) -> None:
        """Launch what reads the frame_body() at which `p` stands."""
        chunk: bytes = p.chunk
        at = p.at // 8
        count = new_splats(p.data[at : at + 8], limits["splats"])
        before = None if frame_type == "I" else self._slot
        self._bound.add(self._state.next_number, count, frame_type == "I")
        with self.room.reading as stream:
            self._settle(self.room.slots[0])
            slot = self.room.take(self._bound.most, len(chunk), before.most if before else 0, count)
            told = slot.told
            for name in ("width", "height", "max_lane_exponent"):
                told[name] = self.header[name]
            told["end"] = told["checked"] = len(chunk) - 4
            told["body_at"], told["intra"] = len(chunk) - 4 - len(p.data) + at, frame_type == "I"
            told["splat_limits"], told["halvings"] = (limits["splats"], limits["own_splats"]), self._state.halvings
            told["work_limits"] = self._state.limits["work"], self._state.own["work"]
            slot.text_on_host[: len(chunk)] = np.frombuffer(chunk, np.uint8)
            device.send(slot.text_on_host[: len(chunk)], slot.text)
            for start in self.room.reader(slot, before):
                start()
            read = stream.record()
        with self.room.rendering as stream:
            stream.wait_event(read)
            if slot.show is None:
                slot.show = self.room.shower(slot)
            slot.show()
            device.fetch(slot.status, slot.status_on_host[: STATUS.itemsize])
            if self.header["flags"] & PARAMETER_CHECKSUM:
                device.fetch(slot.checksum, slot.status_on_host[STATUS.itemsize :])
            slot.done = stream.record()
        self._slot, self._bits.chunk = slot, None
        p.at = 8 * len(p.data)

    def complete(self, frame: dict[str, Any], chunk_bit: int) -> Picture:
        """The picture of a frame of which all elements are read; what is checked of it is checked later."""
        slot = cast(Slot, self._slot)  # the first frame is an I-frame (R-6.4-2)
        waiting, self._state.bytes_waiting = self._state.bytes_waiting, 0
        self._checks.append(Check(frame["frame_number"], lambda: self._check(frame, slot, chunk_bit, waiting), slot))
        return Picture(self, frame["frame_number"], slot)

    def count_layer(self, chunk_bit: int) -> None:
        """A chunk `n`, of which the bytes count in a paced stream."""
        waiting, self._state.bytes_waiting = self._state.bytes_waiting, 0

        def check() -> None:
            self._pacing.bytes_waiting = waiting
            names()["add_to_second"](0, (0, 0), chunk_bit, self._pacing)

        if self.header["flags"] & PACED:
            self._checks.append(Check(self._state.next_number, check))

    # ---- Inside

    def _settle(self, slot: Slot | None) -> None:
        """Confirm what is in a slot before it is taken again; a fault waits until a picture is asked for."""
        if slot is not None and slot.done is not None:
            slot.done.synchronize()
        numbers = [check.number for check in self._checks if check.slot is slot]
        with suppress(names()["Fault"]):
            self.confirm(max(numbers, default=-1))

    def _check(self, frame: dict[str, Any], slot: Slot, chunk_bit: int, waiting: int) -> None:
        """What is left of the order of section 12.2, once the device has read a frame."""
        slot.done.synchronize()
        found, fault = slot.found, names()["Fault"]
        if found["rule"] > 0:
            raise fault(RULES[found["rule"]], chunk_bit + int(found["bit"]))
        stated = frame["parameter_checksum"]
        if stated is not None and stated != slot.found_checksum:
            raise fault("R-6.4-3", frame["checksum_bit"])
        if frame["type"] != "R":
            self._bound.learn(frame["frame_number"], int(found["count"]))
        if self.header["flags"] & PACED:
            self._pacing.bytes_waiting = waiting
            counted = {**frame, "parameters": range(int(found["count"]))}
            names()["check_second"](counted, tuple(map(int, found["works"])), chunk_bit, self._pacing)


def _compare_checksum(chunk: Any, names: dict[str, Any]) -> None:
    """R-6.2-2 of a frame that the device did not get to see, since the host has found another fault in it."""
    if chunk is not None:
        data, first_bit = chunk
        if int.from_bytes(data[-4:], "little") != names["crc32c"](data[:-4]):
            raise names["Fault"]("R-6.2-2", first_bit + 8 * (len(data) - 4))


@cache
def names() -> dict[str, Any]:
    """The code of spec.md, which reads the container, with functions that launch in the place of those that read."""

    class MainState:
        """What the code of section 15.12 carries from frame to frame: the decoder has it."""

        decoder: Decoder
        splats: Any = ()

        def forget(self) -> None:
            """An I-frame begins with no splats by itself."""

    def read_chunk(s: Any, longest: int, compare_crc: bool = True, own_longest: int | None = None) -> tuple[str, Any]:
        first = s.at // 8
        deferred = hasattr(s, "of_decoder") and s.data[first : first + 1] in (b"I", b"P")
        chunk_type, p = read_whole_chunk(s, longest, compare_crc and not deferred, own_longest)
        if deferred:
            p.chunk = s.data[first : s.at // 8]
            s.chunk = p.chunk, 8 * first
        return chunk_type, p

    def read_main_body(p: Any, frame_type: str, main: MainState, header: Any, limits: Any) -> None:
        main.decoder.read(p, frame_type, limits)

    def complete_frame(p: Any, frame_type: str, chunk_bit: int, state: Any) -> dict[str, Any]:
        frame: dict[str, Any] = made["read_main_frame"](p, frame_type, state)
        made["check_filled"](p)
        frame["picture"] = state.main.decoder.complete(frame, chunk_bit)
        state.next_number += 1
        return frame

    def count_layer(splats: int, works: Any, before: Any, chunk_bit: int, state: Any) -> None:
        state.main.decoder.count_layer(chunk_bit)

    own = (MainState, read_main_body, complete_frame, count_layer)
    made = code_of_spec({function.__name__: function for function in own})
    read_whole_chunk = made["read_chunk"]
    made["read_chunk"] = read_chunk
    return made
