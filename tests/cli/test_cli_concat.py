"""``gsvc concat``: files joined without decoding; what is said, and what stands under the name when it fails."""

import io
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import QUICK

import gsvc_ref
import gsvc_tools.editing
from gsvc_base.files import opened_output
from gsvc_ref.cli import main
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, write_stream
from gsvc_tools.cli import concat

OVERVIEW = write_stream(OVERVIEW_HEADER, overview_frames())


@pytest.fixture
def parts(tmp_path) -> list[Path]:
    """Two files of three frames each."""
    paths = [tmp_path / "morning.gsvc", tmp_path / "noon.gsvc"]
    for path in paths:
        path.write_bytes(OVERVIEW)
    return paths


@pytest.fixture
def fails(capsys, tmp_path):
    """Run the command, which must fail and leave the folder as it was: its message."""

    def run(status, *arguments):
        before = {path: path.read_bytes() for path in tmp_path.iterdir()}
        assert main(["concat", *map(str, arguments)]) == status
        assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
        out, error = capsys.readouterr()
        assert out == ""
        assert error.startswith("gsvc concat: ")
        assert error.count("\n") == 1
        return error

    return run


def test_encoded_clips_are_joined(clip, stream, tmp_path, capsys):
    """Frames of the encoder, with its log: the same pictures one after the other."""
    out = tmp_path / "out.gsvc"
    assert main(["concat", str(stream), str(stream), "-o", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{out}: {out.stat().st_size:,} bytes, 8 frames"
    assert lines[1:3] == [f"  frames 0 to 3  {stream}", f"  frames 4 to 7  {stream}"]
    assert lines[3].startswith("  left out: 2 chunks d")
    one, both = list(gsvc_ref.decode(stream)), list(gsvc_ref.decode(out))
    assert [np.array_equal(a, b) for a, b in zip(both, one + one, strict=True)] == [True] * 8
    assert main(["info", str(out)]) == 0
    (frame,) = gsvc_ref.decode(out, start=6, stop=7)  # through the new index
    assert np.array_equal(frame, one[2])


def test_json(parts, tmp_path, capsys):
    out = tmp_path / "out.gsvc"
    assert main(["concat", *map(str, parts), "-o", str(out), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["parts"] == [
        {"input": str(parts[0]), "first_frame": 0, "frame_count": 3},
        {"input": str(parts[1]), "first_frame": 3, "frame_count": 3},
    ]
    assert (report["frame_count"], report["file_bytes"], report["left_out"]) == (6, out.stat().st_size, {})
    assert report["header"]["frame_count"] == 6


def test_quiet(parts, tmp_path, capsys):
    assert main(["concat", *map(str, parts), "-o", str(tmp_path / "out.gsvc"), "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_pipes(parts, tmp_path):
    run = subprocess.run(
        [sys.executable, "-m", "gsvc_ref", "concat", "-", str(parts[0]), "-o", "-"], input=OVERVIEW, capture_output=True
    )
    assert run.returncode == 0
    assert run.stdout == _joined(*parts)
    assert b"standard output: " in run.stderr
    assert b"  frames 0 to 2  standard input" in run.stderr


def _joined(*paths) -> bytes:
    out = io.BytesIO()
    gsvc_ref.concat(paths, out)
    return out.getvalue()


def test_progress_is_shown_on_a_terminal(parts, tmp_path, monkeypatch):
    said = []

    class Display(concat.ProgressDisplay):
        def __init__(self, **options):
            super().__init__(**options)
            self.active = True

        def update(self, text, done, total):
            said.append((text, done, total))

    monkeypatch.setattr(concat, "ProgressDisplay", Display)
    assert main(["concat", *map(str, parts), "-o", str(tmp_path / "out.gsvc"), "--quiet"]) == 0
    total = 2 * len(OVERVIEW)
    assert said[0][0].startswith(f"{parts[0]}, file 1/2, ")
    assert said[-1][0].startswith(f"{parts[1]}, file 2/2, ")
    assert {size for _, _, size in said} == {total}
    assert len(OVERVIEW) < said[-1][1] <= total


def test_a_header_that_differs(fails, parts, stream, tmp_path):
    error = fails(2, parts[0], stream, "-o", tmp_path / "out.gsvc")
    assert f"`profile` is 0 in {parts[0]} and 1 in {stream}" in error
    assert "encode one of them again" in error


@pytest.mark.parametrize("first", [True, False])
def test_a_damaged_part(fails, parts, tmp_path, first):
    data = bytearray(OVERVIEW)
    data[80] ^= 1
    damaged, out = tmp_path / "damaged.gsvc", tmp_path / "out.gsvc"
    damaged.write_bytes(data)
    out.write_bytes(b"an older file")
    error = fails(1, *([damaged, parts[0]] if first else [parts[0], damaged]), "-o", out)
    assert f"malformed: {damaged}: the checksum of a chunk I is wrong" in error
    assert "fetch it again, or leave it out [R-6.2-2, byte 102 bit 0]" in error


def test_no_stream(fails, clip, parts, tmp_path):
    assert f"malformed: {clip}: this is not a .gsvc stream" in fails(1, parts[0], clip, "-o", tmp_path / "out.gsvc")


def test_wrong_use(fails, parts, tmp_path, standard_input):
    out = tmp_path / "out.gsvc"
    assert "there is no file" in fails(2, parts[0], tmp_path / "missing.gsvc", "-o", out)
    assert "is a folder" in fails(2, parts[0], tmp_path.parent, "-o", out)
    assert "is the input itself" in fails(2, *parts, "-o", parts[1])
    assert "does not exist" in fails(2, *parts, "-o", tmp_path / "no" / "out.gsvc")
    assert "required: -o/--output" in fails(2, *parts)
    assert "required: IN" in fails(2, "-o", out)
    assert "--json needs standard output" in fails(2, *parts, "-o", "-", "--json")
    standard_input(OVERVIEW)
    assert "only one part can come from standard input" in fails(2, "-", "-", "-o", out)


def test_ctrl_c_leaves_the_old_file(parts, tmp_path, monkeypatch, capsys):
    out = tmp_path / "out.gsvc"
    out.write_bytes(b"an older file")

    def interrupted(*arguments, **options):
        with opened_output(out) as file:
            file.write(b"half")
            raise KeyboardInterrupt

    monkeypatch.setattr(gsvc_tools.editing, "concat", interrupted)
    assert main(["concat", *map(str, parts), "-o", str(out)]) == 130
    assert capsys.readouterr().err == "gsvc concat: interrupted; nothing was written\n"
    assert out.read_bytes() == b"an older file"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["morning.gsvc", "noon.gsvc", "out.gsvc"]


KILLED = """
import itertools, os, signal, sys
import gsvc_ref
from gsvc_tools.editing import copying
steps, write = itertools.count(), copying.write_all
def killing(target, data):
    if next(steps) == int(sys.argv[1]):
        target.flush()
        os.kill(os.getpid(), signal.SIGKILL)
    write(target, data)
copying.write_all = killing
gsvc_ref.concat(sys.argv[2:4], sys.argv[4])
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.exhaustive
@pytest.mark.parametrize("step", [0, 7, 25, 10_000])
def test_killed_at_any_moment_it_leaves_the_old_file_or_the_whole_new_one(parts, tmp_path, step):
    out = tmp_path / "out.gsvc"
    out.write_bytes(b"an older file")
    run = subprocess.run([sys.executable, "-c", KILLED, str(step), *map(str, parts), str(out)], capture_output=True)
    if step == 10_000:
        assert (run.returncode, out.read_bytes()) == (0, _joined(*parts))
    else:
        assert (run.returncode, out.read_bytes()) == (-signal.SIGKILL, b"an older file")
    assert main(["concat", *map(str, parts), "-o", str(out), "--quiet"]) == 0  # what was left behind is cleared away
    assert sorted(path.name for path in tmp_path.iterdir()) == ["morning.gsvc", "noon.gsvc", "out.gsvc"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no full device")
def test_a_full_disk(fails, parts):
    assert "/dev/full: No space left" in fails(1, *parts, "-o", "/dev/full")


def test_clips_of_other_settings_say_what_to_do(clip, tmp_path, capsys):
    other = tmp_path / "other.gsvc"
    eight, nine = ([*QUICK, "--profile", "paper", "--iterations", "2", "--cholesky-bits", b] for b in "89")
    stream = tmp_path / "eight.gsvc"
    assert main(["encode", str(clip), str(stream), *eight]) == 0
    assert main(["encode", str(clip), str(other), *nine]) == 0
    assert StreamReader(other.read_bytes()).header.cholesky_bits == 9
    assert main(["concat", str(stream), str(other), "-o", str(tmp_path / "out.gsvc")]) == 2
    assert "`cholesky_bits` is " in capsys.readouterr().err
