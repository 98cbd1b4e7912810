"""The corpus and some thousand inputs of a seed through all targets of the fuzzer, and proof that it finds defects."""

import hashlib
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from fuzz import corpus, guided, seeded, targets
from fuzz.__main__ import main
from fuzz.fuzzing import CORPUS, TARGETS
from fuzz.layout import elements, split
from fuzz.stream_mutations import MUTATIONS, mutate_stream

from gsvc_base.errors import GsvcError
from gsvc_base.files import PartialFile
from gsvc_conformance.cases.faulty import faults
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.coder import categories_of
from gsvc_ref.bitstream.rans import encode_plane
from gsvc_ref.stream import DecodedFrame
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, write_stream

ROOT = Path(__file__).parents[2]
OVERVIEW = write_stream(OVERVIEW_HEADER, overview_frames())

MAX_FILES = 160
MAX_BYTES = 150_000

RUNS = {
    "parser": 1200, "reencode": 300, "pictures": 300, "differential": 400, "planes": 600, "videos": 600,
    "settings": 400, "dump": 60, "info": 60, "cut": 40, "concat": 40, "export": 40, "decode": 40, "salvage": 40,
    "listing": 200, "import": 80, "scene": 40, "log": 300, "kit_reports": 40, "kit_speeds": 20, "kit_tables": 60,
    "kit_vectors": 30, "kit_answers": 20,
}  # fmt: skip
"""Executions of each target here; `python -m tests.hostile.fuzz` makes as many as are wanted.

Those of kit_servers start programs, so that what becomes of an input depends on the load of the machine.
"""

AT_LEAST, MAX_TIME_RUNS = 5_000, 20_000
"""Executions in which every rule is broken; the rarest one, R-8-1, needs some thousand."""

RULES = {"parser": 30, "differential": 30, "planes": 8}
"""How many different rules such a run must break at least, lest mutations stay on the surface."""


@pytest.fixture(scope="module")
def pools() -> dict[str, list[bytes]]:
    """What mutations begin with, by target; the targets of streams share it."""
    by_folder = {target.folder: target for target in TARGETS.values()}
    made = {folder: seeded.pool(target) for folder, target in by_folder.items()}
    return {name: made[target.folder] for name, target in TARGETS.items()}


@pytest.mark.parametrize("name", TARGETS)
def test_corpus(name: str) -> None:
    for path in TARGETS[name].corpus():
        try:
            seeded.execute(TARGETS[name], path.read_bytes())
        except Exception as defect:
            raise AssertionError(f"a defect shows: {seeded.replay_command(name, path)}") from defect


def test_the_corpus_stays_small() -> None:
    files = [path for path in CORPUS.rglob("*") if path.is_file()]
    assert 50 <= len(files) <= MAX_FILES
    assert sum(path.stat().st_size for path in files) <= MAX_BYTES
    for path in files:
        origin, _, digest = path.stem.rpartition("-")
        assert re.fullmatch(r"(guided|seeded)-[a-z]+|faulty-vectors", origin)
        assert digest == hashlib.sha256(path.read_bytes()).hexdigest()[:12]


@pytest.mark.parametrize("name", RUNS)
def test_inputs_of_a_seed(name: str, pools: dict[str, list[bytes]], tmp_path: Path) -> None:
    tally = seeded.run_part(name, 0, range(RUNS[name]), pools[name], tmp_path)
    assert not tally.defects, "\n".join(what for _, what in tally.defects)
    assert tally.runs == RUNS[name]
    accepted = sum(count for word, count in tally.outcomes.items() if word == targets.ACCEPTED)
    assert 0.05 < accepted / tally.runs < 0.6
    assert tally.outcomes[targets.SKIPPED] < 0.1 * tally.runs
    rules = {word.split()[0] for word in tally.outcomes if word.startswith("R-")}
    assert len(rules) >= RULES.get(name, 0), sorted(rules)


def test_dialogues_of_servers(pools: dict[str, list[bytes]], tmp_path: Path) -> None:
    tally = seeded.run_part("kit_servers", 0, range(4), pools["kit_servers"], tmp_path)
    assert not tally.defects, "\n".join(what for _, what in tally.defects)
    assert RUNS.keys() | {"kit_servers"} == TARGETS.keys()


@pytest.mark.exhaustive
def test_every_rule_is_reached(pools: dict[str, list[bytes]], tmp_path: Path) -> None:
    """gsvc_ref and spec.md agree in kind, rule and bit on inputs that break every rule that can be broken."""
    rules, broken = {fault.rule for fault in faults()} | {"R-5-9"}, set()
    for first in range(0, MAX_TIME_RUNS, AT_LEAST):
        tally = seeded.run_part("differential", 0, range(first, first + AT_LEAST), pools["differential"], tmp_path)
        assert not tally.defects, "\n".join(what for _, what in tally.defects)
        broken |= {word.split()[0] for word in tally.outcomes if word.startswith("R-")}
        if broken >= rules:
            break
    assert broken == rules


