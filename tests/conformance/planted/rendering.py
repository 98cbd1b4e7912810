"""Mutants of rendering: kernels over pixels and splats, and the conversion to samples."""

import numpy as np

from planted import Planted, after, before, patched

AREA = "rendering"
SUM = "render_sum"
G = "g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)"
ADD = "        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n"
ENDED = '        return {"sum": C.astype(np.float32)}'


def masked(select):
    """The sum with zeros where `select(height, width)`, an index of pixels, points."""

    def change(out, inputs):
        out["sum"][select(*out["sum"].shape[:2])] = 0
        return out

    return change


def some_splats(select):
    return lambda inputs: {"parameters": select(inputs["parameters"])}


def stale():
    """A buffer that is not cleared before splats are added."""
    from gsvc_conformance import spec

    kept = np.zeros(0, np.float32)

    def render_sum(parameters, width, height):
        nonlocal kept
        fresh = spec.namespace()["render_sum"](parameters, width, height)["sum"]
        size = fresh.size
        held = np.zeros(max(size, kept.size), np.float32)
        held[: kept.size] = kept
        held[:size] += fresh.ravel()
        kept = held
        return {"sum": held[:size].reshape(fresh.shape).copy()}

    return {"render_sum": render_sum}


def unwritten_rows():
    """The last row keeps what the picture before had there."""
    from gsvc_conformance import spec

    kept = np.zeros(0, np.float32)

    def render_sum(parameters, width, height):
        nonlocal kept
        fresh = spec.namespace()["render_sum"](parameters, width, height)["sum"].ravel()
        size, written = fresh.size, fresh.size - width * 3
        held = np.zeros(max(size, kept.size), np.float32)
        held[: kept.size] = kept
        held[:written] = fresh[:written]
        kept = held
        return {"sum": held[:size].reshape(height, width, 3).copy()}

    return {"render_sum": render_sum}


def half_splats(columns):
    def change(inputs):
        with np.errstate(over="ignore"):
            inputs["parameters"][:, columns] = inputs["parameters"][:, columns].astype(np.float16)
        return inputs

    return change


