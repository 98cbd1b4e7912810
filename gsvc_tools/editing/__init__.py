"""Streams joined and cut without decoding a splat (spec.md section 6.10).

`concatenation` makes one stream of several and `cutting` one of a part of another. Both copy chunks with `copying`,
which keeps their time stamps right with `retiming`.
"""

from gsvc_tools.editing.concatenation import concat
from gsvc_tools.editing.copying import ConcatReport
from gsvc_tools.editing.cutting import cut

__all__ = ["ConcatReport", "concat", "cut"]
