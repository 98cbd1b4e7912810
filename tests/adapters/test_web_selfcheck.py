"""The page's own check against the vectors: over HTTP, from a folder that is chosen, and from one that is dropped."""

import shutil

import pytest

pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")

import web_pages

from gsvc_conformance.adapters import web
from gsvc_conformance.adapters.web import browser
from gsvc_conformance.operation import operations
from gsvc_conformance.vector import VECTORS, set_hash

ROOT = VECTORS.parent
WEB = "conformance/gsvc_conformance/adapters/web"
SOME = [
    "decode_plane", "from_half", "to_half", "reconstruct_intra", "reconstruct_inter", "parameter_checksum",
    "rendering_work", "to_frame", "render_frame", "codes_of_classes", "cells_of_halves", "field_vectors",
    "splat_classes", "main_intra", "motion_of_splats", "main_inter", "state_parameters", "main_work",
]  # fmt: skip
CHECK = "async ([url, only]) => GSVC.selfCheck(await GSVC.vectorsAt(url), { only })"


@pytest.fixture(scope="module")
def server():
    with web_pages.serving(ROOT) as url:
        yield url


@pytest.fixture(scope="module")
def open_page():
    """open_page(url): a page of the browser; what it complains of is an error."""
    with web_pages.pages() as blank:

        def opened(url):
            page = blank()
            page.goto(url)
            return page

        yield opened


def some_vectors(folder, *parts):
    """A copy of the vectors of operations, such as core/to_half, with the sums of all, in `folder`/vectors."""
    for part in parts:
        shutil.copytree(VECTORS / part, folder / "vectors" / part)
    shutil.copy(VECTORS / "SHA256SUMS", folder / "vectors")
    return folder / "vectors"


@pytest.fixture(scope="module")
def served_page(open_page, server):
    page = open_page(f"{server}{WEB}/operations.html")
    page.evaluate("() => GSVC.bridge.start('auto')")
    return page


@pytest.fixture(scope="module")
def local_page(open_page):
    return open_page(browser.PAGE.as_uri())


@pytest.fixture(scope="module")
def checked(served_page):
    return served_page.evaluate(CHECK, ["../../../../vectors/", SOME])


def test_a_right_decoder_passes(checked, vector_folder):
    assert checked["failures"] == []
    assert checked["complete"]
    for row in checked["rows"]:
        assert row["vectors"] == sum(name.split("/")[1] == row["operation"] for name in vector_folder.names)
        assert row["wrong"] == 0
        assert row["passed"] == row["vectors"] or row["group"] == "rendering"  # there may be no renderer
    assert [row["operation"] for row in checked["rows"]] == SOME
    checks = {row["operation"]: row["checks"] for row in checked["rows"]}
    assert (checks["to_half"], checks["to_frame"], checks["render_frame"]) == (["exact"], ["decision"], ["interval"])
    verdicts = {group["name"]: group["verdict"] for group in checked["classes"]}
    assert verdicts == {
        "bitstream": "incomplete",
        "reconstruction": "passed",
        "rendering": "incomplete",
        "deterministic": "not claimed",
        "seeking": "not claimed",
        "sizes": "not claimed",
        "layers": "not claimed",
    }


def test_the_set_of_vectors_is_named_by_its_hash(checked):
    assert checked["verified"]
    assert checked["sums"] == set_hash()


def test_every_operation_of_the_page_is_of_a_class_that_a_decoder_claims(served_page):
    script = """
    async () => {
      const { classes } = await GSVC.selfCheck({ ids: [], listed: [] });
      return { names: Object.keys(GSVC.operations), classes: classes.map(({ name }) => name) };
    }
    """
    page = served_page.evaluate(script)
    classes = ["bitstream", "reconstruction", "rendering", "deterministic", "seeking", "sizes", "layers"]
    assert page["classes"] == classes
    assert set(page["names"]) == {
        name for name, operation in operations().items() if operation.group in page["classes"]
    }
    assert all(callable(getattr(web, name)) for name in page["names"])


def test_a_wrong_decoder_fails_and_is_told_where(served_page):
    script = """
    async () => {
      const { from_half, to_frame } = GSVC.operations;
      GSVC.operations.from_half = async (inputs) => {
        const outputs = await from_half(inputs);
        outputs.values.data[1] += 1;
        return outputs;
      };
      GSVC.operations.to_frame = async () => { throw new Error("out of ink"); };
      const told = [];
      const options = { only: ["from_half", "to_frame"], onProgress: (progress) => told.push(progress) };
      const result = await GSVC.selfCheck(await GSVC.vectorsAt("../../../../vectors/"), options);
      Object.assign(GSVC.operations, { from_half, to_frame });
      return { ...result, told };
    }
    """
    result = served_page.evaluate(script)
    assert [(row["operation"], row["passed"]) for row in result["rows"]] == [("from_half", 0), ("to_frame", 0)]
    verdicts = {group["name"]: group["verdict"] for group in result["classes"]}
    assert (verdicts["reconstruction"], verdicts["rendering"]) == ("failed", "failed")
    messages = {failure["id"].split("/")[1]: failure["message"] for failure in result["failures"]}
    assert messages["to_frame"] == "out of ink"
    assert "at [1]" in messages["from_half"]
    assert [progress["done"] for progress in result["told"]] == list(range(1, result["told"][-1]["total"] + 1))


