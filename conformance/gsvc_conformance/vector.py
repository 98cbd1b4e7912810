"""Golden vectors on disk: `vectors/<tier>/<operation>/<slug>/manifest.json` and its parts.

A part is an array (``.npy``, little-endian, C order) or a stream (``.gsvc``). Large arrays that repeat themselves are
stored as runs (`runs`). Single numbers among the inputs and texts among the outputs stand in the manifest. `SHA256SUMS`
has every file; `manifest.schema.json` says what a manifest is. An installed kit has them all in one archive, which
stands for the folder wherever a folder is named.
"""

import hashlib
import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.errors import UsageError
from gsvc_base.rendering.error_models import FP32, ErrorModel
from gsvc_conformance.case import Case
from gsvc_conformance.encoding import Task
from gsvc_conformance.expectations import EXPECTATIONS, Bounded, Encoding, Expectation, Rate, Refusal
from gsvc_conformance.level import level_of
from gsvc_conformance.operation import Operation, Values, operations
from gsvc_conformance.profiles import ANY, profile_of
from gsvc_conformance.reading import Archive, Folder, check_size, elements_of, native, parse_json, parse_npy
from gsvc_conformance.runs import pack, unpack
from gsvc_conformance.schema import COUNT, NEEDED, OBJECT, TEXT, TEXTS, Schema, checked, shown

PACKED: Final = Path(__file__).with_name("vectors.zip")
"""The vectors of an installed kit."""
VECTORS: Final = PACKED if PACKED.exists() else Path(__file__).parents[2] / "vectors"
SUMS: Final = "SHA256SUMS"
MANIFEST: Final = "manifest.json"
SPEC_VERSION: Final = "1.0-draft.2"
FIELDS: Final[Schema] = {
    **dict.fromkeys(("id", "tier", "operation", "class", "title", "reason"), (TEXT, NEEDED)), "profile": (TEXT, ANY),
    **dict.fromkeys(("rules", "equations", "flags"), (TEXTS, NEEDED)), "kills": (TEXTS, []), "level": (COUNT, 1),
    "inputs": (OBJECT, NEEDED), "outputs": (OBJECT, NEEDED),
}  # fmt: skip
"""Fields of a manifest that the kit reads."""
OUTPUT: Final[Schema] = {"check": (TEXT, NEEDED)}
CHECK_RULES: Final = {
    "decision": "R-13-2", "bounded": "R-13-3", "interval": "R-13-4", "encoding": "R-13-7", "rate": "R-13-8",
}  # fmt: skip
"""The requirement that each check holds an output against (spec.md section 13.2)."""


@dataclass(frozen=True, eq=False)
class Vector:
    """One vector as it was read: its manifest, the inputs, and what the outputs must be."""

    id: str
    manifest: Mapping[str, Any]
    operation: Operation
    inputs: Values
    expected: Mapping[str, Expectation]

    @property
    def title(self) -> str:
        """A sentence that says what is tested."""
        return str(self.manifest["title"])

    @property
    def tier(self) -> str:
        """``core``, ``uncommon``, ``stress`` or ``faulty``."""
        return self.id.partition("/")[0]

    @property
    def profile(self) -> str:
        """The profile whose claims need the vector, or ``any`` (spec.md section 13.1)."""
        return str(self.manifest.get("profile", ANY))

    @property
    def level(self) -> int:
        """The level of spec.md section 5 from which on a claim needs the vector; 1 for one that is in no folder."""
        return int(self.manifest.get("level", 1))

    def by_model(self, model: ErrorModel) -> "Vector":
        """The vector with the bounds of an error model; files have those of fp32/1."""
        judge = self.operation.by_model
        return (
            self if model is FP32 or judge is None else replace(self, expected=judge(model, self.expected, self.inputs))
        )


def files_of(case: Case, inputs: Values, expected: Mapping[str, Expectation]) -> dict[str, bytes]:
    """The files of a case's vector by name, relative to its folder.

    Parameters
    ----------
    case
        The case.
    inputs, expected
        As `Case.run` returns them.
    """
    files: dict[str, bytes] = {}
    manifest: dict[str, Any] = {
        "id": case.id,
        "spec_version": SPEC_VERSION,
        "profile": profile_of(case.operation, inputs),
        "tier": case.tier,
        "level": level_of(case.operation, inputs),
        "operation": case.operation.name,
        "class": case.operation.group,
        "title": case.title,
        "reason": case.reason,
        "rules": sorted({*case.operation.rules, *case.rules, *_rules(expected)}),
        "equations": sorted({*case.operation.equations, *case.equations}),
        "flags": sorted(case.flags),
        "generator": case.generator,
        "seed": case.seed,
        "inputs": {name: _store(name, value, files) for name, value in inputs.items()},
        "outputs": {name: _expectation(name, value, files) for name, value in expected.items()},
    }
    if case.fault:
        manifest["fault"] = {"lie": case.fault.lie, "truth": case.fault.truth}
    files["manifest.json"] = manifest_bytes(manifest)
    return files


