"""Mutants of render_gradients: reductions over pixels, warps and tiles, and formulas."""

import numpy as np

from planted import Planted, after, before, patched

AREA = "gradients"
OPERATION = "render_gradients"
SUMS = "    of_x = np.sum(q * v1)\n"


def of_residual(change):
    """The gradients of another residual: what threads over pixels see."""

    def changed(inputs):
        change(inputs["residual"])
        return inputs

    return changed


def weighted(weights):
    """The residual times weights of pixels (rows, columns) -> (H, W)."""

    def changed(inputs):
        rows, columns = np.indices(inputs["residual"].shape[:2])
        inputs["residual"] *= np.float32(weights(rows, columns, inputs["residual"].shape))[:, :, None]
        return inputs

    return changed


def covered(weights):
    """Weights of a splat's covered pixels by their number: what threads over a list of pixels see."""
    return (
        "    e = residual[covered]\n",
        f"    e = residual[covered]\n    turn = np.arange(len(e))\n    e = e * ({weights})[:, None]\n",
    )


def stale():
    from gsvc_conformance import spec

    kept = np.zeros((0, 8), np.float32)

    def render_gradients(parameters, residual):
        nonlocal kept
        fresh = spec.namespace()["render_gradients"](parameters, residual)["gradients"]
        held = np.zeros((max(len(fresh), len(kept)), 8), np.float32)
        held[: len(kept)] = kept
        held[: len(fresh)] += fresh
        kept = held
        return {"gradients": held[: len(fresh)].copy()}

    return {"render_gradients": render_gradients}


def column(name, factor):
    index = ("x", "y", "l11", "l21", "l22", "red", "green", "blue").index(name)
    return lambda out, i: (
        out["gradients"].__setitem__(np.s_[:, index], out["gradients"][:, index] * np.float32(factor)),
        out,
    )[1]


