"""The compiler of Kaitai Struct, which `make kaitai` installs with npm into .venv/kaitai."""

import os
import shutil
import subprocess
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
SOURCE: Final = ROOT / "docs" / "gsvc.ksy"
MODULES: Final = Path(os.environ.get("NODE_PATH") or ROOT / ".venv" / "kaitai" / "node_modules")


def missing() -> str:
    """What is not there that compiling needs; '' if all is."""
    if shutil.which("node") is None:
        return "there is no node; it runs kaitai-struct-compiler"
    packages = [name for name in ("kaitai-struct-compiler", "js-yaml") if not (MODULES / name).is_dir()]
    return f"{MODULES} has no {' and no '.join(packages)}: make kaitai" if packages else ""


def compile_to(language: str, folder: Path, source: Path = SOURCE) -> None:
    """Compile a .ksy file into a folder.

    Raises
    ------
    ValueError
        The compiler refuses it.
    """
    script = Path(__file__).parent / "compile.js"
    done = subprocess.run(
        ["node", str(script), str(source), language, str(folder)],
        capture_output=True, text=True, check=False, env={**os.environ, "NODE_PATH": str(MODULES)},
    )  # fmt: skip
    if done.returncode:
        raise ValueError(done.stderr.strip())
