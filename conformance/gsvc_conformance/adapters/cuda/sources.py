"""The kernels as text: which file has which, what they are compiled with, and where that is kept."""

import hashlib
import os
import re
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Final

KERNELS: Final = Path(__file__).parent / "kernels"
SOURCES: Final = (
    "lists", "rendering", "gradients", "training", "quantization", "reconstruct", "main_body", "main_operations"
)  # fmt: skip
"""Each is compiled by itself, when one of its kernels is first launched; what they share is in the .cuh files."""

ROUNDING: Final = {
    True: ("-DEXACT", "--fmad=false", "--ftz=false", "--prec-div=true", "--prec-sqrt=true"),
    False: ("--fmad=true", "--ftz=false", "--prec-div=true", "--prec-sqrt=true"),
}
"""Options of NVRTC and of nvcc, by `exact`: nothing is ever flushed, and in an exact kernel nothing fused."""

PLANTED: Final = ("-DPLANTED_RACE",) if os.environ.get("GSVC_CUDA_PLANTED_RACE") else ()
"""An option that takes a barrier out of tiles.cuh, to see whether a tool for races reports it."""

DEFINITION: Final = re.compile(r'extern "C" __global__ void\s+(?:__launch_bounds__\([^)]*\)\s+)?(\w+)\(')


@cache
def kernels(source: str) -> tuple[str, ...]:
    """The kernels of a file, by name."""
    return tuple(DEFINITION.findall((KERNELS / f"{source}.cu").read_text("utf-8")))


@cache
def source_of(kernel: str) -> str:
    """The file that has a kernel."""
    return next(source for source in SOURCES if kernel in kernels(source))


def kept(suffix: str, recipe: Sequence[str], make: Callable[[Path], None]) -> Path:
    """A file in the user's cache, made if that has not been done before from these sources.

    Parameters
    ----------
    recipe
        What else the contents follow from: compiler, its version, options.
    make
        It writes the file at the path that it gets.

    Returns
    -------
    Path
        In the folder `gsvc-cuda` of the user's cache (XDG_CACHE_HOME, else ~/.cache), which the user alone can enter.
    """
    parts = [*(path.read_bytes() for path in sorted(KERNELS.iterdir())), *(part.encode() for part in recipe)]
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gsvc-cuda"
    home.mkdir(mode=0o700, parents=True, exist_ok=True)
    result = home / (hashlib.sha256(b"\0".join(parts)).hexdigest()[:32] + suffix)
    if not result.exists():
        with tempfile.TemporaryDirectory(dir=home) as folder:  # two that compile at once are in nobody's way
            made = Path(folder, "made")
            make(made)
            made.replace(result)
    return result
