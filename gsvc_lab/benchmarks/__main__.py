"""``python -m gsvc_lab.benchmarks``: measure, print tables, and keep the numbers (`make bench`)."""

import argparse
import json
import os
import sys
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, Final

from gsvc_lab.benchmarks.changes import changes
from gsvc_lab.benchmarks.decoding import decoding
from gsvc_lab.benchmarks.material import CACHE
from gsvc_lab.benchmarks.peers import Limit
from gsvc_lab.benchmarks.rendering import kernels, peers, precisions
from gsvc_lab.benchmarks.results import Section, goal_table
from gsvc_lab.benchmarks.scaling import scaling
from gsvc_lab.benchmarks.start import start
from gsvc_lab.machine import environment

RESULTS: Final = CACHE / "results.json"

SECTIONS: Final = ("kernels", "precisions", "peers", "decoding", "changes", "scaling", "start")


def main() -> None:
    """Measure the sections that are asked for."""
    parser = argparse.ArgumentParser(prog="python -m gsvc_lab.benchmarks", description=__doc__)
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=f"of {', '.join(SECTIONS)}; default: all")
    parser.add_argument("--limit", type=Path, metavar="FOLDER", help="folder of the C++ limit, with its limit.py")
    parser.add_argument("--limit-name", default="the C++ limit", help="what the tables call it")
    parser.add_argument("--threads", type=int, default=min(2, os.cpu_count() or 1), help="default: 2, if there are")
    parser.add_argument(
        "--json", type=Path, default=RESULTS, metavar="FILE", help="keep the numbers of each section here"
    )
    arguments = parser.parse_args()
    if unknown := set(arguments.sections) - set(SECTIONS):
        parser.error(f"there is no section {unknown.pop()}; there are {', '.join(SECTIONS)}")
    limit = Limit(arguments.limit)
    if arguments.limit is not None and limit.stick is None:
        print(f"{limit.reason}; going on without it.", file=sys.stderr)
    measure: dict[str, Callable[[int], Section]] = {
        "kernels": partial(kernels, limit=limit),
        "precisions": precisions,
        "peers": peers,
        "decoding": decoding,
        "changes": changes,
        "scaling": scaling,
        "start": start,
    }
    print(describe(environment(arguments.threads)), end="\n\n", flush=True)
    goals = []
    for name in arguments.sections or SECTIONS:
        section = measure[name](arguments.threads)
        print(section.markdown(), end="\n\n", flush=True)
        goals += section.goals
        keep(arguments.json, name, section, arguments)
    print(goal_table(goals).markdown())


def describe(machine: dict[str, Any]) -> str:
    """The machine in a sentence."""
    packages = ", ".join(f"{name} {machine[name]}" for name in ("numpy", "numba", "llvmlite", "torch"))
    return (
        f"{machine['cpu']}, {machine['cores']} cores, {machine['vectors']}, {machine['system']}; {machine['threads']} "
        f"threads; Python {machine['python']}, {packages}; gsvc_ref {machine['gsvc_ref']}."
    )


def keep(path: Path, name: str, section: Section, arguments: argparse.Namespace) -> None:
    """Put a section into the file of results, beside what other runs put there."""
    results = json.loads(path.read_text()) if path.exists() else {}
    limit = arguments.limit_name if arguments.limit is not None else None
    results[name] = {"environment": environment(arguments.threads), "limit": limit, **asdict(section)}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
