"""Concatenation: the frames of the parts one after the other, and nothing that would not be true of the whole."""

import gc
import io
import os
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gsvc_ref
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.bitstream.chunks import MAGIC, PREFIX_SIZE, VERSION_MAJOR
from gsvc_ref.paper import State, reconstruct
from gsvc_ref.stream import StreamReader
from gsvc_ref.stream.chunk_decoder import ChunkDecoder
from gsvc_ref.stream.source import Source
from gsvc_ref.testing import (
    OVERVIEW_HEADER,
    RICH_HEADER,
    Lie,
    frames,
    headers,
    join_chunks,
    overview_frames,
    rich_frames,
    split_chunks,
    write_stream,
)
from gsvc_tools.editing import concat
from gsvc_tools.editing.copying import CopiedStream, Opening, _Index, sound_chunks

OVERVIEW = write_stream(OVERVIEW_HEADER, overview_frames())
RICH = write_stream(RICH_HEADER, rich_frames())
VERSION = bytes([VERSION_MAJOR, 0])


def joined(*parts) -> bytes:
    out = io.BytesIO()
    concat(parts, out)
    return out.getvalue()


def types(stream) -> str:
    return "".join(letter.decode() for letter, _ in split_chunks(stream))


@st.composite
def part_lists(draw):
    """Streams with equal headers but for `level` and `frame_count`, of any minor version, with all kinds of chunks."""
    header = draw(headers(max_pixels=4096))
    later = draw(st.sampled_from((b"", b"\x00", b"later")))
    lies = [Lie("version_minor", 3), Lie("lane_count", bytes([header.lane_count]) + later)] if later else []
    parts = []
    for _ in range(draw(st.integers(1, 4))):
        state, codes = State.initial(header.width, header.height), []
        for number in range(draw(st.integers(1, 4))):
            codes.append(draw(frames(header, state, types="IPR" if number else "I", max_count=12)))
            state = reconstruct(codes[-1], state)
        ancillary = draw(
            st.dictionaries(
                st.integers(0, len(codes) - 1),
                st.tuples(st.sampled_from("dpqrs"), st.binary(min_size=16, max_size=40)),
                max_size=3,
            )
        )
        mine = replace(header, level=draw(st.integers(header.level, 5)))
        count = Lie("frame_count", draw(st.sampled_from((0, len(codes)))))
        index = draw(st.booleans())
        parts.append(write_stream(mine, codes, index=index, ancillary=ancillary, lies=[*lies, count]))
    return parts


@pytest.mark.exhaustive
@given(part_lists())
@settings(max_examples=40)
def test_the_result_is_the_parts_one_after_the_other(parts):
    result = joined(*parts)
    answer, answers = gsvc_ref.reconstruct_stream(result), [gsvc_ref.reconstruct_stream(part) for part in parts]
    assert answer.error == ""
    assert answer.counts.tolist() == [count for one in answers for count in one.counts]
    assert answer.parameters.tobytes() == b"".join(one.parameters.tobytes() for one in answers)
    opened = [StreamReader(part).header for part in parts]
    counts = [header.frame_count for header in opened]
    expected = {"level": max(header.level for header in opened), "frame_count": sum(counts) if all(counts) else 0}
    expected["paced_flag"] = False
    assert StreamReader(result).header == replace(opened[0], **expected)
    assert result[:PREFIX_SIZE] == parts[0][:PREFIX_SIZE]
    for number in range(len(answer.counts)):  # through the index, and by hopping where there is none
        frame = next(StreamReader(result).frames(number))
        assert frame.number == number
        assert frame.splats.to_array().tobytes() == answer.parameters[_rows(answer.counts, number)].tobytes()


def _rows(counts, number):
    first = int(np.sum(counts[:number]))
    return slice(first, first + int(counts[number]))


@given(part_lists())
@settings(max_examples=15)
def test_it_does_not_matter_in_which_steps_parts_are_joined(parts):
    at_once = joined(*parts)
    step = joined(parts[0])
    for part in parts[1:]:
        step = joined(step, part)
    assert step == at_once


