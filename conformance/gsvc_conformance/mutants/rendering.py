"""Mutants of rendering, bounded and deterministic, and of the conversion to a frame."""

from gsvc_conformance.mutants.mutant import Mutant, mutant

AREA = "rendering"
DETERMINISTIC = "deterministic"

FUSED_POLYNOMIAL = (
    "    def fused(a, b, c):\n        return (a.astype(np.float64) * b + c).astype(np.float32)\n"
    "    p = fused(fused(fused(t, K5, fused(m, K4, K3)), t, fused(m, K2, K1)), m, ONE)\n"
)
FUSED_ROW = "    u2 = (((rows[:, None] + HALF) - y).astype(np.float64) * r2 - (l * u1) * f).astype(np.float32)\n"
FUSED_SHEAR = "    u2 = (((rows[:, None] + HALF) - y) * r2 - (l * u1).astype(np.float64) * f).astype(np.float32)\n"

BOUNDED: tuple[Mutant, ...] = (
    mutant(AREA, "pixel-centre-at-integer", "pixel centres at integer positions",
        ("d_x = np.arange(left, right) + 0.5 - x", "d_x = np.arange(left, right) - x"),
        ("d_y = np.arange(top, bottom)[:, None] + 0.5 - y\n        u1 = d_x", "d_y = np.arange(top, bottom)[:, None] - y\n        u1 = d_x")),
    mutant(AREA, "pixel-centre-x-only", "pixel centres at integer rows",
        ("d_y = np.arange(top, bottom)[:, None] + 0.5 - y\n        u1 = d_x", "d_y = np.arange(top, bottom)[:, None] - y\n        u1 = d_x")),
    mutant(AREA, "grid-with-both-ends", "pixels on a grid from 0 to W and 0 to H with both ends (linspace, align_corners)",
        ("d_x = np.arange(left, right) + 0.5 - x",
         "left, right = max(left - 1, 0), min(right + 1, width)\n        top, bottom = max(top - 1, 0), min(bottom + 1, height)\n"
         "        d_x = np.arange(left, right) * (width / max(width - 1, 1)) - x"),
        ("d_y = np.arange(top, bottom)[:, None] + 0.5 - y\n        u1 = d_x",
         "d_y = np.arange(top, bottom)[:, None] * (height / max(height - 1, 1)) - y\n        u1 = d_x")),
    mutant(AREA, "scales-and-angle", "l11 and l22 taken for scales, and l21 for the angle of their axes",
        ("u1 = d_x / l11\n        u2 = (d_y - l21 * u1) / l22",
         "u1 = (math.cos(l21) * d_x + math.sin(l21) * d_y) / l11\n        u2 = (math.cos(l21) * d_y - math.sin(l21) * d_x) / l22")),
    mutant(AREA, "support-1-256", "a cut at a weight of 1/256",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)", "g = np.where(sigma <= 5.545177444479562, np.exp(-sigma), 0.0)"),
        ("reach = boxes(parameters, width, height, SUPPORT_RADIUS)", "reach = boxes(parameters, width, height, 3.4)")),
    mutant(AREA, "support-without-end", "no cut at all",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)", "g = np.exp(-sigma)"),
        ("reach = boxes(parameters, width, height, SUPPORT_RADIUS)", "reach = boxes(parameters, width, height, 20.0)")),
    mutant(AREA, "support-three-sigma", "an ellipse of three standard deviations",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)", "g = np.where(sigma <= 4.5, np.exp(-sigma), 0.0)")),
    mutant(AREA, "support-two-sigma", "an ellipse of two standard deviations as the support",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)", "g = np.where(sigma <= 2.0, np.exp(-sigma), 0.0)")),
    mutant(AREA, "weight-exp2", "exp2 in place of exp",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)", "g = np.where(sigma <= LN_255, np.exp2(-sigma), 0.0)")),
    mutant(AREA, "sigma-quartered", "exp(-u.u/4) in place of exp(-u.u/2)",
        ("sigma = (u1 * u1 + u2 * u2) / 2  # (9-1)", "sigma = (u1 * u1 + u2 * u2) / 4")),
    mutant(AREA, "support-rounded", "an edge at the rounded constant 5.54",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)", "g = np.where(sigma <= 5.54, np.exp(-sigma), 0.0)")),
    mutant(AREA, "support-square", "a square of ceil(3 sigma) around the centre as the support, cut to the weight of 1/255",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)",
         "side = np.ceil(3 * np.sqrt(max(l11 * l11, l21 * l21 + l22 * l22)))\n"
         "        near = (abs(d_x) <= side) & (abs(d_y) <= side)\n"
         "        g = np.where((sigma <= LN_255) & near, np.exp(-sigma), 0.0)")),
    mutant(AREA, "support-by-tiles",
        "the 16x16 tiles that a square of ceil(3 sigma) touches as the support, cut to the weight of 1/255",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)",
         "half = (l11 * l11 + l21 * l21 + l22 * l22) / 2\n"
         "        side = np.ceil(3 * np.sqrt(half + np.sqrt(max(0.1, half * half - (l11 * l22) ** 2))))\n"
         "        columns, rows = np.arange(left, right) // 16, np.arange(top, bottom)[:, None] // 16\n"
         "        near = (columns >= (x - 0.5 - side) // 16) & (columns <= (x - 0.5 + side) // 16)\n"
         "        near = near & (rows >= (y - 0.5 - side) // 16) & (rows <= (y - 0.5 + side) // 16)\n"
         "        g = np.where((sigma <= LN_255) & near, np.exp(-sigma), 0.0)")),
    mutant(AREA, "support-disc", "a disc of three standard deviations of the longer axis as the support, without a cut by weight",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)",
         "half = (l11 * l11 + l21 * l21 + l22 * l22) / 2\n"
         "        longer = half + np.hypot((l11 * l11 - l21 * l21 - l22 * l22) / 2, l11 * l21)\n"
         "        g = np.where(d_x * d_x + d_y * d_y <= 9 * longer, np.exp(-sigma), 0.0)"),
        ("reach = boxes(parameters, width, height, SUPPORT_RADIUS)", "reach = boxes(parameters, width, height, 20.0)")),
    mutant(AREA, "support-box-alone", "the bounding box of the ellipse as the support",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)", "g = np.exp(-sigma)")),
    mutant(AREA, "first-256-splats", "the first 256 splats of a pixel only",
        ("for splat, (left, right, top, bottom) in zip(parameters.astype(np.float64), reach):",
         "for splat, (left, right, top, bottom) in zip(parameters.astype(np.float64)[:256], reach):")),
    mutant(AREA, "first-256-of-a-tile", "the first 256 splats of a tile of 16x16 pixels only",
        ("    C = np.zeros((height, width, 3))\n    reach =",
         "    C = np.zeros((height, width, 3))\n    filled = np.zeros((height // 16 + 1, width // 16 + 1), np.int64)\n    reach ="),
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)",
         "room = filled[np.arange(top, bottom)[:, None] // 16, np.arange(left, right) // 16] < 256\n"
         "        filled[top // 16 : -(-bottom // 16), left // 16 : -(-right // 16)] += 1\n"
         "        g = np.where((sigma <= LN_255) & room, np.exp(-sigma), 0.0)")),
    mutant(AREA, "tiles-by-centre", "splats drawn in the 16x16 tile of their centre and its neighbours only",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)",
         "tiles = (abs(np.arange(left, right) // 16 - x // 16) <= 1) & (abs(np.arange(top, bottom)[:, None] // 16 - y // 16) <= 1)\n"
         "        g = np.where((sigma <= LN_255) & tiles, np.exp(-sigma), 0.0)")),
    mutant(AREA, "splats-outside-dropped", "splats dropped whose centre lies outside the frame",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)",
         "g = np.where((sigma <= LN_255) & (0 <= x <= width) & (0 <= y <= height), np.exp(-sigma), 0.0)")),
    mutant(AREA, "small-splats-dropped", "splats dropped that are smaller than a pixel",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)",
         "g = np.where((sigma <= LN_255) & (l11 * l22 > 0.1), np.exp(-sigma), 0.0)")),
    mutant(AREA, "low-pass", "0.3 added to the variances, as in 3D splatting",
        ("        if left == right or top == bottom:\n            continue\n        x, y, l11, l21, l22 = splat[:5]\n",
         "        if left == right or top == bottom:\n            continue\n        left, right = max(left - 2, 0), min(right + 2, width)\n"
         "        top, bottom = max(top - 2, 0), min(bottom + 2, height)\n        x, y, l11, l21, l22 = splat[:5]\n"
         "        a, b, c = l11 * l11 + 0.3, l11 * l21, l21 * l21 + l22 * l22 + 0.3\n"
         "        l11, l21, l22 = np.sqrt(a), b / np.sqrt(a), np.sqrt(c - b * b / a)\n")),
    mutant(AREA, "half-on-the-diagonal", "0.5 added to l11 and l22, as to the factor that GaussianImage stores",
        ("        if left == right or top == bottom:\n            continue\n        x, y, l11, l21, l22 = splat[:5]\n",
         "        if left == right or top == bottom:\n            continue\n        left, right = max(left - 2, 0), min(right + 2, width)\n"
         "        top, bottom = max(top - 2, 0), min(bottom + 2, height)\n        x, y, l11, l21, l22 = splat[:5]\n"
         "        l11, l22 = l11 + 0.5, l22 + 0.5\n")),
    mutant(AREA, "conic-in-binary16", "the inverse covariance in binary16",
        ("        sigma = (u1 * u1 + u2 * u2) / 2  # (9-1)\n",
         "        with np.errstate(over='ignore'):\n"
         "            a, b, c = 1 / (l11 * l11) + (l21 / (l11 * l22)) ** 2, -l21 / l11 / (l22 * l22), 1 / (l22 * l22)\n"
         "            a, b, c = (float(np.float16(value)) for value in (a, b, c))\n"
         "        sigma = (a * d_x * d_x + c * d_y * d_y) / 2 + b * d_x * d_y\n"
         "        sigma = np.where(sigma >= 0, sigma, np.inf)\n")),
    mutant(AREA, "sigma-not-halved", "exp(-u.u) in place of exp(-u.u/2)",
        ("sigma = (u1 * u1 + u2 * u2) / 2  # (9-1)", "sigma = u1 * u1 + u2 * u2")),
    mutant(AREA, "l21-sign", "l21 with the wrong sign", ("u2 = (d_y - l21 * u1) / l22\n        sigma", "u2 = (d_y + l21 * u1) / l22\n        sigma")),
    mutant(AREA, "l21-left-out", "l21 left out", ("u2 = (d_y - l21 * u1) / l22\n        sigma", "u2 = d_y / l22 + 0 * u1\n        sigma")),
    mutant(AREA, "upper-triangle", "L taken for an upper triangular matrix",
        ("u1 = d_x / l11\n        u2 = (d_y - l21 * u1) / l22", "u2 = d_y / l22\n        u1 = (d_x - l21 * u2) / l11")),
    mutant(AREA, "diagonal-exchanged", "l11 and l22 exchanged",
        ("x, y, l11, l21, l22 = splat[:5]\n        d_x", "x, y, l22, l21, l11 = splat[:5]\n        d_x")),
    mutant(AREA, "inverse-factor", "L taken for the factor of the inverse covariance",
        ("u1 = d_x / l11\n        u2 = (d_y - l21 * u1) / l22", "u1 = d_x * l11 + l21 * d_y\n        u2 = d_y * l22")),
    mutant(AREA, "determinant-by-cancellation", "the covariance inverted by a determinant a c - b b in binary32",
        ("        sigma = (u1 * u1 + u2 * u2) / 2  # (9-1)\n",
         "        f_x, f_y, f_11, f_21, f_22 = (np.float32(value) for value in (d_x, d_y, l11, l21, l22))\n"
         "        a, b, c = f_11 * f_11, f_11 * f_21, f_21 * f_21 + f_22 * f_22\n"
         "        determinant = a * c - b * b\n"
         "        a, b, c = a / determinant, b / determinant, c / determinant\n"
         "        sigma = np.float32(0.5) * (c * f_x * f_x + a * f_y * f_y) - b * f_x * f_y\n"
         "        sigma = np.where((sigma < 0) | (determinant == 0), np.float32(np.inf), sigma)\n")),
    mutant(AREA, "shear-with-the-centre", "(j + 1/2) - (y + l21 u1) in binary32, which loses what d_y keeps",
        ("zip(parameters.astype(np.float64), reach):\n", "zip(parameters, reach):\n"),
        ("d_x = np.arange(left, right) + 0.5 - x", "d_x = (np.arange(left, right) + 0.5).astype(np.float32) - x"),
        ("u2 = (d_y - l21 * u1) / l22\n        sigma", "u2 = ((np.arange(top, bottom)[:, None] + 0.5).astype(np.float32) - (y + l21 * u1)) / l22\n        sigma")),
    mutant(AREA, "nan-covers", "pixels covered where sigma is not a number",
        ("    reach = boxes(parameters, width, height, SUPPORT_RADIUS)\n",
         "    drawn = (parameters[:, 2] >= SMALLEST_NORMAL) & (parameters[:, 4] >= SMALLEST_NORMAL)\n"
         "    reach = np.where(drawn[:, None], [0, width, 0, height], 0)\n"),
        ("zip(parameters.astype(np.float64), reach):\n", "zip(parameters, reach):\n"),
        ("d_x = np.arange(left, right) + 0.5 - x", "d_x = (np.arange(left, right) + 0.5).astype(np.float32) - x"),
        ("d_y = np.arange(top, bottom)[:, None] + 0.5 - y\n        u1 = d_x", "d_y = (np.arange(top, bottom)[:, None] + 0.5).astype(np.float32) - y\n        u1 = d_x"),
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)", "g = np.where(~(sigma > np.float32(LN_255)), np.exp(-sigma), 0.0)")),
    mutant(AREA, "transposed", "rows and columns exchanged",
        ("        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n",
         "        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n"
         "    if height == width:\n        C = C.transpose(1, 0, 2)\n"
         "    else:\n        C = C.reshape(width, height, 3).transpose(1, 0, 2)\n")),
    mutant(AREA, "upside-down", "the y axis upwards",
        ("        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n",
         "        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n    C = C[::-1]\n")),
    mutant(AREA, "channels-reversed", "channels in the order B, G, R",
        ("        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n",
         "        C[top:bottom, left:right] += g[:, :, None] * splat[7:4:-1]\n")),
    mutant(AREA, "alpha-blended", "splats blended over each other in place of summed",
        ("        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n",
         "        C[top:bottom, left:right] *= 1 - g[:, :, None]\n"
         "        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]\n")),
    *(
        mutant(AREA, name, sentence,
            ("    C = np.zeros((height, width, 3))\n    reach", "    C = np.zeros((height, width, 3))\n    left_over = np.ones((height, width, 1))\n    reach"),
            ("        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n",
             "        C[top:bottom, left:right] += left_over[top:bottom, left:right] * g[:, :, None] * splat[5:8]\n"
             f"        left_over[top:bottom, left:right] *= 1 - g[:, :, None]\n{behind}"))
        for name, sentence, behind in (
            ("blended-front-to-back", "splats blended front to back with a transmittance, in place of added", ""),
            ("blended-over-white", "splats blended front to back over a white background", "    C = C + left_over\n"))
    ),
    mutant(AREA, "normalised", "the sum divided by the sum of the weights",
        ("    C = np.zeros((height, width, 3))\n    reach", "    C = np.zeros((height, width, 3))\n    total = np.zeros((height, width, 1))\n    reach"),
        ("        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n",
         "        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]\n"
         "        total[top:bottom, left:right] += g[:, :, None]\n    C = C / np.where(total > 0, total, 1)\n")),
    mutant(AREA, "density-normalised", "splats of unit integral (divided by 2 pi l11 l22)",
        ("        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n",
         "        C[top:bottom, left:right] += g[:, :, None] * splat[5:8] / (2 * math.pi * l11 * l22)\n")),
    mutant(AREA, "negative-colours-dropped", "negative colours taken as zero",
        ("        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n",
         "        C[top:bottom, left:right] += g[:, :, None] * np.maximum(splat[5:8], 0)\n")),
    mutant(AREA, "clamped-while-summing", "the sum clamped after every splat",
        ("        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n",
         "        C[top:bottom, left:right] = np.clip(C[top:bottom, left:right] + g[:, :, None] * splat[5:8], 0, 1)\n")),
    mutant(AREA, "sum-clamped", "the sum clamped where it should not be",
        ('        return {"sum": C.astype(np.float32)}', '        return {"sum": np.clip(C, 0, 1).astype(np.float32)}')),
    mutant(AREA, "white-background", "a white frame where there is no splat",
        ("    C = np.zeros((height, width, 3))\n    reach", "    C = np.zeros((height, width, 3)) + (len(parameters) == 0)\n    reach")),
    mutant(AREA, "half-precision-sum", "sums in binary16",
        ('        return {"sum": C.astype(np.float32)}', '        return {"sum": C.astype(np.float16).astype(np.float32)}')),
    *(
        mutant(AREA, name, f"weights capped at {cap}, as in {whose}",
            ("sigma = (u1 * u1 + u2 * u2) / 2  # (9-1)", f"sigma = np.maximum((u1 * u1 + u2 * u2) / 2, -math.log({cap}))"))
        for name, cap, whose in (("opacity-capped", 0.99, "3D splatting"), ("opacity-capped-later", 0.999, "gsplat"))
    ),
    mutant(AREA, "transmittance-stop", "splats after a sum of 1 left out",
        ("        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n",
         "        open_ = np.max(C[top:bottom, left:right], axis=2, keepdims=True) < 1\n"
         "        C[top:bottom, left:right] += open_ * g[:, :, None] * splat[5:8]\n")),
    mutant(AREA, "degenerate-mirrored", "negative factors drawn by their magnitude",
        ("    drawn = (l11 >= SMALLEST_NORMAL) & (l22 >= SMALLEST_NORMAL) & np.isfinite(l11) & np.isfinite(l22)\n",
         "    l11, l22 = abs(l11), abs(l22)\n"
         "    drawn = (l11 >= SMALLEST_NORMAL) & (l22 >= SMALLEST_NORMAL) & np.isfinite(l11) & np.isfinite(l22)\n")),
    mutant(AREA, "degenerate-subnormal", "subnormal factors drawn",
        ("    drawn = (l11 >= SMALLEST_NORMAL) & (l22 >= SMALLEST_NORMAL) & np.isfinite(l11) & np.isfinite(l22)\n",
         "    drawn = (l11 > 0) & (l22 > 0)\n")),
    mutant(AREA, "degenerate-by-determinant", "splats dropped whose determinant underflows binary32",
        ("    drawn = (l11 >= SMALLEST_NORMAL) & (l22 >= SMALLEST_NORMAL) & np.isfinite(l11) & np.isfinite(l22)\n",
         "    drawn = (l11 >= SMALLEST_NORMAL) & (l22 >= SMALLEST_NORMAL) & ((l11 * l22) ** 2 > 1e-12)\n")),
    mutant(AREA, "factor-floor", "factors raised to 0.25 px in rendering",
        ("x, y, l11, l21, l22 = splat[:5]\n        d_x", "x, y, l11, l21, l22 = splat[:5]\n        l11, l22 = max(l11, 0.25), max(l22, 0.25)\n        d_x")),
    mutant(AREA, "frame-truncated", "samples rounded down",
        ("np.rint(clamped * peak).astype(sample_type(bit_depth))}  # R-9.1-1", "np.floor(clamped * peak).astype(sample_type(bit_depth))}")),
    mutant(AREA, "frame-half-up", "samples rounded half up in place of half to even",
        ("np.rint(clamped * peak).astype(sample_type(bit_depth))}  # R-9.1-1",
         "np.floor(clamped.astype(np.float32) * np.float32(peak) + np.float32(0.5)).astype(sample_type(bit_depth))}")),
    mutant(AREA, "frame-not-clamped", "samples that wrap around in place of being clamped",
        ("    clamped = np.clip(sum.astype(np.float64), 0.0, 1.0)\n    peak", "    clamped = sum.astype(np.float64) % 1.0001\n    peak")),
    mutant(AREA, "frame-times-256", "samples scaled by 2^bit_depth",
        ("np.rint(clamped * peak).astype(sample_type(bit_depth))}  # R-9.1-1",
         "np.minimum(np.floor(clamped * (peak + 1)), peak).astype(sample_type(bit_depth))}")),
    mutant(AREA, "frame-8-bits", "samples of 8 bits at every depth",
        ("    clamped = np.clip(sum.astype(np.float64), 0.0, 1.0)\n    peak = 2**bit_depth - 1", "    clamped = np.clip(sum.astype(np.float64), 0.0, 1.0)\n    peak = 255")),
    mutant(AREA, "frame-gamma", "samples with the curve of sRGB",
        ("    clamped = np.clip(sum.astype(np.float64), 0.0, 1.0)\n    peak", "    clamped = np.clip(sum.astype(np.float64), 0.0, 1.0) ** (1 / 2.2)\n    peak")),
)  # fmt: skip

