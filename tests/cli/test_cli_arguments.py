from argparse import ArgumentTypeError
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.cli.arguments import finite, frame_range, key_frames, positive, size, whole
from gsvc_base.errors import UsageError
from gsvc_ref.cli import build_parser, main
from gsvc_ref.cli.files import check_stream_name, default_output

numbers = st.integers(0, 10**9 - 1)


@given(numbers, st.one_of(st.none(), numbers))
def test_frame_range_is_half_open_and_never_empty(start, stop):
    text = f"{start}:{'' if stop is None else stop}"
    if stop is None or stop > start:
        assert frame_range(text) == (start, stop)
    else:
        with pytest.raises(ArgumentTypeError, match="holds no frame"):
            frame_range(text)


def test_frame_range_begins_at_zero_when_nothing_is_said():
    assert frame_range(":60") == (0, 60)
    assert frame_range(":") == (0, None)


@given(st.lists(numbers, min_size=2))
def test_key_frames_lists_numbers(listed):
    assert key_frames(",".join(map(str, listed))) == tuple(listed)


def test_key_frames_tells_a_period_from_a_list_of_one():
    assert key_frames("auto") == "auto"
    assert key_frames("12") == 12
    assert key_frames("12,") == (12,)


@pytest.mark.parametrize(
    ("convert", "text"),
    [
        (frame_range, "30"),
        (frame_range, "30-60"),
        (frame_range, "-1:2"),
        (frame_range, "٣:٦"),
        (key_frames, ""),
        (key_frames, "-3"),
        (key_frames, ",1"),
        (key_frames, "1,,2"),
        (finite, "nan"),
        (finite, "inf"),
        (finite, "high"),
        (positive, "0"),
        (positive, "-2"),
        (whole, "1.5"),
        (whole, ""),
        (whole, "9" * 30),
        (size, "192"),
        (size, "0x112"),
        (size, "192*112"),
    ],
)
def test_what_is_not_allowed_is_quoted(convert, text):
    with pytest.raises(ArgumentTypeError) as caught:
        convert(text)
    assert repr(text) in str(caught.value)


def test_numbers_and_sizes():
    assert finite("34.5") == 34.5
    assert positive("0.5") == 0.5
    assert whole("-7") == -7
    assert size("192x112") == (192, 112)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["encode", "a", "b", "--splat", "3"], "unknown argument --splat (did you mean --splats?)"),
        (["encode", "a", "b", "--prest=slow"], "unknown argument --prest=slow (did you mean --preset?)"),
        (["info", "a", "--salvge"], "unknown argument --salvge (did you mean --salvage?)"),
        (["encode", "a", "b", "--zzz"], "unknown argument --zzz; see gsvc encode --help"),
        (["encode", "a", "b", "splats"], "unknown argument splats; see gsvc encode --help"),
        (["encode", "a", "b", "--crf", "23"], "unknown argument --crf (did you mean --quality?)"),
        (["encode", "a", "--layers", "2"], "'2' is one PSNR, and makes no layers"),
        (["encode", "a", "b", "-o", "c"], "two names of the output: c and b"),
        (["enc", "a", "b"], "there is no command 'enc' (did you mean encode?); see gsvc --help"),
        (["convert", "a", "b"], "there is no command 'convert' (did you mean encode or decode?); see gsvc --help"),
        (["encod", "a", "b"], "there is no command 'encod' (did you mean encode?); see gsvc --help"),
        (["zzz"], "there is no command 'zzz'; see gsvc --help"),
        (["--versio"], "unknown argument --versio (did you mean --version?)"),
    ],
)
def test_a_slip_of_the_pen_is_understood(arguments, said, capsys):
    assert main(arguments) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["IN", "OUT", "--quality", "30"],
        ["IN", "--quality", "30", "OUT"],
        ["--quality", "30", "IN", "OUT"],
        ["IN", "-o", "OUT", "--quality", "30"],
        ["-o", "OUT", "--quality", "30", "IN"],
    ],
)
def test_options_may_stand_anywhere(words):
    arguments, unknown = build_parser("encode").parse_known_args(["encode", *words])
    assert not unknown
    assert (arguments.input, arguments.output, arguments.quality) == ("IN", "OUT", 30)


@pytest.mark.parametrize(
    ("source", "output"),
    [("clip.mp4", "clip.gsvc"), ("a.b/clip", "a.b/clip.gsvc"), ("folder", "folder.gsvc"), ("scene:pan", "pan.gsvc")],
)
def test_an_output_without_a_name_gets_that_of_the_input(source, output, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("a.b").mkdir()
    assert default_output(source) == output
    Path(output).touch()
    with pytest.raises(UsageError, match="exists already"):
        default_output(source)


def test_standard_input_gives_no_name():
    with pytest.raises(UsageError, match="there is no output"):
        default_output("-")


@pytest.mark.parametrize("name", ["a.mkv", "folder.gsvc/a.Y4M", "a.gsvc.png", "a.gif"])
def test_a_stream_under_the_name_of_another_format(name):
    with pytest.raises(UsageError, match="--force"):
        check_stream_name(name, force=False)
    check_stream_name(name, force=True)


@pytest.mark.parametrize("name", ["-", "a.gsvc", "a", "a.part", "a.2024", ".mkv", "/dev/null"])
def test_names_of_streams(name):
    check_stream_name(name, force=False)


@pytest.mark.parametrize("command", ["encode", "concat", "cut", "import"])
def test_commands_ask_before_they_write_under_another_name(command, tmp_path, capsys):
    source = tmp_path / "a.gsvc"
    source.write_bytes(b"x")
    target = tmp_path / "a.mp4"
    options = {"concat": ["-o", str(target)], "cut": [str(target), "--layer", "0"]}.get(command, [str(target)])
    assert main([command, str(source), *options]) == 2
    assert "name it a.gsvc" in capsys.readouterr().err
    assert not target.exists()
