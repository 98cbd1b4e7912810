"""``gsvc-conformance legal``: whether the file of an encoder is a stream, and what is wrong with it."""

import json

import pytest

from gsvc_conformance.__main__ import main
from gsvc_conformance.cases.faults import overview, rich
from gsvc_conformance.commands import legal
from gsvc_conformance.commands.legal import examine, sentence
from gsvc_ref.errors import GsvcError
from gsvc_ref.testing import Lie


def test_legal_streams(tmp_path, capsys):
    files = [tmp_path / "a.gsvc", tmp_path / "b.gsvc"]
    files[0].write_bytes(overview())
    files[1].write_bytes(rich(level=3))
    assert main(["legal", *map(str, files)]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{files[0]}: legal, class stream, profile paper, level 1")
    assert first.endswith(": 3 frames")
    assert second.startswith(f"{files[1]}: legal, class stream, profile paper, level 3")
    assert second.endswith(": 5 frames")


def test_a_fault_has_kind_rule_bit_and_element(tmp_path, capsys):
    good, bad = tmp_path / "good.gsvc", tmp_path / "bad.gsvc"
    good.write_bytes(overview())
    bad.write_bytes(overview(Lie("frame_number", 9, 2)))
    assert main(["legal", str(bad), str(good)]) == 1
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{bad}: refused (invalid R-6.4-1 ")
    assert ") after 2 frames, at frame_number: " in first
    assert "9" in first.partition("frame_number: ")[2]
    assert ": legal, " in second
    assert main(["legal", "--json", str(bad)]) == 1
    (finding,) = json.loads(capsys.readouterr().out)
    assert (finding["legal"], finding["frames"], finding["level"]) == (False, 2, 1)
    assert finding["error"].split()[:2] == ["invalid", "R-6.4-1"]


@pytest.mark.parametrize("data", [b"", b"no stream", overview()[:20]])
def test_what_has_no_header_has_no_level(data):
    finding = examine("x", data)
    assert not finding.legal
    assert (finding.profile, finding.level, finding.paced) == (None, None, None)
    assert sentence(finding).startswith("x: refused (malformed ")


def test_decoders_that_disagree_are_told(monkeypatch):
    def refuse(data):
        raise GsvcError("limit", "too much", rule="R-5-4", bit=99)

    monkeypatch.setattr(legal, "_frames_by_reference", refuse)
    finding = examine("x", overview())
    assert not finding.legal
    assert sentence(finding) == (
        "x: legal with 3 frames by spec.md, refused (limit R-5-4 99) after 0 frames by gsvc_ref: "
        "please report it with the file"
    )


def test_a_file_that_is_not_there(tmp_path, capsys):
    assert main(["legal", str(tmp_path / "none.gsvc")]) == 2
    assert "cannot be read" in capsys.readouterr().err
