"""`gsvc_ref.write` in profile `paper`: given splats become a stream that every decoder reads."""

from fractions import Fraction
from io import BytesIO, RawIOBase

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gsvc_ref
from gsvc_ref import spec
from gsvc_ref.metrics import psnr
from gsvc_ref.rendering import Renderer

W, H = 48, 32


def some_splats(count=40, seed=0):
    """Splats as a trainer may leave them, (N, 8) f4."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform((0, 0), (W, H), (count, 2))
    factors = np.stack([rng.uniform(0.5, 6, count), rng.uniform(-3, 3, count), rng.uniform(0.5, 6, count)], axis=1)
    return np.concatenate([positions, factors, rng.uniform(-0.2, 0.6, (count, 3))], axis=1).astype(np.float32)


def moved(splats, t):
    return splats + np.array([0.6 * t, -0.3 * t, 0, 0, 0, 0, 0, 0], np.float32)


def written(frames, width=W, height=H, *arguments, **options):
    file = BytesIO()
    options.setdefault("profile", "paper")
    report = gsvc_ref.write(file, frames, width, height, *arguments, **options)
    return report, file.getvalue()


def decoded(data):
    with gsvc_ref.open(data) as stream:
        return list(stream)


def types(report):
    return "".join(frame.type for frame in report.frames)


def number(low, high):
    return st.one_of(st.sampled_from([low, high]), st.floats(low, high, width=32))


@st.composite
def legal_frames(draw):
    """Frames of any splats that may be written, and the size of their frame."""
    width, height = draw(st.integers(1, 40)), draw(st.integers(1, 40))
    factors = st.one_of(st.floats(0.125, 64, width=32), number(2.0**-126, 2.0**40))
    skew = st.one_of(st.floats(-8, 8, width=32), number(-(2.0**40), 2.0**40))
    x, y = (st.one_of(st.floats(0, 40, width=32), number(-32000.0 * side, 32000.0 * side)) for side in (width, height))
    color = st.one_of(st.floats(-1, 1, width=32), number(-65504.0, 65504.0))
    rows = st.tuples(x, y, factors, skew, factors, color, color, color)
    frames = draw(st.lists(st.lists(rows, max_size=6), min_size=1, max_size=3))
    return [np.array(frame, np.float32).reshape(-1, 8) for frame in frames], width, height


@given(legal_frames(), st.sampled_from(["auto", (), 1, 2]), st.integers(1, 12), st.integers(1, 3), st.integers(1, 9))
@settings(max_examples=25, deadline=None)
def test_any_legal_splats_make_a_legal_stream(frames, key_frames, bits, stages, codewords):
    """The decoder inside spec.md reads it, and has the splats that gsvc_ref has."""
    splats, width, height = frames
    options = {"cholesky_bits": bits, "color_stages": stages, "color_codewords": codewords}
    report, data = written(splats, width, height, key_frames=key_frames, checksums=True, **options)
    plain = spec.reconstruct_stream(data)
    fast = gsvc_ref.reconstruct_stream(data)
    assert plain["parameters"].tobytes() == np.asarray(fast.parameters).tobytes()
    assert [frame.splats for frame in report.frames] == [len(frame) for frame in splats]


def test_differences_between_stages_may_exceed_what_a_codeword_holds():
    """Two opposite colours under one codeword leave a residual of twice the largest binary16."""
    rows = [
        [0, 0, 1, 0, 2.0**-126, -65504, 65504, 65504],
        [0, 0, 2.0**-126, 0, 2.0**-126, -65504, 65504, -16],
        [0, -32000, 2.0**-126, -(2.0**40), 2.0**-126, 0, 0, 0],
    ]
    options = {"cholesky_bits": 1, "color_stages": 2, "color_codewords": 2}
    for frames in ([rows], [[], rows], [rows, np.negative(rows) * [1, 1, -1, 1, -1, 1, 1, 1]]):
        report, _ = written([np.array(frame, np.float32).reshape(-1, 8) for frame in frames], 1, 1, **options)
        assert len(report.frames) == len(frames)


def test_an_i_frame_is_within_the_errors_of_its_quantisers():
    splats = some_splats(300)
    _, data = written([splats])
    frame = decoded(data)[0]
    error = np.abs(frame.splats.to_array() - splats)
    half = np.array([W / 2, H / 2])
    spacing = np.maximum(np.spacing(np.abs(splats[:, :2] / half - 1).astype(np.float16)).astype(np.float64), 2.0**-16)
    assert (error[:, :2] <= np.maximum(spacing / 2 * half, 1 / 64) * 1.001).all()
    assert (error[:, 2:5] <= frame.codes.intra.quantizer.scale * 0.51).all()
    assert error[:, 5:].max() < 0.02


def test_psnr_compares_with_the_splats_that_were_given():
    frames = [moved(some_splats(), t) for t in range(4)]
    report, data = written(frames)
    for told, splats, frame in zip(report.frames, frames, gsvc_ref.decode(data), strict=True):
        assert told.psnr == psnr(gsvc_ref.render_frame(splats, W, H, 8), frame, 255)
        assert told.psnr > 45


def test_rows_are_the_same_splats_where_there_are_as_many():
    frames = [moved(some_splats(), t) for t in range(6)]
    report, data = written(frames)
    assert types(report) == "IPPPPP"
    alone, _ = written(frames, key_frames=1)
    assert types(alone) == "IIIIII"
    assert report.file_bytes < 0.6 * alone.file_bytes
    for frame, splats in zip(decoded(data), frames, strict=True):
        assert np.abs(frame.splats.to_array() - splats)[:, :2].max() < 0.1


def test_equal_frames_are_repeated():
    splats = some_splats()
    report, data = written([splats, splats.copy(), splats, moved(splats, 1)])
    assert types(report) == "IRRP"
    assert [frame.reason for frame in report.frames][1:3] == ["equal to the frame before"] * 2
    assert len(decoded(data)) == 4


def test_equal_frames_are_not_rendered(monkeypatch):
    """A file of 300 bytes may hold a million of them."""
    rendered = []
    draw = Renderer.frame
    monkeypatch.setattr(Renderer, "frame", lambda *given: rendered.append(given) or draw(*given))
    reports = [gsvc_ref.write(BytesIO(), [np.zeros((0, 8))] * count, 16, 16, profile="paper") for count in (1, 40)]
    assert reports[1].frame_types == {"I": 1, "R": 39}
    assert {frame.psnr for frame in reports[1].frames} == {reports[0].frames[0].psnr}
    assert len(rendered) == 4  # of each first frame, what was given and what is decoded


def test_the_number_of_frames_is_known_from_a_list():
    told = []
    gsvc_ref.write(
        BytesIO(), [np.zeros((0, 8))] * 2, 16, 16, progress=lambda progress: told.append(progress.frame_count)
    )
    assert set(told) == {2}


def test_rows_that_are_others_make_an_i_frame():
    """With b = 4, differences are clamped where rows are other splats; so an I-frame is as small, and better."""
    frames = [some_splats(200, seed) for seed in range(3)]
    report, _ = written(frames, cholesky_bits=4)
    predicted, _ = written(frames, cholesky_bits=4, key_frames=())
    assert types(report) == "III"
    assert types(predicted) == "IPP"
    assert report.frames[1].psnr > predicted.frames[1].psnr + 3


def test_ids_tell_which_splats_stay():
    splats = some_splats(50)
    first, second = np.arange(100, 140), np.r_[np.arange(100, 150)[10:][::-1]]
    frames = [(splats[:40], first), (splats[10:][::-1], second)]
    report, data = written(frames, key_frames=())
    a, b = decoded(data)
    assert (a.type, b.type) == ("I", "P")
    assert report.frames[1].pruned_splats == 10
    assert report.frames[1].new_splats == 10
    assert b.codes.origins.tolist() == [*range(10, 40), *[-1] * 10]
    wanted = np.concatenate([splats[10:40], splats[40:][::-1]])
    assert np.abs(b.splats.to_array() - wanted)[:, :2].max() < 0.1


def test_without_ids_another_number_of_splats_makes_an_i_frame():
    report, _ = written([some_splats(9), some_splats(8)], key_frames=())
    assert types(report) == "II"
    assert report.frames[1].reason == "no splat of the frame before stays"


@pytest.mark.parametrize(("key_frames", "wanted"), [(2, "IPIPI"), ((0, 3), "IPPIP"), ((), "IPPPP")])
def test_key_frames_are_where_they_are_asked_for(key_frames, wanted):
    assert types(written([moved(some_splats(), t) for t in range(5)], key_frames=key_frames)[0]) == wanted


def test_frames_without_splats_are_black():
    report, data = written([np.empty((0, 8)), some_splats(3), np.empty((0, 8))])
    assert [frame.splats for frame in report.frames] == [0, 3, 0]
    assert [frame.any() for frame in gsvc_ref.decode(data)] == [False, True, False]


class Pipe(RawIOBase):
    """A target that never goes back."""

    def __init__(self):
        self.data = b""

    def writable(self):
        return True

    def seekable(self):
        return False

    def write(self, data):
        self.data += bytes(data)
        return len(data)


def test_the_level_is_the_least_that_fits_also_on_a_pipe():
    frames = [some_splats(5), some_splats(1 << 15)]
    report, data = written(frames, color_codewords=8)
    assert report.header.level == gsvc_ref.open(data).header.level == 2
    assert written(frames[:1])[0].header.level == 1
    pipe = Pipe()
    gsvc_ref.write(pipe, frames, W, H, color_codewords=8)
    assert pipe.data == data


def test_with_a_level_frames_are_written_as_they_come():
    pipe, sizes = Pipe(), []

    def frames():
        for t in range(3):
            sizes.append(len(pipe.data))
            yield moved(some_splats(), t)

    report = gsvc_ref.write(pipe, frames(), W, H, level=3)
    assert report.header.level == 3
    assert sizes[0] == 0 < sizes[1] < sizes[2] < len(pipe.data)
    assert len(decoded(pipe.data)) == 3


def test_what_the_caller_changes_later_does_not_matter():
    buffer = np.empty((40, 8), np.float32)

    def frames():
        for t in range(3):
            buffer[:] = moved(some_splats(), t)
            yield buffer

    assert written(frames())[1] == written([moved(some_splats(), t) for t in range(3)])[1]


def test_a_negative_factor_is_turned_left_out_or_refused():
    splats = some_splats(6)
    splats[1, 2] *= -1
    splats[2, 4] *= -1
    with pytest.raises(gsvc_ref.UsageError, match=r"frame 0, splat 1: l11 is -.*degenerate='turn'.*'remove'"):
        written([splats])
    report, data = written([splats], degenerate="turn")
    assert report.notes == ["the signs of 2 splats were turned so that l11 and l22 are above 0"]
    L = decoded(data)[0].splats.cholesky
    assert np.allclose(L[1], [-splats[1, 2], -splats[1, 3], splats[1, 4]], atol=0.01)
    assert np.allclose(L[2], [splats[2, 2], splats[2, 3], -splats[2, 4]], atol=0.01)
    report, data = written([splats, splats], degenerate="remove", key_frames=())
    assert report.notes == ["4 splats that cover nothing were left out"]
    assert [len(frame.splats) for frame in decoded(data)] == [4, 4]
    assert types(report) == "IR"
    splats[3, 2] = 0
    with pytest.raises(gsvc_ref.UsageError, match=r"splat 3: l11 is 0.0; .* a zero has no sign"):
        written([splats], degenerate="turn")


def changed(row, column, value):
    splats = some_splats(5)
    splats[row, column] = value
    return [splats]


@pytest.mark.parametrize(
    ("frames", "options", "message"),
    [
        (changed(2, 0, np.nan), {}, "frame 0, splat 2: x is nan; it must be a number from -1572072 to 1572120"),
        (changed(2, 1, 1e9), {}, "frame 0, splat 2: y is 1000000000.0; it must be a number from -1048048"),
        (changed(0, 3, -np.inf), {}, "splat 0: l21 is -inf"),
        (changed(0, 4, 2e12), {}, r"splat 0: l22 is 1999999991808.0; it must be a number from -1.09951163e\+12 to"),
        (changed(4, 7, 65600), {}, "splat 4: B is 65600.0; it must be a number from -65504 to 65504"),
        ([np.zeros((3, 7))], {}, r"frame 0: the array has shape \(3, 7\); it must be \(N, 8\)"),
        ([None], {}, "frame 0: the splats cannot be of type NoneType"),
        (some_splats(), {}, "the frames are one ndarray; give an iterable"),
        ([], {}, "there are no frames; give the splats of at least one"),
        ([(some_splats(3), [1, 2])], {}, r"the ids are int64 of shape \(2,\); they must be integers, \(3,\)"),
        ([(some_splats(3), [1, 2, 2])], {}, "two splats have the same id"),
        ([some_splats(1 << 15)], {"level": 1}, "frame 0 has 32768 splats; level 1 allows 16384 .R-5-2."),
        ([some_splats()], {"level": 6}, "level is 6"),
        ([some_splats()], {"bit_depth": 7}, "bit_depth is 7"),
        ([some_splats()], {"cholesky_bits": 13}, "cholesky_bits is 13"),
        ([some_splats()], {"degenerate": "x"}, "degenerate is 'x'"),
        ([some_splats()], {"key_frames": "x"}, "key_frames is 'x'"),
        ([some_splats()], {"frame_rate": 0}, "frame_rate is 0"),
    ],
)
def test_what_cannot_be_written_is_refused_with_what_is_allowed(frames, options, message):
    with pytest.raises(gsvc_ref.UsageError, match=message):
        written(frames, W, H, **options)


def test_a_size_in_one_argument_is_refused():
    with pytest.raises(gsvc_ref.UsageError, match="there is no height; give width and height as two numbers"):
        gsvc_ref.write(BytesIO(), [some_splats()], (W, H))


def test_rendering_work_beyond_the_level_is_refused_before_anything_is_rendered():
    large = np.tile(some_splats(1) * np.float32([1, 1, 99, 1, 99, 1, 1, 1]), (1 << 14, 1))
    with pytest.raises(gsvc_ref.UsageError, match=r"frame 0 has 67108864 pairs .* level 1 allows 33554432 \(R-5-4\)"):
        written([large], 64, 64, level=1)


def test_a_fault_in_a_later_frame_leaves_the_frames_before_it(tmp_path):
    path = tmp_path / "a.gsvc"
    with pytest.raises(gsvc_ref.IncompleteEncodeError, match=r"frame 1, splat 2: x is nan.*saved: 1 complete frame"):
        gsvc_ref.write(path, [some_splats(5), *changed(2, 0, np.nan)], W, H)
    assert len(decoded(path.read_bytes())) == 1

    def failing():
        yield some_splats()
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine") as caught:
        gsvc_ref.write(path, failing(), W, H)
    assert caught.value.__notes__ == ["gsvc_ref.write saved: 1 complete frame, as a valid stream"]


def test_nothing_stands_in_the_place_of_a_stream_that_has_no_frame(tmp_path):
    with pytest.raises(gsvc_ref.UsageError):
        gsvc_ref.write(tmp_path / "a.gsvc", [None], W, H)
    assert list(tmp_path.iterdir()) == []


def test_the_frame_rate_is_taken_as_it_is_written():
    for rate, wanted in ((25, 25), (29.97, Fraction(2997, 100)), ("30000/1001", Fraction(30000, 1001))):
        assert written([some_splats(2)], W, H, rate)[0].header.frame_rate == wanted


def test_a_decoded_stream_can_be_written_again():
    frames = [moved(some_splats(), t) for t in range(3)]
    _, data = written(frames)
    report, again = written((frame.splats for frame in decoded(data)), key_frames=())
    assert types(report) == "IPP"
    for a, b in zip(gsvc_ref.decode(data), gsvc_ref.decode(again), strict=True):
        assert psnr(a, b, 255) > 45
