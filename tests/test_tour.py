"""docs/tour.md: its paths and names exist, its table has the rooms in the order of their use, its numbers are right."""

import ast
import re
from contextlib import chdir
from dataclasses import fields
from functools import cache
from itertools import chain
from pathlib import Path

import numpy as np
import pytest

import gsvc_ref
from gsvc_base.syntax import named
from gsvc_ref.main.tables import step_of
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, split_chunks, write_stream

ROOT = Path(__file__).parents[1]
TOUR = ROOT / "docs" / "tour.md"
TEXT = TOUR.read_text(encoding="utf-8")
LINKS = re.findall(r"\[([^\]]*)\]\(([^)]*)\)", TEXT)


@cache
def defined(path):
    """The names of a module: functions, classes, `Class.method`, and what it assigns."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.ClassDef):
            names |= {
                node.name,
                *(f"{node.name}.{part.name}" for part in node.body if isinstance(part, ast.FunctionDef)),
            }
        elif isinstance(node, ast.AnnAssign | ast.Assign):
            targets = [node.target] if isinstance(node, ast.AnnAssign) else node.targets
            names |= {target.id for target in targets if isinstance(target, ast.Name)}
    return names


@pytest.mark.parametrize(("words", "target"), LINKS)
def test_what_is_linked_exists(words, target):
    path = (TOUR.parent / target.partition("#")[0]).resolve()
    assert path.exists(), f"docs/tour.md: there is no {target}"
    name = re.fullmatch(r"`([\w.]+)`", words)
    if name:
        assert name[1] in defined(path), f"docs/tour.md: {target} has no {name[1]}"
    elif "/" in words:
        assert path == ROOT / words


def test_names_without_a_link_stand_beside_one():
    linked = {words.strip("`").split(".")[-1] for words, _ in LINKS}
    plain = set(re.findall(r"(?<!\[)`([a-z]+_[a-z_]+)`", TEXT))
    elements, settings = set(named()), {field.name for field in fields(gsvc_ref.Settings)}
    assert plain - linked <= elements | settings | {"adan_step"}  # the function of spec.md


def rooms():
    """The rooms of the table's rows, from the top down."""
    table = TEXT[TEXT.index("| room |") :].partition("\n\n")[0]
    rows = [
        re.findall(r"\]\(\.\./(?:conformance/)?([\w/]+)\)", row.split("|")[1]) for row in table.splitlines()[2:] if row
    ]
    return [[room.replace("/", ".") for room in row] for row in rows]


