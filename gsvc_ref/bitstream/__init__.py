"""The bitstream: bytes and syntax, one description for reading and writing (spec.md sections 3 to 7, 10).

`StreamReader` and `StreamWriter` are the doors. Behind them, each table of spec.md is one function that works both
ways: `chunks` (6.1, 6.2, 6.7, 6.8), `header` (5, 6.3), `frames` (6.4, 6.5), `planes` (6.6) and `rans` (7).
"""

from gsvc_ref.bitstream.coder import CATEGORIES, Element
from gsvc_ref.bitstream.crc import crc32c, parameter_checksum
from gsvc_ref.bitstream.decoded import DecodedFrame, FrameSummary, Gap, StreamSummary
from gsvc_ref.bitstream.header import LEVELS, Level, SequenceHeader, level_for
from gsvc_ref.bitstream.reader import StreamReader
from gsvc_ref.bitstream.writer import StreamWriter

__all__ = [
    "CATEGORIES",
    "LEVELS",
    "DecodedFrame",
    "Element",
    "FrameSummary",
    "Gap",
    "Level",
    "SequenceHeader",
    "StreamReader",
    "StreamSummary",
    "StreamWriter",
    "crc32c",
    "level_for",
    "parameter_checksum",
]
