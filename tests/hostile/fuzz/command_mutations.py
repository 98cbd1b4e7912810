"""Files of splats, scenes and logs to begin with, and mutations of them that know how they are built."""

import io
import json
import re
import warnings
import zipfile
import zlib
from collections.abc import Sequence
from random import Random
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_lab.scenes.built_in import scene_names, scene_text
from gsvc_ref.encoder.effects import EFFECT_NAMES

from .stream_mutations import bytes_changed

TYPES: Final = (
    "u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8", ">u2", ">i4", ">i8", ">f4", ">f8", "?", "c8", "g",
    "S3", "U2", "M8[s]", "m8[s]", "V8", "i4,f4",
)  # fmt: skip
SHAPES: Final = (
    "()", "(0,)", "(1,)", "(3,)", "(0, 8)", "(3, 8)", "(3, 7)", "(1, 3, 8)", "(2, 0, 8)", "(-1, 8)", "(1048577, 8)",
    "(4194305, 8)", "(1099511627776, 8)", "(1048577, 0, 8)", "(9223372036854775807, 8)", "(10**9, 8)", "(True, 8)",
    "(3.0, 8)", "3", "None", "'8'", "(" * 200 + ")" * 200, "(3, 8, 0)", "(18446744073709551616, 0, 8)",
)  # fmt: skip
NUMBERS: Final = (
    0, 1, 2, 3, -1, 127, 128, 255, 32767, 65535, 1 << 22, (1 << 22) + 1, (1 << 31) - 1, 1 << 31, (1 << 63) - 1, 0.5,
    1e-9, 3e38, 1e39, 1e300, np.inf, -np.inf, np.nan, 8.0, 25, 2.0**-150,
)  # fmt: skip
HEADERS: Final = (
    "{{'descr': '{0}', 'fortran_order': False, 'shape': {1}}}",
    "{{'descr': '{0}', 'fortran_order': True, 'shape': {1}}}",
    "{{'descr': '|O', 'fortran_order': False, 'shape': {1}}}",
    "{{'descr': [('a', '{0}')], 'fortran_order': False, 'shape': {1}}}",
    "{{'descr': {1}, 'fortran_order': 0, 'shape': {1}}}",
    "{{'descr': '{0}', 'shape': {1}}}",
    "[{1}, '{0}']",
    "__import__('os')",
    "\x00\xff",
)
NAMES: Final = ("parameters", "counts", "ids", "width", "height", "frame_rate", "more", "../up", "")


def some_splat_files() -> list[bytes]:
    """NPZ of all types of numbers and all shapes that are read, and PLY of one Gaussian and of three."""
    rng = np.random.default_rng(0)
    splats = np.concatenate([rng.uniform(2, 9, (3, 5)), rng.uniform(0, 1, (3, 3))], axis=1)
    whole: dict[str, Any] = {"counts": np.array([1, 2]), "ids": np.array([1, 1, 2])}
    rest: dict[str, Any] = {"width": 16, "height": 12, "frame_rate": np.array([30000, 1001])}
    made = [_npz({"parameters": splats.astype(kind)}) for kind in TYPES[:15]]
    made += [_npz({"parameters": splats} | {k: v.astype(kind) for k, v in whole.items()}) for kind in TYPES[:8]]
    made += [_npz({"parameters": np.stack([splats, splats + 1])} | rest), _npz({"parameters": splats} | whole | rest)]
    made += [_npz({"parameters": splats, "frame_rate": 29.97} | whole, zipfile.ZIP_DEFLATED)]
    made += [_ply(count, kind) for count in (1, 3) for kind in ("float", "double", "uchar")]
    return made


def _npy(array: Any) -> bytes:
    target = io.BytesIO()
    np.lib.format.write_array(target, np.asarray(array), version=(1, 0))
    return target.getvalue()


def _npz(arrays: dict[str, Any], method: int = zipfile.ZIP_STORED) -> bytes:
    return _zipped([(f"{name}.npy", _npy(array), method) for name, array in arrays.items()])


def _zipped(members: Sequence[tuple[str, bytes, int]]) -> bytes:
    target = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(target, "w") as archive:
        warnings.simplefilter("ignore")  # of names that are there twice
        for name, data, method in members:
            archive.writestr(zipfile.ZipInfo(name), data, method)
    return target.getvalue()