@pytest.mark.parametrize(
    ("letter", "first", "inside", "other"),
    [
        ("d", "", "", ""),
        ("p", "", "", ""),
        ("q", "q", "q", "q"),
        ("r", "", "", ""),
        ("s", "s", "s", ""),
        ("x", "", "", ""),
    ],
)
def test_ancillary_chunks_stay_where_they_are_true(letter, first, inside, other):
    """By the bits of their type, and whether a frame stands before them: in the first part, inside, in another part."""
    chunks = split_chunks(write_stream(OVERVIEW_HEADER, overview_frames(), index=False))
    own = letter.encode(), b"\x00" if letter == "x" else b"own data"
    part = join_chunks([chunks[0], own, chunks[1], own, *chunks[2:]], prefix=MAGIC + VERSION)
    out = io.BytesIO()
    report = concat([part, part], out)
    assert types(out.getvalue()) == f"H{first}I{inside}PR{other}I{inside}PRxE"
    left_out = 4 - len(first + inside + other + inside)
    assert report.left_out == ({letter: left_out} if left_out and letter != "x" else {})
    assert all(data == own[1] for kind, data in split_chunks(out.getvalue()) if kind == own[0] and letter != "x")


@pytest.mark.exhaustive
@pytest.mark.parametrize("edge", [128, 16384])
def test_numbers_that_take_a_byte_more(edge):
    """The chunk grows by a byte at 128 frames and at 16,384; all but its number stays."""
    repeated = write_stream(OVERVIEW_HEADER, [overview_frames()[0], *overview_frames()[2:] * (edge - 2)])
    result = joined(repeated, OVERVIEW)
    chunks = [data for letter, data in split_chunks(result) if letter in (b"I", b"P", b"R")]
    assert len(chunks) == edge - 1 + 3
    old = [data for letter, data in split_chunks(OVERVIEW) if letter in (b"I", b"P", b"R")]
    encoded = {edge - 1: 1 if edge == 128 else 2, edge: 2 if edge == 128 else 3}
    assert len(chunks[edge - 1]) == len(old[0]) - 1 + encoded[edge - 1]
    assert len(chunks[edge]) == len(old[1]) - 1 + encoded[edge]
    assert chunks[edge][encoded[edge] :] == old[1][1:]
    answer = gsvc_ref.reconstruct_stream(result)
    assert answer.error == ""
    assert len(answer.counts) == edge + 2


def test_a_checksum_of_splats_stays_right():
    answer = gsvc_ref.reconstruct_stream(joined(RICH, RICH))
    assert answer.error == ""
    assert len(answer.counts) == 10


def test_one_part_is_itself():
    assert joined(OVERVIEW) == OVERVIEW
    assert joined(RICH) == RICH


@pytest.mark.parametrize(
    ("element", "value", "said"),
    [
        ("width", 17, "`width` is 16 in part 1 and 17 in part 2"),
        ("frame_rate_numerator", 50, "`frame_rate_numerator` is 25 in part 1 and 50 in part 2"),
        ("parameter_checksum_flag", True, "`parameter_checksum_flag` is False in part 1 and True in part 2"),
        ("bit_depth", 10, "`bit_depth` is 8 in part 1 and 10 in part 2"),
        ("color_primaries", 9, "`color_primaries` is 1 in part 1 and 9 in part 2"),
        ("lane_count", 2, "`lane_count` is 1 in part 1 and 2 in part 2"),
    ],
)
def test_headers_that_differ_are_refused(element, value, said):
    other = write_stream(replace(OVERVIEW_HEADER, **{element: value}), overview_frames())
    with pytest.raises(UsageError, match=r"R-6\.10-1") as caught:
        joined(OVERVIEW, other)
    assert said in str(caught.value)
    assert "encode one of them again" in str(caught.value)


