"""`gsvc import` and `gsvc export`: from files of splats to a stream and back, with what gets lost."""

import json
import os

import numpy as np
import pytest

import gsvc_ref
from gsvc_ref.cli import main
from gsvc_tools.splat_files import from_gaussians, read_ply, to_gaussians, write_ply

W, H = 40, 30


def splats_of_frames():
    rng = np.random.default_rng(0)
    first = np.concatenate(
        [rng.uniform(0, 30, (20, 2)), rng.uniform(1, 5, (20, 3)), rng.uniform(0, 0.5, (20, 3))], axis=1
    )
    return [(first + np.array([t, 0, 0, 0, 0, 0, 0, 0])).astype(np.float32) for t in range(3)]


@pytest.fixture
def npz(tmp_path):
    frames = splats_of_frames()
    np.savez(tmp_path / "in.npz", parameters=np.stack(frames), width=W, height=H, frame_rate=[30000, 1001])
    return tmp_path / "in.npz"


def decoded(path):
    with gsvc_ref.open(path) as stream:
        return [frame.splats.to_array() for frame in stream]


def test_npz_to_a_stream_and_back(npz, tmp_path, capsys):
    out, back, again = (str(tmp_path / name) for name in ("a.gsvc", "b.npz", "c.gsvc"))
    assert main(["import", str(npz), out, "--profile", "paper"]) == 0
    said = capsys.readouterr()
    assert "3 frames: 1 I, 2 P" in said.out
    assert said.err.count("lost: ") == 1
    assert "what quantisers round: frame" in said.err
    with gsvc_ref.open(out) as stream:
        assert stream.header.frame_rate_numerator == 30000
    assert main(["export", out, back, "--quiet"]) == 0
    assert capsys.readouterr().err == ""
    with np.load(back, allow_pickle=False) as arrays:
        kept = dict(arrays)
    assert np.array_equal(kept["parameters"], np.concatenate(decoded(out)))
    assert kept["ids"].tolist() == [*range(20)] * 3
    assert main(["import", back, again, "--profile", "paper", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert [frame["type"] for frame in report["frames"]] == ["I", "P", "P"]
    assert report["mean_psnr"] is None or report["mean_psnr"] > 50
    for a, b in zip(decoded(out), decoded(again), strict=True):
        assert np.abs(a - b).max() < 0.03


def test_ply_files_to_a_stream_and_back(npz, tmp_path, capsys):
    out, folder, again = tmp_path / "a.gsvc", tmp_path / "plys", tmp_path / "c.gsvc"
    assert main(["import", str(npz), str(out), "--profile", "paper", "--quiet"]) == 0
    units = ["--pixels-per-unit", "10", "--origin=-0.5,2"]
    capsys.readouterr()
    assert main(["export", str(out), str(folder), *units, "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["lost"]) == 2
    assert sorted(path.name for path in folder.iterdir()) == [f"frame_{t:06}.ply" for t in range(3)]
    assert main(["export", str(out), str(folder), "--quiet"]) == 2
    assert "holds PLY files already" in capsys.readouterr().err
    assert main(["import", str(folder), str(again)]) == 2
    assert "give --width and --height" in capsys.readouterr().err
    size = ["--width", str(W), "--height", str(H)]
    assert main(["import", str(folder), str(again), *units, *size, "--profile", "paper", "--quiet"]) == 0
    assert "lost: what hides what" in capsys.readouterr().err
    for a, b in zip(decoded(out), decoded(again), strict=True):
        assert np.abs(a - b).max() < 0.03


def test_splats_go_through_profile_main(npz, tmp_path, capsys):
    out, back, again = (str(tmp_path / name) for name in ("a.gsvc", "b.npz", "c.gsvc"))
    assert main(["import", str(npz), out, "--psnr", "50", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["header"]["profile"] == 1
    assert min(frame["psnr"] for frame in report["frames"]) >= 50
    assert main(["export", out, back, "--quiet"]) == 0
    assert main(["import", back, again, "--quality", "60", "--refit", "none", "--quiet"]) == 0
    assert len(decoded(again)) == 3
    assert main(["import", back, again, "--quality", "60", "--cholesky-bits", "8", "--force"]) == 2
    assert "cholesky_bits is an option of profile paper" in capsys.readouterr().err


def test_a_checkpoint_is_told_from_splats(tmp_path, capsys):
    (tmp_path / "gaussian_model.pth.tar").write_bytes(b"PK")
    assert main(["import", str(tmp_path / "gaussian_model.pth.tar"), str(tmp_path / "a.gsvc")]) == 2
    assert "is a checkpoint of PyTorch" in capsys.readouterr().err


def test_one_frame_as_ply(npz, tmp_path, capsys):
    out, ply = tmp_path / "a.gsvc", tmp_path / "one.ply"
    assert main(["import", str(npz), str(out), "--quiet"]) == 0
    assert main(["export", str(out), str(ply), "--quiet"]) == 2
    assert "more than one frame" in capsys.readouterr().err
    assert not ply.exists()
    assert main(["export", str(out), str(ply), "--frames", "1:2", "--quiet"]) == 0
    assert np.allclose(from_gaussians(read_ply(ply).columns).parameters, decoded(out)[1], atol=1e-4)
    assert main(["export", str(out), str(ply), "--frames", "7:8"]) == 2
    assert "no such frame" in capsys.readouterr().err


def test_splats_that_cannot_be_coded_are_bad_data_of_a_named_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    first = splats_of_frames()[0]
    wrong = first.copy()
    wrong[3, 0] = np.nan
    np.savez("dup.npz", parameters=first, ids=[0, *range(19)], width=W, height=H)
    np.savez("wide.npz", parameters=first, width=10_000_000, height=H)
    np.savez("nan.npz", parameters=[wrong, first], width=W, height=H)
    np.savez("later.npz", parameters=[first, wrong], width=W, height=H)
    write_ply("1.ply", to_gaussians(first))
    write_ply("2.ply", to_gaussians(first) | {"x": np.full(len(first), 1e9)})
    for inputs, message in (
        (["dup.npz"], "invalid: dup.npz: frame 0: two splats have the same id"),
        (["wide.npz"], "malformed: wide.npz: the size is 10000000x30"),
        (["nan.npz"], "invalid: nan.npz: frame 0, splat 3: x is nan"),
        (["later.npz"], "invalid: later.npz: frame 1, splat 3: x is nan"),
        (["1.ply", "2.ply", "--width", "40", "--height", "30"], "invalid: 2.ply: frame 1, splat 0: x is 1"),
    ):
        files = [name for name in inputs if name.endswith(("npz", "ply"))]
        assert main(["import", *files, "x.gsvc", *inputs[len(files) :], "--quiet"]) == 1
        assert message in capsys.readouterr().err


def test_other_elements_of_ply_files_are_said_to_be_lost(tmp_path, capsys):
    ply = tmp_path / "a.ply"
    write_ply(ply, to_gaussians(splats_of_frames()[0]))
    faces = b"element face 1\nproperty uchar i\nend_header\n"
    ply.write_bytes(ply.read_bytes().replace(b"end_header\n", faces) + b"\1")
    assert main(["import", str(ply), str(tmp_path / "x.gsvc"), "--width", "40", "--height", "30", "--quiet"]) == 0
    assert "lost: elements of PLY files that are not vertices: face" in capsys.readouterr().err


def test_a_damaged_stream_gives_the_frames_before_the_damage(npz, tmp_path, capsys):
    out, cut = tmp_path / "a.gsvc", tmp_path / "cut.gsvc"
    assert main(["import", str(npz), str(out), "--quiet", "--key-frames", "1"]) == 0
    with gsvc_ref.open(out) as stream:
        second = list(stream)[1]
    cut.write_bytes(out.read_bytes()[: second.offset + second.size + 5])
    assert main(["export", str(cut), str(tmp_path / "b.npz"), "--quiet"]) == 1
    assert "R-6.2-4" in capsys.readouterr().err
    with np.load(tmp_path / "b.npz", allow_pickle=False) as arrays:
        assert arrays["counts"].tolist() == [20, 20]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["import", "no.npz", "x.gsvc"], 2, "there is no file 'no.npz'"),
        (["import", "bad.npz", "x.gsvc"], 1, "bad.npz is not a sound NPZ file"),
        (["import", "bad.ply", "x.gsvc", "--width", "9", "--height", "9"], 1, "does not begin with 'ply'"),
        (["import", "bad.txt", "x.gsvc"], 2, "neither one NPZ file nor PLY"),
        (["import", "pipe.npz", "x.gsvc"], 2, "pipe.npz is not a regular file"),
        (["import", "pipes", "x.gsvc"], 2, "a.ply is not a regular file"),
        (["import", "-", "x.gsvc"], 2, "cannot come from standard input"),
        (["import", "empty", "x.gsvc"], 2, "holds no .ply files"),
        (["import", "bad.npz", "x.gsvc", "--frame-rate", "0"], 2, "'0' is not a frame rate"),
        (["import", "bad.npz", "x.gsvc", "--origin", "3"], 2, "'3' is not X,Y"),
        (["export", "bad.npz", "x.npz"], 1, "R-6.1-1"),
        (["export", "bad.npz", "x.txt"], 2, "cannot tell what to write as x.txt"),
    ],
)
def test_wrong_use_is_said_in_a_sentence(tmp_path, monkeypatch, capsys, arguments, status, message):
    monkeypatch.chdir(tmp_path)
    for folder in ("empty", "pipes"):
        (tmp_path / folder).mkdir()
    for name in ("pipe.npz", "pipes/a.ply"):
        os.mkfifo(tmp_path / name)
    for name in ("bad.npz", "bad.ply", "bad.txt"):
        (tmp_path / name).write_bytes(b"no splats at all")
    assert main(arguments) == status
    assert message in capsys.readouterr().err
    assert not (tmp_path / "x.gsvc").exists()
