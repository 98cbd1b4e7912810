"""Codes to splats, exactly: binary32 operations in the order of spec.md section 8 (R-3.3-2), none fused (R-3.3-1)."""

from dataclasses import dataclass, replace
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F4, I8, U2
from gsvc_base.checks import door
from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.splats import Splats
from gsvc_ref._jit import kernel
from gsvc_ref.paper import lsq, rvq
from gsvc_ref.paper.codes import NO_QUANTIZER, BlockKind, Codebooks, FrameCodes, Quantizer, SplatBlock
from gsvc_ref.paper.half import from_half

Columns = tuple[F4, F4, F4]
"""Positions (N, 2), Cholesky factors (N, 3) and colours (N, 3) of splats."""


class Codes(NamedTuple):
    """The codes of a block, with the quantiser and the codebooks that it uses; no rows of what is not present."""

    positions: U2  # (n, 2) patterns of binary16
    cholesky: U2  # (n, 3)
    scale: F4  # (3,) pixels
    offset: F4  # (3,) pixels
    color_indices: U2  # (n, M)
    codebook_sizes: I8  # (M,)
    codewords: U2  # (K, 3) patterns of binary16, stage after stage


DTYPES: Final = (np.uint16, np.uint16, np.float32, np.float32, np.uint16, np.int64, np.uint16)
"""Those of `Codes`, in its order."""

_NO_PAIRS: Final[U2] = np.empty((0, 2), np.uint16)
_NO_TRIPLES: Final[U2] = np.empty((0, 3), np.uint16)

VALUES_OF_HALVES: Final[F4] = from_half(np.arange(1 << 16, dtype=np.uint16))
"""The exact value of each binary16 pattern, (65536,) f4."""


@dataclass(frozen=True)
class Kept:
    """The quantiser and the codebooks that a block without its own uses (spec.md section 6.5); None: there are none."""

    quantizer: Quantizer | None = None
    codebooks: Codebooks | None = None

    def after(self, block: SplatBlock | None) -> "Kept":
        """The quantiser and codebooks that are kept after a block."""
        if block is None:
            return self
        return Kept(
            self.quantizer if block.quantizer is None else block.quantizer,
            self.codebooks if block.codebooks is None else block.codebooks,
        )


@dataclass(frozen=True)
class State:
    """All that a decoder carries from frame to frame; the encoder's closed loop carries the same."""

    width: int
    height: int
    splats: Splats  # reconstructed, of the frame before
    intra: Kept = Kept()  # for intra blocks
    inter: Kept = Kept()  # for inter blocks

    @classmethod
    def initial(cls, width: int, height: int) -> Self:
        """The state before the first frame of a sequence of `width` by `height` pixels."""
        return cls(width, height, Splats.empty())

    def forget(self) -> "State":
        """The state in which an I-frame is parsed: no splats, nothing kept (R-6.5-9)."""
        return State(self.width, self.height, Splats.empty())

    def kept(self, kind: BlockKind) -> Kept:
        """The quantiser and codebooks that are kept for blocks of a kind (R-6.5-8)."""
        return self.intra if kind == "intra" else self.inter


def reconstruct(codes: FrameCodes, state: State) -> State:
    """Decode one frame's codes: the state after the frame, whose `splats` are the frame's splats.

    A parameter that is not finite raises a GsvcError ``invalid`` (R-8-1). Codes that do not fit the state or themselves
    raise a UsageError; those that a reader has read always fit.
    """
    if codes.survivors is not None and len(codes.survivors) != len(state.splats):
        raise UsageError(f"survivors are {len(codes.survivors)} splats; the frame before has {len(state.splats)}")
    if codes.type == "R":  # R-6.4-4
        return state
    before = state.forget() if codes.type == "I" else state
    kept_inter, kept_intra = before.inter.after(codes.inter), before.intra.after(codes.intra)
    width, height = state.width, state.height
    parts = _columns(before.splats)
    if codes.survivors is not None:
        parts = _inter(width, height, before.splats, codes.survivors, _codes(codes.inter, kept_inter))
    if codes.intra is not None:
        if codes.intra.positions is None or codes.intra.cholesky is None or codes.intra.colors is None:
            raise UsageError("an intra block needs positions, cholesky and colors (R-6.5-2)")
        mu, L, c = _intra(width, height, _codes(codes.intra, kept_intra))
        parts = np.concatenate([parts[0], mu]), np.concatenate([parts[1], L]), np.concatenate([parts[2], c])
    return replace(before, splats=_finite(parts), inter=kept_inter, intra=kept_intra)


