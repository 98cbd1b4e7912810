"""What the commands do when all is well, and with damaged streams."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import QUICK, write_clip
from test_cli_progress import Terminal

import gsvc_ref
import gsvc_ref.video
from gsvc_base.cli import progress
from gsvc_ref.cli import main
from gsvc_ref.video import ColorDescription, encode_png, open_video
from gsvc_ref.video.y4m import Y4mReader


def read(path):
    with open_video(path) as reader:
        return list(reader)


def strict_json(text):
    def refuse(constant):
        raise AssertionError(f"{constant} is not strict JSON")

    return json.loads(text, parse_constant=refuse)


def lossless(tmp_path, stream, *options):
    """The frames that ``gsvc decode`` writes as PNG files."""
    folder = tmp_path / "frames"
    assert main(["decode", str(stream), str(folder), "--quiet", *options]) == 0
    return read(folder)


def test_encode_says_what_it_does_and_what_came_out(clip, tmp_path, capsys):
    path = tmp_path / "out.gsvc"
    assert main(["encode", str(clip), str(path), *QUICK[:-1]]) == 0
    out, err = capsys.readouterr()
    first, second, *rest = out.splitlines()
    assert first == f"{clip}: 32x24, 4 frames, 24 frames/s, 8 bits, 4:2:0, BT.709, limited range"
    assert second == (
        "settings: profile main, preset quick, about 12 splats a frame, I-frames every 2 frames, effects auto, seed 0"
    )
    assert f"{path.stat().st_size:,} bytes" in rest[0]
    assert f"({path.stat().st_size / clip.stat().st_size:.2g} times its source)" in rest[0]
    assert "4 frames: 2 I, 2 P" in rest[1]
    assert "times real time" in rest[2]
    assert rest[-1] == f"  next: gsvc view {path} {clip}"
    assert err == ""


def test_encode_of_a_range_names_where_the_source_begins(clip, tmp_path, capsys):
    path = tmp_path / "out.gsvc"
    assert main(["encode", str(clip), str(path), *QUICK[:-1], "--frames", "2:4"]) == 0
    *_, last = capsys.readouterr().out.splitlines()
    assert last == f"  next: gsvc view {path} {clip} --source-from 2"


def test_a_file_that_is_larger_than_its_source_is_noted(tmp_path, capsys):
    folder = tmp_path / "picture"
    folder.mkdir()
    source = folder / "0.png"
    source.write_bytes(encode_png(np.zeros((8, 8, 3), np.uint8)))
    assert main(["encode", str(source), str(tmp_path / "out.gsvc"), "--splats", "9", "--key-frames", "1"]) == 0
    assert "larger than its source" in capsys.readouterr().out


def test_encode_states_assumptions(tmp_path, capsys):
    source = tmp_path / "plain.y4m"
    source.write_bytes(b"YUV4MPEG2 W4 H4 F25:1 C444\nFRAME\n" + bytes(48))
    assert main(["encode", str(source), str(tmp_path / "out.gsvc"), "--splats", "1"]) == 0
    assert "  note: colour not stated" in capsys.readouterr().out


def test_encode_json_is_all_there_is(clip, tmp_path, capsys):
    path = tmp_path / "out.gsvc"
    assert main(["encode", str(clip), str(path), *QUICK[:-1], "--json"]) == 0
    report = strict_json(capsys.readouterr().out)
    assert report["file_bytes"] == path.stat().st_size
    assert [frame["type"] for frame in report["frames"]] == ["I", "P", "I", "P"]
    assert report["format"]["frame_rate"] == {"numerator": 24, "denominator": 1}
    assert report["settings"]["preset"] == "quick"
    assert report["interrupted"] is False


OF_PAPER = [
    *("--profile", "paper"), *("--iterations", "2"), *("--cholesky-bits", "5"), *("--color-stages", "2"),
    *("--color-codewords", "4"),
]  # fmt: skip


@pytest.mark.parametrize("of_profile", [[], OF_PAPER], ids=["main", "paper"])
def test_encode_options_reach_the_stream(clip, tmp_path, of_profile):
    path = tmp_path / "out.gsvc"
    options = ["--splats", "6", "--key-frames", "0,1", "--frames", "1:4", "--checksums", "--quiet"]
    options += ["--lanes", "3", "--no-index", "--paced", *of_profile]
    assert main(["encode", str(clip), str(path), *options, "--seed", "3", "--threads", "1"]) == 0
    with gsvc_ref.open(path) as stream:
        info = stream.info()
    header = info.header
    assert [frame.type for frame in info.frames] == ["I", "I", "P"]
    assert (header.lane_count, header.max_lane_exponent) == ((3, 0) if of_profile else (1, 1))
    assert header.parameter_checksum_flag
    assert header.paced_flag
    assert info.bits["index"] == 0
    if of_profile:
        assert (header.cholesky_bits, header.color_stages, header.color_codewords) == (5, 2, 4)
        assert max(frame.splats for frame in info.frames) <= 6
    else:
        assert header.profile == 1
        assert max(frame.splats for frame in info.frames) <= 12


def test_low_latency_and_psnr_are_accepted(clip, tmp_path, capsys):
    path = tmp_path / "out.gsvc"
    options = ["--splats", "20", "--psnr", "10", "--low-latency", "--frames", ":2"]
    assert main(["encode", str(clip), str(path), *options]) == 0
    out = capsys.readouterr().out
    assert "at least 10 dB with at most about 20 splats a frame, I-frames found from the past alone" in out


def test_pipes_carry_nothing_but_data(clip, stream, tmp_path, capfdbinary, monkeypatch, standard_input):
    standard_input(clip.read_bytes())
    assert main(["encode", "-", "-", *QUICK[:-1]]) == 0
    captured = capfdbinary.readouterr()
    assert captured.err.startswith(b"standard input: 32x24")
    standard_input(captured.out)
    assert main(["decode", "-", "-", "--chroma", "444"]) == 0
    piped = capfdbinary.readouterr()
    assert b"standard output: 4 frames of 32x24" in piped.err
    (tmp_path / "piped.y4m").write_bytes(piped.out)
    assert main(["decode", str(stream), str(tmp_path / "direct.y4m"), "--chroma", "444", "--quiet"]) == 0
    np.testing.assert_array_equal(read(tmp_path / "piped.y4m"), read(tmp_path / "direct.y4m"))


def test_decode_writes_what_the_api_yields(stream, tmp_path):
    np.testing.assert_array_equal(lossless(tmp_path, stream), list(gsvc_ref.decode(stream)))


@pytest.mark.parametrize("span", ["1:3", "3:", ":1", "2:99"])
def test_decode_a_range_of_frames(stream, tmp_path, span):
    start, stop = (int(text) if text else None for text in span.split(":"))
    expected = list(gsvc_ref.decode(stream))[start:stop]
    np.testing.assert_array_equal(lossless(tmp_path, stream, "--frames", span), expected)


def test_decode_at_another_size_and_precision(stream, tmp_path):
    frames = lossless(tmp_path, stream, "--scale", "1.5", "--precision", "exact", "--threads", "1")
    np.testing.assert_array_equal(frames, list(gsvc_ref.decode(stream, scale=1.5, precision="exact")))
    assert frames[0].shape == (36, 48, 3)


@pytest.mark.parametrize("chroma", ["rgb", "420", "422", "444"])
def test_decode_to_another_chroma_format(stream, tmp_path, chroma, capsys):
    path = tmp_path / "out.y4m"
    assert main(["decode", str(stream), str(path), "--chroma", chroma]) == 0
    with Y4mReader(path, "out") as reader:
        assert reader.format.chroma_format == ("444" if chroma == "rgb" else chroma)
    assert ("note: y4m holds no R'G'B'" in capsys.readouterr().out) == (chroma == "rgb")


def test_pictures_become_planes_when_asked(tmp_path, clip):
    folder, path, out = tmp_path / "pictures", tmp_path / "p.gsvc", tmp_path / "out.y4m"
    with open_video(clip) as reader:
        frame = next(iter(reader))
    folder.mkdir()
    (folder / "1.png").write_bytes(encode_png(frame, 8, ColorDescription(2, 2, 0, True, 0)))
    assert main(["encode", str(folder), str(path), *QUICK]) == 0
    assert main(["decode", str(path), str(out), "--chroma", "420", "--quiet"]) == 0
    with Y4mReader(out, "out") as reader:
        assert (reader.format.chroma_format, reader.format.color.matrix) == ("420", 6)


def test_info_for_people(stream, capsys):
    assert main(["info", str(stream), "--frames-table"]) == 0
    out = capsys.readouterr().out
    size = stream.stat().st_size
    assert out.startswith(f"{stream}: {size:,} bytes, 4 complete frames\n")
    assert "2 I, 2 P (frame 0: I, frame 1: P, frame 2: I, frame 3: P)" in out
    assert ["total", f"{8 * size:,}", "100.0%"] in [line.split() for line in out.splitlines()]
    with gsvc_ref.open(stream) as reader:
        splats = [len(frame.splats) for frame in reader]
    assert out.splitlines()[-1].split()[:3] == ["3", "P", str(splats[3])]


def test_info_json_accounts_for_every_bit(stream, capsys):
    assert main(["info", str(stream), "--json"]) == 0
    info = strict_json(capsys.readouterr().out)
    assert info["file_bytes"] == stream.stat().st_size
    assert sum(info["bits"].values()) == 8 * info["file_bytes"]
    assert info["time_base"] == {"numerator": 1, "denominator": 24}
    assert info["header"]["width"] == 32
    assert [frame["number"] for frame in info["frames"]] == [0, 1, 2, 3]
    assert all(sum(frame["bits"].values()) == 8 * frame["size"] for frame in info["frames"])
    assert "error" not in info


def test_info_reads_a_pipe(stream, capsys, standard_input):
    standard_input(stream.read_bytes())
    assert main(["info", "-"]) == 0
    assert capsys.readouterr().out.startswith("standard input: ")


def boundaries(stream):
    """Where each frame's chunk ends."""
    with gsvc_ref.open(stream) as opened:
        return [frame.offset + frame.size for frame in opened]


