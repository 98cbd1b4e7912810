"""``python -m experiments``: the paper's experiments, by name or all."""

from experiments.command import main

if __name__ == "__main__":
    raise SystemExit(main())
