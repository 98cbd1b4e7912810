"""Splats of any trainer written as a stream of profile `paper`: nothing is fitted, they are only quantised.

`writing` is all of it, `given_splats` checks the splats, and `splat_coder` codes them.
"""

from gsvc_tools.writing.writing import write

__all__ = ["write"]
