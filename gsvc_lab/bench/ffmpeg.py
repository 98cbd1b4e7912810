"""The ffmpeg program of imageio-ffmpeg: asked what it has, and run so that nothing of it stays behind."""

import os
import re
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

from gsvc_base.errors import UsageError

QUIET: Final = ("-hide_banner", "-nostdin", "-nostats", "-y")


class FfmpegError(UsageError):
    """Ffmpeg is missing, or could not do what was asked; the message is then its own first error."""


@dataclass(frozen=True)
class Ran:
    """One run of the program."""

    # Wall time, and CPU time of all its threads, from the start of the program to its end
    seconds: float
    cpu_seconds: float
    log: str  # the text of its error stream


@cache
def program() -> str:
    """The path of the program.

    An FfmpegError says that there is none.
    """
    try:
        import imageio_ffmpeg  # an optional extra: absent in a plain installation

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except ImportError:
        raise FfmpegError("the codecs come with the package imageio-ffmpeg: pip install 'gsvc_ref[bench]'") from None
    except RuntimeError as error:
        raise FfmpegError(f"imageio-ffmpeg finds no ffmpeg program: {error}") from None


def available() -> bool:
    """Whether there is a program."""
    try:
        program()
    except FfmpegError:
        return False
    return True


def description() -> tuple[str, float]:
    """The first line of ``ffmpeg -version``, and the seconds that it takes to start; or why there is none, and 0."""
    try:
        runs = [run(["-version"], capture=True) for _ in range(3)]
    except FfmpegError as error:
        return str(error), 0.0
    return runs[0].log.splitlines()[0], min(one.seconds for one in runs)


@cache
def encoders() -> frozenset[str]:
    """The names of the encoders that the program has."""
    lines = run(["-encoders"], capture=True).log.splitlines()
    return frozenset(words[1] for line in lines if len(words := line.split()) > 1)


def file_url(path: Path) -> str:
    """A path as ffmpeg takes it whatever characters it holds: never an option, never another protocol."""
    return f"file:{path}"


def run(arguments: Sequence[str], *, loglevel: str = "error", capture: bool = False) -> Ran:
    """Run ffmpeg to its end.

    `arguments`: arguments after the common ones. `loglevel`: level of the messages in the log. `capture`: whether its
    standard output is to stand in the log too. An FfmpegError says that it does not start, or ends with an error.
    """
    command = [program(), *QUIET, "-loglevel", f"level+{loglevel}", *arguments]
    start, before = time.perf_counter(), os.times()
    try:
        # An exception, Ctrl-C too, kills the program before it leaves this call.
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    except OSError as error:
        raise FfmpegError(f"{command[0]} does not start: {error}") from error
    seconds, after = time.perf_counter() - start, os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    log = done.stderr.decode(errors="replace") + (done.stdout.decode(errors="replace") if capture else "")
    if done.returncode != 0:
        raise FfmpegError(_first_complaint(log, done.returncode))
    return Ran(seconds, cpu, log)


def pictures(arguments: Sequence[str], size: int) -> Iterator[bytes]:
    """The standard output of ffmpeg in pieces of `size` bytes.

    An FfmpegError says that it fails, or the last piece is cut off.
    """
    command = [program(), *QUIET, "-loglevel", "level+error", *arguments, "pipe:1"]
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=errors)
        assert process.stdout is not None
        try:
            while len(piece := process.stdout.read(size)) == size:
                yield piece
            process.wait()
        finally:  # also when the consumer stops early
            process.kill()
            process.stdout.close()
            process.wait()
        errors.seek(0)
        if process.returncode != 0 or piece:
            raise FfmpegError(_first_complaint(errors.read().decode(errors="replace"), process.returncode))


def _first_complaint(log: str, status: int) -> str:
    """The first error in a log whose lines tell their levels."""
    error = re.search(r"\[(?:error|fatal)\] (.*\S)", log)
    return error[1] if error else f"ffmpeg ended with status {status}"
