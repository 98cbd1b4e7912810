"""A coder that leads another one, so that each group of pictures takes the bits that are planned for it.

The I-frame gets another number of splats until it takes about what it should. After each P-frame what is left for the
group is compared with what the frames that are left would take, and the next one is coded as much finer or coarser. The
last one is tried again where it misses. A group knows its own plan alone, so nothing depends on the order of groups.
"""

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass
from typing import Any, Final

from gsvc_base.arrays import Frame
from gsvc_base.errors import GsvcError
from gsvc_base.portable import log2, power, total
from gsvc_ref.bitstream import LEVELS, SequenceHeader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.encoder.encoded_frame import EncodedFrame, OnStage
from gsvc_ref.encoder.loop import GroupCoder
from gsvc_ref.encoder.main.frame import MainFrameEncoder
from gsvc_ref.encoder.paper import FrameEncoder
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.encoder.setup import coder_of
from gsvc_ref.main.tables import QUANTIZERS
from gsvc_ref.paper import FrameType
from gsvc_ref.stream.formats import header_fields
from gsvc_ref.stream.profiles import AnyState, profile_of
from gsvc_ref.video import VideoFormat
from gsvc_tools.targets.curves import USUAL

CLOSE_SIZE: Final = 0.005
"""A group may take this part more or less than is planned."""

SLACK: Final = 0.1
"""An I-frame may be off by this part of what P-frames are planned to take, since they can make up for it."""

GROUP_TRIES: Final = 5
"""The most values that are tried for an I-frame, or for the last P-frame."""

QUANTIZER_SLOPE: Final = 0.145
"""log2 of the bits that a P-frame gains by the next finer quantiser: measured with 8 frames, 128x96, of the scenes
``pan`` and ``water`` with 160 and 640 splats."""

MAX_QUANTIZER_CHANGE: Final = 16
"""The maximum difference between the quantisers of a P-frame and its I-frame, two octaves of D."""

MAX_OCTAVES: Final = 0.15
"""Profile `paper`: the same of the number of splats."""

BITS_DECAY: Final = 0.9
"""What counts of a frame's bits, against those expected, when the next frame is done."""

CHUNK_BITS: Final = 60
"""Type, length, numbers and checksum of a chunk, about."""


@dataclass(frozen=True)
class GroupPlan:
    """What is planned for a group of pictures."""

    splats: int  # the number of splats of a frame
    bits: float  # what its frames are to take together
    frame_bits: tuple[float, ...]  # what each of them is expected to take with that many splats


