"""Which vectors to run, and their reading: nothing is run that SHA256SUMS does not list or that was changed since."""

import hashlib
import math
import re
import shlex
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from gsvc_base.errors import UsageError
from gsvc_base.splats import PARAMETERS_PER_SPLAT
from gsvc_conformance.case import FULL, OWN, TIERS
from gsvc_conformance.level import LEVELS
from gsvc_conformance.operation import operations
from gsvc_conformance.profiles import ANY
from gsvc_conformance.reading import MAX_TEXT, check_size, read_json
from gsvc_conformance.schema import cut, shown
from gsvc_conformance.sets import VectorSet, newest, read_sets, withdrawn
from gsvc_conformance.spelling import question
from gsvc_conformance.vector import MANIFEST, PACKED, SUMS, VECTORS, Vector, files_in, from_files, manifest_of

SCHEMA: Final = Path(__file__).with_name("manifest.schema.json")
ALL_TIERS: Final = (*TIERS, FULL, OWN)
SLUG: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*\Z")
"""The last part of an id, which is the name of a folder."""
GIVE: Final = "give a folder that `gsvc-conformance make` wrote, or leave it out for the vectors of the kit"
VECTORS_FOLDER: Final = "vectors"
"""The folder of the vectors in a checkout."""
MAX_NAMED: Final = 4
"""Maximum number of selected names that are listed; more are counted."""

Wanted = int | Literal["newest", "all"]
"""The set that is wanted: a number, the newest one, or all vectors of a folder, also those that no set lists yet."""


@dataclass(frozen=True)
class Selection:
    """A selection of vectors: all kinds must hold, each by any of its values; an empty tuple selects everything.

    A pattern of a case is matched with the whole id and with its last part. Rules, equations and flags stand in
    manifests, and so does the profile: of those of a profile and those of any. Of each operation that has such, the
    first one of another profile is selected, too, which is to be refused (R-13-5).
    """

    tiers: tuple[str, ...] = ()
    operations: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    patterns: tuple[str, ...] = ()
    rules: tuple[str, ...] = ()
    equations: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()
    profile: str = ""

    def holds(self, name: str) -> bool:
        """Whether a vector is selected, as far as its id tells."""
        tier, operation, slug = name.split("/")
        return (
            (not self.tiers or tier in self.tiers)
            and (not self.operations or operation in self.operations)
            and (not self.groups or operations()[operation].group in self.groups)
            and (not self.patterns or matches(name, slug, patterns=self.patterns))
        )

    @property
    def of_manifests(self) -> dict[str, tuple[str, ...]]:
        """The values to look up in manifests, by the name of the field."""
        kinds = {"rules": self.rules, "equations": self.equations, "flags": self.flags}
        return {field: values for field, values in kinds.items() if values}

    @property
    def whole(self) -> bool:
        """Whether all vectors of the classes are selected that any vector is selected of."""
        return not (self.tiers or self.operations or self.patterns or self.of_manifests)

    def __str__(self) -> str:
        kinds = {"tier": self.tiers, "operation": self.operations, "class": self.groups, "case": self.patterns,
                 "rule": self.rules, "equation": self.equations, "flag": self.flags}  # fmt: skip
        return ", ".join(_named(kind, values) for kind, values in kinds.items() if values)


def _named(kind: str, values: tuple[str, ...]) -> str:
    """Values by name, or their number if they are many."""
    return (
        f"{kind} {' or '.join(values)}"
        if len(values) <= MAX_NAMED
        else f"{len(values)} {kind}{'es' if kind.endswith('s') else 's'}"
    )


def matches(*names: str, patterns: tuple[str, ...]) -> bool:
    """Whether one of some names matches one of some patterns."""
    return any(fnmatchcase(name, pattern) for name in names for pattern in patterns)