PLANTED = (
    after(AREA, "first 64 rows", OPERATION, "splats from 64", lambda out, i: (out["gradients"].__setitem__(np.s_[64:], 0), out)[1]),
    after(AREA, "last splat", OPERATION, "last of the splats", lambda out, i: (out["gradients"].__setitem__(np.s_[-1:], 0), out)[1]),
    after(AREA, "partial block of splats", OPERATION, "partial block of (4|8|16|32|64|128|256) of the splats",
          lambda out, i: (out["gradients"].__setitem__(np.s_[len(out["gradients"]) // 4 * 4 :], 0), out)[1]),
    after(AREA, "l21 doubled", OPERATION, "l21", column("l21", 2)),
    after(AREA, "l22 halved", OPERATION, "l22", column("l22", 0.5)),
    after(AREA, "x negative", OPERATION, "other sign.*\\bx\\b", column("x", -1)),
    after(AREA, "colours not written", OPERATION, "red, green, blue", lambda out, i: (out["gradients"].__setitem__(np.s_[:, 5:], 0), out)[1]),
    after(AREA, "red and blue", OPERATION, "red and blue exchanged|B, G, R", lambda out, i: {"gradients": out["gradients"][:, [0, 1, 2, 3, 4, 7, 6, 5]].copy()}),
    after(AREA, "l21 and l22 exchanged", OPERATION, "l21 and l22 exchanged", lambda out, i: {"gradients": out["gradients"][:, [0, 1, 2, 4, 3, 5, 6, 7]].copy()}),
    after(AREA, "l11 in place of l21", OPERATION, "l11 in place of l21|l21", lambda out, i: {"gradients": out["gradients"][:, [0, 1, 2, 2, 4, 5, 6, 7]].copy()}),
    after(AREA, "fields of splats", OPERATION, "fields of splats", lambda out, i: {"gradients": np.ascontiguousarray(out["gradients"].T).reshape(-1, 8)}),
    after(AREA, "mean over the pixels", OPERATION, "1/\\(H W\\)", lambda out, i: {"gradients": (out["gradients"] / np.float32(i["residual"][:, :, 0].size)).astype(np.float32)}),
    after(AREA, "position in normalised units", OPERATION, "W/2.*H/2|W/2", lambda out, i: {"gradients": out["gradients"] * np.float32([i["residual"].shape[1] / 2, i["residual"].shape[0] / 2, 1, 1, 1, 1, 1, 1])}),
    after(AREA, "times 255", OPERATION, "255 times", lambda out, i: {"gradients": out["gradients"] * np.float32(255)}),
    after(AREA, "all negative", OPERATION, "other sign", lambda out, i: {"gradients": -out["gradients"]}),
    after(AREA, "binary16 results", OPERATION, "binary16|few bits", lambda out, i: {"gradients": out["gradients"].astype(np.float16).astype(np.float32)}),
    Planted("gradients not cleared", AREA, (OPERATION,), "vector before", stale),
    before(AREA, "residual last row lost", OPERATION, "last of the rows of pixels left out", weighted(lambda y, x, s: y < s[0] - 1)),
    before(AREA, "residual last column lost", OPERATION, "last of the columns of pixels left out", weighted(lambda y, x, s: x < s[1] - 1)),
    before(AREA, "residual last tile lost", OPERATION, "last of the tiles|whole tile", weighted(lambda y, x, s: ~((y >= s[0] // 16 * 16) & (x >= s[1] // 16 * 16)))),
    before(AREA, "partial tiles lost", OPERATION, "whole tile of 16x16", weighted(lambda y, x, s: (y < s[0] // 16 * 16) & (x < s[1] // 16 * 16))),
    before(AREA, "first tile only", OPERATION, "tiles of 16x16 from 1|rows of pixels from 16|columns of pixels from 16|tile", weighted(lambda y, x, s: (y < 16) & (x < 16))),
    before(AREA, "lower half lost", OPERATION, "lower half|rows of pixels from", weighted(lambda y, x, s: y < s[0] // 2)),
    before(AREA, "half warps lost", OPERATION, "second half of each warp|second half of each 32|every second of the rows", weighted(lambda y, x, s: (y % 16 * 16 + x % 16) % 32 < 16)),
    before(AREA, "lane 31 lost", OPERATION, "last of each 32 threads|every 32th", weighted(lambda y, x, s: (y % 16 * 16 + x % 16) % 32 != 31)),
    before(AREA, "first 256 pixels", OPERATION, "pixels, row after row, from 256", weighted(lambda y, x, s: y * s[1] + x < 256)),
    before(AREA, "last partial block of 64 pixels", OPERATION, "partial block of 64", weighted(lambda y, x, s: y * s[1] + x < s[0] * s[1] // 64 * 64)),
    before(AREA, "tile edges twice", OPERATION, "each tile of 16x16 taken twice", weighted(lambda y, x, s: (1 + ((y % 16 == 0) & (y > 0))) * (1 + ((x % 16 == 0) & (x > 0))))),
    before(AREA, "outermost pixels twice", OPERATION, "outermost pixels taken twice", weighted(lambda y, x, s: 1 + ((y == 0) | (x == 0) | (y == s[0] - 1) | (x == s[1] - 1)))),
    before(AREA, "even rows only", OPERATION, "every second", weighted(lambda y, x, s: y % 2 == 0)),
    patched(AREA, "partial warp of covered pixels", OPERATION, "partial (warp|block) of 32 of (its|the) covered|covered pixels", covered("turn < len(e) // 32 * 32")),
    patched(AREA, "first 256 covered pixels", OPERATION, "covered pixels.*256|256.*covered", covered("turn < 256")),
    patched(AREA, "first covered pixel lost", OPERATION, "first of (its|the) covered", covered("turn > 0")),
    before(AREA, "residual transposed", OPERATION, "transposed|rows and columns exchanged|columns one after", lambda i: {"residual": np.ascontiguousarray(i["residual"].transpose(1, 0, 2)).reshape(i["residual"].shape)}),
    before(AREA, "residual upside down", OPERATION, "y axis upwards|upside down", lambda i: {"residual": i["residual"][::-1].copy()}),
    before(AREA, "residual red alone", OPERATION, "red", lambda i: {"residual": i["residual"] * np.float32([1, 0, 0])}),
    before(AREA, "residual clamped", OPERATION, "clamped", lambda i: {"residual": np.clip(i["residual"], 0, 1)}),
    patched(AREA, "forward l21 sign", OPERATION, "l21", ("    u2 = (d_y - l21 * u1) / l22\n    sigma = (u1 * u1 + u2 * u2) / 2\n    covered", "    u2 = (d_y + l21 * u1) / l22\n    sigma = (u1 * u1 + u2 * u2) / 2\n    covered")),
    patched(AREA, "gradient l21 left out", OPERATION, "l21", ("    u2 = (d_y - l21 * u1) / l22\n    sigma = (u1 * u1 + u2 * u2) / 2\n    covered", "    u2 = d_y / l22 + 0 * u1\n    sigma = (u1 * u1 + u2 * u2) / 2\n    covered")),
    patched(AREA, "columns at integers", OPERATION, "columns|integer", ("d_x = np.arange(width)[None, :] + 0.5 - x\n    d_y = np.arange(height)[:, None] + 0.5 - y\n    u1 = np.broad", "d_x = np.arange(width)[None, :] - x\n    d_y = np.arange(height)[:, None] + 0.5 - y\n    u1 = np.broad")),
    patched(AREA, "q without g", OPERATION, "without exp|exp\\(-sigma\\)|weight", ("q = g * (e[:, 0] * red", "q = (e[:, 0] * red")),
    patched(AREA, "q of g squared", OPERATION, "exp\\(-2 sigma\\)|squared", ("q = g * (e[:, 0] * red", "q = g * g * (e[:, 0] * red")),
    patched(AREA, "l22 by v1", OPERATION, "l22", ("of_l22 = np.sum(q * v2 * u2)", "of_l22 = np.sum(q * v1 * u2)")),
    patched(AREA, "l11 by v2", OPERATION, "l11", ("of_l11 = np.sum(q * v1 * u1)", "of_l11 = np.sum(q * v2 * u1)")),
    patched(AREA, "mu not through l21", OPERATION, "l21|\\bx\\b", ("    v1 = (u1 - l21 * v2) / l11\n    of_x = np.sum(q * v1)", "    v1 = (u1 - l21 * v2) / l11\n    of_x = np.sum(q * u1 / l11)")),
    patched(AREA, "a store of the last pixel", OPERATION, "last of the pixels alone|store|last pixel|last covered pixel alone", (SUMS, "    of_x = (q * v1)[-1] if len(q) else 0.0\n")),
    patched(AREA, "only splats inside", OPERATION, "outside", ("        if drawn.all():\n            gradients[n] = splat_gradient(splat, residual.astype(np.float64))", "        if drawn.all() and 0 <= splat[0] <= residual.shape[1] and 0 <= splat[1] <= residual.shape[0]:\n            gradients[n] = splat_gradient(splat, residual.astype(np.float64))")),
    patched(AREA, "support of one half", OPERATION, "support|ellipse|covered|cut", ("covered = sigma <= LN_255\n    u1 = u1[covered]", "covered = sigma <= 2.77\n    u1 = u1[covered]")),
    after(AREA, "weights dL/dw without c", "weighted_gradients", "\\bw\\b", lambda out, i: (out["gradients"].__setitem__(np.s_[:, 8], i["gradients"][:, 5:8].sum(axis=1)), out)[1]),
    after(AREA, "weights first 4 rows", "weighted_gradients", "from 4 on", lambda out, i: (out["gradients"].__setitem__(np.s_[4:], 0), out)[1]),
    after(AREA, "weights of mu scaled", "weighted_gradients", "\\bx, y\\b|x", lambda out, i: (out["gradients"].__setitem__(np.s_[:, :2], i["values"][:, 8:] * out["gradients"][:, :2]), out)[1]),
    after(AREA, "weighted colours by magnitude", "weighted_parameters", "negative weight", lambda out, i: (out["parameters"].__setitem__(np.s_[:, 5:8], abs(i["values"][:, 8:]) * i["values"][:, 5:8]), out)[1]),
)  # fmt: skip
