"""Mutants of training, quantization and colour, written without a look at what the kit says."""

import numpy as np

from planted import after, before, patched


def of(name, change):
    """Something done to one output, `change(output, inputs)`."""
    return lambda out, inputs: {name: np.asarray(change(out[name], inputs), out[name].dtype)}


TRAINING = (
    after("training", "previous never stored", "adan_step", r"previous", of("previous", lambda o, i: i["previous"])),
    after("training", "steps never counted", "adan_step", r"\bsteps\b", of("steps", lambda o, i: i["steps"])),
    before("training", "beta1 and beta2 exchanged", "adan_step", r"beta", lambda i: {"beta1": i["beta2"], "beta2": i["beta1"]}),
    patched("training", "1 - beta2 before the difference", "adan_step", r"(?i)ahead|1 - beta2|beta2.* d\b|\bn\b",
            ("    ahead = g + beta2 * d", "    ahead = g + (1 - beta2) * d")),
    patched("training", "v added without beta2", "adan_step", r"(?i)beta2|\bv\b", ("corrected_m + beta2 * corrected_v", "corrected_m + corrected_v")),
    patched("training", "n corrected by beta2", "adan_step", r"(?i)\bn\b|beta[23]|bias|correct",
            ("corrected_n = n / (1 - beta3**k)", "corrected_n = n / (1 - beta2**k)")),
    before("training", "the first rate for all columns", "adan_step", r"(?i)\brates?\b|columns?", lambda i: {"rates": np.full_like(i["rates"], i["rates"][0])}),
    patched("training", "a loss of absolute differences", "loss", r"(?i)absolute|\bL1\b|magnitude|squar|\|", ("np.sum(difference * difference)\n    residual", "np.sum(abs(difference))\n    residual")),
    patched("training", "a residual without its 2", "loss", r"(?i)1/2|0\.5|\bhalf|factor|\b2\b|twice", ("residual = 2 * difference", "residual = difference")),
    patched("training", "a loss of whole blocks of 256 pixels", "loss", r"(?i)256|last|pixels?.*(lost|left out|missing|from)|part of|whole",
            ("    total = np.sum(difference * difference)\n    residual",
             "    total = np.sum((difference * difference).reshape(-1, 3)[: pixels // 256 * 256])\n    residual")),
    patched("training", "gradients of colours without the weight", "weighted_gradients", r"(?i)weight|\bw\b|colou?r|red",
            ("result[:, channel] = w * by_product", "result[:, channel] = by_product")),
    before("training", "weights kept positive", "weighted_parameters", r"(?i)negative|clamp|below 0|weight|\bw\b",
           lambda i: {"values": np.concatenate([i["values"][:, :8], np.maximum(i["values"][:, 8:], 0)], 1)}),
    patched("training", "a decay without steps", "learning_rates", r"(?i)interval|floor|continu|whole|division|fraction|smooth|in every iteration",
            ("exponent = int(iterations[j]) // interval", "exponent = int(iterations[j]) / interval")),
    before("training", "iterations counted from 1", "learning_rates", r"(?i)from 1|\+ 1|one (too|early|ahead)|earl|iteration", lambda i: {"iterations": i["iterations"] + 1}),
    patched("training", "the lowest weights with their sign", "prune", r"(?i)sign|negative|magnitude|abs|\|w\|", ("magnitude = np.abs(weights)", "magnitude = weights")),
    before("training", "kept and removed mixed up", "prune", r"(?i)removed|complement|stay|kept|number of|too (few|many)|length|shape",
           lambda i: {"removed": len(i["weights"]) - i["removed"]}),
    patched("training", "previous gradients of the splats before", "compact", r"previous", ('"previous": previous[survivors]', '"previous": previous[: len(survivors)]')),
    patched("training", "new rows placed by the width", "augment", r"(?i)height|width|\by\b|column 1", ("uniforms[:, 1] * np.float32(height)", "uniforms[:, 1] * np.float32(width)")),
    patched("training", "new weights of 1", "augment", r"(?i)weight|0\.01|column 8|\bw\b|100 times", ("NEW_WEIGHT = np.float32(0.01)", "NEW_WEIGHT = np.float32(1)")),
    patched("training", "new l22 without its half", "augment", r"(?i)l22|column 4|0\.5|1/2", ("new[:, 4] = uniforms[:, 4] + np.float32(0.5)", "new[:, 4] = uniforms[:, 4]")),
    patched("training", "calm only below the tolerance", "converged", r"(?i)toleran|<|strict|equal", ("if change <= tolerance", "if change < tolerance")),
    patched("training", "changes relative to the loss", "converged", r"(?i)relativ|divided|quotient|percent",
            ("if change <= tolerance", "if change <= tolerance * abs(float(losses[j]))")),
    patched("training", "the index of the last loss", "converged", r"(?i)from 0|one (less|too|earl)|- 1|index|count|early",
            ('"iteration": np.array(j + 1', '"iteration": np.array(j')),
    patched("training", "a window of the past only", "select_key_frames", r"(?i)window|past|behind|ahead|later|before",
            ("last = min(frames - 1, t + window)", "last = min(frames - 1, t)")),
    patched("training", "a sequence that begins without a key frame", "select_key_frames", r"(?i)frame 0|first|element 0|missing", ("keys = {0}", "keys = set()")),
    patched("training", "earlier key frames among the others", "select_key_frames", r"(?i)keys|key frames?|others", ("if j != t and j not in keys]", "if j != t]")),
    patched("training", "the remainder pruned at first", "pruning_plan", r"(?i)remainder|first|last|share|rest\b", ("if time == last:", "if time == times[0]:")),
    patched("training", "a fraction cut to whole splats", "pruning_plan", r"(?i)trunc|floor|round|down|cut|total", ("total = round(fraction * splats)", "total = int(fraction * splats)")),
)  # fmt: skip

