"""The log of an encode: what was decided about each effect of each frame, why, and what it cost; as bytes and back.

A stream carries it in the ancillary chunk ``d`` (spec.md section 6.9): deflated lines of JSON, one for each frame. It
holds no times, so the same encode gives the same bytes.
"""

import json
import time
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Final

from gsvc_base.errors import UsageError
from gsvc_ref.encoder.effects import EFFECT_NAMES, EffectName, Effects
from gsvc_ref.paper import FrameType

LOG_SIGNATURE: Final = b"LOG\x01"
"""The first bytes of a log, since applications may give the chunk type another meaning; the last one is the version."""

MAX_LOG_LINE: Final = 2048
"""Maximum number of bytes of a line; those of gsvc_ref have about 600."""

MAX_STEPS: Final = 2**53 - 1
"""Maximum of a count in a log: every reader of JSON knows whole numbers up to it."""

OFF: Final = "switched off"
"""The reason of a decision about an effect whose mode is ``off``."""

LOG_PIECE: Final = 1 << 16
"""Maximum number of bytes that are inflated at a time."""


@dataclass(frozen=True)
class Decision:
    """One decision about one effect of one frame."""

    effect: EffectName
    done: bool  # False if all or part of its work was left out
    reason: str  # a phrase with the number that it rests on
    # optimisation steps: for ``dks`` of pre-training, for ``frames`` of fitting and fine-tuning
    iterations: int = 0
    saved: int = 0  # optimisation steps that ``all`` would have taken in addition, as far as known beforehand
    seconds: float = 0.0  # 0 when read from a stream, which has no times


class FrameLog:
    """The decisions about one frame as they are made; a later one about an effect replaces the first."""

    def __init__(self, made: Iterable[Decision] = ()) -> None:
        self.made: dict[EffectName, Decision] = {one.effect: one for one in made}

    @property
    def decisions(self) -> tuple[Decision, ...]:
        """The decisions so far."""
        return tuple(self.made.values())

    def add(self, effect: EffectName, reason: str, *, done: bool, saved: int = 0) -> None:
        """Log a decision."""
        self.made[effect] = Decision(effect, done, reason, saved=saved)

    def measured(self, effect: EffectName, iterations: int, seconds: float) -> None:
        """Log what the work of an effect took that was decided on before."""
        self.made[effect] = replace(self.made[effect], iterations=iterations, seconds=seconds)

    @contextmanager
    def timed(self, effect: EffectName) -> Iterator[None]:
        """Add the time that the block takes to the decision about an effect, which is logged in it."""
        begin = time.perf_counter()
        yield
        self.made[effect] = replace(self.made[effect], seconds=time.perf_counter() - begin)

    def completed(self, effects: Effects, frame_type: FrameType) -> tuple[Decision, ...]:
        """One decision about each effect, in the order of `EFFECT_NAMES`, also where there was nothing to decide."""
        for name in EFFECT_NAMES:
            if name in self.made:
                continue
            if effects.mode(name) == "off":
                reason = OFF
            elif frame_type == "R":
                reason = "the frame before is repeated"
            else:
                reason = "the rate has room for all splats" if name == "gsp" else "an I-frame begins from nothing"
            self.add(name, reason, done=False)
        return tuple(self.made[name] for name in EFFECT_NAMES)


def percent(fraction: float) -> str:
    """A fraction above 0 as a percentage, at least 1 %."""
    return f"{max(1, round(100 * fraction))} %"


def write_log(frames: Sequence[Sequence[Decision]]) -> bytes:
    """The payload of a chunk ``d`` for the decisions about all frames, one about each effect."""
    deflater = zlib.compressobj(9, wbits=-15)
    lines = (_line(number, decisions) for number, decisions in enumerate(frames))
    return b"".join([LOG_SIGNATURE, *map(deflater.compress, lines), deflater.flush()])


def _line(number: int, decisions: Iterable[Decision]) -> bytes:
    """The line of one frame; counts of 0 are left out."""
    entry: dict[str, Any] = {"frame": number}
    for one in decisions:
        counts = {"iterations": one.iterations, "saved": one.saved}
        entry[one.effect] = {"done": one.done, "reason": one.reason} | {k: n for k, n in counts.items() if n}
    return json.dumps(entry, separators=(",", ":")).encode() + b"\n"


def read_log(
    payload: bytes,  # of a chunk of type `chunks.DECISIONS`
    frame_count: int,  # of the stream that it was found in
) -> list[tuple[Decision, ...]]:
    """The decisions about all frames, each with one about each effect in the order of `EFFECT_NAMES`.

    Any payload takes at most MAX_LOG_LINE bytes for each frame: it is inflated piece by piece, and reading ends at the
    first line that is too long or one too many. Names that this version does not know are skipped.
    """
    if payload[: len(LOG_SIGNATURE)] != LOG_SIGNATURE:
        raise UsageError("the chunk of type d holds no log of decisions, or one of a later version")
    frames: list[tuple[Decision, ...]] = []
    for line in _inflated_lines(payload[len(LOG_SIGNATURE) :]):
        if len(frames) == frame_count:
            raise UsageError(f"the log of decisions has more lines than the stream has frames, {frame_count}")
        frames.append(_decisions(line, len(frames)))
    if len(frames) < frame_count:
        raise UsageError(f"the log of decisions is about {len(frames)} frames, and the stream has {frame_count}")
    return frames


def _inflated_lines(deflated: bytes) -> Iterator[bytes]:
    """The lines of a raw deflate stream."""
    inflater, rest = zlib.decompressobj(-15), b""
    while not inflater.eof:
        try:
            piece = inflater.decompress(deflated, LOG_PIECE)
        except zlib.error as error:
            raise UsageError(f"the log of decisions cannot be inflated: {error}") from None
        deflated = inflater.unconsumed_tail
        if not (piece or deflated or inflater.eof):
            break
        *lines, rest = (rest + piece).split(b"\n")
        if len(rest) > MAX_LOG_LINE:
            break
        yield from lines
    if rest or not inflater.eof or inflater.unused_data:
        raise UsageError("the log of decisions is cut, has a line that is too long, or something follows it")


def _decisions(line: bytes, number: int) -> tuple[Decision, ...]:
    """The decisions in a line; a value of a wrong type makes the whole line invalid."""
    try:
        entry: Any = json.loads(line) if len(line) <= MAX_LOG_LINE else None
        if entry["frame"] != number:
            raise ValueError
        return tuple(_decision(name, **_known(entry[name])) for name in EFFECT_NAMES)
    except (ValueError, TypeError, KeyError, RecursionError):
        raise UsageError(f"the log of decisions has a line {number} that does not say what was decided") from None


def _known(fields: dict[str, Any]) -> dict[str, Any]:
    return {name: fields[name] for name in ("done", "reason", "iterations", "saved") if name in fields}


def _decision(effect: EffectName, done: Any, reason: Any, iterations: Any = 0, saved: Any = 0) -> Decision:
    """A decision of values that may have any type."""
    counts_fit = all(type(count) is int and 0 <= count <= MAX_STEPS for count in (iterations, saved))
    if not (isinstance(done, bool) and isinstance(reason, str) and reason.isprintable() and reason and counts_fit):
        raise ValueError
    return Decision(effect, done, reason, iterations, saved)