class VectorFolder:
    """The vectors of a folder, as its SHA256SUMS lists them.

    Parameters
    ----------
    folder
        With ``<tier>/<operation>/<slug>/manifest.json``, SHA256SUMS and, unless they are somebody's own,
        ``sets/<number>.txt``; or an archive (zip) of such a folder.
    wanted
        The set whose vectors alone are here. ``newest`` means all vectors where the folder has no sets.

    Attributes
    ----------
    names
        The ids, by tier and then by the order of the operations; withdrawn vectors belong to sets alone.
    set
        The set that they are; None for all vectors.

    Raises
    ------
    UsageError
        There are no vectors, or some of an operation that this kit does not know, or there is no such set.
    """

    def __init__(self, folder: Path, wanted: Wanted = "all") -> None:
        self.folder = folder
        self._files = files_in(folder)
        try:
            check_size(str(folder / SUMS), self._files.size(SUMS), MAX_TEXT)
        except KeyError:
            raise UsageError(_no_vectors(folder)) from None
        sums = self._files[SUMS]
        self._hash = hashlib.sha256(sums).hexdigest()
        try:
            lines = sums.decode().splitlines()
            self._sums = {name: digest for digest, name in (line.split("  ") for line in lines)}
        except ValueError:
            raise UsageError(
                f"{folder / SUMS} is damaged: its lines are HASH, two spaces, NAME; {_mended(folder)}"
            ) from None
        self._parts: dict[str, list[str]] = {}
        for name in self._sums:
            self._parts.setdefault(name.rpartition("/")[0], []).append(name.rpartition("/")[2])
        for name in self._parts:
            parts = name.split("/")
            known = len(parts) == 3 and parts[0] in ALL_TIERS and parts[1] in operations() and SLUG.match(parts[2])
            if not known:
                raise UsageError(
                    f"{name} is a vector of a tier or operation that this kit does not know: use the same version of "
                    "the kit and of the vectors"
                )
        sets = read_sets(self._files)
        self.set = self._chosen(sets, wanted)
        place = {operation: index for index, operation in enumerate(operations())}
        self.names = sorted(
            self.set.digests if self.set else self._parts.keys() - withdrawn(sets),
            key=lambda n: (ALL_TIERS.index(n.split("/")[0]), place[n.split("/")[1]], n),
        )

    def _chosen(self, sets: Mapping[int, VectorSet], wanted: Wanted) -> VectorSet | None:
        """The set that is wanted, all of whose vectors must be there.

        Raises
        ------
        UsageError
            There is no such set, or a vector of it is missing.
        """
        if wanted == "all":
            return None
        if isinstance(wanted, int) and wanted not in sets:
            known = f"its sets are {', '.join(map(str, sets))}" if sets else "it has none: leave out --set"
            raise UsageError(f"{self.folder} has no set {wanted}; {known}")
        chosen = newest(sets) if wanted == "newest" else sets[wanted]
        if chosen and (gone := sorted(chosen.digests.keys() - self._parts.keys())):
            raise UsageError(f"{self.folder} lacks {gone[0]} of set {chosen.number}; {_mended(self.folder)}")
        return chosen

    @property
    def sha256(self) -> str:
        """The SHA-256 of the list of the set; of SHA256SUMS where these are all vectors of a folder."""
        return self.set.sha256 if self.set else self._hash

    def select(self, selection: Selection) -> list[str]:
        """The ids that are selected, by tier and then by the order of the operations.

        Raises
        ------
        UsageError
            None is: running nothing must not look like success.
        """
        self.check_patterns("--case ", selection.patterns)
        if FULL in selection.tiers and not any(name.startswith(f"{FULL}/") for name in self.names):
            raise UsageError(f"{self.folder} has no vectors of the tier {FULL}: write them with "
                             "gsvc-conformance generate --full DIR, then add --vectors DIR")  # fmt: skip
        if OWN in selection.tiers and not any(name.startswith(f"{OWN}/") for name in self.names):
            raise UsageError(f"{self.folder} has no vectors of the tier {OWN}: make them with "
                             "gsvc-conformance make OPERATION INPUTS DIR, then add --vectors DIR")  # fmt: skip
        chosen = [name for name in self.names if selection.holds(name)]
        for field, values in selection.of_manifests.items():
            chosen = self._having(field, values, chosen)
        if selection.profile:
            chosen = self._of_profile(selection.profile, chosen)
        if chosen:
            return chosen
        what = f"no vector is selected by {selection}" if self.names else f"{self.folder} lists no vectors"
        raise UsageError(f"{what}; see gsvc-conformance list --cases")

    def _of_profile(self, profile: str, names: list[str]) -> list[str]:
        """Those of a profile and of any, and of each operation of that profile the first one of another."""
        stated = {name: self.manifest(name).get("profile", ANY) for name in names}
        shared = {name.split("/")[1] for name in names if stated[name] == profile}
        others: dict[str, str] = {}
        for name in names:
            if stated[name] not in (ANY, profile):
                others.setdefault(name.split("/")[1], name)
        foreign = {name for operation, name in others.items() if operation in shared}
        return [name for name in names if stated[name] in (ANY, profile) or name in foreign]

    def check_patterns(self, before: str, patterns: tuple[str, ...]) -> None:
        """Refuse a pattern that no vector of the folder matches: it is mistyped.

        Parameters
        ----------
        before
            What stands before each in a command, such as ``--case`` and a space.
        patterns
            The patterns.

        Raises
        ------
        UsageError
            There is one, and what may be meant.
        """
        for pattern in patterns if self.names else ():
            if not any(matches(name, name.split("/")[2], patterns=(pattern,)) for name in self.names):
                near = question(pattern, [*self.names, *(name.split("/")[2] for name in self.names)])
                raise UsageError(f"no vector matches {before}{pattern}{near or '; see: gsvc-conformance list --cases'}")

    def _having(self, field: str, values: tuple[str, ...], names: list[str]) -> list[str]:
        """The vectors whose manifests have one of some values in a field; each value must be that of some vector."""
        has = {name: self.manifest(name)[field] for name in self.names}
        known = dict.fromkeys(value for found in has.values() for value in found)
        for value in values:
            if value not in known:
                near = question(value, known) or "; gsvc-conformance list --json shows those of each vector"
                raise UsageError(f"no vector has {value} among its {field}{near}")
        return [name for name in names if not set(values).isdisjoint(has[name])]

    def killed_by(self, names: Iterable[str]) -> set[str]:
        """The mutants that the manifests of some vectors say to find."""
        return {mutant for name in names for mutant in self.manifest(name).get("kills", ())}

    def read(self, names: list[str]) -> Iterator[Vector]:
        """Vectors by id, each when it is asked for.

        Raises
        ------
        UsageError
            A file is missing, was changed or is damaged, or a manifest is none that this kit knows.
        """
        for name in names:
            manifest = self.manifest(name)
            with _damaged(self.folder / name, _mended(self.folder, name)):
                check_manifest(name, manifest)
                if self.set:
                    self.set.check(name, manifest)
                vector = self._vector(name)
                for port, value in vector.inputs.items():
                    if (
                        not isinstance(value, np.ndarray | int | float | bytes)
                        or np.asarray(value).dtype.kind not in "uifS"
                    ):
                        raise TypeError(f"the input {port} is not an array of numbers")
            yield vector

    def _vector(self, name: str) -> Vector:
        """A vector, all of whose files are those of SHA256SUMS and of its manifest.

        Raises
        ------
        UsageError
            One is not.
        """
        try:
            there = sum(self._size(f"{name}/{part}") for part in self._parts[name])
            check_size(f"all of {self.folder / name} together", there)
            files = {part: self._file(f"{name}/{part}") for part in self._parts[name]}
            return from_files(files, self.folder / name)
        except UsageError as error:
            advice = _mended(self.folder, name)
            raise UsageError(str(error) if advice in str(error) else f"{error}; {advice}") from None

    def manifest(self, name: str) -> Mapping[str, Any]:
        """The manifest of a vector, of which nothing is checked but that it is the file that SHA256SUMS lists.

        Raises
        ------
        UsageError
            It is missing, was changed or is damaged.
        """
        if name not in self._parts:
            raise UsageError(f"there is no vector {name} in {self.folder}; gsvc-conformance list --cases names all")
        if MANIFEST not in self._parts[name]:
            raise UsageError(f"{self.folder / SUMS} lists no {name}/{MANIFEST}; {_mended(self.folder, name)}")
        data = self._file(f"{name}/{MANIFEST}")
        try:
            return manifest_of(data, MANIFEST)
        except UsageError as error:
            raise UsageError(
                f"the vector {self.folder / name} cannot be read: {error}; {_mended(self.folder, name)}"
            ) from None

    def input_size(self, name: str) -> int:
        """The bytes of a vector's inputs as `operation.input_size` counts them, by its manifest and the sizes of files.

        It is 0 if these are damaged; reading the vector says so.
        """
        try:
            return sum(self._bytes_of(name, entry) for entry in self.manifest(name)["inputs"].values())
        except Exception:  # a hostile manifest may raise anything
            return 0

    def work(self, name: str) -> int:
        """About how much a vector asks for, by its manifest: pairs of a pixel and a splat, and what goes in and out.

        It is 0 if that is damaged; reading the vector says so.
        """
        try:
            manifest = self.manifest(name)
            shapes = [entry.get("shape", ()) for entry in manifest["inputs"].values()]
            shapes += [entry.get("expected", {}).get("shape", ()) for entry in manifest["outputs"].values()]
            pixels = max((math.prod(shape[:-1]) for shape in shapes if len(shape) > 2), default=0)
            splats = max((shape[0] for shape in shapes if shape[1:] == [PARAMETERS_PER_SPLAT]), default=0)
            return pixels * splats + self.input_size(name) + sum(map(math.prod, shapes))
        except Exception:  # a hostile manifest may raise anything
            return 0

    def _bytes_of(self, name: str, entry: Mapping[str, Any]) -> int:
        """The bytes of one input: a number, an array or a stream."""
        if "file" not in entry:
            return 8
        if "shape" in entry:
            return int(math.prod(entry["shape"]) * np.dtype(entry["dtype"]).itemsize)
        return self._files.size(f"{name}/{entry['file']}")

    def _size(self, name: str) -> int:
        try:
            return self._files.size(name)
        except KeyError:
            raise UsageError(f"{self.folder / name} is missing; {_mended(self.folder, name)}") from None

    def _file(self, name: str) -> bytes:
        try:
            data = self._files[name]
        except KeyError:
            raise UsageError(f"{self.folder / name} is missing; {_mended(self.folder, name)}") from None
        if hashlib.sha256(data).hexdigest() != self._sums[name]:
            raise UsageError(f"{self.folder / name} is not the file that {SUMS} lists; {_mended(self.folder, name)}")
        return data


