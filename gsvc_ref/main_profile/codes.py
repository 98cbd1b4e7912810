"""The codes of a frame of profile `main`, before arithmetic (spec.md section 15)."""

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from gsvc_ref.arrays import I8
from gsvc_ref.main_profile.densities import Densities

REMOVED: Final = 8
"""The mode of a splat that is removed."""

SIDES: Final = (0, 64, 32, 16)
"""Side of a motion cell in pixels, by `motion_cell`; 0: no field."""


def _none(*shape: int) -> I8:
    return np.zeros(shape, np.int64)


@dataclass(frozen=True, eq=False)
class IntraCodes:
    """The codes of the splats of an I-frame, or of new ones, in the order of their cells.

    Attributes
    ----------
    cells
        (N, 2), column and row of the cell.
    colors
        (N, 3), k0, k1 and k2.
    shapes
        (N, 3), the codes of size, aspect and shear.
    places
        (N, 2), the place in the cell.
    """

    cells: I8 = field(default_factory=lambda: _none(0, 2))
    colors: I8 = field(default_factory=lambda: _none(0, 3))
    shapes: I8 = field(default_factory=lambda: _none(0, 3))
    places: I8 = field(default_factory=lambda: _none(0, 2))

    def __len__(self) -> int:
        return len(self.cells)

    def take(self, indices: I8) -> "IntraCodes":
        """The codes of some splats, in another order."""
        return IntraCodes(self.cells[indices], self.colors[indices], self.shapes[indices], self.places[indices])


@dataclass(frozen=True, eq=False)
class MainCodes:
    """The codes of an I- or P-frame.

    Attributes
    ----------
    quantizer
        0..79, which gives D.
    lane_exponent
        The binary logarithm of the number of lanes.
    densities
        The frame's own densities; None: those that are kept.
    new
        The splats of an I-frame, or the new ones of a P-frame.
    motion_cell
        0 no field, else 1, 2, 3: cells of 64, 32 or 16 pixels.
    vectors
        (rows, columns, 2), the vectors in quarter pixels.
    modes
        (N,), the mode of each splat of the frame before: bits 0 to 2 for differences of position, shape and colour, or
        `REMOVED`.
    differences
        (N, 8), q.
    """

    quantizer: int
    lane_exponent: int = 0
    densities: Densities | None = None
    new: IntraCodes = field(default_factory=IntraCodes)
    motion_cell: int = 0
    vectors: I8 = field(default_factory=lambda: _none(0, 0, 2))
    modes: I8 = field(default_factory=lambda: _none(0))
    differences: I8 = field(default_factory=lambda: _none(0, 8))


GROUPS: Final = (("position", 0, 2), ("shape", 2, 5), ("color", 5, 8))
"""The groups of differences: name, first component, and the one behind the last; bit i of a mode is that of group i."""


def modes_of(differences: I8, removed: I8) -> I8:
    """The mode of each splat (N,) from its differences (N, 8) and whether it is removed (N,)."""
    modes = sum(
        (differences[:, first:end] != 0).any(axis=1).astype(np.int64) << bit
        for bit, (_, first, end) in enumerate(GROUPS)
    )
    return np.where(removed.astype(bool), REMOVED, modes)
