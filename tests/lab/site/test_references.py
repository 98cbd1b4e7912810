"""Mentions become links, and symbols in text get their scripts."""

import pytest

pytest.importorskip("markdown_it", reason="markdown-it-py is one of the extra site")
pytest.importorskip("pygments", reason="Pygments is one of the extra site")

from gsvc_lab.site.document import Targets
from gsvc_lab.site.references import Linker

TARGETS = Targets(
    rules={"R-6.5-2": "six.html#R-6.5-2", "R-6.5-20": "six.html#R-6.5-20"},
    equations={"8-1": "eight.html#eq-8-1"},
    elements={"width": "six.html#element-width", "frame_count": "six.html#element-frame_count"},
    sections={"6": "six.html", "6.5": "six.html#65", "9.2": "nine.html#92", "Annex A": "a.html"},
    operations={"loss": "four.html#operation-loss"},
)


def linked(body, page="other.html", in_spec=True):
    return Linker(TARGETS, page, in_spec=in_spec).linked(body)


@pytest.mark.parametrize(
    ("body", "links"),
    [
        ("breaks R-6.5-2.", ["six.html#R-6.5-2"]),
        ("R-6.5-20, not R-6.5-3", ["six.html#R-6.5-20"]),
        ("by (8-1), not (8-2)", ["eight.html#eq-8-1"]),
        ("sections 6.5 and 9.2", ["six.html#65", "nine.html#92"]),
        ("section 6, of 9.2 and (6.5, 9.2)", ["six.html", "nine.html#92", "six.html#65", "nine.html#92"]),
        ("Annex A", ["a.html"]),
        ("a bound of 9.2 ε and 6.5 units", []),
        ("<code>width</code> and <code>loss</code>", ["six.html#element-width", "four.html#operation-loss"]),
        ("<code>width * 2</code>", []),
        ("<pre><code># R-6.5-2, width</code></pre>", ["six.html#R-6.5-2"]),
        ("<h2>R-6.5-2 and section 6.5</h2>", []),
        ('<a href="x.html">section 6.5, (8-1)</a>', ["x.html"]),
        ("<table><tr><th>section</th><th>bits</th></tr><tr><td>6</td><td>6</td></tr></table>", ["six.html"]),
    ],
)
def test_mentions(body, links):
    found = [piece.partition('"')[0] for piece in linked(body).split('href="')[1:]]
    assert found == links


def test_a_link_within_a_page_is_short():
    assert 'href="#R-6.5-2"' in linked("R-6.5-2", page="six.html")


def test_guides_number_their_own_sections():
    assert linked("section 6.5 and R-6.5-2", in_spec=False).count("<a ") == 1
    assert "<a " not in linked("<code>width</code>", in_spec=False)
    assert "<a " in linked("<code>frame_count</code>", in_spec=False)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("l11 and d_x", "<i>l</i><sub>11</sub> and <i>d</i><sub>x</sub>"),
        ("σ_x² + u1²", "<i>σ</i><sub>x</sub>² + <i>u</i><sub>1</sub>²"),
        ("γ_(D+11) · 2^−25", "<i>γ</i><sub>D+11</sub> · 2<sup>−25</sup>"),
        ("gsvc_ref, C12 and l111", "gsvc_ref, C12 and l111"),
        ("<code>d_x</code>", "<code>d_x</code>"),
        ("[ours] It", '<span class="tag ours">ours</span> It'),
        ("a &lt; b &amp; c", "a &lt; b &amp; c"),
    ],
)
def test_scripts_and_tags(text, expected):
    assert linked(text) == expected