def test_what_a_later_version_says_must_be_the_same():
    def of_minor(minor, later):
        lies = [Lie("version_minor", minor), Lie("lane_count", b"\x01" + later)]
        return write_stream(OVERVIEW_HEADER, overview_frames(), lies=lies)

    with pytest.raises(UsageError, match="`version_minor` is 0 in part 1 and 2 in part 2"):
        joined(OVERVIEW, of_minor(2, b""))
    with pytest.raises(UsageError, match="what follows `lane_count` is 07 in part 1 and 08 in part 2"):
        joined(of_minor(2, b"\x07"), of_minor(2, b"\x08"))
    result = joined(of_minor(2, b"\x07"), of_minor(2, b"\x07"))
    assert result[PREFIX_SIZE - 1] == 2
    assert split_chunks(result)[0][1].endswith(b"\x01\x07")


def test_levels_and_unknown_counts():
    high = write_stream(replace(OVERVIEW_HEADER, level=3), overview_frames())
    live = write_stream(OVERVIEW_HEADER, overview_frames(), lies=[Lie("frame_count", 0)])
    assert StreamReader(joined(OVERVIEW, high, OVERVIEW)).header.level == 3
    assert StreamReader(joined(OVERVIEW, high)).header.frame_count == 6
    unknown = joined(OVERVIEW, live)
    assert StreamReader(unknown).header.frame_count == 0
    assert StreamReader(unknown).frame_count == 6  # which the end chunk says


@pytest.mark.parametrize("paced", [(True, True), (True, False), (False, True)])
def test_the_result_is_not_paced(paced):
    """Each part keeps its seconds; those of the result would have frames of two."""
    parts = [write_stream(replace(OVERVIEW_HEADER, paced_flag=flag), overview_frames()) for flag in paced]
    assert [StreamReader(part).header.paced_flag for part in parts] == list(paced)
    result = joined(*parts)
    assert not StreamReader(result).header.paced_flag
    assert gsvc_ref.reconstruct_stream(result).error == ""


def test_more_frames_than_a_stream_may_have_are_refused_at_once():
    many = write_stream(OVERVIEW_HEADER, overview_frames(), lies=[Lie("frame_count", 2**31)])
    with pytest.raises(UsageError, match="together the parts have 4294967296 frames"):
        joined(many, many)


def with_payload(size, *, head=b"", before=()):
    """A stream of level 1 whose one frame has a payload of `size` bytes, which no decoder is asked to decode."""
    chunks = split_chunks(OVERVIEW)
    one = chunks[0][1][:19] + (1).to_bytes(4, "little") + chunks[0][1][23:]
    end = (1).to_bytes(4, "little") + bytes(4)
    frame = b"I", b"\x00" + head + bytes(size - 1 - len(head))
    return join_chunks([(b"H", one), *before, frame, (b"E", end)], prefix=MAGIC + VERSION)


def test_a_payload_that_grows_beyond_the_level_is_refused():
    full = with_payload(2**20)
    first = write_stream(OVERVIEW_HEADER, [overview_frames()[0], *overview_frames()[2:] * 127])
    assert len(joined(full, first)) > 2**20
    with pytest.raises(UsageError, match=r"frame 128, of part 2, .* 1048577 bytes .*level 1 allows 1048576 \(R-5-3\)"):
        joined(first, full)
    assert len(joined(first, with_payload(2**20 - 1))) > 2**20


