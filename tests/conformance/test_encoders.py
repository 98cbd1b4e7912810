"""Encoders are judged by what their streams decode to: wrong ones are found, by a named vector; plain ones pass."""

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from gsvc_conformance.case import cases
from gsvc_conformance.cases.encoder import CLIPS, MARGIN
from gsvc_conformance.commands.judging import Causes
from gsvc_conformance.encoding import MAX_BYTES, Decoding, judge, psnr, rendered, worst_frame
from gsvc_conformance.expectations import Rate
from gsvc_conformance.implementations import ModuleImplementation
from gsvc_conformance.level import level_of
from gsvc_conformance.mutants import MUTANTS, called, killed_by
from gsvc_conformance.operation import Values, operations
from gsvc_conformance.pairs import PAIRS, Free
from gsvc_conformance.process import ProcessImplementation
from gsvc_conformance.report.kept import keep_files
from gsvc_conformance.report.pictures import view_of
from gsvc_conformance.runner import judge_vector
from gsvc_conformance.vector import Vector, files_of, from_files
from gsvc_ref import Settings, Splats
from gsvc_ref.encoder import paper, setup
from gsvc_ref.metrics import psnr as fast_psnr

Inputs = dict[str, Any]
Encoder = Callable[..., Values]

plain: Encoder = operations()["encode_video"].reference
CASES = {case.id.split("/")[2]: case for case in cases().values() if case.operation.name == "encode_video"}


def vector(name: str) -> Vector:
    case = CASES[name]
    return from_files(files_of(case, *case.run()))


def judged(encoder: Encoder, name: str) -> Any:
    """The result of an encoder on a vector."""
    return judge_vector(ModuleImplementation("mine", {"encode_video": encoder}), vector(name)).result


@contextmanager
def settings(**changes: Any) -> Iterator[None]:
    """gsvc_ref's quick preset with other settings."""
    quick = Settings.quick
    with patch.object(Settings, "quick", lambda **given: quick(**(given | changes))):
        yield


# Wrong encoders


def changed(change: Callable[[Any], Any]) -> Encoder:
    """An encoder that gets other frames than it should encode."""
    return lambda **inputs: plain(**inputs | {"frames": np.ascontiguousarray(change(inputs["frames"]))})


def asked(**others: Any) -> Encoder:
    """An encoder that does something else than it is asked for."""
    return lambda **inputs: plain(**inputs | others)


