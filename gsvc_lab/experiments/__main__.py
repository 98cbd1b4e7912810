"""``python -m gsvc_lab.experiments``: the paper's experiments, by name or all."""

from gsvc_base.cli.errors import guarded
from gsvc_lab.experiments.command import main

if __name__ == "__main__":
    raise SystemExit(guarded("python -m gsvc_lab.experiments", main))
