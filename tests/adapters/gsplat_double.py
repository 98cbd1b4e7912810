"""A double of the authors' CUDA rasteriser: what its public code computes, in plain tensors.

It stands for github.com/XingtongGe/gsplat at bf697c8 where no GPU is. It has the signatures of the two functions that
GSVC uses, and their faults, each of which can be mended. It was written from what that code does and shares no line
with it. A compiler may fuse products and sums there, so that both ways are judged. What else a GPU does is left out:
its own exp, and which splats of a tile come first (there: as a sort of equal keys leaves them; here: by index). It
fails exactly the vectors that the rasteriser failed on a GPU (MEASURED), and predicts those that no GPU was asked.

    PYTHONPATH=. python tests/adapters/gsplat_double.py    # writes expected_failures.toml again
"""

import importlib
import math
import sys
import types
from itertools import combinations
from pathlib import Path

import pytest
import torch

from gsvc_conformance.implementations import load_module
from gsvc_conformance.report.json import read
from gsvc_conformance.runner import judge_vector
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector_folder import VectorFolder
from gsvc_conformance.waivers import Waiver, Waivers, patterns, to_toml

HEAD = """\
# What the public code of the rasteriser (bf697c8) gets wrong, and the equations of spec.md that it breaks.
# measured: {where}: docs/reports/gsplat_cuda.json.
# predicted: by a double of the rasteriser, for vectors that are newer. Of the others it fails what was measured.
# PYTHONPATH=. python tests/adapters/gsplat_double.py writes this file.
"""
FAULTS = {
    "off-diagonal": "the gradient of the off-diagonal entry of L L^T is counted twice; (10-5) counts that of l21 once",
    "conic": "sigma comes in binary32 from the inverse of L L^T, whose determinant is a difference that cancels; "
    "(9-1) divides by the factors",
    "support": "a splat ends with the tiles that a square of 3 standard deviations touches; (9-1) ends it at 3.33, "
    "where sigma is ln 255",
    "cap": "only the first 256 splats of a tile of 16 x 16 pixels are summed; (9-2) has no limit",
    "centre": "positions pass as -1 to 1 over the frame, in binary32; (9-1) takes x and y as they are",
}
"""What is wrong, and the equation of spec.md that it breaks."""
TILE = 16
CAP = 256
PAIRS = 2**22  # of a splat and a pixel at once
OPERATIONS = ("render_sum", "render_frame", "render_gradients")
ADAPTER = "gsvc_conformance.adapters.gsplat_cuda"
ROOT = Path(__file__).parents[2]
EXPECTED = ROOT / "conformance" / "gsvc_conformance" / "adapters" / "gsplat_cuda" / "expected_failures.toml"
MEASURED = ROOT / "docs" / "reports" / "gsplat_cuda.json"


class Double:
    """The two functions, as they are but for the faults that are mended; fused or not."""

    def __init__(self, mended=(), fused=False) -> None:
        self.mended = frozenset(mended)
        self.fused = fused
        assert self.mended <= FAULTS.keys()

    def project_gaussians_2d(self, means2d, L_elements, img_height, img_width, tile_bounds, clip_thresh=0.01):
        assert tile_bounds == (math.ceil(img_width / TILE), math.ceil(img_height / TILE), 1)
        centers, radii, conics, tiles_hit = Project.apply(means2d, L_elements, img_height, img_width, self)
        return centers, torch.zeros(len(centers)), radii, conics, tiles_hit

    def rasterize_gaussians_sum(
        self, xys, depths, radii, conics, num_tiles_hit, colors, opacity, img_height, img_width,
        BLOCK_H=TILE, BLOCK_W=TILE, background=None, return_alpha=False,
    ):  # fmt: skip
        assert (BLOCK_H, BLOCK_W, return_alpha) == (TILE, TILE, False), "the kernels are compiled for 16"
        assert torch.all(opacity == 1), "GSVC has no other"
        assert len(xys), "the code looks at the last splat"
        return Rasterize.apply(xys, conics, radii, colors, img_height, img_width, self)