def _mended(folder: Path, name: str = "") -> str:
    """What to do about damaged vectors, or about the one to which a file or an id belongs."""
    if folder == PACKED:
        return "install gsvc-conformance again"
    if folder == VECTORS:
        return "write them with: gsvc-conformance generate"
    if name.startswith(f"{OWN}/"):
        _, operation, slug, *_ = name.split("/")
        there = shlex.quote(str(folder))
        return f"make it again with: gsvc-conformance make {operation} INPUTS {there} --id {slug} --replace"
    return "the vectors are damaged: unpack, copy or make them again"


def _no_vectors(folder: Path) -> str:
    """A sentence about a folder that has no vectors, and what to do."""
    if folder in (PACKED, VECTORS):
        return f"there are no vectors in {folder} (no {SUMS}); {_mended(folder)}"
    if not folder.exists():
        return f"there is no folder {folder}; {GIVE}"
    if (below := folder / VECTORS_FOLDER / SUMS).is_file():
        return f"there are no vectors in {folder} (no {SUMS}); did you mean {below.parent}?"
    return f"there are no vectors in {folder} (no {SUMS}); {GIVE}"


@contextmanager
def _damaged(vector: Path, advice: str) -> Iterator[None]:
    """Say of which vector it is that a file cannot be understood, whatever is wrong with it.

    Raises
    ------
    UsageError
        It cannot.
    """
    try:
        yield
    except UsageError:
        raise
    except OSError:
        raise
    except Exception as error:  # a hostile manifest may raise anything
        raise UsageError(f"the vector {vector} cannot be read ({type(error).__name__}: {error}); {advice}") from None


