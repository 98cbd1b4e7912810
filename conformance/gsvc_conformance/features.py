"""What an implementation is made for, as its features.toml says, and what of that a vector needs (protocol.md)."""

from collections.abc import Callable, Container, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Final, get_args

from gsvc_base.cli.text import plural
from gsvc_base.errors import UsageError
from gsvc_conformance.claim import Claim
from gsvc_conformance.level import LEVELS, splat_counts
from gsvc_conformance.operation import Group, Operation, is_needed, operations
from gsvc_conformance.profiles import ANY, PROFILES, stated_profile
from gsvc_conformance.reading import read_toml
from gsvc_conformance.schema import shown
from gsvc_conformance.spec import header_rows, namespace
from gsvc_conformance.spelling import question
from gsvc_conformance.vector import Vector

MOST_SPLATS: Final = 1 << 32
"""No frame has so many splats: a `uv` cannot say it."""


@dataclass(frozen=True)
class Features:
    """What an implementation is made for; None is no limit.

    Attributes
    ----------
    profiles
        Names of profiles.
    level
        The highest level of spec.md section 5.
    bit_depths, lanes
        The values of `bit_depth` and of `lane_count`.
    max_splats
        The largest number of splats of a frame.
    classes, operations
        Classes of conformance, and operations besides those of these classes.
    """

    profiles: tuple[str, ...] | None = None
    level: int | None = None
    bit_depths: tuple[int, ...] | None = None
    lanes: tuple[int, ...] | None = None
    max_splats: int | None = None
    classes: tuple[str, ...] | None = None
    operations: tuple[str, ...] | None = None

    def outside(self, vector: Vector) -> str:
        """What a vector needs beside these features, such as ``bit depth 10, 64 lanes``; empty if it needs nothing."""
        return ", ".join(self._beside(vector))

    def _beside(self, vector: Vector) -> Iterator[str]:
        if not self._has(vector.operation):
            yield f"the operation {vector.operation.name}"
        if self.profiles is not None and (profile := vector.manifest.get("profile", ANY)) not in (ANY, *self.profiles):
            yield f"profile {profile}"
        if self.level is not None and vector.level > self.level:
            yield f"level {vector.level}"
        if self.bit_depths is not None:
            yield from (f"bit depth {depth}" for depth in _numbers(vector, "bit_depth") if depth not in self.bit_depths)
        if self.lanes is not None:
            yield from (plural(lanes, "lane") for lanes in _numbers(vector, "lane_count") if lanes not in self.lanes)
        if self.max_splats is not None and most_splats(vector) > self.max_splats:
            yield f"more than {plural(self.max_splats, 'splat')}"

    def _has(self, operation: Operation) -> bool:
        if self.classes is None and self.operations is None:
            return True
        return is_needed(operation, self.classes or ()) or operation.name in (self.operations or ())

    def check_claim(self, claim: Claim) -> None:
        """Refuse a claim that needs more or less than these features.

        Raises
        ------
        UsageError
            It does.
        """
        wanted = {"profiles": (claim.profile,), "level": claim.level}
        wrong = [
            name for name, value in self.to_object().items()
            if name not in ("classes", "operations") and value != _plain(wanted.get(name))
        ]  # fmt: skip
        if not all(map(self._has, (about for about in operations().values() if is_needed(about, claim.judged)))):
            wrong.append("operations" if self.classes is None else "classes")
        if wrong:
            raise UsageError(
                f"--claim {claim} and {', '.join(wrong)} of --features do not agree: a claim needs all vectors of its "
                f"classes, profile and level (R-13-1), and none above; leave out one of the two"
            )

    def to_object(self) -> dict[str, Any]:
        """The keys of the file that are there, for JSON."""
        return {name: _plain(value) for name, value in asdict(self).items() if value is not None}

    def __str__(self) -> str:
        words = {
            "profiles": "profile", "level": "level", "bit_depths": "bit depth", "lanes": "lanes",
            "max_splats": "splats at most", "classes": "class", "operations": "operation",
        }  # fmt: skip
        return "; ".join(f"{words[name]} {_words(value)}" for name, value in self.to_object().items()) or "everything"


def read_features(path: Path) -> Features:
    """The features of a file features.toml.

    Raises
    ------
    UsageError
        It is not TOML, or has keys or values that are none.
    """
    return features_of(read_toml(path), str(path))


