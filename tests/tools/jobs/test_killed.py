"""An encode that is killed at any moment leaves the old file or a new one that is whole; a live one its beginning.

Each case runs in a forked child that kills itself at one of its steps: between two pieces of a write, before and after
every call that gives the file its name.
"""

import os
import random
import signal
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest
from codec_cases import complete_frames, encoded, fast, same, video_format, waves

from gsvc_ref.encoder import encode
from gsvc_ref.stream import StreamWriter, decode

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="only POSIX can fork")

SMALL = video_format(24, 16)
CLIP = waves(24, 16, 3)
OLD = b"an older encode"


def in_child(work: Callable[[], object]) -> int:
    """Run something in a forked child: what `os.waitpid` tells of its end."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of a fork while there are threads
        child = os.fork()
    if child == 0:
        try:
            work()
            os._exit(0)
        except BaseException:
            traceback.print_exc()
            os._exit(1)
    return os.waitpid(child, 0)[1]


class Killer:
    """Kills its process at step number `last`."""

    def __init__(self, last: int) -> None:
        self.left, self.rng = last, random.Random(last)

    def step(self) -> None:
        self.left -= 1
        if self.left == 0:
            os.kill(os.getpid(), signal.SIGKILL)

    def watch(self, name: str) -> None:
        """Make the time before and after a function of `os` a step."""
        function = getattr(os, name)

        def watched(*arguments, **options):
            self.step()
            result = function(*arguments, **options)
            self.step()
            return result

        setattr(os, name, watched)

    def encode(self, path: Path, live: bool) -> None:
        """Encode the clip, under observation."""

        def write(writer: StreamWriter, data: bytes, original=StreamWriter._write_all) -> None:
            cut = self.rng.randrange(len(data) + 1)
            for part in (data[:cut], data[cut:]):
                original(writer, part)
                self.step()

        StreamWriter._write_all = write  # type: ignore[method-assign]
        for name in ("replace", "fsync", "chmod", "chown"):
            self.watch(name)
        encode((CLIP, SMALL), path, fast(), live=live)


@pytest.mark.exhaustive
@pytest.mark.parametrize("existing", [False, True])
@pytest.mark.parametrize("live", [False, True])
def test_killed_at_every_step(tmp_path, live, existing):
    path = tmp_path / "clip.gsvc"
    _, whole = encoded(CLIP, fast(), live=live)
    frames = list(decode(whole))
    ends: set[bytes | None] = set()
    kept: set[int] = set()
    for last in range(1, 1000):
        for left in tmp_path.iterdir():
            left.unlink()
        if existing:
            path.write_bytes(OLD)
        status = in_child(lambda last=last: Killer(last).encode(path, live))
        end = path.read_bytes() if path.exists() else None
        ends.add(end)
        if status == 0:
            break
        assert os.WTERMSIG(status) == signal.SIGKILL
        parts = [left for left in tmp_path.iterdir() if left != path]
        assert all(part.match(".clip.gsvc.*.part") for part in parts)
        if live:
            assert parts == []
            data = end or b""
        else:
            assert end in ((OLD if existing else None), whole)
            assert len(parts) == (end != whole)
            data = parts[0].read_bytes() if parts else whole
        if data != OLD:
            found, _ = complete_frames(data) if data else ([], None)
            assert same(found, frames[: len(found)])
            assert not live or whole.startswith(data)
            kept.add(len(found))
    assert status == 0
    assert last > 10
    assert end == whole
    assert kept == {0, 1, 2, 3}
    assert len(ends) > 10 if live else ends == {OLD if existing else None, whole}


def test_the_next_encode_removes_what_a_killed_one_left(tmp_path):
    path = tmp_path / "clip.gsvc"
    for last in (1, 5, 9):
        assert os.WTERMSIG(in_child(lambda last=last: Killer(last).encode(path, False))) == signal.SIGKILL
    assert len(list(tmp_path.iterdir())) == 1  # each removed that of the one before
    encode((CLIP, SMALL), path, fast())
    assert [left.name for left in tmp_path.iterdir()] == ["clip.gsvc"]