@cache
def _schema() -> Mapping[str, Any]:
    schema: Mapping[str, Any] = read_json(SCHEMA)
    return schema


def check_manifest(name: str, manifest: Mapping[str, Any]) -> None:
    """Refuse fields that this kit does not know, it might judge without what they say, and names of other ports.

    Names of inputs and outputs become names of files. `verify` holds manifests against the whole schema.

    Raises
    ------
    UsageError
        The manifest has an unknown field or check, is not that of the vector, or has not the ports of its operation.
    """
    kinds = _schema()["$defs"]
    problems = [f"the field {field}" for field in manifest.keys() - _schema()["properties"].keys()]
    known = {field for kind in ("number", "stream", "array") for field in kinds[kind]["properties"]}
    for port, entry in manifest["inputs"].items():
        problems += [f"the field {field} of {port}" for field in entry.keys() - known]
    for port, entry in manifest["outputs"].items():
        kind = kinds.get(entry["check"], {}).get("properties", {})
        problems += [
            f"the field {field} of {port} (check {cut(entry['check'])})" for field in entry.keys() - kind.keys()
        ]
    if problems:
        raise UsageError(f"the manifest of {name} has {', '.join(sorted(problems))}, which this kit does "
                        "not know: use the same version of the kit and of the vectors")  # fmt: skip
    if manifest["tier"] != name.split("/")[0] or manifest["level"] not in LEVELS:
        raise UsageError(f"the manifest of {name} has the tier {shown(manifest['tier'])}, which must be the first part "
                         f"of the id, and the level {manifest['level']}, of 1 to {max(LEVELS)}")  # fmt: skip
    if manifest["id"] != name or manifest["operation"] != name.split("/")[1]:
        raise UsageError(f"the manifest of {name} is that of {manifest['id']}, operation {manifest['operation']}")
    operation = operations()[name.split("/")[1]]
    for kind, ports in (("inputs", operation.inputs), ("outputs", operation.outputs)):
        if (found := set(manifest[kind])) != (known := {port.name for port in ports}):
            raise UsageError(f"the manifest of {name} has the {kind} {', '.join(sorted(found))}; those of "
                             f"{operation.name} are {', '.join(sorted(known))}")  # fmt: skip
