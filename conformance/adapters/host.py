"""The host's half of a decoder whose other half runs on an accelerator.

Parsing is sequential and full of decisions, so a GPU decoder does it on the CPU. Here the parser inside spec.md does,
and calls the back end for everything that is arithmetic on many elements.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final

from conformance import spec

Stages = dict[str, Callable[..., dict[str, Any]]]

STREAM_STAGES: Final = ("reconstruct_stream", "decode_stream", "decode_stream_deterministic")
"""What of spec.md calls the back end."""


def stream_stages(back_end: Mapping[str, Callable[..., Any]]) -> Stages:
    """The stages of whole streams, by name, with functions of a back end in the place of spec.md's own.

    Parameters
    ----------
    back_end
        By the names of spec.md: ``reconstruct_intra`` and ``reconstruct_inter``, and for pictures ``render_frame``,
        ``render_sum_deterministic`` and ``to_frame_deterministic``; they take keyword or positional arguments in the
        order of spec.md and return dicts, as the stages of these names do.
    """
    names = spec.namespace(functions=back_end)
    return {name: names[name] for name in STREAM_STAGES}