def imported(path):
    """The modules that a file imports, wherever in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_every_room_of_the_package_is_in_the_table():
    packages = {f"gsvc_ref.{path.parent.name}" for path in ROOT.glob("gsvc_ref/*/__init__.py")}
    others = {path.parent.name for home in (ROOT, ROOT / "conformance") for path in home.glob("gsvc_*/__init__.py")}
    assert packages | others | {"gsvc_ref.encoder.main", "viewer"} == set(chain(*rooms()))


def test_rooms_use_those_above_them():
    levels = {room: level for level, row in enumerate(rooms()) for room in row}
    upward = []
    for room, level in levels.items():
        if room in ("gsvc_ref", "viewer"):  # gsvc_ref/__init__.py names what the rooms offer
            continue
        for path in ROOT.glob(f"{room.replace('.', '/')}/**/*.py"):
            for module in imported(path):
                used = max((other for other in levels if f"{module}.".startswith(f"{other}.")), key=len, default=None)
                if used not in (None, "gsvc_ref", room) and levels[used] > level:
                    upward.append(f"{path.relative_to(ROOT)} uses {module}")
    assert upward == []


PLAIN = " ".join(TEXT.split())
"""The text in one line."""


@pytest.fixture(scope="module")
def splat_of_main(tmp_path_factory):
    """The frames that the tour encodes, and the stream that its lines of Python make."""
    code = re.search(r"^```python\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)[1]
    names = {}
    with chdir(tmp_path_factory.mktemp("tour")):
        exec(code, names)
        return names["frames"], Path("splat.gsvc").read_bytes()


def shown(values):
    """Numbers as the tour writes them."""
    return f"({', '.join(map(str, np.ravel(values).tolist()))})".replace("-", "−")


def test_the_codes_of_the_tour(splat_of_main):
    _, stream = splat_of_main
    listed = gsvc_ref.read_main_stream(stream)
    assert bytes(listed.frame_types) == b"IPR"
    assert listed.modes.tolist() == [0]
    assert f"Its one vector is {shown(listed.fields)}, in quarter pixels" in PLAIN
    codes = next(iter(StreamReader(stream))).codes
    assert f"`quantizer` {codes.quantizer}" in PLAIN
    assert f"D, the step of all codes, is {step_of(codes.quantizer) / 16:g}" in PLAIN
    new = codes.new
    said = f"cell {shown(new.cells)}, the place {shown(new.places)} in it, the shape {shown(new.shapes)} and the colour"
    assert f"{said} {shown(new.colors)}" in PLAIN
    X, _, A, *_ = listed.states[0].tolist()
    assert f"X = 1024 + 32 · 16 + 8 = {X}" in PLAIN
    assert f"A = 205 · 5 = {A}" in PLAIN
    assert f"X = {listed.states[1][0]}." in PLAIN


def test_the_bytes_of_the_tour(splat_of_main):
    chunks = dict(split_chunks(splat_of_main[1]))
    intra, predicted = (chunks[letter].hex(" ").upper() for letter in (b"I", b"P"))
    assert f"Ours takes {len(chunks[b'I'])} bytes as an I-frame: `{intra[:11]}`" in PLAIN
    assert "18 bytes of densities follow" in PLAIN
    state, raw = intra[3 * (4 + 18) :][:11], intra[3 * (4 + 18 + 4) :]
    assert f"raw bits after it: `{state}` and `{raw}`" in PLAIN
    assert f"a state and a raw byte: `{predicted}`" in PLAIN


def test_the_pixel_of_the_tour(splat_of_main):
    frames, stream = splat_of_main
    x, y, l11, l21, l22, *color = gsvc_ref.reconstruct_stream(stream).parameters[0].tolist()
    assert f"x = {x}, y = {y}, l11 = l22 = {l11:.5f}" in PLAIN
    assert (l21, l22) == (0, l11)
    colors = f"({', '.join(f'{value:.5f}' for value in color)})"
    assert f"the colour {colors}" in PLAIN
    sigma = (((6.5 - x) / l11) ** 2 + ((4.5 - y) / l22) ** 2) / 2
    g = np.exp(-sigma)
    assert f"σ = {sigma:.5f} and g = {g:.5f}" in PLAIN
    pixel = next(gsvc_ref.decode(stream))[4, 6]
    assert f"255 · {g:.5f} · {colors} = {shown(pixel)}." in PLAIN
    assert np.rint(255 * g * np.array(color)).tolist() == pixel.tolist()
    assert f"The source has {shown(frames[0, 4, 6])}." in PLAIN


def test_the_pixel_of_profile_paper():
    stream = write_stream(OVERVIEW_HEADER, overview_frames(), index=False)
    pixel = next(gsvc_ref.decode(stream))[4, 6]
    assert f"{shown(pixel)}." in TEXT
    g = np.exp(-1 / 32)
    assert f"g = {g:.5f}" in TEXT
    assert np.rint(255 * g * np.array([0.75, 0.5, 0.25])).tolist() == pixel.tolist()


@pytest.mark.parametrize("name", ["adapt_model", "half_frequencies", "pruning_plan", "splat_classes"])
def test_an_operation_is_named_where_the_list_of_places_says(name):
    part = TEXT[TEXT.index("**... add an operation?**") : TEXT.index("**... change what is in a stream?**")]
    places = [(TOUR.parent / target).resolve() for _, target in re.findall(r"\[([^\]]*)\]\(([^)]*)\)", part)]
    kit = ROOT / "conformance" / "gsvc_conformance"
    sources = [path for path in kit.rglob("*.py") if "adapters" not in path.parts]
    sources += [ROOT / "spec.md", *(ROOT / "gsvc_ref").rglob("*.pyi")]
    naming = [path for path in sources if re.search(rf"\b{name}\b", path.read_text(encoding="utf-8"))]
    assert len(naming) >= 5
    assert [path for path in naming if not any(path.is_relative_to(place) for place in places)] == []
