"""3D Gaussians as gsplat and 3DGS write them to 2D splats and back: a plane z = 0 that is looked at along z.

A Gaussian has the centre (x, y, z), the covariance R diag(exp(scale))^2 R^T with the rotation R of a quaternion
(w, x, y, z), the colour 0.5 + 0.28209479177387814 f_dc with a part `f_rest` that depends on the direction of view, and
the opacity sigmoid(opacity). Its 2D splat has the centre (x, y), the upper left 2 x 2 part of the covariance, and the
colour times the opacity. 2D Gaussian splatting has no `scale_2`, which is then 0 along its normal; a logarithm of -inf
is an extent of 0, and an opacity of -inf or inf is 0 or 1.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8
from gsvc_base.constants import SMALLEST_NORMAL
from gsvc_base.errors import GsvcError

SH_C0: Final = 0.28209479177387814
"""The spherical harmonic of degree 0, 1 / (2 sqrt(pi))."""

FLAT: Final = 1e-6
"""The standard deviation of a 2D splat along z, in pixels."""

OPACITIES: Final = (1 / 255, 0.99)
"""The range of opacities that are written: viewers leave out what is fainter, and cap what is more."""

NEEDED: Final = (
    "x", "y", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "rot_0", "rot_1", "rot_2", "rot_3",
)  # fmt: skip
THIRD: Final = "scale_2"
"""May be missing, as in files of 2D Gaussian splatting, whose splats have no third extent."""
LOGARITHMS: Final = ("scale_0", "scale_1", THIRD)
"""May be -inf: an extent of 0."""
UNUSED: Final = ("nx", "ny", "nz")
"""Properties that 3DGS writes as zeros."""


class Flattened(NamedTuple):
    """2D splats, and what they lack of the Gaussians."""

    parameters: F8
    """(N, 8) f8 in the columns of `Splats.to_array`."""
    lost: list[str]
    """A sentence for each thing that is lost."""


def from_gaussians(
    columns: dict[str, NDArray[Any]],
    name: str = "the Gaussians",
    *,
    pixels_per_unit: float = 1.0,
    origin: tuple[float, float] = (0.0, 0.0),
) -> Flattened:
    """The 2D splats of Gaussians in columns as `read_ply` gives them: x, y, f_dc_*, opacity, scale_* and rot_*.

    A point (x, y) of the file is (x - origin[0], y - origin[1]) * pixels_per_unit in pixels. A GsvcError says, of what
    is called `name`, which property is missing or not finite.
    """
    if missing := [column for column in NEEDED if column not in columns]:
        raise GsvcError(
            "invalid", f"{name} has no property {missing[0]}; it must have {', '.join(NEEDED)}, as gsplat writes them"
        )
    used = {key: np.asarray(columns[key], np.float64) for key in NEEDED}
    used[THIRD] = np.asarray(columns.get(THIRD, np.full(len(used["x"]), -np.inf)), np.float64)
    for key, values in used.items():
        if (wrong := _wrong(key, values)).any():
            splat = int(np.flatnonzero(wrong)[0])
            what = "a number, or -inf for no extent" if key in LOGARITHMS else "a finite number"
            what = "a number, -inf or inf" if key == "opacity" else what
            raise GsvcError("invalid", f"{name}, splat {splat}: {key} is {values[splat]}; it must be {what}")
    stacked = {key: _stack(used, key, count) for key, count in (("f_dc_", 3), ("scale_", 3), ("rot_", 4))}
    color = 0.5 + SH_C0 * stacked["f_dc_"]
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        opacity = 1 / (1 + np.exp(-used["opacity"]))
        factor = _rotation(stacked["rot_"], name)[:, :2] * np.exp(stacked["scale_"])[:, None] * pixels_per_unit
        position = (np.stack([used["x"], used["y"]], axis=1) - origin) * pixels_per_unit
        parameters = np.concatenate([position, _cholesky(factor), color * opacity[:, None]], axis=1)
    if not np.isfinite(parameters).all():
        splat = int(np.argwhere(~np.isfinite(parameters))[0, 0])
        raise GsvcError("invalid", f"{name}, splat {splat}: its position or size is beyond all numbers in pixels")
    return Flattened(parameters, _lost(columns, color))


def to_gaussians(
    parameters: F4, *, pixels_per_unit: float = 1.0, origin: tuple[float, float] = (0.0, 0.0)
) -> dict[str, F8]:
    """The properties of the Gaussians that 2D splats (N, 8) f4 are, in the order in which 3DGS writes them.

    None of the splats may be degenerate (R-9.1-2). The opacity is the largest magnitude of R, G and B within OPACITIES,
    and the colour is divided by it, so that their product is the colour of the splat.
    """
    values = parameters.astype(np.float64)
    count = len(values)
    L = np.zeros((count, 2, 2))
    L[:, 0, 0], L[:, 1, 0], L[:, 1, 1] = values[:, 2:5].T
    axes, sizes, _ = np.linalg.svd(L)  # L L^T = axes diag(sizes)^2 axes^T
    angle = np.arctan2(axes[:, 1, 0], axes[:, 0, 0])
    opacity = np.clip(np.abs(values[:, 5:8]).max(axis=1, initial=0), *OPACITIES)
    f_dc = (values[:, 5:8] / opacity[:, None] - 0.5) / SH_C0
    sizes = np.maximum(sizes, SMALLEST_NORMAL) / pixels_per_unit
    zeros = np.zeros(count)
    return {
        "x": values[:, 0] / pixels_per_unit + origin[0],
        "y": values[:, 1] / pixels_per_unit + origin[1],
        "z": zeros, "nx": zeros, "ny": zeros, "nz": zeros,
        "f_dc_0": f_dc[:, 0], "f_dc_1": f_dc[:, 1], "f_dc_2": f_dc[:, 2],
        "opacity": np.log(opacity / (1 - opacity)),
        "scale_0": np.log(sizes[:, 0]), "scale_1": np.log(sizes[:, 1]),
        "scale_2": np.full(count, np.log(FLAT / pixels_per_unit)),
        "rot_0": np.cos(angle / 2), "rot_1": zeros, "rot_2": zeros, "rot_3": np.sin(angle / 2),
    }  # fmt: skip


def _wrong(key: str, values: F8) -> NDArray[np.bool_]:
    """Which values of a property are no numbers that it can have, (N,): a logarithm and a logit have limits."""
    if key == "opacity":
        return np.isnan(values)
    return np.asarray(~(np.isfinite(values) | (np.isneginf(values) & (key in LOGARITHMS))))


def _stack(columns: dict[str, F8], prefix: str, count: int) -> F8:
    return np.stack([columns[f"{prefix}{i}"] for i in range(count)], axis=1)


def _rotation(quaternions: F8, name: str) -> F8:
    """The rotation matrices (N, 3, 3) of quaternions (w, x, y, z), of any length but 0."""
    length = np.linalg.norm(quaternions, axis=1, keepdims=True)
    if not length.all():
        splat = int(np.flatnonzero(length[:, 0] == 0)[0])
        raise GsvcError("invalid", f"{name}, splat {splat}: the quaternion rot_0 to rot_3 is 0; it must be a rotation")
    w, x, y, z = (quaternions / length).T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows).reshape(3, 3, -1), -1, 0)


def _cholesky(factor: F8) -> F8:
    """l11, l21, l22 (N, 3) of M M^T for each M of (N, 2, 3): by rotating M, which cancels nothing as M M^T does."""
    first, second = factor[:, 0], factor[:, 1]
    l11 = np.linalg.norm(first, axis=1)
    along = first / np.maximum(l11, SMALLEST_NORMAL)[:, None]
    l21 = (along * second).sum(axis=1)
    l22 = np.linalg.norm(second - l21[:, None] * along, axis=1)
    return np.stack([l11, l21, l22], axis=1)


def _lost(columns: dict[str, NDArray[Any]], color: F8) -> list[str]:
    """What 2D splats lack of these Gaussians."""
    lost = []
    rest = [key for key in columns if key.startswith("f_rest_") and np.any(columns[key])]
    if rest:
        lost.append(f"the dependence of colours on the view: {len(rest)} coefficients f_rest_* are left out")
    lost.append(
        "what hides what: opacity is multiplied into the colour, and splats are added up where 3D Gaussians are "
        "blended from front to back"
    )
    lost.append(
        "depth: z, and the extent along it, are left out; splats are those of a view along z without perspective"
    )
    if (color < 0).any():
        lost.append("the clamp of colours at 0: those below it are kept, and take light away")
    known = {*NEEDED, *UNUSED, THIRD, "z"}
    if unknown := [key for key in columns if key not in known and not key.startswith("f_rest_")]:
        lost.append(f"unknown properties: {', '.join(key[:40] for key in unknown[:8])}")
    return lost
