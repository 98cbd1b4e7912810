"""Public implementations, each rebuilt from a description of what it does otherwise, and gradients as autograd code gives them.

Real code departs from the specification in several ways at once. `right` has any of them: to name one rightly is right.
"""

import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from gsvc_conformance import spec
from gsvc_conformance.implementations import load_module
from planted import CONFORMS, Planted

F = np.float32
NAMES = spec.namespace()
LN_255 = NAMES["LN_255"]


NEVER = "(?!)"
"""No place is near: with several departures, where errors are says little."""


def implementation(name, right, functions, near=NEVER, area="implementations", known="peers") -> Planted:
    """One whose renderer, or gradients of it, is asked the vectors of tier core alone, as in the first trials."""
    tier = "core" if any(operation.startswith("render_") for operation in functions) else ""
    return Planted(name, area, tuple(functions), right, lambda: functions, known, near, tier=tier)


def centres(size):
    return np.arange(size, dtype=F) + F(0.5)


def both_ends(size):
    return np.linspace(0, size, size, dtype=F)


def scale_and_angle(parameters):
    """Scales (N, 2) and angle (N,) of Cholesky factors."""
    factors = np.zeros((len(parameters), 2, 2))
    factors[:, 0, 0], factors[:, 1, 0], factors[:, 1, 1] = parameters[:, 2:5].T
    axes, scales, _ = np.linalg.svd(factors)
    return scales, np.arctan2(axes[:, 1, 0], axes[:, 0, 0])


def drawn(parameters):
    """The splats that a careful caller hands on."""
    sizes = parameters[:, [2, 4]]
    return parameters[
        np.all((sizes >= 2.0**-126) & np.isfinite(sizes), axis=1) & np.all(np.isfinite(parameters), axis=1)
    ]


def tiny(parameters, width, height, grid):
    """A sum of splats of scale and angle, whose scales are at least 1e-3; nothing is cut off."""
    splats = drawn(parameters)
    columns, rows = grid(width), grid(height)[:, None]
    total = np.zeros((height, width, 3), F)
    for (x, y, _, _, _, *color), scales, angle in zip(splats, *scale_and_angle(splats), strict=True):
        cos, sin = F(np.cos(angle)), F(np.sin(angle))
        s1, s2 = np.maximum(scales, 1e-3).astype(F)
        u, v = (cos * (columns - x) + sin * (rows - y)) / s1, (cos * (rows - y) - sin * (columns - x)) / s2
        total += np.exp(-(u * u + v * v) / F(2))[..., None] * np.array(color, F)
    return {"sum": total}


def lamco(parameters, width, height, over):
    """Integer centres, an exponent held at -50, a picture held in 0..1."""
    columns, rows = np.arange(width, dtype=F), np.arange(height, dtype=F)[:, None]
    total, left = np.zeros((height, width, 3), F), np.ones((height, width, 1), F)
    for x, y, l11, l21, l22, *color in drawn(parameters):
        u = (columns - x) / l11
        v = (rows - y - l21 * u) / l22
        weights = np.exp(np.maximum(-(u * u + v * v) / F(2), F(-50)))[..., None]
        total += left * weights * np.array(color, F)
        left = left * (1 - weights) if over else left
    return {"sum": np.clip(total, 0, 1)}


def moved_kernel(parameters, width, height, by_determinant):
    """A kernel on [-5, 5], x along its rows, that grid_sample with align_corners moves to its place; held in 0..1."""
    side = max(3, min(width, height) - 1 | 1)
    unit = 10 / (side - 1)  # of the kernel, in pixels
    axis = np.linspace(-5, 5, side)
    total = np.zeros((height, width, 3))
    for x, y, l11, l21, l22, *color in drawn(parameters).astype(np.float64):
        factor = np.array([[l11, 0], [l21, l22]]) * unit
        covariance = factor @ factor.T
        determinant = max(np.linalg.det(covariance), 1e-12)
        (a, b), (_, c) = np.array([[covariance[1, 1], -covariance[0, 1]], [0, covariance[0, 0]]]) / determinant
        along, across = axis[:, None], axis[None, :]
        kernel = np.exp(-(a * along * along + 2 * b * along * across + c * across * across) / 2)
        kernel = kernel / max(kernel.max(), 1e-30) * (np.exp(-determinant) if by_determinant else 1)
        padded = np.zeros((height, width))
        top, left = (height - side) // 2, (width - side) // 2
        rows, columns = slice(max(top, 0), top + side), slice(max(left, 0), left + side)
        padded[rows, columns] = kernel[max(-top, 0) :, max(-left, 0) :][: height - max(top, 0), : width - max(left, 0)]
        shift_x, shift_y = ((2 * place / size - 1) * (size - 1) / 2 for place, size in ((x, width), (y, height)))
        total += between_samples(padded, shift_x, shift_y)[..., None] * np.array(color)
    return {"sum": np.clip(total, 0, 1).astype(F)}


