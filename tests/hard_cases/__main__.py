"""Measure all hard cases: `python -m tests.hard_cases [--markdown FILE]`."""

import argparse
from pathlib import Path

from gsvc_base.pages.markers import put_between
from tests.hard_cases.table import BEGIN, END, failures, measurements, plain, row
from tests.hard_cases.table import markdown as as_markdown


def main() -> int:
    """Print the table, and write it into a page; 1 if a case fails."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.hard_cases",
        description="Measure all hard cases, which takes a minute or two. The exit code is 1 if one fails.",
    )
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="also write the table into this page")
    page: Path | None = parser.parse_args().markdown
    measured = list(measurements())
    lines = [row(*one) for one in measured]
    print(plain(lines))
    if page is not None:
        put_between(page, BEGIN, END, as_markdown(lines))
    if failed := failures(measured):
        print(f"\nFAILED: {', '.join(failed)}")
        return 1
    print(f"\n{len(lines)} cases: every error of ours is within its bound, and every naive formula fails")
    return 0


raise SystemExit(main())
