"""PLY files of one fixed layout: binary, little-endian, the first element ``vertex`` with numbers as its properties.

That is what 3D Gaussian splatting and gsplat write. It is so little that no library is needed; plyfile, the usual one,
reads lists and text as well, and allocates what a header claims.
"""

import os
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_base.errors import GsvcError
from gsvc_base.files import complete_file

Columns = dict[str, NDArray[Any]]
"""A column of numbers for each property, all of the same length."""

MAX_HEADER: Final = 1 << 16
"""Maximum number of bytes of a header."""
MAX_PROPERTIES: Final = 1000
MAX_VERTICES: Final = 1 << 22
"""Maximum number of splats of a frame, that of the highest level (R-5-2)."""
MAX_SIZE: Final = 1 << 30
"""Maximum number of bytes of the vertices, which are read at once; 3DGS writes 248 for each."""

PROPERTY_TYPES: Final = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "<i2", "int16": "<i2", "ushort": "<u2",
    "uint16": "<u2", "int": "<i4", "int32": "<i4", "uint": "<u4", "uint32": "<u4", "float": "<f4", "float32": "<f4",
    "double": "<f8", "float64": "<f8",
}  # fmt: skip
"""The types of properties."""


class Vertices(NamedTuple):
    """The vertices of a PLY file."""

    columns: Columns
    """Their properties by name."""
    lost: list[str]
    """A sentence if the file holds other elements, which are not read."""


class _Header(NamedTuple):
    """What a header says."""

    vertices: int
    """Their number."""
    dtype: np.dtype[Any]
    """The type of a vertex."""
    others: list[str]
    """The names of the elements after the vertices."""


def read_ply(path: str | Path) -> Vertices:
    """The properties of the vertices of a PLY file.

    A GsvcError is ``malformed`` where it is not a PLY file, ends early or goes on after all that its header states,
    ``unsupported`` where it has another layout, ``limit`` for more than 2^22 vertices or 1000 properties.
    """
    path = Path(path)
    with path.open("rb") as file:
        count, dtype, others = _header(file, str(path))
        size, left = count * dtype.itemsize, os.fstat(file.fileno()).st_size - file.tell()
        if left < size:
            raise GsvcError(
                "malformed",
                f"{path} ends early: {count} vertices take {size} bytes, and {left} are left; fetch or write it again",
            )
        if left > size and not others:
            raise GsvcError(
                "malformed",
                f"{path} goes on after its {count} vertices: they take {size} bytes, and {left} are left; correct the "
                "count in its header, or write it again",
            )
        vertices = np.frombuffer(file.read(size), dtype, count)
    lost = [f"elements of PLY files that are not vertices: {', '.join(others[:8])}"] if others else []
    return Vertices({name: vertices[name] for name in dtype.names or ()}, lost)


def _header(file: BinaryIO, name: str) -> _Header:
    """What the header says; the file then stands at the first vertex."""
    lines = _lines(file, name)
    if lines[1:2] != ["format binary_little_endian 1.0"]:
        said = lines[1] if len(lines) > 1 else "nothing"
        raise GsvcError(
            "unsupported",
            f"{name} says {said[:80]!r}; write it as binary_little_endian 1.0, as gsplat and 3DGS do: the package "
            "plyfile does so by PlyData.read(IN), text = False, byte_order = '<' and write(OUT)",
        )
    count, properties = None, []
    for line in lines[2:]:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "element" and count is not None:
            break
        if words[:2] == ["element", "chunk"]:
            raise GsvcError(
                "unsupported",
                f"{name} is a compressed PLY file of SuperSplat; export it as PLY without compression there, or with "
                "its command splat-transform, and give that",
            )
        if words[:2] == ["element", "vertex"] and len(words) == 3 and words[2].isdecimal():
            digits = words[2].lstrip("0") or "0"
            count = int(digits[:18])  # more of them are beyond all limits anyway, and long for int()
        elif words[0] == "property" and count is not None and len(words) == 3 and words[1] in PROPERTY_TYPES:
            properties.append((words[2], PROPERTY_TYPES[words[1]]))
        else:
            raise GsvcError(
                "unsupported",
                f"{name}: its header says {line[:80]!r}; it must begin with 'element vertex COUNT', then lines "
                f"'property TYPE NAME' with TYPE one of {', '.join(PROPERTY_TYPES)}",
            )
    if count is None:
        raise GsvcError("malformed", f"{name} has no element 'vertex'; give a PLY file of Gaussian splats")
    size = count * sum(np.dtype(kind).itemsize for _, kind in properties)
    if count > MAX_VERTICES or len(properties) > MAX_PROPERTIES or size > MAX_SIZE:
        raise GsvcError(
            "limit",
            f"{name} has {digits[:80]} vertices with {len(properties)} properties; at most {MAX_VERTICES} with "
            f"{MAX_PROPERTIES} in {MAX_SIZE} bytes are read",
        )
    names = [name for name, _ in properties]
    if len(set(names)) != len(names):
        raise GsvcError("malformed", f"{name}: two properties of the vertices have the same name")
    others = [" ".join(line.split()[1:2])[:80] for line in lines[2:] if line.split()[:1] == ["element"]][1:]
    return _Header(count, np.dtype(properties), others)


def _lines(file: BinaryIO, name: str) -> list[str]:
    """The lines of the header up to ``end_header``."""
    lines: list[str] = []
    size = 0
    while True:
        line = file.readline(MAX_HEADER + 1 - size)
        size += len(line)
        if size > MAX_HEADER:
            raise GsvcError(
                "limit", f"{name} has a header of more than {MAX_HEADER} bytes; give a PLY file of Gaussian splats"
            )
        text = line.decode("ascii", "replace").strip()
        if not lines and text != "ply":
            raise GsvcError("malformed", f"{name} is not a PLY file; it does not begin with 'ply'")
        if not line.endswith(b"\n"):
            raise GsvcError("malformed", f"{name} ends inside its header; fetch or write it again")
        if text == "end_header":
            return lines
        lines.append(text)


def write_ply(path: str | Path, columns: Columns) -> None:
    """Write columns of equal length as vertices of binary32 numbers, which are complete when the file gets its name."""
    count = len(next(iter(columns.values())))
    vertices = np.empty(count, np.dtype([(name, "<f4") for name in columns]))
    for name, column in columns.items():
        vertices[name] = column
    properties = "".join(f"property float {name}\n" for name in columns)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n"
    with complete_file(Path(path)) as file:
        file.write(header.encode("ascii"))
        file.write(vertices.tobytes())