QUANTIZATION = (
    patched("quantization", "codes by the reciprocal of the scale", "lsq_quantize", r"(?i)reciproc|1 ?/|multipl",
            ("        return difference / scale", "        return difference * (np.float32(1) / scale)")),
    patched("quantization", "x and offset divided apart", "lsq_quantize", r"(?i)offset|apart|separat|order|beta",
            ("        difference = x - offset\n        return difference / scale", "        return x / scale - offset / scale")),
    patched("quantization", "codes of a signed range", "lsq_quantize", r"(?i)sign|range|clamp|2\^\(|largest|half of the|bits taken as one less",
            ("    largest = np.float32(2**bits - 1)", "    largest = np.float32(2 ** (bits - 1) - 1)")),
    after("quantization", "codes kept in bytes", "lsq_quantize", r"(?i)8 bits|modul|256|byte|wrap", of("codes", lambda o, i: o & 255)),
    after("quantization", "the scale's gradient over the root of N Q", "lsq_gradients", r"(?i)root|sqrt|ratio|times|factor|normal",
          of("grad_scale", lambda o, i: o / np.sqrt(max(len(i["x"]), 1) * (2 ** i["bits"] - 1)))),
    patched("quantization", "no offset's gradient from below", "lsq_gradients", r"(?i)below|t < 0|low|clamp|offset",
            ("of_offset = np.where(inside, 0.0, 1.0)", "of_offset = np.where(above, 1.0, 0.0)")),
    patched("quantization", "straight through the clamp too", "lsq_gradients", r"(?i)clip|clamp|outside|inside|beyond|grad_x",
            ("of_x = np.where(inside, 1.0, 0.0)", "of_x = np.ones(t.shape)")),
    patched("quantization", "distances by norms and products", "rvq_assign", r"(?i)expan|norm|product|\bdot|2 ?x|\|",
            ("distance = (squares[:, 0] + squares[:, 1]) + squares[:, 2]",
             "distance = np.sum(books[k] * books[k], 1) - np.float32(2) * (books[k] @ r)")),
    patched("quantization", "of codewords alike the last", "rvq_assign", r"(?i)\btie|last|equal|alike|higher|first of",
            ("best = np.argmin(distance)", "best = len(distance) - 1 - np.argmin(distance[::-1])")),
    patched("quantization", "every stage of x itself", "rvq_assign", r"(?i)residual|stage|itself|left over|subtract",
            ("            r = r - books[k][best]\n", "")),
    after("quantization", "one block of 1024 vectors", "rvq_assign", r"1024", lambda o, i: {"indices": np.where(np.arange(len(o["indices"]))[:, None] < 1024, o["indices"], 0).astype(np.uint16)}),
    before("quantization", "decay and its complement exchanged", "rvq_update", r"(?i)decay", lambda i: {"decay": 1 - i["decay"]}),
    patched("quantization", "counts that are not smoothed", "rvq_update", r"(?i)smooth",
            ("smoothed = (counts[b] + smoothing) / (total + len(book) * smoothing) * total", "smoothed = counts[b]")),
    patched("quantization", "codewords kept in binary32", "rvq_update", r"(?i)binary16|binary32|\bhalf|round", ("moved.astype(np.float16).astype", "moved.astype")),
    patched("quantization", "a commitment to the last stage only", "commitment", r"(?i)stage|last|sum of", ("    for error in r[1:]:", "    for error in r[-1:]:")),
    patched("quantization", "a commitment by vectors", "commitment", r"(?i)\b3\b|component|three|ratio|times", ("components = max(3 * len(x), 1)", "components = max(len(x), 1)")),
)  # fmt: skip

