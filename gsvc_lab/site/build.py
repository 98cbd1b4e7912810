"""Everything that the site has, and where it comes from."""

import html
import json
import os
import re
import shutil
from collections.abc import Callable, Collection, Iterable, Sequence
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from gsvc_lab.pages.narrow import twin_source, write_twin
from gsvc_lab.site import glance
from gsvc_lab.site.browser import browser
from gsvc_lab.site.document import FENCED, SYNTAX, Part, element_names, parts_of, targets_of
from gsvc_lab.site.markdown import highlighted, rendered
from gsvc_lab.site.page import Page, documents
from gsvc_lab.site.references import Linker, with_anchors
from gsvc_lab.site.search import index
from gsvc_lab.site.syntax import tables_of

GUIDES: Final = {
    "README.md": "readme.html",
    "docs/encode-and-look.md": "encode-and-look.html",
    "docs/check-your-implementation.md": "check-your-implementation.html",
    "conformance/protocol.md": "protocol.html",
    "docs/tour.md": "tour.html",
}
"""Guides that come first, in this order; all others in docs/ follow."""

RECORDS: Final = {
    "docs/reports/README.md": "reports.html",
    "vectors/COVERAGE.md": "coverage.html",
    "CHANGELOG.md": "changelog.html",
}
VIEWER: Final = "viewer"
REPORTS: Final = "docs/reports"
FOLDERS: Final = {
    VIEWER: "viewer/index.html",
    f"{VIEWER}/index.html": "viewer/index.html",
    REPORTS: "reports.html",
    "vectors": "coverage.html",
}
SOURCES: Final = (".py", ".toml", ".json", ".js", ".txt", ".css", ".md", ".c", ".h", ".ksy", "")
"""Endings of text files that a link may lead to; the site shows them as pages."""

LEAD: Final = (
    '<p class="lead">Video as sums of 2D Gaussian splats: those of each frame are predicted from the frame before, '
    "and what is left is coded. Here is what every byte means.</p>"
)
CARDS: Final = (
    ("glance.html", "At a glance", "The layout of a stream in pictures: what stands in what, in how many bits."),
    ("syntax.html", "Syntax browser", "Every table of the syntax; click an element to read what it means."),
    ("viewer/index.html", "Viewer", "Watch a stream in this browser, zoom in, follow a splat. It has an example."),
    (
        "check-your-implementation.html",
        "Check your implementation",
        "From an empty kernel to a green report in an afternoon.",
    ),
    ("encode-and-look.html", "Encode, decode and look", "The commands, the Python functions, and what they reach."),
    ("reports.html", "Reports", "What the conformance kit says about implementations on CPUs and GPUs."),
    ("coverage.html", "Coverage", "Which vectors hold each rule, each equation and each element."),
)


DRAWN: Final = re.compile(r'<img src="([^"]+)\.svg"[^>]*>')
"""A figure of a page."""


def _write_twins(folder: Path, targets: Iterable[str]) -> set[str]:
    """Write the figures for phones beside those that have several columns; the names of these without suffix."""
    return {
        target.removesuffix(".svg") for target in targets if target.endswith(".svg") and write_twin(folder / target)
    }


def _figure(image: re.Match[str], twins: Collection[str]) -> str:
    """A figure that phones show in its narrow form, or else large enough to be read, to be moved sideways."""
    if image[1] in twins:
        return f"<picture>{twin_source(image[1])}{image[0]}</picture>"
    return f'<span class="figure" tabindex="0">{image[0]}</span>'


