"""Peak memory of decoding hostile streams, measured in a process of its own: what the system had to give.

NumPy's and the kernels' memory is in it, the interpreter's and the compiled kernels' is not: everything has been run on
a small stream before. Linux only: its kernel tells the highest size of a process since it was last asked.
"""

import ctypes
import gc
import io
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, Final

import gsvc_ref
from gsvc_base.errors import GsvcError
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.header import MAIN
from gsvc_ref.cli import main
from gsvc_ref.stream import StreamReader
from tests.hostile.hostile_streams import Case, cases

MEBIBYTE: Final = 1 << 20
BASE: Final = 64 * MEBIBYTE
BYTES_PER_SPLAT: Final = 32
CLEAR: Final = Path("/proc/self/clear_refs")
SUPPORTED: Final = CLEAR.exists()


def declared_frame(header: SequenceHeader) -> int:
    """Bytes of the largest frame that a stream may have: the payload, the parameters of the splats and the picture.

    Profile `main` keeps a state of eight integers of a splat beside its parameters.
    """
    limits = header.limits
    of_splat = 2 * BYTES_PER_SPLAT if header.profile == MAIN else BYTES_PER_SPLAT
    picture = header.width * header.height * 3 * (1 if header.bit_depth == 8 else 2)
    return limits.payload + of_splat * limits.splats + picture


def allowed(header: SequenceHeader) -> int:
    """The peak memory in bytes that is promised."""
    return BASE + 4 * declared_frame(header)


class Pipe(io.RawIOBase):
    """A file that cannot seek and gives few bytes at a time."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb")

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        return self._file.read(min(size, 4096))

    def close(self) -> None:
        self._file.close()
        super().close()


def read(path: Path) -> None:
    with StreamReader(path) as reader:
        for _ in reader:
            pass


def read_pipe(path: Path) -> None:
    with Pipe(path) as pipe:
        for _ in StreamReader(pipe):  # type: ignore[arg-type]
            pass


def decode(path: Path, **options: Any) -> None:
    for _ in gsvc_ref.decode(path, **options):
        pass


def info(path: Path) -> None:
    with gsvc_ref.open(path) as stream:
        error = stream.info().error
    if error is not None:
        raise error


def seek(path: Path) -> None:
    with gsvc_ref.open(path) as stream:
        for _ in stream.frames(1):
            pass


def command(*arguments: str) -> None:
    """Run a command of gsvc and raise what it complains about."""
    output, messages = io.StringIO(), io.StringIO()
    with redirect_stdout(output), redirect_stderr(messages):
        status = main(list(arguments))
    if status:
        raise SystemExit(f"{status}: {messages.getvalue()}")


def command_decode(path: Path) -> None:
    command("decode", str(path), os.devnull, "--quiet")


def command_info(path: Path) -> None:
    command("info", str(path), "--json")


def command_dump(path: Path) -> None:
    command("dump", str(path))


def command_compare(path: Path) -> None:
    command("compare", str(path), str(path), "--no-vmaf", "--quiet")


ENTRIES: Final[dict[str, Callable[[Path], None]]] = {
    "StreamReader": read,
    "StreamReader of a pipe": read_pipe,
    "decode": decode,
    "decode, deterministic": lambda path: decode(path, precision="deterministic"),
    "info": info,
    "frames(1)": seek,
    "gsvc decode": command_decode,
    "gsvc info": command_info,
    "gsvc dump": command_dump,
    "gsvc compare": command_compare,
}
"""Every way into the decoder."""

WARM_UP: Final = ("splats on a picture", "words")
"""Cases of level 1 that need all kernels: frames of 16 and of 8 bits, many splats, a coded plane."""


def status_of(key: str) -> int:
    """A size of this process in bytes."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(f"{key}:"):
            return int(line.split()[1]) * 1024
    raise LookupError(key)


def peak_of(entry: str, path: Path) -> tuple[int, str]:
    """The bytes by which this process grows at most, and the error that came out."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    CLEAR.write_text("5")
    before = status_of("VmRSS")
    error = ""
    try:
        ENTRIES[entry](path)
    except GsvcError as fault:
        error = str(fault.rule)
    except SystemExit as fault:
        error = str(fault)
    return status_of("VmHWM") - before, error


def measure_here(tasks: Iterable[tuple[str, str]]) -> list[tuple[int, str]]:
    """`peak_of` for pairs of an entry and the name of a file."""
    return [peak_of(entry, Path(name)) for entry, name in tasks]


def measure(tasks: list[tuple[str, Path]], warm_up: list[tuple[str, Path]]) -> list[tuple[int, str]]:
    """`peak_of` in a new process, in which the tasks of `warm_up` have been done before."""
    pairs = [(entry, str(path)) for entry, path in [*warm_up, *tasks]]
    done = subprocess.run(
        [sys.executable, "-m", "tests.hostile.memory"],
        input=json.dumps(pairs), capture_output=True, text=True, check=False, cwd=Path(__file__).parents[2],
    )  # fmt: skip
    if done.returncode:
        raise RuntimeError(done.stderr)
    return [(peak, error) for peak, error in json.loads(done.stdout)][len(warm_up) :]


def write(case: Case, path: Path) -> Path:
    """Write a stream piece by piece, so that it need not fit into memory."""
    with path.open("wb") as file:
        for piece in case.make():
            file.write(piece)
    return path


def measure_level(
    level: int, folder: Path, entries: Iterable[str] = ENTRIES, names: Iterable[str] | None = None
) -> list[tuple[str, str, int, int, str, str | None]]:
    """Of every case of a level and every entry: case, entry, peak, what is allowed, the error, the rule expected."""
    chosen = {name: case for name, case in cases(level).items() if names is None or name in names}
    files = {name: write(case, folder / f"{level} {name}.gsvc") for name, case in chosen.items()}
    small = [write(cases(1)[name], folder / f"first {name}.gsvc") for name in WARM_UP]
    warm_up = [(entry, path) for entry in entries for path in small]
    keys = [(name, entry) for name in chosen for entry in entries]
    peaks = measure([(entry, files[name]) for name, entry in keys], warm_up)
    return [
        (name, entry, peak, allowed(chosen[name].head), error, chosen[name].rule)
        for (name, entry), (peak, error) in zip(keys, peaks, strict=True)
    ]


def table(level: int, entries: Iterable[str]) -> bool:
    """Print the peaks of a level; whether all are allowed and all errors as they must be."""
    measured, wrong = 0, 0
    print(f"level    {'case':24} {'entry':24} {'peak':>8}    {'allowed':>8}")
    for case in cases(level):
        with tempfile.TemporaryDirectory() as folder:
            for name, entry, peak, most, error, rule in measure_level(level, Path(folder), entries, [case]):
                fine = peak <= most and (rule or "") in error and bool(rule) == bool(error)
                measured, wrong = measured + 1, wrong + (not fine)
                share = f"{peak / MEBIBYTE:8.1f} of {most / MEBIBYTE:8.1f} MiB"
                print(f"level {level}  {name:24} {entry:24} {share}  {'' if fine else f'WRONG {error}'}", flush=True)
    verdict = f"{wrong} WRONG" if wrong else "all below what is allowed, with the errors that must come"
    print(f"level {level}: {measured} measured, {verdict}")
    return wrong == 0


if __name__ == "__main__":
    print(json.dumps(measure_here(json.load(sys.stdin))))
