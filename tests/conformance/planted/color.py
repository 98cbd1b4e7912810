"""Mutants of colour conversion and metrics."""

import numpy as np

from planted import after, patched

AREA = "colour"
BOTH = "planes_to_frame frame_to_planes"

PLANTED = (
    after(AREA, "bgr", "planes_to_frame", "B, G, R", lambda out, i: {"frame": out["frame"][:, :, ::-1].copy()}),
    after(AREA, "cb and cr", "frame_to_planes", "cb|Cb", lambda out, i: {"cb": out["cr"], "cr": out["cb"]}),
    after(AREA, "frame transposed", "planes_to_frame", "columns one after", lambda out, i: {"frame": np.ascontiguousarray(out["frame"].transpose(1, 0, 2)).reshape(out["frame"].shape)}),
    after(AREA, "frame planar", "planes_to_frame", "planes one after", lambda out, i: {"frame": np.ascontiguousarray(out["frame"].transpose(2, 0, 1)).reshape(out["frame"].shape)}),
    after(AREA, "last row", "planes_to_frame", "last of the rows", lambda out, i: (out["frame"].__setitem__(np.s_[-1:], 0), out)[1]),
    after(AREA, "odd column", "planes_to_frame", "every second of the columns|last of the columns", lambda out, i: (out["frame"].__setitem__(np.s_[:, 1::2], 0), out)[1]),
    patched(AREA, "full range always", BOTH, "full range", ("if video_full_range_flag == 1:\n        luma_gain", "if video_full_range_flag >= 0:\n        luma_gain")),
    patched(AREA, "limited range with 255", BOTH, "limited|range|video_full_range_flag", ("luma_gain, luma_offset = 219 * unit, 16 * unit", "luma_gain, luma_offset = 255 * unit, 16 * unit")),
    patched(AREA, "luma offset left out", BOTH, "offset|limited|video_full_range_flag|smaller by 16", ("luma_gain, luma_offset = 219 * unit, 16 * unit", "luma_gain, luma_offset = 219 * unit, 0")),
    patched(AREA, "2020 for 709", BOTH, "matrix_coefficients = 1|BT\\.|matrix_coefficients taken as 9", ("    1: (0.2126, 0.0722),", "    1: (0.2627, 0.0593),")),
    patched(AREA, "709 luma with 601 chroma", BOTH, "BT.601 chroma|BT.709|chroma", ("        cb = 2 * (1 - kb)\n        cr = 2 * (1 - kr)\n        forward", "        cb = 2 * (1 - 0.114)\n        cr = 2 * (1 - 0.299)\n        forward")),
    patched(AREA, "240m for fcc", BOTH, "matrix_coefficients = 4", ("    4: (0.30, 0.11),", "    4: (0.212, 0.087),")),
    patched(AREA, "chroma doubled by copying", "planes_to_frame", "nearest", ("        weights[i, max(j, 0)] += 4 - fraction\n        weights[i, min(j + 1, samples - 1)] += fraction", "        weights[i, i // 2] += 4")),
    patched(AREA, "chroma of the left", "frame_to_planes", "one pixel|mean", ("taps = {0: [(-1, 1), (0, 2), (1, 1)], 1: [(0, 2), (1, 2)], 2:", "taps = {0: [(0, 4)], 1: [(0, 4)], 2:")),
    patched(AREA, "siting ignored", BOTH, "between the columns|chroma_sample_loc_type|siting", ("    columns = PHASE_OF_COLUMNS[chroma_sample_loc_type] if", "    columns = 1 if")),
    patched(AREA, "samples cut", BOTH, "rounded down", ("rounded = np.rint(np.clip(values, 0, peak))", "rounded = np.trunc(np.clip(values, 0, peak))")),
    patched(AREA, "samples wrap", BOTH, "wrap", ("rounded = np.rint(np.clip(values, 0, peak))", "rounded = np.rint(values) % (peak + 1)")),
    patched(AREA, "peak of 8 bits", "planes_to_frame", "bit_depth|8 bits", ("to_rgb = inverse * ((2**bit_depth - 1) / gain)", "to_rgb = inverse * (255 / gain)")),
    patched(AREA, "ycgco signs", BOTH, "matrix_coefficients = 8|Cg", ("inverse = [[1, -1, 1], [1, 1, 0], [1, -1, -1]]", "inverse = [[1, 1, 1], [1, -1, 0], [1, 1, -1]]"), ("forward = [[0.25, 0.5, 0.25], [-0.25, 0.5, -0.25], [0.5, 0, -0.5]]", "forward = [[0.25, 0.5, 0.25], [0.25, -0.5, 0.25], [0.5, 0, -0.5]]")),
    after(AREA, "mse of one channel", "metrics", "third|1/3|red", lambda out, i: {"mse": out["mse"] / 3}),
    after(AREA, "mse per pixel", "metrics", "3 times", lambda out, i: {"mse": out["mse"] * 3}),
    after(AREA, "mse last row", "metrics", "last of the rows", lambda out, i: {"mse": np.array(((i["a"].astype("f8") - i["b"]) ** 2)[:-1].sum() / i["a"].size)}),
    patched(AREA, "psnr by log", "metrics", "psnr", ("psnr = 10 * math.log10(peak * peak / mse)", "psnr = 10 * math.log(peak * peak / mse)")),
    patched(AREA, "psnr of the root", "metrics", "psnr", ("psnr = 10 * math.log10(peak * peak / mse)", "psnr = 10 * math.log10(peak / mse)")),
    patched(AREA, "ssim window of 7", "metrics", "ms_ssim|window", ("WINDOW_SIZE = 11", "WINDOW_SIZE = 7")),
    patched(AREA, "ssim deviation 2", "metrics", "ms_ssim|window|deviation", ("WINDOW_DEVIATION = 1.5", "WINDOW_DEVIATION = 2.0")),
)  # fmt: skip
