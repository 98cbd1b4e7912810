"""Roots of other processors' Linux, run by qemu-user: nothing is installed into the host, nothing is left behind.

Packages come from the host's own Debian sources, unpacked without their scripts, wheels from PyPI; both are kept in a
folder. A command runs in a user namespace of its own (Linux 6.7 or later), in which the kernel hands the other
processor's programs to qemu.
"""

import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Final

REPOSITORY: Final = Path(__file__).parents[2]
SOURCES: Final = Path("/etc/apt/sources.list.d/debian.sources")
MIN_KERNEL: Final = (6, 7)
"""Whose binfmt_misc belongs to a user namespace."""

RUN: Final = r"""
mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc
printf '%s' ":other:M::$MAGIC:$MASK:$QEMU:F" > /proc/sys/fs/binfmt_misc/register
mount -t proc proc "$ROOT/proc"
mount --rbind /dev "$ROOT/dev"
mount --bind "$REPOSITORY" "$ROOT/repository"
exec chroot "$ROOT" /usr/bin/env -i PATH=/usr/bin:/bin HOME=/tmp LANG=C.UTF-8 \
    PYTHONPATH=/repository:/repository/conformance:/site PYTHONDONTWRITEBYTECODE=1 $SETTINGS \
    sh -c 'cd /repository && exec "$@"' sh "$@"
"""
"""In the namespaces: qemu for programs of the other processor, then the command in its root."""


PHOTOGRAPHS: Final = """
from pathlib import Path
import numpy, PIL.Image
def __getattr__(name):
    return lambda: numpy.asarray(PIL.Image.open(Path(__file__).with_name(name + ".png")))
"""
"""A package skimage.data in few words."""


class CannotRunError(Exception):
    """Why a machine cannot run here, and what to do."""


@dataclass(frozen=True)
class Processor:
    """A kind of processor.

    Attributes
    ----------
    name, debian
        As the kernel and Debian call it.
    magic
        How its programs begin: ELF class, byte order and machine.
    packages
        Of Debian, with all that they need.
    wheels
        Of PyPI, where they exist for it; none where Debian has the packages.
    settings
        Environment variables of its commands.
    """

    name: str
    debian: str
    magic: str
    packages: tuple[str, ...]
    wheels: tuple[str, ...]
    settings: tuple[str, ...]

    @property
    def mask(self) -> str:
        """Which bits of the magic count: all but the OS ABI, and EXEC as DYN."""
        big = self.magic[20:24] == r"\x02"
        end = r"\xff\xfe\xff\xff" if big else r"\xfe\xff\xff\xff"
        return r"\xff" * 7 + r"\x00" + r"\xff" * 8 + end


WHEELS: Final = ("numpy", "numba", "scipy", "scikit-image", "pillow", "jsonschema>=4.21", "hypothesis>=6.100")
SYSTEM: Final = ("dash", "coreutils", "libgomp1", "libstdc++6", "libgcc-s1")

AARCH64: Final = Processor(
    "aarch64", "arm64", r"\x7f\x45\x4c\x46\x02\x01\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x02\x00\xb7\x00",
    (*SYSTEM, "python3"), WHEELS, ("NUMBA_CACHE_DIR=/kernels",),
)  # fmt: skip
S390X: Final = Processor(
    "s390x", "s390x", r"\x7f\x45\x4c\x46\x02\x02\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x02\x00\x16",
    (*SYSTEM, "python3", "python3-numpy", "python3-numba", "python3-pil", "python3-jsonschema", "python3-scipy"), (),
    # Alternatives of BLAS are links that the packages' scripts would make.
    ("NUMBA_CACHE_DIR=/kernels", "LD_LIBRARY_PATH=/usr/lib/s390x-linux-gnu/blas:/usr/lib/s390x-linux-gnu/lapack"),
)  # fmt: skip


PREPARING = Lock()
"""Held while the emulators, which processors share, are downloaded: two are prepared at a time."""


