"""The syntax of the bitstream, one description for reading and writing (spec.md sections 3 to 7).

Each table of spec.md is one function that works both ways: `chunks` (6.1, 6.2, 6.7, 6.8), `header` (5, 6.3), `frames`
(6.4, 6.5), `planes` (6.6) and `rans` (7). `gsvc_ref.stream` reads and writes whole streams with them.
"""

from gsvc_ref.bitstream.coder import CATEGORIES, Element
from gsvc_ref.bitstream.crc import crc32c, parameter_checksum
from gsvc_ref.bitstream.header import LEVELS, Level, SequenceHeader, level_for

__all__ = ["CATEGORIES", "LEVELS", "Element", "Level", "SequenceHeader", "crc32c", "level_for", "parameter_checksum"]
