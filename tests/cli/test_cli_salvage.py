"""Cut and damaged streams on the command line: what is written, what is said to be missing, and exit code 1."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import gsvc_ref
from gsvc_ref.cli import main
from gsvc_ref.cli.damage import MAX_GAPS, Gaps
from gsvc_ref.stream import DecodedFrame, Gap, StreamReader
from gsvc_ref.testing import (
    OVERVIEW_HEADER,
    RICH_HEADER,
    Lie,
    overview_frames,
    rich_frames,
    write_stream,
)
from gsvc_ref.video import open_video

CODES = [*rich_frames(), *rich_frames()]  # I P R I P I P R I P
GOOD = write_stream(RICH_HEADER, CODES)
FRAMES = list(StreamReader(GOOD))
PICTURES = list(gsvc_ref.decode(GOOD))


@pytest.fixture
def save(tmp_path):
    """Write a stream to a file."""

    def write(data: bytes) -> Path:
        path = tmp_path / "in.gsvc"
        path.write_bytes(data)
        return path

    return write


@pytest.fixture
def gsvc(capsys):
    """Run a command: its exit code and the lines on standard output and standard error."""

    def run(*arguments):
        capsys.readouterr()
        status = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return status, captured.out.splitlines(), captured.err.splitlines()

    return run


def damaged(*numbers: int, data: bytes = GOOD) -> bytes:
    """`GOOD` with a wrong bit in some frames."""
    changed = bytearray(data)
    for number in numbers:
        changed[FRAMES[number].offset + 6] ^= 1
    return bytes(changed)


def pictures(folder: Path) -> dict[int, np.ndarray]:
    """The pictures of a folder by the numbers in their names."""
    found = {}
    for path in sorted(folder.iterdir()):
        with open_video(path) as reader:
            found[int(path.stem.removeprefix("frame_"))] = next(iter(reader))
    return found


def assert_are_those_of(found: dict[int, np.ndarray], numbers, first: int = 0) -> None:
    assert [number + first for number in found] == list(numbers)
    assert all(np.array_equal(picture, PICTURES[number + first]) for number, picture in found.items())


def test_every_truncation_through_the_commands(save, tmp_path, gsvc):
    """All complete frames, which ones are missing, exit code 1; with --salvage the same frames."""
    data = write_stream(replace(OVERVIEW_HEADER, chroma_format=0), overview_frames())
    frames: list[DecodedFrame] = list(StreamReader(data))
    expected = list(gsvc_ref.decode(data))
    for size in range(len(data)):
        complete = sum(frame.offset + frame.size <= size for frame in frames)
        path = save(data[:size])
        for options in ([], ["--salvage"]) if size % 4 == 0 else ([],):
            folder = tmp_path / f"frames{size}{len(options)}"
            status, _, errors = gsvc("decode", path, folder, *options, "--quiet")
            assert status == 1
            assert folder.exists() == (complete > 0)
            if size < frames[0].offset:
                assert len(errors) == 1
                assert ("nothing can be salvaged" in errors[0]) == bool(options and size)
                continue
            told = " ".join(errors)
            if complete:
                found = pictures(folder)
                assert all(np.array_equal(found[n], expected[n]) for n in range(complete))
                assert len(found) == complete
            else:
                assert "nothing was written" in told
            if options:
                assert f"{3 - complete} of 3 frames" in told or complete == 3
            else:
                place = f"after {complete} of 3 frames" if complete else "in the first frame"
                assert f"cut off, or still being written, {place}" in told
            if complete == 2:
                assert "frame 2" in told


def test_what_plain_decoding_says_of_damage(save, tmp_path, gsvc):
    path, folder = save(damaged(4)), tmp_path / "frames"
    status, out, (fault, consequence) = gsvc("decode", path, folder)
    assert status == 1
    assert out == []
    assert fault.startswith(
        f"gsvc decode: {path} is damaged after 4 of 10 frames: malformed: the checksum of a chunk P"
    )
    assert "[R-6.2-2, byte " in fault
    assert consequence == (
        f"gsvc decode: {folder} holds the 4 complete frames before the fault; missing: frames 4 to 9. "
        "Fetch the file again if you can; --salvage finds more frames after the damage"
    )
    assert_are_those_of(pictures(folder), range(4))


def test_salvage_is_not_praised_where_it_finds_nothing(save, tmp_path, gsvc):
    for data in (damaged(8), damaged(9)):
        _, _, errors = gsvc("decode", save(data), tmp_path / f"frames{hash(data)}")
        assert errors[-1].endswith("Fetch the file again if you can")


def test_a_cut_file_may_still_grow(save, tmp_path, gsvc):
    _, _, errors = gsvc("decode", save(GOOD[: FRAMES[4].offset + 3]), tmp_path / "frames")
    assert errors[-1].endswith(
        "missing: frames 4 to 9. If it is still being written, try again later; otherwise fetch it again"
    )


def test_nothing_is_advised_where_nothing_is_missing(save, tmp_path, gsvc):
    path, folder = save(GOOD + b"more"), tmp_path / "frames"
    status, _, (fault, consequence) = gsvc("decode", path, folder)
    assert status == 1
    assert fault.startswith(f"gsvc decode: {path} is sound up to its end chunk: invalid: something follows")
    assert consequence.endswith("holds the 10 complete frames before the fault; no frame is missing")
    _, _, errors = gsvc("decode", save(GOOD[: FRAMES[9].offset + FRAMES[9].size]), tmp_path / "cut")
    assert errors[1].endswith("; no frame is missing")


def test_damage_in_the_first_frames(save, tmp_path, gsvc):
    path = save(damaged(0))
    _, _, errors = gsvc("decode", path, tmp_path / "frames")
    assert f"{path} is damaged in the first frame: " in errors[0]
    assert "nothing was written; missing: frames 0 to 9. " in errors[1]
    _, _, errors = gsvc("decode", save(damaged(1)), tmp_path / "frames", "--frames", "2:4")
    assert "is damaged before the end of frame 2: " in errors[0]
    assert "nothing was written; missing: frames 2 to 3. " in errors[1]


def test_a_wrong_length_is_no_cut(save, gsvc):
    """A length that reaches beyond the end looks like a cut, but the end chunk is there."""
    place = FRAMES[1].offset + 2
    whole = GOOD[:place] + b"\x7f" + GOOD[place + 1 :]
    for data in (whole, whole[: FRAMES[9].offset]):  # the other one is cut as well
        status, _, errors = gsvc("info", save(data))
        assert status == 1
        assert "is damaged after 1 of 10 frames: malformed: the stream ends inside `payload`" in errors[0]
        assert "--salvage finds more frames" in errors[1]


def test_salvage_writes_every_frame_that_is_left_under_its_number(save, tmp_path, gsvc):
    path, folder = save(damaged(4, 6)), tmp_path / "frames"
    status, out, errors = gsvc("decode", "--salvage", path, folder)
    assert status == 1
    assert out == [f"{folder}: 7 frames of 40x30, 25 frames/s, 8 bits"]
    first, second, summary = errors
    assert first.startswith("gsvc decode: frame 4 is missing: the checksum of a chunk P is wrong")
    assert first.endswith("bytes 1,279 to 1,292 skipped")
    assert second.startswith("gsvc decode: frames 6 to 7 are missing, 7 because predicted from missing ones: the check")
    assert summary == f"gsvc decode: {path} is damaged: 3 of 10 frames are missing; {folder} holds 7 frames"
    assert_are_those_of(pictures(folder), [0, 1, 2, 3, 5, 8, 9])


def test_quiet_does_not_hide_gaps(save, tmp_path, gsvc):
    status, out, errors = gsvc("decode", "--salvage", "--quiet", save(damaged(4)), tmp_path / "frames")
    assert (status, out, len(errors)) == (1, [], 2)


def test_videos_become_shorter(save, tmp_path, gsvc):
    output = tmp_path / "out.y4m"
    status, _, errors = gsvc("decode", "--salvage", save(damaged(0, 6)), output, "--chroma", "444")
    assert status == 1
    assert errors[2] == (
        f"gsvc decode: frames after a gap move up: frame 0 of {output} is frame 3 of the video; "
        "a folder of PNG files keeps the numbers"
    )
    with open_video(output) as reader:
        assert len(list(reader)) == 5
    _, _, errors = gsvc("decode", "--salvage", save(damaged(6)), output, "--frames", "5:9", "--chroma", "444")
    assert f"frame 1 of {output} is frame 8 of the video" in errors[1]
    _, _, errors = gsvc("decode", "--salvage", save(damaged(8)), output, "--chroma", "444")  # nothing follows the gap
    assert len(errors) == 2


@pytest.mark.parametrize("index", [True, False])
def test_a_range_of_a_damaged_file(save, tmp_path, gsvc, index):
    data = damaged(1, 6, data=write_stream(RICH_HEADER, CODES, index=index))
    path = save(data)
    status, _, errors = gsvc("decode", path, tmp_path / "plain", "--frames", "3:6")
    assert (status, errors) == (0, [])
    assert_are_those_of(pictures(tmp_path / "plain"), [3, 4, 5], 3)
    status, _, errors = gsvc("decode", "--salvage", path, tmp_path / "sound", "--frames", "3:6")
    assert (status, errors) == (0, [])
    status, out, errors = gsvc("decode", "--salvage", path, tmp_path / "frames", "--frames", "2:7")
    assert status == 1
    assert out[1:] == ["  note: names count from frame 2"]
    assert [line.split(":")[1] for line in errors[:2]] == [
        " frame 2 is missing, because predicted from missing ones",
        " frame 6 is missing",
    ]
    assert "2 of 5 frames are missing" in errors[2]
    assert_are_those_of(pictures(tmp_path / "frames"), [3, 4, 5], 2)
    status, _, errors = gsvc("decode", "--salvage", path, tmp_path / "gone", "--frames", "1:3")
    assert status == 1
    assert errors[-1].endswith("2 of 2 frames are missing; nothing was written")
    assert not (tmp_path / "gone").exists()
    status, _, errors = gsvc("decode", "--salvage", path, tmp_path / "none", "--frames", "10:12")
    assert (status, len(errors)) == (2, 1)


def test_a_sound_stream_is_no_failure(save, tmp_path, gsvc):
    status, _, errors = gsvc("decode", "--salvage", save(GOOD), tmp_path / "frames")
    assert (status, errors) == (0, [])
    status, _, errors = gsvc("info", "--salvage", save(GOOD))
    assert (status, errors) == (0, [])


def test_damage_that_loses_no_frame_is_told_too(save, tmp_path, gsvc):
    status, _, errors = gsvc("decode", "--salvage", save(GOOD + b"more"), tmp_path / "frames")
    assert status == 1
    assert errors[0].startswith("gsvc decode: no frame is missing, but something follows the end chunk")
    assert "no frame is missing; " in errors[1]


def test_another_stream_behind_a_cut_is_pointed_out(save, tmp_path, gsvc):
    cut = FRAMES[4].offset + 5
    status, _, errors = gsvc("decode", "--salvage", save(GOOD[:cut] + GOOD), tmp_path / "frames")
    assert status == 1
    assert errors[1].startswith("gsvc decode:   inside: invalid: a second sequence header follows")
    assert "6 of 10 frames are missing" in errors[2]


def test_a_stream_that_does_not_tell_its_length(save, tmp_path, gsvc):
    data = write_stream(RICH_HEADER, CODES, lies=[Lie("frame_count", 0)])
    path = save(damaged(1, data=data)[: FRAMES[4].offset])
    status, _, errors = gsvc("decode", path, tmp_path / "plain")
    assert "is damaged after 1 complete frame:" in errors[0]
    assert "missing: what follows frame 0." in errors[1]
    status, _, errors = gsvc("decode", "--salvage", path, tmp_path / "frames")
    assert status == 1
    assert "is damaged: 2 frames are missing, and any number may be missing at the end" in errors[-1]
    _, out, _ = gsvc("info", path)
    assert "number of frames left open" in " ".join(out)
    sound = save(data[: FRAMES[4].offset])
    status, _, errors = gsvc("decode", "--salvage", sound, tmp_path / "more")
    assert "is damaged: any number may be missing at the end, since" in errors[-1]


def test_info_shows_gaps_and_accounts_for_their_bits(save, gsvc):
    path = save(damaged(4, 6))
    status, out, errors = gsvc("info", "--salvage", path)
    assert status == 1
    assert out[0] == f"{path}: {len(GOOD):,} bytes, 7 complete frames"
    runs = "frame 0: I, frame 1: P, frame 2: R, frame 3: I, frame 5: I, frame 8: I, frame 9: P"
    assert f"4 I, 2 P, 1 R ({runs})" in " ".join(out)
    rows = {line.split()[0]: line.split()[1] for line in out if len(line.split()) == 3}
    assert rows["skipped"] == f"{8 * (FRAMES[4].size + FRAMES[6].size + FRAMES[7].size):,}"
    assert rows["total"] == f"{8 * len(GOOD):,}"
    assert out[-2].startswith("frame 4 is missing: ")
    assert out[-1].startswith("frames 6 to 7 are missing, 7 because predicted from missing ones: ")
    assert errors == [f"gsvc info: {path} is damaged: 3 of 10 frames are missing"]


def test_the_rate_of_a_damaged_file_is_that_of_its_frames(save, gsvc):
    _, out, _ = gsvc("info", save(damaged(3)))
    bits = 8 * sum(frame.size for frame in FRAMES[:3])
    (rate,) = [line for line in out if line.startswith("  rate ")]
    assert rate.split("  ")[-1] == f"{bits / (40 * 30 * 3):.4f} bits/pixel, {bits / 120:.1f} kbit/s, 0.12 s of " + (
        "the complete frames"
    )


def test_info_json_lists_the_gaps(save, gsvc):
    status, out, _ = gsvc("info", "--salvage", "--json", save(damaged(4, 6)))
    assert status == 1
    info = json.loads("\n".join(out))
    assert "error" not in info
    assert info["frame_count"] == 7
    assert sum(info["bits"].values()) == 8 * len(GOOD)
    assert [(gap["first_missing"], gap["missing_count"], gap["fault_count"]) for gap in info["gaps"]] == [
        (4, 1, 1),
        (6, 2, 1),
    ]
    assert [gap["predicted_from"] for gap in info["gaps"]] == [None, 7]
    assert info["gaps"][0]["faults"][0]["rule"] == "R-6.2-2"
    status, out, _ = gsvc("info", "--salvage", "--json", save(GOOD))
    assert (status, json.loads("\n".join(out))["gaps"]) == (0, [])


def test_a_damaged_header_leaves_nothing(save, tmp_path, gsvc):
    for place in (3, 30):
        data = bytearray(GOOD)
        data[place] ^= 1
        for command in (
            ["decode", "--salvage", save(bytes(data)), tmp_path / "frames"],
            ["info", "--salvage", save(data)],
        ):
            status, _, errors = gsvc(*command)
            assert (status, len(errors)) == (1, 1)
            assert "nothing can be salvaged without a sound beginning" in errors[0]


def test_a_pipe_cannot_be_salvaged(tmp_path, gsvc, monkeypatch, standard_input):
    import io
    import sys

    class Pipe(io.BytesIO):
        def seekable(self):
            return False

    for command in (["decode", "--salvage", "-", tmp_path / "frames"], ["info", "--salvage", "-"]):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(Pipe(GOOD)))
        status, _, errors = gsvc(*command)
        assert status == 2
        assert "save it to a file first" in errors[0]
    standard_input(damaged(4))  # a file behind standard input can be sought
    status, _, errors = gsvc("decode", "--salvage", "-", tmp_path / "frames")
    assert status == 1
    assert "standard input is damaged: 1 of 10 frames is missing" in errors[1]


def test_compare_with_a_damaged_stream_says_how_far_it_went(save, tmp_path, gsvc):
    good = tmp_path / "good.gsvc"
    good.write_bytes(GOOD)
    path = save(damaged(4))
    status, out, errors = gsvc("compare", good, path, "--no-vmaf", "--quiet")
    assert status == 1
    assert out[0] == "PSNR     identical: 4 frames equal in every sample"
    assert errors[0].startswith(f"gsvc compare: {path} is damaged after 4 of 10 frames: malformed: ")
    assert errors[0].endswith("only the frames before it could be compared")
    assert "note: the second video (damaged after frame 3) ends 6 frames before the other one" in " ".join(out)


def test_the_sum_counts_what_lies_in_the_range() -> None:
    gaps = Gaps()
    for gap in StreamReader(damaged(1, 6)).salvage(2, 7):
        if not isinstance(gap, DecodedFrame):
            gaps(gap)
    assert gaps.missing == 2
    assert gaps.total(3) == "2 of 5 frames are missing"


def test_of_very_many_gaps_the_first_are_listed():
    gaps = Gaps()
    gap = Gap((gsvc_ref.GsvcError("malformed", "why", rule="R-6.2-2", bit=0),), 1, 0, 9, 9, 0, 1)
    for _ in range(MAX_GAPS + 3):
        gaps(gap)
    assert len(gaps.lines()) == MAX_GAPS + 1
    assert gaps.lines()[-1] == "and 3 more gaps"
    assert gaps.total(1) == "1,003 of 1,004 frames are missing"


def test_a_scale_beyond_binary32_is_no_damage(save, gsvc, tmp_path):
    codes = overview_frames()[0]
    quantizer = replace(codes.intra.quantizer, scale=np.full(3, 5e36, np.float32))
    large = replace(codes, intra=replace(codes.intra, quantizer=quantizer))
    path = save(write_stream(OVERVIEW_HEADER, [codes, large, codes]))
    for folder, options in (("a", ()), ("b", ("--salvage",))):
        status, _, errors = gsvc("decode", path, tmp_path / folder, "--scale", 9, *options)
        assert status == 0
        assert not any("missing" in line or "cannot" in line for line in errors)
        assert len(list((tmp_path / folder).iterdir())) == 3


def test_a_header_that_announces_fewer_frames_than_there_are(save, tmp_path, gsvc):
    path = save(write_stream(OVERVIEW_HEADER, overview_frames(), lies=[Lie("frame_count", 2)]))
    status, _, errors = gsvc("decode", path, tmp_path / "frames", "--quiet")
    assert status == 1
    assert "damaged after 3 complete frames: " in " ".join(errors)