class Emulator:
    """A processor's root in a folder; made at the first use, and used again as long as it is there."""

    def __init__(self, processor: Processor, folder: Path) -> None:
        self.processor, self.folder = processor, folder
        self.root = folder / processor.name
        self.qemu = folder / f"usr/bin/qemu-{processor.name}-static"

    def prepare(self) -> None:
        """Download and unpack what is not there yet.

        Raises
        ------
        CannotRunError
            The kernel or the system does not allow it.
        """
        self._check()
        self.folder.mkdir(parents=True, exist_ok=True)
        with PREPARING:
            if not self.qemu.exists():
                self._qemu()
        if not (self.root / "ready").exists():
            shutil.rmtree(self.root, ignore_errors=True)
            for name in ("site", "proc", "dev", "tmp", "repository", "kernels"):
                (self.root / name).mkdir(parents=True)
            for package in self._packages():
                run(["dpkg-deb", "-x", str(package), str(self.root)], self.folder)
            for wheel in self._wheels():
                zipfile.ZipFile(wheel).extractall(self.root / "site")
            if not self.processor.wheels:
                self._photographs()
            (self.root / "ready").touch()

    def _qemu(self) -> None:
        """Download the emulators of all processors; they stand in their place only when they are whole."""
        partial = self.folder / "partial"
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir()
        run(["apt-get", "download", "qemu-user-static"], partial)
        for package in partial.glob("qemu-user-static_*.deb"):
            run(["dpkg-deb", "-x", str(package), "."], partial)
        shutil.rmtree(self.folder / "usr", ignore_errors=True)
        (partial / "usr").rename(self.folder / "usr")

    def command(self, words: Sequence[str], settings: Sequence[str] = ()) -> tuple[list[str], dict[str, str]]:
        """A command of the host that runs words in the root, the current folder being the repository, and its
        environment.
        """
        namespaces = ["unshare", "--user", "--map-root-user", "--mount", "--pid", "--fork", "--kill-child"]
        environment = {
            **os.environ, "MAGIC": self.processor.magic, "MASK": self.processor.mask, "QEMU": str(self.qemu),
            "ROOT": str(self.root), "REPOSITORY": str(REPOSITORY),
            "SETTINGS": " ".join([*self.processor.settings, *settings]),
        }  # fmt: skip
        return [*namespaces, "sh", "-ec", RUN, "sh", *words], environment

    def _check(self) -> None:
        release = tuple(map(int, re.findall(r"\d+", os.uname().release)[:2]))
        missing = [name for name in ("unshare", "apt-get", "dpkg-deb", "chroot") if shutil.which(name) is None]
        if sys.platform != "linux" or release < MIN_KERNEL:
            reason = f"Linux {os.uname().release}; binfmt_misc in a user namespace needs 6.7"
        elif missing:
            reason = f"there is no {', no '.join(missing)}: use Debian or a container of it"
        elif not SOURCES.exists():
            reason = f"there is no {SOURCES}, which names the packages' sources"
        elif subprocess.run(["unshare", "--user", "--map-root-user", "true"], capture_output=True).returncode:
            reason = (
                "user namespaces are not allowed: sysctl user.max_user_namespaces, kernel.unprivileged_userns_clone"
            )
        else:
            return
        raise CannotRunError(f"{self.processor.name} cannot be emulated here: {reason}")

    def _packages(self) -> list[Path]:
        """Debian's packages of the processor, downloaded by an apt whose state is in the folder."""
        state = self.folder / f"apt-{self.processor.name}"
        for name in ("state/lists/partial", "cache/archives/partial"):
            (state / name).mkdir(parents=True, exist_ok=True)
        (state / "status").touch()
        settings = state / "apt.conf"
        settings.write_text(
            f'APT::Architecture "{self.processor.debian}"; APT::Architectures {{ "{self.processor.debian}"; }};\n'
            f'Dir::State "{state}/state"; Dir::State::status "{state}/status"; Dir::Cache "{state}/cache";\n'
            f'Dir::Etc::sourcelist "{SOURCES}"; Dir::Etc::sourceparts "-";\n'
            'APT::Install-Recommends "false"; APT::Sandbox::User "root"; Acquire::Languages "none";\n'
        )
        environment = {**os.environ, "APT_CONFIG": str(settings)}
        run(["apt-get", "update", "--quiet=2"], state, environment)
        install = ["apt-get", "install", "--quiet=2", "--yes", "--download-only"]
        run([*install, *self.processor.packages], state, environment)
        return sorted((state / "cache/archives").glob("*.deb"))

    def _photographs(self) -> None:
        """The picture files of this machine's scikit-image; Debian's package of it would bring a hundred others."""
        import skimage.data

        data = self.root / "site/skimage/data"
        data.mkdir(parents=True)
        (data.parent / "__init__.py").touch()
        (data / "__init__.py").write_text(PHOTOGRAPHS)
        for name in ("astronaut", "chelsea", "coffee"):
            shutil.copy(Path(skimage.data.__file__).with_name(f"{name}.png"), data)

    def _wheels(self) -> list[Path]:
        """PyPI's wheels for the root's Python."""
        if not self.processor.wheels:
            return []
        folder = self.folder / f"wheels-{self.processor.name}"
        python = next((self.root / "usr/bin").glob("python3.[0-9]*")).name.removeprefix("python").replace(".", "")
        platforms = [f"--platform=manylinux_2_{glibc}_{self.processor.name}" for glibc in (17, 24, 26, 27, 28, 31, 34)]
        run(
            [
                sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", f"--dest={folder}",
                *platforms, f"--platform=manylinux2014_{self.processor.name}", "--only-binary=:all:",
                "--implementation=cp", f"--python-version={python}", *self.processor.wheels,
            ],
            self.folder,
        )  # fmt: skip
        return sorted(folder.glob("*.whl"))


def run(command: Sequence[str], folder: Path, environment: dict[str, str] | None = None) -> None:
    """Run a command in a folder; raises CannotRunError with what it said if it fails."""
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise CannotRunError(f"{' '.join(command[:3])} ... failed: {(done.stderr or done.stdout).strip()[-800:]}")
