"""The memory of a process of its own."""

import resource
import subprocess
import sys
from pathlib import Path
from typing import Final

STATUS: Final = Path("/proc/self/status")


def peak_kib() -> int:
    """The largest resident memory so far, in KiB: Linux counts `ru_maxrss` from before a process was its own."""
    if STATUS.exists():
        return next(int(line.split()[1]) for line in STATUS.read_text().splitlines() if line.startswith("VmHWM"))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak // 1024 if sys.platform == "darwin" else peak


def peaks_of(script: str, *arguments: str) -> list[float]:
    """The peaks in MiB that a script prints in KiB, run in a process of its own."""
    run = subprocess.run([sys.executable, "-c", script, *arguments], check=True, capture_output=True, text=True)
    return [int(part) / 1024 for part in run.stdout.split()]
