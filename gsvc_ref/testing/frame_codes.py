"""Hypothesis strategies of what a stream says: headers, frames, and whole streams with what they stand for."""

from functools import cache
from typing import Any, Final

import numpy as np
from hypothesis import strategies as st
from numpy.typing import DTypeLike, NDArray

from gsvc_base.draws import Draws, Size
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.paper import FrameCodes, State
from gsvc_ref.stream import reconstruct_stream
from gsvc_ref.testing.choices import Choices
from gsvc_ref.testing.examples import RICH_HEADER, rich_frames
from gsvc_ref.testing.faults import write_stream
from gsvc_ref.testing.random_main_streams import make_main_stream, random_main_stream
from gsvc_ref.testing.random_streams import LEVEL1_PIXELS, Stream, make_frame, make_header, make_stream

FEW_NUMBERS: Final = 24
"""Number of numbers that are drawn one by one: those of 8 splats."""


class DrawnChoices(Choices):
    """Choices that Hypothesis draws."""

    def __init__(self, draw: st.DrawFn) -> None:
        self._draw = draw

    def integer(self, lowest: int, highest: int) -> int:
        """An integer in lowest..highest."""
        return self._draw(st.integers(lowest, highest))

    def generator(self) -> Draws:
        """A generator whose numbers are drawn one by one where they are few."""
        return DrawnNumbers(self._draw)


class DrawnNumbers(Draws):
    """Random numbers that Hypothesis draws, the simple ones first: middles, lowest integers, zeros.

    More than `FEW_NUMBERS` at once come from a drawn seed.
    """

    def __init__(self, draw: st.DrawFn) -> None:
        super().__init__(draw(st.integers(0, 2**32 - 1)))
        self._draw = draw

    def random(self, size: Size, dtype: DTypeLike = np.float64) -> NDArray[Any]:
        """Numbers from 0 to below 1; 1/2 is the simplest."""
        if np.prod(size) > FEW_NUMBERS:
            return super().random(size, dtype)
        return np.asarray(self._numbers(st.floats(-0.5, 0.5, exclude_max=True, width=32), size) + 0.5).astype(dtype)

    def integers(self, low: Any, high: Any = None, size: Any = None, dtype: DTypeLike = np.int64) -> Any:
        """Integers from low to below high, or from 0 to below low; the lowest is the simplest."""
        shape = () if size is None else size
        if np.ndim(low) or np.ndim(high) or np.prod(shape) > FEW_NUMBERS:
            return super().integers(low, high, size, dtype)
        first, end = (0, low) if high is None else (low, high)
        drawn = self._numbers(st.integers(int(first), int(end) - 1), shape)
        return int(drawn) if size is None else drawn.astype(dtype)

    def standard_normal(self, size: Size, dtype: DTypeLike = np.float64) -> NDArray[Any]:
        """Numbers of some units around 0; 0 is the simplest."""
        if np.prod(size) > FEW_NUMBERS:
            return super().standard_normal(size, dtype)
        return self._numbers(st.floats(-4, 4, width=32), size).astype(dtype)

    def _numbers(self, strategy: st.SearchStrategy[Any], size: Size) -> NDArray[Any]:
        return np.array([self._draw(strategy) for _ in range(int(np.prod(size)))]).reshape(size)


@st.composite
def headers(draw: st.DrawFn, *, max_pixels: int = LEVEL1_PIXELS) -> SequenceHeader:
    """Legal sequence headers; all elements but the size take their whole range."""
    return make_header(DrawnChoices(draw), max_pixels=max_pixels)


@st.composite
def frames(
    draw: st.DrawFn, header: SequenceHeader, state: State, *, types: str = "IPR", max_count: int = 120
) -> FrameCodes:
    """A frame that may follow `state`: one of `types`, with at most `max_count` new splats."""
    return make_frame(DrawnChoices(draw), header, state, types=types, max_count=max_count)


def streams(*, max_frames: int = 5, max_count: int = 120, max_pixels: int = LEVEL1_PIXELS) -> st.SearchStrategy[Stream]:
    """Legal streams with all that the syntax allows: those of `random_stream`, drawn by Hypothesis.

    `max_count` limits the new splats of a frame. What a stream needs of the compiler is compiled before the first is
    drawn, and so is `gsvc_ref.reconstruct_stream`.
    """

    @st.composite
    def drawn(draw: st.DrawFn) -> Stream:
        return make_stream(DrawnChoices(draw), max_frames=max_frames, max_count=max_count, max_pixels=max_pixels)

    def compiled() -> st.SearchStrategy[Stream]:
        compile_streams()
        return drawn()

    return st.deferred(compiled)  # Hypothesis asks for it when a test begins, before it measures a draw


def main_streams(
    *, max_frames: int = 5, max_count: int = 120, max_pixels: int = LEVEL1_PIXELS
) -> st.SearchStrategy[Stream]:
    """Legal streams of profile `main` with all that the syntax allows: those of `random_main_stream`."""

    @st.composite
    def drawn(draw: st.DrawFn) -> Stream:
        choices = DrawnChoices(draw)
        return make_main_stream(choices, max_frames=max_frames, max_count=max_count, max_pixels=max_pixels)

    def compiled() -> st.SearchStrategy[Stream]:
        compile_main_streams()
        return drawn()

    return st.deferred(compiled)


@cache
def compile_main_streams() -> None:
    """Compile all that writes a stream of profile `main` and reconstructs its splats: once a process."""
    for seed in range(4):
        reconstruct_stream(random_main_stream(seed, max_pixels=4096).data)


@cache
def compile_streams() -> None:
    """Compile all that writes a stream and reconstructs its splats, or load it from the cache: once a process."""
    reconstruct_stream(write_stream(RICH_HEADER, rich_frames()))
