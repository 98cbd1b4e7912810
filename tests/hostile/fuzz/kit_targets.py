"""The conformance kit: whatever it reads, a command ends with 0, 1 or 2 and a sentence, and leaves nothing behind."""

import io
import json
import sys
import tempfile
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, Final
from unittest import mock

from gsvc_base.errors import UsageError
from gsvc_conformance import process
from gsvc_conformance.__main__ import main
from gsvc_conformance.features import read_features
from gsvc_conformance.reading import Folder
from gsvc_conformance.report.json import read
from gsvc_conformance.results import Result
from gsvc_conformance.vector import VECTORS, vector_in
from gsvc_conformance.vector_folder import VectorFolder
from gsvc_conformance.waivers import read_waivers, renewed, to_toml

from .command_targets import LONGEST_SENTENCE, limited_memory
from .kit_mutations import IDS, packed, some_reports, unpacked, vectors, with_sums
from .targets import ACCEPTED

MAX_SECONDS: Final = 15.0
"""CPU time of an execution, in seconds; those before it is warm included."""
ANSWERS: Final = "kit_fuzz_answers"
"""The module that answers the vectors that are fuzzed."""
FILES: Final = ("json", "html", "junit", "markdown", "badge")


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A folder for an execution and for all that the kit keeps meanwhile, of which nothing may stay."""
    with tempfile.TemporaryDirectory() as folder, mock.patch.object(tempfile, "tempdir", f"{folder}/tmp"):
        home = Path(folder)
        (home / "tmp").mkdir()
        yield home
        assert not list((home / "tmp").iterdir()), "something stays in the folder for temporary files"


def outcome(*words: object) -> str:
    """Run a command of the kit; how it ended."""
    said, complaint = io.StringIO(), io.StringIO()
    begin = time.process_time()
    with redirect_stdout(said), redirect_stderr(complaint), limited_memory():
        status = main([*map(str, words)])
    seconds = time.process_time() - begin
    text = complaint.getvalue()
    assert seconds < MAX_SECONDS, f"{words} took {seconds} s"
    assert status in (0, 1, 2), f"exit code {status}: {text}"
    assert "Traceback" not in text, text
    assert "not enough memory" not in text, text
    assert len(text) < LONGEST_SENTENCE, text
    assert status < 2 or text.startswith("gsvc-conformance ") or said.getvalue(), f"no sentence of {words}"
    if "--json" in words and status != 2 and words[0] == "list":
        json.loads(said.getvalue())
    return ACCEPTED if status == 0 else f"exit {status}"


def outputs(home: Path) -> list[str]:
    """Options for all files of a report."""
    return [f"--{kind}={home / kind}" for kind in FILES]


def reports(data: bytes) -> str:
    """``report`` and ``compare`` of JSON that was edited; `report` of what `run` wrote has its results."""
    way = zlib.crc32(data) % 6
    with scratch_folder() as home:
        path, other = home / "it.json", home / "other.json"
        path.write_bytes(data)
        other.write_bytes(some_reports()[0])
        if way < 2:
            return outcome("report", path, *outputs(home)[1:])
        if way == 2:
            (home / "kept").mkdir()
            return outcome("report", path, "--html", home / "html", "--keep", home / "kept")
        words = ([path, other], [other, path, "--quiet"], [path, other, "--tables"])[way - 3]
        return outcome("compare", *words)


def speeds(data: bytes) -> str:
    """``compare --speeds``."""
    with scratch_folder() as home:
        (home / "report.json").write_bytes(some_reports()[0])
        (home / "speeds.json").write_bytes(data)
        return outcome("compare", home / "report.json", "--speeds", home / "speeds.json")


@cache
def names() -> tuple[str, ...]:
    """The ids of all vectors."""
    return tuple(VectorFolder(VECTORS, "newest").names)


def tables(data: bytes) -> str:
    """Waivers, used as a run uses them and written again, and features."""
    with scratch_folder() as home:
        path = home / "it.toml"
        path.write_bytes(data)
        found = []
        for use in (_waivers, read_features):
            refused = ""
            try:
                use(path)
                found.append(ACCEPTED)
            except UsageError as error:
                refused = str(error)
            assert not refused or (str(path) in refused and len(refused) < LONGEST_SENTENCE)
        if zlib.crc32(data) % 64 == 0:
            option = ("--waivers", "--features")[zlib.crc32(data) // 64 % 2]
            answering, selected = ("--module", answers()), ("--case", IDS[1])
            outcome("run", *answering, *selected, "--quiet", option, path, "--write-waivers", home / "new.toml")
    return found[0] if found else "refused"


def _waivers(path: Path) -> None:
    waivers = read_waivers(path)
    results = [Result(name, "", "rendering", ("pass", "fail")[len(name) % 2], "x") for name in names()[::40]]
    assert waivers.reasons(names()).keys() <= set(names())
    waivers.stale(results, names())
    path.write_text(to_toml(renewed(waivers, results, names())), encoding="utf-8")
    assert read_waivers(path).counting() == renewed(waivers, results, names()).counting()


@cache
def answers() -> str:
    """The name of a module that answers the operations of some vectors as is right for these, whatever it is asked."""
    module = ModuleType(ANSWERS)
    for name in IDS:
        vector = vector_in(Folder(VECTORS), name)
        expected = {port: getattr(one, "value", b"") for port, one in vector.expected.items()}
        setattr(module, vector.operation.name, _answering(expected))
    sys.modules[ANSWERS] = module
    return ANSWERS


def _answering(values: Mapping[str, Any]) -> Callable[..., Mapping[str, Any]]:
    return lambda **_inputs: values


def archives(data: bytes) -> str:
    """Vectors of others, as an archive or as a folder: judged, listed, exported."""
    number = zlib.crc32(data)
    with scratch_folder() as home:
        path = home / "it.zip"
        path.write_bytes(data)
        if number % 5 == 0:
            try:
                files = unpacked(data)
            except Exception:  # no archive
                files = {}
            path = home / "vectors"
            path.mkdir()
            for name, text in files.items():
                if ".." not in name and not name.startswith("/") and "\0" not in name and not name.endswith("/"):
                    try:
                        (path / name).parent.mkdir(parents=True, exist_ok=True)
                        (path / name).write_bytes(text)
                    except OSError:  # no name of a file
                        continue
        run = ["run", "--module", answers(), "--quiet", "--no-diagnosis", "--vectors", path]
        ways: list[list[object]] = [
            [*run, *outputs(home)], [*run, "--set", "all", "--keep", home / "kept"], [*run, "--set", "1"],
            [*run, "--rule", "R-13-2"], [*run, "--claim", "rendering,paper,1"], ["list", "--json", "--vectors", path],
            ["list", "--cases", "--vectors", path], ["sets", "--vectors", path],
            ["export", "--gltf", home / "out", "--vectors", path],
        ]  # fmt: skip
        ended = outcome(*ways[number // 5 % len(ways)])
        if (home / "json").exists():
            read(home / "json")
        return ended


def written_answers(data: bytes) -> str:
    """What a command wrote for a vector, judged, drawn, kept, and looked for causes in."""
    files = unpacked(data)
    name = files.pop("id").decode()

    class Writes:
        """In the place of a program."""

        def __init__(self, words: list[str], *_: object) -> None:
            for file, text in files.items():
                Path(words[-1], file).write_bytes(text)

        def __enter__(self) -> "Writes":
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def wait(self, *_: object) -> int:
            """The exit status."""
            return 0

    with scratch_folder() as home, mock.patch.object(process, "Program", Writes):
        words = ["--case", name, "--quiet", "--keep", home / "kept", *outputs(home)]
        words += ["--write-waivers", home / "new.toml"] if zlib.crc32(data) % 2 else []
        words += ["--no-diagnosis"] if zlib.crc32(data) % 8 else []
        vectors_of_it = home / "vectors.zip"
        vectors_of_it.write_bytes(_alone(name))
        ended = outcome("run", "--impl", "true", "--vectors", vectors_of_it, *words)
        assert [result.id for result in read(home / "json").results] == [name]
        outcome("report", home / "json", "--keep", home / "kept", "--html", home / "again", "--vectors", vectors_of_it)
        return ended


@cache
def _alone(name: str) -> bytes:
    """An archive of one vector."""
    return packed(with_sums({file: data for file, data in vectors().items() if file.startswith(f"{name}/")}))


SERVER: Final = "sh -c 'cat {0}/0; n=1; while read -r request; do cat {0}/$n 2>/dev/null; n=$((n+1)); done'"


def dialogues(data: bytes) -> str:
    """What a server writes, before requests and after them."""
    with scratch_folder() as home:
        for number, line in enumerate(data.splitlines(keepends=True)):
            (home / str(number)).write_bytes(line)
        vectors_of_it = home / "vectors.zip"
        vectors_of_it.write_bytes(_alone(IDS[1]))
        words = ["--timeout", "0.3", "--start-timeout", "0.3", "--repeat", "2", "--quiet", "--vectors", vectors_of_it]
        return outcome("run", "--serve", SERVER.format(home), *words, *outputs(home))
