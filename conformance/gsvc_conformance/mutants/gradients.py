"""Mutants of render_gradients and of the weights."""

from gsvc_conformance.mutants.mutant import Mutant, mutant

AREA = "gradients"


def _by_the_conic(factor: float) -> tuple[tuple[str, str], ...]:
    """The gradient of L through the inverse covariance, whose off-diagonal entry has a gradient `factor` times too large."""
    return (
        ("of_l11 = np.sum(q * v1 * u1)",
         "a, b, c = ((l21 * l21 + l22 * l22) / (l11 * l22) ** 2, -l21 / (l11 * l22 * l22), 1 / (l22 * l22))\n"
         f"    extra = {factor - 1} * np.sum(q * l11 * u1 * (l21 * u1 + l22 * u2))\n"
         "    of_l11 = np.sum(q * v1 * u1) + extra * (2 * a * b * l11 + (b * b + a * c) * l21)"),
        ("of_l21 = np.sum(q * v2 * u1)", "of_l21 = np.sum(q * v2 * u1) + extra * ((b * b + a * c) * l11 + 2 * b * c * l21)"),
        ("of_l22 = np.sum(q * v2 * u2)", "of_l22 = np.sum(q * v2 * u2) + extra * 2 * b * c * l22"),
    )  # fmt: skip