class BudgetCoder:
    """A GroupCoder that leads another one by the plan of each group; no frame gets more than `most` splats."""

    def __init__(self, coder: GroupCoder, video: VideoFormat, plans: Mapping[int, GroupPlan], most: int) -> None:
        assert isinstance(coder, MainFrameEncoder | FrameEncoder)
        self._coder: Any = coder
        self._video, self._plans, self._most = video, plans, most
        self._plan: GroupPlan | None = None
        self._place = self._base = 0
        self._bits = self._decayed_bits = self._decayed_plan = 0.0

    @property
    def settings(self) -> Settings:
        """The settings in use."""
        settings: Settings = self._coder.settings
        return settings

    @property
    def state(self) -> AnyState:
        """The decoder's state after the frames so far."""
        state: AnyState = self._coder.state
        return state

    @property
    def decides_first(self) -> bool:
        """Whether the first frame of the stream decides something for all groups."""
        return bool(self._coder.decides_first)

    def decided(self) -> tuple[int, ...]:
        """What the first frame has decided, once it is encoded."""
        return tuple(self._coder.decided())

    def decide(self, decided: tuple[int, ...]) -> None:
        """Take it from another coder of the stream."""
        self._coder.decide(decided)

    def elements(self) -> dict[str, Any]:
        """The elements of the sequence header that belong to the profile."""
        elements: dict[str, Any] = self._coder.elements()
        return elements

    def for_group(self) -> "BudgetCoder":
        """A coder for another group of pictures."""
        return BudgetCoder(self._coder.for_group(), self._video, self._plans, self._most)

    def encode(self, frame: Frame, frame_type: FrameType, number: int, progress: OnStage) -> EncodedFrame:
        """Encode a frame (H, W, 3) u1 or u2; the next one is predicted from its reconstruction.

        A GsvcError ``invalid`` says that the source has other frames than when it was read before.
        """
        if number in self._plans:
            self._begin(self._plans[number])
        if self._plan is None or self._place >= len(self._plan.frame_bits):
            raise GsvcError("invalid", "the source gave other frames when it was read again; encode a file that rests")
        plan, place = self._plan, self._place
        self._place += 1
        args = (frame, frame_type, number, progress)
        if frame_type == "I":
            encoded, bits = self._intra(plan, *args)
        elif frame_type == "P":
            encoded, bits = self._inter(plan, place, *args)
        else:
            encoded, bits = self._encode(*args)
        self._bits += bits
        return encoded

    def _begin(self, plan: GroupPlan) -> None:
        self._plan, self._place = plan, 0
        self._bits = self._decayed_bits = self._decayed_plan = 0.0

    def _intra(self, plan: GroupPlan, *frame: Any) -> tuple[EncodedFrame, float]:
        """An I-frame."""
        goal = plan.bits * plan.frame_bits[0] / total(plan.frame_bits)
        room = max(CLOSE_SIZE * plan.bits, SLACK * (plan.bits - goal))

        def with_splats(octave: float) -> float:
            self._coder.intra_splats = min(max(1, round(_power_of_two(octave))), self._most)
            return float(log2(self._coder.intra_splats))

        first = float(log2(plan.splats))
        encoded, bits, _ = self._nearest(frame, goal, room, with_splats, first, USUAL.intra, GROUP_TRIES)
        self._base = self._coder.quantizer if isinstance(self._coder, MainFrameEncoder) else self._coder.intra_splats
        return encoded, bits

    def _inter(self, plan: GroupPlan, place: int, *frame: Any) -> tuple[EncodedFrame, float]:
        """A P-frame, as much finer or coarser as what is left for the group asks for."""
        rest = plan.frame_bits[place:]
        usual = 2 * total(plan.frame_bits) / len(plan.frame_bits)  # so that one odd frame changes little
        ahead = total(rest) * (usual + self._decayed_bits) / (usual + self._decayed_plan)
        rest_bits = max(plan.bits - self._bits, 1.0)
        pressure = float(log2(rest_bits / max(ahead, 1.0)))
        is_last = len(rest) == 1 or max(rest[1:]) <= 2 * CHUNK_BITS
        goal = rest_bits if is_last else rest_bits * rest[0] / total(rest)
        tries, room = (GROUP_TRIES, CLOSE_SIZE * plan.bits) if is_last else (1, 0.0)
        slope = QUANTIZER_SLOPE if isinstance(self._coder, MainFrameEncoder) else 1.0
        encoded, bits, finer = self._nearest(frame, goal, room, self._refine, pressure / slope, slope, tries)
        self._decayed_bits = BITS_DECAY * self._decayed_bits + bits / _power_of_two(slope * finer)
        self._decayed_plan = BITS_DECAY * self._decayed_plan + rest[0]
        return encoded, bits

    def _refine(self, change: float) -> float:
        """Refine the next P-frame in quantisers, in profile `paper` in octaves of splats; the change made."""
        if isinstance(self._coder, MainFrameEncoder):
            whole = round(min(max(change, -MAX_QUANTIZER_CHANGE), MAX_QUANTIZER_CHANGE))
            self._coder.quantizer = min(max(self._base - whole, 0), QUANTIZERS - 1)
            return float(self._base - self._coder.quantizer)
        octaves = min(max(change, -MAX_OCTAVES), MAX_OCTAVES)
        self._coder.intra_splats = min(max(1, round(self._base * _power_of_two(octaves))), self._most)
        return float(log2(self._coder.intra_splats / self._base))

    def _nearest(
        self,
        frame: tuple[Any, ...],  # what `GroupCoder.encode` takes
        goal: float,  # the number of bits, which may be missed by `room`
        room: float,
        set_to: Callable[[float], float],  # sets what is tried, and returns the value that is possible
        # the first value, log2 of the bits that 1 more gains, and how many are tried at most
        value: float,
        slope: float,
        tries: int,
    ) -> tuple[EncodedFrame, float, float]:
        """The frame of those tried with the nearest number of bits, these, and its value; the coder goes on from it."""
        before = after = self._coder
        best: tuple[EncodedFrame, float, float] | None = None
        tried = set()
        for _ in range(tries):
            self._coder = copy(before)
            possible = set_to(value)
            if possible in tried:
                break
            tried.add(possible)
            encoded, bits = self._encode(*frame)
            if best is None or abs(bits - goal) < abs(best[1] - goal):
                best, after = (encoded, bits, possible), self._coder
            if abs(bits - goal) <= room:
                break
            value = possible + float(log2(max(goal, 1.0) / max(bits, 1.0))) / slope
        assert best is not None
        self._coder = after
        return best

    def _encode(self, *frame: Any) -> tuple[EncodedFrame, float]:
        """Encode a frame; with its bits."""
        before = self._coder.state
        encoded: EncodedFrame = self._coder.encode(*frame)
        return encoded, chunk_bits(self._coder, self._video, before, encoded)


def planned_coder(settings: Settings, video: VideoFormat, *, plans: Mapping[int, GroupPlan], most: int) -> BudgetCoder:
    """The coder of a video that keeps to the plans of its groups; no frame gets more than `most` splats."""
    return BudgetCoder(coder_of(settings, video), video, plans, most)


def header_so_far(coder: GroupCoder, video: VideoFormat) -> SequenceHeader:
    """The sequence header of frames that a coder has begun to encode, at a level that has room for all."""
    return SequenceHeader(level=max(LEVELS), **{**header_fields(video), **coder.elements()})


def chunk_bits(coder: GroupCoder, video: VideoFormat, before: AnyState, encoded: EncodedFrame) -> float:
    """The bits of the chunk of a frame that a coder has encoded, about; `before`: its state before that."""
    header = header_so_far(coder, video)
    body = Writer()
    profile_of(header).prepare(Writer, header, before, encoded.codes, encoded.state).write(body)
    return 8.0 * len(body.getvalue()) + CHUNK_BITS


def _power_of_two(exponent: float) -> float:
    return float(power(2.0, exponent))
