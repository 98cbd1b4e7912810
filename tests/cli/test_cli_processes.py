"""What only a process of its own can show: start, signals, pipes; few, because each start costs a second."""

import json
import signal
import subprocess
import sys

import pytest

import gsvc_ref
from gsvc_ref.cli import main
from gsvc_ref.video import open_video

GSVC = [sys.executable, "-m", "gsvc_ref"]
TIMEOUT_S = 120

START = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
from gsvc_ref.cli import main
raise SystemExit(main())
"""


def test_help_and_version_import_nothing_heavy():
    script = (
        "import sys; from gsvc_ref.cli import main\n"
        "codes = [main(['--version']), main(['encode', '--help'])]\n"
        "heavy = {'numba', 'numpy', 'scipy', 'skimage', 'av', 'rich'} & set(sys.modules)\n"
        "print(codes, sorted(heavy))"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=TIMEOUT_S, check=True
    )
    assert result.stdout.startswith(f"gsvc {gsvc_ref.__version__}\n")
    assert result.stdout.endswith("[0, 0] []\n")
    assert "--key-frames auto|K|LIST" in result.stdout


def test_a_reader_that_has_enough_ends_the_decoder_silently(stream):
    with subprocess.Popen(
        [*GSVC, "decode", str(stream), "-", "--scale", "20"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.read(9) == b"YUV4MPEG2"
        process.stdout.close()
        assert process.stderr is not None
        assert process.stderr.read() == b""
        assert process.wait(TIMEOUT_S) == 141


def test_ctrl_c_before_the_first_frame_leaves_nothing(clip, tmp_path):
    header, _, _ = clip.read_bytes().partition(b"FRAME")
    command = [sys.executable, "-c", START, "encode", "-", str(tmp_path / "out.gsvc")]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=False
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(header + b"FRAME\n")
        process.stdin.flush()
        while not process.stdout.readline().startswith(b"settings: "):
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=TIMEOUT_S)
    assert error == b"gsvc encode: interrupted before the first frame was complete; nothing was saved\n"
    assert process.returncode == 130
    assert list(tmp_path.iterdir()) == []


def test_demo_in_a_small_size(tmp_path, capsys):
    folder = tmp_path / "demo"
    command = ["demo", "--output", str(folder), "--size", "32x24", "--length", "4", "--splats", "12", "--threads", "1"]
    assert main(command) == 0
    out = capsys.readouterr().out
    size = (folder / "clip.gsvc").stat().st_size
    assert f"which is 8 x {size:,}, the size of the file" in out
    assert "the checksum of each frame's splats held" in out
    page = (folder / "report.html").read_text()
    assert "gsvc encode" in page
    assert len(list((folder / "decoded").iterdir())) == 4
    (folder / "decoded" / "frame_999999.png.mine").touch()  # of the user
    assert main([*command, "--quiet", "--length", "2"]) == 0
    assert len(list((folder / "decoded").iterdir())) == 3
    (folder / "decoded" / "frame_999999.png.mine").unlink()
    assert main(command) == 0
    capsys.readouterr()
    assert main(["compare", str(folder / "decoded"), str(folder / "clip.gsvc"), "--no-vmaf", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["identical_frames"] == 4


@pytest.mark.parametrize("target", ["missing/demo", "file"])
def test_demo_needs_a_folder(tmp_path, capsys, target):
    (tmp_path / "file").touch()
    assert main(["demo", "--output", str(tmp_path / target)]) == 2
    assert capsys.readouterr().err.startswith("gsvc demo: ")


def test_with_standard_error_closed_the_output_is_the_stream_alone(stream, tmp_path):
    (tmp_path / "cut.gsvc").write_bytes(stream.read_bytes()[:-20])
    with open(tmp_path / "out.y4m", "wb") as file:
        command = [*GSVC, "decode", str(tmp_path / "cut.gsvc"), "-"]
        closed = ["sh", "-c", 'exec "$@" 2>&-', "sh", *command]
        assert subprocess.run(closed, stdout=file, timeout=TIMEOUT_S, check=False).returncode == 1
    with open_video(tmp_path / "out.y4m") as reader:
        assert len(list(reader)) > 0