def nothing(*_args: Any, **_named: Any) -> None:
    """In place of a check that is forgotten."""


def says_no_bit(_reader: Reader, rule: str, message: str, *, bit: int | None = None) -> None:
    raise GsvcError("invalid", message, rule=rule)


def raises_key_error(*_args: Any) -> None:
    raise KeyError("of a dictionary inside")


def first_words(*arguments: Any) -> Any:
    """The encoder's words in the order in which it makes them, not reversed."""
    states, words = encode_plane(*arguments)
    return states, words[::-1]


def one_splat_less(*arguments: Any) -> DecodedFrame:
    """A frame as the writer tells of it, without its last splat."""
    frame = DecodedFrame(*arguments)
    return replace(frame, base=frame.base.take(np.arange(max(0, len(frame.base) - 1))))


def as_it_is(value: Any, schema: Any, *_named: str) -> Any:
    """An object with the fields of a schema, whatever they are."""
    return {field: value.get(field, default) for field, (_, default) in schema.items()}


def read_toml_as_it_is(path: Path) -> Any:
    return tomllib.loads(path.read_text(encoding="utf-8"))


def no_index(profile: int) -> tuple[str, ...]:
    return tuple(name for name in categories_of(profile) if name != "index")


PLANTED: dict[str, tuple[str, str, Any]] = {
    "any chunk may stand anywhere": ("differential", "stream.chunk_decoder._check_may_stand", nothing),
    "symbols of a plane are not checked": ("planes", "bitstream.planes._check_symbol", nothing),
    "what is left of a payload is not checked": ("differential", "stream.chunk_decoder._check_filled", nothing),
    "intra blocks may leave attributes out": (
        "differential", "bitstream.frames._attribute_flag", lambda s, name, kind, present: s.u(name, 1, int(present)),
    ),
    "parameter checksums are not those of the spec": (
        "differential", "stream.chunk_decoder.parameter_checksum", lambda splats: len(splats),
    ),
    "errors do not say where": ("parser", "bitstream.bit_reader.Reader.fail", says_no_bit),
    "another exception comes out": ("parser", "bitstream.frames._colors", raises_key_error),
    "seeking lands at the first frame": (
        "parser", "stream.reader.find_frame", lambda decoder, number: replace(decoder.first, next_number=number),
    ),
    "bits of the index are not counted": (
        "parser", "stream.reader.categories_of", no_index,
    ),
    "frames lose their last splat": ("reencode", "stream.writer.DecodedFrame", one_splat_less),
    "words are written in the wrong order": ("planes", "bitstream.plane_coding.encode_plane", first_words),
    "pictures lie on their side": (
        "pictures", "stream.decoder.scaled_size", lambda header, scale: (header.height, header.width),
    ),
    "sizes of videos are not checked": ("videos", "video.y4m_header.check_size", nothing),
    "settings are not checked": ("settings", "encoder.settings.common.check_range", nothing),
    "faults of archives pass through": (
        "import", "gsvc_tools.splat_files.npz.NpzSplats._reading", lambda _: nullcontext(),
    ),
    "an empty run has a last element": (
        "listing", "gsvc_tools.listing.Entry.item_at", lambda run, bit: run if run.count == 1 else next(run.items()),
    ),
    "what is half done is left": ("import", "gsvc_base.files.PartialFile.discard", PartialFile._unlock),
    "fields of a report are not checked": ("kit_reports", "gsvc_conformance.report.json.checked", as_it_is),
    "fields of speeds are not checked": ("kit_speeds", "gsvc_conformance.report.comparison.checked", as_it_is),
    "what is no TOML is a fault": ("kit_tables", "gsvc_conformance.waivers.read_toml", read_toml_as_it_is),
    "fields of manifests are not checked": ("kit_vectors", "gsvc_conformance.vector.checked", as_it_is),
    "folders of answers stay": ("kit_answers", "gsvc_conformance.process.remove", nothing),
}  # fmt: skip
"""Defects: the target that must find them, and what (of gsvc_ref, where no package is named) is replaced by what."""

ENOUGH = 3000
"""Executions in which a planted defect must be found."""


