"""``python -m gsvc_lab.site``: write the documents as a static site."""

import argparse
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def main(arguments: list[str] | None = None) -> int:
    """Write the site and say how to look at it."""
    parser = argparse.ArgumentParser(prog="python -m gsvc_lab.site", description=__doc__)
    parser.add_argument(
        "--output", type=Path, default=ROOT / "site", help="folder for the site, which is emptied first"
    )
    folder: Path = parser.parse_args(arguments).output
    try:
        from gsvc_lab.site.build import Site
    except ModuleNotFoundError as error:
        print(f"{error}; the site needs the extra site: pip install '.[site]'", file=sys.stderr)
        return 2
    if folder.exists() and any(folder.iterdir()) and not (folder / "search-index.js").exists():
        print(f"{folder} holds something else than a site; name another folder, or empty it", file=sys.stderr)
        return 2
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    count = Site(ROOT).write(folder)
    print(f"{folder}: {count} pages. Open {folder / 'index.html'}, or serve them: python -m http.server -d {folder}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
