"""``generate``: write the vectors, or compare them with what the cases make."""

import hashlib
from argparse import ArgumentParser, Namespace
from pathlib import Path

from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import plural, show
from gsvc_base.errors import UsageError
from gsvc_conformance.commands import add_vectors, count
from gsvc_conformance.vector import SUMS, files_in, set_hash, sums_of


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    add_vectors(parser)
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--check", action="store_true", help="write nothing; say what would change (exit code 1)")
    what.add_argument("--full", type=Path, metavar="DIR", help="write the full set of large vectors there instead")
    parser.add_argument(
        "--without-kills", action="store_true",
        help="with --check: run no mutants, which takes most of the time; which of them a vector finds is not checked",
    )  # fmt: skip
    parser.add_argument(
        "--jobs",
        type=count,
        default=0,
        metavar="N",
        help="processes that make them (default: 0, one for each processor)",
    )
    parser.add_argument("--quiet", action="store_true", help="show no progress")


def run(arguments: Namespace) -> int:
    """Write or compare; 1 if a comparison finds differences."""
    from gsvc_conformance import generate

    if not arguments.check and not arguments.full and arguments.vectors.is_file():
        raise UsageError(f"{arguments.vectors} is an archive: name a folder to write to, with --vectors DIR")
    if arguments.check and SUMS not in files_in(arguments.vectors):
        raise UsageError(f"there are no vectors in {arguments.vectors}; write them with: gsvc-conformance generate")
    if arguments.without_kills and not arguments.check:
        raise UsageError("--without-kills goes with --check: vectors are written with all that they say")
    with ProgressDisplay(quiet=arguments.quiet) as display:

        def on_case(done: int, total: int) -> None:
            display.update(f"{done} of {plural(total, 'vector')}", done, total)

        if arguments.check:
            made = generate.make(
                on_case=on_case, jobs=arguments.jobs, kills_in=arguments.vectors if arguments.without_kills else None
            )
            found = generate.differences(arguments.vectors, made)
        elif arguments.full:
            found = generate.generate_full(arguments.full, on_case, jobs=arguments.jobs)
        else:
            found, many = [], generate.generate(arguments.vectors, on_case, jobs=arguments.jobs)
    for line in found:
        show(line)
    if arguments.check:
        show("the vectors differ from what the cases make" if found else "the vectors are what the cases make")
        whole = {**made, **generate.kept(arguments.vectors, made)}
        show(f"SHA-256 of the {SUMS} that they make: {hashlib.sha256(sums_of(whole)).hexdigest()}")
    elif arguments.full:
        show(f"written to {arguments.full}; " + ("these hashes are not known" if found else "all hashes are known"))
    else:
        show(f"{plural(many, 'vector')} in {arguments.vectors}, SHA-256 of {SUMS}: {set_hash(arguments.vectors)}")
    return 1 if found else 0
