"""What the ladder ran on."""

import os
import platform
from importlib.metadata import version
from pathlib import Path

import gsvc_ref


def machine() -> dict[str, str]:
    """What this runs on: name and value."""
    return {
        "gsvc_ref": gsvc_ref.__version__,
        "Python": platform.python_version(),
        **{name: version(name) for name in ("numpy", "numba")},
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "processors": str(os.cpu_count()),
    }


def _processor() -> str:
    """The name of the processor as far as the system tells it."""
    listing = Path("/proc/cpuinfo")
    if listing.is_file():
        for line in listing.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "unknown"
