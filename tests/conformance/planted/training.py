"""Mutants of the loss, Adan, pruning, augmentation, key frames and convergence."""

import numpy as np

from planted import after, before, patched

AREA = "training"


def rows(name, first):
    return lambda out, i: (out[name].__setitem__(np.s_[first:], 0), out)[1]


def kept_rows(first, *names):
    """Rows from one on keep what they had."""
    return lambda out, i: {name: np.concatenate([out[name][:first], i[name][first:]]) for name in names}


def never_reset(losses, patience, tolerance):
    small = np.cumsum(abs(np.diff(losses, prepend=np.inf)) <= tolerance)
    ends = np.flatnonzero(small >= patience)
    return {"iteration": np.array(ends[0] + 1 if len(ends) else 0, np.int64)}


PLANTED = (
    after(AREA, "loss of three channels", "loss", "1/3|third|three channels", lambda out, i: {"loss": out["loss"] / 3}),
    after(AREA, "loss halved", "loss", "half", lambda out, i: {"loss": out["loss"] / 2}),
    after(AREA, "loss not divided", "loss", "H W", lambda out, i: {"loss": out["loss"] * i["picture"][:, :, 0].size}),
    after(AREA, "loss is its root", "loss", "root", lambda out, i: {"loss": np.sqrt(out["loss"])}),
    after(AREA, "loss first 64 pixels", "loss", "from 64", lambda out, i: {"loss": np.array(((np.clip(i["picture"].astype("f8"), 0, 1) - i["target"]) ** 2).sum(axis=2).ravel()[:64].sum() / i["picture"][:, :, 0].size)}),
    after(AREA, "loss partial block of 32", "loss", "partial block of 32", lambda out, i: {"loss": np.array((d := ((np.clip(i["picture"].astype("f8"), 0, 1) - i["target"]) ** 2).sum(axis=2).ravel())[: d.size // 32 * 32].sum() / d.size)}),
    after(AREA, "loss last row", "loss", "last of the rows", lambda out, i: {"loss": np.array(((np.clip(i["picture"].astype("f8"), 0, 1) - i["target"]) ** 2)[:-1].sum() / i["picture"][:, :, 0].size)}),
    after(AREA, "loss of red alone", "loss", "red", lambda out, i: {"loss": np.array(((np.clip(i["picture"].astype("f8"), 0, 1) - i["target"]) ** 2)[:, :, 0].sum() / i["picture"][:, :, 0].size)}),
    after(AREA, "residual halved", "loss", "half|factor 2", lambda out, i: {"residual": out["residual"] * np.float32(0.5)}),
    after(AREA, "residual of the mean of channels", "loss", "third|1/3", lambda out, i: {"residual": out["residual"] / np.float32(3)}),
    after(AREA, "residual uphill", "loss", "other sign|target minus", lambda out, i: {"residual": -out["residual"]}),
    after(AREA, "residual last row 0", "loss", "last of the rows", lambda out, i: (out["residual"].__setitem__(np.s_[-1:], 0), out)[1]),
    patched(AREA, "residual of the unclamped picture", "loss", "clamped|before it is clamped", ("residual = 2 * difference / pixels", "residual = 2 * (picture.astype(np.float64) - target) / pixels")),
    patched(AREA, "residual zero where clamped", "loss", "clamped", ("residual = 2 * difference / pixels", "residual = np.where((picture >= 0) & (picture <= 1), 2 * difference / pixels, 0)")),
    patched(AREA, "beta2 and beta3", "adan_step", "beta2 and beta3|n|v", ("v = beta2 * v.astype(np.float64) + (1 - beta2) * d", "beta2, beta3 = beta3, beta2\n    v = beta2 * v.astype(np.float64) + (1 - beta2) * d")),
    patched(AREA, "no corrections", "adan_step", "bias correction|parameters alone", ("corrected_m = m / (1 - beta1**k)", "corrected_m = m"), ("corrected_v = v / (1 - beta2**k)", "corrected_v = v"), ("corrected_n = n / (1 - beta3**k)", "corrected_n = n")),
    patched(AREA, "steps from 0", "adan_step", "steps|step", ("k = steps[:, None] + 1", "k = steps[:, None] + 2")),
    patched(AREA, "root of n without correction", "adan_step", "correction|root", ("corrected_n = n / (1 - beta3**k)", "corrected_n = n / (1 - beta3**k) ** 2")),
    patched(AREA, "n not squared", "adan_step", "\\bn\\b", ("(1 - beta3) * (ahead * ahead)", "(1 - beta3) * abs(ahead)")),
    patched(AREA, "previous not kept", "adan_step", "previous", ('"previous": g.astype(np.float32)', '"previous": (0 * g).astype(np.float32)')),
    patched(AREA, "steps not counted", "adan_step", "steps", ('"steps": steps + 1,', '"steps": steps,')),
    patched(AREA, "step without the rate", "adan_step", "rate", ("- unit * rate * update", "- unit * update")),
    after(AREA, "adan first 8 rows", "adan_step", "from 8 on", kept_rows(8, "parameters", "m", "v", "n", "previous", "steps")),
    after(AREA, "adan first 16 rows zero", "adan_step", "from 16 on", lambda out, i: {k: np.where(np.arange(len(v)).reshape((-1,) + (1,) * (v.ndim - 1)) < 16, v, 0).astype(v.dtype) for k, v in out.items()}),
    after(AREA, "adan last row", "adan_step", "last of the splats", kept_rows(-1, "parameters", "m", "v", "n", "previous", "steps")),
    after(AREA, "m of binary16", "adan_step", "binary16|few bits|\\bm\\b", lambda out, i: {"m": out["m"].astype(np.float16).astype(np.float32)}),
    after(AREA, "rates one early", "learning_rates", "early|late|iteration", lambda out, i: {"rates": np.array([i["rate"] * i["factor"] ** ((int(n) + 1) // i["interval"]) for n in i["iterations"]])}),
    after(AREA, "rates of binary32", "learning_rates", "binary32|few bits", lambda out, i: {"rates": (np.float32(i["rate"]) * np.float32(i["factor"]) ** (i["iterations"] // i["interval"]).astype(np.float32)).astype(np.float64)}),
    after(AREA, "rates first 4", "learning_rates", "from 4 on", rows("rates", 4)),
    patched(AREA, "smallest kept", "prune", "smallest|largest", ("np.argsort(-magnitude", "np.argsort(magnitude")),
    patched(AREA, "ties by the last", "prune", "equal|ties", ("    largest_first = np.argsort(-magnitude, kind=\"stable\")\n", "    largest_first = len(weights) - 1 - np.argsort(-magnitude[::-1], kind=\"stable\")\n")),
    patched(AREA, "signed weights", "prune", "sign|magnitude", ("magnitude = np.abs(weights)", "magnitude = weights")),
    patched(AREA, "survivors by size", "prune", "order|sorted", ('np.sort(kept).astype(np.int64)', 'kept.astype(np.int64)')),
    before(AREA, "one more removed", "prune", "one|removed", lambda i: {**i, "removed": min(len(i["weights"]), i["removed"] + 1)}),
    after(AREA, "survivors from 1", "prune", "larger by 1|from 1|one", lambda out, i: {"survivors": out["survivors"] + 1}),
    patched(AREA, "new splats not at the end", "augment", "before", ("np.concatenate([values, new])", "np.concatenate([new, values])")),
    patched(AREA, "new height by width", "augment", "height|\\by\\b", ("uniforms[:, 1] * np.float32(height)", "uniforms[:, 1] * np.float32(width)")),
    patched(AREA, "new weights of a tenth", "augment", "weight|\\bw\\b", ("NEW_WEIGHT = np.float32(0.01)", "NEW_WEIGHT = np.float32(0.1)")),
    patched(AREA, "new l21 negative", "augment", "l21", ("new[:, 3] = uniforms[:, 3]", "new[:, 3] = -uniforms[:, 3]")),
    patched(AREA, "plan fraction up", "pruning_plan", "rounded up|counts", ("total = round(fraction * splats)", "total = math.ceil(fraction * splats)")),
    patched(AREA, "plan iterations from 0", "pruning_plan", "iterations", ("planned = sorted(plan)", "planned = sorted(plan)\n    plan = {t - 1: c for t, c in plan.items()}\n    planned = sorted(plan)")),
    patched(AREA, "plan remainder first", "pruning_plan", "remainder|counts", ("        if time == last:\n            count", "        if time == times[0]:\n            count")),
    patched(AREA, "window of one side", "select_key_frames", "window", ("first = max(1, t - window)", "first = t")),
    patched(AREA, "two deviations", "select_key_frames", "threshold|deviation", ("k = Fraction(threshold)", "k = Fraction(threshold) - 1")),
    patched(AREA, "deviation not squared", "select_key_frames", "deviation|threshold", ("above * above > threshold * threshold * variance", "above * above > threshold * variance")),
    patched(AREA, "keys without the first", "select_key_frames", "first", ("    keys = {0}\n", "    keys = set()\n")),
    before(AREA, "patience one less", "converged", "early|one", lambda i: {"patience": i["patience"] - 1}),
    patched(AREA, "counted from 0", "converged", "one|from 0|smaller by 1", ("np.array(j + 1, np.int64)", "np.array(j, np.int64)")),
    after(AREA, "not reset", "converged", "in a row|reset", lambda out, i: never_reset(**i)),
)  # fmt: skip
