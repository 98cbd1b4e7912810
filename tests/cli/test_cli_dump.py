"""``gsvc dump``: every bit of a stream has a name, sound or damaged, and the command says it in lines or in JSON."""

import io
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gsvc_base.errors import UsageError
from gsvc_base.syntax import elements, rules_of
from gsvc_conformance.spec import SPEC
from gsvc_conformance.vector import VECTORS
from gsvc_ref.bitstream.header import MAIN, PAPER
from gsvc_ref.cli import main
from gsvc_ref.testing import (
    OVERVIEW_HEADER,
    RICH_HEADER,
    Lie,
    overview_frames,
    random_main_stream,
    rich_frames,
    write_stream,
)
from gsvc_tools.cli.dump import description_lines
from gsvc_tools.listing import Entry, list_elements, name_at, place_of
from tests.hostile.hostile_streams import chunk

RICH = write_stream(RICH_HEADER, rich_frames())
OVERVIEW = write_stream(OVERVIEW_HEADER, overview_frames(), index=False)
NAMELESS_FAULTS = {"R-6.1-4", "R-6.2-4"}
"""Rules that may be broken where no element is: after the end, or where a chunk is missing."""


@pytest.fixture
def save(tmp_path):
    """Write a stream to a file."""

    def write(data):
        path = tmp_path / "in.gsvc"
        path.write_bytes(data)
        return path

    return write


@pytest.fixture
def dump(capsys):
    """Run the command: its exit code and the lines on standard output and standard error."""

    def run(*arguments):
        capsys.readouterr()
        status = main(["dump", *map(str, arguments)])
        captured = capsys.readouterr()
        return status, captured.out.splitlines(), captured.err.splitlines()

    return run


def entries_of(data, *span):
    found = []
    fault, at_fault = list_elements(data, found.append, *span)
    return found, fault, at_fault


def assert_gapless(entries):
    end = entries[0].bit
    for entry in entries:
        assert entry.bit == end, entry.full_name
        end += entry.bits
    return end


def find(entries, name):
    return next(entry for entry in entries if entry.full_name.startswith(name))


def test_the_table_of_the_spec():
    """What section 4.2 says about each byte is what the listing says."""
    text = SPEC.read_text(encoding="utf-8")
    section = text[text.index("### 4.2 ") : text.index("### 4.3 ")]
    rows = re.findall(r"^\| (\d+) \| ([0-9A-F ]+) \| (.*?) \|", section, re.MULTILINE)
    data = b"".join(bytes.fromhex(row[1]) for row in rows)
    entries, fault, _ = entries_of(data)
    assert fault is None
    assert len(rows) > 50
    for byte, _, names in rows:
        entry = next(entry for entry in entries if entry.bit == 8 * int(byte))
        first = re.match(r"`(\w+)`", names)[1]
        assert first in entry.full_name.replace("plane_mode of ", "")


def test_every_bit_has_a_name():
    for data in (RICH, OVERVIEW, write_stream(RICH_HEADER, [*rich_frames(), *rich_frames()])):
        entries, fault, _ = entries_of(data)
        assert fault is None
        assert assert_gapless(entries) == 8 * len(data)
        items = [item for entry in entries for item in entry.items()]
        assert assert_gapless(items) == 8 * len(data)
        assert all(entry.syntax or entry.name in ("align()", "payload") for entry in entries)
        for item in items:
            for bit in {item.bit, item.bit + item.bits - 1} if item.bits else ():
                run = next(entry for entry in entries if entry.bit <= bit < entry.bit + entry.bits)
                assert run.item_at(bit).full_name == item.full_name


def test_values_of_runs():
    entries, _, _ = entries_of(RICH)
    plane = [entry for entry in entries if entry.of == "position_low x" and entry.frame == 0]
    assert [entry.name for entry in plane][:5] == [
        "plane_mode", "table_bits", "golomb_order", "first_symbol", "last_symbol"
    ]  # fmt: skip
    frequency = next(entry for entry in plane if entry.name == "frequency")
    assert frequency.value.sum() == 1 << next(entry.value for entry in plane if entry.name == "table_bits")
    third = list(frequency.items())[3]
    assert third.full_name == "frequency[3] of position_low x, frame 0"
    assert third.value == frequency.value[3]
    bits = np.unpackbits(np.frombuffer(RICH, np.uint8))[third.bit : third.bit + third.bits]
    assert int("".join(map(str, bits)), 2) == third.value + (1 << frequency.order)
    codeword = list(find(entries, "codeword of stage 1, frame 0").items())[4]
    assert codeword.full_name == "codeword[1] G of stage 1, frame 0"


