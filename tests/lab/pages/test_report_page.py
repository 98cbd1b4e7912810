import dataclasses
import math
import re
from fractions import Fraction

import numpy as np
import pytest
from html_pages import parsed
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_base.pages.page import Figure
from gsvc_lab.pages import pictures
from gsvc_lab.pages.charts import LEFT, RIGHT, WIDTH, Axis, Scale, color_classes, nice_ticks, share_bar
from gsvc_lab.pages.data import Choice, FrameRecord, PictureRow, ReportData, condensed
from gsvc_lab.pages.frame_charts import bits_chart, psnr_chart
from gsvc_lab.pages.report import report_html, write_report


def wide(chart):
    """The chart as wide pages show it, without its narrow twin."""
    return chart.partition('<div class="narrow">')[0]


def record(number, kind="P", **changes):
    values = {
        "number": number,
        "type": kind,
        "psnr": 31.25 + number,
        "bits_by_attribute": {"positions": 16_011 + number, "colours": 7_001, "frame header": 88},
        "splats": 1_234 + number,
        "iterations": 151 + number,
        "seconds": 0.125 * (number + 1),
        "reason": f"because of {number}",
    }
    return FrameRecord(**(values | changes))


def report(frames=None, **changes):
    frames = [record(0, "I"), record(1), record(2, "R", psnr=math.inf)] if frames is None else frames
    totals = {}
    for frame in frames:
        for name, bits in frame.bits_by_attribute.items():
            totals[name] = totals.get(name, 0) + bits
    totals["container"] = 800 + -sum(totals.values()) % 8
    clip = [np.full((12, 20, 3), 40 * number, np.uint8) for number in range(3)]
    values = {
        "title": "A report <of> tests & more",
        "command": "gsvc encode 'a b.y4m' out.gsvc --splats 1234",
        "introduction": "What was coded & why.",
        "width": 20,
        "height": 12,
        "frame_rate": Fraction(30000, 1001),
        "bit_depth": 8,
        "preset": "quick",
        "file_bytes": sum(totals.values()) // 8,
        "bits_by_attribute": totals,
        "stages": {"fitting": 12.34, "entropy coding": 0.56},
        "frames": frames,
        "ms_ssim": 0.98765,
        "vmaf": 91.23,
        "figures": [Figure("Threads", "2", "cores", "of one machine")],
        "pictures": [
            PictureRow(1, clip[0], clip[1], np.array([[3, 4], [50, 4]], np.float32), None, "a <row>"),
            PictureRow(2, clip[2], clip[2], np.ones((2, 2), np.float32), np.ones((2, 3), np.float32)),
        ],
        "preview_original": clip,
        "preview_decoded": clip,
        "notes": ["first note", "second <note>"],
        "environment": {"processor": "a fast one"},
    }
    return ReportData(**(values | changes))


def test_the_page_is_well_formed_and_needs_nothing_else():
    page = report_html(report())
    checker = parsed(page)
    assert "script" not in checker.tags
    for name, value in checker.attributes:
        if name in ("src", "srcset", "href"):
            assert value.startswith("data:image/")
    without_pictures = re.sub(r"data:image/[^\"]*", "", page)
    assert not re.search(r"https?:|//|url\(|@import", without_pictures)
    assert "prefers-color-scheme: dark" in page


def test_every_number_stands_on_the_page():
    data = report()
    text = " ".join(parsed(report_html(data)).text)
    expected = [
        "A report <of> tests & more", data.command, data.introduction, "20 × 12", "29.97 frames/s", "quick",
        f"{data.file_bytes:,} bytes", f"{data.bits_per_pixel:.3f}", "0.9877", "91.2", "12.34", "0.56", "12.90",
        "Threads", "of one machine", "a <row>", "first note", "second <note>", "a fast one", "1 I, 1 P, 1 R",
        "0.10 s", "Largest difference: 40 of 255", "Centres of the 2 splats (1 of them outside the frame)",
    ]  # fmt: skip
    for frame in data.frames:
        expected += [
            f"{frame.bits:,}",
            f"{frame.splats:,}",
            str(frame.iterations),
            f"{frame.seconds:.3f}",
            frame.reason,
        ]
        expected += [f"{bits:,}" for bits in frame.bits_by_attribute.values()]
        expected.append(f"{frame.psnr:.2f}" if math.isfinite(frame.psnr) else "identical")
    expected += [f"{bits:,}" for bits in data.bits_by_attribute.values()]
    assert [words for words in expected if words not in text] == []


