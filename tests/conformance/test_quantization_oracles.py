"""The oracles of quantisation: against automatic differentiation, what their bounds let by, and what they do not.

Legal variants in binary32 lie inside the bounds of every case, small bugs outside those of at least one.
"""

import numpy as np
import pytest
from oracle_checks import assert_legal, in_blocks, judged

from gsvc_conformance.operations.codebooks import books_of
from gsvc_conformance.operations.quantization import commitment_oracle, lsq_gradients_oracle, rvq_assign_oracle

F4 = np.float32


def test_lsq_gradients_are_those_of_a_straight_through_rounding():
    rng = np.random.default_rng(3)
    torch = pytest.importorskip("torch", reason="PyTorch is the peer that differentiates LSQ+")
    x = rng.uniform(-3, 12, (50, 3)).astype(np.float32)
    grad = rng.normal(size=(50, 3)).astype(np.float32)
    scale, offset = np.array([0.13, 0.21, 0.47], F4), np.array([-0.3, 0.7, 0.1], F4)
    t_x, t_scale, t_offset = (
        torch.tensor(a, dtype=torch.float64, requires_grad=True) for a in (x, scale, offset)
    )  # fmt: skip
    clamped = ((t_x - t_offset) / t_scale).clamp(0, 15)
    code = clamped + (clamped.round() - clamped).detach()
    (torch.tensor(grad) * (code * t_scale + t_offset)).sum().backward()
    expected = lsq_gradients_oracle(x, scale, offset, 4, grad)
    for name, leaf in (("grad_x", t_x), ("grad_scale", t_scale), ("grad_offset", t_offset)):
        np.testing.assert_allclose(expected[name].value, leaf.grad, rtol=1e-9, atol=1e-9)


def test_the_gradient_of_the_commitment_stops_at_codewords():
    rng = np.random.default_rng(3)
    torch = pytest.importorskip("torch", reason="PyTorch is the peer that differentiates the commitment loss")
    sizes, books = np.array([4, 3]), rng.normal(size=(7, 3)).astype(np.float16).astype(np.float32)
    x, indices = rng.normal(size=(9, 3)).astype(np.float32), rng.integers(0, 3, (9, 2)).astype(np.uint16)
    leaf = torch.tensor(x, dtype=torch.float64, requires_grad=True)
    left, loss = leaf, 0
    for k, book in enumerate(books_of(sizes, books)):
        left = left - torch.tensor(book[indices[:, k]])
        loss = loss + (left**2).mean()
    loss.backward()
    expected = commitment_oracle(x, indices, sizes, books)
    np.testing.assert_allclose(expected["loss"].value, loss.item(), rtol=1e-12)
    np.testing.assert_allclose(expected["grad_x"].value, leaf.grad, rtol=1e-9, atol=1e-12)


def lsq_codes(x, scale, offset, bits, *, reciprocal):
    t = (x - offset) * (F4(1) / scale) if reciprocal else (x - offset) / scale
    return {"codes": np.rint(np.clip(t, F4(0), F4(2**bits - 1))).astype(np.uint16)}


@pytest.mark.parametrize("reciprocal", [False, True])
def test_codes_by_quotient_or_reciprocal_are_legal(reciprocal):
    assert_legal("lsq_quantize", lambda **v: lsq_codes(**v, reciprocal=reciprocal))


def test_inputs_of_open_decisions_are_refused():
    scale, offset = np.array([0.1], F4), np.zeros(1, F4)
    with pytest.raises(ValueError, match="tie"):
        lsq_gradients_oracle(np.array([[0.05]], F4), scale, offset, 4, np.ones((1, 1), F4))
    x, books = np.array([[0.15, 0.1, 0.3]], F4), np.array([[0.1, 0.1, 0.3], [0.2, 0.1, 0.3]], F4)
    with pytest.raises(ValueError, match="border"):
        rvq_assign_oracle(x, np.array([2]), books)


def lsq_gradients_in_binary32(x, scale, offset, bits, grad_output, *, backwards):
    p = F4(2**bits - 1)
    t = (x - offset) * (F4(1) / scale)
    inside = (t >= 0) & (t <= p)
    of_scale = np.where(inside, np.rint(t) - t, np.where(t > p, p, F4(0))) * grad_output
    of_offset = np.where(inside, F4(0), grad_output)
    order = slice(None, None, -1 if backwards else 1)
    sums = [
        np.array([in_blocks(column[order]) for column in terms.T], F4) for terms in (of_scale, of_offset)
    ]  # fmt: skip
    return {"grad_x": np.where(inside, grad_output, F4(0)), "grad_scale": sums[0], "grad_offset": sums[1]}