def _unzipped(data: bytes) -> list[tuple[str, bytes, int]]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return [(info.filename, archive.read(info), info.compress_type) for info in archive.infolist()]


PROPERTIES: Final = ("x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "f_rest_0", "opacity", "scale_0", "scale_1",
                     "scale_2", "rot_0", "rot_1", "rot_2", "rot_3")  # fmt: skip


def _ply(count: int, kind: str) -> bytes:
    properties = "".join(f"property {kind} {name}\n" for name in PROPERTIES)
    dtype = {"float": "<f4", "double": "<f8", "uchar": "u1"}[kind]
    vertices = np.linspace(1, 3, count * len(PROPERTIES)).astype(dtype)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n"
    return head.encode() + vertices.tobytes()


LINES: Final = (
    b"format ascii 1.0", b"format binary_big_endian 1.0", b"format", b"comment", b"comment \xff\xfe",
    b"obj_info x", b"element vertex 0", b"element vertex 2", b"element vertex 3", b"element vertex 03",
    b"element vertex 4194305", b"element vertex 9223372036854775808", b"element vertex -1",
    b"element vertex 1e3", b"element vertex 1_0", b"element vertex \xd9\xa3", b"element face 1",
    b"element face 0", b"property float x", b"property float more", b"property half x",
    b"property list uchar int i", b"property uchar y", b"property double y", b"property float", b"property",
    b"end_header", b"", b"ply", b"end_header \r",
    b"comment " + b"x" * 70_000, b"element vertex " + b"9" * 5_000, b"element vertex " + b"0" * 40 + b"1",
)  # fmt: skip