FAULTS = [
    ("magic", lambda data: b"X" + data[1:], "malformed", "R-6.1-1"),
    ("version", lambda data: data[:8] + b"\xff" + data[9:], "unsupported", "R-6.1-2"),
    ("cut in a chunk", lambda data: data[:-3], "malformed", "R-6.2-4"),
    ("cut between chunks", lambda data: data[:-14], "malformed", "R-6.2-4"),
    ("something after the end", lambda data: data + b"\x00", "invalid", "R-6.1-4"),
    ("a byte of a frame", lambda data: data[:80] + bytes([data[80] ^ 1]) + data[81:], "malformed", "R-6.2-2"),
    ("a length", lambda data: data[:53] + b"\xff\xff\xff\x7f" + data[57:], "limit", "R-5-3"),
]
CHANGES = [
    ("an unknown critical chunk", lambda c: [*c[:2], (b"B", b"\x01"), *c[2:]], "unsupported", "R-3.2-1"),
    ("a second header", lambda c: [*c[:2], c[0], *c[2:]], "invalid", "R-6.1-3"),
    ("no frame", lambda c: [c[0], c[-1]], "invalid", "R-6.1-5"),
    ("no I-frame first", lambda c: [c[0], *c[2:]], "invalid", "R-6.4-2"),
    ("a frame that is missing", lambda c: [*c[:2], *c[3:]], "invalid", "R-6.4-1"),
    ("no number", lambda c: [c[0], (b"I", b""), *c[2:]], "malformed", "R-6.2-3"),
    ("a number in two bytes", lambda c: [c[0], (b"I", b"\x80\x00" + c[1][1][1:]), *c[2:]], "malformed", "R-3.1-1"),
    ("a wrong count", lambda c: [*c[:-1], (b"E", b"\x04" + c[-1][1][1:])], "invalid", "R-6.8-1"),
    ("a wrong index length", lambda c: [*c[:-1], (b"E", c[-1][1][:4] + b"\x05\0\0\0")], "invalid", "R-6.8-2"),
    ("a long end", lambda c: [*c[:-1], (b"E", c[-1][1] + b"\0")], "malformed", "R-6.2-3"),
    ("an index that runs ahead", lambda c: [*c[:2], (b"x", b"\x01\x00\xff\x7f"), *c[2:]], "invalid", "R-6.7-1"),
]


@pytest.mark.parametrize(
    ("damage", "kind", "rule"),
    [pytest.param(*fault[1:], id=fault[0]) for fault in FAULTS]
    + [
        pytest.param(
            lambda data, change=change: join_chunks(change(split_chunks(data)), prefix=data[:PREFIX_SIZE]),
            kind, rule, id=name,
        )
        for name, change, kind, rule in CHANGES
    ],
)  # fmt: skip
def test_a_damaged_part_is_refused_as_a_decoder_refuses_it(tmp_path, damage, kind, rule):
    sound, broken, out = (tmp_path / name for name in ("sound.gsvc", "broken.gsvc", "out.gsvc"))
    sound.write_bytes(OVERVIEW)
    broken.write_bytes(damage(write_stream(OVERVIEW_HEADER, overview_frames(), index=False)))
    out.write_bytes(b"an older file")
    with pytest.raises(GsvcError) as expected:
        list(StreamReader(broken.read_bytes()))
    for parts in ([sound, broken], [broken, sound]):
        with pytest.raises(GsvcError) as caught:
            concat(parts, out)
        assert (caught.value.kind, caught.value.rule, caught.value.bit) == (kind, rule, expected.value.bit)
        assert expected.value.rule == rule
        assert caught.value.message.startswith(f"{broken}: {expected.value.message}; ")
        assert "fetch it again, or leave it out" in caught.value.message
        assert out.read_bytes() == b"an older file"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["broken.gsvc", "out.gsvc", "sound.gsvc"]


def test_a_fault_that_only_splats_show_comes_along():
    """R-6.10-7: splats are not looked at."""
    faulty = write_stream(OVERVIEW_HEADER, overview_frames(), lies=[Lie("block_reserved", 1, 1)])
    before = gsvc_ref.reconstruct_stream(faulty)
    after = gsvc_ref.reconstruct_stream(joined(OVERVIEW, faulty))
    assert before.error.startswith("unsupported R-6.5-1")
    assert after.error.startswith("unsupported R-6.5-1")
    assert len(after.counts) == 3 + len(before.counts) == 4


class Slow(io.RawIOBase):
    """A pipe that gives and takes a few bytes at a time."""

    def __init__(self, data=b""):
        self.data, self.at = data, 0

    def readable(self):
        return True

    def writable(self):
        return True

    def readinto(self, buffer):
        piece = self.data[self.at : self.at + min(5, len(buffer))]
        buffer[: len(piece)] = piece
        self.at += len(piece)
        return len(piece)

    def write(self, data):
        self.data += bytes(data)[:3]
        return min(3, len(data))


