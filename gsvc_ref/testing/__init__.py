"""Material for testing implementations of GSVC: legal data as Hypothesis strategies, bounds, and streams with a fault.

For anyone who writes a decoder, an encoder or a renderer; docs/property-tests.md is a tutorial. Only the strategies
need Hypothesis: install them with ``pip install 'gsvc_ref[testing]'``.

Legal data::

    from hypothesis import given
    from gsvc_ref.testing import assert_same_splats, streams

    @given(streams())
    def test_my_decoder(stream):
        frames = my_decoder(stream.data)  # (N, 8) f4 each: x, y, l11, l21, l22, R, G, B
        assert_same_splats(frames, stream)

A stream has `data`, its bytes; `header` and `frames`, what they say; `splats`, what they stand for: what every
conforming decoder reconstructs, bit for bit.

`splat_sets`, `planes`, `headers`, `frames`, `streams` and `videos` are strategies. What matters is drawn splat by splat
and value by value, simple values first, so that a failure shrinks to the one splat that it needs, with round numbers.
Nothing is compiled while Hypothesis draws. `random_stream` makes legal streams from a seed, without Hypothesis.
`main_streams` and `random_main_stream` make streams of profile `main`.

Bounds::

    from gsvc_ref.testing import assert_within_bound, splat_sets

    @given(splat_sets(32, 24, max_count=10))
    def test_my_renderer(splats):
        sums = my_renderer(splats.to_array(), 32, 24)  # (24, 32, 3) f4
        assert_within_bound("render_sum", sums, parameters=splats, width=32, height=24)

`assert_within_bound` does so for sums, frames, gradients, losses and steps of the optimiser.

Faulty streams: `FaultyWriter` writes a stream in which chosen elements lie, everything else (lengths, checksums) being
true; `split_chunks` and `join_chunks` take a stream apart and put it together again, with checksums made right.
`overview_frames` and `rich_frames` are two small streams to begin with::

    from gsvc_ref.testing import RICH_HEADER, Lie, rich_frames, write_stream

    data = write_stream(RICH_HEADER, rich_frames(), lies=[Lie("block_reserved", 1)])
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from gsvc_ref.testing.assertions import assert_same_splats as assert_same_splats
    from gsvc_ref.testing.assertions import assert_within_bound as assert_within_bound
    from gsvc_ref.testing.examples import OVERVIEW_HEADER as OVERVIEW_HEADER
    from gsvc_ref.testing.examples import RICH_HEADER as RICH_HEADER
    from gsvc_ref.testing.examples import overview_frames as overview_frames
    from gsvc_ref.testing.examples import rich_frames as rich_frames
    from gsvc_ref.testing.faults import FaultyWriter as FaultyWriter
    from gsvc_ref.testing.faults import Liar as Liar
    from gsvc_ref.testing.faults import Lie as Lie
    from gsvc_ref.testing.faults import join_chunks as join_chunks
    from gsvc_ref.testing.faults import split_chunks as split_chunks
    from gsvc_ref.testing.faults import write_stream as write_stream
    from gsvc_ref.testing.frame_codes import frames as frames
    from gsvc_ref.testing.frame_codes import headers as headers
    from gsvc_ref.testing.frame_codes import main_streams as main_streams
    from gsvc_ref.testing.frame_codes import streams as streams
    from gsvc_ref.testing.random_main_streams import random_main_stream as random_main_stream
    from gsvc_ref.testing.random_streams import Stream as Stream
    from gsvc_ref.testing.random_streams import Wishes as Wishes
    from gsvc_ref.testing.random_streams import random_stream as random_stream
    from gsvc_ref.testing.strategies import Plane as Plane
    from gsvc_ref.testing.strategies import planes as planes
    from gsvc_ref.testing.strategies import splat_sets as splat_sets
    from gsvc_ref.testing.strategies import videos as videos

_HOMES: Final = {
    "FaultyWriter": "faults",
    "Liar": "faults",
    "Lie": "faults",
    "OVERVIEW_HEADER": "examples",
    "Plane": "strategies",
    "RICH_HEADER": "examples",
    "Stream": "random_streams",
    "Wishes": "random_streams",
    "assert_same_splats": "assertions",
    "assert_within_bound": "assertions",
    "frames": "frame_codes",
    "headers": "frame_codes",
    "join_chunks": "faults",
    "main_streams": "frame_codes",
    "overview_frames": "examples",
    "planes": "strategies",
    "random_main_stream": "random_main_streams",
    "random_stream": "random_streams",
    "rich_frames": "examples",
    "splat_sets": "strategies",
    "split_chunks": "faults",
    "streams": "frame_codes",
    "videos": "strategies",
    "write_stream": "faults",
}
"""The module of each name. It is loaded on first use: the bounds in this package need NumPy alone."""
_STRATEGIES: Final = ("frame_codes", "strategies")
"""Modules that need Hypothesis."""

__all__ = [
    "OVERVIEW_HEADER",
    "RICH_HEADER",
    "FaultyWriter",
    "Liar",
    "Lie",
    "Plane",
    "Stream",
    "Wishes",
    "assert_same_splats",
    "assert_within_bound",
    "frames",
    "headers",
    "join_chunks",
    "main_streams",
    "overview_frames",
    "planes",
    "random_main_stream",
    "random_stream",
    "rich_frames",
    "splat_sets",
    "split_chunks",
    "streams",
    "videos",
    "write_stream",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'gsvc_ref.testing' has no attribute {name!r}")
    if _HOMES[name] in _STRATEGIES:
        try:
            import_module("hypothesis")
        except ImportError as error:
            raise ImportError(f"{name} needs Hypothesis: pip install 'gsvc_ref[testing]'") from error
    return getattr(import_module(f"gsvc_ref.testing.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
