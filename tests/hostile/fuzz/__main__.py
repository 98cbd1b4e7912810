"""The command: `python -m tests.hostile.fuzz TARGET --runs N --seed S --jobs 2`, or `--atheris`, or `--replay FILE`."""

import argparse
import os
import sys
from pathlib import Path


def main(arguments: list[str] | None = None) -> int:
    """Fuzz, replay or minimise; the exit code says whether there was no defect."""
    parser = argparse.ArgumentParser("python -m tests.hostile.fuzz", description="Fuzz everything that reads bytes.")
    parser.add_argument("target", help="what is fuzzed, such as parser or import; another word lists all")
    parser.add_argument("--runs", type=int, default=10_000, help="executions (with --atheris: at most)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first execution of the seed")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--folder", type=Path, default=Path(), help="where inputs that show a defect are written")
    parser.add_argument("--replay", type=Path, nargs="+", help="execute these inputs and say what comes of them")
    parser.add_argument("--atheris", action="store_true", help="be guided by coverage; kernels run uncompiled")
    parser.add_argument("--seconds", type=int, default=0, help="with --atheris: stop after this time; 0: no limit")
    parser.add_argument("--found", type=Path, default=Path("fuzz-found"), help="with --atheris: keeps new inputs")
    parser.add_argument(
        "--minimise",
        type=Path,
        help="replace the corpus by those of its own and this folder's inputs that are worth keeping",
    )
    given = parser.parse_args(arguments)
    if given.atheris or given.minimise:
        os.environ["NUMBA_DISABLE_JIT"] = "1"  # before gsvc_ref is imported: coverage sees into Python only
    if given.atheris:
        from . import guided

        return guided.run(given.target, runs=given.runs, seconds=given.seconds, seed=given.seed, found=given.found)
    from . import corpus, seeded
    from .fuzzing import TARGETS

    if given.target not in TARGETS:
        parser.error(f"there is no target {given.target}; there are {', '.join(TARGETS)}")
    if given.minimise:
        corpus.minimise(given.target, given.minimise)
        return 0
    if given.replay:
        if missing := [path for path in given.replay if not path.is_file()]:
            parser.error(f"--replay: there is no file {missing[0]}")
        for path in given.replay:
            print(f"{path}: {seeded.execute(TARGETS[given.target], path.read_bytes())}")
        return 0
    given.folder.mkdir(parents=True, exist_ok=True)
    good = seeded.run(
        given.target, runs=given.runs, seed=given.seed, first=given.first, jobs=given.jobs, folder=given.folder
    )
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
