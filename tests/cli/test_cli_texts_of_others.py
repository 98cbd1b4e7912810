"""Names, tags and streams that others made: none commands the terminal, closes a stream or hides where it was."""

import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.cli.text import printable
from gsvc_ref.cli import main

ROOT = Path(__file__).parents[2]
COMMANDS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")

posix = pytest.mark.skipif(os.name != "posix", reason="pipes and streams of POSIX")


@given(st.text(st.characters(codec=None)))
def test_only_what_can_be_seen_comes_through(text):
    shown = printable(text)
    assert not COMMANDS.search(shown)
    assert printable(shown) == shown
    if not COMMANDS.search(text):
        assert shown == text


def test_letters_of_all_kinds_stay_as_they_are():
    text = "a\tb\nÄö 漢字 עברית 🎬 é"
    assert printable(text) == text
    assert printable("\x1b[31m\x9b\x7f\u202e\udcff\r") == r"\x1b[31m\x9b\x7f\u202e\udcff\r"


def test_all_that_commands_print_goes_through_one_function():
    """So that nothing added later lets a terminal be commanded."""
    sources = [
        *ROOT.glob("gsvc_base/cli/*.py"),
        *ROOT.glob("gsvc_ref/cli/*.py"),
        *ROOT.glob("gsvc_tools/cli/*.py"),
        *ROOT.glob("conformance/gsvc_conformance/commands/*.py"),
        ROOT / "conformance/gsvc_conformance/__main__.py",
    ]
    found = [
        (path.name, line.strip())
        for path in sources
        for line in path.read_text(encoding="utf-8").splitlines()
        if re.search(r"(?<![\w.])print\(|std(out|err)\.write\(", line)
    ]
    assert found == [("text.py", 'print(printable("\\n".join(lines)), file=file, flush=True)')]


@pytest.mark.parametrize(
    "tag", ["C\x1b]0;owned\x07", "I\x1b[31m", "F\x1b[31m", "A\x1b[31m", "W\x1b[31m", "XGSVC_COLOR=\x1b"]
)
def test_tags_of_a_video(tmp_path, capsys, tag):
    path = tmp_path / "x.y4m"
    size = "" if tag[0] == "W" else "W48 "
    path.write_bytes(f"YUV4MPEG2 {size}H32 {tag}\nFRAME\n".encode("latin-1"))
    assert main(["encode", str(path), str(tmp_path / "x.gsvc")]) == 1
    out, err = capsys.readouterr()
    assert r"\x1b" in err
    assert not COMMANDS.search(out + err)


@posix
def test_the_name_of_a_file(clip, tmp_path, capsys):
    path = tmp_path / os.fsdecode(b"a\x1b[31m\xffb.y4m")
    path.write_bytes(clip.read_bytes())
    assert main(["encode", str(path), str(tmp_path / "x.gsvc"), "--splats", "12"]) == 0
    assert main(["encode", str(path), str(path)]) == 2
    assert main(["encode", "\x1b[31m", "--\x1b[31m"]) == 2
    out, err = capsys.readouterr()
    assert r"a\x1b[31m\udcffb.y4m: 32x24" in out
    assert not COMMANDS.search(out + err)


@posix
@pytest.mark.parametrize(
    ("number", "words", "what"), [(0, ["info", "-"], "input"), (1, ["scene", "pan", "-"], "output")]
)
def test_a_closed_stream_is_no_terminal(number, words, what):
    closing = f'exec "$@" {number}{"<" if number == 0 else ">"}&-'
    command = ["sh", "-c", closing, "sh", sys.executable, "-m", "gsvc_ref", *words]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=100)
    assert run.returncode == 2
    assert f"standard {what}, which is closed" in run.stderr


@posix
def test_a_stream_in_a_pipe_is_not_called_a_bad_video(clip, stream, tmp_path, capsys):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    feeding = threading.Thread(target=lambda: pipe.write_bytes(stream.read_bytes()[:100]))
    feeding.start()
    assert main(["compare", str(clip), str(pipe), "--no-vmaf"]) == 2
    feeding.join()
    err = capsys.readouterr().err
    assert "pipe holds a GSVC stream" in err
    assert "save it to a file" in err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
@pytest.mark.parametrize(
    ("words", "name"),
    [
        (["decode", "STREAM", "-"], "standard output"),
        pytest.param(["decode", "STREAM", "/dev/full", "--quiet"], "/dev/full", marks=pytest.mark.exhaustive),
        pytest.param(["encode", "CLIP", "-", "--splats", "12"], "standard output", marks=pytest.mark.exhaustive),
        (["encode", "CLIP", "/dev/full", "--splats", "12", "--quiet"], "/dev/full"),
        (["info", "STREAM"], "standard output"),
        pytest.param(["info", "STREAM", "--json"], "standard output", marks=pytest.mark.exhaustive),
    ],
)
def test_a_full_disk_names_what_was_written(clip, stream, words, name):
    words = [{"STREAM": str(stream), "CLIP": str(clip)}.get(word, word) for word in words]
    with open("/dev/full", "wb") as full:
        run = subprocess.run(
            [sys.executable, "-m", "gsvc_ref", *words],
            cwd=ROOT,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=300,
        )
    assert run.returncode == 1
    assert f"gsvc {words[0]}: {name}: No space left on device" in run.stderr
