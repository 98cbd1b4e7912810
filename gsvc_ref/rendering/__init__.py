"""From splats to pixels and back to gradients (spec.md sections 9, 10.2, 10.3 and 13).

`gsvc_base.rendering` says in binary64 what a picture is, and how far a binary32 renderer may be from it.
`deterministic` says in which order operations come where every bit is fixed. `renderer`,
`sequence`, `objective` and `sampled` are what the rest of the package calls; they compute on the machine in `fast`, the
last two on any device that has an `Evaluator`.
`pictures` and `losses` are single operations on pictures.
"""

from gsvc_base.constants import LN_255 as LN_255
from gsvc_base.constants import SMALLEST_NORMAL as SMALLEST_NORMAL
from gsvc_base.rendering.bounds import exact_gradients_with_bound as exact_gradients_with_bound
from gsvc_base.rendering.bounds import render_exact_with_bound as render_exact_with_bound
from gsvc_ref.rendering.evaluator import Evaluator as Evaluator
from gsvc_ref.rendering.losses import Loss as Loss
from gsvc_ref.rendering.losses import loss as loss
from gsvc_ref.rendering.objective import Objective as Objective
from gsvc_ref.rendering.pictures import to_frame as to_frame
from gsvc_ref.rendering.pictures import to_frame_deterministic as to_frame_deterministic
from gsvc_ref.rendering.precision import PRECISIONS as PRECISIONS
from gsvc_ref.rendering.precision import Precision as Precision
from gsvc_ref.rendering.renderer import Renderer as Renderer
from gsvc_ref.rendering.renderer import covered_pixels as covered_pixels
from gsvc_ref.rendering.renderer import render as render
from gsvc_ref.rendering.renderer import render_frame as render_frame
from gsvc_ref.rendering.renderer import render_gradients as render_gradients
from gsvc_ref.rendering.renderer import render_sum as render_sum
from gsvc_ref.rendering.renderer import render_sum_deterministic as render_sum_deterministic
from gsvc_ref.rendering.sampled import SampledObjective as SampledObjective
from gsvc_ref.rendering.sequence import SequenceRenderer as SequenceRenderer
