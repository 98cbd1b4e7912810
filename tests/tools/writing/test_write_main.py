"""`gsvc_ref.write` in profile `main`: given splats come back as near as was asked for, in few bits."""

from io import BytesIO

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gsvc_ref
from gsvc_ref import spec
from gsvc_ref.encoder.main.coordinates import to_parameters
from gsvc_ref.encoder.main.differences import anchors_of
from gsvc_ref.main.reconstruct import add_differences
from gsvc_ref.main.state import parameters_of
from gsvc_ref.metrics import psnr
from gsvc_tools.writing.main_codes import codable, motion_fields, nearest_differences

W, H = 48, 32


def some_splats(count=40, seed=0, width=W, height=H):
    """Splats as a trainer may leave them, (N, 8) f4."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform((0, 0), (width, height), (count, 2))
    factors = np.stack([rng.uniform(0.5, 6, count), rng.uniform(-3, 3, count), rng.uniform(0.5, 6, count)], axis=1)
    return np.concatenate([positions, factors, rng.uniform(-0.2, 0.6, (count, 3))], axis=1).astype(np.float32)


def written(frames, width=W, height=H, **options):
    file = BytesIO()
    report = gsvc_ref.write(file, frames, width, height, profile="main", **options)
    return report, file.getvalue()


def decoded(data):
    with gsvc_ref.open(data) as stream:
        return list(stream)


def types(report):
    return "".join(frame.type for frame in report.frames)


def psnr_of_frames(frames, data, width=W, height=H):
    """PSNR of each decoded frame against the picture of the splats given, of their arrays alone."""
    return [
        psnr(gsvc_ref.render_frame(splats, width, height, 8), frame, 255)
        for splats, frame in zip(frames, gsvc_ref.decode(data), strict=True)
    ]


def number(low, high):
    return st.one_of(st.sampled_from([low, high]), st.floats(low, high, width=32))


@st.composite
def legal_frames(draw):
    """Frames of any splats that may be written, and the size of their frame."""
    width, height = draw(st.integers(1, 40)), draw(st.integers(1, 40))
    factors = st.one_of(st.floats(0.125, 64, width=32), number(2.0**-126, 2.0**40))
    skew = st.one_of(st.floats(-8, 8, width=32), number(-(2.0**40), 2.0**40))
    place = st.one_of(st.floats(-9, 49, width=32), number(-65535.0, 65535.0))
    color = st.one_of(st.floats(-1, 1, width=32), st.just(0.0), number(-4.0, 4.0))
    rows = st.tuples(place, place, factors, skew, factors, color, color, color)
    frames = draw(st.lists(st.lists(rows, max_size=6), min_size=1, max_size=3))
    return [np.array(frame, np.float32).reshape(-1, 8) for frame in frames], width, height


@given(legal_frames(), st.sampled_from(["auto", (), 1]), st.integers(0, 79), st.sampled_from(["all", "colors", "none"]))
@settings(max_examples=25, deadline=None)
def test_any_legal_splats_make_a_legal_stream(frames, key_frames, quality, refit):
    """The decoder inside spec.md reads it, and has the splats that gsvc_ref has."""
    splats, width, height = frames
    options = {"key_frames": key_frames, "quality": quality, "refit": refit, "checksums": True}
    report, data = written(splats, width, height, **options)
    plain = spec.reconstruct_stream(data)
    fast = gsvc_ref.reconstruct_stream(data)
    assert plain["parameters"].tobytes() == np.asarray(fast.parameters).tobytes()
    assert [frame.psnr for frame in report.frames] == psnr_of_frames(splats, data, width, height)


@given(st.integers(1, 60), st.integers(0, 99), st.sampled_from([30.0, 40.0, 50.0]), st.sampled_from(["all", "none"]))
@settings(max_examples=12, deadline=None)
def test_no_frame_is_worse_than_asked_for(count, seed, goal, refit):
    rng = np.random.default_rng(seed)
    first = some_splats(count, seed)
    frames = [first, *(first + rng.normal(0, 0.1, first.shape).astype(np.float32) * (t > 1) for t in (1, 2))]
    frames = [np.maximum(one, np.float32([-99, -99, 0.2, -99, 0.2, -9, -9, -9])) for one in frames]
    report, data = written(frames, psnr=goal, refit=refit)
    assert min(psnr_of_frames(frames, data)) >= goal
    assert [frame.psnr for frame in report.frames] == psnr_of_frames(frames, data)
    assert types(report)[1] == "R"


def test_a_splat_costs_less_than_half_of_what_profile_paper_takes():
    splats = some_splats(400, 1, 160, 120) * np.float32([1, 1, 1, 1, 1, 0.3, 0.3, 0.3])
    bits = [8 * written([splats], 160, 120, refit=refit)[0].file_bytes / 400 for refit in ("all", "colors", "none")]
    assert bits == sorted(bits)
    assert bits[0] < 55
    assert 8 * gsvc_ref.write(BytesIO(), [splats], 160, 120, profile="paper").file_bytes / 400 > 2 * bits[0]


def test_with_colors_alone_refitted_positions_and_shapes_are_the_nearest():
    splats = some_splats(60, 2)
    alone, refitted = (decoded(written([splats], quality=50, refit=refit)[1])[0] for refit in ("none", "colors"))

    def nearest(frame):
        """The distance in deviations from each decoded splat to the one given that is nearest to it."""
        rows = frame.splats.to_array()
        far = np.abs(rows[:, None, :5] - splats[None, :, :5]) / np.maximum(splats[:, 2], 0.5)[None, :, None]
        return far.max(axis=2).min(axis=1)

    assert np.median(nearest(refitted)) < 1.5 * np.median(nearest(alone)) < 0.15


@pytest.mark.parametrize(
    ("rows", "least"),
    [
        ([[24, 16, 5, 0, 5, 0.5, 0.4, 0.3]], 48),  # one splat
        ([[24, 16, 5, 1, 5, 0.5, 0.4, 0.3]] * 5, 48),  # at one place
        ([[24, 16, 5, 1, 5, 9, 9, 9], [24, 16, 5, 1, 5, -8.5, -8.6, -8.7]], 48),  # which nearly cancel
        ([[24, 16, 900, 0, 900, 0.5, 0.4, 0.3]], 48),  # larger than the frame
        ([[24, 16, 1e6, 5e5, 1e6, 0.5, 0.4, 0.3]], 48),  # larger than any
        ([[24, 16, 14, 14, 0.7, 0.5, 0.4, 0.3]], 22),  # a needle too slanted for an I-frame becomes a wider one
        ([[-3, 16, 5, 1, 5, 0.5, 0.4, 0.3], [24, 35, 5, 2, 5, 0.5, 0.4, 0.3]], 40),  # beyond the edges
        ([[-300, 40, 200, 90, 250, 0.5, 0.4, 0.3]], 36),  # a large one beyond two edges
        ([[-40, 16, 5, 0, 5, 0.5, 0.4, 0.3], [24, 16, 5, 0, 5, 0.5, 0, 0]], 48),  # which cannot be seen
        ([[24, 16, 5, 0, 5, 0, 0, 0]], 200),  # black
        ([], 200),
    ],
)
def test_hard_splats(rows, least):
    splats = np.array(rows, np.float32).reshape(-1, 8)
    report, data = written([splats], quality=79)
    assert psnr_of_frames([splats], data)[0] >= least
    assert [frame.psnr for frame in report.frames] == psnr_of_frames([splats], data)


def test_splats_that_cannot_be_seen_are_said_to_be_left_out():
    splats = some_splats(5)
    splats[1, 0] = -500
    splats[3, 5:] = 0
    report, _ = written([splats, splats + 0.01], key_frames=())
    assert report.frames[0].splats == 3
    assert types(report) == "IP"
    assert report.notes[0].startswith("4 splats that cannot be seen")


def test_motion_that_neighbours_share_takes_few_bits():
    splats = some_splats(150, 3, 160, 120)
    frames = [splats + np.float32([1.25 * t, -0.75 * t, 0, 0, 0, 0, 0, 0]) for t in range(3)]
    report, data = written(frames, 160, 120, psnr=42, key_frames=())
    assert types(report) == "IPP"
    assert all(frame.codes.motion_cell for frame in decoded(data)[1:])
    first, *others = (sum(frame.bits.values()) for frame in report.frames)
    assert max(others) < 0.25 * first
    assert min(psnr_of_frames(frames, data, 160, 120)) >= 42


def test_splats_come_and_go_by_their_ids():
    splats, ids = some_splats(50), np.arange(100, 150)
    frames = [(splats[:40], ids[:40]), (splats[10:][::-1], ids[10:][::-1])]
    report, data = written(frames, key_frames=())
    a, b = decoded(data)
    assert (a.type, b.type) == ("I", "P")
    assert (report.frames[1].pruned_splats, report.frames[1].new_splats) == (10, 10)
    assert report.frames[1].splats == 40
    assert min(psnr_of_frames([one for one, _ in frames], data)) >= 48


def test_a_splat_leaves_the_frame_and_comes_back():
    splats = some_splats(20)
    away = splats.copy()
    away[4, 0] = -300
    report, data = written([splats, away, splats], key_frames=())
    assert [frame.splats for frame in report.frames] == [20, 19, 20]
    assert min(psnr_of_frames([splats, away, splats], data)) >= 48


def test_rows_that_are_others_make_an_i_frame():
    frames = [some_splats(200, seed) for seed in range(2)]
    report, _ = written(frames)
    assert types(report) == "II"
    assert report.frames[1].reason == "better than a P-frame"
    assert written([some_splats(9), some_splats(8)], key_frames=())[0].frames[1].reason.startswith("no splat of the")


def test_a_change_that_cannot_be_seen_repeats_the_frame():
    splats = some_splats()
    for refit in ("all", "colors", "none"):
        assert types(written([splats, splats * np.float32(1 + 1e-6)], refit=refit)[0]) == "IR"


def test_differences_bring_splats_to_those_given():
    """What is left is less than half a step of each, which is worth 0.25 D^2."""
    z = codable(some_splats(80, 5), W, H).z
    z_now = z + np.random.default_rng(0).normal(0, 0.2, z.shape)
    given_now = to_parameters(z_now)
    state = some_state(z)
    step, none = 16, np.zeros((80, 2), np.int64)
    found = nearest_differences(anchors_of(state, none, step, W * H), z_now, np.zeros((80, 8)))
    after = parameters_of(add_differences(state, none, found.q, step))
    error = [
        psnr(*(gsvc_ref.render_frame(one, W, H, 8) for one in (given_now, rows)), 255)
        for rows in (after, parameters_of(state))
    ]
    assert error[0] > 42
    assert error[0] > error[1] + 15


def some_state(z):
    """The state (N, 8) nearest to coordinates."""
    octaves = 1024 / np.log(2)
    A, B = (z[:, 2] + z[:, 3]) / np.sqrt(2) * octaves, (z[:, 2] - z[:, 3]) / np.sqrt(2) * octaves
    columns = [256 * z[:, 0], 256 * z[:, 1], A, B, 1024 * z[:, 4], *(16 * z[:, 5:]).T]
    return np.rint(np.stack(columns, axis=1)).astype(np.int64)


def test_fields_follow_the_motion_of_splats():
    splats = some_splats(100, 6, 128, 128)
    turned = splats.copy()
    turned[:, 0] += 0.05 * (splats[:, 1] - 64)
    fields = motion_fields(splats, turned[:, :2].astype(float), (64, 32, 16), 128, 128)
    assert list(fields) == [64, 32, 16]
    assert np.array_equal(np.sign(fields[64][:, :, 0]), [[-1, -1], [1, 1]])
    assert np.abs(fields[16][:, :, 1]).max() == 0
    assert motion_fields(splats, splats[:, :2].astype(float), (64, 32, 16), 128, 128) == {}


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        ((2, 0, np.nan), {}, "frame 0, splat 2: x is nan; it must be a number from -"),
        ((2, 1, 1e6), {}, "frame 0, splat 2: y is 1000000.0"),
        ((0, 2, 0), {}, "splat 0: l11 is 0.0; it must be at least 2"),
        ((4, 7, 65600), {}, "splat 4: B is 65600.0; it must be a number from -65504 to 65504"),
        ((1, slice(2, 6), [9000, 0, 9000, 60000]), {}, "splat 1: its colour is too large for its size"),
        (
            (0, slice(2, 5), [14, 14, 0.7]),
            {"psnr": 60.0},
            r"frame 0: profile main comes to \d\d\.\d\d dB of the picture",
        ),
        ((0, 0, 1), {"psnr": 40.0, "quality": 30}, "give one of them"),
        ((0, 0, 1), {"quality": 80}, "quality is 80"),
        ((0, 0, 1), {"refit": "x"}, "refit is 'x'; it must be one of none, colors, all"),
        ((0, 0, 1), {"cholesky_bits": 8}, "cholesky_bits is an option of profile paper: leave it out, or give"),
    ],
)
def test_what_cannot_be_written_is_refused_with_what_is_allowed(change, options, message):
    splats = some_splats(5)
    row, column, value = change
    splats[row, column] = value
    with pytest.raises(gsvc_ref.UsageError, match=message):
        written([splats], **options)


def test_the_profile_follows_from_its_options():
    def profile(**options):
        return gsvc_ref.write(BytesIO(), [some_splats(5)], W, H, **options).header.profile

    assert profile() == profile(psnr=40) == profile(profile="main") == 1
    assert profile(cholesky_bits=8) == profile(profile="paper") == 0
    for options in ({"psnr": 40, "color_stages": 2}, {"profile": "paper", "refit": "none"}, {"profile": "x"}):
        with pytest.raises(gsvc_ref.UsageError, match="profile"):
            profile(**options)


def test_codebooks_of_profile_paper_pay_for_their_splats():
    sizes = {}
    for count in (16, 64, 200, 3000):
        splats = [some_splats(count, 1, 160, 120)]
        own, all_of_them = (
            gsvc_ref.write(BytesIO(), splats, 160, 120, profile="paper", **options)
            for options in ({}, {"color_stages": 6, "color_codewords": 32})
        )
        sizes[count] = own.header.color_stages, own.header.color_codewords
        assert own.file_bytes <= all_of_them.file_bytes
        assert own.frames[0].psnr > all_of_them.frames[0].psnr - 2
    assert sizes == {16: (4, 8), 64: (3, 32), 200: (8, 16), 3000: (6, 32)}
