"""The site: no link breaks, nothing of a network is loaded, everything with an id is found, nothing is too wide."""

import html.parser
import json
import re
import shutil

import pytest

pytest.importorskip("markdown_it", reason="markdown-it-py is one of the extra site")
pytest.importorskip("pygments", reason="Pygments is one of the extra site")

from gsvc_lab.site.__main__ import ROOT, main
from gsvc_lab.site.document import parts_of, targets_of

LOADED = {"img": "src", "script": "src", "link": "href", "iframe": "src", "source": "src", "video": "src"}
VOID = {"meta", "img", "source", "br", "hr", "link", "input", "wbr"}


class Facts(html.parser.HTMLParser):
    """Ids, links, and what is loaded; notes tags that are closed out of their place."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.loaded, self.open, self.wrong = [], [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        named = dict(attrs)
        if tag not in VOID:
            self.open.append(tag)
        if "id" in named:
            self.ids.append(named["id"])
        if tag == "a" and "href" in named:
            self.links.append(named["href"])
            if "a" in self.open[:-1]:
                self.wrong.append(f"a link in a link: {named['href']}")
        if tag in LOADED and LOADED[tag] in named:
            self.loaded.append(named[LOADED[tag]])

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if tag in VOID:
            return
        if not self.open or self.open.pop() != tag:
            self.wrong.append(f"</{tag}>")


def broken_links(folder):
    """The links and loaded files of all pages of a folder that lead nowhere, or to a network if they are loaded."""
    facts = {path: Facts(path.read_text(encoding="utf-8")) for path in sorted(folder.rglob("*.html"))}
    broken = []
    for path, page in facts.items():
        outside = [url for url in page.loaded if re.match(r"\w+:|//", url) and not url.startswith("data:")]
        inside = [url for url in page.links + page.loaded if not re.match(r"\w+:", url)]
        broken += [(path.name, url) for url in outside]
        for url in inside:
            name, _, anchor = url.partition("#")
            target = (path.parent / name).resolve() if name else path
            known = facts[target].ids if target in facts else []
            if not target.is_file() or (anchor and anchor not in known):
                broken.append((path.name, url))
    return broken


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("built") / "site"
    assert main(["--output", str(folder)]) == 0
    return folder.resolve()


@pytest.fixture(scope="module")
def targets():
    return targets_of(parts_of((ROOT / "spec.md").read_text(encoding="utf-8")))


@pytest.mark.exhaustive
def test_no_link_breaks(site):
    assert broken_links(site) == []


@pytest.mark.exhaustive
def test_a_broken_link_is_found(site, tmp_path):
    copy = tmp_path / "site"
    shutil.copytree(site, copy)
    with (copy / "index.html").open("a", encoding="utf-8") as page:
        page.write('<a href="spec-1.html#nowhere"></a><a href="none.html"></a><img src="https://example.org/x.png">')
    assert [url for _, url in broken_links(copy)] == ["https://example.org/x.png", "spec-1.html#nowhere", "none.html"]


def test_pages_are_well_formed_and_ids_are_unique(site):
    for path in sorted(site.glob("*.html")):
        page = Facts(path.read_text(encoding="utf-8"))
        assert (page.wrong, page.open) == ([], []), path.name
        assert len(page.ids) == len(set(page.ids)), (path.name, [i for i in page.ids if page.ids.count(i) > 1])


def test_style_sheets_load_nothing(site):
    for path in sorted(site.rglob("*.css")):
        assert "url(" not in path.read_text(encoding="utf-8").replace("url(data:", "")
        assert "@import" not in path.read_text(encoding="utf-8")


def test_everything_with_an_id_has_its_anchor(site, targets):
    spec = (ROOT / "spec.md").read_text(encoding="utf-8")
    assert set(targets.rules) == set(re.findall(r"\*\*(R-[\d.]+-\d+)\*\*", spec))
    assert len(targets.equations) > 70
    assert len(targets.operations) > 30
    ids = {path.name: set(Facts(path.read_text(encoding="utf-8")).ids) for path in site.glob("*.html")}
    groups = (targets.rules, targets.equations, targets.elements, targets.operations, targets.headings)
    missing = [
        url for group in groups for url in group.values() if url.partition("#")[2] not in ids[url.partition("#")[0]]
    ]
    assert missing == []


def test_mentions_are_links(site, targets):
    text = (site / "spec-12.html").read_text(encoding="utf-8")
    unlinked = re.sub(r"<a [^>]*>.*?</a>", "", text)
    assert 'href="spec-6.html#R-6.5-7"' in text
    assert 'href="spec-6.html#element-survivor_map"' in text
    assert 'href="spec-6.html#63-sequence-header-h"' in text
    assert [rule for rule in targets.rules if f"{rule} " in unlinked] == []


def test_the_search_knows_all_ids(site, targets):
    script = (site / "search-index.js").read_text(encoding="utf-8")
    index = json.loads(script.removeprefix("window.GSVC_INDEX = ").removesuffix(";\n"))
    assert set(targets.rules) < set(index["ids"])
    assert {row[2].partition("#")[0] for row in index["parts"]} >= {
        "spec-6.html",
        "readme.html",
        "coverage.html",
        "tour.html",
    }


def test_another_folder_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    assert main(["--output", str(tmp_path)]) == 2
    assert (tmp_path / "mine.txt").exists()


@pytest.fixture(scope="module")
def open_page():
    pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")
    import web_pages

    with web_pages.pages() as opener:
        yield opener


@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_is_wider_than_the_page(site, open_page, width):
    page = open_page(width=width, height=800)
    too_wide = {}
    sources = sorted(site.glob("file-*.html"), key=lambda path: len(path.name))
    for path in sorted({*site.glob("*.html")} - {*sources[:-3]}):  # sources are set alike: those with the longest names
        page.goto(path.as_uri())
        room = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
        if room[0] > room[1]:
            too_wide[path.name] = room
    page.close()
    assert too_wide == {}


def test_the_search_works_from_a_disk(site, open_page):
    page = open_page(width=1000, height=800)
    page.goto((site / "index.html").as_uri())
    page.press("/")
    page.fill("#site-query", "R-6.5-2")
    page.wait_for_selector("#site-results a")
    assert page.get_attribute("#site-results a", "href") == "spec-6.html#R-6.5-2"
    page.fill("#site-query", "survivor map")
    page.wait_for_selector("#site-results mark")
    assert all(not url.startswith("http") for url in page.requests)
    page.close()


def test_the_viewer_plays_its_example(site, open_page):
    page = open_page(width=1000, height=800)
    page.goto((site / "viewer" / "index.html").as_uri() + "?renderer=webgl2")
    page.drawn()
    page.close()


def test_a_click_on_an_element_shows_its_text(site, open_page):
    page = open_page(width=1280, height=800)
    page.goto((site / "syntax.html").as_uri())
    assert not page.is_visible("#about-survivor_map")
    page.click('.tables a[href="#about-survivor_map"]')
    assert page.is_visible("#about-survivor_map")
    assert "R-6.4-5" in page.text_content("#about-survivor_map")
    page.click('#table-end a[href="#about-frame_count-end"]')
    assert not page.is_visible("#about-survivor_map")
    page.click('#table-frame_body a[href="#about-motion_cell"]')
    assert "R-15.5-2" in page.text_content("#about-motion_cell")
    page.click('#table-frame_body a[href="#about-quantizer_present-frame_body"]')
    assert "R-15.5-5" in page.text_content("#about-quantizer_present-frame_body")
    page.click('#table-layer a[href="#table-frame_body"]')
    page.close()
