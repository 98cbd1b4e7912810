"""An encoded group of pictures as bytes and back, so that another encode can resume from it.

It is a `.gsvc` stream: its frames with their layers, and after each frame a private chunk with the rest of its
`EncodedFrame`, as JSON. So the decoder reads it, which takes any bytes, and every chunk has a checksum. The last
private chunk says which group of which folder it is, and has the SHA-256 of all chunks between the sequence header and
itself, so that frames and records of different groups do not get mixed.
"""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from io import BytesIO
from typing import Any, Final
from uuid import UUID

from gsvc_base.errors import GsvcError
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.chunks import END_TYPE, UUID_SIZE
from gsvc_ref.encoder.effects import EFFECT_NAMES
from gsvc_ref.encoder.encoded_frame import EncodedFrame, EncodedLayer
from gsvc_ref.encoder.log import MAX_STEPS, Decision
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.stream import DecodedFrame, StreamReader, StreamWriter
from gsvc_ref.stream.chunk_decoder import ChunkDecoder
from gsvc_ref.stream.source import Source

OURS: Final = UUID("0f1ee9a8-6c0e-4c35-9d0f-5f4b1d0c7a53").bytes
"""What the private chunks begin with."""

FRAME_RECORD, GROUP_RECORD = "p", "q"
"""Types of the private chunks after each frame, and after all of them."""

MAX_RECORD: Final = 1 << 16
"""Maximum number of bytes of a record; those of gsvc_ref have about 600."""

NOT_A_GROUP: Final = "the bytes are not a group of pictures that an encode has kept"


class GroupWriter:
    """Writes the frames of a group as they are encoded.

    Parameters
    ----------
    header
        The sequence header of the encode.
    mark, first
        The mark of the folder, and the number of the first frame of the group.
    """

    def __init__(self, header: SequenceHeader, mark: str, first: int) -> None:
        self._file, self._place = BytesIO(), (mark, first)
        self._writer = StreamWriter(self._file, header, index=False)
        self._begin = self._writer.offset

    def add(self, encoded: EncodedFrame, seconds: float, digest: str) -> None:
        """Add a frame, the seconds that it took, and the digest of its source.

        Raises
        ------
        UsageError, GsvcError
            The frame breaks a limit of the level.
        """
        self._writer.write_frame(encoded.codes, encoded.state, encoded.chunks)
        record = {
            "digest": digest,
            "seconds": seconds,
            "psnr": _finite(encoded.psnr),
            "iterations": encoded.iterations,
            "stages": encoded.seconds,
            "decisions": [[d.effect, d.done, d.reason, d.iterations, d.saved, d.seconds] for d in encoded.decisions],
            "reason": encoded.reason,
            "layers": [_finite(part.psnr) for part in encoded.layers],
        }
        self._writer.write_ancillary(FRAME_RECORD, OURS + json.dumps(record).encode())

    def finish(self, decided: tuple[int, ...]) -> bytes:
        """The bytes of the group, with what the first frame of the stream has decided."""
        mark, first = self._place
        chunks = sha256(self._file.getbuffer()[self._begin :]).hexdigest()
        record = {"decided": decided, "mark": mark, "first": first, "chunks": chunks}
        self._writer.finish((GROUP_RECORD, OURS + json.dumps(record).encode()))
        return self._file.getvalue()


@dataclass(frozen=True)
class _Record:
    """What a record says beside the codes of its frame."""

    digest: str
    seconds: float
    psnr: float
    iterations: int
    stages: dict[str, float]
    decisions: tuple[Decision, ...]
    reason: str | None
    layers: tuple[float, ...]


class KeptGroup:
    """The frames of a group, one after the other.

    Parameters
    ----------
    data
        What a `GroupWriter` wrote, or anything else.

    Attributes
    ----------
    header
        The sequence header.
    place
        The mark of the folder that it is kept in, and the number of its first frame.
    decided
        What the first frame of the stream has decided.
    digests
        The digest of the source of each frame.

    Raises
    ------
    GsvcError
        It is not a complete group of pictures that was kept; every checksum is verified.
    """

    def __init__(self, data: bytes) -> None:
        self._records: list[_Record] = []
        whole: dict[str, Any] = {}
        for kind, record in _records(data):
            if kind == FRAME_RECORD:
                self._records.append(_record(record))
            else:
                whole = record
        decided, mark, first = (whole.get(name) for name in ("decided", "mark", "first"))
        if not (
            isinstance(decided, list) and all(map(_is_count, decided)) and isinstance(mark, str) and _is_count(first)
        ):
            raise GsvcError("malformed", NOT_A_GROUP)
        self.decided, self.place = tuple(decided), (mark, first)
        self.digests = [record.digest for record in self._records]
        reader = StreamReader(data, layer=None)
        if reader.frame_count != len(self._records):
            raise GsvcError("malformed", NOT_A_GROUP)
        self.header = reader.header
        self._frames = reader.frames()
        self._position = 0

    def next_frame(self) -> tuple[EncodedFrame, float]:
        """The next frame, and the seconds that it took.

        Raises
        ------
        GsvcError
            Its bits are not those of a frame, although the checksum fits.
        """
        frame, record = next(self._frames), self._records[self._position]
        self._position += 1
        layers = _layers(frame, record.layers) if self.header.layer_count > 1 else ()
        return (
            EncodedFrame(
                frame.codes, frame.state, record.psnr, record.iterations, record.stages, record.decisions,
                record.reason, layers=layers,
            ),
            record.seconds,
        )  # fmt: skip


