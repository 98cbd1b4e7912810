"""The glTF files of render vectors: a renderer that knows KHR_gaussian_splatting alone finds the expected pictures."""

import json
import subprocess
import sys

import numpy as np
import pytest

from gsvc_base.constants import LN_255
from gsvc_conformance.__main__ import main
from gsvc_conformance.gltf import EXTENSION, MAX_CHANGE, export, left_out, pictures, stored
from gsvc_conformance.making import make_vector
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector import read as read_vector

SELECTION = ("core/render_sum/*", "core/render_frame/*", "uncommon/render_sum/*")
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gltf")
    selected = [word for pattern in SELECTION for word in ("--case", pattern)]
    assert main(["export", "--gltf", str(folder), *selected]) == 0
    return folder


def read(home):
    """The camera and the attributes of a file, as the words of glTF have them."""
    gltf = json.loads((home / "splats.gltf").read_text())
    data = (home / gltf["buffers"][0]["uri"]).read_bytes()
    assert len(data) == gltf["buffers"][0]["byteLength"]
    assert gltf["extensionsUsed"] == [EXTENSION]
    (primitive,) = gltf["meshes"][0]["primitives"]
    assert primitive["mode"] == 0
    assert primitive["extensions"][EXTENSION] == {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}
    attributes = {}
    for name, place in primitive["attributes"].items():
        accessor = gltf["accessors"][place]
        view = gltf["bufferViews"][accessor["bufferView"]]
        assert accessor["componentType"] == 5126
        part = data[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        attributes[name] = np.frombuffer(part, "<f4").reshape(accessor["count"], WIDTHS[accessor["type"]])
    position = gltf["accessors"][primitive["attributes"]["POSITION"]]
    assert position["min"] == attributes["POSITION"].min(axis=0).tolist()
    assert position["max"] == attributes["POSITION"].max(axis=0).tolist()
    camera = next(node for node in gltf["nodes"] if "camera" in node)
    return attributes, camera["translation"], gltf["cameras"][camera["camera"]]["orthographic"]


def matrices(quaternions):
    """Rotations (N, 3, 3) of unit quaternions x, y, z, w."""
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)


def render(home, width, height, cut=LN_255):
    """The sum of a file's splats in binary64: covariance in space, seen along z, opacity times weight times colour.

    A splat covers a pixel where minus the logarithm of its weight is at most `cut`.
    """
    attributes, (left, top, _), camera = read(home)
    wide = {name.removeprefix(f"{EXTENSION}:"): array.astype(np.float64) for name, array in attributes.items()}
    x = left - camera["xmag"] + (np.arange(width) + 0.5) * 2 * camera["xmag"] / width
    y = top + camera["ymag"] - (np.arange(height) + 0.5) * 2 * camera["ymag"] / height
    picture = np.zeros((height, width, 3))
    factors = matrices(wide["ROTATION"]) * wide["SCALE"][:, None, :]
    for n, factor in enumerate(factors):
        covariance = (factor @ factor.T)[:2, :2]
        a, b, c = covariance[0, 0], covariance[0, 1], covariance[1, 1]
        determinant = np.prod(wide["SCALE"][n, :2]) ** 2
        dx, dy = x[None, :] - wide["POSITION"][n, 0], y[:, None] - wide["POSITION"][n, 1]
        sigma = (c * dx * dx - 2 * b * dx * dy + a * dy * dy) / determinant / 2
        color = wide["SH_DEGREE_0_COEF_0"][n] * 0.28209479177387814 + 0.5
        picture += np.where(sigma <= cut, wide["OPACITY"][n] * np.exp(-sigma), 0)[..., None] * color
    return picture


def entries_of(folder):
    return json.loads((folder / "index.json").read_text())["pictures"]


def save(folder, name, picture):
    path = folder / f"{name}.npy"
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, picture)
    return path


def compare(exported, folder, *more):
    """The exit code of compare_pictures.py, and its lines."""
    words = [sys.executable, str(exported / "compare_pictures.py"), str(folder), *more]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert not done.stderr
    return done.returncode, done.stdout.splitlines()


def test_a_renderer_of_the_extension_finds_the_expected_pictures(exported, tmp_path):
    entries = entries_of(exported)
    assert len(entries) > 40
    for entry in entries:
        picture = render(exported / entry["id"], entry["width"], entry["height"])
        if "bit_depth" in entry:
            kind = np.uint8 if entry["bit_depth"] == 8 else np.uint16
            picture = np.rint(np.clip(picture, 0, 1) * (2 ** entry["bit_depth"] - 1)).astype(kind)
        save(tmp_path, entry["id"], picture)
    assert compare(exported, tmp_path) == (0, [f"{len(entries)} of {len(entries)} pictures are right"])

    one = next(entry["id"] for entry in entries if not entry["needs"])
    picture = np.load(tmp_path / f"{one}.npy")
    np.save(tmp_path / f"{one}.npy", np.roll(picture, 1, axis=1))
    code, lines = compare(exported, tmp_path, "--plain")
    assert code == 1
    assert lines[0].startswith(f"WRONG {one}: is ")


