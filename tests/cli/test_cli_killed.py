"""Commands that are ended from outside, or have no room: what stands under the name, what is said, the exit code."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

import gsvc_ref
from gsvc_ref.cli import main

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and limits of POSIX")

OPTIONS = ["--splats", "12", "--key-frames", "2", "--threads", "1"]
START = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
from gsvc_ref.cli import main
raise SystemExit(main())
"""
TIMEOUT_S = 120


class Encoder:
    """``gsvc encode - OUT`` in a process of its own, which gets the frames of a clip one by one."""

    def __init__(self, process: "subprocess.Popen[bytes]", clip: Path, out: Path) -> None:
        assert process.stdin is not None
        self.process, self.stdin, self.out = process, process.stdin, out
        self.header, *self.frames = clip.read_bytes().split(b"FRAME\n")
        self.given = 0
        self.stdin.write(self.header)

    def give(self, frames: int) -> None:
        """Give it the next frames, and wait until it has written them."""
        for frame in self.frames[self.given : self.given + frames]:
            self.stdin.write(b"FRAME\n" + frame)
        self.stdin.flush()
        self.given += frames
        end = time.monotonic() + TIMEOUT_S
        while len(self.complete()) < self.given:
            assert self.process.poll() is None
            assert time.monotonic() < end
            time.sleep(0.05)

    def complete(self) -> list[np.ndarray]:
        """The frames that can be decoded of what stands in the folder."""
        frames: list[np.ndarray] = []
        for path in self.out.parent.iterdir():
            with suppress(gsvc_ref.GsvcError):  # which comes after the last complete frame
                frames.extend(gsvc_ref.decode(path))
        return frames

    def end(self) -> tuple[int, str]:
        _, error = self.process.communicate(timeout=TIMEOUT_S)
        return self.process.returncode, error.decode()


@contextmanager
def encoder(clip: Path, out: Path, *options: str) -> Iterator[Encoder]:
    with subprocess.Popen(
        [sys.executable, "-c", START, "encode", "-", str(out), *OPTIONS, *options],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        yield Encoder(process, clip, out)


@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.exhaustive), signal.SIGTERM])
def test_a_signal_that_asks_to_end_keeps_the_frames_done(clip, stream, tmp_path, number):
    out = tmp_path / "out.gsvc"
    with encoder(clip, out, "--json") as running:
        running.give(3)
        running.process.send_signal(number)
        status, error = running.end()
    assert status == 128 + number
    assert error == f"gsvc encode: interrupted; {out} is a valid file with the 3 frames done so far\n"
    assert [path.name for path in tmp_path.iterdir()] == ["out.gsvc"]
    assert len(list(gsvc_ref.decode(out))) == 3
    assert main(["info", str(out)]) == 0


@pytest.mark.parametrize("live", [False, True])
def test_kill_leaves_the_old_file_or_the_frames_so_far(clip, tmp_path, live):
    """In every state of the encode; see test_killed.py for every moment of a write."""
    rng = random.Random(5)
    out = tmp_path / "out.gsvc"
    out.write_bytes(b"an older encode")
    with encoder(clip, out, "--quiet", *(["--live"] if live else [])) as running:
        running.give(rng.randrange(1, 3))
        copy = out.read_bytes()
        running.give(1)
        assert out.read_bytes().startswith(copy)
        running.process.kill()
        assert running.end() == (-signal.SIGKILL, "")
    if live:
        assert [path.name for path in tmp_path.iterdir()] == ["out.gsvc"]
        target = tmp_path / "out.y4m"
        assert main(["decode", str(out), str(target), "--quiet"]) == 1
        assert target.read_bytes().count(b"FRAME") == running.given
    else:
        assert out.read_bytes() == b"an older encode"
        assert main(["encode", str(clip), str(out), *OPTIONS, "--quiet"]) == 0
        assert [path.name for path in tmp_path.iterdir()] == ["out.gsvc"]


NO_ROOM = """
import resource, signal, sys
from pathlib import Path
from gsvc_ref.cli import main
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (600, 600))
out = Path(sys.argv[2])
for options in ([], ["--live"]):
    status = main(["encode", *sys.argv[1:], *options])
    print(status, out.read_bytes() == b"an older encode", len(list(out.parent.iterdir())))
"""


def test_no_room_leaves_the_old_file_and_says_so(clip, tmp_path):
    out = tmp_path / "out.gsvc"
    out.write_bytes(b"an older encode")
    run = subprocess.run(
        [sys.executable, "-c", NO_ROOM, str(clip), str(out), *OPTIONS, "--quiet"],
        capture_output=True, text=True, timeout=TIMEOUT_S,
    )  # fmt: skip
    assert run.stdout == "1 True 1\n1 False 1\n"
    plain, told, live = run.stderr.splitlines()
    assert plain == live
    assert "files may not get so large here" in plain
    assert told == f"gsvc encode: {out} ends early; it can be decoded up to its last complete frame"
    with pytest.raises(gsvc_ref.GsvcError) as caught:
        list(gsvc_ref.decode(out))
    assert caught.value.rule == "R-6.2-4"


def test_a_reader_that_has_enough_ends_the_encoder_silently(clip):
    with subprocess.Popen(
        [sys.executable, "-c", START, "encode", str(clip), "-", *OPTIONS, "--quiet"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.read(4) == b"\x89GSV"
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(TIMEOUT_S) == 141