PLANTED = (
    after(AREA, "last row not drawn", SUM, "last of the rows", masked(lambda h, w: np.s_[h - 1 :])),
    after(AREA, "last column not drawn", SUM, "last of the columns", masked(lambda h, w: np.s_[:, w - 1 :])),
    after(AREA, "last row and column not drawn", SUM, "last row and column",
          lambda out, i: (out["sum"].__setitem__(np.s_[-1:], 0), out["sum"].__setitem__(np.s_[:, -1:], 0), out)[2]),
    after(AREA, "columns from 256 on", SUM, "columns.*from 256|columns.*2\\^8", masked(lambda h, w: np.s_[:, 256:])),
    after(AREA, "rows from 32 on", SUM, "rows of pixels from 32", masked(lambda h, w: np.s_[32:])),
    after(AREA, "first row not drawn", SUM, "first of the rows", masked(lambda h, w: np.s_[:1])),
    after(AREA, "odd rows not drawn", SUM, "every second of the rows", masked(lambda h, w: np.s_[1::2])),
    after(AREA, "every 32nd column", SUM, "every 32th of the columns", masked(lambda h, w: np.s_[:, 31::32])),
    after(AREA, "one grid of 1024 pixels", SUM, "pixels, row after row, from 1024",
          lambda out, i: {"sum": np.where(np.arange(out["sum"].size).reshape(out["sum"].shape) < 3072, out["sum"], np.float32(0))}),
    after(AREA, "partial tiles of 16", SUM, "whole tile of 16x16",
          lambda out, i: (out["sum"].__setitem__(np.s_[i["height"] // 16 * 16 :], 0),
                          out["sum"].__setitem__(np.s_[:, i["width"] // 16 * 16 :], 0), out)[2]),
    after(AREA, "blue not written", SUM, "blue", lambda out, i: (out["sum"].__setitem__(np.s_[:, :, 2], 0), out)[1]),
    after(AREA, "green is red", SUM, "red in place of green|green alone",
          lambda out, i: (out["sum"].__setitem__(np.s_[:, :, 1], out["sum"][:, :, 0]), out)[1]),
    after(AREA, "picture one pixel to the right", SUM, "one pixel to the right",
          lambda out, i: {"sum": np.roll(out["sum"], 1, axis=1)}),
    after(AREA, "half a turn", SUM, "half a turn", lambda out, i: {"sum": out["sum"][::-1, ::-1].copy()}),
    after(AREA, "rows of W + 1 pixels", SUM, "W \\+ 1 pixels apart",
          lambda out, i: {"sum": np.pad(out["sum"], ((0, 0), (0, 1), (0, 0))).reshape(-1, 3)[: i["height"] * i["width"]].reshape(out["sum"].shape)}),
    after(AREA, "sum twice", SUM, "twice the right", lambda out, i: {"sum": out["sum"] * np.float32(2)}),
    after(AREA, "sum over the pixels", SUM, "1/\\(H W\\)|by the size",
          lambda out, i: {"sum": out["sum"] / np.float32(i["width"] * i["height"])}),
    after(AREA, "sum of 255", SUM, "255 times", lambda out, i: {"sum": out["sum"] * np.float32(255)}),
    after(AREA, "an ambient of a tenth", SUM, "larger by 0.1", lambda out, i: {"sum": out["sum"] + np.float32(0.1)}),
    after(AREA, "red halved", SUM, "half the right numbers in red|half.*red",
          lambda out, i: {"sum": out["sum"] * np.float32([0.5, 1, 1])}),
    after(AREA, "binary16 sums", SUM, "binary16|few bits", lambda out, i: {"sum": out["sum"].astype(np.float16).astype(np.float32)}),
    after(AREA, "bfloat16 sums", SUM, "bfloat16|few bits",
          lambda out, i: {"sum": (out["sum"].view(np.uint32) & np.uint32(0xFFFF0000)).view(np.float32)}),
    before(AREA, "first 64 splats", SUM, "splats from 64 on|first 64 splats", some_splats(lambda p: p[:64])),
    before(AREA, "splats from 4 on", SUM, "splats from 4 on", some_splats(lambda p: p[:4])),
    before(AREA, "last splat missing", SUM, "last of the splats left out|splats? \\d+ left out", some_splats(lambda p: p[:-1])),
    before(AREA, "first splat missing", SUM, "first of the splats left out|splats 0 left out", some_splats(lambda p: p[1:])),
    before(AREA, "every second splat", SUM, "every second", some_splats(lambda p: p[::2])),
    before(AREA, "first splat twice", SUM, "first of the splats taken twice|splats 0 taken twice",
           some_splats(lambda p: np.concatenate([p[:1], p]))),
    before(AREA, "last splat twice", SUM, "last of the splats taken twice|splats \\d+ taken twice",
           some_splats(lambda p: np.concatenate([p, p[-1:]]))),
    before(AREA, "partial warp of splats", SUM, "partial block of 32 of the splats", some_splats(lambda p: p[: len(p) // 32 * 32 or len(p)])),
    before(AREA, "lane 31 of splats", SUM, "every 32th of the splats left out", some_splats(lambda p: p[np.arange(len(p)) % 32 != 31])),
    patched(AREA, "a store in place of an addition", SUM, "store in place of an addition",
            (ADD, "        here = (g > 0)[:, :, None]\n        C[top:bottom, left:right] = np.where(here, g[:, :, None] * splat[5:8], C[top:bottom, left:right])\n")),
    patched(AREA, "a maximum in place of a sum", SUM, "largest of the splats",
            (ADD, "        C[top:bottom, left:right] = np.maximum(C[top:bottom, left:right], g[:, :, None] * splat[5:8])\n")),
    Planted("a sum that is not cleared", AREA, (SUM,), "vector before", stale),
    Planted("a last row that is not written", AREA, (SUM,), "vector before|last of the rows", unwritten_rows),
    patched(AREA, "mu cut to whole pixels", SUM, "positions|centre|whole pixels|pixel", ("x, y, l11, l21, l22 = splat[:5]\n        d_x", "x, y, l11, l21, l22 = splat[:5]\n        x, y = np.floor(x), np.floor(y)\n        d_x")),
    before(AREA, "mu in binary16", SUM, "binary16", half_splats(slice(0, 2))),
    patched(AREA, "columns at integers only", SUM, "columns|integer", ("d_x = np.arange(left, right) + 0.5 - x", "d_x = np.arange(left, right) - x")),
    patched(AREA, "centre a half too much", SUM, "centre|half a pixel|pixel", ("d_x = np.arange(left, right) + 0.5 - x", "d_x = np.arange(left, right) + 1.0 - x")),
    patched(AREA, "exp2 for exp", SUM, "exp2|2\\^|base 2", (G, "g = np.where(sigma <= LN_255, np.exp2(-sigma), 0.0)")),
    patched(AREA, "two sigma", SUM, "two standard deviations|support|covered|smaller", (G, "g = np.where(sigma <= 2.0, np.exp(-sigma), 0.0)")),
    patched(AREA, "sigma quartered", SUM, "sigma|factor of 1/2|u.u/4", ("sigma = (u1 * u1 + u2 * u2) / 2  # (9-1)", "sigma = (u1 * u1 + u2 * u2) / 4")),
    patched(AREA, "l11 squared", SUM, "variance|squared", ("u1 = d_x / l11\n        u2 = (d_y - l21 * u1) / l22\n        sigma", "u1 = d_x / (l11 * l11)\n        u2 = (d_y - l21 * u1) / (l22 * l22)\n        sigma")),
    patched(AREA, "colour magnitudes", SUM, "negative", (ADD, "        C[top:bottom, left:right] += g[:, :, None] * abs(splat[5:8])\n")),
    patched(AREA, "colours clamped first", SUM, "colour|above 1|negative", (ADD, "        C[top:bottom, left:right] += g[:, :, None] * np.clip(splat[5:8], 0, 1)\n")),
    patched(AREA, "sum not below zero", SUM, "negative|below 0|clamped", (ENDED, '        return {"sum": np.maximum(C, 0).astype(np.float32)}')),
    patched(AREA, "centre held inside", SUM, "outside|dropped|moved", ("x, y, l11, l21, l22 = splat[:5]\n        d_x", "x, y, l11, l21, l22 = splat[:5]\n        x, y = min(max(x, 0), width), min(max(y, 0), height)\n        d_x")),
    after(AREA, "frame truncated by a cast", "to_frame", "rounded down", lambda out, i: {"frame": (np.clip(i["sum"].astype(np.float64), 0, 1) * (2 ** i["bit_depth"] - 1)).astype(out["frame"].dtype)}),
    after(AREA, "frame ties up", "to_frame", "ties|half up", lambda out, i: {"frame": np.floor(np.clip(i["sum"].astype(np.float64), 0, 1) * (2 ** i["bit_depth"] - 1) + 0.5).astype(out["frame"].dtype)}),
    after(AREA, "frame of 8 bits in 16", "to_frame", "bit_depth|8 bits", lambda out, i: {"frame": np.rint(np.clip(i["sum"].astype(np.float64), 0, 1) * 255).astype(out["frame"].dtype)}),
    after(AREA, "frame big-endian", "to_frame", "other order|byte", lambda out, i: {"frame": out["frame"].byteswap()}),
    after(AREA, "frame below zero wraps", "to_frame", "below 0|wrap", lambda out, i: {"frame": np.where(np.nan_to_num(i["sum"]) < 0, np.iinfo(out["frame"].dtype).max, out["frame"]).astype(out["frame"].dtype)}),
    after(AREA, "frame first 64 pixels", "to_frame", "pixels, row after row, from 64", lambda out, i: {"frame": np.where(np.arange(out["frame"].size).reshape(out["frame"].shape) < 192, out["frame"], 0).astype(out["frame"].dtype)}),
    patched(AREA, "strict first 64 splats", "render_sum_deterministic", "splats from 64|first 64", ("        for splat, (left, right, top, bottom) in zip(parameters, reach):\n            if left", "        for splat, (left, right, top, bottom) in zip(parameters[:64], reach):\n            if left")),
    patched(AREA, "strict pixel centre", "render_sum_deterministic", "centre|integer", ("u1 = ((columns + HALF) - x) * r1", "u1 = (columns - x) * r1"), ("u2 = ((rows[:, None] + HALF) - y) * r2", "u2 = (rows[:, None] - y) * r2")),
    patched(AREA, "strict clamp after each splat", "render_sum_deterministic", "clamped", ("np.where(covered[:, :, None], pixels + g * splat[5:8], pixels)", "np.where(covered[:, :, None], np.clip(pixels + g * splat[5:8], 0, 1), pixels)")),
    after(AREA, "strict flushed results", "render_sum_deterministic", "subnormal|flush", lambda out, i: {"sum": np.where(abs(out["sum"]) < 2.0**-126, np.float32(0), out["sum"])}),
    patched(AREA, "strict no cut", "render_sum_deterministic", "no cut|support|cover|box", ("            covered = m <= SUPPORT_SQUARED\n", "            covered = m <= 100\n")),
    before(AREA, "render_frame drops last splat", "render_frame", "last of the splats left out|splats \\d+ left out", some_splats(lambda p: p[:-1])),
    after(AREA, "render_frame last row", "render_frame", "last of the rows", lambda out, i: (out["frame"].__setitem__(np.s_[-1:], 0), out)[1]),
    after(AREA, "scale with the old width", "scale_parameters", "nothing|x|width|not scaled|1/|times", lambda out, i: (out["parameters"].__setitem__(np.s_[:, 0], i["parameters"][:, 0]), out)[1]),
    after(AREA, "scale only first 8 rows", "scale_parameters", "from 8 on", lambda out, i: (out["parameters"].__setitem__(np.s_[8:], 0), out)[1]),
)  # fmt: skip
