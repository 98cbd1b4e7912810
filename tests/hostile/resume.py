"""Encodes that are killed at random moments and gone on with, after changes to what they had kept."""

import io
import os
import random
import shutil
import signal
import time
from collections import Counter
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np

from gsvc_base.errors import UsageError
from gsvc_ref.encoder import encode
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.video import ColorDescription, VideoFormat
from gsvc_tools.jobs.resume import ABOUT, LOCK

WIDTH, HEIGHT, FRAMES, GROUP = 24, 16, 12, 3
RGB = ColorDescription(primaries=1, transfer=1, matrix=0, full_range=True, chroma_location=0)
VIDEO = VideoFormat(WIDTH, HEIGHT, Fraction(25), 8, "rgb", RGB)
SETTINGS = Settings.quick(splats=20, key_frames=GROUP, threads=1, checksums=True, seed=3)
CLIP = list(np.random.default_rng(3).integers(0, 256, (FRAMES, HEIGHT, WIDTH, 3), np.uint8))
WAIT_S = 120.0
"""Seconds after which an encode counts as waiting for ever."""

NAMES = [f"{first:08}.gsvc" for first in range(0, FRAMES, GROUP)]
DAMAGES = (
    "flip", "cut", "empty", "zeros", "swap", "finished", "link", "dangling link", "FIFO", "device", "folder", "part",
)  # fmt: skip
REFUSED = ("link", "FIFO", "folder", "empty")
"""What is put in place of the record or the lock, in which case the encode must refuse the folder."""


def kills(count: int, seed: int, folder: Path) -> bool:
    """Kill encodes `count` times in a folder, and print what happened; whether every end was as promised."""
    rng = random.Random(seed)
    encode((CLIP, VIDEO), whole := io.BytesIO(), SETTINGS)
    case, found = _Case(folder, whole.getvalue()), Counter[str]()
    begin = time.perf_counter()
    case.check_end(case.encode(WAIT_S))
    full = time.perf_counter() - begin
    while found["killed"] < count:
        status = case.encode(rng.uniform(0.2, 1.6) * full)
        if status is None:
            found["killed"] += 1
            if rng.random() < 0.8:
                found[f"planted: {case.plant(rng)}"] += 1
            if rng.random() < 0.1:
                found[f"refused: {case.plant_refused(rng)}"] += 1
        else:
            found["complete"] += 1
            case.check_end(status)
    case.check_end(case.encode(WAIT_S))
    for fault in case.faults:
        print(fault)
    print(f"{', '.join(f'{what} {times}' for what, times in sorted(found.items()))}; wrong: {len(case.faults)}")
    return not case.faults


class _Case:
    """A target, its folder, a file of somebody else, and what went wrong."""

    def __init__(self, folder: Path, whole: bytes) -> None:
        self.target, self.kept = folder / "out.gsvc", folder / "out.gsvc.resume"
        self.victim, self.whole = folder / "victim", whole
        self.finished = folder / "finished.gsvc"
        self.finished.write_bytes(whole)
        self.victim.write_bytes(b"precious")
        self.faults: list[str] = []

    def encode(self, seconds: float) -> int | None:
        """Encode in a child that is killed after some seconds: its exit code, or None if it was killed."""
        child = os.fork()
        if child == 0:
            _exit_after(lambda: encode((CLIP, VIDEO), self.target, SETTINGS, resume=self.kept))
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                return os.waitstatus_to_exitcode(status)
            time.sleep(0.001)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        if seconds == WAIT_S:
            self.faults.append("an encode waits for ever")
        return None

    def plant(self, rng: random.Random) -> str:
        """Damage one of the groups that are kept, or put something in place of any."""
        there = [path.name for name in NAMES if _has_bytes(path := self.kept / name)]
        if not (self.kept / ABOUT).is_file():  # a folder without it that holds something is refused, as it should be
            return "nothing, as there was no record"
        how = rng.choice(DAMAGES if there else ("link", "dangling link", "FIFO", "device", "part"))
        path = self.kept / rng.choice(there or NAMES)
        data = bytearray(path.read_bytes() if there else b"")
        if how == "flip":
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        elif how in ("cut", "empty", "zeros"):
            data = {"cut": data[: rng.randrange(len(data))], "empty": b"", "zeros": bytes(len(data))}[how]
        elif how in ("swap", "finished"):
            data = (self.kept / rng.choice(there) if how == "swap" else self.finished).read_bytes()
        else:
            self._put(how, path)
            return how
        path.write_bytes(data)
        return how

    def plant_refused(self, rng: random.Random) -> str:
        """Put something in place of the record or the lock, see it refused, and undo it."""
        path, how = self.kept / rng.choice((ABOUT, LOCK)), rng.choice(REFUSED)
        if not (self.kept / ABOUT).is_file() or (path.name == LOCK and how == "empty"):
            return "nothing"
        before = path.read_bytes() if path.exists() else None
        self._put(how, path)
        if (status := self.encode(WAIT_S)) != 2:
            self.faults.append(f"{how} in place of {path.name}: exit code {status}, must be 2")
        path.rmdir() if how == "folder" else path.unlink()
        if before is not None:
            path.write_bytes(before)
        return f"{how} as {path.name}"

    def _put(self, how: str, path: Path) -> None:
        if how == "part":  # a file in the making
            path = path.with_name(f".{path.name}.0.part")
            how = "link"
        if path.is_dir() and not path.is_symlink():
            return
        path.unlink(missing_ok=True)
        if how == "folder":
            path.mkdir()
        elif how == "FIFO":
            os.mkfifo(path)
        elif how == "empty":
            path.touch()
        else:
            path.symlink_to({"link": self.victim, "dangling link": "/nowhere/x", "device": "/dev/zero"}[how])

    def check_end(self, status: int | None) -> None:
        """Note what a complete encode should not have left or done, and begin anew."""
        if status != 0:
            self.faults.append(f"exit code {status}, must be 0")
        if not self.target.exists() or self.target.read_bytes() != self.whole:
            self.faults.append("other bytes than those of an undisturbed encode")
        if self.victim.read_bytes() != b"precious" or self.finished.read_bytes() != self.whole:
            self.faults.append("a file outside of the folder was changed")
        if self.kept.exists() and not all(path.is_dir() for path in self.kept.iterdir()):
            self.faults.append(f"left: {sorted(path.name for path in self.kept.iterdir())}")
        self.target.unlink(missing_ok=True)
        shutil.rmtree(self.kept, ignore_errors=True)


def _has_bytes(path: Path) -> bool:
    return path.is_file() and not path.is_symlink() and path.stat().st_size > 0


def _exit_after(work: Callable[[], object]) -> None:
    """Do something and end this process: with 0, with 2 where it is refused, or with 1."""
    code = 1
    try:
        work()
        code = 0
    except UsageError:
        code = 2
    finally:
        os._exit(code)
