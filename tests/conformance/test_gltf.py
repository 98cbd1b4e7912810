"""The glTF files of render vectors: a renderer that knows KHR_gaussian_splatting alone finds the expected pictures."""

import json
import subprocess
import sys

import numpy as np
import pytest

from gsvc_conformance.__main__ import main
from gsvc_conformance.gltf import EXTENSION, MAX_CHANGE, export, left_out, pictures, stored
from gsvc_conformance.making import make_vector

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


def render(home, width, height):
    """The sum of a file's splats in binary64: covariance in space, seen along z, opacity times weight times colour."""
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
        weight = np.exp(-(c * dx * dx - 2 * b * dx * dy + a * dy * dy) / determinant / 2)
        color = wide["SH_DEGREE_0_COEF_0"][n] * 0.28209479177387814 + 0.5
        picture += np.where(weight >= 1 / 255, wide["OPACITY"][n] * weight, 0)[..., None] * color
    return picture


def test_a_renderer_of_the_extension_finds_the_expected_pictures(exported, tmp_path):
    entries = json.loads((exported / "index.json").read_text())["pictures"]
    assert len(entries) > 40
    for entry in entries:
        picture = render(exported / entry["id"], entry["width"], entry["height"])
        if "bit_depth" in entry:
            kind = np.uint8 if entry["bit_depth"] == 8 else np.uint16
            picture = np.rint(np.clip(picture, 0, 1) * (2 ** entry["bit_depth"] - 1)).astype(kind)
        path = tmp_path / f"{entry['id']}.npy"
        path.parent.mkdir(parents=True, exist_ok=True)
        np.save(path, picture)
    words = [sys.executable, str(exported / "compare_pictures.py"), str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, f"{len(entries)} of {len(entries)} pictures are right\n")

    one = next(entry["id"] for entry in entries if not entry["needs"])
    picture = np.load(tmp_path / f"{one}.npy")
    np.save(tmp_path / f"{one}.npy", np.roll(picture, 1, axis=1))
    done = subprocess.run([*words, "--plain"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stdout.startswith(f"WRONG {one}: is ")


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
