"""Cutting: some frames of a stream as a stream of their own, which begins with an I-frame."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_concatenation import OVERVIEW, joined, part_lists, types

import gsvc_ref
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.cli import main
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import OVERVIEW_HEADER, Lie, join_chunks, overview_frames, split_chunks, write_stream

NINE = joined(OVERVIEW, OVERVIEW, OVERVIEW)
"""Nine frames: I P R, three times."""


def kept(stream, start=0, stop=None) -> bytes:
    out = io.BytesIO()
    report = gsvc_ref.cut(stream, out, start=start, stop=stop)
    assert report.file_bytes == len(out.getvalue())
    assert report.frame_count == StreamReader(out.getvalue()).frame_count
    return out.getvalue()


@given(part_lists(), st.data())
@settings(max_examples=15)
def test_it_undoes_joining(parts, data):
    """From the beginning of any part of a joined stream to any frame: what that stream has there."""
    whole = joined(*parts)
    counts = [len(gsvc_ref.reconstruct_stream(part).counts) for part in parts]
    first = data.draw(st.integers(0, len(parts) - 1))
    start = sum(counts[:first])
    stop = data.draw(st.one_of(st.none(), st.integers(start + 1, sum(counts) + 2)))
    all_frames, some = gsvc_ref.reconstruct_stream(whole), gsvc_ref.reconstruct_stream(kept(whole, start, stop))
    assert some.error == ""
    assert some.counts.tolist() == all_frames.counts.tolist()[start:stop]
    before = sum(all_frames.counts[:start])
    assert np.array_equal(some.parameters, all_frames.parameters[before : before + sum(some.counts)], equal_nan=True)


def test_the_part_that_was_joined_comes_back():
    assert kept(NINE, 3, 6) == OVERVIEW
    assert kept(NINE) == NINE
    assert kept(NINE, 0, 100) == NINE
    assert types(kept(NINE, 6, 7)) == "HIxE"


@pytest.mark.parametrize(
    ("start", "stop", "said"),
    [
        (4, None, "frame 4 of part 1 is a P-frame, which needs those before it; begin with an I-frame: 3 or 6"),
        (8, None, "frame 8 of part 1 is a R-frame, which needs those before it; begin with an I-frame: 6"),
        (9, None, "part 1 has 9 frames, 0 to 8; there is no frame 9"),
        (3, 3, "start is 3 and stop is 3"),
        (-1, None, "start is -1"),
    ],
)
def test_frames_that_cannot_be_cut_out(start, stop, said):
    with pytest.raises(UsageError) as error:
        kept(NINE, start, stop)
    assert str(error.value).startswith(said)


def test_an_unknown_count_stays_unknown():
    live = write_stream(OVERVIEW_HEADER, overview_frames(), lies=[Lie("frame_count", 0)])
    cut = kept(joined(live, OVERVIEW), 3, 5)
    assert StreamReader(cut).header.frame_count == 0
    assert StreamReader(cut).frame_count == 2
    assert StreamReader(kept(NINE, 3, 5)).header.frame_count == 2


def test_paced_where_seconds_begin_anew():
    """R-5-7 counts seconds from frame 0, so they are the same if the first frame was that of a second."""
    for rate, paced in ((3, True), (4, False)):
        header = replace(OVERVIEW_HEADER, paced_flag=True, frame_rate_numerator=rate, frame_rate_denominator=1)
        cut = kept(write_stream(header, overview_frames() * 3), 3)
        assert StreamReader(cut).header.paced_flag == paced
        assert gsvc_ref.reconstruct_stream(cut).error == ""


def test_chunks_of_frames_that_are_dropped_go_with_them():
    """Of the whole stream and safe to copy: `q`; of a frame and safe: `s`; not safe: `p`, and the log `d`."""
    chunks = split_chunks(NINE)
    around = [(b"q", bytes(1)), (b"s", bytes(2)), (b"p", bytes(3)), (b"d", bytes(4))]
    many = [chunks[0], *[chunk for frame in chunks[1:10] for chunk in (frame, *around)]]
    out = io.BytesIO()
    whole = join_chunks([*many, (b"E", chunks[-1][1][:4] + bytes(4))], prefix=NINE[:PREFIX_SIZE])
    report = gsvc_ref.cut(whole, out, start=3, stop=6)
    assert types(out.getvalue()) == "Hqqq" + "IqsPqsRqs" + "xE"
    assert report.left_out == {"d": 6, "p": 6}


def test_what_comes_behind_the_frames_is_not_looked_at():
    damaged = NINE[:-40]
    assert kept(damaged, 3, 6) == OVERVIEW
    with pytest.raises(GsvcError, match="part 1: "):
        kept(damaged, 6)


def test_command(tmp_path, capsys):
    path, out = tmp_path / "nine.gsvc", tmp_path / "three.gsvc"
    path.write_bytes(NINE)
    assert main(["cut", str(path), str(out), "--frames", "3:6"]) == 0
    assert capsys.readouterr().out == f"{out}: {len(OVERVIEW):,} bytes, 3 frames, those from 3 to 5\n"
    assert out.read_bytes() == OVERVIEW
    assert main(["cut", str(path), str(out), "--frames", "6:", "--layer", "0", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["first_frame"], report["frame_count"]) == (6, 3)
    assert main(["cut", str(path), str(out), "--frames", "4:"]) == 2
    assert "is a P-frame" in capsys.readouterr().err
    assert out.read_bytes() == OVERVIEW  # what stood there still does
    assert main(["cut", str(path), str(out)]) == 2
    assert "say what stays: --frames A:B" in capsys.readouterr().err
