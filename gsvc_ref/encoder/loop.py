"""The loop of the encoder: typed frames in, encoded frames out, each predicted from the one before (closed loop).

A *group of pictures* is a frame that was typed I, with all frames up to the next such one. Nothing in it is predicted
from another group, and its coder is `FrameCoder.for_group` of that of the first frame. So it does not matter where and
in which order groups are encoded: the bytes are the same.

What else an encode does stands around this loop: `recording` writes the stream and the report, gsvc_tools has groups
encoded side by side, goes on from what an earlier encode has kept, and encodes several times for a size.
"""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, Protocol, Self, TypeVar

from gsvc_base.arrays import Frame
from gsvc_ref.encoder.encoded_frame import EncodedFrame, OnStage
from gsvc_ref.encoder.frame_types import TypedFrame
from gsvc_ref.encoder.log import Decision, FrameLog
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.paper import FrameType
from gsvc_ref.stream.profiles import AnyState

FrameT = TypeVar("FrameT")
"""What a frame of the source is: a picture, or splats."""
CodedT = TypeVar("CodedT", contravariant=True)

Watch = Callable[[int], OnStage]
"""Gives, for the number of a frame, what is called with the stages of its encoding."""


class FrameCoder(Protocol[CodedT]):
    """What encodes the frames of a group of pictures in order."""

    @property
    def settings(self) -> Settings:
        """The settings in use; the first frame of a stream may choose some of them."""

    @property
    def state(self) -> AnyState:
        """The decoder's state after the frames so far."""

    def elements(self) -> dict[str, Any]:
        """The elements of the sequence header that belong to the profile; they are final after the first frame."""

    def encode(self, frame: CodedT, frame_type: FrameType, number: int, progress: OnStage) -> EncodedFrame:
        """Encode a frame; the next one is predicted from its reconstruction."""

    def for_group(self) -> Self:
        """A coder for a group of pictures, with what the first frame of the stream has decided, and nothing else."""


class GroupCoder(FrameCoder[Frame], Protocol):
    """What encodes pictures, in any process: what the first frame of a stream decides can be handed over."""

    @property
    def decides_first(self) -> bool:
        """Whether the first frame of a stream decides something for all of its groups."""

    def decided(self) -> tuple[int, ...]:
        """What the first frame has decided, once it is encoded."""

    def decide(self, decided: tuple[int, ...]) -> None:
        """Take the decisions of another coder of the stream; raises ValueError if they cannot be such."""


def silent(stage: str, done: int, iterations: int, psnr: float | None) -> None:
    """Ignore the stages of a frame."""


def unwatched(number: int) -> OnStage:
    """Ignore the stages of all frames."""
    return silent


def encode_frames(
    frames: Iterable[TypedFrame[FrameT]], coder: FrameCoder[FrameT], watch: Watch = unwatched
) -> Iterator[EncodedFrame]:
    """Encode frames in order, the first group of pictures with `coder` and each other one with another coder."""
    template: FrameCoder[FrameT] | None = None  # has what the first frame has decided, and encodes nothing
    for frame in frames:
        if frame.type == "I" and template is not None:
            coder = template.for_group()
        yield encode_frame(frame, coder, watch)
        template = template or coder.for_group()


def encode_frame(frame: TypedFrame[FrameT], coder: FrameCoder[FrameT], watch: Watch = unwatched) -> EncodedFrame:
    """Encode the next frame of a group of pictures."""
    begin = time.perf_counter()
    encoded = coder.encode(frame.frame, frame.type, frame.number, watch(frame.number))
    return described(encoded, frame, coder, time.perf_counter() - begin)


def described(encoded: EncodedFrame, frame: TypedFrame[Any], coder: FrameCoder[Any], elapsed_s: float) -> EncodedFrame:
    """An encoded frame with its number, its time, and all that was decided about it, when it was typed as well."""
    decisions: tuple[Decision, ...] = ()
    if frame.decisions:
        log = FrameLog((*frame.decisions, *encoded.decisions))
        log.measured("frames", encoded.iterations, sum(encoded.seconds.values()))
        decisions = log.completed(coder.settings.effects, encoded.codes.type)
    reason = encoded.reason or frame.reason
    return replace(encoded, number=frame.number, reason=reason, decisions=decisions, elapsed_s=elapsed_s)
