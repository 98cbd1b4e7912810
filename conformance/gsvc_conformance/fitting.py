"""Inputs that somebody brings: read from files, and held against the types and shapes of spec.md section 4.3.

What can be converted without loss is converted. Everything else is refused, with a sentence for each input.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.errors import UsageError
from gsvc_conformance.operation import DTYPES, Operation, Port, Values
from gsvc_conformance.reading import Archive, check_size, parse_npy, read_bytes
from gsvc_conformance.spelling import question

Array = NDArray[Any]
STREAM: Final = ".gsvc"


def read_inputs(operation: Operation, path: Path) -> dict[str, Any]:
    """The inputs in a file or folder, by name, as they are.

    Parameters
    ----------
    operation
        The operation that they are for.
    path
        An ``.npz`` file; a ``.gsvc`` file, the stream of an operation whose only input it is; or a folder of
        ``NAME.npy`` and ``NAME.gsvc``, as ``run --keep`` leaves them in ``in/``.

    Raises
    ------
    UsageError
        It cannot be read, or is none of these.
    """
    if path.is_dir():
        return _of_folder(operation, path)
    if path.suffix == STREAM:
        streams = [port.name for port in operation.inputs if port.type == "stream"]
        if len(streams) != 1 or len(operation.inputs) != 1:
            raise UsageError(f"{operation.name} takes {_names(operation)}, so a stream alone is not enough: give a "
                             "folder or an .npz file of them")  # fmt: skip
        return {streams[0]: _bytes(path)}
    if path.suffix != ".npz":
        raise UsageError(f"{path} is neither an .npz file, nor a {STREAM} file, nor a folder of .npy files")
    try:
        files = Archive(path)
        check_size(f"all of {path} together", sum(map(files.size, files)))
        return {name.removesuffix(".npy"): parse_npy(data, name, foreign=True) for name, data in files.items()}
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}") from None
    except UsageError as error:
        raise UsageError(f"{path} cannot be read as an .npz file of plain arrays: {error}") from None


def _of_folder(operation: Operation, folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for file in sorted(folder.iterdir()):
        if file.suffix == STREAM:
            found[file.stem] = _bytes(file)
        elif file.suffix == ".npy":
            found[file.stem] = parse_npy(_bytes(file), str(file), foreign=True)
    if not found:
        inside = "; give its folder in/" if (folder / "in").is_dir() else ""
        raise UsageError(f"{folder} has no .npy or {STREAM} files; {operation.name} takes {_names(operation)}{inside}")
    return found


def _bytes(path: Path) -> bytes:
    try:
        return read_bytes(path)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from None


def _names(operation: Operation) -> str:
    return ", ".join(port.name for port in operation.inputs)


def fit(operation: Operation, given: Mapping[str, Any]) -> Values:
    """The inputs of an operation, each of the type and shape that spec.md section 4.3 states.

    Parameters
    ----------
    operation
        The operation.
    given
        Its inputs by name: arrays or what NumPy makes arrays of, numbers, and bytes for streams.

    Raises
    ------
    UsageError
        Inputs are missing, unknown, of another type or shape, or their dimensions disagree; a sentence for each.
    """
    problems = [*_misnamed(operation, given)]
    values: Values = {}
    for port in operation.inputs:
        if port.name in given:
            try:
                values[port.name] = _value(port, given[port.name], _sample_type(given))
            except UsageError as error:
                problems.append(f"{port.name} {error}")
    problems += _dimension_problems(operation, values)
    if problems:
        raise UsageError(f"{operation.name} cannot take these inputs: {'; '.join(problems)}")
    return values


def _misnamed(operation: Operation, given: Mapping[str, Any]) -> Iterator[str]:
    """A sentence for each input that is missing, and for each that is none of the operation."""
    ports = {port.name: port for port in operation.inputs}
    missing = [name for name in ports if name not in given]
    for name in given:
        if name not in ports:
            near = question(name, missing) or f"; its inputs are {_names(operation)}"
            yield f"{name} is none of its inputs{near}".replace("; did", ": did").replace("; its", ": its")
    for name in missing:
        yield f"{name} is missing, {_article(ports[name])}"


def _article(port: Port) -> str:
    kind = {"int": "a whole number", "float": "a number", "stream": "the bytes of a stream"}.get(port.type)
    return kind or f"an array of {port.type} {port.shape}"


def _sample_type(given: Mapping[str, Any]) -> str:
    """The type of samples: that of R-9.1-1 for the bit depth that is given, or either."""
    depth = given.get("bit_depth")
    return "u1|u2" if depth is None or np.size(depth) != 1 else "u1" if np.asarray(depth).item() == 8 else "u2"


def _value(port: Port, value: Any, sample_type: str) -> Any:
    """One input in its type.

    Raises
    ------
    UsageError
        It is of another; what follows the name in a sentence.
    """
    if port.type == "stream":
        return _stream(value)
    if isinstance(value, bytes | str):
        raise UsageError(f"must be {_article(port)}, not {type(value).__name__}")
    array = np.asarray(value)
    if array.dtype.kind not in "biuf":
        raise UsageError(f"must be {_article(port)}; it has the type {array.dtype}")
    if port.type in ("int", "float"):
        if array.shape != ():
            raise UsageError(f"must be {_article(port)}; it is an array of shape {array.shape}")
        try:
            return converted(array, "i8" if port.type == "int" else "f8").item()
        except UsageError:
            raise UsageError(f"is {array.item()}; it must be {_article(port)}") from None
    kind = sample_type if port.type == "u1|u2" else port.type
    if kind not in DTYPES:
        kind = "u2" if array.dtype.str.lstrip("<>|") == "u2" else "u1"
    return np.array(converted(array, kind), order="C")


def _stream(value: Any) -> bytes:
    if isinstance(value, bytes | bytearray | memoryview):
        return bytes(value)
    if isinstance(value, np.ndarray) and value.dtype == np.uint8 and value.ndim == 1:
        return value.tobytes()
    raise UsageError("must be the bytes of a stream: bytes, or an array of u1 (n,)")


def converted(array: Array, kind: str) -> Array:
    """An array in another type, if every number stays what it is.

    Parameters
    ----------
    array
        Of booleans, integers or floating-point numbers, of any shape.
    kind
        One of `operation.DTYPES`.

    Raises
    ------
    UsageError
        Some number does not; what follows the name in a sentence.
    """
    dtype = np.dtype(kind)
    with np.errstate(all="ignore"):
        new = array.astype(dtype)
        back = new.astype(array.dtype)
        same = (back == array) & (np.signbit(back) == np.signbit(array) if array.dtype.kind == "f" else True)
        if dtype.kind == "f":
            same |= np.isnan(new) & np.isnan(array)
        else:
            same = (back == array) & (array >= np.iinfo(dtype).min) & (array <= np.iinfo(dtype).max)
    if np.all(same):
        return np.asarray(new)
    count, place = int(np.count_nonzero(~same)), [int(i) for i in np.argwhere(~same)[0]]
    at = f" at {place}" if place else ""
    if dtype.kind == "f":
        advice = f"round it yourself, as by .astype('{kind}'), so that you know what is judged"
        what = f"{count} of {array.size} numbers are not of that type, such as {array[tuple(place)]!s}{at}: {advice}"
    else:
        what = f"{array[tuple(place)]!s}{at} is no such number"
    raise UsageError(f"must be {kind}, and is {array.dtype}: {what}")


def _dimension_problems(operation: Operation, values: Values) -> Iterator[str]:
    """A sentence for each shape that is another, and for each letter that stands for two numbers."""
    seen: dict[str, tuple[int, str]] = {}
    for port in operation.inputs:
        if port.type in ("int", "float", "stream") or port.name not in values:
            continue
        shape = values[port.name].shape
        wanted = [part.strip() for part in port.shape.strip("()").split(",") if part.strip()]
        if len(shape) != len(wanted):
            yield f"{port.name} has the shape {shape}; it must be {port.shape}"
            continue
        for length, symbol in zip(shape, wanted, strict=True):
            yield from _length_problem(port, shape, length, symbol, seen)


def _length_problem(
    port: Port, shape: tuple[int, ...], length: int, symbol: str, seen: dict[str, tuple[int, str]]
) -> Iterator[str]:
    """What is wrong with one length of a shape, if anything; `seen` has the number and the input of each letter."""
    if symbol.isdigit():
        if length != int(symbol):
            yield f"{port.name} has the shape {shape}; it must be {port.shape}"
        return
    if symbol.endswith(" or 0") and length == 0:
        return
    letter, less = re.fullmatch(r"(\w+)(?:-(\d))?(?: or 0)?", symbol).groups()  # type: ignore[union-attr]
    number = length + int(less or 0)
    known, of = seen.setdefault(letter, (number, f"{port.name} {shape}"))
    if number != known:
        yield f"{letter} is {known} in {of} and {number} in {port.name} {shape}"
