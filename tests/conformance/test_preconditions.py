"""No vector asks an operation for more than the preconditions of spec.md section 4.3 allow."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import pytest

from gsvc_conformance.operation import Values, operations
from gsvc_conformance.spec import namespace
from gsvc_conformance.vectors import VECTORS, read

LEVELS: Final = namespace()["LEVELS"]
SIDES: Final = ("width", "height", "new_width", "new_height")
RANGES: Final = {
    **dict.fromkeys(SIDES, (1, 65535)),
    "bit_depth": (8, 16),
    "entropy_precision": (12, 16),
    "lane_count": (1, 64),
    "video_full_range_flag": (0, 1),
    "chroma_sample_loc_type": (0, 5),
    "alphabet": (1, 4096),
    "interval": (1, np.inf),
    "patience": (1, np.inf),
    "tolerance": (0, np.inf),
    "robust": (0, 1),
    "decay": (0, np.nextafter(1, 0)),
    "uniforms": (0, np.nextafter(1, 0)),
    "beta1": (0, np.nextafter(1, 0)),
    "beta2": (0, np.nextafter(1, 0)),
    "beta3": (0, np.nextafter(1, 0)),
    "codebook_sizes": (1, 1024),
    "level": (1, 5),
    "key_frame_interval": (0, np.inf),
    "frame_rate_numerator": (1, 2**31 - 1),
    "frame_rate_denominator": (1, 2**31 - 1),
}
"""Of inputs by name, whatever the operation."""

NOT_FINITE: Final = {
    ("render_sum", "parameters"), ("render_gradients", "parameters"), ("render_sum_deterministic", "parameters"),
    ("to_frame", "sum"), ("to_frame_deterministic", "sum"),
    *(("compact", name) for name in ("values", "m", "v", "n", "previous")),
}  # fmt: skip
"""Inputs that may have infinities or NaN."""


def finite_halves(bits: Any) -> bool:
    return bool(np.all(bits & 0x7C00 != 0x7C00))


def codes_of_blocks(given: Values) -> bool:
    used = len(given["cholesky"]) == 0 or np.all(given["scale"] >= 2.0**-126)
    rows = given["codebook_sizes"].sum() == len(given["codewords"])
    return bool(used and rows and finite_halves(given["positions"]) and finite_halves(given["codewords"]))


def of_codebooks(given: Values) -> bool:
    return bool(np.all(given["indices"] < given["codebook_sizes"]))


def planes_can_be_converted(given: Values) -> bool:
    matrix, chroma_format = given["matrix_coefficients"], given["chroma_format"]
    samples = max(int(given[name].max()) for name in ("frame", "y", "cb", "cr") if name in given)
    return (
        matrix in (0, 1, 2, 4, 5, 6, 7, 8, 9)
        and chroma_format in ((3,) if matrix == 0 else (1, 2, 3))
        and samples < 2 ** given["bit_depth"]
    )


def only_columns_are_infinite(*columns: int) -> Callable[[Values], bool]:
    def check(given: Values) -> bool:
        infinite = np.flatnonzero(np.isinf(given["parameters"]).any(axis=0)).tolist()
        return set(infinite) <= set(columns) and not np.isnan(given["parameters"]).any()

    return check


ROWS: Final[dict[str, Callable[[Values], bool]]] = {
    "encode_plane": lambda i: bool(
        len(i["symbols"]) > 0
        and i["frequencies"].sum() == 2 ** i["entropy_precision"]
        and np.all(i["frequencies"][i["symbols"]] > 0)
    ),
    "from_half": lambda i: not np.any((i["bits"] & 0x7C00 == 0x7C00) & (i["bits"] & 0x3FF != 0)),
    "to_half": lambda i: bool(np.isfinite(i["values"].astype(np.float16)).all()),
    "reconstruct_intra": codes_of_blocks,
    "reconstruct_inter": lambda i: codes_of_blocks(i) and set(np.unique(i["survivors"])) <= {0, 1},
    "render_sum": only_columns_are_infinite(2, 4),
    "render_gradients": only_columns_are_infinite(2, 4),
    "render_sum_deterministic": only_columns_are_infinite(0, 1, 2, 3, 4),
    "to_frame": lambda i: not np.isnan(i["sum"]).any(),
    "learning_rates": lambda i: bool(np.all(i["iterations"] >= 0) and 0 < i["factor"] <= 1),
    "adan_step": lambda i: bool(
        np.all(i["n"] >= 0)
        and np.all(i["steps"] >= 0)
        and i["epsilon"] > 0
        and np.all(abs(i["gradients"].astype(np.float64) * i["units"]) <= 2.0**62)
    ),
    "pruning_plan": lambda i: (
        0 <= i["fraction"] < 1 <= i["first"] <= i["last"] and min(i["splats"], i["iterations"]) >= 0
    ),
    "prune": lambda i: 0 <= i["removed"] <= len(i["weights"]),
    "compact": lambda i: bool(np.all(np.diff(i["survivors"], prepend=-1, append=len(i["steps"])) > 0)),
    "select_key_frames": lambda i: (
        len(i["losses_p"]) == len(i["losses_i"]) - 1 and min(i["window"], i["threshold"]) >= 0
    ),
    "lsq_quantize": lambda i: bool(np.all(i["scale"] > 0) and 1 <= i["bits"] <= 16),
    "lsq_gradients": lambda i: bool(np.all(i["scale"] > 0) and 1 <= i["bits"] <= 16),
    "lsq_dequantize": lambda i: bool(np.all(i["scale"] > 0)),
    "rvq_assign": lambda i: bool(max(abs(i["x"]).max(initial=0), abs(i["codebooks"]).max()) <= 65504),
    "rvq_update": lambda i: of_codebooks(i) and bool(np.all(i["counts"] >= 0) and i["smoothing"] >= 0),
    "commitment": of_codebooks,
    "planes_to_frame": planes_can_be_converted,
    "frame_to_planes": planes_can_be_converted,
    "encode_video": lambda i: (
        min(len(i["frames"]), i["splats"]) >= 1
        and int(i["frames"].max()) < 2 ** i["bit_depth"]
        and i["frames"][0, ..., 0].size <= LEVELS[i["level"]]["pixels"]
        and i["splats"] <= LEVELS[i["level"]]["splats"]
    ),
    "metrics": lambda i: i["a"].shape == i["b"].shape and max(i["a"].max(), i["b"].max()) < 2 ** i["bit_depth"],
}  # fmt: skip
"""What the row of an operation asks of its inputs."""


def problems(operation: str, given: Values) -> list[str]:
    """The inputs that break a precondition, or the operation if its row is broken."""
    broken = []
    for name, value in given.items():
        array = np.asarray(value if not isinstance(value, (bytes, str)) else 0)
        low, high = RANGES.get(name, (-np.inf, np.inf))
        finite = (operation, name) in NOT_FINITE or np.isfinite(array).all()
        if not finite or not np.all((array >= low) & (array <= high) | np.isnan(array)):
            broken.append(name)
    if operation in ROWS and not ROWS[operation](given):
        broken.append(operation)
    return broken


@pytest.mark.parametrize("operation", operations())
def test_vectors_keep_the_preconditions(operation: str) -> None:
    homes = sorted(VECTORS.glob(f"*/{operation}/*"))
    assert homes
    assert {home.name: found for home in homes if (found := problems(operation, read(home).inputs))} == {}


def test_what_breaks_a_precondition_is_seen() -> None:
    assert problems("prune", {"weights": np.array([1, np.nan], np.float32), "removed": 3}) == ["weights", "prune"]
    assert problems("rendering_work", {"parameters": np.zeros((0, 8)), "width": 0, "height": 9}) == ["width"]
