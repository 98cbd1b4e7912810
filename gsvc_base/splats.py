"""The data everybody passes on: the 2D Gaussian splats of one frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from gsvc_base.arrays import F4 as F4
from gsvc_base.checks import door, numbers
from gsvc_base.constants import SMALLEST_NORMAL
from gsvc_base.errors import UsageError

PARAMETERS_PER_SPLAT = 8
"""Position (2), Cholesky factor (3), weighted colour (3); paper section 3.2."""


@dataclass(frozen=True, eq=False)
class Splats:
    """N splats as three binary32 arrays; index n is the same splat in each.

    Attributes
    ----------
    positions
        (N, 2) f4, the centre mu = (x, y) in pixels of the coded frame; origin top left, y down, the centre of the
        first pixel at (0.5, 0.5).
    cholesky
        (N, 3) f4, the entries (l11, l21, l22) in pixels of the lower triangular L with covariance L L^T.
    colors
        (N, 3) f4, the weighted colour c' as (R, G, B); 1 is full scale, any sign.

    A position or factor that a scale has taken beyond binary32 is infinite, and the splat covers nothing.

    To NumPy they are an array of their parameters, (N, 8) f4: what spec.md calls `parameters`.

    Raises
    ------
    UsageError
        A shape does not fit, a value is NaN, or a colour is infinite.
    """

    positions: F4
    cholesky: F4
    colors: F4

    def __post_init__(self) -> None:
        for name, columns in (("positions", 2), ("cholesky", 3), ("colors", 3)):
            given = numbers(getattr(self, name), f"Splats.{name}", f"give an array (N, {columns})")
            array = np.ascontiguousarray(given)
            if array.ndim != 2 or array.shape[1] != columns:
                raise UsageError(f"Splats.{name} has shape {array.shape}; it must be (N, {columns})")
            wrong = ~np.isfinite(array) if name == "colors" else np.isnan(array)
            if wrong.any():
                value = "NaN or infinite" if name == "colors" else "NaN"
                raise UsageError(f"Splats.{name} is {value} at splat {int(np.argwhere(wrong)[0, 0])}")
            object.__setattr__(self, name, array)
        if not len(self.positions) == len(self.cholesky) == len(self.colors):
            counts = f"{len(self.positions)}, {len(self.cholesky)} and {len(self.colors)}"
            raise UsageError(f"positions, cholesky and colors hold {counts} splats; the counts must be equal")

    def __len__(self) -> int:
        return len(self.positions)

    def __eq__(self, other: object) -> bool:
        """Bit-equality of all parameters (so -0 differs from +0)."""
        return isinstance(other, Splats) and len(self) == len(other) and self.tobytes() == other.tobytes()

    __hash__ = None  # type: ignore[assignment]

    @classmethod
    def empty(cls) -> Self:
        """No splats: a black frame."""
        return cls(np.empty((0, 2), np.float32), np.empty((0, 3), np.float32), np.empty((0, 3), np.float32))

    @classmethod
    def of(cls, parameters: "Splats | ArrayLike") -> "Splats":
        """Splats as they are, or those of an (N, 8) array: what an operation of spec.md is given as `parameters`."""
        return parameters if isinstance(parameters, Splats) else cls.from_array(parameters)

    @classmethod
    def from_array(cls, array: ArrayLike) -> Self:
        """Split an (N, 8) array with columns x, y, l11, l21, l22, R, G, B."""
        packed = cls.parameters_of(array)
        return cls(packed[:, 0:2], packed[:, 2:5], packed[:, 5:8])

    @classmethod
    def parameters_of(cls, splats: "Splats | ArrayLike") -> F4:
        """The parameters of splats, or an (N, 8) array of numbers as f4; what a number says is not looked at.

        Raises
        ------
        UsageError
            It is neither.
        """
        packed = numbers(splats, "the splats", f"give Splats or an array (N, {PARAMETERS_PER_SPLAT})")
        if packed.ndim != 2 or packed.shape[1] != PARAMETERS_PER_SPLAT:
            raise UsageError(f"the array has shape {packed.shape}; it must be (N, {PARAMETERS_PER_SPLAT})")
        return packed

    def to_array(self) -> F4:
        """All parameters as (N, 8) f4 with columns x, y, l11, l21, l22, R, G, B."""
        return np.concatenate([self.positions, self.cholesky, self.colors], axis=1)

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        if copy is False:
            raise ValueError("the parameters of splats are in three arrays, so that an array of all is a copy")
        return self.to_array().astype(dtype or np.float32, copy=False)

    def tobytes(self) -> bytes:
        """Positions, Cholesky factors and colours, each little-endian binary32 in C order: what a checksum covers."""
        return b"".join(
            part.astype("<f4", copy=False).tobytes() for part in (self.positions, self.cholesky, self.colors)
        )

    def take(self, indices: NDArray[Any]) -> "Splats":
        """The splats that an index or boolean array selects, in its order."""
        rows = np.flatnonzero(indices) if indices.dtype == np.bool_ else indices  # `take` copies rows, [] elements
        return Splats(*(part.take(rows, axis=0) for part in (self.positions, self.cholesky, self.colors)))

    def append(self, other: "Splats") -> "Splats":
        """These splats, then the other ones."""
        return Splats.joined([self, other])

    @classmethod
    def joined(cls, parts: "Sequence[Splats]") -> "Splats":
        """The splats of one set after the other, at least one; those of a single set are not copied."""
        if len(parts) == 1:
            return parts[0]
        columns = zip(*((part.positions, part.cholesky, part.colors) for part in parts), strict=True)
        return cls(*map(np.concatenate, columns))


# twin of spec.scale_parameters
@door
def scale_parameters(
    parameters: Splats | ArrayLike, width: int, height: int, new_width: int, new_height: int
) -> Splats:
    """The splats of a frame for a frame of another size, which then shows the same picture (9-8).

    Every factor and every product is rounded to binary32 (R-9.4-1); a product beyond it is infinite.

    Parameters
    ----------
    parameters
        The splats, or their parameters (N, 8) f4.
    width, height
        Size of their frame in pixels.
    new_width, new_height
        Size of the other frame in pixels.

    Returns
    -------
    Splats
        Positions and the rows of L are scaled; the colours are the same.

    Raises
    ------
    UsageError
        The parameters do not describe splats.
    """
    splats = Splats.of(parameters)
    a, e = np.float32(new_width) / np.float32(width), np.float32(new_height) / np.float32(height)
    with np.errstate(over="ignore", under="ignore"):
        positions = splats.positions * np.array([a, e], np.float32)
        cholesky = splats.cholesky * np.array([a, e, e], np.float32)
    return Splats(positions, cholesky, splats.colors)


# twin of spec.scale_parameters_filtered
@door
def scale_parameters_filtered(
    parameters: Splats | ArrayLike, width: int, height: int, new_width: int, new_height: int
) -> Splats:
    """The splats of a frame for a smaller one, filtered by the area of its pixels, computed in binary64 (9-9).

    A side that does not become smaller is not filtered, nor is a splat that is degenerate (R-9.4-3).

    Parameters
    ----------
    parameters
        The splats, or their parameters (N, 8) f4.
    width, height
        Size of their frame in pixels.
    new_width, new_height
        Size of the other frame in pixels.

    Returns
    -------
    Splats
        Positions are scaled; L is scaled and made wider, and the colours paler, so that a splat's sum stays.

    Raises
    ------
    UsageError
        The parameters do not describe splats.
    """
    splats = Splats.of(parameters)
    a, e = new_width / width, new_height / height
    v_x = max(0, width - new_width) * (width + new_width) / (12 * width * width)
    v_y = max(0, height - new_height) * (height + new_height) / (12 * height * height)
    entries = splats.cholesky  # (l11, l21, l22)
    drawn = np.isfinite(entries).all(axis=1) & (entries[:, [0, 2]] >= SMALLEST_NORMAL).all(axis=1)  # R-9.4-3
    positions, cholesky = splats.positions * np.array([a, e]), entries * np.array([a, e, e])  # (9-8), f8
    colors = splats.colors.astype(np.float64)
    l11, l21, l22 = cholesky[drawn].T
    m11 = np.sqrt(l11 * l11 + v_x)
    m22 = np.sqrt(l22 * l22 + v_y + l21 * l21 * v_x / (m11 * m11))
    colors[drawn] *= (l11 / m11 * (l22 / m22))[:, None]
    cholesky[drawn] = np.column_stack([m11, l21 * (l11 / m11), m22])  # (9-9)
    with np.errstate(over="ignore", under="ignore"):
        return Splats(*(part.astype(np.float32) for part in (positions, cholesky, colors)))