# twin of spec.reconstruct_intra
@door
def reconstruct_intra(
    width: int,
    height: int,
    positions: ArrayLike,
    cholesky: ArrayLike,
    scale: ArrayLike,
    offset: ArrayLike,
    color_indices: ArrayLike,
    codebook_sizes: ArrayLike,
    codewords: ArrayLike,
) -> Splats:
    """The splats that the codes of an intra block stand for, by the intra column of section 8.

    Parameters
    ----------
    width, height
        Size of the frame in pixels.
    positions
        (N, 2) u2, patterns of binary16.
    cholesky
        (N, 3) u2, codes of l11, l21, l22.
    scale, offset
        (3,) f4 each, the quantiser of the Cholesky factors in pixels.
    color_indices
        (N, M) u2, the index of the codeword of each stage.
    codebook_sizes
        (M,) i8, the number of codewords of each stage.
    codewords
        (K, 3) u2, the codewords stage after stage, patterns of binary16.

    Returns
    -------
    Splats
        N splats, bit for bit those of every decoder.

    Raises
    ------
    GsvcError
        ``invalid``, R-8-1: a parameter is not finite.
    UsageError
        The indices do not fit the codebooks.
    """
    codes = _arrays(positions, cholesky, scale, offset, color_indices, codebook_sizes, codewords)
    return _finite(_intra(width, height, codes))


# twin of spec.reconstruct_inter
@door
def reconstruct_inter(
    width: int,
    height: int,
    reference: Splats | ArrayLike,
    survivors: ArrayLike,
    positions: ArrayLike,
    cholesky: ArrayLike,
    scale: ArrayLike,
    offset: ArrayLike,
    color_indices: ArrayLike,
    codebook_sizes: ArrayLike,
    codewords: ArrayLike,
) -> Splats:
    """The survivors of a frame after the differences of an inter block, by the inter column of section 8.

    Parameters
    ----------
    width, height
        Size of the frame in pixels.
    reference
        The N splats of the frame before, or their parameters (N, 8) f4.
    survivors
        (N,) u1 or bool, whether each of them stays (R-6.4-5); n of them do.
    positions, cholesky, color_indices
        (n, 2), (n, 3) and (n, M) u2 as for `reconstruct_intra`; none in place of n where an attribute is not present,
        whose bits stay (R-6.5-10).
    scale, offset, codebook_sizes, codewords
        As for `reconstruct_intra`.

    Returns
    -------
    Splats
        n splats, bit for bit those of every decoder.

    Raises
    ------
    GsvcError
        ``invalid``, R-8-1: a parameter is not finite.
    UsageError
        The indices do not fit the codebooks.
    """
    codes = _arrays(positions, cholesky, scale, offset, color_indices, codebook_sizes, codewords)
    return _finite(_inter(width, height, Splats.of(reference), np.asarray(survivors, np.bool_), codes))


def _arrays(*given: ArrayLike) -> Codes:
    """The arguments of an operation, in the order of `Codes`, as its arrays."""
    return Codes(*(np.ascontiguousarray(array, dtype) for array, dtype in zip(given, DTYPES, strict=True)))


