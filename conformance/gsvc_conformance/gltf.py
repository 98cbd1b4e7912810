"""Render vectors as glTF files with KHR_gaussian_splatting: docs/gltf.md says what maps and what does not.

A splat of GSVC is a Gaussian of the plane. In a glTF file it is one of space that is seen by an orthographic camera of
one unit a pixel: y points up there, so that (x, y) becomes (x, -y, 0), exactly; the Cholesky factor becomes a rotation
about z and two scales; the colour the coefficient of degree 0, with opacity 1.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.constants import LN_255
from gsvc_base.errors import UsageError
from gsvc_base.rendering.bounds import error_footprints
from gsvc_base.rendering.error_models import EPS
from gsvc_conformance.expectations import Bounded, Interval
from gsvc_conformance.report.png import png
from gsvc_conformance.vector import Vector, npy

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

EXTENSION: Final = "KHR_gaussian_splatting"
OPERATIONS: Final = ("render_sum", "render_frame")
SH_0: Final = 0.28209479177387814
"""The spherical harmonic of degree 0, 1 / (2 sqrt(pi)); a colour is SH_0 times its coefficient, plus 1/2."""
SMALLEST_NORMAL: Final = 2.0**-126
MAX_CHANGE: Final = 1e-5
"""Maximum change of a pixel by storing splats in binary32 as glTF has them, as a fraction of white or, if it is more,
of the largest colour; a vector with more is left out."""
MAX_WORK: Final = 1 << 27
"""Maximum number of pairs of splats and pixels of a vector; one with more is left out."""
FLOAT: Final = 5126
ARRAY_BUFFER: Final = 34962
CHECKER: Final = Path(__file__).with_name("compare_pictures.py")


@dataclass(frozen=True, eq=False)
class Stored:
    """Splats as a glTF file has them, each array f4 with a row for each.

    Attributes
    ----------
    position
        (N, 3): x, -y, 0.
    rotation
        (N, 4), unit quaternions x, y, z, w, about z.
    scale
        (N, 3), standard deviations in pixels; that along z, which no picture shows, is the smaller of the others.
    opacity
        (N, 1), all 1.
    coefficient
        (N, 3), of the spherical harmonic of degree 0.
    """

    position: F4
    rotation: F4
    scale: F4
    opacity: F4
    coefficient: F4


ATTRIBUTES: Final = {
    "position": ("POSITION", "VEC3"),
    "rotation": (f"{EXTENSION}:ROTATION", "VEC4"),
    "scale": (f"{EXTENSION}:SCALE", "VEC3"),
    "opacity": (f"{EXTENSION}:OPACITY", "SCALAR"),
    "coefficient": (f"{EXTENSION}:SH_DEGREE_0_COEF_0", "VEC3"),
}
"""The attribute and the type of each array of `Stored`."""


def stored(parameters: F4) -> Stored:
    """Splats (N, 8) f4, finite and not degenerate, as a glTF file has them."""
    x, y, l11, l21, l22 = parameters[:, :5].astype(np.float64).T
    zero = np.zeros_like(x)
    factor = np.stack([np.stack([l11, zero], 1), np.stack([l21, l22], 1)], 1)  # (N, 2, 2)
    axes, scales, _ = np.linalg.svd(factor)  # the covariance is axes * scales^2 * axes^T
    half = np.arctan2(-axes[:, 1, 0], axes[:, 0, 0]) / 2  # of the first axis, y upwards
    wide = {
        "position": np.stack([x, -y, zero], 1),
        "rotation": np.stack([zero, zero, np.sin(half), np.cos(half)], 1),
        "scale": np.concatenate([scales, scales[:, 1:]], 1),
        "opacity": np.ones((len(x), 1)),
        "coefficient": (parameters[:, 5:].astype(np.float64) - 0.5) / SH_0,
    }
    return Stored(**{name: array.astype(np.float32) for name, array in wide.items()})


@dataclass(frozen=True, eq=False)
class Pictures:
    """What a glTF file can be expected to show.

    Attributes
    ----------
    change
        (H, W, 3) f8: how far storing the splats, and reading their colours in binary32, may move each pixel, splat by
        splat; also pixels that are drawn by one of two legal coverage decisions only.
    covered
        (H, W) i8: the number of splats that cover each pixel.
    """

    change: F8
    covered: NDArray[np.int64]


def pictures(parameters: F4, splats: Stored, width: int, height: int) -> Pictures:
    """Compare splats with what is stored of them, in binary64.

    Where either coverage decision is legal (13-9), the bound of a vector allows the splat to be left out, and to be
    drawn as it is: what is added here is the change of the splat when it is drawn.
    """
    change, covered = np.zeros((height, width, 3)), np.zeros((height, width), np.int64)
    colors = parameters[:, 5:].astype(np.float64)
    stored_colors = splats.coefficient.astype(np.float64) * SH_0 + 0.5
    read = EPS * (abs(stored_colors - 0.5) + abs(stored_colors))  # three roundings of half an EPS each, in binary32
    for n, _, pixels, errors in error_footprints(parameters, width, height):
        box = pixels.rows, pixels.columns
        x = np.arange(pixels.columns.start, pixels.columns.stop)[None, :] + 0.5
        y = np.arange(pixels.rows.start, pixels.rows.stop)[:, None] + 0.5
        sigma = _sigma_by_rotation(splats, n, x, y)
        before = np.where(errors.band, errors.g_plain, pixels.g)
        after = np.where(errors.band | (sigma <= LN_255), np.exp(-sigma), 0.0)
        change[box] += abs(after[..., None] * stored_colors[n] - before[..., None] * colors[n])
        change[box] += after[..., None] * read[n]
        covered[box] += pixels.covered
    return Pictures(change, covered)


def _sigma_by_rotation(splats: Stored, n: int, x: F8, y: F8) -> F8:
    """Sigma at pixels, by the two coordinates along the axes of a stored splat, in its scales."""
    px, py, _ = splats.position[n].astype(np.float64)
    _, _, qz, qw = splats.rotation[n].astype(np.float64)
    angle = 2 * np.arctan2(qz, qw)
    dx, dy = x - px, -y - py
    first, second, _ = splats.scale[n].astype(np.float64)
    u1 = (np.cos(angle) * dx + np.sin(angle) * dy) / first
    u2 = (np.cos(angle) * dy - np.sin(angle) * dx) / second
    return np.asarray((u1 * u1 + u2 * u2) / 2, np.float64)


def left_out(vector: Vector) -> str:
    """Why a vector has no glTF file; empty if it has one, as far as its splats tell."""
    parameters = vector.inputs["parameters"]
    if not len(parameters):
        return "has no splats, and a glTF file has at least one"
    if not np.isfinite(parameters).all() or (parameters[:, [2, 4]] < SMALLEST_NORMAL).any():
        return "has degenerate splats, which GSVC does not draw and glTF has no word for"
    if len(parameters) * vector.inputs["width"] * vector.inputs["height"] > MAX_WORK:
        return "is too large"
    with np.errstate(all="ignore"):
        splats = stored(parameters)
    held = all(np.isfinite(getattr(splats, name)).all() for name in ATTRIBUTES)
    if not held or (splats.scale < SMALLEST_NORMAL).any():
        return "has splats of which a scale or colour leaves binary32"
    return ""


def needs(vector: Vector, covered: NDArray[np.int64]) -> list[str]:
    """What a renderer must do beyond the extension for a vector; see docs/gltf.md."""
    colors = vector.inputs["parameters"][:, 5:]
    found = []
    if (covered > 1).any():
        found.append("sums")
    if (colors < 0).any() or (colors > 1).any():
        found.append("any colours")
    expected = vector.expected.get("sum")
    if isinstance(expected, Bounded) and not ((expected.value >= 0) & (expected.value <= 1)).all():
        found.append("float target")
    return found


def document(splats: Stored, width: int, height: int, title: str) -> tuple[dict[str, Any], bytes]:
    """The JSON of a glTF file ``splats.gltf``, and the bytes of its ``splats.bin``."""
    accessors: list[dict[str, Any]] = []
    views: list[dict[str, int]] = []
    data = b""
    for name, (_, kind) in ATTRIBUTES.items():
        array = np.ascontiguousarray(getattr(splats, name), "<f4")
        accessor = {"bufferView": len(views), "componentType": FLOAT, "count": len(array), "type": kind}
        if name == "position":
            accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        accessors.append(accessor)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes, "target": ARRAY_BUFFER})
        data += array.tobytes()
    attributes = {attribute: place for place, (attribute, _) in enumerate(ATTRIBUTES.values())}
    extension = {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}
    camera = {"type": "orthographic",
              "orthographic": {"xmag": width / 2, "ymag": height / 2, "znear": 0.0, "zfar": 2.0}}  # fmt: skip
    return {
        "asset": {"version": "2.0", "generator": "gsvc-conformance export --gltf", "extras": {"title": title}},
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"camera": 0, "translation": [width / 2, -height / 2, 1.0]}],
        "cameras": [camera],
        "meshes": [{"primitives": [{"attributes": attributes, "mode": 0, "extensions": {EXTENSION: extension}}]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"uri": "splats.bin", "byteLength": len(data)}],
    }, data


def export(vectors: Iterable[Vector], folder: Path) -> tuple[list[str], dict[str, str]]:
    """Write the glTF files of vectors, what they must show, and what compares pictures with that.

    Parameters
    ----------
    vectors
        Of `OPERATIONS`.
    folder
        Where to: it gets ``ID/splats.gltf`` and so on, index.json and compare_pictures.py.

    Returns
    -------
    The ids that were written; and by id why others were left out.
    """
    entries, others = [], {}
    for vector in vectors:
        try:
            reason = left_out(vector)
        except (LookupError, TypeError, ValueError) as error:  # inputs of an untrusted vector
            raise UsageError(f"the inputs of {vector.id} do not fit {vector.operation.name}: {error}") from None
        entry = None if reason else _write(vector, folder)
        if entry:
            entries.append(entry)
        else:
            others[vector.id] = (
                reason or f"loses more than {MAX_CHANGE:g} of its colours to the binary32 numbers of glTF"
            )
    folder.mkdir(parents=True, exist_ok=True)
    index = {"extension": EXTENSION, "pictures": entries, "left_out": others}
    (folder / "index.json").write_text(json.dumps(index, indent=1) + "\n", encoding="utf-8")
    (folder / CHECKER.name).write_bytes(CHECKER.read_bytes())
    return [entry["id"] for entry in entries], others


def _write(vector: Vector, folder: Path) -> dict[str, Any] | None:
    """Write one vector; its entry in index.json, or None if storing its splats changes too much."""
    parameters, width, height = (vector.inputs[name] for name in ("parameters", "width", "height"))
    splats = stored(parameters)
    found = pictures(parameters, splats, width, height)
    if not found.change.max() <= MAX_CHANGE * max(1.0, float(abs(parameters[:, 5:]).max())):
        return None
    home = folder / vector.id
    home.mkdir(parents=True, exist_ok=True)
    gltf, data = document(splats, width, height, str(vector.manifest["title"]))
    (home / "splats.gltf").write_text(json.dumps(gltf, indent=1) + "\n", encoding="utf-8")
    (home / "splats.bin").write_bytes(data)
    for name, array in _allowed(vector, found.change).items():
        (home / f"{name}.npy").write_bytes(npy(array))
    (home / "expected.png").write_bytes(png(_shown(vector)))
    return {
        "id": vector.id, "title": vector.manifest["title"], "width": width, "height": height,
        "splats": len(parameters), "needs": needs(vector, found.covered),
        **({"bit_depth": vector.inputs["bit_depth"]} if "bit_depth" in vector.inputs else {}),
    }  # fmt: skip


def _allowed(vector: Vector, change: F8) -> dict[str, NDArray[Any]]:
    """The least and the largest value that each sample may have, and the exact one."""
    (expected,) = vector.expected.values()
    if isinstance(expected, Interval):
        steps = np.ceil(change * (2 ** vector.inputs["bit_depth"] - 1)).astype(
            np.int64
        )  # a sample moves by one at most
        peak = 2 ** vector.inputs["bit_depth"] - 1
        low, high = expected.lowest.astype(np.int64) - steps, expected.highest.astype(np.int64) + steps
        kind = expected.value.dtype
        return {"expected": expected.value, "lowest": np.clip(low, 0, peak).astype(kind),
                "highest": np.clip(high, 0, peak).astype(kind)}  # fmt: skip
    assert isinstance(expected, Bounded)
    bound = expected.bound + change
    return {"expected": expected.value, "lowest": expected.value - bound, "highest": expected.value + bound}


def _shown(vector: Vector) -> NDArray[np.uint8]:
    """What is expected as a picture of 8 bits, for people."""
    (expected,) = vector.expected.values()
    assert isinstance(expected, Bounded | Interval)
    peak = 1.0 if isinstance(expected, Bounded) else 2.0 ** vector.inputs["bit_depth"] - 1
    return np.rint(np.clip(expected.value / peak, 0, 1) * 255).astype(np.uint8)
