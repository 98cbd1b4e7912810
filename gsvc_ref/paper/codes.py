"""The codes, quantisers and codebooks of a frame, before arithmetic (spec.md sections 6.4 and 6.5)."""

from dataclasses import dataclass
from typing import Any, Final, Literal, Self

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F2, F4, U2
from gsvc_base.errors import UsageError

FrameType = Literal["I", "P", "R"]
BlockKind = Literal["intra", "inter"]
Codebooks = tuple[F2, ...]
"""A codebook per stage of the residual vector quantiser, each (codewords, 3) f2 with columns R, G, B."""

FRAME_TYPES: Final[tuple[FrameType, ...]] = ("I", "P", "R")


def same_array(a: NDArray[Any] | None, b: NDArray[Any] | None) -> bool:
    """Whether two arrays are both missing or have the same shape, type and bits (so -0 differs from +0)."""
    if a is None or b is None:
        return a is b
    return a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()


def _checked(value: object, name: str, dtype: type[np.generic], columns: int | None) -> NDArray[Any]:
    array = np.asarray(value)
    if array.ndim != 2 or (columns is not None and array.shape[1] != columns):
        raise UsageError(f"{name} has shape {array.shape}; it must be (count, {columns or 'stages'})")
    if array.dtype != dtype:
        raise UsageError(f"{name} has type {array.dtype}; it must be {np.dtype(dtype)}")
    return np.ascontiguousarray(array)


@dataclass(frozen=True, eq=False)
class Quantizer:
    """Scale and offset of the three Cholesky channels l11, l21, l22: a code q stands for q·scale + offset."""

    scale: F4  # (3,) pixels, positive normal numbers
    offset: F4  # (3,) pixels

    def __post_init__(self) -> None:
        for name in ("scale", "offset"):
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float32)
            if array.shape != (3,):
                raise UsageError(f"Quantizer.{name} has shape {array.shape}; it must be (3,): l11, l21, l22")
            object.__setattr__(self, name, array)

    def __eq__(self, other: object) -> bool:
        """Bit-equality."""
        return (
            isinstance(other, Quantizer)
            and same_array(self.scale, other.scale)
            and same_array(self.offset, other.offset)
        )

    __hash__ = None  # type: ignore[assignment]


NO_QUANTIZER: Final = Quantizer(np.zeros(3, np.float32), np.zeros(3, np.float32))
"""What stands where a block brings none."""


@dataclass(frozen=True, eq=False)
class SplatBlock:
    """The codes of `count` splats, values (intra) or differences (inter); None stands for "not present"."""

    positions: U2 | None = None  # (count, 2) binary16 patterns of x, y normalised to -1..1, or of their differences
    cholesky: U2 | None = None  # (count, 3) codes of l11, l21, l22, each below 2^`cholesky_bits`
    colors: U2 | None = None  # (count, stages) `color_index` of each stage
    quantizer: Quantizer | None = None  # None: the kept one
    codebooks: Codebooks | None = None  # None: the kept ones

    def __post_init__(self) -> None:
        for name, columns in (("positions", 2), ("cholesky", 3), ("colors", None)):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _checked(value, f"SplatBlock.{name}", np.uint16, columns))
        if self.codebooks is not None:
            books = tuple(_checked(book, "a codebook", np.float16, 3) for book in self.codebooks)
            object.__setattr__(self, "codebooks", books)
        counts = {len(part) for part in (self.positions, self.cholesky, self.colors) if part is not None}
        if len(counts) > 1:
            raise UsageError(f"the attributes of a block are of {sorted(counts)} splats; the counts must be equal")

    @property
    def count(self) -> int | None:
        """The number of splats, or None if no attribute is present."""
        for part in (self.positions, self.cholesky, self.colors):
            if part is not None:
                return len(part)
        return None

    def __eq__(self, other: object) -> bool:
        """Bit-equality of everything."""
        if not isinstance(other, SplatBlock) or (self.codebooks is None) != (other.codebooks is None):
            return False
        mine, theirs = self.codebooks or (), other.codebooks or ()
        return (
            same_array(self.positions, other.positions)
            and same_array(self.cholesky, other.cholesky)
            and same_array(self.colors, other.colors)
            and self.quantizer == other.quantizer
            and len(mine) == len(theirs)
            and all(same_array(a, b) for a, b in zip(mine, theirs, strict=True))
        )

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True, eq=False)
class FrameCodes:
    """All codes of one frame; build it with `intra_frame`, `predicted_frame` or `repeated_frame`."""

    type: FrameType
    survivors: NDArray[np.bool_] | None = None  # (reference_count,) which splats stay; P-frames only
    inter: SplatBlock | None = None  # differences of the survivors, in their order; None without survivors
    intra: SplatBlock | None = None  # the splats of an I-frame, the new ones of a P-frame; None without

    def __post_init__(self) -> None:
        if self.type not in FRAME_TYPES:
            raise UsageError(f"the frame type is {self.type!r}; it must be one of {', '.join(FRAME_TYPES)}")
        if (self.type == "P") != (self.survivors is not None):
            raise UsageError("survivors belong to P-frames, and every P-frame needs them")
        if (self.inter is not None and self.type != "P") or (self.intra is not None and self.type == "R"):
            raise UsageError("an I-frame has an intra block only, an R-frame has none")
        if self.intra is not None and self.intra.count is None:
            raise UsageError("an intra block needs positions, cholesky and colors")
        if self.survivors is not None:
            survivors = np.ascontiguousarray(self.survivors)
            if survivors.ndim != 1 or survivors.dtype != np.bool_:
                raise UsageError(
                    f"survivors are {survivors.dtype} of shape {survivors.shape}; they must be bool of shape (count,)"
                )
            object.__setattr__(self, "survivors", survivors)
            stay = int(np.count_nonzero(survivors))
            described = 0 if self.inter is None else self.inter.count
            if (self.inter is None) != (stay == 0) or described not in (None, stay):
                raise UsageError(f"{stay} splats survive; the inter block describes {described}")

    @classmethod
    def intra_frame(cls, block: SplatBlock | None) -> Self:
        """An I-frame: the splats of a block, or none."""
        return cls("I", intra=block if block is None or block.count else None)

    @classmethod
    def predicted_frame(
        cls, survivors: NDArray[np.bool_], inter: SplatBlock | None, intra: SplatBlock | None = None
    ) -> Self:
        """A P-frame: which splats stay, their differences, and the new splats."""
        return cls("P", survivors, inter, intra if intra is None or intra.count else None)

    @classmethod
    def repeated_frame(cls) -> Self:
        """An R-frame: the splats of the frame before."""
        return cls("R")

    @property
    def survivor_count(self) -> int:
        """The number of splats that stay; 0 unless this is a P-frame."""
        return 0 if self.survivors is None else int(np.count_nonzero(self.survivors))

    @property
    def origins(self) -> NDArray[np.int64] | None:
        """For each splat of a P-frame the index of the one before that it continues, or -1, (N,) i8; else None."""
        if self.survivors is None:
            return None
        return np.concatenate([np.flatnonzero(self.survivors), np.full(self.intra_count, -1)])

    @property
    def intra_count(self) -> int:
        """`splat_count` of an I-frame, `new_splat_count` of a P-frame."""
        return (self.intra.count or 0) if self.intra is not None else 0

    def __eq__(self, other: object) -> bool:
        """Bit-equality of everything."""
        return (
            isinstance(other, FrameCodes)
            and self.type == other.type
            and same_array(self.survivors, other.survivors)
            and self.inter == other.inter
            and self.intra == other.intra
        )

    __hash__ = None  # type: ignore[assignment]
