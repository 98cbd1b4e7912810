"""Mutants of render_gradients that mirror those of rendering, and broken sums over pixels: warps, tiles, edges."""

from gsvc_conformance.mutants.mutant import Mutant, mutant

AREA = "gradients"

U2 = "    u2 = (d_y - l21 * u1) / l22\n    sigma = (u1 * u1 + u2 * u2) / 2\n    covered"
COVERED = "covered = sigma <= LN_255\n    u1 = u1[covered]"
RESIDUAL = "    e = residual[covered]\n"
CENTRE = "d_x = np.arange(width)[None, :] + 0.5 - x\n    d_y = np.arange(height)[:, None] + 0.5 - y\n    u1 = np.broad"
SPLAT = "            gradients[n] = splat_gradient(splat, residual.astype(np.float64))"
ROWS, COLUMNS = "np.arange(height)[:, None]", "np.arange(width)[None, :]"


def _of_pixels(condition: str) -> tuple[str, str]:
    """Only the pixels that meet a condition."""
    return COVERED, f"covered = (sigma <= LN_255) & ({condition})\n    u1 = u1[covered]"


def _of_list(weights: str) -> tuple[str, str]:
    """Weights by the number of a pixel in the list of those that a splat covers."""
    return RESIDUAL, f"{RESIDUAL}    turn = np.arange(len(e))\n    e = e * ({weights})[:, None]\n"


def _of_residual(changed: str) -> tuple[str, str]:
    return SPLAT, SPLAT.replace("residual.astype(np.float64)", changed)


MIRRORS: tuple[Mutant, ...] = (
    mutant(AREA, "gradient-columns-at-integers", "pixel centres at integer columns in the gradient alone",
        (CENTRE, CENTRE.replace("[None, :] + 0.5", "[None, :]"))),
    mutant(AREA, "gradient-rows-at-integers", "pixel centres at integer rows in the gradient alone",
        (CENTRE, CENTRE.replace("[:, None] + 0.5", "[:, None]"))),
    mutant(AREA, "gradient-support-1-256", "a gradient over the pixels with a weight of at least 1/256",
        (COVERED, COVERED.replace("LN_255", "5.545177444479562"))),
    mutant(AREA, "gradient-support-two-sigma", "a gradient over the ellipse of two standard deviations only",
        (COVERED, COVERED.replace("LN_255", "2.0"))),
    mutant(AREA, "gradient-support-half", "a gradient over the pixels with at least half the cut of sigma only",
        (COVERED, COVERED.replace("LN_255", "LN_255 / 2"))),
    mutant(AREA, "gradient-support-square", "a gradient over a square of ceil(3 sigma), cut to the weight of 1/255",
        _of_pixels("(abs(d_x) <= np.ceil(3 * np.sqrt(max(l11 * l11, l21 * l21 + l22 * l22))))"
                   " & (abs(d_y) <= np.ceil(3 * np.sqrt(max(l11 * l11, l21 * l21 + l22 * l22))))")),
    mutant(AREA, "gradient-tiles-by-centre", "gradients from the 16x16 tile of the centre and its neighbours only",
        _of_pixels(f"(abs({COLUMNS} // 16 - x // 16) <= 1) & (abs({ROWS} // 16 - y // 16) <= 1)")),
    mutant(AREA, "gradient-first-tile", "gradients from the first tile of 16x16 pixels only",
        _of_pixels(f"({COLUMNS} < 16) & ({ROWS} < 16)")),
    mutant(AREA, "gradient-l21-sign", "l21 with the wrong sign where the gradient draws the splat again",
        (U2, U2.replace("d_y - l21", "d_y + l21"))),
    mutant(AREA, "gradient-l21-left-out", "l21 left out where the gradient draws the splat again",
        (U2, U2.replace("(d_y - l21 * u1)", "(d_y + 0 * u1)"))),
    mutant(AREA, "gradient-exp2", "exp2 in place of exp in the gradient",
        ("g = np.exp(-sigma[covered])", "g = np.exp2(-sigma[covered])")),
    mutant(AREA, "gradient-residual-transposed", "the residual's rows and columns exchanged",
        _of_residual("residual.astype(np.float64).transpose(1, 0, 2).reshape(residual.shape)")),
    mutant(AREA, "gradient-residual-upside-down", "the residual with the y axis upwards",
        _of_residual("residual.astype(np.float64)[::-1]")),
    mutant(AREA, "gradient-residual-clamped", "a residual that is clamped to 0..1",
        _of_residual("np.clip(residual.astype(np.float64), 0, 1)")),
    mutant(AREA, "gradient-inside-only", "no gradient of splats whose centre lies outside the frame",
        ("        if drawn.all():\n            gradients", "        if drawn.all() and 0 <= splat[0] <= residual.shape[1] and 0 <= splat[1] <= residual.shape[0]:\n            gradients")),
    mutant(AREA, "gradient-colour-clamped", "colours clamped to 0..1 in the gradient",
        ("q = g * (e[:, 0] * red", "red, green, blue = np.clip(splat[5:], 0, 1)\n    q = g * (e[:, 0] * red")),
    mutant(AREA, "gradient-position-per-column", "v without L^-T: u1 / l11 in the gradient of x",
        ("of_x = np.sum(q * v1)", "of_x = np.sum(q * u1 / l11)")),
    mutant(AREA, "gradient-q-unweighted", "q without exp(-sigma)", ("q = g * (e[:, 0] * red", "q = 1 * (e[:, 0] * red")),
    mutant(AREA, "gradient-q-squared", "q with exp(-2 sigma) in place of exp(-sigma)", ("q = g * (e[:, 0] * red", "q = g * g * (e[:, 0] * red")),
    mutant(AREA, "gradient-diagonal-exchanged", "the gradients of l11 and l22 exchanged",
        ("of_l11 = np.sum(q * v1 * u1)", "of_l11 = np.sum(q * v2 * u2)"), ("of_l22 = np.sum(q * v2 * u2)", "of_l22 = np.sum(q * v1 * u1)")),
)  # fmt: skip

