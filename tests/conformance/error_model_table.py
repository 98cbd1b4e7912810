"""What the bounds of error models say (spec.md sections 13.3 and 13.10), and how far arithmetic with few digits is off.

    python -m tests.conformance.error_model_table --markdown docs/accuracy.md

Bounds are those of all numbers that a splat reaches, in the core vectors of an operation and in a fitted picture.
Errors are those of the fitted picture's sum, before clamping, in NumPy.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.constants import LN_255
from gsvc_base.pages.markers import put_between
from gsvc_base.pages.tables import markdown_table
from gsvc_base.rendering.bounds import render_exact_with_bound
from gsvc_base.rendering.definition import footprints
from gsvc_base.rendering.error_models import ERROR_MODELS, LOCAL, ErrorModel
from gsvc_conformance.operations.exact_splats import picture_by_model
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector_folder import Selection, VectorFolder
from gsvc_lab.benchmarks.material import trained
from gsvc_ref import Splats

BEGIN: Final = "<!-- begin: python -m tests.conformance.error_model_table --markdown -->"
END: Final = "<!-- end: python -m tests.conformance.error_model_table --markdown -->"
WIDTH, HEIGHT, SPLATS = 352, 288, 2000
STEPS: Final = 255
TOO_WIDE: Final = 4
"""Steps of 8 bits beyond which a bound says too little of a picture."""

Weight = Callable[[F8, F8, F8], F8]
"""The weights of a splat (8,) at columns (1, w) and rows (h, 1) of pixel centres."""


def model_rows() -> Iterator[list[str]]:
    """A row for each model, and for models whose positions are stored in the frame."""
    vectors = {name: list(_core(name)) for name in ("render_sum", "render_frame")}
    splats = trained(WIDTH, HEIGHT, SPLATS).splats.to_array()
    in_frame = [replace(ERROR_MODELS[name], local=float(WIDTH)) for name in ("fp16/1", "bf16/1")]
    for model in (*ERROR_MODELS.values(), *in_frame):
        bounds = [np.concatenate([_reached(*inputs, model) for inputs in given]) for given in vectors.values()]
        ordinary = _reached(splats, WIDTH, HEIGHT, model)
        cells = [f"{_steps(np.quantile(bound, share))}" for bound in (*bounds, ordinary) for share in (0.5, 0.99)]
        wide = np.quantile(ordinary, 0.99) * STEPS > TOO_WIDE
        name = model.name if model.local == LOCAL else f"{model.name} but for positions, stored in the frame"
        yield [name, *cells, "no" if wide else "yes"]


def _core(operation: str) -> Iterator[tuple[F4, int, int]]:
    """The splats and sizes of the core vectors of an operation."""
    folder = VectorFolder(VECTORS)
    names = folder.select(Selection(tiers=("core",), operations=(operation,)))
    for vector in folder.read(names):
        yield vector.inputs["parameters"], vector.inputs["width"], vector.inputs["height"]


def _reached(parameters: F4, width: int, height: int, model: ErrorModel) -> F8:
    """The bounds of the numbers that a splat reaches."""
    value, bound = picture_by_model(model, parameters, width, height)
    return np.asarray(bound[value != 0])


def error_rows() -> Iterator[list[str]]:
    """A row for each kind of arithmetic."""
    splats = trained(WIDTH, HEIGHT, SPLATS).splats
    for name, weight, factor, model in (
        ("binary32, factors of 11 bits in all products", with_factors, to_11_bits, "tf32/1"),
        ("binary16 stored, positions in the tile", stored(local=True), to_half, "fp16/1"),
        ("binary16 stored, positions in the frame", stored(local=False), to_half, "fp16/1"),
        ("the exponent a product of matrices in the frame, factors of 11 bits", product(1, None), to_11_bits, "tf32/1"),
        ("the same in the tile", product(1, LOCAL), to_11_bits, "tf32/1"),
        ("the same in the tile, coefficients in two parts", product(2, LOCAL), to_11_bits, "tf32/1"),
    ):
        value, bound = render_exact_with_bound(splats, WIDTH, HEIGHT, ERROR_MODELS[model])
        error = abs(drawn(splats, weight, factor) - value)
        cells = [_steps(np.quantile(error, share)) for share in (0.5, 0.99, 1)]
        beyond = np.count_nonzero(error > bound) / error.size
        yield [name, *cells, model, f"{100 * beyond:.2g} %", f"{np.quantile(error / bound, 0.99):.2g}"]


def drawn(splats: Splats, weight: Weight, factor: Callable[[F8], F8]) -> F8:
    """The sum of splats (H, W, 3) f8, added in binary32."""
    C = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    for _, splat, pixels in footprints(splats, WIDTH, HEIGHT):
        columns, rows = (np.arange(side.start, side.stop) + 0.5 for side in (pixels.columns, pixels.rows))
        g = weight(splat, columns[None, :], rows[:, None])
        C[pixels.rows, pixels.columns] += (factor(g)[..., None] * factor(splat[5:])).astype(np.float32)
    return C.astype(np.float64)


def to_11_bits(x: Any) -> F8:
    """To 11 significant bits, ties to even."""
    fraction, exponent = np.frexp(np.asarray(x, np.float64))
    return np.asarray(np.ldexp(np.rint(fraction * 2048), exponent - 11))


def to_half(x: Any) -> F8:
    """To binary16."""
    return np.asarray(x, np.float64).astype(np.float16).astype(np.float64)


def with_factors(splat: F8, columns: F8, rows: F8) -> F8:
    """(9-1) with factors of 11 bits."""
    x, y, l11, l21, l22 = splat[:5]
    u1 = to_11_bits(columns - x) * to_11_bits(1 / l11)
    u2 = to_11_bits(rows - y - to_11_bits(l21) * to_11_bits(u1)) * to_11_bits(1 / l22)
    return _covering((to_11_bits(u1) ** 2 + to_11_bits(u2) ** 2) / 2)


def stored(*, local: bool) -> Weight:
    """(9-1) with every number stored in binary16."""

    def weight(splat: F8, columns: F8, rows: F8) -> F8:
        x, y = splat[:2]
        l11, l21, l22 = to_half(splat[2:5])
        d_x, d_y = (_distance(side, at, local=local) for side, at in ((columns, x), (rows, y)))
        u1 = to_half(d_x * to_half(1 / l11))
        u2 = to_half(to_half(d_y - to_half(l21 * u1)) * to_half(1 / l22))
        return to_half(_covering(to_half(to_half(u1 * u1) + to_half(u2 * u2)) / 2))

    return weight


def _distance(side: F8, at: float, *, local: bool) -> F8:
    origin = _origin(side) if local else 0.0
    return to_half(to_half(side - origin) - to_half(at - origin))


def _origin(side: F8) -> F8:
    """The middle of the tile of each pixel."""
    return np.asarray(LOCAL * np.floor(side / LOCAL) + LOCAL / 2)


def product(parts: int, tile: float | None) -> Weight:
    """[1, i, j, i^2, i j, j^2] times six coefficients, each of so many parts; in the frame where there is no tile."""

    def weight(splat: F8, columns: F8, rows: F8) -> F8:
        x, y, l11, l21, l22 = splat[:5]
        origin = [_origin(side) if tile else np.zeros_like(side) for side in (columns, rows)]
        i, j, x, y = columns - origin[0], rows - origin[1], x - origin[0], y - origin[1]
        a, b, c = (1 + (l21 / l22) ** 2) / l11**2 / 2, -l21 / (l11 * l22**2), 1 / l22**2 / 2
        terms = (
            (a * x * x + b * x * y + c * y * y, 1.0), (-2 * a * x - b * y, i), (-2 * c * y - b * x, j),
            (a, i * i), (b, i * j), (c, j * j),
        )  # fmt: skip
        sigma = np.zeros(np.broadcast_shapes(columns.shape, rows.shape), np.float32)
        for coefficient, basis in terms:
            left = np.asarray(coefficient, np.float64)
            for _ in range(parts):
                part = to_11_bits(left)
                sigma = sigma + (part * to_11_bits(basis)).astype(np.float32)
                left = left - part
        return _covering(sigma.astype(np.float64))

    return weight


def _covering(sigma: F8) -> F8:
    return np.where(sigma <= LN_255, np.exp(-np.maximum(sigma, 0)), 0.0)


def _steps(value: Any) -> str:
    return f"{STEPS * value:.2g}" if STEPS * value < 100 else f"{STEPS * value:.0f}"


def text() -> str:
    """Both tables."""
    bounds = ["model", "`render_sum`: median", "99 %", "`render_frame`: median", "99 %", "picture: median", "99 %",
              f"says something (99 % within {TOO_WIDE})"]  # fmt: skip
    errors = ["arithmetic", "median", "99 %", "largest", "model", "beyond its bound", "error/bound, 99 %"]
    return "\n".join(
        [
            f"Bounds, in steps of 8 bits. The picture has {WIDTH}x{HEIGHT} pixels and {SPLATS:,} fitted splats.",
            "",
            markdown_table(bounds, list(model_rows())),
            "",
            "Errors of the same picture, in steps of 8 bits, every rounding to nearest.",
            "",
            markdown_table(errors, list(error_rows())),
        ]
    )


def main() -> None:
    """Print the tables, or put them into a document."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="put them between the marks of a document")
    arguments = parser.parse_args()
    if arguments.markdown:
        put_between(arguments.markdown, BEGIN, END, text())
    else:
        print(text())


if __name__ == "__main__":
    main()
