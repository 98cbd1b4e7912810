"""Splats of any trainer written as a stream.

`writing` is all of it, and `given_splats` checks the splats. `splat_coder` codes them in profile `paper`; `main_coder`
does so in profile `main`, by the codes of `main_codes`.
"""

from gsvc_tools.writing.writing import write

__all__ = ["write"]
