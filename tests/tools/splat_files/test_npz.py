"""NPZ files of splats: what is written is read again, and no file of any origin does harm."""

import io
import pickle
import struct
import zipfile
from fractions import Fraction

import numpy as np
import pytest

from gsvc_base.errors import GsvcError
from gsvc_tools.splat_files import NpzSplats, write_npz

SPLATS = np.random.default_rng(0).random((7, 8), np.float32)


def saved(tmp_path, **arrays):
    np.savez(tmp_path / "a.npz", **arrays)
    return tmp_path / "a.npz"


def test_what_is_written_is_read_again(tmp_path):
    frames = [(SPLATS[:4], np.arange(4)), (SPLATS[:0], np.arange(0)), (SPLATS[4:], np.arange(9, 12))]
    assert write_npz(tmp_path / "a.npz", frames, 30, 20, Fraction(30000, 1001)) == [4, 0, 3]
    with NpzSplats(tmp_path / "a.npz") as splats:
        assert (len(splats), splats.width, splats.height, splats.frame_rate) == (3, 30, 20, Fraction(30000, 1001))
        for (parameters, ids), (wanted, numbers) in zip(splats, frames, strict=True):
            assert np.array_equal(parameters, wanted)
            assert np.array_equal(ids, numbers)


@pytest.mark.parametrize(
    ("arrays", "counts"),
    [
        ({"parameters": SPLATS}, [7]),
        ({"parameters": np.stack([SPLATS, SPLATS]).astype(np.float64)}, [7, 7]),
        ({"parameters": SPLATS, "counts": [3, 4]}, [3, 4]),
        ({"parameters": SPLATS.astype(np.float16)}, [7]),
        ({"parameters": SPLATS.astype(">f4"), "counts": [3, 4], "frame_rate": 29.97, "width": 9}, [3, 4]),
    ],
)
def test_what_savez_writes_is_read(tmp_path, arrays, counts):
    with NpzSplats(saved(tmp_path, **arrays)) as splats:
        frames = list(splats)
    assert [len(frame) for frame in frames] == counts
    assert np.array_equal(np.concatenate(frames), np.concatenate([arrays["parameters"].reshape(-1, 8)]).astype("<f4"))


@pytest.mark.parametrize("kind", ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", ">u2", ">i8"])
def test_whole_numbers_of_every_type_are_read(tmp_path, kind):
    whole = {name: np.array(value, kind) for name, value in {"counts": [3, 4], "ids": [*range(7)], "width": 9}.items()}
    with NpzSplats(saved(tmp_path, parameters=SPLATS, **whole)) as splats:
        assert splats.width == 9
        assert [ids.tolist() for _, ids in splats] == [[0, 1, 2], [3, 4, 5, 6]]
    most = np.iinfo(kind).max
    with pytest.raises(GsvcError, match=r"add up|more than 4194304 splats"):
        NpzSplats(saved(tmp_path, parameters=SPLATS, counts=np.array([most, 1], kind)))


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"means": SPLATS}, r"no array 'parameters' in it \(it has means.npy\)"),
        ({"parameters": SPLATS[:, :7]}, r"shape \(7, 7\); it must be \(splats, 8\)"),
        ({"parameters": SPLATS.astype(complex)}, "complex128; it must be float16, float32"),
        ({"parameters": np.asfortranarray(SPLATS)}, "C order"),
        ({"parameters": SPLATS, "counts": [3, 5]}, "counts add up to 8 splats; parameters has 7"),
        ({"parameters": SPLATS, "counts": [8, -1]}, r"counts\[1\] is -1"),
        ({"parameters": SPLATS, "counts": [3.5, 3.5]}, "counts must be integers"),
        ({"parameters": SPLATS, "ids": np.arange(6)}, r"ids are int64 of shape \(6,\)"),
        ({"parameters": SPLATS, "width": 2.5}, "width must be one integer"),
        ({"parameters": SPLATS, "width": 10_000_000}, "a.npz: the size is 10000000x1; width and height must be"),
        ({"parameters": SPLATS, "width": 0}, "a.npz: the size is 0x1; width and height must be"),
        ({"parameters": SPLATS, "width": 60_000, "height": 4000}, "a.npz: no level allows 60000x4000"),
        ({"parameters": SPLATS, "frame_rate": 1e-12}, "a.npz: frame_rate is 1/1000000000000; it must be"),
        ({"parameters": SPLATS, "frame_rate": [0, 1]}, "frame_rate must be"),
        ({"parameters": SPLATS, "frame_rate": np.nan}, "frame_rate must be"),
    ],
)
def test_what_makes_no_sense_is_named(tmp_path, arrays, message):
    with pytest.raises(GsvcError, match=message):
        NpzSplats(saved(tmp_path, **arrays))


