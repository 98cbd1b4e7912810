"""``gsvc encode`` with a source that breaks off: what was saved is told, the fault is told, and the exit code is 1."""

import json
import signal

import pytest

import gsvc_ref
from gsvc_ref.cli import main
from gsvc_ref.cli.encode_text import summary

QUICK = ["--splats", "12", "--key-frames", "2"]


@pytest.fixture
def cut(clip, tmp_path):
    path = tmp_path / "cut.y4m"
    path.write_bytes(clip.read_bytes()[:-100])
    return path


@pytest.mark.parametrize("compiled", [False, True])
def test_seconds_a_frame_that_hold_compilation_say_so(clip, tmp_path, compiled):
    report = gsvc_ref.encode(clip, tmp_path / "out.gsvc", gsvc_ref.Settings.quick(splats=12))
    line = summary("out.gsvc", report, compiled=compiled)[-1]
    assert line.endswith(" with the compilation of kernels") == compiled


@pytest.mark.parametrize("options", [[], ["--live"]])
def test_the_summary_and_the_fault_are_told(cut, tmp_path, capsys, options):
    out = tmp_path / "out.gsvc"
    assert main(["encode", str(cut), str(out), *QUICK, *options]) == 1
    told = capsys.readouterr()
    assert f"{out}: {out.stat().st_size:,} bytes" in told.out
    assert "  3 frames: 2 I, 1 P" in told.out
    assert told.err == (
        f"gsvc encode: malformed: {cut} is cut off in frame 3: 100 of its 1152 bytes are missing"
        "; saved: 3 complete frames, as a valid stream\n"
    )
    assert main(["info", str(out)]) == 0


def test_quiet_says_only_the_fault(cut, tmp_path, capsys):
    assert main(["encode", str(cut), str(tmp_path / "out.gsvc"), *QUICK, "--quiet"]) == 1
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("\n") == 1


def test_json_has_both(cut, tmp_path, capsys):
    out = tmp_path / "out.gsvc"
    assert main(["encode", str(cut), str(out), *QUICK, "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["file_bytes"] == out.stat().st_size
    assert len(report["frames"]) == 3
    assert not report["interrupted"]
    assert report["fault"].startswith(f"malformed: {cut} is cut off in frame 3")


def test_signals_are_handled_as_before_afterwards(cut, tmp_path):
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    main(["encode", str(cut), str(tmp_path / "out.gsvc"), *QUICK, "--quiet"])
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
