"""LSQ+ and residual vector quantisation (sections 10.5 and 10.6); autograd finds every gradient."""

from typing import Final

import torch
from torch import Tensor

from gsvc_conformance.adapters.pytorch.device import Array, Arrays, array, tensor

MAX_DISTANCES: Final = 2**22
"""(vector, codeword) pairs at once."""


def lsq_ratio(x: Tensor, scale: Tensor, offset: Tensor) -> Tensor:
    """(10-15)."""
    difference = x - offset
    return difference / scale


def lsq_quantize(x: Array, scale: Array, offset: Array, bits: int) -> Arrays:
    """Operation: (10-16); torch.round rounds half to even."""
    t = lsq_ratio(tensor(x), tensor(scale), tensor(offset))
    return {"codes": array(torch.round(t.clamp(0, 2**bits - 1)), "u2")}


def fake_quantized(x: Tensor, scale: Tensor, offset: Tensor, bits: int) -> Tensor:
    """A tensor for training: x̂ of (10-17) up to rounding, with the straight-through gradients (10-18).

    Where 0 ≤ t ≤ p it is x + (q - t) s with q - t held fixed, elsewhere q s + β with the fixed code of that end.
    With q s + β everywhere and q straight through t, autograd would sum q and t apart for the derivative by s, and
    lose digits of their difference, which is at most 1/2.
    """
    largest = 2**bits - 1
    t = lsq_ratio(x, scale, offset).detach()
    q = torch.round(t.clamp(0, largest))
    inside = (t >= 0) & (t <= largest)
    return torch.where(inside, x + torch.where(inside, q - t, 0.0) * scale, q * scale + offset)


def lsq_gradients(x: Array, scale: Array, offset: Array, bits: int, grad_output: Array) -> Arrays:
    """Operation: (10-19)."""
    given, s, beta = (tensor(array_of).requires_grad_() for array_of in (x, scale, offset))
    values = fake_quantized(given, s, beta, bits)
    gradients = torch.autograd.grad(values, (given, s, beta), tensor(grad_output))
    names = ("grad_x", "grad_scale", "grad_offset")
    return {name: array(gradient, "f4") for name, gradient in zip(names, gradients, strict=True)}


def rvq_assign(x: Array, codebook_sizes: Array, codebooks: Array) -> Arrays:
    """Operation: (10-20); argmin gives the first of equal distances. torch.cdist would not: it expands the square."""
    r, indices = tensor(x), []
    for book in torch.split(tensor(codebooks), codebook_sizes.tolist()):
        rows = max(1, MAX_DISTANCES // len(book))
        chosen = torch.cat([_distances(part, book).argmin(1) for part in torch.split(r, rows)])
        indices.append(chosen)
        r = r - book[chosen]
    return {"indices": array(torch.stack(indices, 1), "u2")}


def _distances(r: Tensor, book: Tensor) -> Tensor:
    """fl(fl(e0² + e1²) + e2²) of every vector and codeword, (N, B)."""
    squares = (r[:, None] - book) ** 2
    return (squares[:, :, 0] + squares[:, :, 1]) + squares[:, :, 2]


def residuals(x: Tensor, indices: Tensor, books: tuple[Tensor, ...]) -> list[Tensor]:
    """r¹ to r^(M+1) of (10-20)."""
    r = [x]
    for k, book in enumerate(books):
        r.append(r[k] - book[indices[:, k]])
    return r


def commitment(x: Array, indices: Array, codebook_sizes: Array, codebooks: Array) -> Arrays:
    """Operation: (10-21)."""
    vectors = tensor(x).requires_grad_()
    r = residuals(vectors, tensor(indices), torch.split(tensor(codebooks), codebook_sizes.tolist()))
    loss = torch.stack([(left * left).sum() for left in r[1:]]).sum() / max(3 * len(x), 1)
    (gradient,) = torch.autograd.grad(loss, vectors)
    return {"loss": loss.item(), "grad_x": array(gradient, "f4")}


def rvq_update(
    x: Array,
    indices: Array,
    codebook_sizes: Array,
    codebooks: Array,
    counts: Array,
    sums: Array,
    uniforms: Array,
    decay: float,
    smoothing: float,
    dead_count: float,
) -> Arrays:
    """Operation: (10-22) to (10-24), in binary64; nothing changes without vectors."""
    if not len(x):
        return {"counts": counts, "sums": sums, "codebooks": codebooks}
    sizes, chosen, numbers = codebook_sizes.tolist(), tensor(indices), tensor(uniforms)
    books, old_counts, old_sums = (torch.split(tensor(given), sizes) for given in (codebooks, counts, sums))
    r = [part.double() for part in residuals(tensor(x), chosen, books)]
    new: list[tuple[Tensor, Tensor, Tensor]] = []
    for k, (book, n, S) in enumerate(zip(books, old_counts, old_sums, strict=True)):
        n = decay * n + (1 - decay) * torch.bincount(chosen[:, k], minlength=len(book))
        used = torch.zeros_like(S).index_put((chosen[:, k],), r[k], accumulate=True)
        S = decay * S + (1 - decay) * used  # (10-22)
        smoothed = (n + smoothing) / (n.sum() + len(book) * smoothing) * n.sum()
        moved = torch.where((smoothed > 0)[:, None], S / smoothed[:, None], book.double())  # (10-23)
        taken = _revive(moved, n, S, r[k], r[k + 1], numbers, dead_count)
        numbers = numbers[taken:]
        new.append((n, S, moved))
    n, S, moved = (torch.cat(parts) for parts in zip(*new, strict=True))
    return {"counts": array(n, "f8"), "sums": array(S, "f8"), "codebooks": array(_rounded_to_half(moved), "f4")}


def _revive(book: Tensor, n: Tensor, S: Tensor, r: Tensor, left: Tensor, uniforms: Tensor, dead_count: float) -> int:
    """Put vectors that are badly met into the place of dead codewords (10-24); how many uniform numbers that took."""
    E = torch.cumsum((left * left).sum(1), 0)
    dead = (n < dead_count).nonzero()[:, 0]
    if E[-1] == 0:
        return 0
    drawn = torch.searchsorted(E, uniforms[: len(dead)] * E[-1], right=True).clamp(max=len(r) - 1)
    book[dead], S[dead], n[dead] = r[drawn], r[drawn], 1.0
    return len(dead)


def _rounded_to_half(values: Tensor) -> Tensor:
    """The nearest binary16 numbers of binary64 numbers that were rounded to binary32, which the bounds allow.

    PyTorch goes that way even if it is not told to.
    """
    return values.float().half().float()
