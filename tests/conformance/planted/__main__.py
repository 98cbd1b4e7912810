"""The table over all planted bugs, and what is said of those that are not named rightly.

Exit code 1: of those that are caught fewer than 90 % are named or located rightly, or more than 2 % wrongly.
"""

import sys
from argparse import ArgumentParser
from typing import get_args

from planted import Part, all_bugs, said, table

parser = ArgumentParser(prog="python -m planted", description=__doc__)
parser.add_argument("--area", default="", help="only bugs of this area")
parser.add_argument("--name", default="", help="only bugs whose name has this text")
parser.add_argument("--all", action="store_true", help="tell of those named rightly, too")
parser.add_argument("--part", choices=get_args(Part), action="append", help="only this part of the lists")
arguments = parser.parse_args()
found = []
for bug in all_bugs():
    if arguments.area in bug.area and arguments.name in bug.name and bug.part in (arguments.part or get_args(Part)):
        found.append(said(bug))
        if arguments.all or found[-1].verdict != "right":
            print(f"{found[-1].verdict.upper()}: {bug.area}, {bug.name} (to be told: {bug.right})")
            print("".join(f"    {line}\n" for line in found[-1].lines), end="", flush=True)
print("\n".join(table(found)))
caught = [one.verdict for one in found if one.verdict != "not caught"]
met = caught.count("right") >= 0.9 * len(caught) and caught.count("wrong") <= 0.02 * len(caught)
sys.exit(0 if met else 1)
