"""The codes of a frame of profile `main`, before arithmetic (spec.md section 15)."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import I8
from gsvc_ref.main.densities import Densities
from gsvc_ref.paper import FrameType

REMOVED: Final = 8
"""The mode of a splat that is removed."""

SIDES: Final = (0, 64, 32, 16)
"""Side of a motion cell in pixels, by `motion_cell`; 0: no field."""


def _none(*shape: int) -> I8:
    return np.zeros(shape, np.int64)


class Field(NamedTuple):
    """A motion field."""

    vectors: I8  # (rows, columns, 2), in quarter pixels
    side: int  # of a cell in pixels; 0: no field


NO_FIELD: Final = Field(_none(0, 0, 2), 0)
"""The field of what does not move."""


class CodeArrays(NamedTuple):
    """The arrays of `IntraCodes`, as kernels have them: (N, 2), (N, 3), (N, 3) and (N, 2) i8."""

    cells: I8
    colors: I8
    shapes: I8
    places: I8

    @classmethod
    def empty(cls, count: int) -> "CodeArrays":
        """Arrays for the codes of some splats, to be filled."""
        return cls(*(np.empty((count, columns), np.int64) for columns in (2, 3, 3, 2)))


@dataclass(frozen=True, eq=False)
class IntraCodes:
    """The codes of the splats of an I-frame, or of new ones, in the order of their cells."""

    cells: I8 = field(default_factory=lambda: _none(0, 2))  # (N, 2), column and row of the cell
    colors: I8 = field(default_factory=lambda: _none(0, 3))  # (N, 3), k0, k1 and k2
    shapes: I8 = field(default_factory=lambda: _none(0, 3))  # (N, 3), the codes of size, aspect and shear
    places: I8 = field(default_factory=lambda: _none(0, 2))  # (N, 2), the place in the cell

    def __len__(self) -> int:
        return len(self.cells)

    def __eq__(self, other: object) -> bool:
        """Equality of all codes."""
        return isinstance(other, IntraCodes) and all(
            np.array_equal(getattr(self, part.name), getattr(other, part.name)) for part in fields(self)
        )

    __hash__ = None  # type: ignore[assignment]

    @property
    def arrays(self) -> CodeArrays:
        """All codes."""
        return CodeArrays(self.cells, self.colors, self.shapes, self.places)

    @classmethod
    def joined(cls, parts: Sequence["IntraCodes"]) -> "IntraCodes":
        """The codes of several parts, at least one, in their order."""
        return cls(*(np.concatenate(arrays) for arrays in zip(*(part.arrays for part in parts), strict=True)))

    def take(self, indices: I8) -> "IntraCodes":
        """The codes of some splats, in another order."""
        return IntraCodes(self.cells[indices], self.colors[indices], self.shapes[indices], self.places[indices])


@dataclass(frozen=True, eq=False)
class MainCodes:
    """The codes of a frame."""

    type: FrameType = field(kw_only=True)  # an R-frame has no other code
    quantizer: int = 0  # 0..79, which gives D
    quantizer_present: bool = True  # False: a P-frame of the quantizer of the last I- or P-frame does not say it again
    lane_exponent: int = 0  # binary logarithm of the number of lanes
    densities: Densities | None = None  # None: those that are kept
    new: IntraCodes = field(default_factory=IntraCodes)  # all splats of an I-frame
    motion_cell: int = 0  # 0 no field, else 1, 2, 3: cells of 64, 32 or 16 pixels
    vectors: I8 = field(default_factory=lambda: _none(0, 0, 2))  # (rows, columns, 2), in quarter pixels
    # (N,), of the splats before: bits 0 to 2 for differences of position, shape and colour, or REMOVED
    modes: I8 = field(default_factory=lambda: _none(0))
    differences: I8 = field(default_factory=lambda: _none(0, 8))  # (N, 8), q

    @classmethod
    def repeated_frame(cls) -> "MainCodes":
        """An R-frame: the splats of the frame before."""
        return cls(type="R")

    @property
    def field(self) -> Field:
        """Its motion field."""
        return Field(self.vectors, SIDES[self.motion_cell])

    @property
    def intra_count(self) -> int:
        """The splats of an I-frame, the new ones of a P-frame."""
        return len(self.new)

    @property
    def survivor_count(self) -> int:
        """The number of splats that stay; 0 unless this is a P-frame."""
        return int(np.count_nonzero(self.modes != REMOVED))

    @property
    def origins(self) -> I8 | None:
        """For each splat of a P-frame the index of the one before that it continues, or -1, (N,) i8; else None."""
        if self.type != "P":
            return None
        return np.concatenate([np.flatnonzero(self.modes != REMOVED), np.full(len(self.new), -1)])

    def __eq__(self, other: object) -> bool:
        """Equality of all codes."""
        if not isinstance(other, MainCodes):
            return False
        pairs = [(getattr(self, part.name), getattr(other, part.name)) for part in fields(self)]
        return all(np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b for a, b in pairs)

    __hash__ = None  # type: ignore[assignment]


GROUPS: Final = (("position", 0, 2), ("shape", 2, 5), ("color", 5, 8))
"""The groups of differences: name, first component, and the one after the last; bit i of a mode is that of group i."""

GROUP_ENDS: Final = (0, *(end for _, _, end in GROUPS))
"""The first component of each group, and the number of components."""


def modes_of(differences: I8, removed: I8 | NDArray[np.bool_]) -> I8:
    """The mode of each splat (N,) from its differences (N, 8) and whether it is removed (N,)."""
    modes = sum(
        (differences[:, first:end] != 0).any(axis=1).astype(np.int64) << bit
        for bit, (_, first, end) in enumerate(GROUPS)
    )
    return np.where(removed.astype(bool), REMOVED, modes)
