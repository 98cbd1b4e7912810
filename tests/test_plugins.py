"""What other packages add: named sources of video, and commands."""

import re
import subprocess
import sys
from fractions import Fraction
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import gsvc_ref
from gsvc_base.errors import UsageError
from gsvc_ref import cli, plugins
from gsvc_ref.metrics import compare_frames
from gsvc_ref.plugins import NamedSource
from gsvc_ref.video import open_video, open_writer
from gsvc_ref.video.format import ColorDescription, VideoFormat
from gsvc_ref.video.stream import VideoReader

WITHOUT = """
import importlib.metadata, sys
of_others = importlib.metadata.entry_points
importlib.metadata.entry_points = lambda **asked: () if asked else of_others()
from gsvc_ref.cli import main
code = main({words!r})
print({"gsvc_tools", "gsvc_lab"} & set(sys.modules))
sys.exit(code)
"""


class GreyReader(VideoReader):
    """Grey frames; their number is the name after the colon."""

    def __init__(self, name):
        super().__init__()
        self.count = int(name.partition(":")[2] or 1)
        color = ColorDescription(primaries=1, transfer=1, matrix=0, full_range=True, chroma_location=0)
        self.format = VideoFormat(4, 2, Fraction(24), 8, "rgb", color, frame_count=self.count)

    def _read(self):
        return iter([np.full((2, 4, 3), 128, np.uint8)] * self.count)


@pytest.fixture(autouse=True)
def loaded():
    """Load what is installed before a test adds to it."""
    plugins.commands()


@pytest.fixture
def grey(monkeypatch):
    """A source of grey frames among the others."""
    monkeypatch.setattr(plugins, "_sources", [*plugins._sources, NamedSource("grey:", ".grey", GreyReader)])


def without_plugins(*words):
    """What `gsvc` does where nothing else is installed."""
    command = [sys.executable, "-c", WITHOUT.replace("{words!r}", repr(list(words)))]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def test_a_source_is_opened_by_its_prefix(grey):
    with open_video("grey:3") as reader:
        assert [frame.shape for frame in reader] == [(2, 4, 3)] * 3


def test_a_source_is_opened_by_its_suffix(grey, tmp_path):
    (tmp_path / "one.GREY").write_text("what it holds is the reader's matter")
    with open_video(tmp_path / "one.GREY") as reader:
        assert len(list(reader)) == 1


def test_a_file_that_describes_a_source_must_exist(grey, tmp_path):
    with pytest.raises(FileNotFoundError, match="there is no file"):
        open_video(tmp_path / "none.grey")


def test_a_command_is_added(monkeypatch, capsys):
    module = ModuleType("hello")
    module.add_command = lambda commands: commands.add_parser("hello").set_defaults(
        run=lambda arguments: print("hello") or 0
    )
    monkeypatch.setitem(sys.modules, "hello", module)
    monkeypatch.setattr(plugins, "_commands", {**plugins._commands, "hello": "hello"})
    assert cli.main(["hello"]) == 0
    assert capsys.readouterr().out == "hello\n"


def test_the_laboratory_is_a_plugin():
    assert plugins.source_by_prefix("scene:pan") is not None
    assert plugins.source_by_suffix("clip.TOML") is not None
    assert len(plugins.commands()) >= 3


def test_the_codec_works_without_plugins(tmp_path):
    shown = without_plugins("--help")
    assert shown.returncode == 0
    assert "encode" in shown.stdout
    assert "scene" not in shown.stdout
    assert "concat" not in shown.stdout
    assert shown.stdout.endswith("set()\n")
    refused = without_plugins("encode", "scene:pan", str(tmp_path / "x.gsvc"))
    assert refused.returncode == 2
    assert "there is no file 'scene:pan'" in refused.stderr


def test_names_and_files_of_a_plugin_that_is_missing(monkeypatch, tmp_path):
    for name in ("_names", "_file_readers", "_targets", "_vmaf_meters"):
        monkeypatch.setattr(plugins, name, type(getattr(plugins, name))())
    monkeypatch.delitem(vars(gsvc_ref), "concat", raising=False)
    with pytest.raises(UsageError, match="needs gsvc_tools"):
        gsvc_ref.concat  # noqa: B018
    (tmp_path / "clip.mkv").write_bytes(b"\x1aE\xdf\xa3 and more")
    with pytest.raises(UsageError, match="other formats need gsvc_tools"):
        open_video(tmp_path / "clip.mkv")
    with pytest.raises(UsageError, match=r"ends in \.y4m, \.png, a folder"):
        open_writer(tmp_path / "copy.mp4", GreyReader("grey:1").format)
    compared = compare_frames(GreyReader("grey:1"), GreyReader("grey:1"), 255, with_vmaf=True)
    assert "VMAF needs gsvc_tools" in compared.vmaf.reason


@pytest.mark.parametrize("asked", [{"jobs": 2}, {"resume": "kept"}, {"settings": gsvc_ref.Settings.quick(size=1000)}])
def test_an_encode_that_needs_a_plugin_is_refused_without_it(monkeypatch, tmp_path, asked):
    monkeypatch.setattr(plugins, "_encoders", [])
    clip = np.zeros((1, 16, 16, 3), np.uint8)
    with pytest.raises(UsageError, match=r"jobs, an executor, resume and targets .* need gsvc_tools"):
        gsvc_ref.encode(clip, tmp_path / "x.gsvc", **asked)
    assert not [*tmp_path.iterdir()]


def test_the_command_encode_works_without_plugins(tmp_path):
    source, target = tmp_path / "a.y4m", tmp_path / "a.gsvc"
    source.write_bytes(b"YUV4MPEG2 W16 H16 F25:1 C420jpeg\nFRAME\n" + bytes(384))
    encoded = without_plugins("encode", str(source), str(target), "--splats", "2")
    assert encoded.returncode == 0, encoded.stderr
    assert [frame.shape for frame in gsvc_ref.decode(target)] == [(16, 16, 3)]
    assert "unknown argument --jobs" in without_plugins("encode", str(source), str(target), "--jobs", "2").stderr
    refused = without_plugins("encode", str(source), str(target), "--size", "900")
    assert refused.returncode == 2
    assert "need gsvc_tools" in refused.stderr


def test_all_that_gsvc_ref_asks_for_is_offered():
    stub = Path(gsvc_ref.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    asked = re.findall(r"^from (gsvc_tools\S*) import (\w+)", stub, re.MULTILINE)
    assert {name: module for module, name in asked} == plugins._names
    assert set(cli.ORDER) == {*cli.MODULES, *plugins.commands()} - {"report", "bench", "accuracy", "scene", "demo"}
    for name, module in plugins._names.items():
        assert getattr(gsvc_ref, name) is getattr(import_module(module), name)
