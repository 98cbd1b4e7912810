"""What the report says of the planted faults: a table, and the sentences about those that are not named rightly.

Exit code 1: something does not reach what is asked of its part.
"""

import sys
from argparse import ArgumentParser
from multiprocessing import get_context
from pathlib import Path
from typing import get_args

from planted import Part, all_planted, said_of, table
from planted.page import PAGE, TOLD, kept, page, short, to_json

parser = ArgumentParser(prog="python -m planted", description=__doc__)
parser.add_argument("--area", default="", help="only faults of this area")
parser.add_argument("--name", default="", help="only faults whose name has this text")
parser.add_argument("--all", action="store_true", help="tell of those named rightly, too")
parser.add_argument("--part", choices=get_args(Part), action="append", help="only this part of the lists")
parser.add_argument("--jobs", type=int, default=1, help="processes")
parser.add_argument("--results", type=Path, help="a file of what earlier runs found; what this one finds is added")
parser.add_argument("--write", action="store_true", help=f"write {PAGE.name}, of what was found")


def main() -> int:
    arguments = parser.parse_args()
    places = [
        place
        for place, fault in enumerate(all_planted())
        if arguments.area in fault.area
        and arguments.name in fault.name
        and fault.part in (arguments.part or get_args(Part))
    ]
    found = kept(arguments.results) if arguments.results else []
    with get_context("forkserver").Pool(arguments.jobs) as pool:
        for one in pool.imap(said_of, places):
            found = [*(other for other in found if other.mutant.name != one.mutant.name), one]
            if arguments.results:
                arguments.results.write_text(to_json(found), encoding="utf-8")
            if arguments.all or one.verdict != "right":
                print("\n".join(short(one)), flush=True)
    order = [fault.name for fault in all_planted()]
    found.sort(key=lambda one: order.index(one.mutant.name))
    print("\n".join(table(found)))
    if arguments.write:
        PAGE.write_text(page(found), encoding="utf-8")
    missed = [what for what, met in TOLD.items() if not met(found)]
    print("".join(f"NOT MET: {what}\n" for what in missed), end="")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
