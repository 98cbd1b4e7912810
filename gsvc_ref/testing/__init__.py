"""Material for testing implementations of GSVC: legal data as Hypothesis strategies, and streams with a fault in them.

For anyone who writes a decoder, an encoder or a renderer. Install with ``pip install 'gsvc_ref[testing]'``.

Legal data::

    from hypothesis import given
    from gsvc_ref.testing import streams

    @given(streams())
    def test_my_decoder(stream):
        assert my_decoder(stream.data) == [splats.to_array() for splats in stream.splats]

`splat_sets`, `planes`, `headers`, `frames`, `streams` and `videos` are strategies; a stream comes with its bytes and
with the splats that every conforming decoder reconstructs, bit for bit.

Faulty streams: `FaultyWriter` writes a stream in which chosen elements lie, everything else (lengths, checksums) being
true; `split_chunks` and `join_chunks` take a stream apart and put it together again, with checksums made right.
`overview_frames` and `rich_frames` are two small streams to begin with::

    data = write_stream(RICH_HEADER, rich_frames(), lies=[Lie("block_reserved", 1)])
"""

try:
    import hypothesis as _hypothesis  # noqa: F401
except ImportError as error:
    raise ImportError("gsvc_ref.testing needs Hypothesis: pip install 'gsvc_ref[testing]'") from error

from gsvc_ref.testing.examples import OVERVIEW_HEADER, RICH_HEADER, overview_frames, rich_frames
from gsvc_ref.testing.faults import FaultyWriter, Liar, Lie, join_chunks, split_chunks, write_stream
from gsvc_ref.testing.frame_codes import Stream, frames, headers, streams
from gsvc_ref.testing.strategies import Plane, planes, splat_sets, videos

__all__ = [
    "OVERVIEW_HEADER",
    "RICH_HEADER",
    "FaultyWriter",
    "Liar",
    "Lie",
    "Plane",
    "Stream",
    "frames",
    "headers",
    "join_chunks",
    "overview_frames",
    "planes",
    "rich_frames",
    "splat_sets",
    "split_chunks",
    "streams",
    "videos",
    "write_stream",
]