MUTANTS: tuple[Mutant, ...] = (
    mutant(
        AREA, "off-diagonal-counted-twice",
        "the gradient of l11 and l21 through a symmetric covariance whose off-diagonal entry is counted twice",
        ("of_l11 = np.sum(q * v1 * u1)", "of_l11 = np.sum(q * (v1 * u1 + l21 * v1 * v2))"),
        ("of_l21 = np.sum(q * v2 * u1)", "of_l21 = np.sum(q * (v2 * u1 + l11 * v1 * v2))"),
    ),
    *(
        mutant(AREA, name, f"the gradient of L by way of the conic, with {mistake}", *_by_the_conic(factor))
        for name, mistake, factor in (
            ("conic-y-halved", "half the gradient of the conic's off-diagonal entry", 0.5),
            ("conic-off-diagonal-doubled", "the conic's off-diagonal entry counted twice", 2.0))
    ),
    mutant(
        AREA, "scales-halved", "the gradient of L by way of scales and an angle, with half the gradients of the scales",
        ("of_l11 = np.sum(q * v1 * u1)",
         "angle = math.atan2(2 * l11 * l21, l11 * l11 - l21 * l21 - l22 * l22) / 2\n"
         "    cos, sin = math.cos(angle), math.sin(angle)\n"
         "    long, wide = (np.sum(q * along * along) / 2 for along in (cos * v1 + sin * v2, cos * v2 - sin * v1))\n"
         "    of_l11 = np.sum(q * v1 * u1) - long * cos * (cos * l11 + sin * l21) + wide * sin * (cos * l21 - sin * l11)"),
        ("of_l21 = np.sum(q * v2 * u1)",
         "of_l21 = np.sum(q * v2 * u1) - long * sin * (cos * l11 + sin * l21) - wide * cos * (cos * l21 - sin * l11)"),
        ("of_l22 = np.sum(q * v2 * u2)",
         "of_l22 = np.sum(q * v2 * u2) - (long * sin * sin + wide * cos * cos) * l22"),
    ),
    mutant(
        AREA, "off-diagonal-halved",
        "the gradient of L by way of the covariance, with half the gradient of its off-diagonal entry",
        ("of_l11 = np.sum(q * v1 * u1)", "of_l11 = np.sum(q * (v1 * u1 - l21 * v1 * v2 / 2))"),
        ("of_l21 = np.sum(q * v2 * u1)", "of_l21 = np.sum(q * (v2 * u1 - l11 * v1 * v2 / 2))"),
    ),
    mutant(
        AREA, "l21-gradient-doubled", "the gradient of l21 taken twice",
        ("of_l21 = np.sum(q * v2 * u1)", "of_l21 = 2 * np.sum(q * v2 * u1)"),
    ),
    mutant(
        AREA, "l21-gradient-transposed", "the gradient of l12 in place of l21 (upper in place of lower triangle)",
        ("of_l21 = np.sum(q * v2 * u1)", "of_l21 = np.sum(q * v1 * u2)"),
    ),
    mutant(
        AREA, "position-gradient-sign", "the gradient of the position with the wrong sign (d taken as mu minus pixel)",
        ("of_x = np.sum(q * v1)", "of_x = -np.sum(q * v1)"),
        ("of_y = np.sum(q * v2)", "of_y = -np.sum(q * v2)"),
    ),
    mutant(
        AREA, "position-gradient-by-u", "u in place of v = L^-T u in the gradient of the position",
        ("of_x = np.sum(q * v1)", "of_x = np.sum(q * u1)"),
        ("of_y = np.sum(q * v2)", "of_y = np.sum(q * u2)"),
    ),
    mutant(
        AREA, "transposed-solve", "v solved with L in place of its transpose",
        ("v2 = u2 / l22\n    v1 = (u1 - l21 * v2) / l11", "v1 = u1 / l11\n    v2 = (u2 - l21 * v1) / l22"),
    ),
    mutant(
        AREA, "l21-dropped-from-solve", "v without its l21 term",
        ("v1 = (u1 - l21 * v2) / l11\n    of_x", "v1 = u1 / l11\n    of_x"),
    ),
    mutant(
        AREA, "color-gradient-squared-weight", "colour gradients weighted by exp(-2 sigma)",
        ("of_red, of_green, of_blue = np.sum(g[:, None] * e, axis=0)",
         "of_red, of_green, of_blue = np.sum((g * g)[:, None] * e, axis=0)"),
    ),
    mutant(
        AREA, "color-gradient-unweighted", "colour gradients without exp(-sigma)",
        ("of_red, of_green, of_blue = np.sum(g[:, None] * e, axis=0)",
         "of_red, of_green, of_blue = np.sum(e, axis=0)"),
    ),
    mutant(
        AREA, "residual-summed-not-dotted", "q from the sum of the residual, without the colour",
        ("q = g * (e[:, 0] * red + e[:, 1] * green + e[:, 2] * blue)", "q = g * (e[:, 0] + e[:, 1] + e[:, 2])"),
    ),
    mutant(
        AREA, "residual-channels-reversed", "the residual's channels in the order B, G, R",
        ("q = g * (e[:, 0] * red + e[:, 1] * green + e[:, 2] * blue)",
         "q = g * (e[:, 2] * red + e[:, 1] * green + e[:, 0] * blue)"),
    ),
    mutant(
        AREA, "gradient-pixel-centre-at-integer", "pixel centres at integer positions in the gradient alone",
        ("d_x = np.arange(width)[None, :] + 0.5 - x\n    d_y = np.arange(height)[:, None] + 0.5 - y\n    u1 = np.broad",
         "d_x = np.arange(width)[None, :] - x\n    d_y = np.arange(height)[:, None] - y\n    u1 = np.broad"),
    ),
    mutant(
        AREA, "gradient-shear-with-the-centre", "(j + 1/2) - (y + l21 u1) in binary32, which loses what d_y keeps",
        ("u2 = (d_y - l21 * u1) / l22\n    sigma = (u1 * u1 + u2 * u2) / 2\n    covered",
         "rows = np.float32(np.arange(height)[:, None] + 0.5)\n    u2 = (rows - (np.float32(y) + np.float32(l21 * u1))) / l22\n"
         "    sigma = (u1 * u1 + u2 * u2) / 2\n    covered"),
    ),
    mutant(
        AREA, "gradient-without-support", "a gradient over all pixels, covered or not",
        ("covered = sigma <= LN_255\n    u1 = u1[covered]", "covered = sigma <= 80\n    u1 = u1[covered]"),
    ),
    mutant(
        AREA, "gradient-three-sigma", "a gradient over the ellipse of three standard deviations only",
        ("covered = sigma <= LN_255\n    u1 = u1[covered]", "covered = sigma <= 4.5\n    u1 = u1[covered]"),
    ),
    mutant(
        AREA, "gradient-scale", "gradients too large by a ten-thousandth",
        ("q = g * (e[:, 0] * red", "q = 1.0001 * g * (e[:, 0] * red"),
    ),
    mutant(
        AREA, "gradient-sigma-not-halved", "the gradient of u.u in place of u.u/2",
        ("q = g * (e[:, 0] * red", "q = 2 * g * (e[:, 0] * red"),
    ),
    mutant(
        AREA, "gradient-first-256", "gradients of the first 256 splats only",
        ("for n in range(len(parameters)):\n        splat = parameters[n].astype(np.float64)\n        factors",
         "for n in range(min(256, len(parameters))):\n        splat = parameters[n].astype(np.float64)\n        factors"),
    ),
    mutant(
        AREA, "gradient-of-degenerate", "a gradient of degenerate splats that is not zero",
        ("drawn = (factors >= SMALLEST_NORMAL) & np.isfinite(factors)\n", "drawn = factors != 0\n"),
    ),
    mutant(
        AREA, "gradient-of-infinite", "a gradient of splats whose l11 or l22 is infinite",
        ("drawn = (factors >= SMALLEST_NORMAL) & np.isfinite(factors)\n", "drawn = factors >= SMALLEST_NORMAL\n"),
    ),
    mutant(
        AREA, "gradient-nan-covers", "gradients that count pixels where sigma is not a number",
        ("    x, y, l11, l21, l22 = splat[:5]\n    red", "    x, y, l11, l21, l22 = splat[:5].astype(np.float32)\n    red"),
        ("d_x = np.arange(width)[None, :] + 0.5 - x\n    d_y = np.arange(height)[:, None] + 0.5 - y\n    u1 = np.broad",
         "d_x = (np.arange(width)[None, :] + 0.5).astype(np.float32) - x\n"
         "    d_y = (np.arange(height)[:, None] + 0.5).astype(np.float32) - y\n    u1 = np.broad"),
        ("covered = sigma <= LN_255\n    u1 = u1[covered]", "covered = ~(sigma > np.float32(LN_255))\n    u1 = u1[covered]"),
    ),
    mutant(
        AREA, "gradient-columns-1024", "gradients from the first 1024 columns only",
        ("covered = sigma <= LN_255\n    u1 = u1[covered]", "covered = (sigma <= LN_255) & (np.arange(width) < 1024)\n    u1 = u1[covered]"),
    ),
    mutant(
        AREA, "gradient-rows-1024", "gradients from the first 1024 rows only",
        ("covered = sigma <= LN_255\n    u1 = u1[covered]", "covered = (sigma <= LN_255) & (np.arange(height)[:, None] < 1024)\n    u1 = u1[covered]"),
    ),
    mutant(
        AREA, "weight-gradient-missing-channel", "dL/dw from the last channel alone",
        ("result[:, 8] += color * by_product", "result[:, 8] = color * by_product"),
    ),
    mutant(
        AREA, "weight-gradient-by-product", "dL/dw by the weighted colour in place of c'",
        ("result[:, 8] += color * by_product", "result[:, 8] += w * color * by_product"),
    ),
    mutant(
        AREA, "color-gradient-without-weight", "dL/dc' without its factor w",
        ("result[:, channel] = w * by_product", "result[:, channel] = by_product"),
    ),
    mutant(
        AREA, "weight-not-folded", "colours rendered without their weight",
        ("parameters[:, channel] = w * values[:, channel]", "parameters[:, channel] = values[:, channel]"),
    ),
)  # fmt: skip
