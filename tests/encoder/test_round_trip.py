"""What an encoder writes is, bit for bit, what it meant, and its report tells the truth."""

import hashlib
import subprocess
import sys
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from codec_cases import encoded, paper_fast, paper_quick, video_format, waves

from gsvc_ref.bitstream.crc import parameter_checksum
from gsvc_ref.encoder import Settings, encode, recording, setup
from gsvc_ref.encoder.paper import FrameEncoder
from gsvc_ref.metrics import psnr
from gsvc_ref.paper import reconstruct
from gsvc_ref.stream import Stream, StreamWriter, decode

IN_ANOTHER_PROCESS = """
import hashlib, sys
import gsvc_ref
with gsvc_ref.open(sys.argv[1]) as stream:
    for frame in stream:
        print(frame.type, hashlib.sha256(frame.splats.tobytes()).hexdigest())
for frame in gsvc_ref.decode(sys.argv[1], threads=1):
    print(hashlib.sha256(frame.tobytes()).hexdigest())
"""


@pytest.fixture
def states(monkeypatch) -> list:
    """The decoder's state that the encoder holds after each frame that it encodes from now on."""
    kept = []

    class Recording(FrameEncoder):
        def encode(self, *arguments):
            result = super().encode(*arguments)
            assert result.state is self.state
            kept.append(result.state)
            return result

    monkeypatch.setattr(setup, "FrameEncoder", Recording)
    return kept


VARIETY = {
    "quick": paper_fast(iterations=8, key_frames=3),
    "chosen": paper_quick(iterations=2, threads=1, key_frames=(2,)),
    "quality": paper_fast(psnr=24.0, key_frames=3),
    "paper": Settings.paper(iterations=30, splats=30, key_frames=3, threads=1),
    "odd quantisers": paper_fast(cholesky_bits=1, color_stages=8, color_codewords=1, key_frames=4),
    "large quantisers": paper_fast(cholesky_bits=12, color_stages=2, color_codewords=1024, lane_count=64),
    "all splats": paper_fast(iterations=1, splats=32 * 24, key_frames=1),
}


@pytest.mark.parametrize("settings", VARIETY.values(), ids=VARIETY)
def test_decoded_parameters_are_the_encoders_own(states, settings):
    clip = waves(frames=4)
    clip.insert(2, clip[1].copy())  # an R-frame where no key frame is asked for
    _, data = encoded(clip, replace(settings, checksums=True))  # a reader checks each checksum
    with Stream(data) as stream:
        splats = [frame.splats for frame in stream]
    assert len(splats) == len(states) == 5
    for decoded, state in zip(splats, states, strict=True):
        assert decoded == state.splats
        assert parameter_checksum(decoded) == parameter_checksum(state.splats)


@pytest.mark.parametrize("settings", VARIETY.values(), ids=VARIETY)
def test_the_writer_takes_the_state_that_it_would_reconstruct(monkeypatch, settings):
    """The encoder's state after each frame, what it keeps of the quantisers included, is that of its codes."""
    taken = []

    class Checking(StreamWriter):
        def write_frame(self, codes, state=None, layers=None):
            again = reconstruct(codes, self.state)
            assert (state.width, state.height) == (again.width, again.height)
            assert state.splats.tobytes() == again.splats.tobytes()
            for kind in ("intra", "inter"):
                assert state.kept(kind).quantizer is again.kept(kind).quantizer
                assert state.kept(kind).codebooks is again.kept(kind).codebooks
            taken.append(codes.type)
            decoded = super().write_frame(codes, state, layers)
            assert self.state is state
            return decoded

    monkeypatch.setattr(recording, "StreamWriter", Checking)
    clip = waves(frames=4)
    clip.insert(2, clip[1].copy())
    _, data = encoded(clip, settings)
    assert "".join(taken) == "".join(frame.type for frame in Stream(data))
    target = BytesIO()
    with Stream(data) as stream:
        writer = StreamWriter(target, stream.header)
        for frame in stream:
            writer.write_frame(frame.codes)
    writer.finish()
    assert target.getvalue() == encoded(clip, replace(settings, decisions=False))[1]


