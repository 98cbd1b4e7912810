"""Hypothesis strategies of what a stream says: headers, frames, and whole streams with what they stand for."""

from hypothesis import strategies as st

from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.reconstruction import FrameCodes, State
from gsvc_ref.testing.choices import Choices
from gsvc_ref.testing.random_streams import MAX_PIXELS, Stream, make_frame, make_header, make_stream


class DrawnChoices(Choices):
    """Choices that Hypothesis draws."""

    def __init__(self, draw: st.DrawFn) -> None:
        self._draw = draw

    def integer(self, lowest: int, highest: int) -> int:
        """An integer in lowest..highest."""
        return self._draw(st.integers(lowest, highest))


@st.composite
def headers(draw: st.DrawFn, *, max_pixels: int = MAX_PIXELS) -> SequenceHeader:
    """Legal sequence headers; all elements but the size take their whole range."""
    return make_header(DrawnChoices(draw), max_pixels=max_pixels)


@st.composite
def frames(
    draw: st.DrawFn, header: SequenceHeader, state: State, *, types: str = "IPR", max_count: int = 120
) -> FrameCodes:
    """A frame that may follow `state`: one of `types`, with at most `max_count` new splats."""
    return make_frame(DrawnChoices(draw), header, state, types=types, max_count=max_count)


@st.composite
def streams(draw: st.DrawFn, *, max_frames: int = 5, max_count: int = 120, max_pixels: int = MAX_PIXELS) -> Stream:
    """Legal streams with all that the syntax allows: those of `random_stream`, drawn by Hypothesis."""
    return make_stream(DrawnChoices(draw), max_frames=max_frames, max_count=max_count, max_pixels=max_pixels)
