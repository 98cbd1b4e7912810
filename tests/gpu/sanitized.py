"""``python -m tests.gpu.sanitized TOOL``: the CUDA kernels under compute-sanitizer, on a few vectors.

With --planted the kernels are compiled with a race in them (GSVC_CUDA_PLANTED_RACE), which racecheck has to report:
else it would prove nothing that it reports none without.
"""

import argparse
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from tests.gpu.advice import advice
from tests.gpu.outcome import Record
from tests.gpu.survey import tool

CASES: Final = (
    "core/render_sum/many_splats_101",
    "core/render_sum_deterministic/many_splats",
    "core/render_gradients/gradients_of_a_plain_picture_300_splats",
    "core/loss/loss_of_a_wide_picture",
    "core/decode_plane/lanes_64_for_150_symbols",
    "core/encode_plane/encoded_lanes_64_for_2000_symbols",
    "core/read_main_stream/main_64_lanes_of_one_splat",
    "core/decode_stream_deterministic/main_more_than_1024_splats_on_a_tile",
)
"""Vectors that set several warps of each kernel to work."""

SUMMARY: Final = re.compile(r"=+ (?:RACECHECK|ERROR) SUMMARY: (\d+) (?:hazard|error)")


def main(words: Sequence[str] | None = None) -> None:
    """Run the tool and count what it reports."""
    parser = argparse.ArgumentParser(prog="python -m tests.gpu.sanitized", description=__doc__)
    parser.add_argument("tool", choices=("racecheck", "memcheck"))
    parser.add_argument("--planted", action="store_true", help="with a race in the kernels")
    parser.add_argument("--json", type=Path, required=True, metavar="FILE", help="where the result goes")
    arguments = parser.parse_args(words)
    sanitizer = tool("compute-sanitizer")
    if sanitizer is None:
        sys.exit("compute-sanitizer is not there: install the CUDA toolkit")
    kit = [sys.executable, "-m", "gsvc_conformance", "run", "--module", "gsvc_conformance.adapters.cuda"]
    kit += [word for case in CASES for word in ("--case", case)]
    run = subprocess.run(
        [sanitizer, "--tool", arguments.tool, "--print-limit", "20", *kit, "--quiet", "--no-diagnosis"],
        env={**os.environ, **({"GSVC_CUDA_PLANTED_RACE": "1"} if arguments.planted else {})},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
    )  # fmt: skip
    print(run.stdout)
    found = SUMMARY.findall(run.stdout)
    if not found:
        sys.exit(advice(run.stdout, run.returncode))
    reports = sum(map(int, found))
    Record(arguments.json).end(reports=reports, wrong=bool(reports) != arguments.planted)


if __name__ == "__main__":
    main()
