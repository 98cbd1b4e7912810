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

from typing import Any

from gsvc_ref._lazy import lazily

_loaded, __dir__, __all__ = lazily(__name__)


def __getattr__(name: str) -> Any:
    try:
        return _loaded(name)
    except ModuleNotFoundError as error:
        if error.name == "hypothesis":
            raise ImportError(f"{name} needs Hypothesis: pip install 'gsvc_ref[testing]'") from error
        raise
