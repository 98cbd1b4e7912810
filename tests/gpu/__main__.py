"""``python -m tests.gpu``: judge and measure everything that runs on this machine's GPU, in minutes.

It says what it found, what it runs, and what it leaves out and why. Then it runs the parts, each a process with a time
limit, and writes the files of `results` after each. Exit code 0: nothing is wrong; 1: something is wrong, failed or was
stopped; 2: there is no GPU.
"""

import argparse
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from gsvc_base.cli.text import plural
from gsvc_lab.benchmarks.material import CACHE
from tests.gpu.golden import GOLDEN, coded, made
from tests.gpu.page import write_page
from tests.gpu.parts import Part, Plan
from tests.gpu.results import Results, summary
from tests.gpu.running import results_of
from tests.gpu.splats import DRAWS, TRAINED
from tests.gpu.survey import ROOT, Survey, surveyed

REPORTS: Final = ROOT / "docs" / "reports"
SECONDS: Final = 225
NO_GPU: Final = (
    "No adapter finds a GPU here. If there is one, install its driver and the packages that the lines above name. "
    "If there is none, --cpu runs every part on the processor, on little work, to test this command."
)


def main(words: Sequence[str] | None = None) -> int:
    """Run everything and say how it went."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.gpu",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        help="where reports go (docs/reports; with --cpu or --only in that of --work)",
    )
    parser.add_argument(
        "--work", type=Path, default=CACHE / "gpu", metavar="WORK", help="where the parts' files and logs go"
    )
    parser.add_argument(
        "--seconds", type=float, default=SECONDS, metavar="S", help=f"for all parts together ({SECONDS})"
    )
    parser.add_argument("--only", action="append", metavar="PART", help="run this part; may be repeated")
    parser.add_argument(
        "--cpu", action="store_true", help="let processors play the GPU, on little: a test of this command"
    )
    arguments = parser.parse_args(words)
    work: Path = arguments.work.resolve()  # parts run in a folder of their own
    out: Path = arguments.out or (work / "reports" if arguments.cpu or arguments.only else REPORTS)
    survey = surveyed(work / "loaders", cpu=arguments.cpu)
    planned = Plan(survey, work, arguments.cpu).parts() if survey.runs else []
    if arguments.only and planned:
        if unknown := set(arguments.only) - {part.name for part in planned}:
            parser.error(f"there is no part {unknown.pop()} here; there are {', '.join(part.name for part in planned)}")
        planned = [part for part in planned if part.name in arguments.only]
    print("\n".join(found(survey, planned)), flush=True)
    if not survey.runs:
        print(NO_GPU, file=sys.stderr)
        return 2
    if not arguments.cpu:
        made(GOLDEN, TRAINED, [coded()], DRAWS)
    results = Results(survey, work, out)
    begin = time.monotonic()
    for outcome in results_of(planned, work, arguments.seconds, survey.width):
        results.add(outcome)
        print(f"{time.monotonic() - begin:5.0f} s  {outcome.what}: {outcome.state}, {outcome.told}", flush=True)
    print("", *summary(results.outcomes), "", f"Reports are in {out}, logs in {work}.", sep="\n")
    if out == REPORTS:
        write_page(REPORTS)
    return int(any(outcome.state in ("wrong", "failed", "stopped") for outcome in results.outcomes))


def found(survey: Survey, planned: Sequence[Part]) -> list[str]:
    """What there is, what is run, and what is skipped and why."""
    lines = [survey.card or "no card", *(f"  {name}: {text}" for name, text in survey.machine.items())]
    lines += [f"{name} runs on {answer.get('device', '?')}" for name, answer in survey.answers.items()]
    lines += [f"{name} is left out: {reason}" for name, reason in survey.missing.items()]
    lines += [f"  {part.what} is skipped: {part.missing}" for part in planned if part.missing]
    count = sum(not part.missing for part in planned)
    return [*lines, f"{plural(count, 'part')} to run", ""] if planned else lines


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that the parts are ended, too
    raise SystemExit(main())
