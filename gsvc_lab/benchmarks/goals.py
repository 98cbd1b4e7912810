"""``python -m gsvc_lab.benchmarks.goals``: bit rates that are asked for, and those that come out.

Six clips are encoded to bit rates with `Settings.bitrate`, each twice: with a low goal and a high one. Seconds are CPU
time, beside that of one encode with the number of splats that the goal came to.
"""

import time
from io import BytesIO
from typing import Final

from gsvc_base.pages.tables import markdown_table
from gsvc_lab.clips import Clip, packaged_clip, scene_clip
from gsvc_ref import Settings, encode

WIDTH, HEIGHT, FRAMES = 128, 96, 16

KEY_FRAMES: Final = 8
"""Two groups of pictures, where a scene has no cut of its own."""

GOALS: Final = (60, 240)
"""In kbit/s."""

SCENES: Final = ("pan", "water", "talking-head", "cross-fade")

PACKAGED: Final = ("carphone_pristine", "bikes")


def main() -> None:
    """Measure, and print a table."""
    clips = [scene_clip(name, WIDTH, HEIGHT, FRAMES) for name in SCENES]
    clips += [packaged_clip(name).scaled(WIDTH, HEIGHT) for name in PACKAGED]
    rows = [measured(clip, goal) for clip in clips for goal in GOALS]
    header = ["clip", "asked, kbit/s", "got", "off", "mean PSNR, dB", "passes", "CPU, s", "one encode, s"]
    print(markdown_table(header, rows))


def measured(clip: Clip, goal: int) -> list[str]:
    """A row of the table."""
    steps: list[str] = []
    settings = Settings.quick(bitrate=1000.0 * goal, key_frames=KEY_FRAMES, threads=1)
    begin = time.process_time()
    report = encode(
        clip.source(0, FRAMES), BytesIO(), settings,
        progress=lambda progress: steps.append(progress.step) if progress.step not in steps else None,
    )  # fmt: skip
    seconds = time.process_time() - begin
    got = float(8 * report.file_bytes * report.header.frame_rate / len(report.frames) / 1000)
    splats = max(frame.splats for frame in report.frames if frame.type == "I")
    begin = time.process_time()
    encode(clip.source(0, FRAMES), BytesIO(), Settings.quick(splats=splats, key_frames=KEY_FRAMES, threads=1))
    alone = time.process_time() - begin
    return [
        clip.name, str(goal), f"{got:.1f}", f"{100 * (got / goal - 1):+.1f} %", f"{report.mean_psnr:.2f}",
        str(len(steps)), f"{seconds:.1f}", f"{alone:.1f}",
    ]  # fmt: skip


if __name__ == "__main__":
    main()
