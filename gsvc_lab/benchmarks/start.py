"""Cold start: how long a command takes until work begins, with nothing compiled and with everything in the cache."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

from gsvc_lab.benchmarks.results import Goal, Section, Table
from gsvc_lab.benchmarks.timing import Spread

GOAL: Final = (0.6, 0.5)
"""Must and aim in seconds of a second start until work begins."""

FIRST_GOAL: Final = (20, 10)
"""Must and aim in seconds of a first encode and decode with nothing compiled."""

STARTS: Final = 9

STEPS: Final = {
    "Python": "pass",
    "and NumPy": "import numpy",
    "and gsvc_ref's modules": "import gsvc_ref.rendering; gsvc_ref.decode",
    "and Numba": "import gsvc_ref.rendering; gsvc_ref.decode; import gsvc_ref._compiler",
    "and a first compiled kernel": "import gsvc_ref.rendering; gsvc_ref.decode; "
    "from gsvc_ref.bitstream import crc32c; crc32c(b'1')",
}
"""The steps of a start, each with all before it."""


def until_output(command: list[str], environment: dict[str, str]) -> float:
    """Seconds from the start of a command to the first byte on its standard output."""
    begin = time.perf_counter()
    with subprocess.Popen(
        command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        assert process.stdout is not None
        process.stdout.read(1)
        seconds = time.perf_counter() - begin
        process.stdout.read()
    if process.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {process.returncode}")
    return seconds


def start(threads: int) -> Section:
    """First and second starts of the commands, and what a start consists of."""
    section = Section("Cold start")
    gsvc = [sys.executable, "-m", "gsvc_ref"]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        clip, coded = Path(folder) / "clip.y4m", Path(folder) / "clip.gsvc"
        clip.write_bytes(b"YUV4MPEG2 W16 H16 F25:1 Ip C444\nFRAME\n" + bytes(range(256)) * 3)
        encode = [*gsvc, "encode", str(clip), "-", "--profile", "paper", "--iterations", "1", "--quiet"]
        with coded.open("wb") as file:
            subprocess.run(encode, check=True, stdout=file)
        commands = {
            "gsvc --help": [*gsvc, "--help"],
            "gsvc decode": [*gsvc, "decode", str(coded), "-", "--quiet"],
            "gsvc encode": encode,
            "gsvc info": [*gsvc, "info", str(coded)],
            "gsvc compare": [*gsvc, "compare", str(clip), str(coded), "--no-vmaf"],
        }
        for number, (name, command) in enumerate(commands.items()):
            cache = {**os.environ, "NUMBA_CACHE_DIR": str(Path(folder) / f"kernels {number}")}
            first = until_output(command, cache)
            later = Spread.of([until_output(command, cache) for _ in range(STARTS)])
            rows.append([name, f"{first:.1f}", later.text()])
            section.numbers.append({"command": name, "first": first, "later": later.median})
            section.goals.append(Goal(f"second start of {name}", "s until work begins", *GOAL, later.median))
        cache = {**os.environ, "NUMBA_CACHE_DIR": str(Path(folder) / "kernels of both")}
        wall, used = time.perf_counter(), _cpu_of_children()
        for command in (encode, commands["gsvc decode"]):
            until_output(command, cache)
        wall, used = time.perf_counter() - wall, _cpu_of_children() - used
    section.numbers.append({"command": "first encode and decode", "seconds": wall, "cpu": used})
    for unit, measured in (("s of CPU", used), ("s", wall)):
        section.goals.append(Goal("first encode and decode, nothing compiled", unit, *FIRST_GOAL, measured))
    text = (
        "Seconds from the start of a process to its first output, with one frame of 16x16 pixels: a first start, which "
        f"compiles every kernel that the command needs, and {STARTS} later ones. A first `gsvc encode` and a first "
        f"`gsvc decode` that share what they compile took {wall:.1f} s together, {used:.1f} s of CPU."
    )
    section.tables.append(Table(text, ["command", "first start", "later, median (quartiles)"], rows))
    section.tables.append(_steps())
    return section


def _cpu_of_children() -> float:
    """Seconds of CPU of the processes that were started and have ended."""
    times = os.times()
    return times.children_user + times.children_system


def _steps() -> Table:
    rows, before = [], 0.0
    for name, code in STEPS.items():
        seconds = []
        for _ in range(STARTS):
            begin = time.perf_counter()
            subprocess.run([sys.executable, "-c", f"import os; {code}; os._exit(0)"], check=True)
            seconds.append(time.perf_counter() - begin)
        spread = Spread.of(seconds)
        rows.append([name, spread.text(), f"{spread.median - before:.2f}"])
        before = spread.median
    text = (
        "What a start consists of, in seconds (a command also puts off Python's garbage collection while it loads, "
        "which these do not)."
    )
    return Table(text, ["step", "until here", "adds"], rows)
