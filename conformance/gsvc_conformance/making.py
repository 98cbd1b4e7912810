"""Vectors from somebody's own inputs: what the outputs must be, and a folder of such vectors that `run` judges.

    vector = make_vector("render_sum", {"parameters": splats, "width": 64, "height": 48}, id="my_five_splats")
    add_vectors("own", [vector])                    # then: gsvc-conformance run --vectors own --module mine

The oracles are those of the golden vectors. They need gsvc_ref (``gsvc-conformance[reference]``).
"""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from gsvc_base.errors import UsageError
from gsvc_base.folders import OwnFolder
from gsvc_conformance.case import OWN, Case
from gsvc_conformance.case import Inputs as CaseInputs
from gsvc_conformance.expectations import Bounded, Expectation
from gsvc_conformance.fitting import fit
from gsvc_conformance.operation import Operation, Values, operations
from gsvc_conformance.preconditions import broken
from gsvc_conformance.reading import MAX_TEXT
from gsvc_conformance.spelling import question
from gsvc_conformance.vector import SUMS, Vector, files_of, from_files, manifest_bytes
from gsvc_conformance.vector_folder import SLUG, VectorFolder

GENERATOR: Final = "gsvc_conformance/making.py:make_vector"
DIGITS: Final = 12
"""Digits of the hash that names a vector without a name."""
INFINITE: Final = ("metrics", "psnr")
"""The one output, by operation and name, that may have to be infinite."""


@dataclass(frozen=True, eq=False)
class OwnVector(Vector):
    """A vector that somebody made.

    Attributes
    ----------
    files
        Its files by name, relative to its folder: the manifest and what it names.
    """

    files: Mapping[str, bytes]


def make_vector(
    operation: str,
    inputs: Mapping[str, Any],
    *,
    title: str | None = None,
    id: str | None = None,
    mutants: bool = False,
) -> OwnVector:
    """The vector of an operation and some inputs: expected values, bounds and manifest.

    Parameters
    ----------
    operation
        The name of an operation of spec.md section 4.3.
    inputs
        Its inputs by name: arrays, numbers, bytes for streams. Types and shapes are those of section 4.3; numbers are
        converted only where none changes.
    title
        A sentence that says what the vector shows; None: its dimensions in words.
    id
        The last part of its id, or all of it: ``own/OPERATION/NAME``. None: a hash of the inputs.
    mutants
        Whether the manifest says which mutants the vector finds, which takes some seconds.

    Raises
    ------
    UsageError
        There is no such operation, the inputs do not fit it, they break its preconditions, or the id is none.

    Examples
    --------
    >>> import numpy as np
    >>> from gsvc_conformance import judge, make_vector
    >>> vector = make_vector("from_half", {"bits": np.array([0x3C00, 0xC000], "u2")}, id="two")
    >>> vector.id, vector.expected["values"].value.tolist()
    ('own/from_half/two', [1.0, -2.0])
    >>> judge(vector, {"values": np.array([1, -2], "f4")}).passed
    True
    """
    if operation not in operations():
        near = question(operation, operations()) or f"; the operations are {', '.join(operations())}"
        raise UsageError(f"there is no operation {operation!r}{near}")
    asked = operations()[operation]
    values = fit(asked, inputs)
    if problems := broken(asked, values):
        raise UsageError(f"{operation} is not defined for these inputs (spec.md section 4.3): {'; '.join(problems)}")
    case = _case(asked, _slug(asked, values, id), title or words_of(asked, values))
    files = files_of(case, values, _expected(asked, values))
    vector = from_files(files)
    if mutants:
        from gsvc_conformance.mutants import MUTANTS, killed_by

        manifest = {**vector.manifest, "kills": killed_by([vector], MUTANTS)[vector.id]}
        files["manifest.json"] = manifest_bytes(manifest)
        vector = from_files(files)
    return OwnVector(vector.id, vector.manifest, vector.operation, vector.inputs, vector.expected, files)


def _case(operation: Operation, slug: str, title: str) -> Case:
    """The case that `files_of` asks for; its function is not called."""

    def function() -> CaseInputs:
        yield {}

    name = f"{OWN}/{operation.name}/{slug}"
    return Case(name, OWN, operation, title, "", (), (), (), None, GENERATOR, function, {})


def _slug(operation: Operation, values: Values, name: str | None) -> str:
    """The last part of a vector's id.

    Raises
    ------
    UsageError
        The name is no such part.
    """
    if name is None:
        return _digest(values)
    slug = name.removeprefix(f"{OWN}/{operation.name}/")
    if not SLUG.match(slug):
        raise UsageError(f"{name!r} names no vector: use letters, digits, and _ . - behind the first, such as "
                         f"my_five_splats, or {OWN}/{operation.name}/my_five_splats")  # fmt: skip
    return slug


def _digest(values: Values) -> str:
    digest = hashlib.sha256()
    for name, value in values.items():
        data = value if isinstance(value, bytes) else np.asarray(value)
        digest.update(f"{name} {getattr(data, 'dtype', '')} {np.shape(value)} ".encode())
        digest.update(data if isinstance(data, bytes) else data.tobytes())
    return digest.hexdigest()[:DIGITS]