COLOR = (
    patched("color", "unspecified matrices as of high definition", "planes_to_frame frame_to_planes", r"(?i)unspecif|576|matrix|709|601",
            ("return 6 if height <= 576 else 1", "return 1")),
    before("color", "cr before cb", "planes_to_frame", r"(?i)\bcb|\bcr\b|chroma|exchang", lambda i: {"cb": i["cr"], "cr": i["cb"]}),
    patched("color", "chroma samples repeated", "planes_to_frame", r"(?i)nearest|replic|interpol|repeat|chroma|filter|up_filter",
            ("        weights[i, max(j, 0)] += 4 - fraction\n        weights[i, min(j + 1, samples - 1)] += fraction", "        weights[i, i // 2] = 4")),
    patched("color", "chroma with the range of luma", "planes_to_frame", r"(?i)224|219|gain|chroma|range",
            ("chroma_gain, chroma_offset = 224 * unit", "chroma_gain, chroma_offset = 219 * unit")),
    patched("color", "samples that wrap", "planes_to_frame", r"(?i)wrap|clip|clamp|modul|overflow",
            ("rounded = np.rint(np.clip(values, 0, peak))", "rounded = np.rint(values).astype(np.int64) & peak")),
    patched("color", "a black of 16 at every depth", "planes_to_frame frame_to_planes", r"(?i)\b16\b|black|offset|depth|bits|luma|\by\b",
            ("luma_gain, luma_offset = 219 * unit, 16 * unit", "luma_gain, luma_offset = 219 * unit, 16")),
    before("color", "chroma always in the centre", "frame_to_planes", r"(?i)\bloc|sit|phase|left|chroma|centre", lambda i: {"chroma_sample_loc_type": 1}),
    before("color", "a PSNR of 8 bits", "metrics", r"(?i)peak|255|depth|psnr", lambda i: {"bit_depth": 8}),
    after("color", "differences of bytes", "metrics", r"(?i)8 bits|wrap|unsigned|modul|sign|overflow",
          of("mse", lambda o, i: np.mean((i["a"] - i["b"]).astype(np.float64) ** 2))),
    patched("color", "one scale of SSIM", "metrics", r"(?i)scale|SSIM, not|single",
            ("    while scales < 5 and side >= WINDOW_SIZE:", "    while False:")),
    patched("color", "a window of 8 samples", "metrics", r"(?i)window|taps|gauss", ("WINDOW_SIZE = 11", "WINDOW_SIZE = 8")),
)  # fmt: skip

PLANTED = (*TRAINING, *QUANTIZATION, *COLOR)