def _codes(block: SplatBlock | None, kept: Kept) -> Codes:
    """The codes of a block of a frame, or of none."""
    block = block or SplatBlock()
    quantizer, codebooks = kept.quantizer or NO_QUANTIZER, kept.codebooks or ()
    if block.cholesky is not None and kept.quantizer is None:
        raise UsageError("a block has no quantizer, and none is kept since the last I-frame (R-6.5-4)")
    if block.colors is not None and kept.codebooks is None:
        raise UsageError("a block has no codebooks, and none are kept since the last I-frame (R-6.5-4)")
    return Codes(
        _NO_PAIRS if block.positions is None else block.positions,
        _NO_TRIPLES if block.cholesky is None else block.cholesky,
        quantizer.scale,
        quantizer.offset,
        _NO_PAIRS if block.colors is None else block.colors,
        np.array([len(book) for book in codebooks], np.int64),
        np.concatenate([_NO_TRIPLES, *(book.view(np.uint16) for book in codebooks)]),
    )


def _intra(width: int, height: int, codes: Codes) -> Columns:
    """The intra column of section 8 (R-8-2)."""
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        mu = _scaled_halves(codes.positions, np.float32(1), width, height)  # (8-1), (8-2)
        L = _dequantized(codes)  # (8-3)
        c = _summed(codes)  # (8-4)
    return mu, L, c


def _inter(width: int, height: int, reference: Splats, survivors: NDArray[np.bool_], codes: Codes) -> Columns:
    """The inter column of section 8 (R-8-2): survivors (R-6.4-5) with the bits of what is not present (R-6.5-10)."""
    mu, L, c = _columns(reference if survivors.all() else reference.take(survivors))
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        if len(codes.positions):
            # Adding -0 changes nothing, not even the sign of a zero.
            mu = mu + _scaled_halves(codes.positions, np.float32(-0.0), width, height)  # (8-1), (8-2)
        if len(codes.cholesky):
            L = L + _dequantized(codes)  # (8-3)
        if len(codes.color_indices):
            c = c + _summed(codes)  # (8-4)
    return mu, L, c


def _columns(splats: Splats) -> Columns:
    return splats.positions, splats.cholesky, splats.colors


def _finite(parts: Columns) -> Splats:
    """The splats of positions, Cholesky factors and colours that are finite (R-8-1)."""
    for name, part in zip(("position", "Cholesky factor", "colour"), parts, strict=True):
        if not np.isfinite(part).all():
            bad = int(np.argwhere(~np.isfinite(part))[0, 0])
            raise GsvcError("invalid", f"the {name} of splat {bad} is not finite after reconstruction", rule="R-8-1")
    return Splats(*parts)


def _dequantized(codes: Codes) -> F4:
    values = np.empty(codes.cholesky.shape, np.float32)  # (count, 3) f4
    lsq.dequantize_kernel(codes.cholesky, codes.scale, codes.offset, values)
    return values


def _summed(codes: Codes) -> F4:
    indices, sizes = codes.color_indices, codes.codebook_sizes
    if indices.shape[1] != len(sizes) or len(sizes) == 0:
        raise UsageError(f"colors have indices for {indices.shape[1]} stages; there are {len(sizes)} codebooks")
    for stage, size in enumerate(sizes.tolist()):
        if len(indices) and indices[:, stage].max() >= size:
            raise UsageError(f"a color index of stage {stage + 1} is not below {size} (R-6.6-2)")
    return rvq.codeword_sum(indices, sizes, from_half(codes.codewords))


def _scaled_halves(bits: U2, addend: np.float32, width: int, height: int) -> F4:
    """fl(fl(h + addend) * half the size of the frame), h the values of binary16 patterns (count, 2)."""
    half_size = np.array([width, height], np.float32) / np.float32(2)  # (2,) f4, exact
    values = np.empty(bits.shape, np.float32)  # (count, 2) f4
    _scaled_halves_kernel(bits, VALUES_OF_HALVES, addend, half_size, values)
    return values


@kernel()
def _scaled_halves_kernel(bits: U2, values_of_halves: F4, addend: np.float32, half_size: F4, values: F4) -> None:
    for n in range(len(bits)):
        for c in range(2):
            # Two binary32 roundings, addition first: see `_scaled_halves`.
            values[n, c] = (values_of_halves[bits[n, c]] + addend) * half_size[c]
