"""The decoder of the CUDA adapter, as fibers on the CPU; test_cuda.py has the vectors of its operations."""

import hashlib

import numpy as np
import pytest

from gsvc_base.draws import Draws
from gsvc_conformance import spec
from gsvc_conformance.adapters import cuda
from gsvc_conformance.adapters.cuda import __main__ as command
from gsvc_conformance.adapters.cuda import decoder, device, fibers, main_profile
from gsvc_conformance.adapters.cuda.decoder import DEPTH, Decoder, Scene
from gsvc_conformance.adapters.cuda.main_profile import STATUS
from gsvc_conformance.cases.main_streams import Plan, main_stream
from gsvc_ref.stream import decode_stream_deterministic
from gsvc_ref.testing import join_chunks, split_chunks
from gsvc_ref.testing.random_main_streams import random_main_stream
from gsvc_ref.testing.random_streams import random_stream

PREFIX = 10
"""Bytes of a stream before its first chunk."""


pytestmark = pytest.mark.usefixtures("on_fibers")


@pytest.fixture
def without_pictures(monkeypatch):
    """Decoders that stop at parameters: fibers take their time for pictures."""
    for name in ("fill", "frame"):
        monkeypatch.setattr(Scene, name, lambda *arguments: None)


def _threads(monkeypatch, count):
    for module in (main_profile, decoder):
        monkeypatch.setattr(module, "reading_threads", lambda: count)


def _reconstructed(stream):
    """What `reconstruct_stream` says, by a Decoder."""
    counts, parameters, error = [], [np.zeros((0, 8), np.float32)], ""
    try:
        for picture in Decoder(stream).pictures():
            picture.samples()
            counts.append(int(picture.slot.found["count"]))
            parameters.append(device.download(picture.slot.parameters, (counts[-1], 8), "f4"))
    except decoder.names()["Fault"] as fault:
        error = f"{fault.kind} {fault.rule} {fault.bit}"
    return {"counts": np.array(counts, np.int64), "parameters": np.concatenate(parameters), "error": error}


def _same(found, expected):
    return all(np.array_equal(found[name], expected[name]) for name in expected)


def test_a_decoder_finds_what_the_vectors_of_main_say_faults_included(vector_folder, without_pictures):
    names = [name for name in vector_folder.names if name.split("/")[1] == "reconstruct_stream"]
    wrong, decoded, faults = [], 0, 0
    for vector in vector_folder.read(names):
        stream = bytes(vector.inputs["stream"])
        expected = {name: vector.expected[name].value for name in ("counts", "parameters", "error")}
        try:
            found = _reconstructed(stream)
        except ValueError:  # of profile paper
            continue
        decoded += 1
        faults += found["error"] != ""
        if not _same(found, expected):
            wrong.append(f"{vector.id}: {found['error']!r} for {expected['error']!r}")
    assert not wrong, "\n".join(wrong)
    assert decoded > faults > 300


def test_a_stream_of_profile_paper_is_not_for_a_decoder():
    with pytest.raises(ValueError, match="profile paper"):
        Decoder(random_stream(0).data)


@pytest.mark.parametrize("seed", range(12))
def test_random_streams_have_the_states_of_the_code_of_the_specification(seed, without_pictures):
    stream = random_main_stream(seed).data
    assert _same(cuda.read_main_stream(stream), spec.namespace()["read_main_stream"](stream))
    assert _same(_reconstructed(stream), spec.namespace()["reconstruct_stream"](stream))


@pytest.mark.parametrize("seed", range(4))
def test_random_frames_have_the_pictures_of_gsvc_ref(seed):
    plans = Plan("I", 40), Plan("P", 10, motion_cell=2), Plan("P", kind="any"), Plan("I", 5), Plan("P", 3)
    stream = main_stream(Draws(seed), *plans, width=70, height=41)
    found = cuda.decode_stream_deterministic(stream)["frames"]
    assert found.tobytes() == decode_stream_deterministic(stream).tobytes()


@pytest.mark.parametrize("threads", [32, 96, 1024])
@pytest.mark.parametrize("lane_exponent", [3, 7, 12])
def test_the_size_of_the_block_changes_nothing(monkeypatch, threads, lane_exponent):
    plans = Plan("I", 400, lane_exponent=lane_exponent), Plan("P", 90, lane_exponent=lane_exponent, motion_cell=2)
    stream = main_stream(Draws(6), *plans, width=352, height=288, level=4, max_lane_exponent=12)
    _threads(monkeypatch, threads)
    assert _same(cuda.read_main_stream(stream), spec.namespace()["read_main_stream"](stream))


def test_the_order_of_threads_changes_nothing(monkeypatch):
    plans = Plan("I", 150, lane_exponent=6), Plan("P", 40, lane_exponent=5, motion_cell=3, kind="any"), Plan("P", 9)
    stream = main_stream(Draws(8), *plans, width=150, height=70, max_lane_exponent=6)
    _threads(monkeypatch, 96)
    ascending = cuda.read_main_stream(stream)
    with monkeypatch.context() as patch:
        patch.setattr(fibers, "OPTIONS", (*fibers.OPTIONS, "-DDESCENDING"))
        for function in (fibers.library, fibers.function):
            function.cache_clear()
        assert _same(cuda.read_main_stream(stream), ascending)
    for function in (fibers.library, fibers.function):
        function.cache_clear()


