"""CRC-32C: published values, and the kernel against spec.md."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.splats import Splats
from gsvc_ref import spec
from gsvc_ref.bitstream import crc32c, parameter_checksum
from gsvc_ref.bitstream.crc import ZERO_TABLES, crc32c_of_part, registers
from gsvc_ref.testing import splat_sets

# RFC 3720, appendix B.4, and the check value of the CRC catalogues.
PUBLISHED = [
    (b"123456789", 0xE3069283),
    (bytes(32), 0x8A9136AA),
    (b"\xff" * 32, 0x62A8AB43),
    (bytes(range(32)), 0x46DD794E),
    (bytes(range(31, -1, -1)), 0x113FDB5C),
    (b"", 0),
]


@pytest.mark.parametrize(("data", "crc"), PUBLISHED)
def test_published_values(data: bytes, crc: int) -> None:
    assert spec.crc32c(data) == crc
    assert crc32c(data) == crc


@given(st.binary(max_size=100), st.binary(max_size=40))
def test_kernel_is_definition_in_pieces_too(first: bytes, second: bytes) -> None:
    assert crc32c(first + second) == spec.crc32c(first + second)
    assert crc32c(second, crc32c(first)) == crc32c(first + second)


@given(splat_sets(hard=True, max_count=6))
def test_parameter_checksum_covers_the_bytes(splats: Splats) -> None:
    """R-6.4-3: all positions, then all Cholesky factors, then all colours, as little-endian binary32."""
    data = b"".join(part.astype("<f4").tobytes() for part in (splats.positions, splats.cholesky, splats.colors))
    assert parameter_checksum(splats) == spec.crc32c(data)


def test_parameter_checksum_sees_the_sign_of_zero() -> None:
    zero = Splats.from_array(np.zeros((1, 8)))
    negative = Splats.from_array(np.array([[0, 0, 0, 0, 0, 0, 0, -0.0]]))
    assert parameter_checksum(zero) != parameter_checksum(negative)
    assert parameter_checksum(Splats.empty()) == 0


@given(st.binary(max_size=300), st.data())
def test_the_checksum_of_a_part_is_that_of_its_bytes(data: bytes, draw: st.DataObject) -> None:
    first = draw.draw(st.integers(0, len(data)))
    end = draw.draw(st.integers(first, len(data)))
    array = np.frombuffer(data, np.uint8)
    assert crc32c_of_part(array, registers(array), first, end, ZERO_TABLES) == spec.crc32c(data[first:end])


@pytest.mark.parametrize("size", [1 << 20, (1 << 21) + 77])
def test_the_checksum_of_a_long_part(size: int) -> None:
    array = np.frombuffer(np.random.default_rng(1).bytes(size + 100), np.uint8)
    part = array[33 : 33 + size]
    assert crc32c_of_part(array, registers(array), 33, 33 + size, ZERO_TABLES) == crc32c(part.tobytes())