@pytest.mark.parametrize("backwards", [False, True])
def test_lsq_gradients_in_any_order_are_legal(backwards):
    assert_legal("lsq_gradients", lambda **v: lsq_gradients_in_binary32(**v, backwards=backwards))


def nearest_by_products(x, codebook_sizes, codebooks):
    """Distances as |c|^2 - 2 r . c, as matrix products give them: more error, but the margins of random cases do."""
    r, columns = x, []
    for book in books_of(codebook_sizes, codebooks):
        best = (np.sum(book * book, axis=1) - 2 * (r @ book.T)).argmin(axis=1)
        columns.append(best)
        r = r - book[best]
    return {"indices": np.stack(columns, axis=1).astype(np.uint16)}


def test_distances_as_products_fail_far_from_zero():
    assert any("indices" in wrong for wrong in judged("rvq_assign", nearest_by_products, ("core",)).values())


def test_nearest_codewords_have_wide_margins():
    found = judged("rvq_assign", nearest_by_products)
    assert not any(wrong for name, wrong in found.items() if "nearest_codewords" in name)


def update_in_binary32(
    x, indices, codebook_sizes, codebooks, counts, sums, uniforms, decay, smoothing, dead_count, *, factor=1.0
):
    """A whole update in binary32 arrays, with sums in descending order of splats."""
    if len(x) == 0:
        return {"counts": counts, "sums": sums, "codebooks": codebooks}
    a, rest, e, first, taken = F4(decay), F4(1 - decay), F4(smoothing), 0, 0
    out_counts, out_sums, out_books = counts.astype(F4), sums.astype(F4), codebooks.copy()
    r = x
    for k, book in enumerate(books_of(codebook_sizes, codebooks)):
        left = r - book[indices[:, k]]
        stage = slice(first, first + len(book))
        c, s, words = out_counts[stage], out_sums[stage], out_books[stage]
        for b in range(len(book)):
            users = r[indices[:, k] == b][::-1]
            c[b] = a * c[b] + rest * F4(len(users))
            batch = np.add.accumulate(users, axis=0, dtype=F4)[-1] if len(users) else np.zeros(3, F4)
            s[b] = a * s[b] + rest * batch
        total = in_blocks(c)
        smoothed = (c + e) * (total / (total + F4(len(book)) * e)) * F4(factor)
        words[:] = np.where(smoothed[:, None] > 0, s / smoothed[:, None], words)
        reach = np.add.accumulate((left * left).sum(axis=1), dtype=F4)
        for b in np.flatnonzero(c < dead_count):
            if reach[-1] > 0:
                vector = r[np.argmax(reach > F4(uniforms[taken]) * reach[-1])]
                c[b], s[b], words[b] = 1, vector, vector
                taken += 1
        first += len(book)
        r = left
    rounded = out_books.astype(np.float16).astype(F4)
    return {"counts": out_counts.astype(np.float64), "sums": out_sums.astype(np.float64), "codebooks": rounded}


def test_codebook_updates_in_binary32_are_legal():
    assert_legal("rvq_update", update_in_binary32)


def test_codewords_that_are_off_by_one_part_in_a_thousand_are_found():
    found = judged("rvq_update", lambda **v: update_in_binary32(**v, factor=1.001))
    assert sum("codebooks" in wrong for wrong in found.values()) > 5


def commitment_in_binary32(x, indices, codebook_sizes, codebooks, *, joined, divided):
    """Residuals stage by stage, or of the sum of the codewords; divided after the sum, in stages, or term by term."""
    chosen = [book[indices[:, k]] for k, book in enumerate(books_of(codebook_sizes, codebooks))]
    left, so_far, errors = x, np.zeros_like(x), []
    for codewords in chosen:
        so_far = so_far + codewords
        left = left - codewords
        errors.append(x - so_far if joined else left)
    components = F4(max(3 * len(x), 1))
    if divided == "last":
        loss, gradient = in_blocks(np.square(errors)) / components, np.add.reduce(errors) * (F4(2) / components)
    else:
        gradient = np.add.reduce([F4(2) * e / components for e in errors])
        if divided == "first":
            loss = in_blocks(np.square(errors) / components)
        else:
            loss = in_blocks([in_blocks(np.square(e)) / components for e in errors])
    return {"loss": np.array(float(loss)), "grad_x": gradient.astype(F4)}


@pytest.mark.parametrize("joined", [False, True])
@pytest.mark.parametrize("divided", ["last", "between", "first"])
def test_commitments_in_any_order_are_legal(joined, divided):
    assert_legal("commitment", lambda **v: commitment_in_binary32(**v, joined=joined, divided=divided))
