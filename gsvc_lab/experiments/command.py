"""The command: run experiments, keep their results, and show them."""

import argparse
import json
import sys
import textwrap
import time
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stdout, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from gsvc_base.cli.text import duration
from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.files import write_text
from gsvc_base.interrupts import termination_as_ctrl_c
from gsvc_lab.experiments.elsewhere import make_elsewhere
from gsvc_lab.experiments.experiment import Experiment, Run
from gsvc_lab.experiments.figures import check_figures
from gsvc_lab.experiments.markdown import write_document
from gsvc_lab.experiments.page import page, write_narrow
from gsvc_lab.experiments.results import read_all, record, write

NAMES: Final = (
    "splats",
    "iterations",
    "pruning",
    "augmentation",
    "key_frames",
    "ablation",
    "rate_distortion",
    "layers",
    "rate_control",
    "time",
    "sizes",
    "own_splats",
    "lanes",
)
"""The experiments in the order of the paper, and three that it lacks; each is the module of that name."""

FOLDER: Final = Path("experiments/results")


def load(name: str) -> Experiment:
    """The experiment of a name."""
    experiment: Experiment = import_module(f"gsvc_lab.experiments.{name}").EXPERIMENT
    return experiment


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(prog="python -m gsvc_lab.experiments", description=__doc__, allow_abbrev=False)
    made.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(NAMES)}; default: all")
    made.add_argument("--list", action="store_true", help="list the experiments with the paper's claims")
    made.add_argument("--full", action="store_true", help="larger, nearer to the paper's counts: hours to days")
    made.add_argument(
        "--clip", type=Path, action="append", default=[], metavar="FILE", help="measure on this file; may be repeated"
    )
    made.add_argument("--uvg", type=Path, metavar="DIR", help="measure on the UVG sequences (raw .yuv) in this folder")
    made.add_argument("--output", type=Path, default=FOLDER, metavar="DIR", help=f"for results (default: {FOLDER})")
    made.add_argument("--threads", type=int, metavar="T", help="threads to compute with (default: all)")
    made.add_argument(
        "--jobs", type=int, default=1, metavar="J", help="experiments at the same time, each in a process (default: 1)"
    )
    made.add_argument(
        "--scheduler", metavar="tcp://HOST:8786", help="make each experiment on a worker of this scheduler of dask, "
        "which needs this checkout, the extra experiments, and the files of --clip and --uvg under the same path"
    )  # fmt: skip
    made.add_argument("--json", action="store_true", help="print the records as JSON; progress goes to standard error")
    made.add_argument(
        "--markdown", type=Path, metavar="FILE", help="write the results there as a document, with figures beside it; "
        "without NAME nothing is run"
    )  # fmt: skip
    return made


def main(words: Sequence[str] | None = None) -> int:
    """Run, show and keep; 0, 1 if an experiment could not be made, 2 for wrong use, 130 for Ctrl-C, 143 for SIGTERM."""
    arguments = parser().parse_args(words)
    with termination_as_ctrl_c() as exit_code:
        return exit_code(_run(arguments))


def _run(arguments: argparse.Namespace) -> int:
    if unknown := [name for name in arguments.names if name not in NAMES]:
        print(f"there is no experiment {unknown[0]}; there are {', '.join(NAMES)}", file=sys.stderr)
        return 2
    if arguments.list:
        print("\n".join(describe(load(name)) for name in arguments.names or NAMES))
        return 0
    names = arguments.names or ((), NAMES)[arguments.markdown is None]
    try:
        with redirect_stdout(sys.stderr) if arguments.json else nullcontext():
            if names:
                check_figures()
                arguments.output.mkdir(parents=True, exist_ok=True)
            if names and (arguments.scheduler is not None or arguments.jobs > 1):
                failed = make_elsewhere(make, names, arguments, arguments.jobs, arguments.scheduler)
            else:
                failed = [name for name in names if not make(name, arguments)]
            if len(failed) < len(names) or not names:
                records = show(arguments)
        if arguments.json and (len(failed) < len(names) or not names):
            shown = [made for made in records if made["name"] in (names or NAMES) and made["name"] not in failed]
            print(json.dumps(shown, allow_nan=False, ensure_ascii=False, indent=1))
    except BrokenPipeError:  # the reader has enough
        raise
    except (UsageError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"\ninterrupted; what was done before is kept in {arguments.output}", file=sys.stderr)
        with suppress(UsageError, OSError):  # there may be nothing yet
            write_index(arguments.output)
        return 130
    if failed:
        print(f"not made: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def show(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Write the page over all results that there are, and the document if asked for; returns their records.

    A UsageError says that there are none, or one is damaged. An OSError says that a file cannot be written.
    """
    records = write_index(arguments.output)
    print(f"{arguments.output / 'index.html'}: {len(records)} of {len(NAMES)} experiments to look at in a browser")
    if arguments.markdown is not None:
        write_document(records, arguments.output, arguments.markdown, print)
        print(f"{arguments.markdown}: the same as a document")
    return records


def write_index(folder: Path) -> list[dict[str, Any]]:
    """Write the page over all results that a folder has; returns their records.

    A UsageError says that there are none, or one is damaged.
    """
    records = read_all(folder, NAMES)
    if not records:
        raise UsageError(f"{folder} holds no results; run some experiments first")
    write_text(page(records, write_narrow(records, folder)), folder / "index.html")
    return records


def make(name: str, arguments: argparse.Namespace) -> bool:
    """Run one experiment and keep its result; False, with a message, where it cannot be made."""
    begin = time.perf_counter()

    def say(sentence: str) -> None:
        print(f"  {duration(time.perf_counter() - begin):>9}  {sentence}", flush=True)

    try:
        experiment = load(name)
        print(f"{experiment.title} ({name})", flush=True)
        threads = experiment.threads(arguments.threads, full=arguments.full)
        run = Run(arguments.full, arguments.output, say, tuple(arguments.clip), arguments.uvg, threads)
        result = experiment.run(run)
        path = write(record(experiment, result, run, time.perf_counter() - begin), run.folder)
    except (UsageError, GsvcError, OSError) as error:
        print(f"  {name} cannot be made: {error}", file=sys.stderr)
        return False
    verdict = textwrap.fill(f"Does it hold? {result.verdict.holds}. {result.verdict.sentence}", 110)
    print(textwrap.indent(verdict, "  ") + "\n")
    for table in result.tables:
        print(f"{table.markdown()}\n")
    print(f"  {path}, {', '.join(f'{figure}.svg' for figure in result.figures)}\n", flush=True)
    return True


def describe(experiment: Experiment) -> str:
    """An experiment in lines."""
    return f"{experiment.name}: {experiment.title}\n" + textwrap.indent(textwrap.fill(experiment.claim, 110), "    ")