def half_a_pixel_left(frames: Any) -> Any:
    wide = frames.astype(np.int64)
    return ((wide + np.roll(wide, -1, axis=2)) // 2).astype(frames.dtype)


def without_chroma(frames: Any) -> Any:
    return np.repeat(frames.mean(axis=3, keepdims=True).round().astype(frames.dtype), 3, axis=3)


def in_limited_range(frames: Any) -> Any:
    return np.rint(16 + frames * (219 / 255)).astype(frames.dtype)


def padded(frames: Any) -> Any:
    height, width = (-side % 8 for side in frames.shape[1:3])
    return np.pad(frames, ((0, 0), (0, height), (0, width), (0, 0)), mode="edge")


def open_loop(**inputs: Any) -> Values:
    """It predicts from splats that are not quantised, which no decoder has."""
    work, encoder = paper._PaperFrame, paper.FrameEncoder
    quantize, encode = work._fine_tuned, encoder.encode

    def kept(self: Any, population: Any, *rest: Any) -> Any:
        self.encoder.unquantized = population.parameters().copy()
        return quantize(self, population, *rest)

    def forgetful(self: Any, *given: Any) -> Any:
        result = encode(self, *given)
        if result.codes.type != "R":
            self.state = replace(result.state, splats=Splats.from_array(self.unquantized))
        return result

    with patch.object(work, "_fine_tuned", kept), patch.object(encoder, "encode", forgetful):
        return plain(**inputs)


def from_the_i_frame(**inputs: Any) -> Values:
    """It predicts each P-frame from the I-frame in place of the frame before."""
    encoder = paper.FrameEncoder
    encode = encoder.encode

    def stuck(self: Any, frame: Any, frame_type: str, *rest: Any) -> Any:
        before = self.state
        result = encode(self, frame, frame_type, *rest)
        if frame_type != "I":
            self.state = before
        return result

    with patch.object(encoder, "encode", stuck):
        return plain(**inputs)


def of_a_high_level(**inputs: Any) -> Values:
    with patch.object(setup, "level_for", lambda *args, **options: 2):
        return plain(**{**inputs, "level": 2})


def without_key_frames(**inputs: Any) -> Values:
    with settings(key_frames=1000):
        return plain(**inputs)


def cut_short(**inputs: Any) -> Values:
    outputs = plain(**inputs)
    stream = outputs["stream"][:-20]
    return {"stream": stream, "bits": np.array(8 * len(stream))}


def damaged(**inputs: Any) -> Values:
    outputs = plain(**inputs)
    middle = len(outputs["stream"]) // 2
    stream = bytearray(outputs["stream"])
    stream[middle] ^= 1
    return {**outputs, "stream": bytes(stream)}


def without_headers_in_its_rate(**inputs: Any) -> Values:
    outputs = plain(**inputs)
    return {**outputs, "bits": outputs["bits"] - 8 * 64}


SHORT = "short of the floor"

WRONG: dict[str, tuple[Encoder, str, str]] = {
    "open loop": (open_loop, "long_fade", SHORT),
    "predicts from the I-frame": (from_the_i_frame, "pan", SHORT),
    "source frame 0 for all": (changed(lambda f: np.repeat(f[:1], len(f), 0)), "pan", SHORT),
    "no chroma": (changed(without_chroma), "cut", SHORT),
    "blue for red": (changed(lambda f: f[..., ::-1]), "cut", SHORT),
    "half a pixel": (changed(half_a_pixel_left), "spots", SHORT),
    "limited range": (changed(in_limited_range), "flat_colour", SHORT),
    "upside down": (changed(lambda f: f[:, ::-1]), "one_frame", SHORT),
    "padded": (changed(padded), "odd_size", "has width 40; it must be 33"),
    "too many splats": (asked(splats=60), "one_frame", "has 60 splats in frame 0; at most 48 were asked for"),
    "level": (of_a_high_level, "one_frame", "states level 2; at most 1 was asked for"),
    "no I-frames": (without_key_frames, "random_access", "has no I-frame at frame 3, 3 frames after the last one"),
    "frame rate": (asked(frame_rate_numerator=30, frame_rate_denominator=1), "odd_size",
                   "has 30/1 frames per second; they must be 30000/1001"),
    "8 bits of 10": (lambda **i: plain(**i | {"frames": (i["frames"] >> 2).astype(np.uint8), "bit_depth": 8}),
                     "ten_bits", "has bit_depth 8; it must be 10"),
    "a frame less": (changed(lambda f: f[:-1]), "still_picture", "has 2 of 3 frames"),
    "a frame more": (changed(lambda f: np.concatenate([f, f[-1:]])), "still_picture", "has more than 3 frames"),
    "cut short": (cut_short, "noise", r"is not legal: malformed by R-6\.2-\d at bit \d+ \(\w+.*\), behind"),
    "damaged": (damaged, "noise", r"is not legal: malformed by R-6\.2-2 at bit \d+ \(chunk_crc\), behind"),
    "rate without headers": (without_headers_in_its_rate, "one_pixel", r"output bits is \d+, expected \d+: the file"),
    "no bytes": (lambda **i: {"stream": np.zeros(3), "bits": np.array(0)}, "one_pixel", "stream is ndarray, not bytes"),
    "too large": (lambda **i: {"stream": bytes(MAX_BYTES + 1), "bits": np.array(0)}, "one_pixel", "at most 4194304"),
}  # fmt: skip
LONG = {"upside down", "open loop", "predicts from the I-frame", "source frame 0 for all", "no chroma", "blue for red"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.exhaustive) if name in LONG else name for name in WRONG]
)
def test_a_wrong_encoder_is_found(name):
    """Where the fault is not in the pictures, a fit that is cut short will do."""
    encoder, where, words = WRONG[name]
    with settings(precision="fast", **({} if words == SHORT else {"iterations": 5})):
        result = judged(encoder, where)
    assert result.outcome == "fail", (result.outcome, result.message)
    if words == SHORT:
        floor = CASES[where].arguments["value"].floor
        words = rf"output stream has a PSNR of \d+\.\d\d dB in frame \d+, which must have {floor:g} dB "
        assert result.ratio > 1
    assert re.search(words, result.message), result.message


# Right encoders


@pytest.mark.parametrize("name", ["spots", "black", "one_pixel"])
def test_the_reference_passes(name):
    result = judged(plain, name)
    assert result.outcome == "pass", result.message
    assert result.ratio <= 1


@pytest.mark.exhaustive
@pytest.mark.parametrize("clip", CLIPS, ids=lambda clip: clip.draw.__name__)
def test_a_third_of_the_iterations_is_enough(clip):
    with settings(iterations=50):
        result = judged(plain, clip.draw.__name__)
    assert result.outcome == "pass", result.message


@pytest.mark.exhaustive
@pytest.mark.parametrize("clip", CLIPS, ids=lambda clip: clip.draw.__name__)
def test_the_reference_is_as_good_as_the_manifests_say(clip):
    """Better is well, as they were written down once; half a decibel less is not."""
    inputs = clip.inputs()
    decoding = Decoding(plain(**inputs)["stream"])
    frames = [rendered(frame, decoding.header) for frame in decoding.frames()]
    worst = min(psnr(a, b, clip.bit_depth) for a, b in zip(frames, inputs["frames"], strict=True))
    assert worst >= clip.reference - 0.5


