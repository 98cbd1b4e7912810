"""What must hold of every salvage, whatever the damage: used by the tests of streams and by those of hostile input."""

from collections.abc import Sequence
from dataclasses import dataclass

from gsvc_base.errors import GsvcError
from gsvc_base.splats import Splats
from gsvc_ref.stream import DecodedFrame, Gap, StreamReader
from gsvc_ref.stream.chunk_decoder import ChunkDecoder
from gsvc_ref.stream.salvage import Salvage
from gsvc_ref.stream.source import Source
from gsvc_ref.stream.whole_chunks import WholeChunks


@dataclass(frozen=True)
class Salvaged:
    """What came out of a damaged stream, in the order of the stream, and apart."""

    parts: list[DecodedFrame | Gap]

    @property
    def frames(self) -> list[DecodedFrame]:
        return [part for part in self.parts if isinstance(part, DecodedFrame)]

    @property
    def gaps(self) -> list[Gap]:
        return [part for part in self.parts if isinstance(part, Gap)]

    @property
    def missing(self) -> list[int]:
        """The numbers of the missing frames, as far as they are known."""
        return [number for gap in self.gaps for number in numbers(gap)]


def numbers(gap: Gap) -> range:
    return range(gap.first_missing, gap.first_missing + (gap.missing_count or 0))


def salvage(data: bytes, truth: Sequence[Splats] | None = None, *, total: int | None = None) -> Salvaged:
    """Salvage a stream with a sound beginning, and check what holds of any.

    Parameters
    ----------
    data
        The stream.
    truth
        The splats of the undamaged one: what comes out must be these, at their numbers.
    total
        The number of frames that the salvage must account for, if it is known.
    """
    decoder = ChunkDecoder(Source(data))
    work = Salvage(decoder, decoder.first)
    bits = decoder.opening_bits.total()
    parts: list[DecodedFrame | Gap] = []
    for part in work:
        if isinstance(part, Gap):
            parts.append(part)
            bits += 8 * part.skipped
        else:
            bits += part.bits.total()
            parts += [part.frame] if part.frame is not None else []
    assert bits == 8 * len(data)
    assert work.checksummed <= WholeChunks.MAX_CHECKSUMMED * len(data)
    result = Salvaged(parts)
    _check_order(result, total)
    if truth is not None:
        assert all(frame.splats == truth[frame.number] for frame in result.frames)
    _check_agrees_with_plain_reading(data, result)
    return result


def _check_order(result: Salvaged, total: int | None) -> None:
    """Frames and gaps account for each number once, and for each byte at most once."""
    due = offset = 0
    open_end = False
    for part in result.parts:
        assert part.offset >= offset
        offset = part.offset + part.size
        assert not open_end
        if isinstance(part, DecodedFrame):
            assert part.number == due
            due += 1
            continue
        assert part.first_missing == due
        assert 0 <= part.skipped <= part.size
        assert 1 <= len(part.faults) <= part.fault_count
        open_end = part.missing_count is None
        due += part.missing_count or 0
    if total is not None:
        assert open_end or due == total


def _check_agrees_with_plain_reading(data: bytes, result: Salvaged) -> None:
    """Up to the first fault both are the same, and both find the same fault."""
    plain: list[DecodedFrame] = []
    fault = None
    try:
        for frame in StreamReader(data):
            plain.append(frame)
    except GsvcError as error:
        fault = error
    assert [frame.splats for frame in result.frames[: len(plain)]] == [frame.splats for frame in plain]
    assert (fault is None) == (result.gaps == [])
    if fault is not None:
        first = result.gaps[0].faults[0]
        assert (first.kind, first.rule, first.bit) == (fault.kind, fault.rule, fault.bit)
        assert first.message == fault.message
        assert result.gaps[0].first_missing == len(plain)