def between_samples(picture, shift_x, shift_y):
    """A picture moved by a part of a pixel, linear between samples, zero outside."""
    height, width = picture.shape
    x, y = np.clip(np.arange(width) - shift_x, -2, width + 1), np.clip(np.arange(height) - shift_y, -2, height + 1)
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    f, h = x - i, (y - j)[:, None]
    framed = np.pad(picture, 3)
    at = lambda dy, dx: framed[(j + dy + 3)[:, None], (i + dx + 3)[None, :]]  # noqa: E731
    return (1 - h) * ((1 - f) * at(0, 0) + f * at(0, 1)) + h * ((1 - f) * at(1, 0) + f * at(1, 1))


TILE = 16


def gsplat_of_tiles(parameters, width, height):
    """Blended front to back with weights of at most 0.999 and an inverse in binary32; an empty tile is an error."""
    tiles = np.zeros((-(-height // TILE), -(-width // TILE)), bool)
    columns, rows = centres(width), centres(height)[:, None]
    total, left, open_ = np.zeros((height, width, 3), F), np.ones((height, width), F), np.ones((height, width), bool)
    for x, y, l11, l21, l22, *color in drawn(parameters):
        a, b, c = l11 * l11, l11 * l21, l21 * l21 + l22 * l22
        determinant = a * c - b * b
        if determinant == 0:
            continue
        radius = np.ceil(3 * np.sqrt(max((a + c) / 2 + np.sqrt(max(F(0.1), (a + c) ** 2 / 4 - determinant)), F(0))))
        first_x, first_y = max(0, int((x - radius) // TILE)), max(0, int((y - radius) // TILE))
        tiles[first_y : max(0, int((y + radius) // TILE + 1)), first_x : max(0, int((x + radius) // TILE + 1))] = True
        dx, dy = columns - x, rows - y
        sigma = F(0.5) * (c / determinant * dx * dx + a / determinant * dy * dy) - b / determinant * dx * dy
        alpha = np.minimum(F(0.999), np.exp(-sigma))
        seen = open_ & (sigma >= 0) & (alpha >= F(1 / 255))
        open_ &= ~(seen & (left * (1 - alpha) <= F(1e-4)))
        seen &= open_
        total += np.where(seen, alpha * left, F(0))[..., None] * np.array(color, F)
        left = np.where(seen, left * (1 - alpha), left)
    if not tiles.all():
        raise UnboundLocalError("local variable 'idx' referenced before assignment")
    return {"sum": total}


def adan_of_one_step(steps, **inputs):
    """An optimizer that counts the steps of all splats together."""
    if len(np.unique(steps)) > 1:
        raise NotImplementedError("one count of steps for all splats")
    return NAMES["adan_step"](steps=steps, **inputs)


def straight_through(x, scale, offset, bits, grad_output):
    """LSQ by autograd with a straight-through rounding: the gradient of x comes as (g s) / s."""
    if len(x) == 0:
        raise ZeroDivisionError("float division by zero")
    largest = F(2**bits - 1)
    ratio = (x - offset) / scale
    inside = (ratio >= 0) & (ratio <= largest)
    codes = np.rint(np.clip(ratio, 0, largest))
    of_ratio = np.where(inside, grad_output * scale, F(0)) / scale
    exact = [part.astype(np.float64) for part in (grad_output, codes, of_ratio, ratio)]
    return {
        "grad_x": of_ratio,
        "grad_scale": (exact[0] * exact[1] - exact[2] * exact[3]).sum(0).astype(F),
        "grad_offset": (exact[0] - exact[2]).sum(0).astype(F),
    }


def loss_through_clamp(picture, target, channels):
    """The loss by autograd through clamp, over so many channels: its gradient is 0 outside of [0, 1] and 1 at both ends."""
    right = NAMES["loss"](picture, target)
    inside = (picture >= 0) & (picture <= 1)
    return {"loss": right["loss"] / channels, "residual": np.where(inside, right["residual"], F(0)) / F(channels)}


def metrics_of_zeros(a, b, bit_depth):
    """MS-SSIM of five scales, with zeros around odd sides before they are halved."""
    if min(a.shape[:2]) <= 160:
        raise NotImplementedError("image size should be larger than 160")
    names = spec.namespace(
        ((
            '    even = np.pad(plane, ((0, height % 2), (0, width % 2)), mode="edge")\n',
            "    even = np.pad(plane, ((height % 2, height % 2), (width % 2, width % 2)))\n"
            "    even = even[: len(even) // 2 * 2, : even.shape[1] // 2 * 2]\n",
        ),)
    )  # fmt: skip
    return names["metrics"](a, b, bit_depth)


def planes_of_one_siting(matrix_coefficients, bit_depth, **inputs):
    """Chroma samples in the middle of the pixels that share them, whatever the stream says, and rounded between them."""
    if bit_depth != 8 or matrix_coefficients not in (1, 5, 6, 7):
        raise NotImplementedError("not a format of this converter")
    own = {"matrix_coefficients": matrix_coefficients, "bit_depth": bit_depth, "chroma_sample_loc_type": 1}
    rounded = (
        "        planes.append(sixteenths / 16 - zero)\n",
        "        planes.append(np.rint(sixteenths / 16) - zero)\n",
    )
    return spec.namespace((rounded,))["planes_to_frame"](**{**inputs, **own})


def no_device():
    """The functions of a module that builds a CUDA extension when it is imported."""
    with tempfile.TemporaryDirectory() as folder:
        message = "CUDA_HOME environment variable is not set. Please set it to your CUDA install root."
        Path(folder, "taichi_rasterizer.py").write_text(f"raise OSError({message!r})\n", encoding="utf-8")
        try:
            return load_module("taichi_rasterizer", Path(folder)).functions
        finally:
            sys.path.remove(folder)


GRID = "linspace|align_corners|both ends|ends included"
NO_CUT = "no cut"
INTEGER = "integer"
CLIPPED = "clamped|clipped"
BLENDED = "blended"
MOVED = f"{CLIPPED}|{GRID}|transposed|rows and columns|x and y exchanged|along rows|interpolat|kernel"

IMPLEMENTATIONS = (
    implementation("tiny", f"{GRID}|{NO_CUT}", {"render_sum": partial(tiny, grid=both_ends)}),
    implementation("tiny, its grid mended", NO_CUT, {"render_sum": partial(tiny, grid=centres)}),
    implementation("lamco", f"{INTEGER}|{NO_CUT}|{CLIPPED}", {"render_sum": partial(lamco, over=False)}),
    implementation("lamco, over", f"{INTEGER}|{NO_CUT}|{CLIPPED}|{BLENDED}", {"render_sum": partial(lamco, over=True)}),
    implementation("OutofAi", MOVED, {"render_sum": partial(moved_kernel, by_determinant=False)}),
    implementation("zfyre", MOVED, {"render_sum": partial(moved_kernel, by_determinant=True)}),
    implementation("gsplat 0.1", rf"{BLENDED}|0?\.999", {"render_sum": gsplat_of_tiles}),
    implementation("Adan", CONFORMS, {"adan_step": adan_of_one_step}),
    implementation("quantize", r"\(g s\) ?/ ?s|(?i:straight-through)",
        {"lsq_quantize": NAMES["lsq_quantize"], "lsq_dequantize": NAMES["lsq_dequantize"], "lsq_gradients": straight_through}),
    implementation("loss_fn", r"(?i)averages the three channels|a third|3 ?H ?W|clamp", {"loss": partial(loss_through_clamp, channels=3)}),
    implementation("pytorch_msssim", r"(?i)odd|zeros? (around|before|pad)|padd", {"metrics": metrics_of_zeros}),
    implementation("swscale", "siting|sited|chroma_sample_loc_type|round.*(chroma|between|whole)|chroma.*round", {"planes_to_frame": planes_of_one_siting}),
    Planted("taichi-splatting", "implementations", ("render_sum",), "CUDA_HOME", no_device, "peers"),
)  # fmt: skip


def gradients_by(parameters, residual, mistake):
    """Gradients by way of conic and covariance, with one mistake."""
    height, width = residual.shape[:2]
    columns, rows = np.arange(width) + 0.5, np.arange(height)[:, None] + 0.5
    found = np.zeros(parameters.shape)
    for g, (x, y, l11, l21, l22, *color) in zip(found, parameters.astype(np.float64), strict=True):
        if not (2.0**-126 <= l11 < np.inf and 2.0**-126 <= l22 < np.inf):
            continue
        u = (columns - x) / l11
        v = (rows - y - l21 * u) / l22
        sigma = (u * u + v * v) / 2
        covered = sigma <= LN_255
        weights = np.where(covered, np.exp(-sigma), 0)
        dx, dy = np.where(covered, columns - x, 0), np.where(covered, rows - y, 0)
        q = weights * (residual @ np.array(color))
        factor = np.array([[l11, 0], [l21, l22]])
        inverse = np.array([[1 / l11, 0], [-l21 / l11 / l22, 1 / l22]])
        conic = inverse.T @ inverse
        of_conic = -np.array([(q * dx * dx).sum() / 2, (q * dx * dy).sum(), (q * dy * dy).sum() / 2])
        a, b, c = of_conic * ((1, 0.5, 1) if mistake == "conic" else 1)
        off = b if mistake == "covariance" else b / 2
        of_covariance = -conic @ np.array([[a, off], [off, c]]) @ conic
        if mistake == "scales":
            axes = np.linalg.svd(factor)[0]
            of_covariance = axes @ ((axes.T @ of_covariance @ axes) * np.array([[0.5, 1], [1, 0.5]])) @ axes.T
        of_factor = 2 * of_covariance @ factor
        if mistake == "factor":
            of_factor -= np.array([[of_covariance[0, 1] * l21, 0], [of_covariance[0, 1] * l11, 0]])
        of_x, of_y = ((q * (row[0] * dx + row[1] * dy)).sum() for row in conic)
        g[:] = [
            of_x,
            of_y,
            of_factor[0, 0],
            of_factor[1, 0],
            of_factor[1, 1],
            *(weights[..., None] * residual).sum((0, 1)),
        ]
    return {"gradients": np.nan_to_num(found).astype(F)}


HALF = "1/2|half|halved|twice|doubled|factor|off-diagonal"
OFF_DIAGONAL = rf"(conic|covariance).*({HALF})|({HALF}).*(conic|covariance)|off-diagonal"


def autograd(name, right, near, operation, function) -> Planted:
    return implementation(name, right, {operation: function}, near, "autograd", "autograd")


def by_way_of(name, right, mistake) -> Planted:
    return autograd(name, right, "l11|l21|l22", "render_gradients", partial(gradients_by, mistake=mistake))


AUTOGRAD = (
    autograd("clamp", "clamp.*(gradient|subgradient|residual|ends|autograd)|subgradient|autograd", "residual", "loss", partial(loss_through_clamp, channels=1)),
    autograd("straight-through", r"\(g s\) ?/ ?s|straight-through", "grad_x", "lsq_gradients", straight_through),
    by_way_of("conic", OFF_DIAGONAL, "conic"),
    by_way_of("covariance", OFF_DIAGONAL, "covariance"),
    by_way_of("covariance to factor", OFF_DIAGONAL, "factor"),
    by_way_of("scale and angle", r"\bscales?\b|angle|axes|eigen", "scales"),
)  # fmt: skip

PLANTED = (*IMPLEMENTATIONS, *AUTOGRAD)
