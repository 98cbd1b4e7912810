"""``python -m gsvc_ref``: the same as the command ``gsvc``."""

from gsvc_ref.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
