"""``gsvc encode --effects`` and ``gsvc info --decisions``."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from conftest import QUICK, video_format

from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.cli import main
from gsvc_ref.cli.encode_text import effects_line
from gsvc_ref.encoder.effects import EFFECT_NAMES
from gsvc_ref.encoder.log import Decision
from gsvc_ref.testing import join_chunks, split_chunks
from gsvc_ref.video import open_writer
from gsvc_tools.cli.decisions import MAX_RUNS, decision_lines


def encode(clip, path, *options) -> int:
    return main(["encode", str(clip), str(path), *QUICK[:4], *options])


@pytest.fixture
def still(tmp_path):
    """Two frames, the second twice."""
    path = tmp_path / "still.y4m"
    pictures = np.random.default_rng(3).integers(20, 230, (2, 24, 32, 3), np.uint8)
    with open_writer(path, video_format(chroma_format="444")) as writer:
        for number in (0, 1, 1):
            writer.write(pictures[number])
    return path


PAPER = ["--profile", "paper", "--iterations", "2"]


def test_the_effects_are_told_and_what_they_left_out(still, tmp_path, capsys):
    options = ["--key-frames", "9", "--effects", "auto,motion=off"]
    assert encode(still, tmp_path / "a.gsvc", *options, "--verbose", *PAPER) == 0
    out = capsys.readouterr().out
    assert "effects auto,motion=off, seed 0" in out
    told = "  effects: 1 frame repeated, DKS pre-trained 0 of 3 frames, GSA in [01] of 1 P-frame, static splats in "
    assert re.search(told, out)
    assert encode(still, tmp_path / "a.gsvc", "--key-frames", "9", "--effects", "all", "--json", *PAPER) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["settings"]["effects"]["frames"] == "all"
    assert [frame["type"] for frame in report["frames"]] == ["I", "P", "P"]
    for frame in report["frames"]:
        assert [one["effect"] for one in frame["decisions"]] == list(EFFECT_NAMES)
        assert all(one["reason"] and one["seconds"] >= 0 for one in frame["decisions"])


def test_unknown_effects_are_a_usage_error(clip, tmp_path, capsys):
    assert encode(clip, tmp_path / "a.gsvc", "--effects", "auto,gsa=maybe") == 2
    assert "gsa is 'maybe'; it must be auto or all or off" in capsys.readouterr().err


def test_info_tells_the_decisions_of_a_stream(still, tmp_path, capsys):
    path = tmp_path / "a.gsvc"
    assert encode(still, path, "--key-frames", "9", "--quiet") == 0
    assert main(["info", str(path)]) == 0
    assert "mostly" not in capsys.readouterr().out
    assert main(["info", str(path), "--decisions"]) == 0
    out = capsys.readouterr().out
    assert "ancillary" in out
    assert "  left out  equal to the frame before" in out
    assert main(["info", str(path), "--decisions", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert len(told["decisions"]) == 3
    assert told["decisions"][2][0]["reason"] == "equal to the frame before"
    assert told["decisions_note"] is None


def test_a_stream_without_them_says_so_and_what_to_do(still, tmp_path, capsys):
    path = tmp_path / "a.gsvc"
    assert encode(still, path, "--key-frames", "9", "--quiet", "--no-decisions") == 0
    assert main(["info", str(path), "--decisions"]) == 0
    assert "note: the stream does not tell what the encoder decided; encode it again" in capsys.readouterr().out


def test_a_foreign_or_broken_chunk_is_a_note(still, tmp_path, capsys):
    path = tmp_path / "a.gsvc"
    assert encode(still, path, "--key-frames", "9", "--quiet") == 0
    whole = path.read_bytes()
    chunks = split_chunks(whole)
    for payload in (b"", b"not ours", b"DEC\x01\x03\x00\x00\x00" + bytes(40), b"LOG\x01", b"LOG\x01" + bytes(40)):
        changed = [(kind, payload if kind == b"d" else data) for kind, data in chunks]
        path.write_bytes(join_chunks(changed, prefix=whole[:PREFIX_SIZE]))
        assert main(["info", str(path), "--decisions"]) == 0
        assert re.search("note: the (chunk of type d|log of decisions)", capsys.readouterr().out)
        assert main(["info", str(path), "--decisions", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["decisions"] == []
    path.write_bytes(path.read_bytes()[:-40])
    assert main(["info", str(path), "--decisions"]) == 1
    assert "what is left of it does not tell" in capsys.readouterr().out


def test_a_long_video_stays_readable():
    one = [Decision(name, True, "asked for") for name in EFFECT_NAMES]
    clip = [[replace(d, done=bool(n % 2)) if d.effect == "gsa" else d for d in one] for n in range(1000)]
    clip[7][4] = Decision("gsp", True, "1,234 splats make room for new ones")
    lines = decision_lines(clip)
    assert len(lines) < 3 * len(EFFECT_NAMES) + MAX_RUNS + 10
    assert f"    and {1000 - MAX_RUNS} more runs (--json has all)" in lines
    assert "            0-6  done      asked for" in lines
    assert "              7  done      1,234 splats make room for new ones" in lines
    assert "GSA in 500 of 999 P-frames" in effects_line(clip, ["I", *["P"] * 999])


def test_reasons_that_differ_in_numbers_alone_are_one_run():
    """A table of the effects and their runs says of such numbers the least and the greatest."""
    shares = ("9 % of the splats", "0.5 % of the splats", "1,200 % of the splats", "none of the splats")
    column = [[Decision("regions", False, share)] for share in shares]
    lines = decision_lines(column)
    assert "            0-2  left out  0.5 to 1,200 % of the splats" in lines
    assert "              3  left out  none of the splats" in lines
    assert "0.5 to 1,200 % of the splats (3 of 4)" in lines[1]
