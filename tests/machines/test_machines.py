"""This machine makes what is kept, and so what all others make; a machine that differs or cannot run is told."""

import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numba
import pytest

from tests.machines import __main__ as compare
from tests.machines import emulated
from tests.machines.digests import PARTS, PROMISED, SET, kept


@pytest.mark.parametrize("part", [part for part in PROMISED if part not in SET])
def test_this_machine_makes_what_is_kept(part):
    if part == "encode" and numba.config.DISABLE_JIT:
        pytest.skip("takes minutes without compiled kernels")
    assert PARTS[part]() == kept()[part], f"if that is meant: python -m tests.machines.digests --write {part}"


def test_every_part_has_a_digest():
    assert kept().keys() == PARTS.keys()


def lines_of(*made):
    return lambda *_: iter([{"part": part, "sha256": digest, "seconds": 1.5} for part, digest in made])


@pytest.fixture
def one(monkeypatch):
    """A machine that makes streams and decodes."""
    machine = compare.Machine("one", "a machine", ((("streams", "decode-fast"), ()),))
    monkeypatch.setattr(compare, "machines", lambda: [machine])
    monkeypatch.setattr("sys.argv", ["machines"])
    return machine


def test_equal_bytes_are_told(one, monkeypatch, capsys):
    made = [(part, kept()[part]) for part in ("streams", "decode-fast")]
    monkeypatch.setattr(compare, "lines", lines_of(*made))
    assert compare.main() == 0
    out = capsys.readouterr().out
    assert f"one: {kept()['streams']}  streams  1.5 s\n" in out
    assert out.count("same    1.5 s") == 2
    assert out.endswith("every machine has the same bytes\n")


@pytest.mark.parametrize(
    ("made", "told"),
    [
        ([("streams", "0" * 64), ("decode-fast", "1" * 64)], "DIFFERS"),
        ([("streams", kept()["streams"])], "NOT every machine"),
        ([("decode-fast", kept()["decode-fast"])], "NOT every machine"),
    ],
)
def test_other_bytes_and_missing_ones_fail(one, monkeypatch, capsys, made, told):
    monkeypatch.setattr(compare, "lines", lines_of(*made))
    assert compare.main() == 1
    assert told in capsys.readouterr().out


def test_other_precisions_are_looked_at_only(one, monkeypatch, capsys):
    monkeypatch.setattr(compare, "lines", lines_of(("streams", kept()["streams"]), ("decode-fast", "1" * 64)))
    assert compare.main() == 0
    assert "other    1.5 s" in capsys.readouterr().out


def test_a_command_that_fails_is_told():
    with pytest.raises(emulated.CannotRunError, match=r"ended with 7: no room"):
        list(compare.lines(["sh", "-c", "echo no room >&2; exit 7"], os.environ))
    with pytest.raises(emulated.CannotRunError, match=r"ended with 1: .*No module named"):
        list(compare.lines([sys.executable, "-m", "no_such_module"], os.environ))


@pytest.mark.parametrize(("release", "told"), [("6.1.0-13-amd64", "binfmt_misc in a user namespace needs 6.7")])
def test_an_old_kernel_is_told(one, monkeypatch, capsys, tmp_path, release, told):
    monkeypatch.setattr(os, "uname", lambda: SimpleNamespace(release=release))
    monkeypatch.setattr(compare, "CACHE", tmp_path)
    one.__dict__["processor"] = emulated.S390X
    assert compare.main() == 1
    assert f"one: NOT RUN: s390x cannot be emulated here: Linux {release}; {told}" in capsys.readouterr().out


def test_two_that_are_prepared_at_a_time_download_the_emulators_once(monkeypatch, tmp_path):
    downloads = []

    def run(command, folder, environment=None):
        assert command[:2] == ["apt-get", "download"], "nothing to unpack"
        downloads.append(command)
        time.sleep(0.05)  # the other one comes meanwhile
        for processor in (emulated.AARCH64, emulated.S390X):
            (folder / "usr/bin").mkdir(parents=True, exist_ok=True)
            (folder / f"usr/bin/qemu-{processor.name}-static").touch()

    monkeypatch.setattr(emulated, "run", run)
    some = [emulated.Emulator(processor, tmp_path) for processor in (emulated.AARCH64, emulated.S390X)]
    for emulator in some:
        monkeypatch.setattr(emulator, "_check", lambda: None)
        emulator.root.mkdir()
        (emulator.root / "ready").touch()
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(emulated.Emulator.prepare, some))
    assert len(downloads) == 1
    assert all(emulator.qemu.exists() for emulator in some)


def test_how_programs_of_other_processors_begin():
    """Little-endian ELF of machine 183, big-endian of 22; the OS ABI and EXEC or DYN do not count."""
    for processor, machine in ((emulated.AARCH64, 183), (emulated.S390X, 22)):
        magic, mask = (bytes.fromhex(text.replace(r"\x", "")) for text in (processor.magic, processor.mask))
        order = "big" if magic[5] == 2 else "little"
        assert magic[:5] == b"\x7fELF\x02"
        assert int.from_bytes(magic[18:20], order) == machine
        assert int.from_bytes(mask[16:18], order) == 0xFFFE
        assert (mask[7], mask[18:]) == (0, b"\xff\xff")
