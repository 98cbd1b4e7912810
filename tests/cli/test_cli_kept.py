"""What of a video is kept, and what is lost, is told by the commands, and kept it is."""

import json
from contextlib import closing
from pathlib import Path

import pytest

pytest.importorskip("av")

import av
from tools.video.odd_clips import write_clip

from gsvc_ref.cli import main

TIMES = [0, 40, 80, 200, 240, 500]


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    """A clip as a phone makes it: sound, turned, frames as they came."""
    path = tmp_path_factory.mktemp("phone") / "phone.mp4"
    write_clip(path, times=TIMES, sound=["aac"], rotation=-90)
    return path


@pytest.fixture(scope="module")
def encoded(source) -> Path:
    path = source.with_suffix(".gsvc")
    assert main(["encode", str(source), str(path), "--splats", "6", "--key-frames", "3", "--quiet"]) == 0
    return path


def shown(path):
    """The size of a file's pictures, their times in milliseconds, and its number of audio packets."""
    with closing(av.open(str(path))) as container:
        pictures = list(container.decode(video=0))
        start = pictures[0].pts
        times = [round(1000 * (picture.pts - start) * picture.time_base) for picture in pictures]
    with closing(av.open(str(path))) as container:
        packets = [packet for packet in container.demux(container.streams.audio) if packet.size]
    return (pictures[0].width, pictures[0].height), times, len(packets)


def test_everything_is_told_before_the_first_frame(source, tmp_path, capsys):
    assert main(["encode", str(source), str(tmp_path / "a.gsvc"), "--splats", "2", "--frames", ":1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    before = "\n".join(lines[: next(n for n, line in enumerate(lines) if line.startswith("settings:"))])
    assert "24x32" in before
    assert f"gsvc decode FILE.gsvc OUT.mp4 --audio-from {source}" in before
    assert "not evenly spaced in time" in before
    assert "rotated by 90 degrees clockwise" in before


def test_info_and_dump_tell_the_times(encoded, capsys):
    assert main(["info", str(encoded)]) == 0
    assert "times       frames are shown for 40 to 260 ms each" in capsys.readouterr().out
    assert main(["info", str(encoded), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["times_s"] == [time / 1000 for time in TIMES]
    assert main(["dump", str(encoded)]) == 0
    listed = capsys.readouterr().out
    assert listed.count("frame_ticks, chunk t") == 5
    assert "ticks_per_second, chunk t" in listed


def test_an_mp4_with_everything(encoded, source, tmp_path, capsys):
    path = tmp_path / "a.mp4"
    assert main(["decode", str(encoded), str(path), "--audio-from", str(source)]) == 0
    told = capsys.readouterr().out
    assert "lossy copy for viewing (8 bits, libx264)" in told
    assert f"has the sound of {source}, not encoded again (aac)" in told
    size, times, packets = shown(path)
    assert (size, times) == ((24, 32), TIMES)
    assert packets == pytest.approx(shown(source)[2], abs=2)


def test_a_part_with_its_sound(encoded, source, tmp_path):
    path = tmp_path / "a.mkv"
    assert main(["decode", str(encoded), str(path), "--audio-from", str(source), "--frames", "3:5", "--quiet"]) == 0
    _, times, packets = shown(path)
    assert times == [0, 40]
    assert 12 <= packets <= 15  # 0.3 of a second of 1024 samples each at 48 kHz


@pytest.mark.parametrize("output", ["a.y4m", "folder"])
def test_what_cannot_say_when_frames_are_shown(encoded, tmp_path, capsys, output):
    assert main(["decode", str(encoded), str(tmp_path / output)]) == 0
    assert "not evenly spaced in time, which the output cannot say" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("output", "sound", "said"),
    [
        ("a.gif", "phone.mp4", "a place for sound"),
        ("-", "phone.mp4", "a place for sound"),
        ("folder", "phone.mp4", "a place for sound"),
        ("a.mp4", "nothing.mp4", "there is no file"),
        ("a.mp4", "a.mp4", "there is no file"),
        ("a.mp4", "-", "--audio-from takes a file"),
    ],
)
def test_sound_that_cannot_be_had(encoded, source, tmp_path, capsys, output, sound, said, standard_input):
    standard_input(b"")
    found = {"phone.mp4": str(source), "-": "-"}.get(sound, str(tmp_path / sound))
    target = output if output == "-" else str(tmp_path / output)
    assert main(["decode", str(encoded), target, "--audio-from", found]) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_sound_is_not_written_over_its_source(encoded, tmp_path, source, capsys):
    copy = tmp_path / "copy.mp4"
    copy.write_bytes(source.read_bytes())
    assert main(["decode", str(encoded), str(copy), "--audio-from", str(copy)]) == 2
    assert "is the input itself" in capsys.readouterr().err
    assert copy.read_bytes() == source.read_bytes()


def test_a_stream_cut_to_its_base_keeps_its_times(encoded, tmp_path, capsys):
    assert main(["cut", str(encoded), str(tmp_path / "a.gsvc"), "--layer", "0", "--quiet"]) == 0
    assert main(["info", str(tmp_path / "a.gsvc"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["times_s"] == [time / 1000 for time in TIMES]
