"""PLY files of Gaussians: layouts of gsplat and 3DGS, the way to 2D splats and back, and files of any origin."""

import numpy as np
import pytest

from gsvc_base.errors import GsvcError
from gsvc_tools.splat_files import from_gaussians, read_ply, to_gaussians, write_ply

NAMES = ("x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", *(f"scale_{i}" for i in range(3)))


def gaussians(count=5, **changes):
    rng = np.random.default_rng(0)
    columns = {name: rng.normal(size=count) for name in (*NAMES, *(f"rot_{i}" for i in range(4)))}
    return columns | {name: np.full(count, value) for name, value in changes.items()}


def some_splats(count=50):
    rng = np.random.default_rng(1)
    splats = rng.uniform(-1, 1, (count, 8)) * [40, 30, 0, 5, 0, 1.5, 1.5, 1.5]
    splats[:, [2, 4]] = rng.uniform(0.01, 20, (count, 2))
    return splats.astype(np.float32)


@pytest.mark.parametrize("units", [{}, {"pixels_per_unit": 30.0, "origin": (-0.5, 2.0)}])
def test_splats_come_back_from_a_file(tmp_path, units):
    splats = some_splats()
    write_ply(tmp_path / "a.ply", to_gaussians(splats, **units))
    again = from_gaussians(read_ply(tmp_path / "a.ply").columns, **units).parameters
    assert np.allclose(again, splats, rtol=2e-6, atol=5e-5)


def test_a_covariance_is_projected_as_by_its_definition():
    """Sigma = R S S^T R^T, of which the upper left 2 x 2 part is L L^T; colours are times the opacity."""
    columns = gaussians()
    parameters = from_gaussians(columns).parameters
    for n, (x, y, l11, l21, l22, *color) in enumerate(parameters):
        w, i, j, k = (columns[f"rot_{c}"][n] for c in range(4))
        i, j, k, w = np.array([i, j, k, w]) / np.sqrt(w * w + i * i + j * j + k * k)
        q = np.array([[w, -k, j], [k, w, -i], [-j, i, w]])
        R = q @ q + np.outer([i, j, k], [i, j, k])  # Euler and Rodrigues: v v^T + (w + [v]x)^2
        S = np.diag(np.exp([columns[f"scale_{c}"][n] for c in range(3)]))
        L = np.array([[l11, 0], [l21, l22]])
        assert np.allclose(L @ L.T, (R @ S @ S @ R.T)[:2, :2])
        assert (x, y) == (columns["x"][n], columns["y"][n])
        opacity = 1 / (1 + np.exp(-columns["opacity"][n]))
        base = [0.5 + 0.28209479177387814 * columns[f"f_dc_{c}"][n] for c in range(3)]
        assert np.allclose(color, np.array(base) * opacity)


def test_what_is_lost_is_said():
    columns = gaussians(f_rest_0=1, f_rest_1=0, nx=0, mine=2, f_dc_0=-9)
    said = " ".join(from_gaussians(columns).lost)
    for part in ("1 coefficients f_rest_*", "what hides what", "depth", "colours at 0", "unknown properties: mine"):
        assert part in said


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scale_1": np.nan}, "splat 0: scale_1 is nan"),
        ({"scale_1": 900.0}, "splat 0: its position or size"),
        ({"rot_0": 0, "rot_1": 0, "rot_2": 0, "rot_3": 0}, "splat 0: the quaternion"),
    ],
)
def test_numbers_that_are_none_are_named(changes, message):
    with pytest.raises(GsvcError, match=message):
        from_gaussians(gaussians(**changes))


@pytest.mark.parametrize("name", ["scale_1", "opacity"])
def test_a_missing_property_is_named(name):
    columns = gaussians()
    del columns[name]
    with pytest.raises(GsvcError, match=f"has no property {name}"):
        from_gaussians(columns)


