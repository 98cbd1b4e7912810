"""The machine and the software that something was measured with."""

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

import gsvc_ref
from gsvc_base.processors import processors

PACKAGES: Final = ("gsvc_ref", "numpy", "numba", "llvmlite", "torch")


def environment(threads: int) -> dict[str, Any]:
    """The machine as far as a reader has to know it to make sense of numbers."""
    return {
        "cpu": cpu_model(),
        "cores": processors(),
        "vectors": _widest_vectors(),
        "threads": threads,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        **{name: _version(name) for name in PACKAGES},
    }


def named() -> dict[str, str]:
    """The same in few words for pages: names and values."""
    return {
        "gsvc_ref": gsvc_ref.__version__,
        "Python": platform.python_version(),
        **{name: _version(name) for name in ("numpy", "numba")},
        "system": f"{platform.system()} {platform.machine()}",
        "processor": cpu_model(),
        "processors": str(processors()),
    }


def cpu_model() -> str:
    """The name of the processor where the system tells it."""
    return _cpuinfo("model name") or platform.processor() or platform.machine()


def machine_text() -> str:
    """The number of processors, their kind and the version of Python, for the foot of a table."""
    return f"{processors()} CPUs, {platform.machine()}, Python {platform.python_version()}"


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _cpuinfo(key: str) -> str:
    path = Path("/proc/cpuinfo")
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.exists() else []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(key)), "")


def _widest_vectors() -> str:
    flags = _cpuinfo("flags").split()
    return next((name for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags), "unknown")
