"""Two operations behind the protocols of GSVC's conformance kit (protocol.md): a command, or with --serve a server.

As `--module` the functions alone would do. Python 3.8 and NumPy 1.17 are enough for it.

gsvc-conformance run --impl "python conformance/examples/minimal.py" --operation render_sum
gsvc-conformance run --serve "python conformance/examples/minimal.py --serve" --operation render_sum
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


def from_half(bits: Any) -> dict[str, Any]:
    """The value of each binary16 pattern."""
    return {"values": bits.view("<f2").astype("<f4")}


def render_sum(parameters: Any, width: int, height: int) -> dict[str, Any]:
    """(9-1) and (9-2)."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    total = np.zeros((height, width, 3))
    for px, py, l11, l21, l22, *color in parameters.astype("f8"):
        if 2.0**-126 <= l11 < np.inf and 2.0**-126 <= l22 < np.inf:
            u1 = (x - px) / l11
            u2 = (y - py - l21 * u1) / l22
            sigma = (u1 * u1 + u2 * u2) / 2
            total += np.where(sigma <= np.log(255), np.exp(-sigma), 0)[..., None] * color
    return {"sum": total.astype("<f4")}


def answer(operation: str, in_dir: str, out_dir: str) -> int:
    """Read the inputs, call the operation's function, write its outputs; the exit status."""
    functions: dict[str, Callable[..., dict[str, Any]]] = {"from_half": from_half, "render_sum": render_sum}
    if operation not in functions:
        return 77  # not supported
    inputs = {path.stem: np.load(path) for path in Path(in_dir).glob("*.npy")}
    inputs = {name: value.item() if value.ndim == 0 else value for name, value in inputs.items()}
    for name, value in functions[operation](**inputs).items():
        np.save(Path(out_dir, f"{name}.npy"), value)
    return 0


def serve() -> int:
    """Say hello, then answer request after request until standard input ends."""
    print(json.dumps({"gsvc": 1, "name": "minimal.py", "environment": {"NumPy": np.__version__}}), flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        said = {"id": request["id"], "status": "done"}
        try:
            if answer(request["operation"], request["in"], request["out"]) == 77:
                said["status"] = "unsupported"
        except Exception as error:
            said.update(status="error", message=repr(error))
        print(json.dumps(said), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(serve() if sys.argv[1:] == ["--serve"] else answer(*sys.argv[1:]))
