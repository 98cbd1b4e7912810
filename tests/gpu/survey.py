"""What this machine has: the card and its driver, and which implementations run on it.

What an implementation says of itself (its `environment()`) decides whether it would run on a GPU, so that none is
judged on a processor unnoticed. Each is asked in a process of its own: an import may hang, or take the process along.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from gsvc_base.processors import processors
from gsvc_lab.machine import cpu_model
from tests.gpu.advice import advice
from tests.gpu.splats import DRAWS

ROOT: Final = Path(__file__).parents[2]
ANSWER: Final = 45
"""Seconds for one answer: the first of a driver takes several."""
PATIENCE: Final = 100
"""Seconds for one part."""

MEMORY: Final = 4096
"""MiB of a card that one process may need."""

DRIVERS: Final = (
    "/usr/local/nvidia/lib64",
    "/usr/local/nvidia/lib",
    "/usr/lib/x86_64-linux-gnu",
    "/usr/lib64",
    "/usr/lib",
)
OPENCL: Final = "libnvidia-opencl.so.1"
VULKAN: Final = "/usr/local/nvidia/share/vulkan/icd.d/nvidia_icd.json"
"""Where containers have what the loader of Vulkan looks for in /usr/share and /etc."""
TOOLKIT: Final = "/usr/local/cuda/bin"

PROCESSORS: Final = re.compile(r"\bcpu\b|llvmpipe|swiftshader|pthread|fiber|pocl", re.IGNORECASE)
"""What environments of implementations say that run on a processor."""

ASK: Final = (
    "import importlib, json, sys; print('\\n' + json.dumps(importlib.import_module(sys.argv[1]).environment()))"
)


@dataclass(frozen=True)
class Adapter:
    """An implementation that may run on a GPU."""

    name: str
    package: str  # what it needs, as for `pip install`
    settings: Mapping[str, str] = field(default_factory=dict)  # environment variables to start it with
    on_processor: Mapping[str, str] = field(default_factory=dict)  # those with which it plays a GPU
    draws: int = DRAWS  # random sets of splats to compare; fewer if it is slow, none without deterministic sums
    patience: float = PATIENCE  # seconds for a part that judges it

    @property
    def module(self) -> str:
        """As for ``gsvc-conformance run --module``."""
        return f"gsvc_conformance.adapters.{self.name}"


ADAPTERS: Final = (
    Adapter("cuda", "'gsvc-conformance[cuda]'", on_processor={"GSVC_CUDA": "fibers"}),
    Adapter("opencl", "pyopencl"),
    Adapter("webgpu", "wgpu"),
    Adapter("pytorch", "torch", {"GSVC_TORCH_DEVICE": "cuda"}, {"GSVC_TORCH_DEVICE": "cpu"}, DRAWS // 10, 150),
    Adapter("gsplat_cuda", "--no-build-isolation ./gsplat (the docstring of the adapter says which)", draws=0),
)


@dataclass
class Survey:
    """A machine, what runs on it, and what does not and why."""

    card: str
    driver: str
    machine: dict[str, str]  # further entries, for tables and pages
    variables: dict[str, str]  # environment variables that the drivers need
    answers: dict[str, dict[str, str]] = field(default_factory=dict)  # environments by the name of the adapter
    missing: dict[str, str] = field(default_factory=dict)  # why another adapter does not run, a sentence

    @property
    def width(self) -> int:
        """The number of processes that may share the processors and the card's memory."""
        mebibytes = re.match(r"(\d+) MiB", self.machine.get("memory", ""))
        room = int(mebibytes[1]) // MEMORY if mebibytes else processors()
        return max(1, min(processors(), room))

    @property
    def runs(self) -> list[Adapter]:
        """The adapters that run here."""
        return [adapter for adapter in ADAPTERS if adapter.name in self.answers]