class Project(torch.autograd.Function):
    """From L to the inverse of L L^T; with `conic` mended L itself takes its place, in binary64."""

    @staticmethod
    def forward(context, means, factors, height, width, double):
        mended = double.mended
        half = torch.tensor([0.5 * width, 0.5 * height], dtype=means.dtype)
        centers = sum_of_product(half, means, half, double.fused)
        l11, l21, l22 = (factors.double() if "conic" in mended else factors).unbind(1)
        a, b, c = l11 * l11, l11 * l21, l21 * l21 + l22 * l22
        det = sum_of_product(a, c, -(b * b), double.fused)
        if "conic" in mended:
            det = (l11 * l22) ** 2
        there = det != 0
        conics = torch.stack([c * (1 / det), -b * (1 / det), a * (1 / det)], 1)
        if "conic" in mended:
            conics = torch.stack([l11, l21, l22], 1)
        middle = 0.5 * (a + c)
        # CUDA's max of a NaN and a number is the number.
        root = torch.sqrt(torch.fmax(torch.tensor(0.1, dtype=det.dtype), middle * middle - det))
        radii = torch.ceil(3 * torch.sqrt(torch.fmax(middle + root, middle - root)))
        radii = torch.where(there, torch.full_like(radii, math.inf) if "support" in mended else radii, 0)
        conics = torch.where(there[:, None], conics, 0)
        first, last = tile_box(centers, radii, height, width)
        tiles_hit = torch.where(there, (last - first).prod(1), 0)
        context.save_for_backward(factors, conics, there, half)
        context.mended = mended
        context.mark_non_differentiable(radii, tiles_hit)
        return centers, radii, conics, tiles_hit

    @staticmethod
    def backward(context, of_centers, _of_radii, of_conics, _of_tiles_hit):
        factors, conics, there, half = context.saved_tensors
        count = 1 if "off-diagonal" in context.mended else 2
        through = of_factors if "conic" in context.mended else of_covariance
        gradient = torch.where(there[:, None], through(conics, factors, of_conics, count), 0).float()
        return torch.where(there[:, None], of_centers * half, 0), gradient, None, None, None


def of_covariance(conics, factors, of_conics, count):
    """The gradient of L by way of that of L L^T, -X G X, whose off-diagonal entry is counted so many times."""
    x, g = (matrix[:, [0, 1, 1, 2]].reshape(-1, 2, 2) for matrix in (conics, of_conics))
    of_sigma = -(x @ g @ x)
    g11, g22 = of_sigma[:, 0, 0], of_sigma[:, 1, 1]
    g12 = count * (of_sigma[:, 0, 1] + of_sigma[:, 1, 0])
    l11, l21, l22 = factors.unbind(1)
    return torch.stack([2 * l11 * g11 + g12 * l21, l11 * g12 + 2 * l21 * g22, 2 * l22 * g22], 1)


def of_factors(_factors, factors, exact, count):
    """The exact gradient of L, and once more what the off-diagonal entry has in it for each further count."""
    l11, l21, l22 = factors.double().unbind(1)
    g12 = (exact[:, 1] - l21 * exact[:, 2] / l22) / l11
    return exact + (count - 1) * torch.stack([g12 * l21, g12 * l11, torch.zeros_like(g12)], 1)


def tile_box(centers, radii, height, width):
    """The first tile and the one after the last that the squares around splats touch, (N, 2) each."""
    most = torch.tensor([math.ceil(width / TILE), math.ceil(height / TILE)], dtype=torch.int64)
    low, high = (centers - radii[:, None]) / TILE, (centers + radii[:, None]) / TILE + 1
    # Into the range first: an integer beyond it is the nearest one in CUDA, and anything in PyTorch.
    first, last = (torch.nan_to_num(x, nan=0.0).clamp(0, int(most.max())).trunc().long() for x in (low, high))
    return torch.minimum(first, most), torch.minimum(last, most)