def built(root: Path) -> tuple[int, dict[str, bytes]]:
    """How many pages the site of a checkout has, and its files by name."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        count = Site(root).write(folder)
        files = (path for path in folder.rglob("*") if path.is_file())
        return count, {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


class Site:
    """The pages, made from a checkout."""

    def __init__(self, root: Path) -> None:
        self.root = root  # the checkout
        self.parts = parts_of((root / "spec.md").read_text(encoding="utf-8"))
        self.targets = targets_of(self.parts)
        self.syntax = [part for part in self.parts if part.name in SYNTAX]
        self.tables = tables_of(json.loads((root / "spec" / "syntax.json").read_text(encoding="utf-8")))
        others = sorted(path.relative_to(root).as_posix() for path in (root / "docs").glob("*.md"))
        self.guides = GUIDES | {name: f"{Path(name).stem}.html" for name in others if name not in GUIDES}
        self.files: dict[str, str] = {}
        self.sources: dict[str, str] = {}

    def write(self, folder: Path) -> int:
        """Write the site into an empty folder, and return how many pages it has."""
        pages = [self._start(), *self._specification(), *self._documents()]
        pages += [self._source(name, page) for name, page in self.sources.items()]
        written = documents(pages)
        for name, target in self.files.items():
            (folder / target).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(self.root / name, folder / target)
        twins = _write_twins(folder, self.files.values())
        for name, text in written.items():
            (folder / name).write_text(DRAWN.sub(lambda image: _figure(image, twins), text), encoding="utf-8")
        # The syntax browser repeats sections 6 and 15.
        (folder / "search-index.js").write_text(
            index([page for page in pages if page.group and not page.wide], self.targets), encoding="utf-8"
        )
        for name in ("site.css", "site.js"):
            (folder / name).write_text(_own(name), encoding="utf-8")
        self._copy_viewer(folder)
        return len(written)

    def _copy_viewer(self, folder: Path) -> None:
        """Copy the viewer, and the scripts outside of its folder to where it looks for them."""
        shutil.copytree(self.root / VIEWER, folder / VIEWER, ignore=shutil.ignore_patterns("*.md", "*.toml"))
        page = (self.root / VIEWER / "index.html").read_text(encoding="utf-8")
        for name in re.findall(r'src="\.\./([^"]+)"', page):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(self.root / name, folder / name)

    def _specification(self) -> list[Page]:
        pages = [self._section(part) for part in self.parts]
        link = self._links_of("spec.md")
        syntax = f'<h1 id="syntax">Syntax</h1>\n{browser(self.syntax, self.targets, link)}'
        first = Page(
            "glance.html",
            "GSVC at a glance",
            "Specification",
            self._linked("glance.html", self._glance()),
            _inner(self._glance()),
        )
        second = Page("syntax.html", "Syntax browser", "Specification", self._linked("syntax.html", syntax), wide=True)
        return [pages[0], first, second, *pages[1:]]

    def _section(self, part: Part) -> Page:
        body = rendered(part.text, self._links_of("spec.md"), normative=bool(part.name), raised=1 if part.name else 0)
        body = with_anchors(body, element_names, self.targets.operations)
        title = part.title if part.name else "Contents and introduction"
        return Page(part.page, title, "Specification", self._linked(part.page, body), _inner(body))

    def _glance(self) -> str:
        levels = next(part for part in self.parts if part.name == "5")
        body = rendered(levels.text, self._links_of("spec.md"), raised=1)
        table = re.search(
            r'<div class="scroll"[^>]*><table>(?:(?!</div>).)*<th[^>]*>level</th>.*?</div>', body, re.DOTALL
        )
        if not table:
            raise ValueError("section 5 of spec.md has no table whose first column is called level")
        elements = {name: f"syntax.html#about-{name}" for name in self._browsable()}
        figures = "".join(glance.figure(one, elements, self.tables) for one in self.tables.values())
        return (
            '<h1 id="glance">GSVC at a glance</h1>\n'
            "<p>A frame is a sum of soft ellipses, <em>splats</em>. A stream says which splats each frame has. "
            'The pictures of this page are drawn from the tables of <a href="spec-6.html">section 6</a> '
            'and, for profile main, of <a href="spec-15.html">section 15</a> of the specification.</p>\n'
            '<h2 id="frames">Frames</h2>\n<p>Splats are predicted from splats of the frame before, never from pixels. '
            "An I-frame needs no other frame.</p>\n"
            + glance.dependencies()
            + '<h2 id="layouts">What stands in what</h2>\n'
            "<p>A full box has a fixed size; the number in its corner is its byte, counted from where the structure "
            "begins. A box with a broken edge takes as much as it needs. What stands under a condition, or again and "
            "again, has a frame.</p>\n"
            f'{figures}<h2 id="levels">Levels</h2>\n<p>What a decoder must be ready for in one frame '
            f"(section 5).</p>\n{table[0]}"
        )

    def _browsable(self) -> list[str]:
        """The elements of which the syntax browser has an article of their own."""
        text = "".join(FENCED.sub("", part.text) for part in self.syntax)
        headings = re.findall(r"^#### (.+)$", text, re.MULTILINE)
        return [names[0].removeprefix("element-") for heading in headings if (names := element_names(heading))]

    def _documents(self) -> list[Page]:
        pages = []
        for group, documents_of_it in (("Guides", self.guides), ("Records", RECORDS)):
            for name, page in documents_of_it.items():
                text = (self.root / name).read_text(encoding="utf-8")
                title = re.match(r"# (.+)", text)
                body = rendered(text, self._links_of(name))
                shown = "gsvc_ref" if name == "README.md" else re.sub(r"`", "", title[1]) if title else name
                pages.append(Page(page, shown, group, self._linked(page, body, in_spec=False), _inner(body)))
        return pages

    def _source(self, name: str, page: str) -> Page:
        text = (self.root / name).read_text(encoding="utf-8")
        language = {".py": "python", ".js": "javascript", ".c": "c", ".h": "c"}.get(
            Path(name).suffix, Path(name).suffix[1:]
        )
        return Page(page, name, "", f"<h1>{html.escape(name)}</h1>\n{highlighted(text, language)}")

    def _start(self) -> Page:
        found = self.targets
        normative = (
            f"Normative: {len(found.rules)} rules, {len(found.equations)} numbered equations, "
            f"{len(found.operations)} operations. Its code blocks are a decoder."
        )
        cards = (("spec.html", "Specification", normative), *CARDS)
        tiles = "".join(
            f'<a class="tile" href="{url}"><b>{name}</b><span>{text}</span></a>' for url, name, text in cards
        )
        body = f'<h1 id="gsvc">GSVC</h1>\n{LEAD}\n{glance.dependencies()}<div class="tiles">{tiles}</div>'
        return Page("index.html", "GSVC", "", body)

    def _linked(self, page: str, body: str, *, in_spec: bool = True) -> str:
        return Linker(self.targets, page, in_spec=in_spec).linked(body)

    def _links_of(self, name: str) -> Callable[[str], str | None]:
        """Where the links of a document lead on the site; files that are needed for it are noted."""
        folder = Path(name).parent

        def link(target: str) -> str | None:
            path, _, anchor = target.partition("#")
            if "://" in path or path.startswith("mailto:"):
                return target
            file = Path(os.path.normpath(folder / path)).as_posix() if path else name
            if file == "spec.md":
                return self.targets.headings.get(anchor, "spec.html")
            page = (self.guides | RECORDS | FOLDERS).get(file) or self._copied(file)
            return f"{page}#{anchor}" if page and anchor else page

        return link

    def _copied(self, name: str) -> str | None:
        """The URL of a file of the checkout that is not a document; None for a folder."""
        path = self.root / name
        if not path.is_file():
            return None
        if name.startswith(f"{REPORTS}/"):
            return self.files.setdefault(name, name.removeprefix("docs/"))
        if path.suffix in SOURCES:
            return self.sources.setdefault(name, f"file-{name.replace('/', '-')}.html")
        return self.files.setdefault(name, name.removeprefix("docs/"))


def _inner(body: str) -> Sequence[tuple[str, str]]:
    """Anchor and text of the headings of the second rank."""
    found = re.findall(r'<h2 id="([^"]+)">(.*?)</h2>', body, re.DOTALL)
    return [(html.unescape(anchor), re.sub(r'<a class="here".*', "", text).strip()) for anchor, text in found]


def _own(name: str) -> str:
    return resources.files("gsvc_lab.site").joinpath(name).read_text(encoding="utf-8")