SUMS: tuple[Mutant, ...] = (
    mutant(AREA, "gradient-partial-warp", "the last partial warp of 32 of the covered pixels of each splat left out",
        _of_list("turn < len(e) // 32 * 32")),
    mutant(AREA, "gradient-partial-block", "the last partial block of 256 of the covered pixels of each splat left out",
        _of_list("(turn < len(e) // 256 * 256) | (len(e) < 256)")),
    mutant(AREA, "gradient-half-warp", "the second half of each warp of 32 covered pixels left out",
        _of_list("turn % 32 < 16")),
    mutant(AREA, "gradient-lane-0", "one lane of each warp of 32 covered pixels alone", _of_list("turn % 32 == 0")),
    mutant(AREA, "gradient-last-lane", "the last lane of each warp of 32 covered pixels left out", _of_list("turn % 32 != 31")),
    mutant(AREA, "gradient-first-warp", "the first 32 covered pixels of each splat only", _of_list("turn < 32")),
    mutant(AREA, "gradient-first-256-pixels", "the first 256 covered pixels of each splat only", _of_list("turn < 256")),
    mutant(AREA, "gradient-first-pixel-lost", "the first of the covered pixels of each splat left out", _of_list("turn > 0")),
    mutant(AREA, "gradient-last-pixel-lost", "the last of the covered pixels of each splat left out", _of_list("turn < len(e) - 1")),
    mutant(AREA, "gradient-stored", "the last covered pixel of each splat alone: a store in place of an atomic addition",
        _of_list("turn == len(e) - 1")),
    mutant(AREA, "gradient-last-row", "the last row of the residual left out", _of_pixels(f"{ROWS} < height - 1")),
    mutant(AREA, "gradient-last-column", "the last column of the residual left out", _of_pixels(f"{COLUMNS} < width - 1")),
    mutant(AREA, "gradient-partial-tiles", "pixels left out that lie beyond the last whole tile of 16x16",
        _of_pixels(f"({ROWS} < height // 16 * 16) & ({COLUMNS} < width // 16 * 16)")),
    mutant(AREA, "gradient-edges-twice", "the first row and column of each tile of 16x16 taken twice",
        (RESIDUAL, f"{RESIDUAL}    twice = (1 + (({ROWS} % 16 == 0) & ({ROWS} > 0))) * (1 + (({COLUMNS} % 16 == 0) & ({COLUMNS} > 0)))\n"
         "    e = e * twice[covered][:, None]\n")),
    mutant(AREA, "gradient-outermost-twice", "the outermost pixels taken twice",
        (RESIDUAL, f"{RESIDUAL}    outer = ({ROWS} % (height - 1 or 1) == 0) | ({COLUMNS} % (width - 1 or 1) == 0)\n"
         "    e = e * (1 + outer[covered])[:, None]\n")),
    mutant(AREA, "gradient-position-stored", "the gradient of x from the last covered pixel alone",
        ("of_x = np.sum(q * v1)", "of_x = (q * v1)[-1] if len(q) else 0.0")),
)  # fmt: skip

MUTANTS: tuple[Mutant, ...] = (*MIRRORS, *SUMS)