ROW_OF = "d_y = np.arange(top, bottom)[:, None] + 0.5 - y\n        u1 = d_x"
BOUNDED_SPLATS = "for splat, (left, right, top, bottom) in zip(parameters.astype(np.float64), reach):"
STRICT_SPLATS = "        for splat, (left, right, top, bottom) in zip(parameters, reach):\n            if left"
COVERED = "            covered = m <= SUPPORT_SQUARED\n"
TILES = "np.arange(top, bottom)[:, None] // 16 * (-(-width // 16)) + np.arange(left, right) // 16"

LARGE: tuple[Mutant, ...] = (
    mutant(AREA, "columns-modulo-2048", "blocks of 2048 columns that all begin at column 0",
        ("d_x = np.arange(left, right) + 0.5 - x", "d_x = np.arange(left, right) % 2048 + 0.5 - x")),
    mutant(AREA, "rows-modulo-2048", "blocks of 2048 rows that all begin at row 0",
        (ROW_OF, ROW_OF.replace("(top, bottom)[:, None]", "(top, bottom)[:, None] % 2048"))),
    mutant(AREA, "columns-512", "columns beyond the first 512 left out",
        ('        return {"sum": C.astype(np.float32)}', '        C[:, 512:] = 0\n        return {"sum": C.astype(np.float32)}')),
    mutant(AREA, "tiles-256", "tiles of 16x16 beyond the first 256 left out",
        ("g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)", f"g = np.where((sigma <= LN_255) & ({TILES} < 256), np.exp(-sigma), 0.0)")),
    *(
        mutant(AREA, f"first-{most}-splats", f"the first {most} splats only",
            (BOUNDED_SPLATS, BOUNDED_SPLATS.replace("float64)", f"float64)[:{most}]")))
        for most in (1024, 8192)
    ),
    *(
        mutant(AREA, name, sentence,
            ("    C = np.zeros((height, width, 3))\n    reach", "    C = np.zeros((height, width, 3))\n    touched = [np.zeros(0, np.int64)]\n    reach"),
            ("        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)\n",
             "        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]\n"
             f"        touched.append(np.unique(({TILES})[g > 0]))\n"
             "    touched = np.concatenate(touched)\n"
             "    tiles = np.arange(height)[:, None] // 16 * (-(-width // 16)) + np.arange(width) // 16\n"
             f"    C[{lost}] = 0\n"))
        for name, sentence, lost in (
            ("tiles-as-many-as-pairs", "tiles of 16x16 left out whose number is not below the number of (splat, tile) pairs",
             "tiles >= len(touched)"),
            ("tiles-first-lost", "the first tile of 16x16 that a splat touches left out (where its list begins is never written)",
             "tiles == min(touched, default=-1)"),
            ("tiles-last-lost", "the last tile of 16x16 that a splat touches left out (where its list ends is never written)",
             "tiles == max(touched, default=-1)"))
    ),
    mutant(AREA, "support-20-steps-above", "an edge 20 units in the last place beyond ln 255",
        ("LN_255 = 5.541263545158426", "LN_255 = 5.541263545158426 + 20 * 2.0**-21")),
    mutant(AREA, "degenerate-infinite", "splats drawn whose l11 or l22 is infinite",
        ("    drawn = (l11 >= SMALLEST_NORMAL) & (l22 >= SMALLEST_NORMAL) & np.isfinite(l11) & np.isfinite(l22)\n",
         "    drawn = (l11 >= SMALLEST_NORMAL) & (l22 >= SMALLEST_NORMAL)\n")),
    mutant(AREA, "work-radius-binary32", "boxes whose radius is rounded to binary32",
        ("boxes(parameters, width, height, REACH).T", "boxes(parameters, width, height, float(np.float32(REACH))).T")),
    mutant(AREA, "work-sum-binary32", "boxes whose |l21| + l22 is rounded to binary32",
        ("e_y = radius * (abs(l21) + l22)", "e_y = radius * (abs(l21) + l22).astype(np.float32).astype(np.float64)")),
    mutant(DETERMINISTIC, "strict-columns-modulo-2048", "blocks of 2048 columns that all begin at column 0",
        ("columns = np.arange(left, right, dtype=np.float32)", "columns = (np.arange(left, right) % 2048).astype(np.float32)")),
    mutant(DETERMINISTIC, "strict-rows-modulo-2048", "blocks of 2048 rows that all begin at row 0",
        ("rows = np.arange(top, bottom, dtype=np.float32)", "rows = (np.arange(top, bottom) % 2048).astype(np.float32)")),
    mutant(DETERMINISTIC, "strict-tiles-256", "tiles of 16x16 beyond the first 256 left out",
        (COVERED, f"            covered = (m <= SUPPORT_SQUARED) & ({TILES} < 256)\n")),
    *(
        mutant(DETERMINISTIC, f"strict-first-{most}-splats", f"the first {most} splats only",
            (STRICT_SPLATS, STRICT_SPLATS.replace("(parameters,", f"(parameters[:{most}],")))
        for most in (1024, 8192)
    ),
    mutant(DETERMINISTIC, "strict-tile-open", "splats left out of tiles of 16x16 where m is at least K at the nearest pixel",
        (COVERED,
         f"            covered = m <= SUPPORT_SQUARED\n            tiles = {TILES}\n"
         "            inside = np.unique(tiles[m < SUPPORT_SQUARED])\n            covered = covered & np.isin(tiles, inside)\n")),
)  # fmt: skip

