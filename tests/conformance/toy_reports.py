"""A report of the toy operations with every kind of result, for tests of what is made of reports."""

import math
from dataclasses import replace

from toy_operations import OPERATIONS

from gsvc_conformance.results import OutputResult, Result
from gsvc_conformance.verdicts import Report


def result(slug, outcome="pass", operation="scale", tier="core", ratio=0.5, **changes) -> Result:
    output = OutputResult("scaled", "bounded", outcome == "pass", "", ratio, (2, 1))
    group = OPERATIONS[operation].group
    return replace(Result(f"{tier}/{operation}/{slug}", f"Shows {slug}.", group, outcome, "", (output,)), **changes)


RESULTS = [
    result("good"),
    result("also_good", ratio=0.75),
    result("wrong", "fail", ratio=math.inf, message="scaled is inf", causes=("a factor of two",)),
    result("dead", "crash", message="killed by SIGSEGV", log="before\x00\x1b[31m the end", outputs=()),
    result("none", "unsupported", operation="halve", outputs=()),
    result("ten_bits", "unsupported", operation="paint", tier="uncommon", outputs=()),
    result("eight_bits", operation="paint", ratio=None),
    result("known", "waived", operation="parse", message="bug 12 (waived fail: is 1)"),
    result("fine", operation="parse", ratio=None, seconds=1.5),
]
ENVIRONMENT = {"implementation": "./toy", "vectors": "0" * 64}


def toy_report() -> Report:
    return Report(ENVIRONMENT, "gsvc-conformance run --impl ./toy", "", ["a note"], RESULTS)
