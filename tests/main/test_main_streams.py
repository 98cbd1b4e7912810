"""Streams of profile `main`: written, read, and read by the code of spec.md."""

import re
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings

import gsvc_ref
from gsvc_base.errors import UsageError
from gsvc_ref import spec
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.coder import MAIN_CATEGORIES, Element
from gsvc_ref.bitstream.header import MAIN, header_elements
from gsvc_ref.stream import StreamReader, StreamWriter
from gsvc_ref.stream.profiles import profile_of
from gsvc_ref.testing import OVERVIEW_HEADER, main_streams, overview_frames, write_stream
from gsvc_ref.testing.random_streams import Stream
from gsvc_tools.listing import list_elements, place_of
from tests.main.material import HEADER, both, codes_of, stream_of

ROOM = Path(gsvc_ref.__file__).parent / "main"
SMALL = {"max_frames": 4, "max_count": 20, "max_pixels": 4096}


def test_a_module_that_reads_passes_has_a_plain_form_by_its_name() -> None:
    """main/fast/X.py reads what `code_X` in main writes and makes; lanes.py has what all are made of."""
    plain = {name for path in ROOM.glob("*.py") for name in re.findall(r"def code_(\w+)", path.read_text("utf-8"))}
    reading = {path.stem for path in (ROOM / "fast").glob("[!_]*.py")} - {"lanes"}
    assert len(reading) == 3
    assert reading <= plain


@given(main_streams(**SMALL))
def test_what_is_written_is_read(stream: Stream) -> None:
    with StreamReader(stream.data) as reader:
        frames = list(reader)
    assert reader.header == stream.header
    assert [frame.codes for frame in frames] == list(stream.frames)
    assert [frame.splats for frame in frames] == stream.splats
    for frame in frames:
        assert sum(frame.bits.values()) == 8 * frame.size
        assert set(frame.bits) <= set(MAIN_CATEGORIES)
        assert frame.codes.type == frame.type
        assert frame.codes.survivor_count + frame.codes.intra_count == len(frame.splats) or frame.type == "R"


@settings(max_examples=20)
@given(main_streams(**SMALL))
def test_the_code_of_the_document_reads_the_same(stream: Stream) -> None:
    ours, theirs = both(stream.data)
    assert ours == theirs
    assert ours[2] == ""
    listed, expected = gsvc_ref.read_main_stream(stream.data), spec.read_main_stream(stream.data)
    for name, values in expected.items():
        assert np.array_equal(getattr(listed, name), values), name
        assert getattr(listed, name).dtype == values.dtype, name


def test_origins_tell_which_splat_goes_on() -> None:
    codes = codes_of("IP")[1]
    origins = codes.origins
    stay = np.flatnonzero(codes.modes != 8)
    assert origins.tolist() == [*stay.tolist(), *[-1] * len(codes.new)]
    assert codes_of("IR")[0].origins is codes_of("IR")[1].origins is None


def test_elements_of_the_header() -> None:
    names = [name for name, *_ in (*spec.HEADER, *spec.MAIN_HEADER)]
    assert list(header_elements(MAIN)) == names
    header = SequenceHeader(profile=MAIN, level=1, width=3, height=2, layer_count=4)
    of_quality = [f"quality_{name}[{quality}]" for quality in range(4) for name in ("level", "halvings")]
    assert list(header.elements) == names + of_quality
    assert header == SequenceHeader(**header.arguments)
    with pytest.raises(UsageError, match="`cholesky_bits` is not an element of profile main"):
        SequenceHeader(profile=MAIN, level=1, width=3, height=2, cholesky_bits=5)
    with pytest.raises(UsageError, match="`layer_count` is not an element of profile paper"):
        SequenceHeader(level=1, width=3, height=2, layer_count=2)
    with pytest.raises(UsageError, match=r"R-3\.2-1"):
        SequenceHeader(profile=MAIN, level=1, width=3, height=2, layer_count=5)


def test_codes_of_the_other_profile_are_refused() -> None:
    for header, codes in ((HEADER, overview_frames()[0]), (OVERVIEW_HEADER, codes_of("I")[0])):
        with pytest.raises(UsageError, match="the codes are of another profile"):
            StreamWriter(BytesIO(), header).write_frame(codes)
    with pytest.raises(UsageError, match="read_main_stream"):
        gsvc_ref.read_stream(stream_of("IP"))
    with pytest.raises(UsageError, match="read_stream"):
        gsvc_ref.read_main_stream(write_stream(OVERVIEW_HEADER, overview_frames()))


def test_every_bit_is_accounted_for() -> None:
    data = stream_of("IPRPPIP", count=30)
    with StreamReader(data) as reader:
        summary = reader.summary()
    assert list(summary.bits) == [*MAIN_CATEGORIES, "unread"]
    assert sum(summary.bits.values()) == 8 * len(data)
    assert all(summary.bits[part] > 0 for part in MAIN_CATEGORIES if part != "ancillary"), summary.bits
    target = BytesIO()
    writer = StreamWriter(target, HEADER)
    for codes in codes_of("IPRPPIP", count=30):
        writer.write_frame(codes)
    written = writer.finish()
    assert {**written, "unread": 0} == summary.bits


def test_every_element_is_listed() -> None:
    data = stream_of("IPR")
    entries: list[object] = []
    assert list_elements(data, entries.append) == (None, None)
    end = 0
    for entry in entries:
        assert entry.bit == end, entry.full_name
        end += entry.bits
    assert end == 8 * len(data)
    names = {entry.full_name for entry in entries}
    assert {"quantizer, frame 0", "scale_code of luma, frame 0", "splat_number, frame 1"} <= names
    state = next(entry for entry in entries if entry.name == "lane_state")
    assert place_of(data, state.bit + 5).entry.full_name == "lane_state[0], frame 0"


def test_elements_of_a_trace_are_those_of_the_document() -> None:
    found: list[Element] = []
    with StreamReader(stream_of("IP"), trace=found.append) as reader:
        list(reader)
    head = ["lane_exponent", "motion_cell", "quantizer_present", "new_present", "quantizer", "splat_number"]
    assert [element.name for element in found if element.name in head] == [*head, *head]


def test_the_level_counts_splats_that_a_frame_removes() -> None:
    """R-5-2 is about the splats before with the new ones, also where `finish` looks for the least level."""
    writer = StreamWriter(BytesIO(), HEADER)
    first, second = codes_of("IP", count=60)
    writer.write_frame(first)
    frame = profile_of(HEADER).prepare(Writer, HEADER, writer.state, second, None)
    assert frame.splats == len(writer.state.splats) + second.intra_count
    assert frame.splats > len(frame.state.splats)
