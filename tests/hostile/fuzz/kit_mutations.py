"""What the conformance kit reads, to begin with, and mutations of it that know its forms."""

import copy
import hashlib
import io
import json
import re
import warnings
import zipfile
from collections.abc import Sequence
from functools import cache
from random import Random
from typing import Any, Final

import numpy as np

from gsvc_conformance.process import npy
from gsvc_conformance.reading import Folder
from gsvc_conformance.report.json import to_text
from gsvc_conformance.results import OutputResult, Result, Table
from gsvc_conformance.vector import MANIFEST, SUMS, VECTORS, vector_in
from gsvc_conformance.verdicts import Report

from .stream_mutations import bytes_changed

IDS: Final = (
    "core/splat_classes/classes_of_nothing", "core/to_frame/the_half_8_bits", "core/render_frame/no_splats_8_bits",
    "uncommon/learning_rates/rates_that_stay", "stress/converged/patience_of_many_iterations",
    "stress/pruning_plan/plan_of_many_removals", "stress/encode_video/one_pixel",
    "faulty/reconstruct_stream/r_6_1_1_nothing",
)  # fmt: skip
"""Small vectors of each kind of check, of streams, and of arrays in runs."""

DEEP, DIGITS, WIDE = "@deep@", "@digits@", "@wide@"
RAW: Final = {DEEP: "[" * 60_000 + "]" * 60_000, DIGITS: "1" * 5000, WIDE: "[" + "[]," * 50_000 + "[]]"}
"""Values that no program writes, by the text that stands for them until the JSON is written."""
ODD: Final = (
    None, True, False, 0, 1, -1, 2, 5, 255, 1 << 31, 1 << 53, (1 << 53) + 1, 1 << 63, 10**400, -(10**400), 0.5, -0.5,
    1e300, float("inf"), float("-inf"), float("nan"), "", "x", "a/b/c", "../../etc/passwd", "core/nothing/x",
    "\x1b[31m", "\ud800", "\x00", "f8,(", "|O", "<f4", "paper", "main", "pass", "fail", "infinite", "R-6.1-1",
    "x" * 3000, [], [0],
    [[]], [1, 2, 3], ["a"], {}, {"a": 1}, {"file": "values.npy"}, {"value": 3}, {"check": "exact"},
    [[1 << 40, 0, 1, 0]], [[1, 0, 1, 0]], [1 << 40], [-1, -1], DEEP, DIGITS, WIDE,
)  # fmt: skip


def written(value: Any) -> bytes:
    """A value as JSON, with what no program writes."""
    text = json.dumps(value)
    for mark, raw in RAW.items():
        text = text.replace(json.dumps(mark), raw)
    return text.encode()


def changed_json(value: Any, rng: Random) -> Any:
    """A value with some part in the place of another, gone, or there twice."""
    value = json.loads(json.dumps(value))
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        value = _changed(value, rng)
    return value


def _odd(rng: Random) -> Any:
    return copy.deepcopy(rng.choice(ODD))


def _changed(value: Any, rng: Random) -> Any:
    keys: list[Any] = list(value) if isinstance(value, dict) else list(range(len(value)))
    if not keys:
        return _odd(rng)
    key, how = rng.choice(keys), rng.randrange(10)
    inner = value[key]
    if isinstance(inner, dict | list) and how < 7:
        value[key] = _changed(inner, rng)
    elif how == 7:
        del value[key]
    elif how == 8 and isinstance(value, dict):
        value[rng.choice(("x", "", "value", "runs", "shape", "\x1b", *map(str, keys)))] = _odd(rng)
    elif how == 9 and isinstance(value, list):
        value.append(_odd(rng))
    else:
        value[key] = _odd(rng)
    return value


# Reports


def some_reports() -> list[bytes]:
    """Reports of runs with results of all outcomes."""
    outputs = (
        OutputResult("frame", "interval", False, "is 3", 2.5, (0, 1, 2), 4),
        OutputResult("error", "refusal", True, "", None, None, 0, "rule", "names R-6.1-1, expected R-6.1-2"),
    )
    table = Table("the worst", ("x", "y"), (("splat 0", "1", "2"), ("splat 3", "3", "4")))
    outcomes = ("pass", "fail", "unsupported", "error", "crash", "timeout", "skipped", "waived")
    results = [
        Result(
            f"core/{operation}/{outcome}", "A title.", group, outcome, "a message",
            outputs if outcome == "fail" else (), ("a cause",) if outcome == "fail" else (), "a log", 0.25,
            table if outcome == "fail" else None, 77, False, 2,
            "level 2" if outcome == "unsupported" else "", profile,
        )
        for outcome in outcomes
        for operation, group, profile in (("to_frame", "rendering", "any"), ("read_stream", "bitstream", "paper"))
    ]  # fmt: skip
    environment = {"implementation": "mine", "kit": "gsvc-conformance 0", "vectors": "ab" * 32, "vector set": "4"}
    made = [Report(environment, "run --module mine", "", ["a note"], results, {"device": "none"}, stale=("a waiver",))]
    made += [Report(environment, "run", "tier core", [], results[:1], ended="ended early", options="--tier core")]
    texts = [json.loads(to_text(report)) for report in made]
    texts[1] |= {"claim": "bitstream+rendering,paper,2,sizes", "features": {"level": 2, "lanes": [1, 8]}, "whole": True}
    return [written(text) for text in texts]


