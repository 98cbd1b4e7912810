"""Arguments of a wrong type are refused by name at every public function, not by an error from inside."""

import re
from dataclasses import replace

import numpy as np
import pytest

import gsvc_ref
from gsvc_base.checks import door
from gsvc_conformance.pairs import PAIRS, Twin
from gsvc_conformance.vector import VECTORS, read
from gsvc_ref.metrics import ms_ssim, psnr
from gsvc_ref.video import encode_png, open_writer, to_planes
from gsvc_ref.video.format import array_format

WRONG = (None, "text", object(), {}, np.array(["a"]), np.array([None, None]))
SPLATS = np.array([[5, 5, 2, 0, 2, 0.5, 0.5, 0.5]])


def vector_of(name):
    homes = (VECTORS / tier / name for tier in ("core", "uncommon"))
    return read(next(home for tier in homes if tier.exists() for home in sorted(tier.iterdir())))


@pytest.mark.parametrize("name", [name for name, pair in PAIRS.items() if isinstance(pair, Twin)])
def test_operations_refuse_arguments_of_a_wrong_type(name):
    """NumPy reads None as NaN and anything as a truth value, so that some are taken; none fails from inside."""
    function, inputs = getattr(gsvc_ref, name), vector_of(name).inputs
    refused = 0
    for argument in inputs:
        for wrong in WRONG:
            try:
                with np.errstate(all="ignore"):
                    function(**{**inputs, argument: wrong})
            except (gsvc_ref.UsageError, gsvc_ref.GsvcError, FileNotFoundError):
                refused += 1
    assert refused >= len(inputs)


@pytest.mark.parametrize("name", [name for name, pair in PAIRS.items() if isinstance(pair, Twin)])
def test_operations_refuse_masked_arrays(name):
    function, inputs = getattr(gsvc_ref, name), vector_of(name).inputs
    for argument, value in inputs.items():
        if isinstance(value, np.ndarray):
            for masked in (np.ma.array(value), [np.ma.array(value)]):
                with pytest.raises(gsvc_ref.UsageError, match=f"{argument} cannot be a masked array"):
                    function(**{**inputs, argument: masked})


@pytest.mark.parametrize(
    "call",
    [
        lambda frame, path: gsvc_ref.encode(np.ma.array([frame, frame]), path),
        lambda frame, path: gsvc_ref.encode(([np.ma.array(frame)], array_format(8, 8, 25, 8)), path),
        lambda frame, path: gsvc_ref.write(path, [np.ma.array(SPLATS)], 8, 8),
        lambda frame, path: gsvc_ref.render(np.ma.array(SPLATS), 8, 8),
        lambda frame, path: gsvc_ref.Splats(np.ma.array(SPLATS[:, :2]), SPLATS[:, 2:5], SPLATS[:, 5:]),
        lambda frame, path: gsvc_ref.scale_parameters(np.ma.array(SPLATS), 8, 8, 4, 4),
        lambda frame, path: psnr(frame, np.ma.array(frame), 255),
        lambda frame, path: ms_ssim(np.ma.array(frame), frame, 255),
        lambda frame, path: to_planes(np.ma.array(frame), replace(array_format(8, 8, 25, 8), chroma_format="444")),
        lambda frame, path: open_writer(path, array_format(8, 8, 25, 8)).write(np.ma.array(frame)),
        lambda frame, path: encode_png(np.ma.array(frame)),
    ],
)
def test_no_door_takes_a_masked_array(call, tmp_path):
    with pytest.raises(gsvc_ref.UsageError, match="a masked array, whose mask would be lost"):
        call(np.zeros((8, 8, 3), np.uint8), tmp_path / "out.png")


@pytest.mark.parametrize("kind", [object, bool, complex, str, "M8[s]", np.int16, ">u2", float])
def test_frames_of_another_type_are_refused_with_it(kind, tmp_path):
    frames = np.zeros((1, 8, 8, 3), np.uint8).astype(kind)
    with pytest.raises(gsvc_ref.UsageError, match=rf"frame 0 is .*{re.escape(str(frames.dtype))}.*uint8"):
        gsvc_ref.encode(frames, tmp_path / "out.gsvc")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: gsvc_ref.render(None, 8, 8),
            r"the splats cannot be of type NoneType; give Splats or an array \(N, 8\)",
        ),
        (lambda: gsvc_ref.render([[1, 2], [3]], 8, 8), "cannot be of type list"),
        (lambda: gsvc_ref.render(SPLATS + 1j, 8, 8), "cannot be of type ndarray of complex128"),
        (lambda: gsvc_ref.render(SPLATS[:, :7], 8, 8), r"shape \(1, 7\); it must be \(N, 8\)"),
        (lambda: gsvc_ref.render(SPLATS, 8.5, 8), "width is 8.5; it must be a whole number"),
        (lambda: gsvc_ref.render(SPLATS, 8, "8"), "height is '8'; it must be a whole number"),
        (lambda: gsvc_ref.render_exact_with_bound("a", 8, 8), "the splats cannot be of type str"),
        (lambda: gsvc_ref.Splats("a", "b", "c"), r"Splats.positions cannot be of type str; give an array \(N, 2\)"),
        (lambda: gsvc_ref.open(5), "a int is not a source"),
        (lambda: next(gsvc_ref.decode(None)), "a NoneType is not a source"),
        (lambda: gsvc_ref.concat(None, "x"), "give a list of one stream or more"),
        (lambda: gsvc_ref.lsq_quantize(SPLATS, SPLATS[0], SPLATS[0], "6"), "bits is '6'; it must be a whole number"),
    ],
)
def test_the_sentence_names_the_argument(call, message):
    with pytest.raises(gsvc_ref.UsageError, match=message):
        call()


def test_render_takes_an_array():
    splats = gsvc_ref.Splats.from_array(SPLATS)
    assert np.array_equal(gsvc_ref.render(SPLATS, 8, 8), gsvc_ref.render(splats, 8, 8))
    assert np.array_equal(*(gsvc_ref.render_exact_with_bound(s, 8, 8)[1] for s in (SPLATS, splats)))


def test_a_fault_of_the_function_itself_passes_a_door():
    @door
    def faulty(x: int) -> int:
        return x + None  # type: ignore[operator]

    with pytest.raises(TypeError, match="unsupported operand"):
        faulty(1)
    with pytest.raises(gsvc_ref.UsageError, match="x is 'a'; it must be a whole number"):
        faulty("a")
    with pytest.raises(TypeError, match="missing"):
        faulty()