def words_of(operation: Operation, values: Values) -> str:
    """Inputs in words: their dimensions, the numbers among them, and the bytes of streams."""
    dimensions: dict[str, int] = {}
    parts = []
    for port in operation.inputs:
        value = values[port.name]
        if isinstance(value, bytes):
            parts.append(f"{port.name} of {len(value)} bytes")
        elif isinstance(value, np.ndarray):
            symbols = [part.strip() for part in port.shape.strip("()").split(",")]
            dimensions.update({s: n for s, n in zip(symbols, value.shape, strict=False) if s.isalpha()})
        else:
            parts.append(f"{port.name} = {value:g}" if isinstance(value, float) else f"{port.name} = {value}")
    return "Own inputs: " + ", ".join([*(f"{letter} = {n}" for letter, n in dimensions.items()), *parts])


def _expected(operation: Operation, values: Values) -> Mapping[str, Expectation]:
    """The oracle's answer.

    Raises
    ------
    UsageError
        The outputs are not determined, or not finite.
    """
    try:
        with np.errstate(all="ignore"):
            expected = operation.oracle(**values)
    except ValueError as error:  # the oracles say so of inputs that lie on an edge
        raise UsageError(
            f"{operation.name} has no certain answer to these inputs: {error}; move them a little"
        ) from None
    except MemoryError:
        raise UsageError(
            f"there is not the memory to compute what {operation.name} must give: take smaller inputs"
        ) from None
    for name, output in expected.items():
        wrong = isinstance(output, Bounded) and not np.isfinite(output.value).all()
        if wrong and (operation.name, name) != INFINITE:
            raise UsageError(f"{operation.name} is not defined for these inputs: its output {name} leaves the range of "
                             "its numbers")  # fmt: skip
    return expected


class TakenError(UsageError):
    """A folder has vectors of these ids already.

    Attributes
    ----------
    taken
        The folder and an id, the beginning of a sentence.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self.taken = f"{folder} has a vector {name} already"
        super().__init__(f"{self.taken}: make it with another id=, or add it with replace=True")


def add_vectors(folder: str | Path, vectors: Iterable[OwnVector], *, replace: bool = False) -> None:
    """Write vectors into a folder of own ones, which is made if it is not there, and keep its SHA256SUMS true.

    Parameters
    ----------
    folder
        With vectors of the tier ``own`` only, or none.
    vectors
        What to add, each of `make_vector`.
    replace
        Whether one with the id of another takes its place.

    Raises
    ------
    UsageError
        An argument is of a wrong type; the folder holds something else or is damaged.
    TakenError
        The folder has a vector of that id, or two vectors have one id, and `replace` is not given. Nothing was written.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from gsvc_conformance import add_vectors, make_vector, vectors
    >>> folder = tempfile.mkdtemp()
    >>> add_vectors(folder, [make_vector("from_half", {"bits": np.zeros(3, "u2")}, id="zeros")])
    >>> [vector.id for vector in vectors(folder=folder)]
    ['own/from_half/zeros']
    """
    if not isinstance(folder, str | Path):
        raise UsageError(f"folder is of the type {type(folder).__name__}; it must be a str or a Path")
    folder, vectors = Path(folder), _vectors(vectors)
    with OwnFolder(folder, mode=0o755, group=True, parents=True) as own:
        _write(own, vectors, replace=replace)


def _write(own: OwnFolder, vectors: list[OwnVector], *, replace: bool) -> None:
    """Write vectors into an opened folder."""
    folder, sums = own.path, _sums(own)
    taken = {name.rpartition("/")[0] for name in sums}
    for vector in vectors:
        if vector.id in taken and not replace:
            raise TakenError(folder, vector.id)
        taken.add(vector.id)
    for vector in vectors:
        for name in [name for name in sums if name.startswith(f"{vector.id}/")]:
            own.remove(name)
            del sums[name]
        for part, data in vector.files.items():
            own.write(f"{vector.id}/{part}", data)
            sums[f"{vector.id}/{part}"] = hashlib.sha256(data).hexdigest()
    own.write(SUMS, "".join(f"{sums[name]}  {name}\n" for name in sorted(sums)).encode())


def _vectors(given: Iterable[OwnVector]) -> list[OwnVector]:
    """A list of vectors.

    Raises
    ------
    UsageError
        It is something else.
    """
    if isinstance(given, Vector) or not isinstance(given, Iterable):
        raise UsageError(f"vectors is of the type {type(given).__name__}; it must be a list: [vector]")
    vectors = list(given)
    for vector in vectors:
        if not isinstance(vector, OwnVector):
            raise UsageError(f"vectors has a {type(vector).__name__}; each must be a vector of make_vector")
    return vectors


def _sums(own: OwnFolder) -> dict[str, str]:
    """The hash of each file that a folder of own vectors lists.

    Raises
    ------
    UsageError
        It holds something else, or is damaged.
    """
    folder, names = own.path, own.names()
    if SUMS not in names:
        if names:
            raise UsageError(f"{folder} is not empty and holds no vectors (no {SUMS}): give a new folder")
        return {}
    there = VectorFolder(folder)
    if foreign := [name for name in there.names if not name.startswith(f"{OWN}/")]:
        raise UsageError(f"{folder} has vectors that are not yours, such as {foreign[0]}: give a folder of your own")
    lines = own.read(SUMS, MAX_TEXT).decode().splitlines()
    return {name: digest for digest, name in (line.split("  ") for line in lines)}