def test_numbers_that_are_not_used_may_be_none():
    columns = gaussians()
    others = {"nx": np.nan, "z": np.inf, "f_rest_0": np.nan, "mine": np.nan}
    given = from_gaussians(gaussians(**others))
    assert np.array_equal(given.parameters, from_gaussians(columns).parameters)


HEADER = "ply\nformat binary_little_endian 1.0\ncomment made by hand\nelement vertex 2\n"


@pytest.mark.parametrize(
    ("text", "kind", "message"),
    [
        ("", "malformed", "does not begin with 'ply'"),
        ("ply\n", "malformed", "ends inside its header"),
        ("ply\nformat ascii 1.0\nend_header\n", "unsupported", "says 'format ascii 1.0'; write it as binary"),
        ("ply\nformat binary_big_endian 1.0\nend_header\n", "unsupported", "big_endian"),
        (HEADER + "property list uchar int x\nend_header\n", "unsupported", "says 'property list uchar int x'"),
        (HEADER + "property half x\nend_header\n", "unsupported", "says 'property half x'"),
        (HEADER + "property float x\nproperty float x\nend_header\n1234567812345678", "malformed", "the same name"),
        (HEADER + "property float x\nend_header\n1234567", "malformed", "2 vertices take 8 bytes, and 7 are left"),
        (
            HEADER + "property float x\nend_header\n123456789",
            "malformed",
            "after its 2 vertices: they take 8 bytes, and 9",
        ),
        (HEADER.replace(" 2", " -2") + "end_header\n", "unsupported", "element vertex -2"),
        (HEADER.replace(" 2", " 99999999999999") + "property float x\nend_header\n", "limit", "at most 4194304"),
        (HEADER.replace(" 2", " 9223372036854775808") + "end_header\n", "limit", "has 9223372036854775808 vertices"),
        (HEADER.replace(" 2", " " + "9" * 5000) + "end_header\n", "limit", f"has {'9' * 80} vertices"),
        (HEADER.replace("vertex", "face") + "end_header\n", "unsupported", "element face"),
        ("ply\nformat binary_little_endian 1.0\nend_header\n", "malformed", "no element 'vertex'"),
        (HEADER + "comment x\n" * 9000, "limit", "header of more than 65536 bytes"),
        (HEADER + "comment" + " x" * 90000, "limit", "header of more than 65536 bytes"),
        (HEADER + "comment" + " x" * 10000, "malformed", "ends inside its header"),
    ],
)
def test_hostile_headers_are_refused(tmp_path, text, kind, message):
    (tmp_path / "a.ply").write_bytes(text.encode())
    with pytest.raises(GsvcError, match=message) as caught:
        read_ply(tmp_path / "a.ply")
    assert caught.value.kind == kind


def test_a_file_of_31_gib_is_not_read(tmp_path):
    """Nearly all of it is a hole, and its size is what its header says."""
    properties = "".join(f"property double p{number}\n" for number in range(1000))
    header = HEADER.replace(" 2", " 4194304") + properties + "end_header\n"
    with (tmp_path / "a.ply").open("wb") as file:
        file.write(header.encode())
        file.truncate(len(header) + (4194304 * 8000))
    with pytest.raises(
        GsvcError, match="4194304 vertices with 1000 properties; at most 4194304 with 1000 in 1073741824"
    ):
        read_ply(tmp_path / "a.ply")


def test_other_types_and_what_follows_the_vertices(tmp_path):
    header = HEADER + "property double x\nproperty uchar red\nelement face 1\nproperty list uchar int i\nend_header\n"
    vertices = np.array([(1.5, 3), (2.5, 4)], [("x", "<f8"), ("red", "u1")]).tobytes()
    (tmp_path / "a.ply").write_bytes(header.encode() + vertices + b"\1\0\0\0\0")
    columns, lost = read_ply(tmp_path / "a.ply")
    assert lost == ["elements of PLY files that are not vertices: face"]
    assert columns["x"].tolist() == [1.5, 2.5]
    assert columns["red"].tolist() == [3, 4]
