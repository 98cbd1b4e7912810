"""gsvc_ref: the readable CPU reference of GSVC, video as sums of 2D Gaussian splats.

    import gsvc_ref

    report = gsvc_ref.encode("clip.y4m", "clip.gsvc")           # or a VideoReader, or frames and their VideoFormat
    for frame in gsvc_ref.decode("clip.gsvc"):                  # (H, W, 3) u1, one at a time
        ...
    with gsvc_ref.open("clip.gsvc") as stream:
        for frame in stream.frames(30, 60):                     # starts decoding at the nearest I-frame
            frame.splats.positions, frame.bits
    for frame in gsvc_ref.decode("damaged.gsvc", on_gap=print): # all that is left, and what is missing
        ...

spec.md says what the bytes mean, `spec` is the code in it, and `bitstream`, `stream`, `reconstruction`, `rendering` and
`quantization` do what it says; `training` has the paper's algorithms, `encoder` leads them from frame to frame, and
`testing` has Hypothesis strategies for those who test an implementation of their own.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from gsvc_ref.encoder import IncompleteEncodeError as IncompleteEncodeError
    from gsvc_ref.encoder import Settings as Settings
    from gsvc_ref.encoder import encode as encode
    from gsvc_ref.errors import GsvcError as GsvcError
    from gsvc_ref.errors import UsageError as UsageError
    from gsvc_ref.rendering import render as render
    from gsvc_ref.rendering import render_exact_with_bound as render_exact_with_bound
    from gsvc_ref.rendering import render_gradients as render_gradients
    from gsvc_ref.splats import Splats as Splats
    from gsvc_ref.stream import Gap as Gap
    from gsvc_ref.stream import Stream as open  # noqa: N813
    from gsvc_ref.stream import decode as decode

__version__ = "0.1.0"

_HOMES: Final = {
    "Gap": ("gsvc_ref.stream", "Gap"),
    "GsvcError": ("gsvc_ref.errors", "GsvcError"),
    "IncompleteEncodeError": ("gsvc_ref.encoder", "IncompleteEncodeError"),
    "Settings": ("gsvc_ref.encoder", "Settings"),
    "Splats": ("gsvc_ref.splats", "Splats"),
    "UsageError": ("gsvc_ref.errors", "UsageError"),
    "decode": ("gsvc_ref.stream", "decode"),
    "encode": ("gsvc_ref.encoder", "encode"),
    "open": ("gsvc_ref.stream", "Stream"),
    "render": ("gsvc_ref.rendering", "render"),
    "render_exact_with_bound": ("gsvc_ref.rendering", "render_exact_with_bound"),
    "render_gradients": ("gsvc_ref.rendering", "render_gradients"),
}
"""Where each public name lives. They are loaded on first use, so that `gsvc --help` does not wait for the compiler."""

__all__ = [
    "Gap",
    "GsvcError",
    "IncompleteEncodeError",
    "Settings",
    "Splats",
    "UsageError",
    "decode",
    "encode",
    "open",
    "render",
    "render_exact_with_bound",
    "render_gradients",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'gsvc_ref' has no attribute {name!r}")
    module, attribute = _HOMES[name]
    value = globals()[name] = getattr(import_module(module), attribute)
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