@pytest.mark.parametrize("complete", [0, 1, 3])
@pytest.mark.parametrize("extra", [0, 1])
def test_decode_keeps_the_complete_frames_of_a_cut_stream(stream, tmp_path, capsys, complete, extra):
    cut = tmp_path / "cut.gsvc"
    with gsvc_ref.open(stream) as opened:
        first = next(iter(opened)).offset
    cut.write_bytes(stream.read_bytes()[: [first, *boundaries(stream)][complete] + extra])
    folder = tmp_path / "frames"
    assert main(["decode", str(cut), str(folder), "--quiet"]) == 1  # as it may be the first that compiles kernels
    fault, consequence = capsys.readouterr().err.splitlines()
    place = f"after {complete} of 4 frames" if complete else "in the first frame"
    assert fault.startswith(f"gsvc decode: {cut} is cut off, or still being written, {place}: ")
    if complete:
        assert f"{folder} holds the {complete} complete frame" in consequence
        np.testing.assert_array_equal(read(folder), list(gsvc_ref.decode(stream, stop=complete)))
        assert f"missing: frames {complete} to 3" in consequence or (complete == 3 and "frame 3" in consequence)
    else:
        assert "nothing was written" in consequence
        assert not folder.exists()


def test_info_tells_of_damage(stream, tmp_path, capsys):
    cut = tmp_path / "cut.gsvc"
    cut.write_bytes(stream.read_bytes()[: boundaries(stream)[1] + 5])
    assert main(["info", str(cut)]) == 1
    out, err = capsys.readouterr()
    assert "2 complete frames" in out
    assert "is cut off, or still being written, after 2 of 4 frames: malformed:" in err
    assert main(["info", str(cut), "--json"]) == 1
    info = strict_json(capsys.readouterr().out)
    assert len(info["frames"]) == 2
    assert info["bits"]["unread"] == 40
    assert sum(info["bits"].values()) == 8 * cut.stat().st_size
    assert set(info["error"]) == {"kind", "message", "rule", "bit"}
    assert (info["error"]["kind"], info["error"]["rule"]) == ("malformed", "R-6.2-4")