def test_objects_are_never_unpickled(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, parameters=np.array([{"a": 1}], dtype=object))
    with pytest.raises(GsvcError, match="parameters is object"):
        NpzSplats(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("parameters.npy", pickle.dumps(print))
    with pytest.raises(GsvcError, match="not a sound NPZ file"):
        NpzSplats(path)


def with_header(path, header, data=b""):
    """An NPZ file whose array says of itself what is given."""
    member = io.BytesIO()
    np.lib.format.write_array_header_1_0(member, header)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("parameters.npy", member.getvalue() + data)
    return path


@pytest.mark.parametrize(
    ("shape", "kind", "message"),
    [
        ((1 << 50, 8), "limit", "more than 4194304 splats in a frame"),
        ((1 << 40, 1, 8), "limit", "more than 1048576 frames"),
        ((1 << 20, 8), "malformed", "parameters takes 33554432 bytes by its header, and has 0; fetch"),
        ((-1, 8), "malformed", "C order|add up"),
    ],
)
def test_a_claim_is_checked_before_anything_is_allocated(tmp_path, shape, kind, message):
    header = {"descr": "<f4", "fortran_order": False, "shape": shape}
    path = with_header(tmp_path / "a.npz", header)
    with pytest.raises(GsvcError, match=message) as caught, NpzSplats(path) as splats:
        list(splats)
    assert caught.value.kind == kind


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_methods_that_inflate_without_a_limit_are_refused(tmp_path, method):
    whole = io.BytesIO()
    np.lib.format.write_array(whole, SPLATS)
    with zipfile.ZipFile(tmp_path / "a.npz", "w", method) as archive:
        archive.writestr("parameters.npy", whole.getvalue())
    with pytest.raises(GsvcError, match="compressed in another way"):
        NpzSplats(tmp_path / "a.npz")


def test_a_list_of_arrays_that_fills_the_memory_is_not_read(tmp_path):
    """In a file of 8 GiB, nearly all of which is a hole."""
    size = 1 << 33
    end = b"PK\6\6" + struct.pack("<QHHLLQQQQ", 44, 45, 45, 0, 0, 1, 1, size, 0)
    end += b"PK\6\7" + struct.pack("<LQL", 0, size, 1) + b"PK\5\6" + b"\xff" * 16 + bytes(2)
    with (tmp_path / "a.npz").open("wb") as file:
        file.truncate(size)
        file.seek(size)
        file.write(end)
    with pytest.raises(GsvcError, match="the list of its arrays takes 8589934592 bytes; at most 1048576 are read"):
        NpzSplats(tmp_path / "a.npz")


def test_any_cut_and_any_byte_changed_is_read_or_refused(tmp_path):
    data = saved(tmp_path, parameters=SPLATS[:2], counts=[1, 1], width=5).read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for place in range(0, len(data), 7):
        changed = bytearray(data)
        changed[place] ^= int(rng.integers(1, 256))
        for damaged in (data[:place], bytes(changed)):
            (tmp_path / "b.npz").write_bytes(damaged)
            try:
                with NpzSplats(tmp_path / "b.npz") as splats:
                    list(splats)
            except GsvcError:
                refused += 1
    assert refused > len(data) // 7