def test_it_can_be_ended(served_page):
    script = """
    async () => {
      const ending = new AbortController();
      const options = { signal: ending.signal, onProgress: ({ done }) => done === 3 && ending.abort() };
      return GSVC.selfCheck(await GSVC.vectorsAt("../../../../vectors/"), options);
    }
    """
    result = served_page.evaluate(script)
    assert not result["complete"]
    assert "passed" not in {group["verdict"] for group in result["classes"]}
    assert sum(row["vectors"] for row in result["rows"]) == 3


def test_vectors_that_are_not_those_of_the_sums_are_refused(open_page, tmp_path):
    folder = some_vectors(tmp_path, "core/from_half", "stress/from_half")
    path = next(folder.glob("core/from_half/*/values.expected.npy"))
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    shutil.copytree(ROOT / WEB, tmp_path / "web")
    script = f"{CHECK}.catch((error) => error.message)"
    with web_pages.serving(tmp_path) as url:
        page = open_page(f"{url}web/operations.html")
        message = page.evaluate(script, ["../vectors/", ["from_half"]])
    assert message == f"{path.relative_to(folder).as_posix()} is not what SHA256SUMS says"


def test_a_folder_that_is_chosen(local_page, tmp_path):
    some_vectors(tmp_path, "core/to_half", "core/reconstruct_intra")
    script = """
    () => {
      const kind = { type: "file", webkitdirectory: true, id: "folder" };
      document.body.append(Object.assign(document.createElement("input"), kind));
    }
    """
    local_page.evaluate(script)
    local_page.set_input_files("#folder", tmp_path / "vectors")
    script = "async () => GSVC.selfCheck(await GSVC.vectorsAmong(document.querySelector('#folder').files))"
    result = local_page.evaluate(script)
    assert [(row["operation"], row["wrong"]) for row in result["rows"]] == [("to_half", 0), ("reconstruct_intra", 0)]
    assert {group["name"] for group in result["classes"] if group["verdict"] == "incomplete"} == {"reconstruction"}
    assert result["sums"] == set_hash()


WAIT_FOR_A_DROP = """
(how) => {
  if (how === "entries") delete DataTransferItem.prototype.getAsFileSystemHandle;
  document.ondragover = (event) => event.preventDefault();
  document.ondrop = (event) => {
    event.preventDefault();
    window.dropped = GSVC.droppedFiles(event.dataTransfer);
  };
}
"""


@pytest.mark.parametrize(
    ("dropped", "sums", "how"),
    [("vectors", True, "handles"), ("vectors", True, "entries"), ("vectors/faulty", False, "handles")],
)
def test_a_folder_that_is_dropped(open_page, server, tmp_path, dropped, sums, how):
    # Browsers without handles have entries; Chromium has both, but its entries fail on a page of a disk.
    page = open_page(browser.PAGE.as_uri() if how == "handles" else f"{server}{WEB}/operations.html")
    some_vectors(tmp_path, "core/from_half", "faulty/reconstruct_stream")  # entries come a hundred at a time
    page.evaluate(WAIT_FOR_A_DROP, how)
    drop(page, tmp_path / dropped)
    found = page.evaluate("async () => (window.vectors = await GSVC.vectorsAmong(await dropped)).ids")
    expected = [path.parent.relative_to(tmp_path / "vectors") for path in (tmp_path / dropped).rglob("manifest.json")]
    assert found == sorted(path.as_posix() for path in expected)
    assert len(found) > 100
    result = page.evaluate("() => GSVC.selfCheck(window.vectors, { only: ['from_half'] })")
    assert [row["passed"] for row in result["rows"]] == ([2] if sums else [])
    assert result["verified"] == sums


def drop(page, path):
    """Drop a folder on a page, as a user does."""

    async def sent():
        session = await page.page.context.new_cdp_session(page.page)
        data = {"items": [], "files": [str(path)], "dragOperationsMask": 1}
        for event in ("dragEnter", "dragOver", "drop"):
            await session.send("Input.dispatchDragEvent", {"type": event, "x": 50, "y": 20, "data": data})
        await session.detach()

    browser.wait(sent())


def test_a_folder_without_vectors_is_refused(local_page):
    script = "() => GSVC.vectorsAmong([new File([], 'holiday.jpg')]).catch((error) => error.message)"
    assert "choose the folder vectors" in local_page.evaluate(script)
