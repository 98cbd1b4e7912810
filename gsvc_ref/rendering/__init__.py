"""From splats to pixels and back to gradients (spec.md sections 9, 10.2, 10.3 and 13).

`gsvc_base.rendering` says in binary64 what a picture is, and how far a binary32 renderer may be from it.
`deterministic` says in which order operations come where every bit is fixed. `renderer`,
`sequence`, `objective` and `sampled` are what the rest of the package calls; they compute on the machine in `fast`.
`pictures` and `losses` are single operations on pictures.
"""

from gsvc_base.constants import LN_255, SMALLEST_NORMAL
from gsvc_base.rendering.bounds import exact_gradients_with_bound, render_exact_with_bound
from gsvc_ref.rendering.losses import Loss, loss
from gsvc_ref.rendering.objective import Objective
from gsvc_ref.rendering.pictures import to_frame, to_frame_deterministic
from gsvc_ref.rendering.precision import PRECISIONS, Precision
from gsvc_ref.rendering.renderer import (
    Renderer,
    covered_pixels,
    render,
    render_frame,
    render_gradients,
    render_sum,
    render_sum_deterministic,
)
from gsvc_ref.rendering.sampled import SampledObjective
from gsvc_ref.rendering.sequence import SequenceRenderer

__all__ = [
    "LN_255",
    "PRECISIONS",
    "SMALLEST_NORMAL",
    "Loss",
    "Objective",
    "Precision",
    "Renderer",
    "SampledObjective",
    "SequenceRenderer",
    "covered_pixels",
    "exact_gradients_with_bound",
    "loss",
    "render",
    "render_exact_with_bound",
    "render_frame",
    "render_gradients",
    "render_sum",
    "render_sum_deterministic",
    "to_frame",
    "to_frame_deterministic",
]
