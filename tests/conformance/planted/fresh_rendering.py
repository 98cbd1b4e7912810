"""Mutants of rendering and of its gradients, written without a look at what the kit says."""

import numpy as np

from planted import after, before, patched

ADD = "        C[top:bottom, left:right] += g[:, :, None] * splat[5:8]  # (9-2)"
G = "        g = np.where(sigma <= LN_255, np.exp(-sigma), 0.0)"
ENDED = '        return {"sum": C.astype(np.float32)}'
COVERED = "    covered = sigma <= LN_255\n"
BOX = "        if left == right or top == bottom:\n            continue\n        x, y, l11, l21, l22 = splat[:5]\n"
SPLAT = "    for splat, (left, right, top, bottom) in zip(parameters.astype(np.float64), reach):"


def of_sum(change):
    """Something done to the sum."""
    return lambda out, inputs: {"sum": np.ascontiguousarray(change(out["sum"]), np.float32)}


def of_splats(change):
    """Something done to the splats."""

    def changed(inputs):
        with np.errstate(all="ignore"):
            return {"parameters": np.ascontiguousarray(change(inputs["parameters"].copy()), np.float32)}

    return changed


def of_gradients(change):
    """Something done to the gradients, `change(gradients, parameters)`."""

    def changed(out, inputs):
        with np.errstate(all="ignore"):
            return {"gradients": np.asarray(change(out["gradients"], inputs["parameters"]), np.float32)}

    return changed


def of_residual(change):
    """Something done to the residual."""
    return lambda inputs: {"residual": np.ascontiguousarray(change(inputs["residual"].copy()), np.float32)}


def without(*index):
    """Zeros in a part of a picture."""

    def change(picture):
        picture[index] = 0
        return picture

    return change