def some_speeds() -> list[bytes]:
    """A file of speeds of two implementations."""
    measured = [
        {"implementation": name, "settings": {"threads": 1}, "environment": {"device": "none"},
         "seconds": {"decode": {"median": 0.25, "least": 0.2}}}
        for name in ("mine", "other")
    ]  # fmt: skip
    value = {"form": "speeds/1", "date": "2026-01-31", "machine": {"CPU": "a"}, "works": {"decode": "decoding"}}
    return [written({**value, "implementations": measured})]


def mutate_report(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """A report with fields of other types and values, or any bytes."""
    if rng.randrange(10) == 0:
        return bytes_changed(data, rng, others)
    return written(changed_json(json.loads(data), rng))


# Waivers and features

TOML_VALUES: Final = (
    "1", "-1", "1.5", "inf", "nan", "true", '""', "'x'", '"core/*"', '"*"', '"["', '"[a-]*"', '"core/to_frame/*"', "[]",
    '["core/*", "*x*?"]', "[1]", "[[]]", "{}", "{a = 1}", "2027-01-31", "2020-01-01", "2027-01-31T10:00:00Z",
    "10:00:00", "0x10", "1e400", "1" * 5000, "[" * 3000, "{a=" * 3000, '"' + "*a" * 600 + '"', '"""\n\n"""',
    '"\\ud800"', '"\\u0000"', "9999-12-31", "0000-00-00", '["main", "paper"]', '["rendering"]', "[8, 10]", "[8, 8]",
    "[" + "1," * 2000 + "]",
)  # fmt: skip
TOML_KEYS: Final = (
    "vectors", "reason", "issue", "until", "level", "profiles", "lanes", "classes", "operations", "max_splats", "x",
    '""', "bit_depths", "a.b", ".".join("a" * 500), " . ".join(['"a"'] * 500), "[[waiver]]", "[waiver]", "[[x]]",
    "[x.y]",
)  # fmt: skip


def some_tables() -> list[bytes]:
    """Waivers and features as TOML."""
    waivers = [
        '[[waiver]]\nvectors = ["core/to_frame/*", "stress/*"]\nreason = "a bug"\n'
        'issue = "https://x"\nuntil = 2027-01-31',
        '[[waiver]]\nvectors = ["*_bits", "faulty/*/r_?_*"]\nreason = "old"\nuntil = 2020-01-31',
        '[[waiver]]\nvectors = ["core/[a-z]*/x", "nothing"]\nreason = "none"',
    ]
    features = ['level = 2\nprofiles = ["paper"]\nlanes = [1, 8]\nbit_depths = [8, 10]', "max_splats = 100",
                'classes = ["rendering"]\noperations = ["to_half"]']  # fmt: skip
    return [text.encode() for text in ("\n".join(waivers), *waivers, *features)]


def mutate_table(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Lines with other keys and values, lines of others, or any bytes."""
    if rng.randrange(8) == 0:
        return bytes_changed(data, rng, others)
    lines = data.decode(errors="replace").split("\n")
    for _ in range(rng.choice((1, 1, 2, 3))):
        place = rng.randrange(len(lines))
        key, _, value = lines[place].partition(" = ")
        how = rng.choice((0, 0, 0, 1, 1, 2, 3, 3, 3, 4))
        if how == 0:
            lines[place] = f"{key} = {rng.choice(TOML_VALUES)}"
        elif how == 1:
            lines[place] = f"{rng.choice(TOML_KEYS)} = {value or rng.choice(TOML_VALUES)}"
        elif how == 2:
            lines[place : place + rng.randrange(2)] = [rng.choice(TOML_KEYS)]
        elif how == 3:
            lines[place:place] = rng.choice(others).decode(errors="replace").split("\n")
        else:
            del lines[place]
            lines.append("")
    return "\n".join(lines).encode(errors="replace")


# Vectors and answers


@cache
def vectors() -> dict[str, bytes]:
    """The files of some vectors of the kit."""
    files = Folder(VECTORS)
    return {name: data for name, data in files.items() if name.rpartition("/")[0] in IDS}


def packed(files: dict[str, bytes], method: int = zipfile.ZIP_STORED) -> bytes:
    """Files as an archive."""
    target = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(target, "w", method) as archive:
        warnings.simplefilter("ignore")  # of names that are there twice
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name.replace("\ud800", "?")), data, method)
    return target.getvalue()


def unpacked(data: bytes) -> dict[str, bytes]:
    """The files of an archive that `packed` made."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def with_sums(files: dict[str, bytes]) -> dict[str, bytes]:
    """Files with SHA256SUMS and a set that are right."""
    there = {name: data for name, data in files.items() if name not in (SUMS, "sets/1.txt")}
    lines = [f"{hashlib.sha256(data).hexdigest()}  {name}\n" for name, data in sorted(there.items())]
    ids = "".join(f"{name} {'0' * 64}\n" for name in IDS[:1])
    return {**there, SUMS: "".join(lines).encode(), **({"sets/1.txt": ids.encode()} if "sets/1.txt" in files else {})}


def some_vectors() -> list[bytes]:
    """Archives of single vectors, of all of them, and with a set."""
    parts = [{n: data for n, data in vectors().items() if n.startswith(f"{name}/")} for name in IDS]
    return [packed(with_sums(files)) for files in (*parts, vectors(), {**vectors(), "sets/1.txt": b""})]


TYPES: Final = (
    "|u1", "<u2", "<u4", "<i8", "<f4", "<f8", ">f4", "|b1", "<c8", "<f2", "<f16", "|S3", "<U2", "|O", "<M8[s]", "|V8",
    "f8,(", "", "<i1000000",
)  # fmt: skip
SHAPES: Final = (
    "()", "(0,)", "(1,)", "(2,)", "(3,)", "(0, 8)", "(1, 3, 8)", "(2, 0, 3)", "(-1, 8)", "(1099511627776,)", "(True,)",
    "(0, 1000000000000000000000000000000)", "(0, 9223372036854775807)", "3", "None", "(1.0,)", "(" * 200 + ")" * 200,
)  # fmt: skip


def changed_npy(data: bytes, rng: Random) -> bytes:
    """An .npy file with another header, other numbers, or another length."""
    head, size = data[:10], int.from_bytes(data[8:10], "little")
    header, body = data[10 : 10 + size].decode("latin-1"), data[10 + size :]
    how = rng.randrange(7)
    if how == 0:
        header = re.sub(r"'descr': '[^']*'", f"'descr': {rng.choice(TYPES)!r}", header)
    elif how == 1:
        header = re.sub(r"'shape': \([^)]*\)", f"'shape': {rng.choice(SHAPES)}", header)
    elif how == 2:
        header = header.replace("False", "True")
    elif how == 3:
        body = body[: rng.randrange(len(body) + 1)] + rng.choice((b"", bytes(8), b"\xff" * 8))
    elif how == 4 and body:
        place = rng.randrange(len(body))
        number = np.array(rng.choice((np.nan, np.inf, -np.inf, -1.0, 1e30, 0.0)), rng.choice(("<f4", "<f8")))
        body = (body[:place] + number.tobytes() + body[place + number.nbytes :])[: len(body)]
    elif how == 5:
        array = rng.choice((np.zeros(()), np.zeros(0), np.ones((2, 3)), np.full(4, np.nan, "f4"), np.arange(200)))
        kinds = ("f4", "f8", "f2") if np.isnan(array).any() else ("u1", "u2", "i8", "f4", "f8", "f2")
        return npy(array.astype(rng.choice(kinds)))
    else:
        head = rng.choice((b"\x93NUMPY\x02\x00", b"\x93NUMPY\x03\x00", b"NUMPY", b"", b"PK\3\4")) + head[8:]
        return head + header.encode("latin-1") + body
    return head[:8] + len(header).to_bytes(2, "little") + header.encode("latin-1") + body


def mutate_vectors(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Manifests, arrays, lists and names of an archive, mostly with sums that are right; or any bytes."""
    if rng.randrange(10) == 0:
        return bytes_changed(data, rng, others)
    files = unpacked(data)
    right = True
    for _ in range(rng.choice((1, 1, 2))):
        name = rng.choice(list(files))
        if name.endswith(MANIFEST):
            files[name] = written(changed_json(json.loads(files[name]), rng))
            if any(mark in files[name].decode() for mark in RAW.values()):
                break
        elif name.endswith(".npy"):
            files[name] = changed_npy(files[name], rng)
            _tell_manifest(files, name)
        elif name in (SUMS, "sets/1.txt"):
            right = False
            files[name] = _changed_list(files[name], rng, others)
        else:
            files[name] = bytes_changed(files[name], rng, others)
            _tell_manifest(files, name)
    if rng.randrange(20) == 0:
        files[rng.choice(("core/to_frame/x/y", "a/b/c/manifest.json", "sets/2.txt", "sets/x.txt", "../x", "/x"))] = (
            b"{}"
        )
    method = zipfile.ZIP_STORED if rng.randrange(8) else rng.choice((zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2))
    archive = packed(with_sums(files) if right and rng.randrange(12) else files, method)
    return archive if rng.randrange(16) else bytes_changed(archive, rng, others)


def _tell_manifest(files: dict[str, bytes], name: str) -> None:
    """Let the manifest of a vector have the SHA-256 of a file that was changed."""
    home = name.rpartition("/")[0]
    manifest = files.get(f"{home}/{MANIFEST}", b"")
    old = hashlib.sha256(vectors().get(name, b"")).hexdigest().encode()
    files[f"{home}/{MANIFEST}"] = manifest.replace(old, hashlib.sha256(files[name]).hexdigest().encode())


LIST_LINES: Final = (
    b"", b"x", b"  ", b"a  b  c", b"\xff", b"0" * 64 + b"  core/to_frame/x/manifest.json", b"0" * 64 + b"  a",
    b"0" * 64 + b"  ../x/y/manifest.json", b"x y",
)  # fmt: skip


def _changed_list(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    lines = data.split(b"\n")
    place = rng.randrange(len(lines))
    how = rng.randrange(4)
    if how == 0:
        lines[place] = rng.choice(LIST_LINES)
    elif how == 1:
        lines[place:place] = [lines[place]]
    elif how == 2:
        del lines[place]
    else:
        return bytes_changed(data, rng, others)
    return b"\n".join(lines)


def some_answers() -> list[bytes]:
    """Right answers to some vectors, as the files that a command writes; the first names the vector."""
    made = []
    for name in IDS:
        files = {"id": name.encode()}
        for port, expectation in vector_in(Folder(VECTORS), name).expected.items():
            value = getattr(expectation, "value", b"")
            if isinstance(value, str):
                files[f"{port}.txt"] = value.encode()
            elif port == "stream":
                files["stream.gsvc"] = b"\x89GSVC"
            else:
                files[f"{port}.npy"] = npy(np.asarray(value))
        made.append(packed(files))
    return made


ERRORS: Final = (
    b"", b"malformed R-6.1-1 0", b"unsupported", b"malformed", b"\xff\x1b[31m", b"x" * 5000,
    b"malformed R-6.1-1 " + b"9" * 5000, b"invalid R-99 -1", "\u202ex".encode(),
)  # fmt: skip


def mutate_answer(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Other arrays and texts, files of other answers, or none."""
    files = unpacked(data)
    for _ in range(rng.choice((0, 1, 1, 2, 3))):
        names = [name for name in files if name != "id"]
        if not names or rng.randrange(12) == 0:
            files |= {n: data for n, data in unpacked(rng.choice(others)).items() if n != "id"}
            continue
        name = rng.choice(names)
        if rng.randrange(10) == 0:
            del files[name]
        elif name.endswith(".npy") and rng.randrange(6):
            files[name] = changed_npy(files[name], rng)
        elif name.endswith(".txt"):
            files[name] = rng.choice(ERRORS)
        else:
            files[name] = bytes_changed(files[name], rng, others)
    return packed(files)


# Dialogues of servers

LINES: Final = (
    {"gsvc": 1, "name": "x"}, {"gsvc": 1, "name": "x", "environment": {"device": "y"}}, {"id": 1, "status": "done"},
    {"id": 1, "status": "unsupported"}, {"id": 1, "status": "error", "message": "m"},
    {"id": 2, "status": "unsupported"},
)  # fmt: skip


def some_dialogues() -> list[bytes]:
    """What a server writes: a hello and answers, a line each; it waits for a request before each but the first."""
    return [
        b"".join(written(line) + b"\n" for line in lines)
        for lines in ([LINES[0], LINES[3], LINES[5]], [LINES[1], LINES[2]], [LINES[0], LINES[4]])
    ]


def mutate_dialogue(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Lines with other fields, lines too many or too few, or any bytes."""
    lines = data.split(b"\n")
    place = rng.randrange(len(lines))
    how = rng.randrange(6)
    if how == 0:
        lines[place:place] = [rng.choice((b"", b"{}", b"[]", b"\xff", b"x" * 70_000, b"{}\r", b"null"))]
    elif how == 1:
        lines[place:place] = rng.choice(others).split(b"\n")
    elif how == 2:
        return bytes_changed(data, rng, others)
    elif lines[place]:
        lines[place] = written(changed_json(json.loads(lines[place]), rng))
    return b"\n".join(lines)