def mutate_splat_file(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Lines of a header of PLY, members of an archive, or any bytes."""
    if rng.randrange(8) == 0:
        return bytes_changed(data, rng, others) if rng.randrange(2) else data[: rng.randrange(len(data) + 1)]
    if data.startswith(b"ply"):
        return _ply_changed(data, rng)
    members = _unzipped(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        _change_member(members, rng, others)
    return _zipped(members)


def _ply_changed(data: bytes, rng: Random) -> bytes:
    head, end, body = data.partition(b"end_header\n")
    lines = (head + end).split(b"\n")
    how = rng.randrange(4)
    if how == 0 and len(body) >= 4:  # a number
        place = rng.randrange(0, len(body) - 3, 4)
        with np.errstate(over="ignore"):
            body = body[:place] + np.array(rng.choice(NUMBERS), np.float32).tobytes() + body[place + 4 :]
    elif how == 1:
        body = body[: rng.randrange(len(body) + 1)] if rng.randrange(2) else body + rng.randbytes(rng.randrange(1, 9))
    else:
        place = rng.randrange(1, len(lines) + 1)
        lines[place : place + rng.randrange(2)] = [rng.choice(LINES)]
    return b"\n".join(lines) + body


def _change_member(members: list[tuple[str, bytes, int]], rng: Random, others: Sequence[bytes]) -> None:
    if not members:
        return
    place, how = rng.randrange(len(members)), rng.randrange(12)
    name, data, method = members[place]
    if how == 0:
        del members[place]
    elif how == 1:
        archives = [other for other in others if not other.startswith(b"ply")]
        members.append(rng.choice(_unzipped(rng.choice(archives))))
    elif how == 2:
        members[place] = f"{rng.choice(NAMES)}.npy", data, method
    elif how == 3:
        methods = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
        members[place] = name, data, rng.choice(methods)
    elif how == 4:
        members[place] = name, bytes_changed(data, rng, others), method
    elif how == 5:
        text = rng.choice(HEADERS).format(rng.choice(TYPES), rng.choice(SHAPES)).encode("latin-1")
        head = text.ljust(117) + b"\n"
        members[place] = name, b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head + data[128:], method
    elif how == 6:
        members[place] = name, data[:6] + bytes([rng.randrange(4), rng.randrange(2)]) + data[8:], method
    elif (array := _array(data)) is not None:
        members[place] = name, _npy(_array_changed(array, how, rng)), method


def _array(data: bytes) -> NDArray[Any] | None:
    try:
        return np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    except Exception:  # it was changed before
        return None


def _array_changed(array: NDArray[Any], how: int, rng: Random) -> NDArray[Any]:
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            if how == 7:
                return np.asfortranarray(array) if rng.randrange(2) else array.reshape(-1)
            if how == 8 and array.ndim:
                return np.concatenate([array, array[:1]]) if rng.randrange(2) else array[:-1]
            if how in (9, 10) and array.size:
                changed = array.copy()
                changed.reshape(-1)[rng.randrange(array.size)] = rng.choice(NUMBERS)
                return changed
            return array.astype(rng.choice(TYPES))
        except (TypeError, ValueError, OverflowError):
            return array


VALUES: Final = (
    "0", "1", "-1", "2", "1e400", "nan", "inf", "-0.0", "true", "''", "'x'", "[]", "[1]", "[1, 2]", "[0, 0]", "{}",
    "9223372036854775807", "9223372036854775808", "1" * 5_000, "'/dev/zero'", "'..'", "[" * 300 + "]" * 300,
    "1979-05-27", "[nan, nan]", "[1e300, 1e300]", "[-1, -1, -1]", "'\\u0000'", "'red'", "'#fff'", "0.5", "24",
    "[1, 1, 1]", "'" + "x" * 5_000 + "'",
)  # fmt: skip


def some_scenes() -> list[bytes]:
    """The scenes that are built in."""
    return [scene_text(name).encode() for name in scene_names()]


def mutate_scene(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Values, lines and tables of TOML; or any bytes."""
    if rng.randrange(10) == 0:
        return bytes_changed(data, rng, others)
    lines = data.split(b"\n")
    for _ in range(rng.choice((1, 1, 2))):
        place, how = rng.randrange(len(lines)), rng.randrange(6)
        key = lines[place].partition(b"=")[0]
        if how <= 2:
            values = [place for place, line in enumerate(lines) if b"=" in line]
            place = rng.choice(values or [0])
            key = lines[place].partition(b"=")[0]
            lines[place] = key + b"= " + rng.choice(VALUES).encode()
        elif how == 3:
            del lines[place]
        elif how == 4:
            lines.insert(place, rng.choice(rng.choice(others).split(b"\n")))
        else:
            before, number, after = re.split(rb"(-?\d+(?:\.\d+)?)", lines[place] + b"0", maxsplit=1)
            lines[place] = before + rng.choice((rng.choice(VALUES).encode(), number)) + after
        lines = lines or [b""]
    return b"\n".join(lines)


def some_logs() -> list[bytes]:
    """Logs of two frames."""
    line = {name: {"done": True, "reason": "it is so", "iterations": 3, "saved": 2} for name in EFFECT_NAMES}
    lines = [json.dumps({"frame": number} | line) for number in (0, 1)]
    told = "\n".join([*lines, ""])
    return [_deflated(told.replace("it is so", f"{number} of 20").encode()) for number in range(20)]


def mutate_log(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Values, names and lines of a log; or any bytes."""
    if rng.randrange(6) == 0:
        return bytes_changed(data, rng, others)
    text = zlib.decompressobj(-15).decompress(data, 1 << 16) if data else b""
    words = rb'true|-?\d+|"[^"]*"|[{}]'
    places = [found.span() for found in re.finditer(words, text)]
    for _ in range(rng.choice((1, 1, 2))):
        if places:
            first, end = rng.choice(places)
            number = str(rng.randrange(1 << 20)).encode()
            word = (
                rng.choice(WORDS_OF_JSON) if rng.randrange(3) else number if rng.randrange(2) else text[first:end] * 2
            )
            text = text[:first] + word + text[end:]
            places = [found.span() for found in re.finditer(words, text)]
    return _deflated(text)


WORDS_OF_JSON: Final = (
    b"0", b"1", b"-1", b"1e400", b"NaN", b"Infinity", b"null", b"true", b'""', b'"\\ud800"', b"[]", b"{}", b"[" * 1500,
    b"[" * 2500, b"9" * 1000, b"9007199254740992", b'"\\u0007"', b"\n", b",", b'"x"',
)  # fmt: skip


def _deflated(text: bytes) -> bytes:
    deflater = zlib.compressobj(9, wbits=-15)
    return deflater.compress(text) + deflater.flush()