def test_floors_leave_the_margin_and_are_reached():
    for clip in CLIPS:
        assert clip.floor <= clip.reference - MARGIN
        assert clip.floor > 0
        assert f"{clip.splats} splats" in CASES[clip.draw.__name__].reason


# The judgement itself


def test_psnr_is_that_of_the_metrics():
    rng = np.random.default_rng(3)
    for bit_depth in (8, 10):
        a, b = rng.integers(0, 2**bit_depth, (2, 5, 7, 3)).astype(np.uint16)
        assert psnr(a, b, bit_depth) == pytest.approx(fast_psnr(a, b, 2**bit_depth - 1), abs=1e-9)
        assert psnr(a, a, bit_depth) == np.inf


def test_equal_frame_rates_may_be_written_differently():
    with settings(precision="fast"):
        outputs = plain(**vector("one_pixel").inputs)
    task = vector("one_pixel").expected["stream"].task
    assert judge(outputs["stream"], replace(task, frame_rate_numerator=50, frame_rate_denominator=2)).message == ""
    assert "frames per second" in judge(outputs["stream"], replace(task, frame_rate_numerator=50)).message


def test_a_rate_needs_its_stream():
    assert not Rate().judge(np.array(0)).passed
    assert not Rate().beside({"stream": b"abc"}).judge(np.array(24.0)).passed
    assert Rate().beside({"stream": b"abc"}).judge(np.array(24)).passed


def test_the_level_of_a_task_is_that_of_its_frames_and_splats():
    operation = operations()["encode_video"]
    inputs = vector("one_frame").inputs
    assert level_of(operation, inputs) == 1
    assert level_of(operation, inputs | {"splats": 2**14 + 1}) == 2
    assert level_of(operation, inputs | {"frames": np.zeros((1, 1024, 1025, 3), np.uint8)}) == 3


# Commands and diagnosis

PROGRAM = """\
import sys
from pathlib import Path
import numpy as np
operation, source, target = sys.argv[1:]
if operation != "encode_video":
    raise SystemExit(77)
frames = np.load(Path(source, "frames.npy"))
stream = Path(__file__).with_name("answer.gsvc").read_bytes()
if frames.shape == (2, 1, 1, 3):
    Path(target, "stream.gsvc").write_bytes(stream)
    np.save(Path(target, "bits.npy"), np.array(8 * len(stream)))
"""


def test_a_command_writes_its_stream_to_a_file(tmp_path):
    given = vector("one_pixel")
    (tmp_path / "answer.gsvc").write_bytes(plain(**given.inputs)["stream"])
    (tmp_path / "encoder.py").write_text(PROGRAM)
    command = ProcessImplementation(f"{sys.executable} {tmp_path / 'encoder.py'}", 60)
    assert judge_vector(command, given).result.outcome == "pass"
    missing = judge_vector(command, vector("noise")).result
    assert (missing.outcome, missing.message) == ("error", "exit status 0, but there is no stream.gsvc")


def test_what_is_wrong_is_kept_and_needs_no_cause(tmp_path):
    implementation = ModuleImplementation("mine", {"encode_video": damaged})
    wrong = judge_vector(implementation, vector("one_pixel"))
    keep_files(tmp_path, wrong)
    home = tmp_path / "stress/encode_video/one_pixel"
    assert (home / "out/stream.gsvc").read_bytes() == wrong.outputs["stream"]
    assert (home / "in/frames.npy").is_file()
    causes = Causes()
    causes.add(wrong)
    assert causes.find([wrong.result])[0] == [wrong.result]


def test_pictures_show_the_worst_frame():
    given = vector("flat_colour")
    with settings(precision="fast", iterations=5):
        wrong = judge_vector(ModuleImplementation("mine", {"encode_video": changed(in_limited_range)}), given)
    pictures = view_of(given, wrong.outputs, wrong.result)
    captions = [picture.caption for picture in pictures]
    assert captions == [
        "source (frame 0)",
        "decoded (frame 0)",
        "error / root mean squared error that the floor allows",
    ]
    assert worst_frame(b"no stream", given.expected["stream"].task) is None


def test_of_a_free_operation_spec_md_says_why_it_has_no_code():
    free = [name for name, pair in PAIRS.items() if isinstance(pair, Free)]
    assert free == ["encode_video"]
    assert called(operations()["encode_video"], {}) == frozenset()
    assert killed_by([vector("one_pixel")], MUTANTS) == {"stress/encode_video/one_pixel": []}
