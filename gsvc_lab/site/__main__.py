"""``python -m gsvc_lab.site``: write the documents as a static site."""

import argparse
import sys
from pathlib import Path
from typing import Final

from gsvc_base.errors import UsageError
from gsvc_base.folders import OwnFolder

ROOT = Path(__file__).parents[2]
RECORD: Final = "site.json"
"""The file that lists those of a site."""


def main(arguments: list[str] | None = None) -> int:
    """Write the site and say how to look at it."""
    parser = argparse.ArgumentParser(prog="python -m gsvc_lab.site", description=__doc__)
    parser.add_argument(
        "--output", type=Path, default=ROOT / "site", help="folder for the site; the files of an earlier one go first"
    )
    folder: Path = parser.parse_args(arguments).output
    try:
        from gsvc_lab.site.build import built
    except ModuleNotFoundError as error:
        print(f"{error}; the site needs the extra site: pip install '.[site]'", file=sys.stderr)
        return 2
    try:
        with OwnFolder(folder, RECORD, mode=0o755, group=True, parents=True) as own:
            count, files = built(ROOT)
            own.write_listed(RECORD, files)
    except UsageError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{folder}: {count} pages. Open {folder / 'index.html'}, or serve them: python -m http.server -d {folder}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