def test_blocks_of_a_p_frame_are_told_apart():
    names = [entry.full_name for entry in entries_of(RICH)[0]]
    assert len(set(names)) + sum(name.startswith("align()") for name in names) >= len(names)
    for kind in ("inter", "intra"):
        assert f"positions_present, {kind} block, frame 1" in names
    assert "positions_present, frame 0" in names


def test_every_element_of_the_document_is_described():
    """What the listing says about an element is what the document says under its heading, in both profiles."""
    for structure, about in elements():
        profile = MAIN if structure in ("main_header", "frame_body", "run", "densities", "layer") else PAPER
        chunk = "E" if structure == "end" else "I"
        entry = Entry(0, 8, about["name"], "", "", chunk, 0, 1, profile=profile)
        assert entry.syntax["heading"] == about["heading"]
        lines = description_lines(entry)
        assert lines[0].startswith(about["descriptor"]), lines
        assert about.get("meaning", about.get("range")) in lines[0]
        assert len(lines) == 1 + len(rules_of(about))


def test_lines(dump, save):
    status, lines, errors = dump(save(OVERVIEW))
    assert (status, errors) == (0, [])
    assert lines[0].split() == ["byte", "bit", "bits", "element", "value"]
    assert lines[1].split() == ["0", "0", "64", "magic", *OVERVIEW[:8].hex(" ").upper().split(), "[R-6.1-1]"]
    assert len(lines) == 1 + len(entries_of(OVERVIEW)[0])
    assert any(re.search(r" 57 +2 +8  symbol of position_high x, frame 0 +180  \[R-6.6-2\]", line) for line in lines)
    assert any(line.split()[3:6] == ["chunk_type,", "frame", "1"] and " P " in line for line in lines)


def test_runs_are_one_line_or_many(dump, save):
    path = save(RICH)
    few, many = dump(path)[1], dump(path, "--all")[1]
    assert not any("frequency[" in line for line in few)
    assert len(many) == 1 + sum(1 for entry in entries_of(RICH)[0] for _ in entry.items())
    assert any("values, " in line and "word of" in line for line in few)


def test_json(dump, save):
    status, lines, _ = dump(save(RICH), "--json")
    told = [json.loads(line) for line in lines]
    assert status == 0
    assert sum(one["bits"] for one in told) == 8 * len(RICH)
    width = next(one for one in told if one["name"] == "width")
    assert (width["value"], width["chunk"], width["frame"], "R-5-1" in width["rules"]) == (
        RICH_HEADER.width, "H", None, True
    )  # fmt: skip
    words = next(one for one in told if one["name"] == "word")
    assert words["count"] * 16 == words["bits"]
    assert words["minimum"] <= words["maximum"]


@pytest.mark.parametrize("span", ["0:1", "1:3", "3:", "4:9", "9:"])
def test_frames(dump, save, span):
    first, _, stop = span.partition(":")
    wanted = range(int(first), int(stop or 99))
    told = [json.loads(line) for line in dump(save(RICH), "--frames", span, "--json")[1]]
    expected = [entry for entry in entries_of(RICH)[0] if entry.frame in wanted]
    assert [(one["bit"], one["element"]) for one in told] == [(entry.bit, entry.full_name) for entry in expected]


def test_bits_of_all_kinds():
    lanes = find(entries_of(RICH)[0], "lane_state of position_low x, frame 0")
    assert name_at(RICH, lanes.bit + 33) == "lane_state[1] of position_low x, frame 0"
    word = find(entries_of(RICH)[0], "word of position_low x, frame 0")
    assert name_at(RICH, word.bit + 3 * 16 + 5) == "word[3] of position_low x, frame 0"
    place = place_of(RICH, word.bit + 3 * 16 + 5)
    assert place.before.full_name == "word[2] of position_low x, frame 0"
    assert place.after.full_name == "word[4] of position_low x, frame 0"
    first = place_of(RICH, 0)
    assert (first.before, first.entry.name, first.after.name) == (None, "magic", "version_major")
    last = place_of(RICH, 8 * len(RICH) - 1)
    assert (last.before.name, last.entry.full_name, last.after) == ("index_length", "chunk_crc, chunk E", None)
    size = len(chunk("E", bytes(8)))
    with_payload = OVERVIEW[:-size] + chunk("q", b"hidden") + OVERVIEW[-size:]
    assert name_at(with_payload, 8 * (len(OVERVIEW) - size + 4)) == "payload, chunk q"
    index = find(entries_of(RICH)[0], "frame_number_step")
    names = [item.full_name for item in index.items()]
    assert names[:3] == ["frame_number_step[0], chunk x", "offset_step[0], chunk x", "frame_number_step[1], chunk x"]