def manifest_bytes(manifest: Mapping[str, Any]) -> bytes:
    """The text of a manifest: a line for each entry, and one for each input and output."""
    lines = []
    for key, value in manifest.items():
        text = json.dumps(value, ensure_ascii=False)
        if isinstance(value, dict) and key in ("inputs", "outputs"):
            entries = (f"  {json.dumps(name)}: {json.dumps(part, ensure_ascii=False)}" for name, part in value.items())
            text = "{\n" + ",\n".join(entries) + "\n }"
        lines.append(f" {json.dumps(key)}: {text}")
    return ("{\n" + ",\n".join(lines) + "\n}\n").encode()


def _rules(expected: Mapping[str, Expectation]) -> Iterator[str]:
    """The requirements that the checks stand for, and those that a faulty stream breaks."""
    for expectation in expected.values():
        if isinstance(expectation, Refusal):
            if expectation.value:
                yield from ("R-12-1", "R-12-2", expectation.value.split()[1])
        elif expectation.check in CHECK_RULES:
            yield CHECK_RULES[expectation.check]


def write(folder: Path, files: Mapping[str, Mapping[str, bytes]]) -> None:
    """Write vectors, by id the files of each, and their sums; `folder` must not hold other files."""
    for name, parts in files.items():
        home = folder / name
        home.mkdir(parents=True, exist_ok=True)
        for part, data in parts.items():
            (home / part).write_bytes(data)
    (folder / SUMS).write_bytes(sums_of(files))


def sums_of(files: Mapping[str, Mapping[str, bytes]]) -> bytes:
    """The contents of SHA256SUMS of these vectors."""
    all_files = {f"{name}/{part}": data for name, parts in files.items() for part, data in parts.items()}
    return "".join(f"{hashlib.sha256(all_files[name]).hexdigest()}  {name}\n" for name in sorted(all_files)).encode()


def set_hash(folder: Path = VECTORS) -> str:
    """The SHA-256 of SHA256SUMS: one number for the whole set."""
    return hashlib.sha256(files_in(folder)[SUMS]).hexdigest()


def files_in(place: Path) -> Folder | Archive:
    """The files of a folder, or of an archive (zip), by their relative names; each is read when it is asked for.

    Raises
    ------
    UsageError
        It is a file and no archive.
    """
    return Archive(place) if place.is_file() else Folder(place)


def load(folder: Path = VECTORS, tiers: tuple[str, ...] = ("core", "uncommon", "stress", "faulty")) -> Iterator[Vector]:
    """All vectors of some tiers, by tier and then by the order of the operations."""
    files = files_in(folder)
    found = sorted(name.split("/") for name in files if name.endswith(f"/{MANIFEST}"))
    for tier in tiers:
        for operation in operations():
            for *home, _ in found:
                if home[:2] == [tier, operation]:
                    yield vector_in(files, "/".join(home))


def read(home: Path) -> Vector:
    """The vector of one folder."""
    return from_files(Folder(home), home)


def vector_in(files: Mapping[str, bytes], name: str) -> Vector:
    """The vector of an id among the files of many."""
    return from_files(_Under(files, f"{name}/"))


def manifests_in(files: Mapping[str, bytes]) -> dict[str, dict[str, Any]]:
    """All manifests among the files of many vectors, by the place of each, which is its id.

    Raises
    ------
    UsageError
        One is not a manifest.
    """
    names = sorted(name for name in files if name.endswith(f"/{MANIFEST}"))
    return {name.removesuffix(f"/{MANIFEST}"): manifest_of(files[name], name) for name in names}


def manifest_of(data: bytes, name: str) -> dict[str, Any]:
    """A manifest from its bytes, with the fields that others read of it.

    Raises
    ------
    UsageError
        It is not one, or a field is missing or of another type; the message names the file.
    """
    try:
        manifest: dict[str, Any] = parse_json(data)
    except ValueError as error:
        raise UsageError(f"{name} cannot be read as JSON: {error}") from None
    checked(manifest, FIELDS, name)
    for kind, entries in (("input", manifest["inputs"]), ("output", manifest["outputs"])):
        for port, entry in entries.items():
            checked(entry, OUTPUT if kind == "output" else {}, f"the {kind} {shown(port)} of {name}")
    return manifest


def from_files(files: Mapping[str, bytes], home: Path | None = None) -> Vector:
    """The vector of some files, by name.

    Parameters
    ----------
    files
        The manifest, and each file that it names.
    home
        Where they lie, for messages; None stands for the id.

    Raises
    ------
    UsageError
        A file is not the one of which the manifest has the SHA-256, or its runs do not fit it.
    """
    manifest = manifest_of(files[MANIFEST], MANIFEST)
    listed = _Listed(files, home or Path(manifest["id"]))
    inputs = {name: _load(listed, entry) for name, entry in manifest["inputs"].items()}
    expected = {name: _expected(listed, entry, inputs) for name, entry in manifest["outputs"].items()}
    return Vector(manifest["id"], manifest, operations()[manifest["operation"]], inputs, expected)


