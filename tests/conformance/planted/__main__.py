"""The table over all planted mutants, and what is said of those that are not named rightly.

Exit code 1: of those that are caught fewer than 90 % are named or located rightly, or more than 2 % wrongly.
"""

import sys
from argparse import ArgumentParser
from typing import get_args

from planted import Part, all_planted, said, table

parser = ArgumentParser(prog="python -m planted", description=__doc__)
parser.add_argument("--area", default="", help="only mutants of this area")
parser.add_argument("--name", default="", help="only mutants whose name has this text")
parser.add_argument("--all", action="store_true", help="tell of those named rightly, too")
parser.add_argument("--part", choices=get_args(Part), action="append", help="only this part of the lists")
arguments = parser.parse_args()
found = []
for mutant in all_planted():
    if (
        arguments.area in mutant.area
        and arguments.name in mutant.name
        and mutant.part in (arguments.part or get_args(Part))
    ):
        found.append(said(mutant))
        if arguments.all or found[-1].verdict != "right":
            print(f"{found[-1].verdict.upper()}: {mutant.area}, {mutant.name} (to be told: {mutant.right})")
            print("".join(f"    {line}\n" for line in found[-1].lines), end="", flush=True)
print("\n".join(table(found)))
caught = [one.verdict for one in found if one.verdict != "not caught"]
met = caught.count("right") >= 0.9 * len(caught) and caught.count("wrong") <= 0.02 * len(caught)
sys.exit(0 if met else 1)
