"""Figures of matplotlib on dark pages and on phones: those that are kept, and rules by hand."""

import re
from pathlib import Path

import pytest

from gsvc_lab.experiments.markdown import FIGURE
from gsvc_lab.pages.narrow import WIDTH, narrow
from gsvc_lab.pages.schemes import DARK, in_both_schemes

FOLDER = Path(__file__).parents[3] / "docs" / "experiments"
KEPT = sorted(FOLDER.glob("*.svg"))


def figure(columns, numbers=True, title=""):
    """A figure of panels from left to right, 20 points apart, with numbers at their left."""
    text = '<text style="font-size: 9px; text-anchor: {}" x="{}" y="{}" transform="rotate(-0 0 0)">{}</text>'
    parts = []
    for number, (left, right) in enumerate(columns, 1):
        parts.append(
            f'<g id="axes_{number}">\n<g id="patch_{number}">\n<path d="M {left} 90 \nL {right} 90 \nL {right} 10 \n'
            f'L {left} 10 \nz\n" style="fill: #ffffff"/>\n</g>\n'
        )
        parts += [text.format("end", left - 3, 50, "30")] if numbers or number == 1 else []
        parts += [text.format("start", left, 8, title), "</g>\n"]
    return (
        '<svg width="400pt" height="100pt" viewBox="0 0 400 100">\n<style type="text/css">*{a: b}</style>\n'
        f'<g id="figure_1">\n{"".join(parts)}</g>\n</svg>\n'
    )


@pytest.mark.parametrize("path", KEPT, ids=lambda path: path.stem)
def test_kept_figures_have_all_their_colours_in_both_schemes(path):
    svg = path.read_text(encoding="utf-8")
    assert in_both_schemes(svg) == svg
    colours = set(re.findall(r"(?:fill|stroke): (#[0-9a-f]{6})", svg.partition("</style>")[2]))
    assert colours <= set(DARK)


def test_text_can_be_read_on_either_paper():
    def light(colour):
        parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    def contrast(a, b):
        high, low = sorted((light(a), light(b)), reverse=True)
        return (high + 0.05) / (low + 0.05)

    paper = DARK["#ffffff"]
    assert all(contrast(DARK[ink], paper) >= 4.5 for ink in ("#1a1e23", "#5b6570", "#000000"))
    assert all(contrast(DARK[line], paper) >= 4.5 for line in ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00"))


def test_columns_come_below_each_other():
    svg = narrow(figure([(20, 190), (230, 400)]))
    size = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg)
    assert float(size[1]) <= WIDTH
    windows = re.findall(r'<svg x="0.0" y="([\d.]+)" width="([\d.]+)" height="[\d.]+" viewBox="([\d.]+) ', svg)
    assert [window[0] for window in windows] == ["0.0", "105.0"]
    edge = float(windows[1][2])
    assert 190 < edge < 230 - 3 - 2 * 0.53 * 9
    assert float(windows[0][1]) == edge
    assert svg.count('<g id="figure_1">') == 1


@pytest.mark.parametrize(
    "svg",
    [
        figure([(20, 190)]),
        figure([(20, 190), (230, 400)], numbers=False),  # the second panel shares the numbers of the first
        figure([(20, 190), (230, 400)], title="a title that is far too long for a column of this width to hold"),
        figure([(20, 190), (30, 200)]),
        "<svg/>",
    ],
)
def test_what_cannot_be_cut_is_left_as_it_is(svg):
    assert narrow(svg) is None


def test_most_figures_of_several_columns_have_a_narrow_form():
    twins = {path.stem for path in KEPT if narrow(path.read_text(encoding="utf-8")) is not None}
    assert twins >= {path.stem for path in KEPT if path.stem.startswith("rate_distortion")} | {"key_frames-losses"}
    document = FOLDER.with_suffix(".md").read_text(encoding="utf-8")
    assert twins <= {found["name"].removesuffix(".svg") for found in FIGURE.finditer(document)}