class Rasterize(torch.autograd.Function):
    """The sum over the pixels: all splats, and as many pixels at once as PAIRS allows."""

    @staticmethod
    def forward(context, centers, conics, radii, colors, height, width, double):
        rows, columns = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
        pixels = torch.stack([columns.flatten(), rows.flatten()], 1)
        context.save_for_backward(centers, conics, radii, colors)
        context.blocks = pixels.split(max(1, PAIRS // max(1, len(centers))))
        context.frame, context.double = (height, width), double
        sums = []
        for block in context.blocks:
            *_, used, _ = Rasterize.weights(block, centers, conics, radii, context.frame, double)
            sums.append((used.T @ colors.to(used.dtype)).float())
        return torch.cat(sums).reshape(height, width, 3)

    @staticmethod
    def weights(pixels, centers, conics, radii, frame, double):
        """Of splats at pixels, (N, P) each: how far away, the weight, what of it is used, whether it is drawn."""
        mended = double.mended
        delta = centers[:, None] - pixels
        reached = in_tiles(centers, radii, pixels, *frame, math.inf if "cap" in mended else CAP)
        if "conic" in mended:
            u = solved(conics, -delta.double())
            sigma = 0.5 * (u * u).sum(2)
            weight = torch.exp(-sigma)
            drawn = reached & (weight >= 1 / 255)
        else:
            sigma = squared_form(conics, delta.double() if double.fused else delta).float()
            weight = torch.exp(-sigma)
            # CUDA's min of 1 and a NaN is 1: such a pixel takes the whole colour.
            alpha = torch.fmin(torch.ones(()), weight)
            drawn = reached & ~(sigma < 0) & (alpha >= torch.tensor(1 / 255))
        used = torch.where(drawn, torch.fmin(torch.ones((), dtype=weight.dtype), weight), 0)
        return delta, weight, used, drawn

    @staticmethod
    def backward(context, of_picture):
        residuals = of_picture.reshape(-1, 3).split([len(block) for block in context.blocks])
        blocks = [Rasterize.gradients(context, *pair) for pair in zip(context.blocks, residuals, strict=True)]
        of_centers, of_conics, of_colors = (sum(parts[1:], parts[0]) for parts in zip(*blocks, strict=True))
        return of_centers, of_conics, None, of_colors.float(), None, None, None

    @staticmethod
    def gradients(context, pixels, residual):
        """What some pixels add to the gradients of centres, conics and colours."""
        centers, conics, radii, colors = context.saved_tensors
        delta, weight, used, drawn = Rasterize.weights(pixels, centers, conics, radii, context.frame, context.double)
        residual = residual.to(used.dtype)
        of_colors = used @ residual
        of_sigma = torch.where(drawn, -weight * (colors.to(used.dtype) @ residual.T), 0)
        if "conic" in context.double.mended:
            u = solved(conics, -delta.double())
            l11, l21, l22 = conics[:, None].unbind(2)
            v2 = u[..., 1] / l22
            v1 = (u[..., 0] - l21 * v2) / l11
            by_centers = torch.stack([-v1, -v2], 2)
            by_conics = torch.stack([-v1 * u[..., 0], -v2 * u[..., 0], -v2 * u[..., 1]], 2)
        else:
            x, y, z = (entry[:, None] for entry in conics.unbind(1))
            d_x, d_y = delta.unbind(2)
            by_centers = torch.stack([x * d_x + y * d_y, y * d_x + z * d_y], 2)
            by_conics = torch.stack([0.5 * d_x * d_x, 0.5 * d_x * d_y, 0.5 * d_y * d_y], 2)
        of_centers, of_conics = (
            torch.where(drawn[..., None], of_sigma[..., None] * by, 0).sum(1) for by in (by_centers, by_conics)
        )
        return of_centers.to(delta.dtype), of_conics, of_colors


def sum_of_product(a, b, c, fused):
    """a b + c; fused, the product is not rounded."""
    return (a.double() * b.double() + c.double()).to(a.dtype) if fused else a * b + c


def squared_form(conics, delta):
    """sigma, (N, P), by the inverse of L L^T; where the difference is in binary64 it is rounded once in the end."""
    x, y, z = (entry[:, None] for entry in conics.unbind(1))
    d_x, d_y = delta.unbind(2)
    return 0.5 * (x * d_x * d_x + z * d_y * d_y) + y * d_x * d_y


def solved(factors, d):
    """(9-1): u of L u = d, (N, P, 2)."""
    l11, l21, l22 = factors[:, None].unbind(2)
    u1 = d[..., 0] / l11
    return torch.stack([u1, (d[..., 1] - l21 * u1) / l22], 2)


def in_tiles(centers, radii, pixels, height, width, cap):
    """Which splat is among the first `cap` of the tile of which pixel, (N, P)."""
    first, last = tile_box(centers, radii, height, width)
    tile = pixels // TILE
    touched = ((tile >= first[:, None]) & (tile < last[:, None])).all(2) & (radii > 0)[:, None]
    return touched & (touched.cumsum(0) <= cap)


def stand_ins(monkeypatch, double):
    """Put a double in the place of the package; the adapter is imported anew."""
    functions = {
        "gsplat.project_gaussians_2d": double.project_gaussians_2d,
        "gsplat.rasterize_sum": double.rasterize_gaussians_sum,
    }
    monkeypatch.setitem(sys.modules, "gsplat", types.ModuleType("gsplat"))
    for name, function in functions.items():
        module = types.ModuleType(name)
        setattr(module, function.__name__, function)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, ADAPTER, raising=False)


def adapter(monkeypatch, mended=(), fused=False):
    """The adapter, with a double in the place of the package."""
    stand_ins(monkeypatch, Double(mended, fused))
    module = importlib.import_module(ADAPTER)
    monkeypatch.setattr(module, "DEVICE", "cpu")
    monkeypatch.setattr(module, "environment", dict)
    if "centre" in mended:
        monkeypatch.setattr(module, "rounded", lambda values: values)
    return load_module(ADAPTER)


def vectors():
    """All vectors of the operations that the adapter has."""
    folder = VectorFolder(VECTORS)
    return list(folder.read([name for name in folder.names if name.split("/")[1] in OPERATIONS]))


def pairs(vector):
    """How many pairs of a splat and a pixel a vector has."""
    inputs = vector.inputs
    pixels = inputs["residual"][..., 0].size if "residual" in inputs else inputs["width"] * inputs["height"]
    return len(inputs["parameters"]) * pixels


def failures(monkeypatch, chosen, mended=()):
    """Those of some vectors that the double fails, fused or not, by id."""
    wrong = {}
    for fused in (False, True):
        implementation = adapter(monkeypatch, mended, fused)
        for vector in chosen:
            if vector.id not in wrong and judge_vector(implementation, vector).result.outcome != "pass":
                wrong[vector.id] = vector
    return {vector.id: vector for vector in chosen if vector.id in wrong}


def measured():
    """The report of a GPU, and its outcomes of the vectors that it was asked, by id."""
    report = read(MEASURED)
    return report, {result.id: result.outcome for result in report.results if result.outcome != "unsupported"}


def reason(faults, how):
    """What a waiver says of a vector that passes when some faults are mended."""
    return f"{how}: {'; and '.join(FAULTS[fault] for fault in faults)}"


def explained(monkeypatch):
    """The reason of every vector that the double fails: the fewest faults that have to be mended for it to pass."""
    left = failures(monkeypatch, vectors())
    order, reasons, asked = list(left), {}, measured()[1]
    for faults in sets_of_faults():
        still = failures(monkeypatch, list(left.values()), faults)
        for name in left.keys() - still.keys():
            reasons[name] = reason(faults, "measured" if name in asked else "predicted")
        left = still
    assert not left, f"unexplained: {list(left)}"
    return {name: reasons[name] for name in order}


def as_toml(reasons):
    """Waivers for vectors with their reasons, an entry a reason."""
    names = VectorFolder(VECTORS).names
    groups = {why: [name for name in reasons if reasons[name] == why] for why in dict.fromkeys(reasons.values())}
    entries = tuple(Waiver(tuple(patterns(chosen, names)), why) for why, chosen in groups.items())
    report = measured()[0]
    on = ", ".join(f"{name} {text}" if name != "device" else text for name, text in report.runs_on.items())
    where = f"{on}, {report.environment['date'][:10]}, vectors {report.environment['vector set']}"
    return to_toml(Waivers(entries), HEAD.format(where=where))


def sets_of_faults():
    """All that are not empty, the smallest first."""
    return [faults for count in range(1, len(FAULTS) + 1) for faults in combinations(FAULTS, count)]


def main() -> None:
    torch.set_num_threads(1)
    with pytest.MonkeyPatch.context() as monkeypatch:
        EXPECTED.write_text(as_toml(explained(monkeypatch)), encoding="utf-8")


if __name__ == "__main__":
    main()