def features_of(values: Mapping[str, Any], source: str) -> Features:
    """The features that values by key are.

    Parameters
    ----------
    values
        As TOML or JSON has them.
    source
        Where they stand, for messages.

    Raises
    ------
    UsageError
        A key or a value is none.
    """
    names = [field.name for field in fields(Features)]
    for name in values:
        if name not in names:
            near = question(name, names) or f"; the keys are {', '.join(names)}"
            raise UsageError(f"{source} has the key {shown(name)}{near}")
    return Features(**{name: _checked(name, value, source) for name, value in values.items()})


def _checked(name: str, value: object, source: str) -> Any:
    """The value of a key."""
    allowed, words = _allowed(name)
    if name in ("level", "max_splats"):
        if type(value) is int and value in allowed:
            return value
        raise UsageError(f"{name} of {source} is {shown(value)}; it must be {words}")
    if not isinstance(value, list) or not value:
        raise UsageError(f"{name} of {source} is {shown(value)}; it must be a list with at least one entry: {words}")
    for entry in value:
        if type(entry) not in (int, str) or entry not in allowed:
            near = question(entry, allowed) if isinstance(entry, str) and isinstance(allowed, tuple) else ""
            raise UsageError(f"{name} of {source} has {shown(entry)}{near or f'; an entry must be {words}'}")
        if value.count(entry) > 1:
            raise UsageError(f"{name} of {source} has {shown(entry)} twice")
    return tuple(value)


def _allowed(name: str) -> tuple[Container[Any], str]:
    """The values that a key may have, or the entries of its list, and the same in words."""
    ranges = {
        "level": LEVELS, "max_splats": range(MOST_SPLATS), "bit_depths": _range("bit_depth"),
        "lanes": _range("lane_count"),
    }  # fmt: skip
    if name in ranges:
        return ranges[name], f"a whole number of {ranges[name][0]} to {ranges[name][-1]}"
    texts: dict[str, Callable[[], tuple[str, ...]]] = {
        "profiles": lambda: PROFILES, "classes": lambda: get_args(Group), "operations": lambda: (*operations(),),
    }  # fmt: skip
    return texts[name](), f"one of {', '.join(texts[name]())}"


def _range(element: str) -> range:
    """The values of an element of the sequence header."""
    ((lowest, highest),) = [(first, last) for name, _, first, last in header_rows() if name == element]
    return range(lowest, highest + 1)


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _words(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else f"{value:,}"


def _streams(vector: Vector) -> list[bytes]:
    return [value for value in vector.inputs.values() if isinstance(value, bytes)]


def _numbers(vector: Vector, name: str) -> list[int]:
    """The values of a number that is an input, and of the element of that name in the headers of streams."""
    found = {int(vector.inputs[name])} if name in vector.inputs else set()
    found.update(header[name] for header in map(stated_header, _streams(vector)) if name in header)
    return sorted(found)


def most_splats(vector: Vector) -> int:
    """The largest number of splats of any input, and of any frame of a stream up to its first fault."""
    of_streams = (count for stream in _streams(vector) for count in _frame_counts(stream))
    of_layers: list[int] = []
    if "layer" in vector.inputs:
        of_layers = namespace()["reconstruct_layers"](**vector.inputs)["counts"].tolist()
    return max([0, *splat_counts(vector.operation, vector.inputs), *of_streams, *of_layers])


def stated_header(stream: bytes) -> dict[str, int]:
    """The elements of a stream's sequence header that are there and have a value that a decoder accepts."""
    code = namespace()
    found: dict[str, int] = {}
    with suppress(code["Fault"]):
        bits, _ = code["read_prefix"](stream)
        chunk_type, payload = code["read_chunk"](bits, code["LONGEST_HEADER"])
        if chunk_type == "H":
            for name, size, lowest, highest in header_rows(stated_profile(stream)):
                value = payload.le(size)
                if lowest <= value <= highest:
                    found[name] = value
    return found


def _frame_counts(stream: bytes) -> Iterator[int]:
    """The splats of each frame that is complete, and the numbers that I- and P-frames state, complete or not."""
    code = namespace()
    with suppress(code["Fault"]):
        for frame in code["all_frames"](stream):
            yield len(frame["parameters"])
    with suppress(code["Fault"]):
        bits, state = code["open_stream"](stream)
        while True:
            chunk_type, payload = code["read_chunk"](bits, state.limits["payload"], compare_crc=False)
            if chunk_type in ("I", "P"):
                payload.uv()  # frame_number
                if state.header["flags"] & 1:
                    payload.le(4)  # parameter_checksum
                if state.header["profile"] == code["MAIN"]:
                    head = payload.le(1)
                    payload.raw(head >> 1 & 1)  # quantizer
                    yield payload.uv() // 2 + 1 if head & 1 else 0  # splat_number
                else:
                    yield payload.uv()  # splat_count or new_splat_count