def test_at(dump, save):
    path = save(OVERVIEW)
    status, lines, _ = dump(path, "--at", "57:2")
    assert status == 0
    assert lines[0] == "byte 57 bit 2 (bit 458): symbol of position_high x, frame 0"
    assert lines[1] == "  u(w), 0 to alphabet − 1: The symbol of all splats (constant) or of splat i (raw)"
    assert [line[0] for line in lines[-3:]] == [" ", ">", " "]
    assert dump(path, "--at", "458")[1] == lines
    told = json.loads(dump(path, "--at", "458", "--json")[1][0])
    assert [told[place]["element"] for place in ("before", "here", "after")] == [
        "plane_mode of position_high x, frame 0", "symbol of position_high x, frame 0",
        "align() of position_high x, frame 0",
    ]  # fmt: skip


def test_bits_behind_the_end(dump, save):
    status, _, errors = dump(save(OVERVIEW), "--at", 8 * len(OVERVIEW))
    assert status == 2
    assert errors[0].endswith(f"has the bits 0 to {8 * len(OVERVIEW) - 1}")


@pytest.mark.parametrize(
    ("options", "message"),
    [(["--at", "x"], "neither a bit"), (["--at", "5:8"], "neither a bit"), (["--at", "5", "--all"], "drop --frames")],
)
def test_wrong_use(dump, save, options, message):
    status, _, errors = dump(save(OVERVIEW), *options)
    assert status == 2
    assert message in errors[0]


def test_a_damaged_stream(dump, save):
    lie = Lie("position_low[x].frequency", lambda table: [0, *table[1:]])
    path = save(write_stream(RICH_HEADER, rich_frames(), lies=[lie]))
    status, lines, errors = dump(path)
    assert status == 1
    assert errors[0].startswith(f"gsvc dump: {path} is damaged: invalid: ")
    at = next(i for i, line in enumerate(lines) if line.startswith("fault: invalid: "))
    assert "[R-6.6-4, byte " in lines[at]
    assert lines[at + 1] == "  at frequency[0] of position_low x, frame 0"
    assert lines[at + 2].startswith("  eg(golomb_order): The frequency of a symbol")
    assert any(line.startswith("  R-6.6-4  first_symbol MUST be less than last_symbol") for line in lines[at:])
    assert any("first_symbol of position_low x, frame 0" in line for line in lines[:at])
    told = json.loads(dump(path, "--json")[1][-1])
    assert told["fault"]["rule"] == "R-6.6-4"
    assert told["element"]["element"] == "frequency[0] of position_low x, frame 0"


def test_an_element_that_is_not_there(dump, save):
    path = save(OVERVIEW[:20])
    status, lines, _ = dump(path)
    assert status == 1
    assert "  instead of payload, chunk H" in lines
    status, lines, _ = dump(path, "--at", "999")
    assert status == 1
    assert lines[0] == "byte 124 bit 7 (bit 999) was not reached: the stream has a fault before it"


def test_no_stream(dump, save):
    status, lines, errors = dump(save(b"Dear reader"))
    assert status == 1
    assert "R-6.1-1" in errors[0]
    assert any(line.startswith("  at magic") for line in lines)
    assert dump("missing.gsvc")[0] == 2


def test_standard_input(dump, standard_input):
    standard_input(OVERVIEW)
    assert len(dump("-")[1]) == 1 + len(entries_of(OVERVIEW)[0])


@pytest.mark.skipif(not VECTORS.is_dir(), reason="vectors/ is not there")
def test_every_fault_of_the_vectors_has_an_element():
    """Names do not depend on the damage: a fault is at an element, all bits before it are named, none twice."""
    seen = 0
    for path in sorted(VECTORS.glob("faulty/*/*/stream.gsvc")):
        data = path.read_bytes()
        entries, fault, at_fault = entries_of(data)
        if fault is not None and entries:
            seen += 1
            assert_gapless(entries)
            assert at_fault is not None or fault.rule in NAMELESS_FAULTS, path
            assert at_fault is None or at_fault.bit <= fault.bit, path
    assert seen > 250