@pytest.mark.parametrize(
    ("size", "told"),
    [
        (0, "is empty; if it is still being written, try again later"),
        (5, "if it is still being written, try again later; otherwise fetch it again"),
        (30, "if it is still being written, try again later; otherwise fetch it again"),
    ],
)
def test_the_beginning_of_a_stream_may_still_grow(stream, tmp_path, capsys, size, told):
    short = tmp_path / "short.gsvc"
    short.write_bytes(stream.read_bytes()[:size])
    for command in (["info"], ["decode"]):
        assert main([*command, str(short), *([str(tmp_path / "out")] if command == ["decode"] else [])]) == 1
        err = capsys.readouterr().err
        assert f"{told} [R-6." in err
        assert "encode it first" not in err


def test_info_json_of_another_file_is_still_json(clip, capsys):
    assert main(["info", str(clip), "--json"]) == 1
    assert strict_json(capsys.readouterr().out)["error"]["rule"] == "R-6.1-1"


def test_compare_prints_each_frame_and_the_means(clip, stream, capsys):
    assert main(["compare", str(clip), str(stream), "--no-vmaf"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"A  {clip}: 32x24")
    assert lines[3].split() == ["frame", "PSNR", "MS-SSIM"]
    assert [line.split()[0] for line in lines[4:8]] == ["0", "1", "2", "3"]
    assert "mean of 4 frames" in lines[9]


def test_compare_json_agrees_with_the_encoder(clip, stream, tmp_path, capsys):
    again = tmp_path / "again.gsvc"
    assert main(["encode", str(clip), str(again), *QUICK[:-1], "--json"]) == 0
    encoded = strict_json(capsys.readouterr().out)
    assert again.read_bytes() == stream.read_bytes()
    assert main(["compare", str(clip), str(stream), "--no-vmaf", "--json"]) == 0
    compared = strict_json(capsys.readouterr().out)
    assert [frame["psnr"] for frame in compared["frames"]] == [frame["psnr"] for frame in encoded["frames"]]
    assert compared["errors"] == []


def test_compare_shows_identical_frames_as_such(clip, capsys):
    assert main(["compare", str(clip), str(clip), "--no-vmaf", "--quiet"]) == 0
    assert capsys.readouterr().out.startswith("PSNR     identical: 4 frames equal in every sample\n")


def test_compare_numbers_frames_as_the_videos_do(clip, stream, capsys):
    assert main(["compare", str(clip), str(stream), "--no-vmaf", "--json", "--frames", "1:3"]) == 0
    assert [frame["number"] for frame in strict_json(capsys.readouterr().out)["frames"]] == [1, 2]


def test_compare_says_why_there_is_no_vmaf(clip, capsys):
    assert main(["compare", str(clip), str(clip)]) == 0  # too small for VMAF, whatever is installed
    out = capsys.readouterr().out
    assert "VMAF     none: VMAF needs" in out
    assert out.count("VMAF needs") == 1


def test_compare_goes_as_far_as_a_damaged_stream(clip, stream, tmp_path, capsys):
    cut = tmp_path / "cut.gsvc"
    cut.write_bytes(stream.read_bytes()[: boundaries(stream)[1] + 5])
    assert main(["compare", str(clip), str(cut), "--no-vmaf"]) == 1
    out, err = capsys.readouterr()
    assert "mean of 2 frames" in out
    assert f"{cut} is cut off, or still being written, after 2 of 4 frames" in err
    assert "only the frames before it could be compared" in err


def test_compare_of_a_stream_without_a_frame(clip, stream, tmp_path, capsys):
    cut = tmp_path / "cut.gsvc"
    with gsvc_ref.open(stream) as opened:
        cut.write_bytes(stream.read_bytes()[: next(iter(opened)).offset])
    assert main(["compare", str(clip), str(cut), "--no-vmaf"]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert "in the first frame" in err


def interrupting(frames_before):
    """Stands in for open_video: a source during whose reading Ctrl-C is pressed."""

    class Interrupted(Y4mReader):
        def _read(self):
            for number, frame in enumerate(super()._read()):
                if number == frames_before:
                    raise KeyboardInterrupt
                yield frame

    return lambda source: Interrupted(source, source)


def test_an_interrupted_encode_keeps_its_frames(clip, stream, tmp_path, capsys, monkeypatch):
    path = tmp_path / "out.gsvc"
    monkeypatch.setattr(gsvc_ref.video, "open_video", lambda source, **options: interrupting(3)(Path(source)))
    assert main(["encode", str(clip), str(path), *QUICK]) == 130
    assert f"interrupted; {path} is a valid file with the 3 frames done so far" in capsys.readouterr().err
    monkeypatch.undo()
    np.testing.assert_array_equal(list(gsvc_ref.decode(path)), list(gsvc_ref.decode(stream, stop=3)))


def test_an_encode_interrupted_too_early_leaves_nothing(clip, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(gsvc_ref.video, "open_video", lambda source, **options: interrupting(0)(Path(source)))
    assert main(["encode", str(clip), str(tmp_path / "out.gsvc"), *QUICK]) == 130
    assert "nothing was saved" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_decode_leaves_nothing(stream, tmp_path, capsys, monkeypatch):
    def interrupted(*arguments, **options):
        yield next(decode(*arguments, **options))
        raise KeyboardInterrupt

    decode = gsvc_ref.decode
    monkeypatch.setattr(gsvc_ref, "decode", interrupted)
    assert main(["decode", str(stream), str(tmp_path / "out.y4m")]) == 130
    assert "nothing was saved" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_terminal_is_no_place_for_a_stream(clip, stream, capsys, monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert main(["encode", str(clip), "-"]) == 2
    assert main(["decode", str(stream), "-"]) == 2
    assert capsys.readouterr().err.count("is a terminal") == 2
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    assert main(["info", "-"]) == 2
    assert "is a terminal" in capsys.readouterr().err


def test_progress_tells_frame_iteration_and_quality(clip, tmp_path, monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(progress, "DELAY_S", 0.0)
    monkeypatch.setattr(progress, "INTERVAL_S", 0.0)
    monkeypatch.setenv("TERM", "dumb")
    assert main(["encode", str(clip), str(tmp_path / "out.gsvc"), *QUICK[:-1], "--json"]) == 0
    shown = terminal.getvalue()
    assert "frame 1/4  encoding 1/" in shown
    assert "frame 4/4  encoding" in shown
    assert " dB" in shown
    assert " left" in shown


def test_no_command_prints_the_help(capsys):
    assert main([]) == 2
    assert "gsvc demo" in capsys.readouterr().err


@pytest.fixture(scope="module")
def wide(tmp_path_factory):
    return write_clip(tmp_path_factory.mktemp("wide") / "wide.y4m", frames=2, chroma_format="422")


def test_other_chroma_formats_go_through(wide, tmp_path):
    path, decoded = tmp_path / "wide.gsvc", tmp_path / "wide.y4m"
    assert main(["encode", str(wide), str(path), *QUICK]) == 0
    assert main(["decode", str(path), str(decoded), "--quiet"]) == 0
    with Y4mReader(decoded, "decoded") as reader:
        assert reader.format.chroma_format == "422"
