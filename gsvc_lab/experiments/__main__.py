"""``python -m gsvc_lab.experiments``: the paper's experiments, by name or all."""

from gsvc_lab.experiments.command import main
from gsvc_ref.cli.errors import guarded

if __name__ == "__main__":
    raise SystemExit(guarded("python -m gsvc_lab.experiments", main))