def surveyed(folder: Path, *, cpu: bool) -> Survey:
    """Look around, and ask every adapter.

    Parameters
    ----------
    folder
        Where files for loaders of drivers go.
    cpu
        Whether processors that play a GPU are wanted, instead of a GPU.
    """
    card, driver, memory, capability, clock = (*nvidia_smi(), "", "", "", "", "")[:5]
    entries = {
        "driver": driver, "memory": memory, "compute capability": capability, "clock": clock,
        "CUDA toolkit": toolkit_version(), "processor": f"{processors()} x {cpu_model()}",
        "Python": sys.version.partition(" ")[0], "commit": commit(), "date": datetime.now(UTC).date().isoformat(),
    }  # fmt: skip
    found = Survey(card, driver, {name: text for name, text in entries.items() if text}, {} if cpu else loaders(folder))
    with ThreadPoolExecutor() as pool:
        for adapter, answer in zip(
            ADAPTERS, pool.map(lambda one: asked(one, found.variables, cpu), ADAPTERS), strict=True
        ):
            if isinstance(answer, str):
                found.missing[adapter.name] = answer
            else:
                found.answers[adapter.name] = answer
    if not found.card:
        devices = (answer.get("device", "") for answer in found.answers.values())
        found.card = cpu_model() if cpu else next(devices, "")
    return found


def nvidia_smi() -> list[str]:
    """Name, driver, memory, compute capability and highest clock of the first card, or nothing."""
    query = "name,driver_version,memory.total,compute_cap,clocks.max.sm"
    lines = output_of(["nvidia-smi", f"--query-gpu={query}", "--format=csv,noheader"]).splitlines()
    return [cell.strip() for cell in lines[0].split(",")] if lines else []


def toolkit_version() -> str:
    """The release of nvcc, or nothing."""
    found = re.search(r"release ([\d.]+)", output_of([tool("nvcc") or "nvcc", "--version"]))
    return found[1] if found else ""


def commit() -> str:
    """The commit of this checkout; a bundle has it in the file COMMIT."""
    packed = ROOT / "COMMIT"
    if packed.exists():
        return packed.read_text(encoding="utf-8").strip()
    return output_of(["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--exclude=*", "--abbrev=8"]).strip()


def tool(name: str) -> str | None:
    """The path of a tool of CUDA."""
    return shutil.which(name) or shutil.which(name, path=TOOLKIT)


def output_of(words: Sequence[str]) -> str:
    """What a command prints, or nothing if it fails."""
    try:
        run = subprocess.run(words, capture_output=True, text=True, timeout=ANSWER, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return "" if run.returncode else run.stdout


def loaders(folder: Path) -> dict[str, str]:
    """Environment variables that lead the loaders of OpenCL and Vulkan to NVIDIA's driver, where nothing else does."""
    variables = {}
    library = next((path for name in DRIVERS if (path := Path(name, OPENCL)).exists()), None)
    if library is not None and "OCL_ICD_VENDORS" not in os.environ:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "nvidia.icd").write_text(f"{library}\n", encoding="utf-8")
        variables["OCL_ICD_VENDORS"] = str(folder)
    if Path(VULKAN).exists() and "VK_DRIVER_FILES" not in os.environ:
        variables["VK_DRIVER_FILES"] = VULKAN
        variables["__EGL_VENDOR_LIBRARY_FILENAMES"] = VULKAN.replace(
            "vulkan/icd.d/nvidia_icd", "glvnd/egl_vendor.d/10_nvidia"
        )
    return variables


def asked(adapter: Adapter, variables: Mapping[str, str], cpu: bool) -> dict[str, str] | str:
    """What an adapter says that it runs on, or why it does not run on what is wanted."""
    settings = adapter.on_processor if cpu else adapter.settings
    try:
        run = subprocess.run(
            [sys.executable, "-c", ASK, adapter.module],
            env={**os.environ, **variables, **settings}, capture_output=True, text=True, timeout=ANSWER, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"it said nothing for {ANSWER} s: its driver hangs"
    if run.returncode:
        return advice(run.stderr, run.returncode, adapter.package)
    answer: dict[str, str] = json.loads(run.stdout.splitlines()[-1])
    if not cpu and any(PROCESSORS.search(value) for value in answer.values()):
        return f"it finds no GPU, and would run on {answer.get('device', 'a processor')}"
    return answer
