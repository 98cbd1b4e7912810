"""Mutants of LSQ+ and of the residual vector quantiser."""

import numpy as np

from planted import after, before, patched

AREA = "quantization"


def rows(first, *names):
    return lambda out, i: {name: np.concatenate([out[name][:first], 0 * out[name][first:]]) for name in names}


PLANTED = (
    patched(AREA, "codes rounded up", "lsq_quantize", "up|rounded", ("codes = np.rint(clamped)", "codes = np.ceil(clamped)")),
    patched(AREA, "codes cut", "lsq_quantize", "down", ("codes = np.rint(clamped)", "codes = np.trunc(clamped)")),
    patched(AREA, "codes not below 0", "lsq_quantize", "below", ("clamped = np.minimum(np.maximum(t, np.float32(0)), largest)", "clamped = np.minimum(t, largest)")),
    patched(AREA, "codes of one bit less", "lsq_quantize", "signed|largest|range", ("largest = np.float32(2**bits - 1)", "largest = np.float32(2 ** (bits - 1) - 1)")),
    patched(AREA, "one scale for all", "lsq_quantize lsq_gradients", "one scale|l21|first column|per tensor", ("        return difference / scale", "        return difference / scale[0]")),
    patched(AREA, "no offset", "lsq_quantize", "offset", ("        difference = x - offset\n", "        difference = x + 0 * offset\n")),
    after(AREA, "codes first 16 rows", "lsq_quantize", "from 16 on", rows(16, "codes")),
    after(AREA, "codes big-endian", "lsq_quantize", "other order", lambda out, i: {"codes": out["codes"].byteswap()}),
    after(AREA, "dequantise columns", "lsq_dequantize", "fields|columns", lambda out, i: {"values": np.ascontiguousarray(out["values"].T).reshape(out["values"].shape)}),
    patched(AREA, "offset first", "lsq_dequantize", "offset|\\(q", ("    product = codes.astype(np.float32) * scale\n    values = product + offset", "    values = (codes.astype(np.float32) + offset) * scale")),
    after(AREA, "dequantise last row", "lsq_dequantize", "last of the", rows(-1, "values")),
    before(AREA, "lsq gradients first 16", "lsq_gradients", "from 16 on left out|from 16 on", lambda i: {**i, "grad_output": np.where(np.arange(len(i["x"]))[:, None] < 16, i["grad_output"], np.float32(0))}),
    before(AREA, "lsq partial block of 8", "lsq_gradients", "partial block of 8", lambda i: {**i, "grad_output": np.where(np.arange(len(i["x"]))[:, None] < len(i["x"]) // 8 * 8, i["grad_output"], np.float32(0))}),
    before(AREA, "lsq last row", "lsq_gradients", "last of the", lambda i: {**i, "grad_output": np.where(np.arange(len(i["x"]))[:, None] < len(i["x"]) - 1, i["grad_output"], np.float32(0))}),
    after(AREA, "scale gradient mean", "lsq_gradients", "1/\\(N\\)|mean", lambda out, i: {"grad_scale": (out["grad_scale"] / np.float32(max(1, len(i["x"])))).astype(np.float32)}),
    after(AREA, "scale gradient sign", "lsq_gradients", "other sign|t - q", lambda out, i: {"grad_scale": -out["grad_scale"]}),
    after(AREA, "gradient scaled by sqrt", "lsq_gradients", "sqrt", lambda out, i: {"grad_scale": (out["grad_scale"] / np.sqrt(max(1, len(i["x"])) * (2 ** i["bits"] - 1))).astype(np.float32), "grad_offset": (out["grad_offset"] / np.sqrt(max(1, len(i["x"])) * (2 ** i["bits"] - 1))).astype(np.float32)}),
    patched(AREA, "gradient everywhere", "lsq_gradients", "outside|clamp", ("of_x = np.where(inside, 1.0, 0.0)", "of_x = np.ones(t.shape)")),
    patched(AREA, "gradient of t", "lsq_gradients", "grad_scale|scale", ("of_scale = np.where(inside, q - t, 0.0)", "of_scale = np.where(inside, -t, 0.0)")),
    patched(AREA, "gradient zero above", "lsq_gradients", "above", ("of_scale = np.where(above, largest, of_scale)", "of_scale = np.where(above, 0.0, of_scale)")),
    patched(AREA, "stages in reverse", "rvq_assign", "reverse", ("        for k in range(len(books)):\n            with", "        for k in reversed(range(len(books))):\n            with")),
    patched(AREA, "farthest codeword", "rvq_assign", "farthest|largest", ("best = np.argmin(distance)", "best = np.argmax(distance)")),
    patched(AREA, "two channels", "rvq_assign", "blue|channel", ("distance = (squares[:, 0] + squares[:, 1]) + squares[:, 2]", "distance = squares[:, 0] + squares[:, 1]")),
    patched(AREA, "last of ties", "rvq_assign", "equal distances|ties", ("best = np.argmin(distance)", "best = np.flatnonzero(distance == distance.min())[-1]")),
    patched(AREA, "residual not passed on", "rvq_assign", "itself|stage", ("            r = r - books[k][best]\n    return", "    return")),
    after(AREA, "assign first 16", "rvq_assign", "from 16 on", rows(16, "indices")),
    after(AREA, "assign columns", "rvq_assign", "fields|columns", lambda out, i: {"indices": np.ascontiguousarray(out["indices"].T).reshape(out["indices"].shape)}),
    after(AREA, "assign first stage only", "rvq_assign", "stage", lambda out, i: (out["indices"].__setitem__(np.s_[:, 1:], 0), out)[1]),
    patched(AREA, "update first 8 rows", "rvq_update", "from 8 on left out", ("users = r[chosen == b].astype(np.float64)", "users = r[:8][chosen[:8] == b].astype(np.float64)")),
    patched(AREA, "update last row", "rvq_update", "last of the (rows|splats) left out", ("users = r[chosen == b].astype(np.float64)", "users = r[:-1][chosen[:-1] == b].astype(np.float64)")),
    patched(AREA, "update decay twice", "rvq_update", "decay|sums", ("sums[b] = decay * sums[b] + (1 - decay)", "sums[b] = decay * decay * sums[b] + (1 - decay)")),
    patched(AREA, "update mean of users", "rvq_update", "mean|sums", ("(1 - decay) * np.sum(users, axis=0)", "(1 - decay) * np.sum(users, axis=0) / max(1, len(users))")),
    patched(AREA, "update without smoothing", "rvq_update", "smoothing", ("smoothed = (counts[b] + smoothing) / (total + len(book) * smoothing) * total", "smoothed = counts[b]")),
    after(AREA, "commitment last row", "commitment", "last of the", lambda out, i: {"grad_x": np.concatenate([out["grad_x"][:-1], 0 * out["grad_x"][-1:]])}),
    after(AREA, "commitment halved", "commitment", "half|factor 2", lambda out, i: {"grad_x": out["grad_x"] / np.float32(2)}),
    patched(AREA, "commitment of the first stage", "commitment", "first stage|stage", ("for error in r[1:]:", "for error in r[1:2]:")),
    patched(AREA, "commitment not a mean", "commitment", "N", ("components = max(3 * len(x), 1)", "components = 1")),
)  # fmt: skip
