"""What a profile adds to the container: the codes of a frame, and the state that they lead to (spec.md section 5).

Whatever reads or writes streams asks `profile_of` a header, and knows no profile itself.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

from gsvc_base.errors import UsageError
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.frames import frame_codes
from gsvc_ref.bitstream.header import PROFILES, Limits, SequenceHeader
from gsvc_ref.bitstream.work import rendering_work
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.frames import frame_body
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.paper import FrameCodes, FrameType, State, reconstruct

AnyCodes = FrameCodes | MainCodes
"""The codes of a frame of any profile: they have `type`, `intra_count`, `survivor_count` and `origins`."""

AnyState = State | MainState
"""What any profile carries from frame to frame; it has `splats`, those of the frame before."""


MakeWriter = Callable[[int], Writer]
"""Makes a Writer, given the bit at which what it writes begins."""


@dataclass(frozen=True)
class Parsed:
    """What a payload holds after `parameter_checksum`."""

    codes: AnyCodes
    reconstruct: Callable[[], AnyState]  # the state after the frame; raises the GsvcError of R-8-1


@dataclass(frozen=True)
class Prepared:
    """A frame that is ready to be written."""

    state: AnyState  # after the frame; the state before, if the frame repeats it
    splats: int  # the number that R-5-2 limits
    write: Callable[[Writer], object]  # what follows `parameter_checksum`


class Profile(Protocol):
    """A profile: frames are handed to it after `parameter_checksum`."""

    def initial(self, header: SequenceHeader) -> AnyState:
        """The state before the first frame, and the one in which decoding begins at an I-frame."""

    def read(
        self, p: Reader, header: SequenceHeader, before: AnyState, frame_type: FrameType, limits: Limits
    ) -> Parsed:
        """Read the rest of the payload of a frame, which keeps the limits."""

    def prepare(
        self,
        make_writer: MakeWriter,
        header: SequenceHeader,
        before: AnyState,
        codes: AnyCodes,
        after: AnyState | None,
    ) -> Prepared:
        """Make a frame ready to be written, given the state `after` it where that is known already.

        Codes of another profile, or that do not fit the state, raise a UsageError, here or when they are written; R-8-1
        is a GsvcError.
        """


class _Paper:
    """Profile 0: sections 6.4 to 8."""

    def initial(self, header: SequenceHeader) -> State:
        return State.initial(header.width, header.height)

    def read(
        self, p: Reader, header: SequenceHeader, before: AnyState, frame_type: FrameType, limits: Limits
    ) -> Parsed:
        assert isinstance(before, State)
        codes = frame_codes(p, header, before, frame_type)
        return Parsed(codes, lambda: reconstruct(codes, before))

    def prepare(
        self,
        make_writer: MakeWriter,
        header: SequenceHeader,
        before: AnyState,
        codes: AnyCodes,
        after: AnyState | None,
    ) -> Prepared:
        assert isinstance(before, State)
        if not isinstance(codes, FrameCodes):
            raise _other_profile(header)
        state = reconstruct(codes, before) if after is None else after
        return Prepared(state, len(state.splats), lambda p: frame_codes(p, header, before, codes.type, codes))


class _Main:
    """Profile 1: section 15. Codes are read in the state that they lead to, so reading is reconstruction."""

    def initial(self, header: SequenceHeader) -> MainState:
        return MainState.initial(header.width, header.height)

    def read(
        self, p: Reader, header: SequenceHeader, before: AnyState, frame_type: FrameType, limits: Limits
    ) -> Parsed:
        assert isinstance(before, MainState)
        if frame_type == "R":
            return Parsed(MainCodes.repeated_frame(), lambda: before)
        own = None if limits.own is None else limits.own.splats
        body = frame_body(p, frame_type, before, header.max_lane_exponent, limits.frame.splats, own_most=own)
        return Parsed(body.codes, lambda: body.after)

    def prepare(
        self,
        make_writer: MakeWriter,
        header: SequenceHeader,
        before: AnyState,
        codes: AnyCodes,
        after: AnyState | None,
    ) -> Prepared:
        assert isinstance(before, MainState)
        if not isinstance(codes, MainCodes):
            raise _other_profile(header)
        if codes.type == "R":
            return Prepared(before, len(before.values), lambda p: None)
        body = make_writer(0)
        state = frame_body(body, codes.type, before, header.max_lane_exponent, header.limits.splats, codes).after
        return Prepared(state, len(codes.modes) + codes.intra_count, lambda p: p.append(body))


def _other_profile(header: SequenceHeader) -> UsageError:
    name = PROFILES[header.profile]
    made = " and ".join(kind.__name__ for kind in (FrameCodes, MainCodes))
    return UsageError(f"the codes are of another profile than `{name}`, that of the header; {made} belong to one each")


_BY_NUMBER: Final[tuple[Profile, ...]] = (_Paper(), _Main())


def profile_of(header: SequenceHeader) -> Profile:
    """The profile of a stream."""
    return _BY_NUMBER[header.profile]


def work_after(state: AnyState, halvings: int = 0) -> int:
    """The rendering work of the splats of a state in pairs, (5-1) or (5-2), the latter at a size halved so often."""
    if isinstance(state, MainState):
        return state.work_at(halvings)
    return rendering_work(state.splats, state.width, state.height)
