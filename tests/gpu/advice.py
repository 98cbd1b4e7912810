"""What went wrong in a process, as a sentence that says what to do."""

import re
import signal
from typing import Final

KNOWN: Final = (
    (
        r"out of memory|OUT_OF_MEMORY|MEM_OBJECT_ALLOCATION_FAILURE|OutOfMemory",
        "the GPU has no memory left: end what else runs there (`nvidia-smi` lists it), and run this again",
    ),
    (
        r"LAUNCH_TIMEOUT|launch timed out|LaunchTimeout",
        "the watchdog of the display ended a kernel: take a GPU that drives no display, or stop the display server",
    ),
    (
        r"driver version is insufficient|InsufficientDriver|UNSUPPORTED_PTX|unsupported toolchain|too old for this",
        "the NVIDIA driver is missing, or too old for this CUDA: install a newer driver (580 or later for CUDA 13)",
    ),
    (
        r"no CUDA-capable device|NO_DEVICE|no NVIDIA GPU|cannot calculate in binary64 on cuda|Found no NVIDIA driver",
        "CUDA finds no GPU: see whether `nvidia-smi` lists one",
    ),
    (
        r"ILLEGAL_ADDRESS|illegal memory access|misaligned address",
        "a kernel left its memory: run it under `compute-sanitizer --tool memcheck`, and report it",
    ),
    (r"device (?:is )?lost|DEVICE_LOST|DeviceLost", "the driver lost the GPU: see `dmesg`, and run this again"),
)
"""Patterns of what drivers and packages print, and sentences."""


def advice(log: str, code: int, package: str = "") -> str:
    """A sentence about a process that failed.

    Parameters
    ----------
    log
        What it printed.
    code
        Its return code; of a signal, as subprocess has it, the negative number.
    package
        What to install if a module is missing.
    """
    for pattern, sentence in KNOWN:
        if re.search(pattern, log):
            return sentence
    if missing := re.findall(r"No module named '([\w.]+)'|CuPy is not there", log):
        return f"{missing[-1] or 'cupy'} is not installed" + (f": pip install {package}" if package else "")
    if code == -signal.SIGKILL:
        return "the system killed it, most likely for want of main memory"
    lines = [line.strip() for line in log.splitlines() if line.strip()]
    if code < 0:
        return f"it ended by {signal.Signals(-code).name}" + (f", after: {lines[-1][:200]}" if lines else "")
    return lines[-1][:300] if lines else f"it ended with code {code} and said nothing"
