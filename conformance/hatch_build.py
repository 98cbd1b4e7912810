"""What a built gsvc-conformance has beside the package's folder: gsvc_base, the documents and the vectors."""

import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

KIT = "gsvc_conformance"
BESIDE = {
    "gsvc_base": "bundled/gsvc_base",
    "spec.md": "bundled/gsvc_base/spec.md",
    "conformance/protocol.md": "protocol.md",
    "conformance/examples": "examples",
    "LICENSE": "LICENSE",
}
"""Files and folders of the checkout, and their places in the package."""
OLDEST = (1980, 1, 1, 0, 0, 0)
"""The time of files in vectors.zip: the same archive each time."""


class BuildHook(BuildHookInterface):  # type: ignore[misc]
    """Adds what a checkout has to each wheel and sdist; an installation in place stays as it is."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Name what is added; an sdist holds it already."""
        package = Path(self.root, KIT)
        if version == "editable" or (package / "vectors.zip").exists():
            return
        checkout = package.parents[1]
        self._folder = TemporaryDirectory()
        archive = Path(self._folder.name, "vectors.zip")
        pack(checkout / "vectors", archive)
        added = {archive: "vectors.zip", **{checkout / source: place for source, place in BESIDE.items()}}
        build_data["force_include"].update({str(source): f"{KIT}/{place}" for source, place in added.items()})

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the archive that was packed."""
        if hasattr(self, "_folder"):
            self._folder.cleanup()


def pack(vectors: Path, path: Path) -> None:
    """Write an archive of the vectors, plain: the wheel compresses all files together, and better."""
    with zipfile.ZipFile(path, "w") as archive:
        for source in sorted(source for source in vectors.rglob("*") if source.is_file()):
            name = zipfile.ZipInfo(source.relative_to(vectors).as_posix(), OLDEST)
            archive.writestr(name, source.read_bytes())