def test_a_long_film_has_its_frame_numbers():
    """Of 5,000 frames eleven share a mark, and few round numbers are the first of eleven."""
    chart = wide(psnr_chart(condensed([record(number, psnr=31.0) for number in range(5000)]), 31.0))
    ticks = re.findall(r'<text class="tick" x="([\d.]+)" y="[\d.]+" text-anchor="middle">(\d+)</text>', chart)
    assert [int(number) for _, number in ticks] == [*range(0, 5000, 500)]
    step = (WIDTH - RIGHT - LEFT) / 455
    for x, number in ticks:
        assert float(x) == pytest.approx(LEFT + step * (int(number) // 11 + 0.5), abs=0.06)


def test_derived_numbers():
    data = report(
        [record(0, "I", psnr=30.0), record(1, psnr=32.0)], preview_original=(), preview_decoded=(), pictures=()
    )
    assert data.mean_psnr == 31
    assert data.bits_per_pixel == 8 * data.file_bytes / (20 * 12 * 2)
    assert data.bits_per_second == pytest.approx(8 * data.file_bytes / (2 * 1001 / 30000))
    assert data.compression == 20 * 12 * 24 * 2 / (8 * data.file_bytes)
    assert data.peak == 255
    assert data.frames[0].bits == 16_011 + 7_001 + 88


def test_a_bare_report_leaves_out_what_it_was_not_given():
    bare = report(ms_ssim=None, vmaf=None, figures=(), pictures=(), preview_original=(), preview_decoded=(), notes=(),
                  environment={}, stages={}, introduction="", command="")  # fmt: skip
    checker = parsed(report_html(bare))
    text = " ".join(checker.text)
    for absent in ("MS-SSIM", "VMAF", "Notes", "What it ran on", "Where the time went", "Frames to look at"):
        assert absent not in text
    assert "img" not in checker.tags
    assert "pre" not in checker.tags


def test_deep_frames_are_shown():
    frame = np.full((12, 20, 3), 1000, np.uint16)
    row = PictureRow(0, frame, frame - 3, np.zeros((0, 2), np.float32))
    page = report_html(report(bit_depth=10, pictures=[row], preview_original=[frame], preview_decoded=[frame]))
    assert "Largest difference: 3 of 1023" in page


def test_without_webp_the_preview_stands_still_and_says_so(monkeypatch):
    monkeypatch.setattr(pictures.features, "check", lambda _name: False)
    page = report_html(report())
    assert "no WebP" in page
    assert "data:image/webp" not in page


def test_the_file_appears_only_when_it_is_complete(tmp_path, monkeypatch):
    write_report(report(), tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == report_html(report())

    def full(self, _target):
        raise OSError("the disk is full")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(OSError, match="full"):
        write_report(report(), tmp_path / "other.html")
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"frames": ()}, "at least one frame"),
        ({"file_bytes": 1}, "the file of 1 bytes 8"),
        ({"bits_by_attribute": {"positions": 8}, "file_bytes": 1}, "which the file's parts do not name"),
        ({"width": 0}, "0x12"),
        ({"frame_rate": Fraction(0)}, "0 frames per second"),
        ({"bit_depth": 17}, "17 bits"),
        ({"preview_decoded": ()}, "3 original and 0 decoded"),
    ],
)
def test_a_report_that_contradicts_itself_is_refused(change, words):
    with pytest.raises(UsageError, match=words):
        dataclasses.replace(report(), **change)


@pytest.mark.parametrize(
    ("change", "words"),
    [({"kind": "B"}, "'B'"), ({"psnr": math.nan}, "NaN"), ({"bits_by_attribute": {"x": -1}}, "negative")],
)
def test_a_frame_that_cannot_be_is_refused(change, words):
    with pytest.raises(UsageError, match=words):
        record(0, **change)


def test_pictures_of_two_sizes_are_refused():
    with pytest.raises(UsageError, match="one size"):
        PictureRow(3, np.zeros((2, 2, 3), np.uint8), np.zeros((2, 3, 3), np.uint8), np.zeros((0, 2), np.float32))


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6), st.integers(2, 12))
def test_ticks_are_round_evenly_spaced_and_inside(low, extent, count):
    high = low + extent
    ticks = nice_ticks(low, high, count)
    assert len(ticks) <= count + 1
    assert all(low - 1e-6 * extent <= tick <= high + 1e-6 * extent for tick in ticks)
    if len(ticks) > 1:
        step = ticks[1] - ticks[0]
        mantissa = step / 10 ** math.floor(math.log10(step) + 1e-6)
        assert min(abs(mantissa - m) for m in (1, 2, 5, 10)) < 1e-3
        np.testing.assert_allclose(np.diff(ticks), step, rtol=1e-3)


