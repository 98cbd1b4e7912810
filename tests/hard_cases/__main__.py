"""Measure all hard cases: `python -m tests.hard_cases [--markdown FILE]`."""

import argparse
from pathlib import Path

from tests.hard_cases.table import markdown as as_markdown
from tests.hard_cases.table import plain, replaced, rows


def main() -> None:
    """Print the table, and write it into a page."""
    parser = argparse.ArgumentParser(prog="python -m tests.hard_cases", description="Measure all hard cases.")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="also write the table into this page")
    page: Path | None = parser.parse_args().markdown
    lines = rows()
    print(plain(lines))
    if page is not None:
        page.write_text(replaced(page.read_text(encoding="utf-8"), as_markdown(lines)), encoding="utf-8")


main()
