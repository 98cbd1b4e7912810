"""Streams that encoders wrote: what the decoder inside spec.md says of one, and whether it is what was asked for.

Only NumPy is needed here, and spec.md. Pictures are rendered deterministically, so that a verdict is the same on every
machine.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_base.cli.text import plural
from gsvc_base.portable import log10
from gsvc_conformance.fault_elements import element_found
from gsvc_conformance.spec import namespace

Array = NDArray[Any]

MAX_BYTES: Final = 1 << 22
"""Bytes of a stream that is judged; the frames of any vector have fewer than a fiftieth of it."""


@dataclass(frozen=True, eq=False)
class Task:
    """What an encoder is asked for (spec.md section 13.9).

    Attributes
    ----------
    frames
        The source: (T, H, W, 3) u1 or u2.
    bit_depth
        Bits of a sample.
    frame_rate_numerator, frame_rate_denominator
        Frames per second.
    splats
        N: no frame may have more.
    key_frame_interval
        No more frames than this from one I-frame up to the next; 0: no I-frame is asked for but the first.
    level
        The highest level that the stream may state.
    floor
        The PSNR in dB that each decoded frame must have.
    """

    frames: Array
    bit_depth: int
    frame_rate_numerator: int
    frame_rate_denominator: int
    splats: int
    key_frame_interval: int
    level: int
    floor: float


@dataclass(frozen=True, eq=False)
class DecodedFrame:
    """A frame of a stream.

    Attributes
    ----------
    type
        I, P or R.
    parameters
        Its splats, (N, 8) f4.
    work
        Its rendering work, (5-1) or (5-2).
    """

    type: str
    parameters: Array
    work: int


@dataclass(frozen=True)
class StreamFault:
    """The first fault of a stream: ``KIND RULE BIT``, and the syntax element that it is about, where there is one."""

    kind: str
    rule: str
    bit: int
    element: str

    def __str__(self) -> str:
        return f"{self.kind} {self.rule} {self.bit}"


class Verdict(NamedTuple):
    """Whether a stream is what was asked for.

    Attributes
    ----------
    message
        What is wrong, a sentence without its subject; empty if nothing is.
    ratio
        The root of the worst frame's mean squared error as a multiple of what the floor allows; None if no frame was
        compared.
    """

    message: str
    ratio: float | None = None


class Decoding:
    """A stream on its way through the decoder inside spec.md.

    Parameters
    ----------
    data
        The bytes.
    quality
        The highest layer that is decoded, above the base, which is layer 0.

    Attributes
    ----------
    header
        The elements of the sequence header by name; empty where it cannot be read.
    count
        The number of frames that were complete so far.
    fault
        The fault that ended it; None while there is none.
    """

    def __init__(self, data: bytes, *, quality: int = 0) -> None:
        self.header: Mapping[str, int] = {}
        self.count, self.fault = 0, None
        self._spec = namespace()
        try:
            self._bits, self._state = self._spec["open_stream"](data, quality=quality)
        except self._spec["Fault"] as fault:
            self.fault = _fault(fault)
            return
        self.header = self._state.header
        if quality > 0 and self.header["profile"] == self._spec["MAIN"]:
            self._state.layers = self._spec["Layers"](quality)

    def frames(self) -> Iterator[DecodedFrame]:
        """Each frame that is complete, up to the end or to the fault."""
        if self.fault is not None:
            return
        waiting = None  # a frame gets its layers up to the next one
        try:
            for frame in self._spec["read_frames"](self._bits, self._state):
                if waiting is not None:
                    yield self._decoded(waiting)
                waiting = frame
        except self._spec["Fault"] as fault:
            self.fault = _fault(fault)
        if waiting is not None:
            yield self._decoded(waiting)

    def _decoded(self, frame: Mapping[str, Any]) -> DecodedFrame:
        self.count += 1
        return DecodedFrame(frame["type"], frame["parameters"], int(frame["work"]))


def _fault(fault: Any) -> StreamFault:
    return StreamFault(fault.kind, fault.rule, fault.bit, element_found(fault.__traceback__))


def judge(data: bytes, task: Task) -> Verdict:
    """Hold a stream against what was asked for; the first thing that is wrong is the message."""
    if len(data) > MAX_BYTES:
        return Verdict(f"has {len(data)} bytes; at most {MAX_BYTES} are judged")
    decoding = Decoding(data)
    if decoding.header and (wrong := _wrong_header(decoding.header, task)):
        return Verdict(wrong)
    worst, where, since, count = np.inf, 0, 0, len(task.frames)
    for number, frame in enumerate(decoding.frames()):
        since = 0 if frame.type == "I" else since + 1
        if wrong := _wrong_frame(number, frame, since, task):
            return Verdict(wrong)
        quality = psnr(rendered(frame, decoding.header), task.frames[number], task.bit_depth)
        if quality < worst:
            worst, where = quality, number
    if decoding.fault:
        return Verdict(f"is not legal: {described(decoding.fault, decoding.count)}")
    if decoding.count < count:
        return Verdict(f"has {decoding.count} of {count} frames")
    ratio = float(10 ** ((task.floor - worst) / 20))
    if worst < task.floor:
        rate = 8 * len(data) / task.frames[..., 0].size
        quality_words = f"a PSNR of {worst:.2f} dB in frame {where}, which must have {task.floor:g} dB"
        return Verdict(f"has {quality_words} ({rate:.3g} bits per pixel)", ratio)
    return Verdict("", ratio)


def worst_frame(data: object, task: Task) -> tuple[int, Array] | None:
    """The frame of a stream that is furthest from its source: its number and pixels; None if none can be compared."""
    if not isinstance(data, bytes) or len(data) > MAX_BYTES:
        return None
    decoding = Decoding(data)
    if not decoding.header or _wrong_header(decoding.header, task):
        return None
    pixels = [rendered(frame, decoding.header) for frame in islice(decoding.frames(), len(task.frames))]
    if not pixels:
        return None
    qualities = [psnr(a, b, task.bit_depth) for a, b in zip(pixels, task.frames, strict=False)]
    number = int(np.argmin(qualities))
    return number, pixels[number]


def _wrong_header(header: Mapping[str, int], task: Task) -> str:
    """What of a sequence header is not as it was asked for; empty if nothing is."""
    height, width = task.frames.shape[1:3]
    if header["level"] > task.level:
        return f"states level {header['level']}; at most {task.level} was asked for"
    for name, asked in (("width", width), ("height", height), ("bit_depth", task.bit_depth)):
        if header[name] != asked:
            return f"has {name} {header[name]}; it must be {asked}"
    rate = header["frame_rate_numerator"], header["frame_rate_denominator"]
    if rate[0] * task.frame_rate_denominator != rate[1] * task.frame_rate_numerator:
        asked_rate = f"{task.frame_rate_numerator}/{task.frame_rate_denominator}"
        return f"has {rate[0]}/{rate[1]} frames per second; they must be {asked_rate}"
    return ""


def _wrong_frame(number: int, frame: DecodedFrame, since: int, task: Task) -> str:
    """What of a frame that is `since` frames after an I-frame is not as it was asked for; empty if nothing is."""
    if number >= len(task.frames):
        return f"has more than {len(task.frames)} frames"
    if len(frame.parameters) > task.splats:
        return f"has {len(frame.parameters)} splats in frame {number}; at most {task.splats} were asked for"
    if task.key_frame_interval and since >= task.key_frame_interval:
        asked = f"no later than {task.key_frame_interval} frames after the one before"
        return f"has no I-frame at frame {number}, {since} frames after the last one; each was asked for {asked}"
    return ""


def rendered(frame: DecodedFrame, header: Mapping[str, int]) -> Array:
    """The pixels of a frame in deterministic rendering: (H, W, 3) u1 or u2."""
    spec = namespace()
    total = spec["render_sum_deterministic"](frame.parameters, header["width"], header["height"])["sum"]
    pixels: Array = spec["to_frame_deterministic"](total, header["bit_depth"])["frame"]
    return pixels


def psnr(a: Array, b: Array, bit_depth: int) -> float:
    """PSNR of two frames in dB, by (11-5): infinite if they are equal."""
    squares = int(np.sum(np.square(a.astype(np.int64) - b.astype(np.int64))))
    return 10 * float(log10((2**bit_depth - 1) ** 2 * a.size / squares)) if squares else np.inf


def described(fault: StreamFault, frames: int) -> str:
    """The fault of a stream in words, with the element where there is one."""
    at = f" ({fault.element})" if fault.element else ""
    return f"{fault.kind} by {fault.rule} at bit {fault.bit}{at}, behind {plural(frames, 'complete frame')}"
