"""Hypothesis profiles: `quick` for every day and CI, `long` on demand (`pytest --hypothesis-profile=long`).

`pytest --versions` runs only what a version of a package may change.
"""

import re
from functools import cache
from pathlib import Path

from hypothesis import HealthCheck, settings

# The first call of a kernel compiles it, which no deadline and no health check should mistake for a slow test.
# The examples are the same each time, so that many of them find little more than some; `long` draws others.
settings.register_profile(
    "quick", max_examples=50, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow],
    print_blob=True,
)  # fmt: skip
settings.register_profile("long", settings.get_profile("quick"), derandomize=False, max_examples=2000)
settings.load_profile("quick")

TESTS = Path(__file__).parent
NAMES = {"pillow": "PIL", "pyyaml": "yaml", "scikit-image": "skimage", "fluster-conformance": "fluster"}
"""Of packages that are imported under another name."""
LEFT_OUT = {"numpy", "hypothesis", "pytest", "pytest-xdist", "playwright"}
"""What most tests import, and what drives a browser, which has a version of its own."""
IMPORT = re.compile(r"^ *(?:from|import|.*importorskip\(\")\W*(\w+)", re.MULTILINE)


def pytest_addoption(parser):
    parser.addoption(
        "--versions", action="store_true",
        help="only tests of rooms of gsvc_ref with many kernels, and those that import a package with a lowest version",
    )  # fmt: skip


def pytest_ignore_collect(collection_path, config):
    if (
        config.getoption("--versions")
        and collection_path.match("test_*.py")
        and not depends_on_versions(collection_path)
    ):
        return True
    return None


def depends_on_versions(path):
    room = TESTS.parent / "gsvc_ref" / path.parent.relative_to(TESTS)
    sources = [source.read_text("utf-8") for source in room.rglob("*.py")] if path.parent != TESTS else []
    if 10 * sum("gsvc_ref._jit" in source for source in sources) > len(sources):
        return True
    return not packages().isdisjoint(IMPORT.findall(path.read_text("utf-8")))


@cache
def packages():
    """The packages whose lowest versions are tested, by the names under which they are imported."""
    lines = (TESTS / "supply_chain" / "lowest.txt").read_text("utf-8").splitlines()
    given = {line.partition("==")[0] for line in lines if not line.startswith("#")} - LEFT_OUT
    return {NAMES.get(name, name.replace("-", "_")) for name in given}