@pytest.mark.parametrize("seed", range(4))
def test_flipped_bytes(seed):
    """Whatever is damaged, nothing but the fault comes out, and the names are without a gap."""
    rng = np.random.default_rng(seed)
    for _ in range(60):
        data = bytearray(RICH)
        for _ in range(rng.integers(1, 4)):
            data[rng.integers(len(data))] = rng.integers(256)
        cut = bytes(data[: rng.integers(1, len(data) + 1)])
        entries, fault, at_fault = entries_of(cut)
        assert_gapless(entries)
        assert entries[0].bit == 0
        assert fault is None or at_fault is None or at_fault.full_name
        assert entries[-1].bit + entries[-1].bits <= 8 * len(cut)
        name_at(cut, int(rng.integers(8 * len(cut))))


@pytest.mark.parametrize("name", ["table_bits", "golomb_order", "word_count", "plane_mode", "codeword_count"])
def test_lies_with_checksums_made_right(name):
    """Lies that the checksum does not tell reach every part of the syntax."""
    count = sum(entry.name == name for entry in entries_of(RICH)[0])
    faults = 0
    for occurrence in range(0, count, 3):
        data = write_stream(RICH_HEADER, rich_frames(), lies=[Lie(name, 3, occurrence)])
        entries, fault, at_fault = entries_of(data)
        assert_gapless(entries)
        assert fault is None or at_fault is not None or fault.rule in NAMELESS_FAULTS
        faults += fault is not None
    assert faults > 0


LIES = {
    "raw_byte": lambda some: some[:0],
    "motion_cell": lambda _: 3,
    "lane_exponent": lambda _: 13,
    "lane_state": lambda states: np.full_like(states, 1 << 16),
    "word": lambda words: words[:0],
}


@pytest.mark.parametrize("name", LIES)
def test_lies_in_frames_of_profile_main(dump, save, name):
    """A frame may have no words, and an element no meaning beside its range."""
    faults = set()
    for number in range(24):
        stream = random_main_stream(number // 2, max_frames=2, max_count=number % 4, max_pixels=16)
        lie = Lie(name, LIES[name])
        try:
            data = write_stream(stream.header, stream.frames, lies=[lie])
        except UsageError:  # it has no such element
            continue
        status, lines, _ = dump(save(data), *["--all"][: number % 2])
        assert status in (0, 1)
        faults |= {lines[at + 1].split()[1].strip(",") for at, line in enumerate(lines) if line.startswith("fault: ")}
    assert faults


def test_an_element_of_a_run_without_any_bits():
    """Symbols of an alphabet of one take no bits: each bit after them finds the last."""
    run = Entry(80, 0, "symbol", "position_low x", "", "I", 0, np.zeros(3, np.int64), first=0)
    assert run.item_at(80).full_name == "symbol[2] of position_low x, frame 0"
    none = replace(run, value=np.zeros(0, np.int64))
    assert none.item_at(80) is none


def test_output_that_nobody_reads(dump, save, monkeypatch):
    """A closed pipe ends the command as it ends the others."""

    class Closed(io.StringIO):
        def write(self, text):
            raise BrokenPipeError

    path = save(RICH)
    monkeypatch.setattr("sys.stdout", Closed())
    assert main(["dump", str(path)]) == 141


def test_progress_is_shown_on_a_terminal(save, monkeypatch, capsys):
    """Of a long listing whose lines go to a file."""
    shown = []
    monkeypatch.setattr("gsvc_base.cli.progress.DELAY_S", 0.0)
    monkeypatch.setattr("gsvc_base.cli.progress.INTERVAL_S", 0.0)
    monkeypatch.setattr("gsvc_base.cli.progress.ProgressDisplay._show", lambda _, text, share: shown.append(share))
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    assert main(["dump", str(save(RICH))]) == 0
    assert shown == sorted(shown)
    assert len(shown) > 10


def test_the_readme_names_it():
    assert "gsvc dump" in (Path(SPEC).parent / "docs" / "encode-and-look.md").read_text(encoding="utf-8")
