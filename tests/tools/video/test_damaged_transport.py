"""Damaged transport streams, and other containers, that lose frames: the encode goes on, and says how many are gone."""

import json

import numpy as np
import pytest

pytest.importorskip("av")

import av
from tools.video.odd_clips import SIZE, pictures, write_clip

from gsvc_ref.cli import main
from gsvc_ref.video import open_video
from gsvc_ref.video.stream import Damage
from gsvc_tools.video.libav_probe import missing_frames, read_packets

PACKET, FRAMES = 188, 12
VIDEO = 0x100


def transport_stream(path):
    """Frames that are each a key frame, so that a lost one damages no other."""
    with av.open(str(path), "w", format="mpegts") as container:
        stream = container.add_stream("mpeg2video", rate=25, options={"g": "1"})
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        for picture in pictures(FRAMES):
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    return path


def packets_of(path):
    """The packets of a transport stream, and the number of the frame that each belongs to; -1 of others."""
    data = path.read_bytes()
    packets = [bytearray(data[at : at + PACKET]) for at in range(0, len(data), PACKET)]
    owners, frame = [], -1
    for packet in packets:
        is_video = (packet[1] & 0x1F) << 8 | packet[2] == VIDEO
        frame += is_video and bool(packet[1] & 0x40)
        owners.append(frame if is_video else -1)
    return packets, owners


def damaged(path, lost=(), flagged=()):
    """The stream without the packets of some frames, and with those of others marked as damaged."""
    packets, owners = packets_of(path)
    kept = []
    for packet, owner in zip(packets, owners, strict=True):
        if owner in flagged:
            packet[1] |= 0x80  # transport_error_indicator
        kept += [] if owner in lost else [packet]
    out = path.with_name("damaged.ts")
    out.write_bytes(b"".join(kept))
    return out


def damage_of(path):
    with open_video(path) as reader:
        count = len(list(reader))
        return count, [str(note) for note in reader.notes if isinstance(note, Damage)]


def test_lost_frames_are_counted(tmp_path):
    path = transport_stream(tmp_path / "a.ts")
    assert damage_of(path) == (FRAMES, [])
    count, (note,) = damage_of(damaged(path, lost=(4, 5, 8)))
    assert count == FRAMES - 3
    assert "3 frames missing, by the time stamps" in note
    count, (note,) = damage_of(damaged(path, flagged=(6,)))
    assert count == FRAMES
    assert "FFmpeg marks 1 packet as damaged" in note


def test_the_encode_goes_on_and_says_so(tmp_path, capsys):
    path = damaged(transport_stream(tmp_path / "a.ts"), lost=(4, 5))
    encode = ["encode", str(path), str(tmp_path / "a.gsvc"), "--splats", "10"]
    said = f"{path} is damaged: 2 frames missing, by the time stamps"
    assert main([*encode, "--quiet"]) == 0
    assert capsys.readouterr().err.startswith(f"gsvc encode: {said}")
    assert main([*encode, "--json"]) == 0
    out, err = capsys.readouterr()
    assert said in err
    report = json.loads(out)
    assert len(report["frames"]) == FRAMES - 2
    assert [note for note in report["notes"] if note.startswith(said)]


def test_a_matroska_file_that_loses_a_cluster(tmp_path):
    path = tmp_path / "a.mkv"
    with av.open(str(path), "w", options={"cluster_time_limit": "120"}) as container:
        stream = container.add_stream("mjpeg", rate=25)
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuvj420p"
        for picture in pictures(FRAMES, "yuvj420p"):
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    assert damage_of(path) == (FRAMES, [])
    data = bytearray(path.read_bytes())
    clusters = [at for at in range(len(data)) if data[at : at + 4] == b"\x1f\x43\xb6\x75"]
    data[clusters[1] : clusters[1] + 12] = bytes(12)
    path.write_bytes(data)
    count, (note,) = damage_of(path)
    assert f"{FRAMES - count} frames missing, by the time stamps; FFmpeg says: " in note


def test_uneven_times_of_a_sound_file_are_no_damage(tmp_path):
    write_clip(tmp_path / "a.mkv", times=[0, 40, 80, 200, 240, 400])
    assert damage_of(tmp_path / "a.mkv") == (6, [])
    assert read_packets(av, tmp_path / "a.mkv").corrupt == 0


@pytest.mark.parametrize(
    ("times", "missing"),
    [
        ([0, 40, 80, 120], 0),
        ([0, 40, 80, 200, 240], 2),
        ([0, 33, 67, 167, 200, 233], 2),
        ([0, 40, 80, 110, 180, 220], 0),  # uneven by nature
        ([0, 0, 40, 80, 120, 200], 0),
        ([7], 0),
        ([0, 0, 0], 0),
    ],
)
def test_room_for_missing_frames(times, missing):
    assert missing_frames(np.array(times)) == missing