def _layers(frame: DecodedFrame, psnr: tuple[float, ...]) -> tuple[EncodedLayer, ...]:
    """The base and the layers of a frame; one without a chunk is carried."""
    chunks = {chunk.layer: chunk.codes for chunk in frame.chunks}
    if frame.layers is None or not isinstance(frame.codes, MainCodes) or not isinstance(frame.state, MainState):
        raise GsvcError("malformed", NOT_A_GROUP)
    states = {0: frame.state, **frame.layers.there}
    if len(states) != len(psnr):
        raise GsvcError("malformed", NOT_A_GROUP)
    codes = {0: frame.codes, **chunks}
    return tuple(
        EncodedLayer(
            layer, codes.get(layer, MainCodes.repeated_frame()), state, psnr[layer], carried=layer not in codes
        )
        for layer, state in states.items()
    )


def _records(data: bytes) -> Iterator[tuple[str, dict[str, Any]]]:
    """The type and the contents of each private chunk; every chunk of the stream is read.

    Raises
    ------
    GsvcError
        The record of the group is not the last chunk, or does not fit the chunks before it.
    """
    decoder = ChunkDecoder(Source(data))
    place, kind = decoder.first, 0
    while kind != END_TYPE:
        before = kind
        _, kind, payload = decoder.read(place)
        if (chr(before) == GROUP_RECORD) != (kind == END_TYPE):
            raise GsvcError("malformed", NOT_A_GROUP)
        if chr(kind) in (FRAME_RECORD, GROUP_RECORD):
            record = _parsed(bytes(payload.raw("payload", payload.bytes_left)))
            chunks = memoryview(data)[decoder.first.offset : place.offset]
            if chr(kind) == GROUP_RECORD and record.get("chunks") != sha256(chunks).hexdigest():
                raise GsvcError("malformed", "its frames do not belong to its records")
            yield chr(kind), record
        place = decoder.hop(place)[1]


def _parsed(payload: bytes) -> dict[str, Any]:
    """A record, of which nothing is trusted but that it is JSON."""
    try:
        if len(payload) > MAX_RECORD or payload[:UUID_SIZE] != OURS:
            raise ValueError
        record = json.loads(payload[UUID_SIZE:])
        if not isinstance(record, dict):
            raise ValueError
        return record
    except (ValueError, RecursionError):
        raise GsvcError("malformed", NOT_A_GROUP) from None


def _record(fields: dict[str, Any]) -> _Record:
    """A record whose values may have any type."""
    try:
        digest, reason = fields["digest"], fields["reason"]
        if not isinstance(digest, str) or not (reason is None or _is_phrase(reason)):
            raise ValueError
        stages = {str(name): _seconds(spent) for name, spent in fields["stages"].items()}
        decisions = tuple(_decision(*one) for one in fields["decisions"])
        if not _is_count(fields["iterations"]):
            raise ValueError
        return _Record(
            digest, _seconds(fields["seconds"]), _psnr(fields["psnr"]), fields["iterations"], stages, decisions,
            reason, tuple(_psnr(one) for one in fields["layers"]),
        )  # fmt: skip
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError):  # no float is so large
        raise GsvcError("malformed", NOT_A_GROUP) from None


def _decision(effect: Any, done: Any, reason: Any, iterations: Any, saved: Any, seconds: Any) -> Decision:
    if effect not in EFFECT_NAMES or not isinstance(done, bool) or not _is_phrase(reason):
        raise ValueError
    if not (_is_count(iterations) and _is_count(saved)):
        raise ValueError
    return Decision(effect, done, reason, iterations, saved, _seconds(seconds))


def _finite(psnr: float) -> float | None:
    """A PSNR in JSON, which has no infinity."""
    return psnr if math.isfinite(psnr) else None


def _psnr(value: Any) -> float:
    return math.inf if value is None else _number(value)


def _seconds(value: Any) -> float:
    number = _number(value)
    if number < 0:
        raise ValueError
    return number


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError
    return float(value)


def _is_count(value: Any) -> bool:
    return type(value) is int and 0 <= value <= MAX_STEPS


def _is_phrase(value: Any) -> bool:
    return isinstance(value, str) and value.isprintable() and len(value) < MAX_RECORD