def test_ticks_of_one_value():
    assert nice_ticks(3, 3, 5) == [3]


def test_bars_are_as_high_as_their_bits():
    first = {"a": 3000, "b": 1000, "c": 2000}
    frames = [record(0, "I", bits_by_attribute=first), record(1, bits_by_attribute={"a": 500, "b": 0})]
    bar = r'<rect class="(c\d)" x="[\d.]+" y="([\d.]+)" width="[\d.]+" height="([\d.]+)"'
    bars = [
        (name, float(y), float(h)) for name, y, h in re.findall(bar, wide(bits_chart(frames, {"a": 4, "b": 0, "c": 9})))
    ]
    assert [name for name, _, _ in bars] == ["c4", "c0", "c9", "c4"]
    unit = bars[1][2]
    np.testing.assert_allclose([height for _, _, height in bars], [3 * unit, unit, 2 * unit, unit / 2], atol=0.03)
    bottoms = [y + height for _, y, height in bars]
    assert bottoms[0] == pytest.approx(bottoms[3], abs=0.02)
    np.testing.assert_allclose(bottoms[1:3], [bars[0][1], bars[1][1]], atol=0.02)


def test_the_largest_parts_have_colors_of_their_own():
    shares = {f"part {size}": size for size in (3, 12, 1, 9, 5, 2, 11, 4, 10, 6, 8, 7)}
    colors = color_classes(shares)
    assert list(colors) == list(shares)
    assert [colors[f"part {size}"] for size in range(12, 0, -1)] == [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9]


def test_points_stand_at_their_psnr():
    frames = [record(0, "I", psnr=30.0), record(1, psnr=34.0), record(2, psnr=32.0), record(3, "R", psnr=math.inf)]
    chart = psnr_chart(frames, math.inf)
    ys = [float(pair.split(",")[1]) for pair in re.search(r'points="([^"]+)"', chart)[1].split()]
    assert ys[2] == pytest.approx((ys[0] + ys[1]) / 2, abs=0.1)
    assert ys[3] < ys[1]
    tick = re.search(r'y="([\d.]+)" text-anchor="end">32</text>', chart)
    assert float(tick[1]) - 4 == pytest.approx(ys[2], abs=0.11)
    assert "mean" not in chart
    for kind in ("mark-i", "mark-p", "mark-r"):
        assert kind in chart


def test_a_long_video_keeps_the_marks_that_matter():
    frames = [record(n, "I" if n % 50 == 0 else "P") for n in range(400)]
    chart = wide(psnr_chart(frames, 31.0))
    assert chart.count("mark-i") == 8
    assert "mark-p" not in chart
    assert "mean 31.00 dB" in chart


def test_all_frames_identical_still_has_a_chart():
    frames = [record(0, "I", psnr=math.inf)]
    parsed(psnr_chart(frames, math.inf))
    assert "∞" in report_html(report(frames))


@given(st.dictionaries(st.text(min_size=1, max_size=8), st.floats(0, 1e6), min_size=1, max_size=12))
def test_shares_fill_the_bar(shares):
    bar = share_bar(shares, "label")
    widths = [float(width) for width in re.findall(r'width="([\d.]+)"', bar)]
    assert sum(widths) == pytest.approx(960 if sum(shares.values()) else 0, abs=0.1)


def test_decisions_are_a_cell_each_with_their_reason():
    choices = [Choice("gsa", "done", "5 % is <new>"), Choice("dks", "skipped", "no cut"), Choice("gsp", "off", "off")]
    frames = [record(0, "I", choices=choices), record(1, choices=choices[::1])]
    page = report_html(report(frames, savings="Much was saved."))
    assert page.count("<title>frame 1, gsa: 5 % is &lt;new&gt;</title>") == 2  # for wide and for narrow pages
    assert page.count("<title>frame 0, dks: no cut</title>") == 2
    assert "Much was saved." in page
    assert "left out, at least in part" in page
    assert "What the scene called for" not in report_html(report())


def test_decisions_about_different_effects_are_refused():
    frames = [record(0, "I", choices=[Choice("gsa", "done", "")]), record(1)]
    with pytest.raises(UsageError, match="different effects"):
        report(frames)


def test_a_logarithmic_axis_spans_a_decade():
    """Values that differ by a hundredth lie beside each other, with marks around them."""
    scale = Scale([0, 2.36e-5, 2.38e-5], Axis("error", str, log=True), 0, 100)
    assert 0 < scale(2.38e-5) - scale(2.36e-5) < 1
    assert scale(0) < scale(2.36e-5) - 20
    assert len(scale.ticks(5)) >= 3