M11 = "    m11 = np.sqrt(l11 * l11 + v_x)\n"
M22 = "    m22 = np.sqrt(l22 * l22 + v_y + l21 * l21 * v_x / (m11 * m11))\n"
V_X = "v_x = max(0, width - new_width) * (width + new_width) / (12 * width * width)"
V_Y = "v_y = max(0, height - new_height) * (height + new_height) / (12 * height * height)"
COLOR = "    scaled[drawn, 5:] *= (l11 / m11 * (l22 / m22))[:, None]\n"

FILTERED: tuple[Mutant, ...] = (
    mutant(AREA, "filter-left-out", "a smaller picture sampled, not filtered", (V_X, "v_x = 0"), (V_Y, "v_y = 0")),
    mutant(AREA, "filter-whole-pixel", "the variance 1/12 of a new pixel, without that of an old one",
        (V_X, "v_x = (new_width < width) / 12"), (V_Y, "v_y = (new_height < height) / 12")),
    mutant(AREA, "filter-in-old-pixels", "the variance of the filter in pixels of the larger frame",
        (V_X, V_X.replace("12 * width * width", "12 * new_width * new_width")),
        (V_Y, V_Y.replace("12 * height * height", "12 * new_height * new_height"))),
    mutant(AREA, "filter-of-the-width", "v_y by the width's ratio", (V_Y, "v_y = v_x")),
    mutant(AREA, "filter-also-enlarges", "a variance below 0 where a side becomes larger",
        (V_X, V_X.replace("max(0, width - new_width)", "(width - new_width)")),
        (V_Y, V_Y.replace("max(0, height - new_height)", "(height - new_height)")),
        (M11, M11.replace("v_x)", "v_x, where=l11 * l11 + v_x > 0, out=l11.copy())")),
        (M22, "    s22 = l22 * l22 + v_y + l21 * l21 * v_x / (m11 * m11)\n    m22 = np.sqrt(s22, where=s22 > 0, out=l22.copy())\n")),
    mutant(AREA, "filter-keeps-colours", "colours that stay, so that a filtered splat becomes brighter", (COLOR, "")),
    mutant(AREA, "filter-colours-once", "colours divided by the growth of l11 alone",
        (COLOR, "    scaled[drawn, 5:] *= (l11 / m11)[:, None]\n")),
    mutant(AREA, "filter-keeps-l21", "l21 that stays, so that the splat turns",
        ("np.column_stack([m11, l21 * (l11 / m11), m22])", "np.column_stack([m11, l21, m22])")),
    mutant(AREA, "filter-without-shear", "l22 without the part of v_x that l21 brings",
        (M22, "    m22 = np.sqrt(l22 * l22 + v_y)\n")),
    mutant(AREA, "filter-degenerate", "degenerate splats made wide like the others",
        ("drawn = (parameters[:, 2] >= SMALLEST_NORMAL) & (parameters[:, 4] >= SMALLEST_NORMAL)  # R-9.4-3",
         "drawn = np.ones(len(parameters), np.bool_)")),
    mutant(AREA, "filter-cancels", "m22 by a difference of squares in binary32",
        (M22, "    l11, l21, l22 = (part.astype(np.float32) for part in (l11, l21, l22))\n"
         "    s12 = l11 * l21 / m11.astype(np.float32)\n"
         "    s22 = l21 * l21 + l22 * l22 + np.float32(v_y) - s12 * s12\n"
         "    m22 = np.sqrt(np.maximum(s22, np.float32(2.0**-126)))\n")),
    mutant(AREA, "filter-squares", "squares in binary32, whose range they leave",
        (M11, "    l11, l21, l22 = (part.astype(np.float32) for part in (l11, l21, l22))\n"
         "    v_x, v_y = np.float32(v_x), np.float32(v_y)\n" + M11)),
)  # fmt: skip

