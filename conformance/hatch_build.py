"""What a built gsvc-conformance has beside the package's folder: the vectors, the documents, and what it borrows.

In a checkout the kit imports gsvc_ref and gsvc_lab as they stand. A wheel or sdist must judge with NumPy alone. So when
one is built, each module of these two that *judging* modules import at their top, and what it imports at its own top,
is copied into `gsvc_conformance.borrowed`, and these imports name the copy. Imports inside functions, and those of the
modules in `MAKING`, are left as they are: they need gsvc_ref, the extra `reference`. A package's ``__init__`` is copied
if it is imported by its own name; otherwise the copy's is empty. Lines keep their numbers.
"""

import ast
import shutil
import zipfile
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

KIT = "gsvc_conformance"
MAKING = ("cases/[!_]*.py", "streams.py")
"""Modules of the kit that make vectors or streams, and therefore need gsvc_ref: patterns below the package."""
LENDERS = ("gsvc_ref", "gsvc_lab")
DATA = {
    "spec.md": "borrowed/gsvc_ref/spec.md",
    "gsvc_base/pages/style.css": "borrowed/gsvc_base/pages/style.css",
    "conformance/protocol.md": "protocol.md",
    "conformance/examples": "examples",
    "LICENSE": "LICENSE",
}
"""Files and folders of the checkout, and their places in the package."""
SAME_CLASSES = """

try:  # whoever catches an error of the kit catches that of an installed gsvc_ref, and the other way round
    from gsvc_base.errors import GsvcError, UsageError
except ModuleNotFoundError:
    pass
"""
"""The end of the copy of gsvc_base.errors."""
OLDEST = (1980, 1, 1, 0, 0, 0)
"""The time of files in vectors.zip: the same archive each time."""


class BuildHook(BuildHookInterface):  # type: ignore[misc]
    """Adds what a checkout has to each wheel and sdist; an installation in place stays as it is."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Put the package together; an sdist holds it as it is to be."""
        root = Path(self.root)
        if version == "editable" or (root / KIT / "borrowed").is_dir():
            return
        self._folder = TemporaryDirectory()
        package = Path(self._folder.name)
        put_together(root.parent, package)
        places = {path: f"{KIT}/{path.relative_to(package).as_posix()}" for path in package.rglob("*")}
        build_data["force_include"].update({str(path): place for path, place in places.items() if path.is_file()})

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the folder that the package was put together in."""
        if hasattr(self, "_folder"):
            self._folder.cleanup()


def put_together(checkout: Path, package: Path) -> None:
    """Write what a built package has and its folder in the checkout has not, or has with other imports."""
    for path in judging(checkout):
        _write(package / path.relative_to(checkout / "conformance" / KIT), rewritten(path))
    for module in borrowed(checkout):
        source = path_of(checkout, module)
        target = package / "borrowed" / source.relative_to(checkout)
        _write(target, rewritten(source) + (SAME_CLASSES if module == "gsvc_base.errors" else ""))
        for folder in target.relative_to(package).parents[:-1]:
            if not (package / folder / "__init__.py").exists():
                _write(package / folder / "__init__.py", "")
    for source, place in DATA.items():
        (package / place).parent.mkdir(parents=True, exist_ok=True)
        copy = shutil.copytree if (checkout / source).is_dir() else shutil.copy
        copy(checkout / source, package / place)
    with zipfile.ZipFile(package / "vectors.zip", "w") as archive:
        for path in sorted(path for path in (checkout / "vectors").rglob("*") if path.is_file()):
            name = zipfile.ZipInfo(path.relative_to(checkout / "vectors").as_posix(), OLDEST)
            archive.writestr(name, path.read_bytes())  # plain: the wheel compresses all files together, and better


def judging(checkout: Path) -> list[Path]:
    """The modules of the kit that judge."""
    home = checkout / "conformance" / KIT
    making = {path for pattern in MAKING for path in home.glob(pattern)}
    return [path for path in sorted(home.rglob("*.py")) if path not in making]


def borrowed(checkout: Path) -> list[str]:
    """The modules of gsvc_ref and gsvc_lab that judging modules, and these themselves, import at their top."""
    found: dict[str, None] = {}
    waiting = judging(checkout)
    while waiting:
        for _, modules in lent(waiting.pop(), checkout):
            waiting += [path_of(checkout, module) for module in modules if module not in found]
            found |= dict.fromkeys(modules)
    return sorted(found)


def lent(path: Path, checkout: Path) -> Iterator[tuple[ast.ImportFrom, list[str]]]:
    """The imports of gsvc_ref and gsvc_lab at the top of a module, with the modules that each names.

    Raises
    ------
    ValueError
        One is written ``import gsvc_ref``: the name would be that of the copy.
    """
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import) and any(alias.name.partition(".")[0] in LENDERS for alias in node.names):
            raise ValueError(
                f"{path}, line {node.lineno}: write `from gsvc_ref import ...`, or import it in a function"
            )
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in LENDERS:
            inner = {alias.name: f"{node.module}.{alias.name}" for alias in node.names}
            yield node, [name if path_of(checkout, name).exists() else str(node.module) for name in inner.values()]


def path_of(checkout: Path, module: str) -> Path:
    """The file of a module, whether it is there or not; of a package, its ``__init__``."""
    place = checkout.joinpath(*module.split("."))
    return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")


def rewritten(path: Path) -> str:
    """The text of a module whose imports at the top name the copies."""
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines(keepends=True)
    for node in ast.parse(text).body:
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in LENDERS:
            lines[node.lineno - 1] = lines[node.lineno - 1].replace("from ", f"from {KIT}.borrowed.", 1)
    return "".join(lines)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
