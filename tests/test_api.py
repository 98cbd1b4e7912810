"""The few public names: all there, loaded only when used, and the ways of the docstring work."""

import copy
import inspect
import pickle
import re
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest

import gsvc_ref
from gsvc_ref.video import ColorDescription, VideoFormat, open_writer

FORMAT = VideoFormat(20, 12, Fraction(25), 8, "444", ColorDescription(1, 1, 1, False, 0))
FRAMES = [np.random.default_rng(t // 2).integers(0, 256, (12, 20, 3), np.uint8) for t in range(4)]
SETTINGS = {"splats": 6}

LAZY = """
import sys
import gsvc_ref
assert not {"numba", "scipy", "skimage", "numpy", "gsvc_ref.encoder"} & set(sys.modules), "loaded too early"
assert set(gsvc_ref.__all__) <= set(dir(gsvc_ref))
gsvc_ref.GsvcError, gsvc_ref.UsageError
assert "numba" not in sys.modules
gsvc_ref.Settings.quick()
import gsvc_ref.rendering
assert callable(gsvc_ref.render) and callable(gsvc_ref.render_exact_with_bound)
print(gsvc_ref.__version__)
"""


def test_every_public_name_is_there():
    assert gsvc_ref.__all__ == sorted(gsvc_ref.__all__)
    for name in gsvc_ref.__all__:
        assert getattr(gsvc_ref, name) is getattr(gsvc_ref, name)
        assert getattr(gsvc_ref, name).__doc__
        assert name in dir(gsvc_ref)
    expected = {"encode", "decode", "Settings", "Splats", "render", "render_gradients", "open", "GsvcError"}
    assert expected <= set(gsvc_ref.__all__)


def test_public_functions_document_their_arguments_and_their_results():
    functions = {name: inspect.unwrap(getattr(gsvc_ref, name)) for name in gsvc_ref.__all__}
    for name, function in functions.items():
        if inspect.isfunction(function):
            parts = re.split(r"^(\w+)\n-+\n", inspect.getdoc(function), flags=re.MULTILINE)
            sections = dict(zip(parts[1::2], parts[2::2], strict=True))
            lines = re.findall(r"^\w.*$", sections["Parameters"], re.MULTILINE)
            documented = {argument for line in lines for argument in line.split(", ")}
            assert documented == {*inspect.signature(function).parameters}, name
            assert sections.keys() & {"Returns", "Yields"}, name


def test_the_parts_that_the_docstring_names_are_attributes():
    parts = re.findall(r"`(\w+)`", gsvc_ref.__doc__.split("spec.md says")[1].split("The operations")[0])
    code = f"import gsvc_ref; [print(getattr(gsvc_ref, name)) for name in {parts}]"
    assert {"spec", "bitstream", "rendering", "plugins"} <= set(parts)
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


def test_there_is_no_other_name():
    with pytest.raises(AttributeError, match="nonsense"):
        gsvc_ref.nonsense  # noqa: B018
    with pytest.raises(ImportError):
        from gsvc_ref import nonsense  # noqa: F401


def test_nothing_is_loaded_before_it_is_used():
    made = subprocess.run([sys.executable, "-c", LAZY], capture_output=True, text=True, timeout=60)
    assert made.stderr == ""
    assert made.stdout.strip() == gsvc_ref.__version__


def test_the_names_belong_together():
    from gsvc_ref.encoder import Settings
    from gsvc_ref.rendering import render
    from gsvc_ref.stream import Stream

    assert gsvc_ref.open is Stream
    assert gsvc_ref.Settings is Settings
    assert gsvc_ref.render is render
    assert issubclass(gsvc_ref.UsageError, ValueError)
    assert not issubclass(gsvc_ref.GsvcError, ValueError)


def test_from_file_to_file_and_back(tmp_path):
    source, target = tmp_path / "clip.y4m", tmp_path / "clip.gsvc"
    with open_writer(source, FORMAT) as writer:
        for frame in FRAMES:
            writer.write(frame)
    report = gsvc_ref.encode(str(source), str(target), gsvc_ref.Settings.quick(**SETTINGS))
    assert report.file_bytes == target.stat().st_size
    assert [frame.type for frame in report.frames][::2] in (["I", "P"], ["I", "I"])
    assert [frame.type for frame in report.frames][1::2] == ["R", "R"]
    frames = list(gsvc_ref.decode(target))
    with gsvc_ref.open(target) as stream:
        assert stream.format.chroma_format == "444"
        for decoded, frame in zip(stream.frames(1, 3), frames[1:3], strict=True):
            splats = decoded.splats
            assert splats.positions.shape == (report.frames[decoded.number].splats, 2)
            assert sum(decoded.bits.values()) == 8 * decoded.size
            picture = gsvc_ref.render(splats, 20, 12)
            assert np.array_equal(np.rint(picture * np.float32(255)), frame)


def test_a_missing_stream_is_a_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        gsvc_ref.open(tmp_path / "none.gsvc")
    with pytest.raises(FileNotFoundError):
        next(gsvc_ref.decode(tmp_path / "none.gsvc"))
    with pytest.raises(FileNotFoundError):
        gsvc_ref.encode(tmp_path / "none.y4m", tmp_path / "none.gsvc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("data", [b"", b"YUV4MPEG2 W2 H2\n", b"\x89GSVC\r\n"])
def test_what_is_no_stream_is_told(data):
    with pytest.raises(gsvc_ref.GsvcError) as caught:
        gsvc_ref.open(data)
    assert caught.value.kind == "malformed"
    assert caught.value.rule == "R-6.1-1"
    assert "malformed" in str(caught.value)


def test_gradients_point_downhill():
    rng = np.random.default_rng(0)
    target = rng.random((12, 20, 3), np.float32)
    start = [[10, 6, 4, 0, 4, 0.5, 0.5, 0.5]]
    splats = gsvc_ref.Splats.from_array(start)
    residual = 2 * (gsvc_ref.render(splats, 20, 12) - target)
    gradient = gsvc_ref.render_gradients(splats, residual)
    lower = gsvc_ref.Splats.from_array(splats.to_array() - 1e-4 * gradient)
    losses = [np.square(gsvc_ref.render(s, 20, 12) - target).sum() for s in (splats, lower)]
    assert losses[1] < losses[0]


def test_errors_survive_another_process():
    error = gsvc_ref.GsvcError("malformed", "why", rule="R-6.2-2", bit=12)
    for made in (pickle.loads(pickle.dumps(error)), copy.copy(error), copy.deepcopy(error)):
        assert (type(made), str(made)) == (gsvc_ref.GsvcError, str(error))
        assert (made.kind, made.rule, made.bit) == ("malformed", "R-6.2-2", 12)