def test_another_process_decodes_the_same_bits(states, tmp_path):
    path = tmp_path / "clip.gsvc"
    clip = waves(frames=4, cut=2)
    encode((clip, video_format()), path, paper_fast(iterations=8, key_frames=(2,)))
    command = [sys.executable, "-c", IN_ANOTHER_PROCESS, str(path)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout.splitlines()
    types = ["I", "P", "I", "P"]
    digests = [hashlib.sha256(state.splats.tobytes()).hexdigest() for state in states]
    assert lines[:4] == [f"{type_} {digest}" for type_, digest in zip(types, digests, strict=True)]
    assert lines[4:] == [hashlib.sha256(frame.tobytes()).hexdigest() for frame in decode(path, threads=2)]


@pytest.mark.parametrize("override", [{}, {"psnr": 25.0}], ids=["rate", "quality"])
def test_the_same_seed_gives_the_same_bytes_with_any_number_of_threads(override):
    clip = waves(64, 32, 3, cut=2)
    common = {"iterations": 6, "key_frames": "auto", "seed": 5, **override}
    first = encoded(clip, paper_quick(threads=1, **common))[1]
    assert encoded(clip, paper_quick(threads=2, **common))[1] == first
    assert encoded(clip, paper_quick(threads=1, **common))[1] == first
    assert encoded(clip, paper_quick(threads=1, **common | {"seed": 6}))[1] != first


def test_the_papers_preset_is_deterministic_too():
    settings = Settings.paper(iterations=12, splats=40, key_frames=2, seed=1)
    first = encoded(waves(frames=3), replace(settings, threads=1))[1]
    assert encoded(waves(frames=3), replace(settings, threads=2))[1] == first
    assert encoded(waves(frames=3), replace(settings, threads=2, seed=2))[1] != first


@pytest.mark.parametrize("bit_depth", [8, 10, 16])
def test_the_report_says_what_the_stream_holds(bit_depth):
    clip = waves(frames=4, bit_depth=bit_depth)
    clip.append(clip[-1].copy())
    report, data = encoded(clip, paper_fast(key_frames=2, lane_count=3), bit_depth)
    with Stream(data) as stream:
        summary = stream.info()
        decoded = list(stream)
    assert report.file_bytes == len(data) == summary.file_bytes
    assert sum(summary.bits.values()) == 8 * len(data)
    assert report.header == stream.header
    assert report.header.frame_count == 5
    assert [frame.type for frame in report.frames] == [frame.type for frame in decoded]
    before = 0
    pictures = decode(data)
    for number, (frame, told, picture) in enumerate(zip(decoded, report.frames, pictures, strict=True)):
        assert told.number == frame.number == number
        assert told.bits == frame.bits == summary.frames[number].bits
        assert sum(told.bits.values()) == 8 * frame.size
        assert told.splats == len(frame.splats)
        assert told.psnr == psnr(clip[number], picture, 2**bit_depth - 1)
        if frame.type == "P":
            assert told.new_splats == frame.codes.intra_count
            assert told.pruned_splats == before - frame.codes.survivor_count
            assert told.splats == before - told.pruned_splats + told.new_splats
        before = told.splats
    assert report.bits_per_pixel == 8 * len(data) / (32 * 24 * 5)
    assert report.mean_psnr == pytest.approx(np.mean([frame.psnr for frame in report.frames]))
    assert sum(report.frame_types.values()) == 5
    assert not report.interrupted
    assert 0 < sum(report.seconds_by_stage.values()) <= report.seconds


def test_a_range_of_frames_is_that_of_the_source():
    clip = waves(frames=5)
    part = encoded(clip, paper_fast(frames=(1, 4)))[1]
    assert part == encoded(clip[1:4], paper_fast())[1]
    assert encoded(clip, paper_fast(frames=(3, None)))[1] == encoded(clip[3:], paper_fast())[1]
    assert encoded(clip, paper_fast(frames=(3, 99)))[1] == encoded(clip[3:], paper_fast())[1]


def test_frames_can_be_views_of_any_layout():
    clip = waves(frames=2)
    plain = encoded(clip, paper_fast())[1]
    reversed_twice = [frame[:, :, ::-1].copy()[:, :, ::-1] for frame in clip]
    turned = [frame.transpose(1, 0, 2).copy().transpose(1, 0, 2) for frame in clip]
    assert encoded(reversed_twice, paper_fast())[1] == plain
    assert encoded(turned, paper_fast())[1] == plain


@pytest.mark.parametrize("key_frames", [(), "auto"])
def test_a_caller_may_fill_the_same_array_again(key_frames):
    clip = waves(frames=3)

    def refilled():
        array = np.empty_like(clip[0])
        for frame in clip:
            array[:] = frame
            yield array

    file = BytesIO()
    encode((refilled(), video_format()), file, paper_fast(key_frames=key_frames))
    assert file.getvalue() == encoded(clip, paper_fast(key_frames=key_frames))[1]


def test_progress_tells_stage_frame_and_iteration():
    seen = []
    frames = waves(frames=3)
    settings = paper_fast(key_frames="auto", frames=(1, None))
    encode((frames, video_format(frame_count=3)), BytesIO(), settings, progress=seen.append)
    assert {progress.stage for progress in seen} == {"detect", "fit", "quantize"}
    assert {progress.frame for progress in seen} == {0, 1}
    assert {progress.frame_count for progress in seen} == {2}
    assert all(0 <= progress.iteration <= progress.iterations for progress in seen)
    assert all(progress.psnr is None or progress.psnr > 0 for progress in seen)
    times = [progress.elapsed_s for progress in seen]
    assert times == sorted(times)
    fits = [progress.iteration for progress in seen if progress.stage == "fit" and progress.frame == 0]
    assert fits == list(range(1, len(fits) + 1))
    assert len(fits) >= settings.intra.fit.iterations


def test_progress_changes_no_byte():
    clip = waves(frames=2)
    assert encoded(clip, paper_fast(), progress=lambda _: None)[1] == encoded(clip, paper_fast())[1]


@pytest.mark.parametrize("index", [True, False])
def test_an_open_file_takes_a_stream_at_its_place(tmp_path, index):
    path = tmp_path / "two.bin"
    clip = waves(frames=2)
    with path.open("w+b") as file:
        file.write(b"before")
        report = encode((clip, video_format()), file, paper_fast(index=index))
        assert not file.closed
        assert file.tell() == 6 + report.file_bytes
    data = path.read_bytes()
    assert data[:6] == b"before"
    assert data[6:] == encoded(clip, paper_fast(index=index))[1]