@pytest.mark.exhaustive
@pytest.mark.parametrize("what", PLANTED)
def test_planted_defects_are_found(
    what: str, pools: dict[str, list[bytes]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, place, instead = PLANTED[what]
    monkeypatch.setattr(place if place.startswith("gsvc_") else f"gsvc_ref.{place}", instead)
    for first in range(0, ENOUGH, 20):
        if seeded.run_part(name, 1, range(first, first + 20), pools[name], tmp_path).defects:
            return
    pytest.fail(f"{ENOUGH} executions of {name} did not find that {what}")


def test_a_hanging_execution_is_a_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seeded, "LONGEST_SECONDS", 0.2)

    def endless(_data: bytes) -> str:
        while True:
            pass

    target = replace(TARGETS["parser"], run=endless)
    with pytest.raises(seeded.HangError, match="more than"):
        seeded.execute(target, b"")


def test_a_defect_is_written_and_replayed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(seeded, "pool", lambda target: [OVERVIEW])
    arguments = ["parser", "--runs", "40", "--seed", "5", "--folder", str(tmp_path)]
    assert main(arguments) == 0
    assert "parser: 40 executions" in capsys.readouterr().out
    monkeypatch.setattr("gsvc_ref.bitstream.frames._colors", raises_key_error)
    monkeypatch.setattr(seeded, "_inputs", {"parser": [OVERVIEW]})
    assert main(arguments) == 1
    said = capsys.readouterr().out
    assert "DEFECT: seed 5, number " in said
    assert "KeyError: 'of a dictionary inside'" in said
    path = next(tmp_path.glob("parser-defect-*.bin"))
    assert f"python -m tests.hostile.fuzz parser --replay {path}" in said
    with pytest.raises(KeyError):
        main(["parser", "--replay", str(path)])
    monkeypatch.undo()
    assert main(["parser", "--replay", str(path)]) == 0
    assert re.fullmatch(rf"{re.escape(str(path))}: (accepted|R-[\d.-]+)\n", capsys.readouterr().out)


def test_a_replay_of_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["parser", "--replay", str(tmp_path / "missing")])
    assert end.value.code == 2
    assert capsys.readouterr().err.endswith(f"error: --replay: there is no file {tmp_path / 'missing'}\n")


def test_a_seed_makes_the_same_inputs(pools: dict[str, list[bytes]]) -> None:
    for name, target in TARGETS.items():
        first = [seeded.input_of(target, pools[name], 3, number) for number in range(40)]
        assert first == [seeded.input_of(target, pools[name], 3, number) for number in range(40)]
        assert first != [seeded.input_of(target, pools[name], 4, number) for number in range(40)]
        assert len(set(first)) > 30


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.__name__)
def test_mutations_take_any_bytes(mutation: Callable[..., bytes]) -> None:
    rng = Random(0)
    odd = [b"", b"\x89", OVERVIEW[:10], OVERVIEW[:11], OVERVIEW[:60], b"\xff" * 40, OVERVIEW + b"x"]
    for data in odd * 20:
        assert isinstance(mutation(data, rng, [OVERVIEW, *odd[1:]]), bytes)


def test_mutations_reach_behind_checksums() -> None:
    """Half of the mutations of elements leave all checksums right, though the elements are others."""
    rng = Random(0)
    mutated = [mutate_stream(OVERVIEW, rng, [OVERVIEW]) for _ in range(200)]
    assert sum(split(data).joined() == data != OVERVIEW for data in mutated) > 100
    assert {"splat_count", "position_high[x].symbol", "codeword", "index_length"} <= elements(OVERVIEW).keys()


def test_minimising_keeps_the_shortest_that_reach_something() -> None:
    kept = corpus.minimised(TARGETS["planes"], [b"", bytes(7), bytes(8), bytes(6) + b"\xc0", bytes(6) + b"\xc1"])
    assert kept == [b"", bytes(7), bytes(6) + b"\xc0"]


def test_minimising_writes_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fuzz.fuzzing.CORPUS", tmp_path / "corpus")
    monkeypatch.setattr(corpus, "CORPUS", tmp_path / "corpus")
    (tmp_path / "found").mkdir()
    for number, data in enumerate((b"\3" + bytes(6), b"\3" + bytes(7), b"")):
        (tmp_path / "found" / str(number)).write_bytes(data)
    for _ in range(2):  # the second time, the files of the first are what there is
        corpus.minimise("planes", tmp_path / "found")
        kept = TARGETS["planes"].corpus()
        assert {path.read_bytes() for path in kept} == {b"", b"\3" + bytes(6)}
        assert all(path.name.startswith("found-") for path in kept)


def test_without_atheris_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "atheris", None)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert main(["planes", "--atheris", "--found", str(tmp_path)]) == 2
    assert "pip install 'gsvc_ref[fuzz]'" in capsys.readouterr().err


@pytest.mark.exhaustive
@pytest.mark.skipif(find_spec("atheris") is None, reason=guided.NEEDS_ATHERIS)
def test_guided_by_coverage(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tests.hostile.fuzz", "videos", "--atheris", "--runs", "90"]
    ran = subprocess.run([*command, "--found", str(tmp_path)], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, ran.stderr
    assert "Instrumenting gsvc_ref.video.png" in ran.stderr
    assert "Instrumenting gsvc_ref.rendering" not in ran.stderr
    assert "DONE   cov: " in ran.stderr