def srgb(linear):
    linear = np.maximum(linear, 0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def rows_of_256_bytes(picture):
    """Rows of a texture, of multiples of 256 bytes, taken for a picture without gaps."""
    height, width, _ = picture.shape
    padded = np.zeros((height, -(-width * 3 // 64) * 64), picture.dtype)
    padded[:, : width * 3] = picture.reshape(height, -1)
    return padded.ravel()[: picture.size].reshape(picture.shape)


def vectors_of_four(picture):
    four = np.zeros((picture.shape[0] * picture.shape[1], 4), picture.dtype)
    four[:, :3] = picture.reshape(-1, 3)
    return four.ravel()[: picture.size].reshape(picture.shape)


def exchanged_groups(picture):
    """As many groups of 16 in a row as the picture has in a column, and the other way round."""
    across, down = -(-picture.shape[0] // 16) * 16, -(-picture.shape[1] // 16) * 16
    picture[down:] = 0
    picture[:, across:] = 0
    return picture


def whole_fours(picture):
    picture.reshape(-1, 3)[picture.shape[0] * picture.shape[1] // 4 * 4 :] = 0
    return picture


def low_pass(p):
    a, b, c = (p[:, i].astype(np.float64) for i in (2, 3, 4))
    l11 = np.sqrt(a * a + 0.3)
    l21 = a * b / l11
    l22 = np.sqrt(b * b + c * c + 0.3 - l21 * l21)
    p[:, 2:5] = np.stack([l11, l21, l22], 1)
    return p


def last_of_batches(p):
    """The last of each 32 splats is read before it is there."""
    p[31::32] = p[30 : 30 + 32 * len(p[31::32]) : 32]
    return p


def deep_as_eight_bits(out, inputs):
    depth = inputs["bit_depth"]
    eight = np.rint(np.clip(inputs["sum"].astype(np.float64), 0, 1) * 255)
    return {"frame": (eight * 2 ** (depth - 8)).astype(out["frame"].dtype)}


SUMS = (
    patched("rendering", "a splat's last tile is not listed", "render_sum", r"(?i)tile|\bbox|extent|right|cut off",
            (BOX, "        right = right if right // 16 == left // 16 else right // 16 * 16\n" + BOX)),
    after("rendering", "the sum in a texture of 8 bits", "render_sum", r"(?i)8 bits|1/255|quanti|steps of|clamp|samples",
          of_sum(lambda s: np.rint(np.clip(s, 0, 1) * 255) / 255)),
    after("rendering", "the sum in a texture of rgba16float", "render_sum", r"(?i)binary16|\bhalf\b|few bits|16 bits|precision",
          of_sum(lambda s: s.astype(np.float16))),
    after("rendering", "the sum in an sRGB target", "render_sum", r"(?i)gamma|transfer|srgb|curve|power|function of",
          of_sum(srgb)),
    patched("rendering", "centres flipped, not ellipses", "render_sum", r"(?i)mirror|upward|flip|upside|y axis|\by\b",
            ("        d_y = np.arange(top, bottom)[:, None] + 0.5 - y",
                         "        d_y = height - np.arange(top, bottom)[:, None] - 0.5 - y"),
            ("    reach = boxes(parameters, width, height, SUPPORT_RADIUS)",
             "    reach = np.tile(np.array([0, width, 0, height]), (len(parameters), 1))"
             " * (np.ptp(boxes(parameters, width, height, SUPPORT_RADIUS), axis=1) > 0)[:, None]")),
    patched("rendering", "exp2 of sigma", "render_sum", r"(?i)exp2|\b2\^|base|2 \*\*|powers? of (two|2)|log2|ln 2",
            (G, G.replace("exp(", "exp2("))),
    patched("rendering", "the squared distance against the support of sigma", "render_sum",
            r"(?i)support|cut|threshold|edge|2 sigma|u\.u", (G, G.replace("sigma <=", "2 * sigma <="))),
    patched("rendering", "weights times colours below 1/255 skipped", "render_sum",
            r"(?i)1/255|threshold|small|faint|weak|support|colou?r.*(skip|left out|below)",
            (ADD, ADD.replace("g[:, :, None] *", "np.where(g * max(abs(splat[5:8])) < 1 / 255, 0, g)[:, :, None] *"))),
    patched("rendering", "weights of at most 0.99", "render_sum", r"(?i)0\.99|clamp|at most|peak|largest weight|limit",
            (ADD, ADD.replace("g[:, :, None]", "np.minimum(g, 0.99)[:, :, None]"))),
    before("rendering", "0.3 added to both variances", "render_sum", r"(?i)0\.3\b|low.?pass|blur|wide|larger|dilat|filter",
           of_splats(low_pass)),
    after("rendering", "groups counted down the rows for those across", "render_sum",
          r"(?i)(rows?|columns?|pixels).*(from|beyond|left out|untouched|not written)|exchang|launch|grid", of_sum(exchanged_groups)),
    after("rendering", "rows of 256 bytes copied as a whole", "render_sum", r"(?i)pitch|stride|pad|aligned|row.*(long|start|gap|bytes)",
          of_sum(rows_of_256_bytes)),
    after("rendering", "pixels of vec3, which has 16 bytes", "render_sum", r"(?i)four|\b4\b|alpha|vec[34]|stride|pad|RGBA",
          of_sum(vectors_of_four)),
    after("rendering", "threads of four pixels, whole ones only", "render_sum",
          r"(?i)last|whole|multiple|from .* on|(pixels?|elements?).*(left out|missing|not written|untouched)", of_sum(whole_fours)),
    before("rendering", "a count of splats in 8 bits", "render_sum",
           r"(?i)modul|8 bits|splats? .*(missing|left out|not drawn|lost)|first \d+ splats|256|from splat", of_splats(lambda p: p[: len(p) % 256])),
    patched("rendering", "front to back with a transmittance", "render_sum", r"(?i)transmitt|alpha|blend|opaque|composit|front|\bover\b",
            ("    C = np.zeros((height, width, 3))\n    reach", "    C, T = np.zeros((height, width, 3)), np.ones((height, width, 1))\n    reach"),
            (ADD, ADD.replace("g[:, :, None] *", "T[top:bottom, left:right] * g[:, :, None] *")
             + "\n        T[top:bottom, left:right] *= 1 - g[:, :, None]")),
    before("rendering", "the last of 32 splats read too early", "render_sum",
           r"(?i)splats?\b.*(\b31\b|missing|twice|not drawn|2 times|left out|drawn)|every 32|32nd", of_splats(last_of_batches)),
    before("rendering", "splats with a centre outside culled", "render_sum render_frame", r"(?i)outside|centre|cull|off the frame",
           lambda i: {"parameters": i["parameters"][((i["parameters"][:, 0] >= 0) & (i["parameters"][:, 0] < i["width"])
                                                     & (i["parameters"][:, 1] >= 0) & (i["parameters"][:, 1] < i["height"]))]}),
    before("rendering", "a stride of 9 numbers between splats", "render_sum", r"(?i)stride|layout|\b9\b|splats?.*(shift|read|other)|parameters.*(shift|read)",
           of_splats(lambda p: np.concatenate([p.ravel(), np.zeros(len(p) + 8, np.float32)])[
               9 * np.arange(len(p))[:, None] + np.arange(8)].reshape(-1, 8) if len(p) else p)),
)  # fmt: skip

FRAMES = (
    patched("rendering", "256 times and the floor", "to_frame", r"(?i)256|peak \+ 1|floor|trunc|2\^|scaled|round",
            ("np.rint(clamped * peak).astype(sample_type(bit_depth))}  # R-9.1-1",
             "np.minimum(np.floor(clamped * (peak + 1)), peak).astype(sample_type(bit_depth))}")),
    after("rendering", "deep samples made of 8 bits", "to_frame", r"(?i)8 bits|255|low bits|shift|multiples|256|depth",
          deep_as_eight_bits),
    after("rendering", "deep samples with their bytes exchanged", "to_frame render_frame", r"(?i)bytes|endian",
          lambda out, i: {"frame": out["frame"].byteswap()}),
    patched("rendering", "what is no number is white", "to_frame_deterministic", r"(?i)nan|not a number|no number|not numbers",
            ("    v = np.where(sum > 0, sum, np.float32(0))", "    v = np.where(sum <= 0, np.float32(0), sum)\n    v = np.where(v == v, v, np.float32(1))")),
    patched("rendering", "u1 divided by l11", "render_sum_deterministic", r"(?i)divi|reciproc|quotient|/ ?l11|\br1\b",
            ("    u1 = ((columns + HALF) - x) * r1", "    u1 = ((columns + HALF) - x) / l11")),
    patched("rendering", "the polynomial by Horner's rule", "render_sum_deterministic", r"(?i)horner|polynomial|\(9-5\)|order of",
            ("    p = ((K5 * t + (K4 * m + K3)) * t + (K2 * m + K1)) * m + ONE", "    p = ((((K5 * m + K4) * m + K3) * m + K2) * m + K1) * m + ONE")),
    patched("rendering", "splats added to a sum by even and odd", "render_sum_deterministic",
            r"(?i)order|even|halves|partial|two sums|added",
            ("        for splat, (left, right, top, bottom) in zip(parameters, reach):\n            if left == right or top == bottom:\n                continue\n            columns",
             "        D = np.zeros_like(C)\n        for k, (splat, (left, right, top, bottom)) in enumerate(zip(parameters, reach)):\n"
             "            if left == right or top == bottom:\n                continue\n            columns"),
            ("            pixels = C[top:bottom, left:right]\n            C[top:bottom, left:right] = np.where(",
             "            B = D if k % 2 else C\n            pixels = B[top:bottom, left:right]\n            B[top:bottom, left:right] = np.where("),
            ('    return {"sum": C}', '    return {"sum": C + D}')),
    patched("rendering", "l21 scaled with the width", "scale_parameters", r"(?i)l21", ("[a, e, a, e, e, 1, 1, 1]", "[a, e, a, a, e, 1, 1, 1]")),
    patched("rendering", "scales that are not rounded", "scale_parameters", r"(?i)binary64|double|round|wider|factor",
            ("    a = np.float32(new_width) / np.float32(width)\n    e = np.float32(new_height) / np.float32(height)\n    factors = np.array([a, e, a, e, e, 1, 1, 1], np.float32)",
             "    a, e = new_width / width, new_height / height\n    factors = np.array([a, e, a, e, e, 1, 1, 1])"),
            ('{"parameters": parameters * factors}', '{"parameters": (parameters * factors).astype(np.float32)}')),
    after("rendering", "a work of 32 bits", "rendering_work", r"(?i)32 bits|2\^32|modul|wrap|overflow|2\^31",
          lambda out, i: {"work": out["work"] % 2**32}),
    patched("rendering", "boxes with both ends", "rendering_work", r"(?i)inclu|\+ 1|one (column|row|pixel)|both ends|wider|larger|box",
            ("np.sum((right - left) * (bottom - top))", "np.sum((right - left + 1) * (bottom - top + 1))")),
)  # fmt: skip

GRADIENTS = (
    after("gradients", "gradients summed in halves", "render_gradients", r"(?i)binary16|\bhalf\b|16 bits|few bits|precision",
          of_gradients(lambda g, p: g.astype(np.float16))),
    before("gradients", "residuals in a texture of rgba16float", "render_gradients", r"(?i)binary16|\bhalf\b|16 bits|few bits|precision",
           of_residual(lambda e: e.astype(np.float16))),
    before("gradients", "a shuffle of 16, 8, 4, 2 and not 1", "render_gradients",
           r"(?i)odd|even|second|column|lanes|every|residual.*(lost|left out|half)", of_residual(without(slice(None), slice(1, None, 2)))),
    before("gradients", "whole tiles of the residual", "render_gradients", r"(?i)whole tile|tile|beyond|(rows|columns) .*from|last",
           of_residual(lambda e: np.pad(e[: e.shape[0] // 16 * 16, : e.shape[1] // 16 * 16],
                                        ((0, e.shape[0] % 16), (0, e.shape[1] % 16), (0, 0))))),
    patched("gradients", "positions by u over l", "render_gradients", r"(?i)l21|\bx\b|v1|\bu1\b|position",
            ("    of_x = np.sum(q * v1)", "    of_x = np.sum(q * u1 / l11)")),
    patched("gradients", "gradients as means over the covered pixels", "render_gradients",
            r"(?i)cover|mean|average|number of pixels|divided|splat by splat|ratio|factor",
            ("    return [of_x, of_y, of_l11, of_l21, of_l22, of_red, of_green, of_blue]",
             "    return list(np.array([of_x, of_y, of_l11, of_l21, of_l22, of_red, of_green, of_blue]) / max(len(g), 1))")),
    patched("gradients", "each tile writes over the one before", "render_gradients",
            r"(?i)tile|last|overwr|lost|region|part of",
            (COVERED, COVERED + "    tiles = np.arange(height)[:, None] // 16 * (width // 16 + 1) + np.arange(width) // 16\n"
             "    covered &= tiles == np.max(tiles[covered], initial=-1)\n")),
    after("gradients", "gradients of blue, green, red", "render_gradients", r"(?i)B, G, R|red|blue|channel|exchang|revers",
          of_gradients(lambda g, p: g[:, [0, 1, 2, 3, 4, 7, 6, 5]])),
    before("gradients", "a residual of 0 to 255", "render_gradients", r"255", of_residual(lambda e: e * np.float32(255))),
    after("gradients", "scales learned as logarithms", "render_gradients", r"(?i)\blog|l11|l22|times l|exp\(",
          of_gradients(lambda g, p: np.concatenate([g[:, :2], g[:, 2:3] * p[:, 2:3], g[:, 3:4], g[:, 4:5] * p[:, 4:5], g[:, 5:]], 1))),
    patched("gradients", "geometry without the weight", "render_gradients", r"(?i)\bg\b|exp\(|weight|without",
            ("    q = g * (e[:, 0]", "    q = 1 * (e[:, 0]")),
    patched("gradients", "gradients up to 3 sigma", "render_gradients", r"(?i)4\.5|3 sigma|support|three|cut|edge|3 standard",
            (COVERED, "    covered = sigma <= 4.5\n")),
    after("gradients", "gradients left in the order of y", "render_gradients", r"(?i)order|permut|sort|rows|other splat|exchang",
          of_gradients(lambda g, p: g[np.argsort(p[:, 1], kind="stable")])),
    before("gradients", "the first row of tiles counted twice", "render_gradients", r"(?i)twice|2 times|\brows?\b|counted|doubl",
           of_residual(lambda e: e * np.where(np.arange(e.shape[0]) % 16 == 0, 2, 1)[:, None, None])),
    after("gradients", "splats that cover nothing divided by zero", "render_gradients", r"(?i)nan|not a number|0 ?/ ?0",
          of_gradients(lambda g, p: np.where(np.any(g != 0, axis=1, keepdims=True), g, np.nan))),
    after("gradients", "gradients downhill", "render_gradients", r"(?i)sign|negative|-1\b", of_gradients(lambda g, p: -g)),
    before("gradients", "the residual one row late", "render_gradients", r"(?i)shift|\brows?\b|one pixel|moved|displac",
           of_residual(lambda e: np.roll(e, 1, axis=0))),
)  # fmt: skip

PLANTED = (*SUMS, *FRAMES, *GRADIENTS)
