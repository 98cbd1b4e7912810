"""Codes to splats, exactly: binary32 operations in the order of spec.md section 8 (R-3.3-2), none fused (R-3.3-1)."""

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.errors import GsvcError, UsageError
from gsvc_ref.quantization import from_half, lsq, rvq
from gsvc_ref.reconstruction.codes import F4, U2, BlockKind, Codebooks, FrameCodes, Quantizer, SplatBlock
from gsvc_ref.splats import Splats

VALUES_OF_HALVES: Final[F4] = from_half(np.arange(1 << 16, dtype=np.uint16))
"""The exact value of each binary16 pattern, (65536,) f4."""


@dataclass(frozen=True)
class Kept:
    """The quantiser and the codebooks that a block without its own uses (spec.md section 6.5); None: there are none."""

    quantizer: Quantizer | None = None
    codebooks: Codebooks | None = None

    def after(self, block: SplatBlock | None) -> "Kept":
        """What is kept once a block has been read."""
        if block is None:
            return self
        return Kept(
            self.quantizer if block.quantizer is None else block.quantizer,
            self.codebooks if block.codebooks is None else block.codebooks,
        )


@dataclass(frozen=True)
class State:
    """All that a decoder carries from frame to frame; the encoder's closed loop carries the same.

    Attributes
    ----------
    width, height
        Size of the coded frame in pixels.
    splats
        The reconstructed splats of the frame before.
    intra, inter
        What is kept for intra and for inter blocks.
    """

    width: int
    height: int
    splats: Splats
    intra: Kept = Kept()
    inter: Kept = Kept()

    @classmethod
    def initial(cls, width: int, height: int) -> Self:
        """The state before the first frame of a sequence of `width` by `height` pixels."""
        return cls(width, height, Splats.empty())

    def forget(self) -> "State":
        """The state in which an I-frame is parsed: no splats, nothing kept (R-6.5-9)."""
        return State(self.width, self.height, Splats.empty())

    def kept(self, kind: BlockKind) -> Kept:
        """What is kept for blocks of a kind (R-6.5-8)."""
        return self.intra if kind == "intra" else self.inter


def reconstruct(codes: FrameCodes, state: State) -> State:
    """Decode one frame's codes: the state after the frame, whose `splats` are the frame's splats.

    Parameters
    ----------
    codes
        The codes of the frame.
    state
        The state after the frame before; it is not changed.

    Raises
    ------
    GsvcError
        ``invalid``, R-8-1: a parameter is not finite.
    UsageError
        The codes do not fit the state or themselves, which those that a reader has read always do.
    """
    if codes.survivors is not None and len(codes.survivors) != len(state.splats):
        raise UsageError(f"survivors tell of {len(codes.survivors)} splats; the frame before has {len(state.splats)}")
    if codes.type == "R":  # R-6.4-4
        return state
    before = state.forget() if codes.type == "I" else state
    kept_inter, kept_intra = before.inter.after(codes.inter), before.intra.after(codes.intra)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        positions, cholesky, colors = _survivors(codes, before, kept_inter)
        if codes.intra is not None:
            new = _intra_values(codes.intra, before, kept_intra)
            positions = np.concatenate([positions, new[0]])
            cholesky = np.concatenate([cholesky, new[1]])
            colors = np.concatenate([colors, new[2]])
    for name, part in (("position", positions), ("Cholesky factor", cholesky), ("colour", colors)):
        if not np.isfinite(part).all():
            bad = int(np.argwhere(~np.isfinite(part))[0, 0])
            raise GsvcError("invalid", f"the {name} of splat {bad} is not finite after reconstruction", rule="R-8-1")
    return replace(before, splats=Splats(positions, cholesky, colors), inter=kept_inter, intra=kept_intra)


def _survivors(codes: FrameCodes, state: State, kept: Kept) -> tuple[F4, F4, F4]:
    """The inter column of section 8: survivors (R-6.4-5) with the bits of what is not present (R-6.5-10)."""
    reference = state.splats
    if codes.survivors is not None and not codes.survivors.all():
        reference = reference.take(np.flatnonzero(codes.survivors))
    positions, cholesky, colors = reference.positions, reference.cholesky, reference.colors
    block = codes.inter
    if block is None:
        return positions, cholesky, colors
    if block.positions is not None:
        # Adding -0 changes nothing, not even the sign of a zero.
        positions = positions + _scaled_halves(block.positions, np.float32(-0.0), state)  # (8-1), (8-2)
    if block.cholesky is not None:
        cholesky = cholesky + _dequantized(block.cholesky, kept.quantizer)  # (8-3)
    if block.colors is not None:
        colors = colors + _summed(block.colors, kept.codebooks)  # (8-4)
    return positions, cholesky, colors


def _intra_values(block: SplatBlock, state: State, kept: Kept) -> tuple[F4, F4, F4]:
    """The intra column of section 8."""
    if block.positions is None or block.cholesky is None or block.colors is None:
        raise UsageError("an intra block needs positions, cholesky and colors (R-6.5-2)")
    positions = _scaled_halves(block.positions, np.float32(1), state)  # (8-1), (8-2)
    return positions, _dequantized(block.cholesky, kept.quantizer), _summed(block.colors, kept.codebooks)


def _dequantized(codes: U2, quantizer: Quantizer | None) -> F4:
    if quantizer is None:
        raise UsageError("a block has no quantizer, and none is kept since the last I-frame (R-6.5-4)")
    values = np.empty(codes.shape, np.float32)  # (count, 3) f4
    lsq.dequantize_kernel(codes, quantizer.scale, quantizer.offset, values)
    return values


def _summed(indices: U2, codebooks: Codebooks | None) -> F4:
    if codebooks is None:
        raise UsageError("a block has no codebooks, and none are kept since the last I-frame (R-6.5-4)")
    if indices.shape[1] != len(codebooks) or not codebooks:
        raise UsageError(f"colors have indices for {indices.shape[1]} stages; there are {len(codebooks)} codebooks")
    for stage, book in enumerate(codebooks):
        if len(indices) and indices[:, stage].max() >= len(book):
            raise UsageError(f"a color index of stage {stage + 1} is not below {len(book)} (R-6.6-2)")
    return rvq.codeword_sum(indices, [book.astype(np.float32) for book in codebooks])


def _scaled_halves(bits: U2, addend: np.float32, state: State) -> F4:
    half_size = np.array([state.width, state.height], np.float32) / np.float32(2)  # (2,) f4, exact
    values = np.empty(bits.shape, np.float32)  # (count, 2) f4
    scaled_halves_kernel(bits, VALUES_OF_HALVES, addend, half_size, values)
    return values


def scaled_halves_plain(bits: U2, addend: np.float32, half_size: F4) -> F4:
    """fl(fl(h + addend) * half_size) with h the exact values of binary16 patterns (count, 2): (count, 2) f4."""
    return (from_half(bits) + addend) * half_size


@kernel()
def scaled_halves_kernel(bits: U2, values_of_halves: F4, addend: np.float32, half_size: F4, values: F4) -> None:
    """Twin of `scaled_halves_plain`, given the value of every pattern."""
    for n in range(len(bits)):
        for c in range(2):
            values[n, c] = (values_of_halves[bits[n, c]] + addend) * half_size[c]
