"""From splats to pixels and back to gradients.

`definition` says in binary64 what a picture is, `bounds` how far a binary32 renderer may be from it, and the other
modules compute it fast: `lists` sorts the splats into column `strips`, `strip_sums` holds the inner loops, `tasks`
shares them among threads, and `renderer` and `objective` are what the rest of the package calls.
"""

from gsvc_ref.constants import LN_255, SMALLEST_NORMAL
from gsvc_ref.rendering.bounds import exact_gradients_with_bound, render_exact_with_bound
from gsvc_ref.rendering.losses import Loss, loss
from gsvc_ref.rendering.objective import Objective
from gsvc_ref.rendering.pictures import to_frame, to_frame_deterministic
from gsvc_ref.rendering.precision import PRECISIONS, Precision
from gsvc_ref.rendering.renderer import (
    Renderer,
    SequenceRenderer,
    covered_pixels,
    render,
    render_frame,
    render_gradients,
    render_sum,
)

__all__ = [
    "LN_255",
    "PRECISIONS",
    "SMALLEST_NORMAL",
    "Loss",
    "Objective",
    "Precision",
    "Renderer",
    "SequenceRenderer",
    "covered_pixels",
    "exact_gradients_with_bound",
    "loss",
    "render",
    "render_exact_with_bound",
    "render_frame",
    "render_gradients",
    "render_sum",
    "to_frame",
    "to_frame_deterministic",
]