def _plain_stream(frames):
    """An I-frame, and P-frames that remove some splats and add others."""
    plans = [Plan("I", 60), *[Plan("P", 9, motion_cell=3, kind="any") for _ in range(frames - 1)]]
    return main_stream(Draws(3), *plans, width=64, height=48)


def test_frames_take_the_slots_in_turn_and_the_bound_of_splats_follows_their_number(without_pictures):
    frames = 4 * DEPTH
    found = Decoder(_plain_stream(frames))
    pictures = list(found.pictures())
    assert [picture.number for picture in pictures] == list(range(frames))
    assert len({id(picture.slot) for picture in pictures}) <= 2 * DEPTH
    assert all(pictures[k].slot is pictures[-1].slot for k in range(frames - 1, 0, -DEPTH) if k >= frames - DEPTH)
    last = int(pictures[-1].slot.found["count"])
    assert last <= found._bound.most <= 60 + 9 * frames
    assert found._bound.most == last  # the end confirms all


def test_a_room_is_for_one_decoder_after_the_other(without_pictures):
    first = Decoder(_plain_stream(6))
    before = [picture.samples().tobytes() for picture in first.pictures()]
    slots = list(first.room.slots)
    again = Decoder(_plain_stream(6), room=first.room)
    assert again.room is first.room
    assert [picture.samples().tobytes() for picture in again.pictures()] == before
    assert set(again.room.slots) == set(slots)
    assert Decoder(_plain_stream(6), exact=True, room=first.room).room is not first.room


def test_frames_before_a_fault_stay(without_pictures):
    stream = _plain_stream(3)
    chunks = split_chunks(stream)
    third = [place for place, (kind, _) in enumerate(chunks) if kind in (b"I", b"P")][2]
    kind, payload = chunks[third]
    chunks[third] = kind, payload[:-1]
    broken = join_chunks(chunks, prefix=stream[:PREFIX])
    pictures, fault = [], None
    try:
        pictures.extend(Decoder(broken).pictures())
    except decoder.names()["Fault"] as found:
        fault = found
    whole = spec.namespace()["reconstruct_stream"](broken)
    assert whole["error"].startswith("malformed R-7-1")
    assert f"{fault.kind} {fault.rule} {fault.bit}" == whole["error"]
    assert _reconstructed(broken)["counts"].tolist() == whole["counts"].tolist() == [60, *whole["counts"][1:]]


@pytest.mark.parametrize("place", [0, 7, -1])
def test_a_chunk_that_was_damaged_breaks_its_checksum_whatever_the_damage_says(without_pictures, place):
    stream = bytearray(_plain_stream(3))
    chunks = split_chunks(bytes(stream))
    start = PREFIX + sum(len(payload) + 6 + (len(payload) > 127) for kind, payload in chunks[:2])
    size = len(chunks[2][1])
    stream[start + 2 + (size > 127) + (place if place >= 0 else size - 1)] ^= 0x10
    found, expected = _reconstructed(bytes(stream)), spec.namespace()["reconstruct_stream"](bytes(stream))
    assert found["error"].startswith("malformed R-6.2-2")
    assert _same(found, expected)


def test_a_head_that_lies_makes_no_room():
    body = bytes([0b0101_0011, 20, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F])
    assert main_profile.new_splats(body, 2**14) == 0
    assert main_profile.new_splats(body, 2**31) == 2**31
    assert main_profile.new_splats(b"\x53", 2**14) == 0
    assert main_profile.new_splats(b"\x53\x14\x07", 2**14) == 4
    assert main_profile.new_splats(b"\x52\x14\x07", 2**14) == 0


def test_status_and_told_have_the_sizes_of_the_kernels():
    source = (device.machine().KERNELS / "main_body.cu").read_text(encoding="utf-8")
    for name, dtype in (("Told", main_profile.TOLD), ("Status", STATUS)):
        body = source.partition(f"struct {name} {{")[2].partition("};")[0]
        fields = [line.partition("/*")[0].partition(";")[0].split() for line in body.splitlines() if ";" in line]
        assert sum("long" in words for words in fields) == sum(dtype[field].base == "u8" for field in dtype.names)


@pytest.mark.parametrize("options", [[], ["--deterministic"]])
def test_the_command_says_how_fast_it_is(capsys, tmp_path, monkeypatch, options):
    stream = _plain_stream(3)
    path = tmp_path / "clip.gsvc"
    path.write_bytes(stream)
    monkeypatch.setattr("sys.argv", ["cuda", "--times", "1", *options, str(path)])
    assert command.main() == 0
    said = capsys.readouterr().out
    assert "3 frames" in said
    assert "frames/s" in said
    expected = hashlib.sha256(decode_stream_deterministic(stream).tobytes()).hexdigest()
    assert (f"sha256 {expected}" in said) == bool(options)


def test_the_command_tells_of_a_fault_in_a_sentence(capsys, tmp_path, monkeypatch):
    path = tmp_path / "clip.gsvc"
    path.write_bytes(_plain_stream(3)[:-20])
    monkeypatch.setattr("sys.argv", ["cuda", str(path)])
    assert command.main() == 1
    assert "R-6.2-4" in capsys.readouterr().err
