"""``gsvc-conformance check``: whether files are legal streams, what is wrong with them, and what they ask for."""

import io
import json

import pytest

from gsvc_base.draws import Draws
from gsvc_base.errors import GsvcError
from gsvc_conformance.__main__ import main
from gsvc_conformance.cases.faults import overview, rich
from gsvc_conformance.cases.main_layers import BASE, LAYERS, with_layers
from gsvc_conformance.commands import check
from gsvc_conformance.commands.check import REFERENCE, SPEC, Frame, examine, least_level, sentence
from gsvc_conformance.diagnosis.streams import element_at
from gsvc_conformance.encoding import Decoding
from gsvc_conformance.spec import namespace
from gsvc_conformance.vector import VECTORS
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.testing import Lie, join_chunks, split_chunks
from tests.main.material import growing, stream_of


def test_legal_streams(tmp_path, capsys):
    files = [tmp_path / "a.gsvc", tmp_path / "b.gsvc"]
    files[0].write_bytes(overview())
    files[1].write_bytes(rich(level=3))
    assert main(["check", *map(str, files)]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{files[0]}: legal, class stream, profile paper, level 1")
    assert first.endswith(f"not paced: 3 frames, 1 I-frame (0), {len(overview())} bytes")
    assert second.startswith(f"{files[1]}: legal, class stream, profile paper, level 3")
    assert "level 3 (1 would do)" in second
    assert ": 5 frames, " in second


def test_a_fault_has_kind_rule_bit_and_element(tmp_path, capsys):
    good, bad = tmp_path / "good.gsvc", tmp_path / "bad.gsvc"
    good.write_bytes(overview())
    bad.write_bytes(overview(Lie("frame_number", 9, 2)))
    assert main(["check", str(bad), str(good)]) == 1
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{bad}: refused (invalid R-6.4-1 ")
    assert ") after 2 frames, at frame_number: " in first
    assert "9" in first.partition("frame_number: ")[2]  # the words are those of gsvc_ref
    assert ": legal, " in second
    assert main(["check", "--json", str(bad)]) == 1
    (finding,) = json.loads(capsys.readouterr().out)
    assert (finding["legal"], len(finding["frames"]), finding["level"]) == (False, 2, 1)
    assert finding["element"] == "frame_number"
    assert finding["error"].split()[:2] == ["invalid", "R-6.4-1"]


@pytest.mark.parametrize("data", [b"", b"no stream", overview()[:20]])
def test_what_has_no_header_has_no_level(data):
    finding = examine("x", data)
    assert not finding.legal
    assert (finding.profile, finding.level, finding.paced) == (None, None, None)
    assert sentence(finding).startswith("x: refused (malformed ")


def test_decoders_that_disagree_are_told(monkeypatch):
    def refuse(data, quality):
        raise GsvcError("limit", "too much", rule="R-5-4", bit=99)

    monkeypatch.setattr(check, "_reference_frames", refuse)
    finding = examine("x", overview())
    assert not finding.legal
    assert sentence(finding) == (
        "x: legal with 3 frames by spec.md, refused (limit R-5-4 99) after 0 frames by gsvc_ref: "
        "please report it with the file"
    )


def test_layers_are_read(tmp_path, capsys):
    """A layer that repeats takes the frame beyond its level, by both decoders; at the next one it is legal."""
    finding = examine("x", growing("the base grows", 1))
    assert (finding.error.split()[:2], finding.element, finding.other) == (["limit", "R-5-2"], "layer_type", "")
    assert (finding.legal, finding.quality, finding.layer) == (False, 0, 1)
    assert finding.message == "with layer 1 repeated the frame has 16510 splats; level 1 allows 16384"
    finding = examine("x", growing("the base grows", 2))
    assert finding.legal
    assert finding.least_level == 2
    assert [frame.splats for frame in finding.frames] == [16010, 16510]
    assert finding.quality == 2


def test_the_seconds_of_a_stream_count_all_layers():
    header = {"width": 4, "height": 4, "flags": 2, "frame_rate_numerator": 100, "frame_rate_denominator": 1}
    assert least_level(header, (Frame("I", 12_000, 1, 9),) * 100, 9) == 2


def test_the_greatest_legal_quality_is_told(tmp_path, capsys):
    """Each quality is decoded (R-13-9): a chunk of layer 2 that is missing leaves quality 1 legal."""
    lost = [(entry.frame, entry.layer) for entry in LAYERS if entry.layer == 2][:1]
    for missing, told in (
        ([], "legal of every quality up to 3, class stream"),
        (lost, "legal of quality 1; with layer 2 refused"),
    ):
        data = with_layers(Draws(19), BASE, LAYERS, lost=missing)
        path = tmp_path / "a.gsvc"
        path.write_bytes(data)
        assert main(["check", str(path)]) == (1 if missing else 0)
        assert told in capsys.readouterr().out
        finding = examine("x", data)
        assert (finding.quality, finding.layer) == ((1, 2) if missing else (3, None))
        assert finding.other == ""
    assert finding.error.split()[1] == "R-15.13-6"


def test_a_layer_where_there_are_none_is_refused():
    """A decoder of the base skips it, and so does one of profile `paper`, to which it is an ancillary chunk."""
    base, layered = stream_of("IP"), with_layers(Draws(19), BASE, LAYERS)
    layer = next(chunk for chunk in split_chunks(layered) if chunk[0] == b"n")
    for data, legal in ((base, False), (overview(), True)):
        chunks = split_chunks(data)
        finding = examine("x", join_chunks([*chunks[:2], layer, *chunks[2:]], prefix=data[:PREFIX_SIZE]))
        assert finding.legal == legal
        assert finding.other == ""
        if not legal:
            assert (finding.error.split()[1], finding.quality, finding.layer) == ("R-15.13-1", 0, 1)
    chunks = split_chunks(base)
    of_no_frame = examine("x", join_chunks([chunks[0], layer, *chunks[1:]], prefix=base[:PREFIX_SIZE]))
    assert (of_no_frame.legal, of_no_frame.quality, of_no_frame.layer) == (True, 0, None)


def test_bytes_of_layers_are_those_of_their_frames():
    data = with_layers(Draws(19), BASE, LAYERS)
    first = namespace()["open_stream"](data)[0].position() // 8
    assert sum(frame.bytes for frame in examine("x", data).frames) == len(data) - first - 14


def test_without_gsvc_ref_the_decoder_of_spec_md_is_asked(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("gsvc_conformance.reference.find_spec", lambda name: None)
    monkeypatch.setattr(check, "_reference_frames", None)  # whoever calls it fails
    bad = tmp_path / "bad.gsvc"
    bad.write_bytes(overview(Lie("frame_number", 9, 2)))
    assert main(["check", str(bad)]) == 1
    said = capsys.readouterr().out
    assert " after 2 frames, at frame_number: In profiles `paper` and `main`, `frame_number` MUST be 0 for " in said


def test_one_decoder_can_be_asked(tmp_path, capsys):
    path = tmp_path / "a.gsvc"
    path.write_bytes(overview())
    for name in (SPEC, REFERENCE):
        assert main(["check", "--json", "--only", name, str(path)]) == 0
        (finding,) = json.loads(capsys.readouterr().out)
        assert finding["decoders"] == [name]
        assert [frame["type"] for frame in finding["frames"]] == ["I", "P", "R"]


def test_bytes_of_frames_are_those_of_the_file(tmp_path, capsys):
    path = tmp_path / "a.gsvc"
    path.write_bytes(overview())
    finding = examine("x", overview())
    first = namespace()["open_stream"](overview())[0].position() // 8
    end = 9 + 14  # the index and the end chunk
    assert sum(frame.bytes for frame in finding.frames) == finding.bytes - first - end
    assert finding.bytes == len(overview())
    assert main(["check", "--frames", str(path)]) == 0
    _, *lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3
    assert lines[0].startswith("  frame 0: I, 1 splat, work 156, 54 bytes")


@pytest.mark.parametrize(
    ("splats", "work", "payload", "level"),
    [(1, 1, 1, 1), (2**14, 2**25, 2**20, 1), (2**14 + 1, 1, 1, 2), (1, 2**28 + 1, 1, 3), (1, 1, 2**24 + 1, 4)],
)
def test_the_least_level_is_that_of_the_largest_frame(splats, work, payload, level):
    header = {"width": 4, "height": 4, "flags": 0, "frame_rate_numerator": 25, "frame_rate_denominator": 1}
    frames = (Frame("I", 1, 1, 9), Frame("P", splats, work, 9))
    assert least_level(header, frames, payload) == level


def test_the_least_level_of_a_paced_stream_is_that_of_its_seconds():
    """100 frames of 12,000 splats are within a frame's limit of level 1, and beyond that of a second (2^20)."""
    header = {"width": 4, "height": 4, "flags": 2, "frame_rate_numerator": 100, "frame_rate_denominator": 1}
    assert least_level(header, (Frame("I", 12_000, 1, 9),) * 100, 9) == 2
    assert least_level(header | {"flags": 0}, (Frame("I", 12_000, 1, 9),) * 100, 9) == 1
    assert least_level(header | {"frame_rate_numerator": 50}, (Frame("I", 12_000, 1, 9),) * 100, 9) == 1


def test_elements_by_the_lines_of_spec_md_are_those_of_gsvc_ref():
    """But where gsvc_ref names what holds the bit, and not what was to be read there, or names it by its plane."""
    others = {
        ("survivor_map", "plane_mode"), ("position_high", "plane_mode"), ("magic", ""), ("chunk_length", ""),
        ("chunk_type", ""), ("version_minor", ""), ("", "payload"), ("frame_number", "chunk_crc"),
        ("frame_number_step", "chunk_crc"), ("lane_count", "chunk_crc"), ("plane_mode", "chunk_crc"),
        ("chunk_crc", ""), ("raw_byte", "payload"), ("raw_byte", "word"), ("word", "chunk_crc"),
        ("main_tools", "chunk_crc"), ("quantizer", "chunk_crc"),
    }  # fmt: skip
    same = 0
    for home in sorted((VECTORS / "faulty/reconstruct_stream").iterdir()):
        stream = (home / "stream.gsvc").read_bytes()
        decoding = Decoding(stream)
        assert sum(1 for _ in decoding.frames()) == decoding.count
        fault = decoding.fault
        if fault is not None:
            pair = fault.element, element_at(stream, fault.bit).partition(" of ")[0]
            same += pair[0] == pair[1]
            assert pair[0] == pair[1] or pair in others, (home.name, fault.rule, pair)
    assert same > 250


def test_a_file_that_is_not_there_keeps_none_from_being_judged(tmp_path, capsys):
    good = tmp_path / "good.gsvc"
    good.write_bytes(overview())
    assert main(["check", str(tmp_path / "none.gsvc"), str(good), str(tmp_path / "lost.gsvc")]) == 2
    shown = capsys.readouterr()
    assert shown.out.startswith(f"{good}: legal, ")
    assert all(f"{name}.gsvc cannot be read" in shown.err for name in ("none", "lost"))


def test_standard_input(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(overview())))
    assert main(["check", "-"]) == 0
    assert capsys.readouterr().out.startswith("standard input: legal, ")