def test_pipes_paths_and_files(tmp_path):
    path = tmp_path / "part.gsvc"
    path.write_bytes(OVERVIEW)
    out = Slow()
    seen = []
    with path.open("rb") as file:
        parts = [Slow(OVERVIEW), path, str(path), file, memoryview(OVERVIEW)]
        concat(parts, out, progress=lambda *at: seen.append(at))
        assert not file.closed
    assert out.data == joined(*[OVERVIEW] * 5)
    assert {total for _, _, total in seen} == {None}
    assert [done for _, done, _ in seen] == sorted(done for _, done, _ in seen)
    concat([path, path], tmp_path / "out.gsvc", progress=lambda *at: seen.append(at))
    assert seen[-1][0] == 1
    assert seen[-1][2] == 2 * len(OVERVIEW)


def test_the_target_may_be_a_part(tmp_path):
    """It is replaced only when all has been read."""
    path = tmp_path / "day.gsvc"
    path.write_bytes(OVERVIEW)
    concat([path, path], path)
    assert path.read_bytes() == joined(OVERVIEW, OVERVIEW)


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="open files are counted as on Linux")
def test_more_parts_than_files_may_be_open(tmp_path):
    import resource

    path = tmp_path / "part.gsvc"
    path.write_bytes(OVERVIEW)
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (len(os.listdir("/proc/self/fd")) + 20, before[1]))
    try:
        assert concat([path] * 100, tmp_path / "out.gsvc").frame_count == 300
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


def test_a_part_that_changes_meanwhile_is_noticed(tmp_path):
    first, second = tmp_path / "first.gsvc", tmp_path / "second.gsvc"
    first.write_bytes(OVERVIEW)
    second.write_bytes(OVERVIEW)

    def overwrite(part, done, total):
        second.write_bytes(RICH)

    with pytest.raises(UsageError, match=r"second\.gsvc was written anew"):
        concat([first, second], tmp_path / "out.gsvc", progress=overwrite)
    assert not (tmp_path / "out.gsvc").exists()


@pytest.mark.parametrize("sources", [[], "a.gsvc", b"bytes"])
def test_no_list_of_parts(sources):
    with pytest.raises(UsageError, match="a list of one stream or more"):
        concat(sources, io.BytesIO())


def test_one_chunk_is_held_at_a_time(tmp_path):
    """Forty frames of a mebibyte in two files: memory is that of a few chunks."""
    path, size = tmp_path / "large.gsvc", 2**20
    chunks = split_chunks(OVERVIEW)
    many = chunks[0][1][:19] + (20).to_bytes(4, "little") + chunks[0][1][23:]
    body = [(b"I", bytes([n]) + bytes(size - 1)) for n in range(20)]
    end = (20).to_bytes(4, "little") + bytes(4)
    path.write_bytes(join_chunks([(b"H", many), *body, (b"E", end)], prefix=MAGIC + VERSION))
    del body
    concat([OVERVIEW], io.BytesIO())  # kernels are compiled
    gc.collect()
    tracemalloc.start()
    try:
        concat([path, path], tmp_path / "out.gsvc")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert (tmp_path / "out.gsvc").stat().st_size > 40 * size
    assert peak < 6 * size


def test_an_index_ends_before_a_step_that_is_too_large():
    index = _Index()
    for entry in ((0, 52), (3, 52 + 2**32 - 1), (4, 52 + 2**33 - 1), (5, 60 + 2**33)):
        index.add(*entry)
    assert index.entry_count == 2
    assert index.steps.hex() == "0034" + "03ffffffff0f"


def test_an_index_without_room_in_the_level_is_left_out():
    for size, written in ((2**20 - 12, "HIPRxE"), (2**20 - 11, "HIPRE")):  # an entry of 2 bytes, then room for one
        out = io.BytesIO()
        result = CopiedStream(out, Opening(0, StreamReader(OVERVIEW).header, b""))
        result._index.steps = bytearray(size)
        stream = ChunkDecoder(Source(OVERVIEW))
        list(result.copy("part 1", stream, sound_chunks(stream)))
        result.finish()
        assert types(out.getvalue()) == written