def test_a_picture_of_either_type_is_judged(exported, tmp_path):
    """Floating point for frames of every bit depth, and 8 bits for sums and frames of 8 bits."""
    entries = entries_of(exported)
    frames = [entry for entry in entries if "bit_depth" in entry]
    assert {entry["bit_depth"] for entry in frames} == {8, 9, 10, 12, 16}
    for entry in frames:
        save(tmp_path / "float", entry["id"], render(exported / entry["id"], entry["width"], entry["height"]))
    assert compare(exported, tmp_path / "float") == (0, [f"{len(frames)} of {len(frames)} pictures are right"])
    for entry in frames:
        path = tmp_path / "float" / f"{entry['id']}.npy"
        picture = np.load(path)
        save(tmp_path / "float", entry["id"], picture + 3 / (2 ** entry["bit_depth"] - 1))
    code, lines = compare(exported, tmp_path / "float")
    assert (code, lines[-1]) == (1, f"0 of {len(frames)} pictures are right")

    kept = [entry for entry in entries if entry.get("bit_depth", 8) == 8]
    for entry in entries:
        picture = np.clip(render(exported / entry["id"], entry["width"], entry["height"]), 0, 1)
        save(tmp_path / "bytes", entry["id"], np.rint(picture * 255).astype(np.uint8))
    code, lines = compare(exported, tmp_path / "bytes")
    assert (code, lines[-1]) == (1, f"{len(kept)} of {len(entries)} pictures are right")
    assert all(line.endswith("numbers of type uint8; they must be uint16 or floating point") for line in lines[:-1])


def test_a_file_that_is_no_picture_is_wrong_and_the_others_are_judged(exported, tmp_path):
    names = [entry["id"] for entry in entries_of(exported)]
    for name in names[:6]:
        save(tmp_path, name, np.load(exported / name / "expected.npy"))
    bad = [tmp_path / f"{name}.npy" for name in names[:5]]
    np.save(bad[0], np.array([{}], object), allow_pickle=True)
    bad[1].write_bytes(b"no array")
    bad[2].write_bytes(b"")
    np.savez(tmp_path / "archive.npz", picture=np.zeros(3))
    (tmp_path / "archive.npz").rename(bad[3])
    np.save(bad[4], np.array("a text"))
    code, lines = compare(exported, tmp_path)
    assert (code, lines[-1]) == (1, "1 of 6 pictures are right")
    for name, line in zip(names, lines[:-1], strict=False):
        assert line.startswith(f"WRONG {name}")


def test_either_decision_at_the_edge_of_a_splat_is_right(tmp_path):
    """Colours that are 0 are not quite 0 as coefficients: a splat that is drawn at its edge shows that."""
    vector = read_vector(VECTORS / "stress/render_sum/hard_coverage_on")
    export([vector], tmp_path / "out")
    (entry,) = entries_of(tmp_path / "out")
    home, size = tmp_path / "out" / vector.id, (entry["width"], entry["height"])
    pictures_of = [render(home, *size, cut=LN_255 * factor) for factor in (1 - 1e-7, 1, 1 + 1e-7)]
    assert len({picture.tobytes() for picture in pictures_of}) > 1
    for picture in pictures_of:
        save(tmp_path / "mine", vector.id, picture)
        assert compare(tmp_path / "out", tmp_path / "mine") == (0, ["1 of 1 pictures are right"])


SPLATS = np.array([[9.5, 4, 3, 0.5, 2, 0.9, 0.5, 0.1], [30, 11, 2, -1, 1.5, 0.2, 0.4, 1.0]], np.float32)


@pytest.fixture
def of_splats():
    def make(splats, **numbers):
        return make_vector(
            "render_sum", {"parameters": np.array(splats, np.float32), "width": 40, "height": 20, **numbers}
        )

    return make


def test_what_a_renderer_needs_is_said(of_splats, tmp_path):
    vectors = {
        "apart": of_splats(SPLATS), "over": of_splats([SPLATS[0], SPLATS[0]]),
        "negative": of_splats(SPLATS - np.float32([0] * 7 + [0.5])),
    }  # fmt: skip
    export(vectors.values(), tmp_path)
    found = {entry["id"]: entry["needs"] for entry in json.loads((tmp_path / "index.json").read_text())["pictures"]}
    assert found[vectors["apart"].id] == []
    assert found[vectors["over"].id] == ["sums", "float target"]
    assert found[vectors["negative"].id] == ["any colours", "float target"]


def test_what_does_not_map_is_left_out(of_splats, tmp_path):
    assert "no splats" in left_out(of_splats(np.zeros((0, 8))))
    assert "degenerate" in left_out(of_splats([[9, 4, 0, 0, 2, 1, 1, 1]]))
    thin = of_splats([[20.5, 10.5, 4000, 4000, 1e-5, 1, 1, 1]])
    assert left_out(thin) == ""
    written, others = export([thin], tmp_path)
    assert (written, list(others)) == ([], [thin.id])
    assert "1e-05 of its colours" in others[thin.id]


def test_storing_changes_little_and_the_change_is_known():
    found = pictures(SPLATS, stored(SPLATS), 40, 20)
    assert 0 < found.change.max() < MAX_CHANGE / 10
    assert found.covered.max() == 1
    moved = stored(SPLATS + np.float32([0.25] + [0] * 7))
    assert pictures(SPLATS, moved, 40, 20).change.max() > 0.05


def test_only_pictures_are_exported(tmp_path, capsys):
    assert main(["export", "--gltf", str(tmp_path), "--operation", "loss"]) == 2
    assert "select vectors of render_sum or render_frame" in capsys.readouterr().err