@dataclass
class _Listed:
    """The files of a vector, each of which must be the one that its manifest means.

    Attributes
    ----------
    files, home
        The files by name, and where they lie.
    held
        Bytes of all arrays so far.
    """

    files: Mapping[str, bytes]
    home: Path
    held: int = 0

    def path(self, entry: Mapping[str, Any]) -> Path:
        """Where the file of an entry lies, for messages."""
        return self.home.joinpath(entry["file"])

    def data(self, entry: Mapping[str, Any]) -> bytes:
        """The bytes of the file of an entry.

        Raises
        ------
        UsageError
            They are not those of which the manifest has the SHA-256.
        """
        data = self.files[entry["file"]]
        if not is_listed(data, entry):
            raise UsageError(f"{self.path(entry)} is not the file of which its {MANIFEST} has the SHA-256")
        return data

    def array(self, entry: Mapping[str, Any]) -> NDArray[Any]:
        """The array of an entry.

        Raises
        ------
        UsageError
            It is not one, its runs do not fit, or the arrays of the vector are too large together.
        """
        stored = parse_npy(self.data(entry), str(self.path(entry)))
        count = elements_of(entry["shape"]) if "runs" in entry else stored.size
        self.held += count * stored.itemsize
        check_size(f"{self.home}, with its arrays,", self.held)
        return unpack(stored, entry, self.path(entry)) if "runs" in entry else stored


def is_listed(data: bytes, entry: Mapping[str, Any]) -> bool:
    """Whether some bytes are those of which an entry of a manifest has the SHA-256."""
    return hashlib.sha256(data).hexdigest() == entry.get("sha256")


class _Under(Mapping[str, bytes]):
    """The files below a folder of others."""

    def __init__(self, files: Mapping[str, bytes], folder: str) -> None:
        self._files, self._folder = files, folder

    def __getitem__(self, name: str) -> bytes:
        return self._files[self._folder + name]

    def __iter__(self) -> Iterator[str]:
        return (name.removeprefix(self._folder) for name in self._files if name.startswith(self._folder))

    def __len__(self) -> int:
        return sum(1 for _ in self)


def npy(array: NDArray[Any]) -> bytes:
    """The bytes of an .npy file."""
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.ascontiguousarray(array).reshape(np.shape(array)), allow_pickle=False)
    return buffer.getvalue()


def _little(array: NDArray[Any]) -> NDArray[Any]:
    return array.astype(array.dtype.newbyteorder("<"), copy=False)


def _store(name: str, value: Any, files: dict[str, bytes]) -> dict[str, Any]:
    """Put a value into files or into the manifest; its entry."""
    if isinstance(value, str | int | float) and not isinstance(value, np.generic):
        return {"value": value}
    if isinstance(value, bytes):
        return _file(f"{name}.gsvc", value, files)
    array = _little(np.asarray(value))
    packed = pack(native(array))
    stored = _file(f"{name}.npy", npy(_little(packed.elements if packed else array)), files)
    form = {"dtype": array.dtype.str, "shape": list(array.shape)}
    return {**stored, **form, **(packed.entry if packed else {})}


def _file(name: str, data: bytes, files: dict[str, bytes]) -> dict[str, Any]:
    files[name] = data
    return {"file": name, "sha256": hashlib.sha256(data).hexdigest()}


def _expectation(name: str, expectation: Expectation, files: dict[str, bytes]) -> dict[str, Any]:
    entry: dict[str, Any] = {"check": expectation.check}
    if isinstance(expectation, Refusal):
        return {**entry, "value": expectation.value}
    if isinstance(expectation, Rate):
        return {**entry, "of": expectation.of}
    for part, array in expectation.parts().items():
        entry[part or "expected"] = _store(f"{name}.{part or 'expected'}", array, files)
    if isinstance(expectation, Bounded):
        entry |= {"dtype": expectation.dtype, "groups": [list(g) for g in expectation.groups], "model": FP32.name}
    for number in ("margin", "guard"):
        if getattr(expectation, number, None) is not None:
            entry[number] = getattr(expectation, number)
    return entry


def _load(files: _Listed, entry: Mapping[str, Any]) -> Any:
    if "value" in entry:
        return entry["value"]
    return files.data(entry) if entry["file"].endswith(".gsvc") else files.array(entry)


def _expected(files: _Listed, entry: Mapping[str, Any], inputs: Values) -> Expectation:
    kind = EXPECTATIONS[entry["check"]]
    if kind is Refusal:
        return Refusal(entry["value"])
    if kind is Encoding:
        return Encoding(Task(**inputs))
    if kind is Rate:
        return Rate(entry["of"])
    fields = {"value": _load(files, entry["expected"])}
    for part in ("bound", "alternative", "lowest", "highest"):
        if part in entry:
            fields[part] = _load(files, entry[part])
    if kind is Bounded:
        fields |= {"dtype": entry["dtype"], "groups": tuple((first, end) for first, end in entry["groups"])}
    fields |= {number: entry[number] for number in ("margin", "guard") if number in entry}
    return kind(**fields)
