"""Sets of vectors: numbered lists of ids, each with a digest of what is judged, which never change.

``vectors/sets/N.txt`` has a line ``ID DIGEST`` for each vector of the set N, by id. A verdict names N and the SHA-256
of that file. A vector that is found wrong is *withdrawn*: the next set leaves it out, older sets keep it, and its id
is never used again.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from gsvc_base.errors import UsageError
from gsvc_conformance.reading import MAX_TEXT, check_size

FOLDER: Final = "sets"
JUDGED: Final = ("operation", "inputs", "outputs")
"""Entries of a manifest that say what is judged, with the hashes of its files; others may be worded anew."""
HASH_DIGITS: Final = 8
"""Digits of a hash that verdicts quote."""
NAMED: Final = 3
"""Maximum number of vectors that a message names."""


@dataclass(frozen=True)
class VectorSet:
    """A set as its file lists it.

    Attributes
    ----------
    number
        From 1.
    digests
        The digest of each vector, by its id.
    sha256
        The SHA-256 of the file.
    """

    number: int
    digests: Mapping[str, str]
    sha256: str

    def check(self, name: str, manifest: Mapping[str, Any]) -> None:
        """Refuse a manifest that is not the one that the set means by an id.

        Raises
        ------
        UsageError
            It is not.
        """
        if digest(manifest) != self.digests[name]:
            raise UsageError(f"{name} is not the vector that set {self.number} lists by this name: take vectors and "
                             "sets of one version")  # fmt: skip


def quoted(number: str, sha256: str) -> str:
    """Vectors as verdicts name them: by the number of their set, '' if they are none, and a hash."""
    return f"{f'GSVC vectors {number}' if number else 'vectors of no set'} (sha256 {sha256[:HASH_DIGITS]}…)"


def digest(manifest: Mapping[str, Any]) -> str:
    """The digest of what a manifest says to judge."""
    judged = {field: manifest[field] for field in JUDGED}
    text = json.dumps(judged, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def list_of(digests: Mapping[str, str]) -> bytes:
    """The contents of the file of a set."""
    return "".join(f"{name} {digests[name]}\n" for name in sorted(digests)).encode()


def read_sets(files: Mapping[str, bytes]) -> dict[int, VectorSet]:
    """The sets among the files of a folder of vectors, by number; none in a folder of somebody's own.

    Raises
    ------
    UsageError
        A file of them is damaged.
    """
    names = [name for name in files if name.startswith(f"{FOLDER}/") and name.endswith(".txt")]
    found = {}
    for name in names:
        try:
            number = int(Path(name).stem)
            check_size(name, len(files[name]), MAX_TEXT)
            lines = files[name].decode().splitlines()
            digests = dict(line.split(" ") for line in lines)
        except ValueError:
            raise UsageError(f"{name} is damaged: it must be NUMBER.txt, with lines ID, a space, DIGEST") from None
        found[number] = VectorSet(number, digests, hashlib.sha256(files[name]).hexdigest())
    return dict(sorted(found.items()))


def newest(sets: Mapping[int, VectorSet]) -> VectorSet | None:
    """The set with the highest number, if there is one."""
    return sets[max(sets)] if sets else None


def withdrawn(sets: Mapping[int, VectorSet]) -> set[str]:
    """The ids that the newest set no longer lists."""
    last = newest(sets)
    return {name for one in sets.values() for name in one.digests} - (last.digests.keys() if last else set())


def changed(sets: Mapping[int, VectorSet], manifests: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """A sentence for each manifest that is not the one that a set means by its id."""
    for name, manifest in manifests.items():
        now = digest(manifest)
        for one in sets.values():
            if one.digests.get(name, now) != now:
                yield f"{name} is not what set {one.number} means by this name, which never changes"


def missing(sets: Mapping[int, VectorSet], names: Iterable[str]) -> Iterator[str]:
    """A sentence for each vector of a set that is not there."""
    there = set(names)
    for one in sets.values():
        yield from (f"{name} of set {one.number} is missing" for name in one.digests if name not in there)


def check_made(sets: Mapping[int, VectorSet], manifests: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse vectors that cases make if an id means another one than in a set, or was withdrawn.

    Raises
    ------
    UsageError
        There is one, and which.
    """
    gone = withdrawn(sets)
    again = (f"{name} was withdrawn, and its id is never used again" for name in manifests if name in gone)
    if problems := [*changed(sets, manifests), *again]:
        more = f", and {len(problems) - NAMED} more" if len(problems) > NAMED else ""
        raise UsageError(f"{'; '.join(problems[:NAMED])}{more}: give the case another name")


def next_list(sets: Mapping[int, VectorSet], manifests: Mapping[str, Mapping[str, Any]]) -> tuple[int, bytes]:
    """The number and the contents of the set that comes next, of the vectors that cases make.

    Raises
    ------
    UsageError
        The newest set has just these, or `check_made` refuses one.
    """
    check_made(sets, manifests)
    digests = {name: digest(manifest) for name, manifest in manifests.items()}
    last = newest(sets)
    if last and last.digests == digests:
        raise UsageError(f"set {last.number} has just these vectors: there is nothing new to list")
    return (last.number if last else 0) + 1, list_of(digests)
