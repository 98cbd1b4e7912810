"""The adapter of the authors' rasteriser over its double, as a module for the kit: what a GPU should give, without one.

PYTHONPATH=tests/adapters gsvc-conformance run --module gsplat_predicted
"""

import gsplat_double
import pytest

_FUNCTIONS = gsplat_double.adapter(pytest.MonkeyPatch(), fused=True).functions  # as nvcc does

render_sum = _FUNCTIONS["render_sum"]
render_frame = _FUNCTIONS["render_frame"]
render_gradients = _FUNCTIONS["render_gradients"]


def environment() -> dict[str, str]:
    """What takes the place of a device."""
    return {"device": "none: a prediction, by a double of the rasteriser"}
