"""Reading ahead: the same items and faults in the same places, one thread while it lasts, and only where it is safe."""

import threading

import numpy as np
import pytest
from codec_cases import encoded, fast, waves

from gsvc_base.errors import GsvcError
from gsvc_ref.stream import Stream, decode, decoder
from gsvc_ref.stream.ahead import read_ahead

NAME = "gsvc_ref ahead"


def alive() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name.startswith(NAME)]


def test_the_next_item_is_made_while_the_caller_works():
    made = [threading.Event() for _ in range(4)]
    makers = []

    def items():
        for number, event in enumerate(made):
            makers.append(threading.current_thread().name.startswith(NAME))
            event.set()
            yield number

    for number in read_ahead(items(), lambda item: item != 1):
        if number == 1:
            assert not made[2].wait(0.1)
        elif number < 3:
            assert made[number + 1].wait(30)
    assert makers == [False, True, False, True]
    assert alive() == []


@pytest.mark.parametrize("taken", [1, 2])
def test_a_fault_comes_behind_all_items_before_it_or_not_at_all(taken):
    def items():
        yield from (0, 1)
        raise GsvcError("malformed", "broken")

    reader, seen = read_ahead(items(), lambda item: True), []
    for _ in range(taken):
        seen.append(next(reader))
    if taken == 2:
        with pytest.raises(GsvcError, match="broken"):
            next(reader)
    reader.close()
    assert seen == [0, 1][:taken]
    assert alive() == []


def test_where_no_thread_can_be_started_the_caller_makes_all(monkeypatch):
    def none(*_):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("gsvc_ref.stream.ahead.ThreadPoolExecutor.submit", none)
    assert list(read_ahead(iter("abc"), lambda item: True)) == ["a", "b", "c"]


@pytest.fixture(scope="module")
def stream() -> bytes:
    return encoded(waves(frames=5), fast())[1]


def outcome(data: bytes, threads: int) -> tuple[list[bytes], str]:
    """The frames of a stream and the fault after them."""
    frames, fault = [], ""
    try:
        for frame in decode(data, threads=threads):
            frames.append(frame.tobytes())
    except GsvcError as error:
        fault = f"{error} {error.rule} {error.bit}"
    return frames, fault


def test_frames_and_faults_are_those_without(stream):
    assert outcome(stream, 2) == outcome(stream, 1)
    with Stream(stream) as opened:
        places = [(frame.offset, frame.size) for frame in opened]
    for offset, size in places:
        damaged = bytearray(stream)
        damaged[offset + size // 2] ^= 0x10
        alone = outcome(bytes(damaged), 1)
        assert alone[1]
        assert outcome(bytes(damaged), 2) == alone
    assert alive() == []


def test_closing_early_leaves_no_thread(stream):
    frames = decode(stream, threads=2)
    first = next(frames)
    assert len(alive()) == 1
    frames.close()
    assert alive() == []
    assert np.array_equal(first, next(decode(stream, threads=1)))
    with Stream(stream) as opened:  # stays open
        frames = decode(opened, threads=2)
        next(frames)
        del frames
        assert alive() == []
        assert len(list(opened)) == 5


def test_nothing_is_read_ahead_that_may_yet_come(stream, monkeypatch, tmp_path):
    """A pipe would hold up whoever closes it, and a file that grows may have the rest when it is asked for."""

    def refused(*_):
        raise AssertionError("read ahead")

    monkeypatch.setattr(decoder, "read_ahead", refused)
    with pytest.raises(AssertionError, match="read ahead"):
        next(decode(stream, threads=2))
    next(decode(stream, threads=1))
    next(decode(stream[:-1], threads=2))
    next(decode(stream, threads=2, on_gap=print))
    path = tmp_path / "live.gsvc"
    path.write_bytes(stream[: len(stream) // 2])
    with path.open("rb") as file:
        frames = decode(file, threads=2)
        next(frames)
        path.write_bytes(stream)
        assert len(list(frames)) == 4


def test_behind_a_large_frame_nothing_is_read_ahead(stream, monkeypatch):
    monkeypatch.setattr(decoder, "SPLATS_AHEAD", 0)
    frames = decode(stream, threads=2)
    next(frames)
    assert alive() == []
    assert len(list(frames)) == 4
