"""Streams: bytes in and frames out, and back (spec.md sections 6 and 12).

In reading order: `source` has the bytes of a file or a pipe, `chunk_decoder` decodes one chunk after the other, and
`reader` leads it through a stream, with `seeking` from any frame on, with `salvage` through what damage has left, whose
`whole_chunks` it finds. The results are in `decoded`. `decoder` renders pictures of them, with the video's format from
`formats`, and `whole_streams` gives all codes, splats or frames of a stream at once. `writer` is the way back.
"""

from gsvc_ref._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