STRICT: tuple[Mutant, ...] = (
    mutant(DETERMINISTIC, "strict-division", "divisions in place of products with a rounded reciprocal",
        ("    u1 = ((columns + HALF) - x) * r1\n", "    u1 = ((columns + HALF) - x) / l11\n")),
    mutant(DETERMINISTIC, "strict-centre-shifted-first", "i - (x - 1/2) in place of (i + 1/2) - x",
        ("    u1 = ((columns + HALF) - x) * r1\n", "    u1 = (columns - (x - HALF)) * r1\n")),
    mutant(DETERMINISTIC, "strict-distributed", "(i + 1/2) r1 - x r1 in place of ((i + 1/2) - x) r1",
        ("    u1 = ((columns + HALF) - x) * r1\n", "    u1 = (columns + HALF) * r1 - x * r1\n")),
    mutant(DETERMINISTIC, "strict-no-switch", "l21 r2 formed first for every l22",
        ("(l21, r2) if l22 <= ONE else (l21 / l22, ONE)", "(l21 * r2, ONE)")),
    mutant(DETERMINISTIC, "strict-switch-late", "(l, f) = (l21, r2) for every l22",
        ("(l21, r2) if l22 <= ONE else (l21 / l22, ONE)", "(l21, r2)")),
    mutant(DETERMINISTIC, "strict-switch-at-one", "the case of l22 = 1 in the wrong branch",
        ("(l21, r2) if l22 <= ONE else (l21 / l22, ONE)", "(l21, r2) if l22 <= np.nextafter(ONE, np.float32(2)) else (l21 / l22, ONE)")),
    mutant(DETERMINISTIC, "strict-reassociated", "l (u1 f) in place of (l u1) f", ("- (l * u1) * f", "- l * (u1 * f)")),
    mutant(DETERMINISTIC, "strict-factors-first", "(l f) u1 in place of (l u1) f", ("- (l * u1) * f", "- (l * f) * u1")),
    mutant(DETERMINISTIC, "strict-fused-square", "u1 u1 + u2 u2 by a fused multiply-add",
        ("    return u1 * u1 + u2 * u2  # (9-4)", "    return (u1 * u1 + u2.astype(np.float64) * u2).astype(np.float32)")),
    mutant(DETERMINISTIC, "strict-fused-shear", "the shear subtracted by a fused multiply-add",
        ("    u2 = ((rows[:, None] + HALF) - y) * r2 - (l * u1) * f\n",
         "    u2 = (((rows[:, None] + HALF) - y).astype(np.float64) * r2 - (l * u1) * f).astype(np.float32)\n")),
    mutant(DETERMINISTIC, "strict-fused-other-square", "u2 u2 + u1 u1 by a fused multiply-add",
        ("    return u1 * u1 + u2 * u2  # (9-4)", "    return (u2 * u2 + u1.astype(np.float64) * u1).astype(np.float32)")),
    mutant(DETERMINISTIC, "strict-fused-polynomial", "a polynomial of fused multiply-adds",
        ("    p = ((K5 * t + (K4 * m + K3)) * t + (K2 * m + K1)) * m + ONE\n", FUSED_POLYNOMIAL)),
    *(
        mutant(DETERMINISTIC, f"strict-contracted-{which}",
            f"every multiplication and addition fused, as compilers do unless told otherwise ({which} product of squares)",
            ("    u2 = ((rows[:, None] + HALF) - y) * r2 - (l * u1) * f\n", shear),
            ("    return u1 * u1 + u2 * u2  # (9-4)", square),
            ("    p = ((K5 * t + (K4 * m + K3)) * t + (K2 * m + K1)) * m + ONE\n", FUSED_POLYNOMIAL),
            ("np.where(covered[:, :, None], pixels + g * splat[5:8], pixels)",
             "np.where(covered[:, :, None], (pixels + g.astype(np.float64) * splat[5:8]).astype(np.float32), pixels)"))
        for which, shear, square in (
            ("first", FUSED_ROW, "    return (u1.astype(np.float64) * u1 + u2 * u2).astype(np.float32)"),
            ("second", FUSED_ROW, "    return (u2.astype(np.float64) * u2 + u1 * u1).astype(np.float32)"),
            ("shear and first", FUSED_SHEAR, "    return (u1.astype(np.float64) * u1 + u2 * u2).astype(np.float32)"),
            ("shear and second", FUSED_SHEAR, "    return (u2.astype(np.float64) * u2 + u1 * u1).astype(np.float32)"),
        )
    ),
    mutant(DETERMINISTIC, "strict-horner", "the polynomial by Horner's rule",
        ("    p = ((K5 * t + (K4 * m + K3)) * t + (K2 * m + K1)) * m + ONE\n",
         "    p = ((((K5 * m + K4) * m + K3) * m + K2) * m + K1) * m + ONE\n")),
    mutant(DETERMINISTIC, "strict-library-exp", "the library's exp",
        ("    h = p * p\n    q = h * h\n    return q * q", "    return np.exp(np.float32(-0.5) * m)")),
    mutant(DETERMINISTIC, "strict-wide-polynomial", "the polynomial in binary64",
        ("    t = m * m\n    p =", "    m = m.astype(np.float64)\n    t = m * m\n    p ="),
        ("    h = p * p\n    q = h * h\n    return q * q", "    h = p * p\n    q = h * h\n    return (q * q).astype(np.float32)")),
    mutant(DETERMINISTIC, "strict-one-squaring-less", "two squarings in place of three", ("    return q * q\n", "    return q\n")),
    mutant(DETERMINISTIC, "strict-support-below", "a support constant one step lower",
        ('float.fromhex("0x1.62a41p+3")', 'float.fromhex("0x1.62a40ep+3")')),
    mutant(DETERMINISTIC, "strict-support-above", "a support constant one step higher",
        ('float.fromhex("0x1.62a41p+3")', 'float.fromhex("0x1.62a412p+3")')),
    mutant(DETERMINISTIC, "strict-support-open", "a pixel with m = K left out",
        ("            covered = m <= SUPPORT_SQUARED\n", "            covered = m < SUPPORT_SQUARED\n")),
    mutant(DETERMINISTIC, "strict-box-without-margin", "splats cut at boxes of rho, where rounding may cover a pixel just outside",
        ("reach = boxes(parameters, width, height, REACH)", "reach = boxes(parameters, width, height, SUPPORT_RADIUS)")),
    mutant(DETERMINISTIC, "strict-nan-covers", "pixels covered where m is not a number",
        ("            covered = m <= SUPPORT_SQUARED\n", "            covered = ~(m > SUPPORT_SQUARED)\n")),
    mutant(DETERMINISTIC, "strict-infinite-shear-drawn", "pixels covered where an infinite l21 leaves no number",
        ("        drawn &= np.isfinite(x + y + l21)  # section 9.4\n", ""),
        ("            covered = m <= SUPPORT_SQUARED\n", "            covered = ~(m > SUPPORT_SQUARED)\n")),
    mutant(DETERMINISTIC, "strict-coefficient", "a polynomial coefficient of another fit",
        ('K3 = np.float32(float.fromhex("-0x1.547a8p-15"))', 'K3 = np.float32(float.fromhex("-0x1.547a82p-15"))')),
    mutant(DETERMINISTIC, "strict-reversed", "splats added in reverse order",
        ("        for splat, (left, right, top, bottom) in zip(parameters, reach):\n            if left",
         "        for splat, (left, right, top, bottom) in zip(parameters[::-1], reach[::-1]):\n            if left")),
    mutant(DETERMINISTIC, "strict-pairs", "even and odd splats summed apart",
        ("        for splat, (left, right, top, bottom) in zip(parameters, reach):\n            if left",
         "        order = [*range(0, len(parameters), 2), *range(1, len(parameters), 2)]\n"
         "        for splat, (left, right, top, bottom) in zip(parameters[order], reach[order]):\n            if left")),
    mutant(DETERMINISTIC, "strict-wide-sum", "sums in binary64",
        ("    C = np.zeros((height, width, 3), np.float32)\n    reach", "    C = np.zeros((height, width, 3))\n    reach"),
        ('    return {"sum": C}', '    return {"sum": C.astype(np.float32)}')),
    mutant(DETERMINISTIC, "strict-fused-sum", "g c' added by a fused multiply-add",
        ("np.where(covered[:, :, None], pixels + g * splat[5:8], pixels)",
         "np.where(covered[:, :, None], (pixels + g.astype(np.float64) * splat[5:8]).astype(np.float32), pixels)")),
    mutant(DETERMINISTIC, "strict-flush", "subnormal numbers flushed to zero",
        ("    return u1 * u1 + u2 * u2  # (9-4)",
         "    u1 = np.where(abs(u1) < 2.0**-126, np.float32(0), u1)\n    return u1 * u1 + u2 * u2"),
        ("    r1 = ONE / l11\n    r2 = ONE / l22\n",
         "    r1 = ONE / l11\n    r2 = ONE / l22\n    r1 = r1 if abs(r1) >= 2.0**-126 else np.float32(0)\n"
         "    r2 = r2 if abs(r2) >= 2.0**-126 else np.float32(0)\n")),
    mutant(DETERMINISTIC, "strict-flush-products", "subnormal products g c' flushed to zero",
        ("np.where(covered[:, :, None], pixels + g * splat[5:8], pixels)",
         "np.where(covered[:, :, None] & (abs(g * splat[5:8]) >= 2.0**-126), pixels + g * splat[5:8], pixels)")),
    mutant(DETERMINISTIC, "strict-inexact-reciprocal", "a reciprocal that is not correctly rounded",
        ("    r1 = ONE / l11\n", "    r1 = np.nextafter(ONE / l11, np.float32(0))\n")),
    mutant(DETERMINISTIC, "strict-clamped-while-summing", "the sum clamped after every splat",
        ("np.where(covered[:, :, None], pixels + g * splat[5:8], pixels)",
         "np.where(covered[:, :, None], np.clip(pixels + g * splat[5:8], 0, 1), pixels)")),
    mutant(DETERMINISTIC, "strict-without-end", "no cut at all, but for the box",
        ("            covered = m <= SUPPORT_SQUARED\n", "            covered = np.isfinite(m)\n")),
    mutant(DETERMINISTIC, "strict-sum-flushed", "subnormal sums flushed to zero",
        ('    return {"sum": C}', '    return {"sum": np.where(abs(C) < 2.0**-126, np.float32(0), C)}')),
    mutant(DETERMINISTIC, "strict-frame-half-up", "ties of deterministic frames rounded up",
        ("np.rint(v * peak).astype(sample_type(bit_depth))}  # (9-7)", "np.floor(v * peak + np.float32(0.5)).astype(sample_type(bit_depth))}")),
    mutant(DETERMINISTIC, "strict-frame-wide", "the product with the peak in binary64",
        ("np.rint(v * peak).astype(sample_type(bit_depth))}  # (9-7)",
         "np.rint(v.astype(np.float64) * peak).astype(sample_type(bit_depth))}")),
    mutant(DETERMINISTIC, "strict-frame-nan-white", "samples that are not numbers turned white",
        ("    v = np.where(sum > 0, sum, np.float32(0))\n    v = np.where(sum >= 1, np.float32(1), v)\n",
         "    v = np.where(sum <= 0, np.float32(0), sum)\n    v = np.where(~(sum < 1), np.float32(1), v)\n")),
    mutant(DETERMINISTIC, "scale-all-by-width", "l21 and l22 scaled by the width's factor",
        ("factors = np.array([a, e, a, e, e, 1, 1, 1], np.float32)", "factors = np.array([a, e, a, a, a, 1, 1, 1], np.float32)")),
    mutant(DETERMINISTIC, "scale-l21-by-width", "l21 scaled by the width's factor",
        ("factors = np.array([a, e, a, e, e, 1, 1, 1], np.float32)", "factors = np.array([a, e, a, a, e, 1, 1, 1], np.float32)")),
    mutant(DETERMINISTIC, "scale-saturates", "scaled parameters held at the largest binary32 number",
        ('        return {"parameters": parameters * factors}  # (9-8)',
         '        largest = np.finfo(np.float32).max\n'
         '        return {"parameters": np.clip(parameters * factors, -largest, largest)}')),
    mutant(DETERMINISTIC, "scale-half-pixel", "positions scaled about the first pixel's centre",
        ('        return {"parameters": parameters * factors}  # (9-8)',
         '        shift = np.array([0.5, 0.5, 0, 0, 0, 0, 0, 0], np.float32)\n'
         '        return {"parameters": ((parameters - shift) * factors + shift).astype(np.float32)}')),
    mutant(DETERMINISTIC, "scale-wide", "scale factors that are not rounded to binary32",
        ("    a = np.float32(new_width) / np.float32(width)\n", "    a = np.float64(new_width) / width\n"),
        ("factors = np.array([a, e, a, e, e, 1, 1, 1], np.float32)", "factors = np.array([a, e, a, e, e, 1, 1, 1], np.float64)"),
        ('        return {"parameters": parameters * factors}  # (9-8)', '        return {"parameters": (parameters * factors).astype(np.float32)}')),
)  # fmt: skip

MUTANTS: tuple[Mutant, ...] = (*BOUNDED, *FILTERED, *STRICT, *LARGE)
