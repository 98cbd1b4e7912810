"""Descriptors of spec.md section 3.1: what is written is read, in bulk as one by one, and never past the end."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.golomb import golomb_sizes
from gsvc_ref.bitstream.plane_coding import best_golomb_order

UV_EXAMPLES = [(0, "00"), (127, "7f"), (128, "8001"), (16383, "ff7f"), (16384, "808001"), (2**32 - 1, "ffffffff0f")]
EG_EXAMPLES = [
    (0, 0, "1"),
    (1, 0, "010"),
    (2, 0, "011"),
    (3, 0, "00100"),
    (0, 2, "100"),
    (3, 2, "111"),
    (4, 2, "01000"),
    (65535, 0, "0" * 16 + "1" + "0" * 16),
]


def bits_of(writer: Writer) -> str:
    size = writer.position
    writer.align()
    return "".join(f"{byte:08b}" for byte in writer.getvalue())[:size]


def failure(read: object, *arguments: object) -> GsvcError:
    with pytest.raises(GsvcError) as caught:
        read(*arguments)  # type: ignore[operator]
    return caught.value


@given(st.lists(st.integers(0, 40).flatmap(lambda n: st.tuples(st.just(n), st.integers(0, 2**n - 1)))))
def test_u_round_trip(elements: list[tuple[int, int]]) -> None:
    writer = Writer()
    for size, value in elements:
        writer.u("e", size, value)
    assert bits_of(writer) == "".join(f"{value:0{size}b}" if size else "" for size, value in elements)
    reader = Reader(writer.getvalue())
    assert [(size, reader.u("e", size)) for size, _ in elements] == elements
    reader.align()
    assert reader.bits_left == 0


@given(st.lists(st.integers(0, 2**32 - 1)))
def test_uv_round_trip(values: list[int]) -> None:
    writer = Writer()
    for value in values:
        writer.uv("e", value)
    reader = Reader(writer.getvalue())
    assert [reader.uv("e") for _ in values] == values
    assert reader.bits_left == 0


@pytest.mark.parametrize(("value", "bytes_"), UV_EXAMPLES)
def test_uv_bytes(value: int, bytes_: str) -> None:
    writer = Writer()
    writer.uv("e", value)
    assert writer.getvalue().hex() == bytes_


@pytest.mark.parametrize(
    "bytes_", ["8000", "ff00", "ffff8000", "ffffffff10", "ffffffff7f", "ffffffffff01", "80808080ff"]
)
def test_uv_not_shortest_or_too_large(bytes_: str) -> None:
    reader = Reader(b"\0" + bytes.fromhex(bytes_), first_bit=800)
    reader.uv("first")
    error = failure(reader.uv, "e")
    assert (error.kind, error.rule, error.bit) == ("malformed", "R-3.1-1", 808)


@pytest.mark.parametrize(("value", "order", "bits"), EG_EXAMPLES)
def test_eg_bits(value: int, order: int, bits: str) -> None:
    writer = Writer()
    writer.eg("e", order, value)
    assert bits_of(writer) == bits
    assert golomb_sizes(np.array([value]), order).tolist() == [len(bits)]


GOLOMBS = st.tuples(st.integers(0, 15), st.lists(st.one_of(st.integers(0, 40), st.integers(0, 65535)), max_size=40))


@given(GOLOMBS, st.integers(0, 9))
def test_golombs_are_egs(golombs: tuple[int, list[int]], offset: int) -> None:
    order, values = golombs
    one_by_one, in_bulk = Writer(), Writer()
    for writer in (one_by_one, in_bulk):
        writer.u("offset", offset, 0)
    for value in values:
        one_by_one.eg("e", order, value)
    in_bulk.golombs("e", len(values), order, np.array(values, np.int64))
    assert one_by_one.bits == in_bulk.bits
    assert bits_of(one_by_one) == bits_of(in_bulk)
    reader = Reader(in_bulk.getvalue())
    reader.u("offset", offset)
    assert reader.golombs("e", len(values), order).tolist() == values
    plain = Reader(in_bulk.getvalue())
    plain.u("offset", offset)
    assert [plain.eg("e", order) for _ in values] == values
    assert reader.position == plain.position


@given(st.binary(max_size=12), st.integers(0, 15), st.integers(1, 30))
def test_golombs_fail_where_egs_fail(data: bytes, order: int, count: int) -> None:
    outcomes = []
    for in_bulk in (True, False):
        reader = Reader(data, first_bit=64)
        try:
            if in_bulk:
                values = reader.golombs("e", count, order).tolist()
            else:
                values = [reader.eg("e", order) for _ in range(count)]
            outcomes.append((values, reader.position))
        except GsvcError as error:
            outcomes.append((error.rule, error.bit))
    assert outcomes[0] == outcomes[1]


def test_golomb_of_17_zeros() -> None:
    error = failure(Reader(bytes([0x80, 0, 0, 0x40])).golombs, "e", 2, 0)
    assert (error.rule, error.bit) == ("R-3.1-3", 1)


@given(st.lists(st.integers(0, 65535), min_size=1, max_size=50))
def test_best_golomb_order_is_best(values: list[int]) -> None:
    sizes = []
    for order in range(16):
        writer = Writer()
        for value in values:
            writer.eg("e", order, value)
        sizes.append(writer.position)
    assert best_golomb_order(np.array(values)) == (sizes.index(min(sizes)), min(sizes))


@given(st.integers(0, 16), st.integers(0, 7), st.integers(0, 40), st.integers(0, 2**32 - 1))
def test_fixed_is_u(size: int, offset: int, count: int, seed: int) -> None:
    values = np.random.default_rng(seed).integers(0, 2**size - 1, count, np.uint16, endpoint=True)
    one_by_one, in_bulk = Writer(), Writer()
    for writer in (one_by_one, in_bulk):
        writer.u("offset", offset, 0)
    for value in values.tolist():
        one_by_one.u("e", size, value)
    in_bulk.fixed("e", count, size, values)
    assert bits_of(one_by_one) == bits_of(in_bulk)
    reader = Reader(in_bulk.getvalue())
    reader.u("offset", offset)
    assert reader.fixed("e", count, size).tolist() == values.tolist()


def test_fixed_of_many_blocks() -> None:
    values = (np.arange(200_000) * 7919 % 1000).astype(np.uint16)
    writer = Writer()
    writer.u("offset", 2, 3)
    writer.fixed("e", len(values), 10, values)
    writer.align()
    reader = Reader(writer.getvalue())
    reader.u("offset", 2)
    np.testing.assert_array_equal(reader.fixed("e", len(values), 10), values)


PAIRS = st.lists(st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 300)), max_size=30)


@given(PAIRS, st.binary(max_size=12))
def test_pairs_are_uvs(pairs: list[tuple[int, int]], rest: bytes) -> None:
    """Also when the bytes end in faults: the pairs before are yielded, then comes the error of the plain form."""
    writer = Writer()
    for pair in pairs:
        writer.uv("a", pair[0])
        writer.uv("b", pair[1])
    in_bulk = Writer()
    blocks = list(in_bulk.pairs(("a", "b"), len(pairs), np.array(pairs, np.uint32).reshape(-1, 2)))
    assert in_bulk.getvalue() == writer.getvalue()
    assert [block.tolist() for block in blocks] == [[list(pair) for pair in pairs]]

    data = writer.getvalue() + rest
    count = len(pairs) + 8
    read, plain = [], []
    reader, plain_reader = Reader(data), Reader(data)
    fault = plain_fault = None
    try:
        for block in reader.pairs(("a", "b"), count):
            read += block.tolist()
    except GsvcError as error:
        fault = error.rule, error.bit
    try:
        for _ in range(count):
            plain.append([plain_reader.uv("a"), plain_reader.uv("b")])
    except GsvcError as error:
        plain_fault = error.rule, error.bit
    assert (read, fault) == (plain, plain_fault)


def test_pairs_of_many_blocks() -> None:
    pairs = np.column_stack([np.arange(100_000), np.arange(100_000) ** 2 % 2**32]).astype(np.uint32)
    writer = Writer()
    list(writer.pairs(("a", "b"), len(pairs), pairs))
    read = np.concatenate(list(Reader(writer.getvalue()).pairs(("a", "b"), len(pairs))))
    np.testing.assert_array_equal(read, pairs)


@pytest.mark.parametrize("dtype", ["u2", "u4", "f2", "f4"])
def test_array_is_little_endian(dtype: str) -> None:
    values = np.array([1, 2.0**-3 if dtype[0] == "f" else 770], dtype)
    writer = Writer()
    writer.array("e", 2, dtype, values)
    assert writer.getvalue() == values.astype(f"<{dtype}").tobytes()
    np.testing.assert_array_equal(Reader(writer.getvalue()).array("e", 2, dtype), values, strict=True)


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_floats_are_finite(value: float) -> None:
    data = np.array([1, value, 1], "<f2").tobytes()
    error = failure(Reader(data).floats, "e", 3, "f2")
    assert (error.kind, error.rule, error.bit) == ("invalid", "R-3.1-2", 16)
    with pytest.raises(UsageError, match=r"R-3\.1-2"):
        Writer().f32("e", value)


def test_align_skips_zeros_only() -> None:
    reader = Reader(bytes([0b1010_0000, 0b1000_0001]))
    reader.u("e", 3)
    reader.align()
    reader.align()
    assert reader.position == 8
    reader.u("e", 1)
    error = failure(reader.align)
    assert (error.kind, error.rule, error.bit) == ("invalid", "R-3.1-4", 9)


@pytest.mark.parametrize(
    ("method", "arguments"),
    [
        ("u", ("e", 17)),
        ("le", ("e", 4)),
        ("uv", ("e",)),
        ("eg", ("e", 0)),
        ("raw", ("e", 3)),
        ("array", ("e", 2, "u2")),
        ("fixed", ("e", 3, 7)),
        ("golombs", ("e", 5, 1)),
    ],
)
def test_nothing_is_read_past_the_end(method: str, arguments: tuple[object, ...]) -> None:
    data = bytes([0x80, 0x80]) if method == "uv" else bytes(2)
    error = failure(getattr(Reader(data, first_bit=80), method), *arguments)
    assert (error.kind, error.rule, error.bit) == ("malformed", "R-6.2-3", 80)
    assert "`e`" in error.message


@pytest.mark.parametrize(
    ("method", "arguments"),
    [("u", ("e", 3, 8)), ("u", ("e", 3, -1)), ("le", ("e", 1, 256)), ("uv", ("e", 2**32)), ("eg", ("e", 0, 2**17))],
)
def test_writer_refuses_what_does_not_fit(method: str, arguments: tuple[object, ...]) -> None:
    with pytest.raises(UsageError, match="`e`"):
        getattr(Writer(), method)(*arguments)


def test_bits_are_counted_by_category_and_traced() -> None:
    traced = []
    writer = Writer(16, traced.append)
    with writer.part("positions", "plane"):
        writer.u("a", 3, 5)
        writer.align()
    writer.le("b", 2, 7)
    assert writer.bits == {("positions", "a"): 3, ("positions", "align"): 5, ("container", "b"): 16}
    assert writer.bits_by_category() == {"positions": 8, "container": 16}
    assert [(e.bit, e.bits, e.category, e.name, e.value) for e in traced] == [
        (16, 3, "positions", "plane.a", 5),
        (19, 5, "positions", "plane.align", 0),
        (24, 16, "container", "b", 7),
    ]
