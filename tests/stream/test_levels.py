"""A decoder that claims a level refuses what is above it, before anything else of the header (R-5-6)."""

from pathlib import Path

import pytest

import gsvc_ref
from gsvc_base.errors import GsvcError, UsageError
from gsvc_conformance.spec import namespace
from gsvc_ref.bitstream import LEVELS, SequenceHeader
from gsvc_ref.cli import main
from gsvc_ref.paper import FrameCodes
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import Lie, write_stream


def stream(level: int, *lies: Lie) -> bytes:
    header = SequenceHeader(level=level, width=16, height=8)
    return write_stream(header, [FrameCodes.intra_frame(None)], lies=lies)


@pytest.mark.parametrize("max_level", LEVELS)
@pytest.mark.parametrize("level", LEVELS)
def test_levels_up_to_the_highest_are_read(level: int, max_level: int) -> None:
    data = stream(level)
    if level <= max_level:
        assert len(list(StreamReader(data, max_level=max_level))) == 1
        assert len(list(gsvc_ref.decode(data, max_level=max_level))) == 1
        namespace()["open_stream"](data, max_level=max_level)
        return
    for read in (
        lambda: StreamReader(data, max_level=max_level),
        lambda: gsvc_ref.open(data, max_level=max_level),
        lambda: next(gsvc_ref.decode(data, max_level=max_level)),
    ):
        with pytest.raises(GsvcError, match=f"of level {level}.* level {max_level} at most") as caught:
            read()
        assert (caught.value.kind, caught.value.rule) == ("unsupported", "R-5-6")
    with pytest.raises(namespace()["Fault"], match=f"^unsupported R-5-6 {caught.value.bit}$"):
        namespace()["open_stream"](data, max_level=max_level)


@pytest.mark.parametrize(
    ("lie", "rule"),
    [
        (Lie("profile", 2), "R-3.2-1"),
        (Lie("level", 6), "R-3.2-1"),
        (Lie("flags", 128), "R-5-6"),
        (Lie("width", 0), "R-5-6"),
    ],
)
def test_the_level_is_refused_in_its_order(lie: Lie, rule: str) -> None:
    data = stream(3, lie)
    with pytest.raises(GsvcError) as caught:
        StreamReader(data, max_level=2)
    assert caught.value.rule == rule
    with pytest.raises(namespace()["Fault"], match=f"{rule} {caught.value.bit}$"):
        namespace()["open_stream"](data, max_level=2)


def test_there_is_no_such_level() -> None:
    for level in (0, 6):
        with pytest.raises(UsageError, match=r"max_level is \d; it must be 1 to 5"):
            gsvc_ref.open(stream(1), max_level=level)


def test_the_commands_refuse_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "level3.gsvc"
    path.write_bytes(stream(3))
    for command in (["info", str(path)], ["decode", str(path), str(tmp_path / "out")]):
        assert main([*command, "--max-level", "2"]) == 1
        err = capsys.readouterr().err
        assert "the stream is of level 3" in err
        assert "a greater --max-level reads it" in err
        assert main([*command, "--max-level", "3"]) == 0
        capsys.readouterr()
    assert main(["info", str(path), "--max-level", "6"]) == 2
    assert "--max-level" in capsys.readouterr().err
