"""What no source may do: unpickle, evaluate text, start a shell, or speak to a network."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("gsvc_base", "gsvc_ref", "gsvc_tools", "gsvc_lab", "conformance/gsvc_conformance")
SOURCES = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]

UNPICKLING = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}
NETWORK = {"socket", "ssl", "http", "urllib", "ftplib", "smtplib", "xmlrpc", "socketserver", "asyncio", "requests"}
EVALUATING = {"eval", "exec", "compile", "__import__"}

KIT = ROOT / "conformance" / "gsvc_conformance"

MAY_EVALUATE = {ROOT / "gsvc_base" / "spec.py", KIT / "spec.py", KIT / "code_coverage.py"}
"""They run the code blocks of spec.md, a file of this project."""

MAY_UNPICKLE = {
    ROOT / "gsvc_tools" / "jobs" / "cluster.py",
    ROOT / "gsvc_tools" / "jobs" / "cluster_task.py",
    ROOT / "gsvc_lab" / "benchmarks" / "cluster.py",
}
"""They read what the machines of a cluster send each other: there each may run any code on others anyway."""

MAY_SERVE = {ROOT / "gsvc_tools" / "viewing" / "server.py"}
"""It gives the viewer to a browser of this machine, on the loopback interface alone."""

MAY_WAIT = {KIT / "adapters" / "web" / "browser.py"}
"""It drives a browser of this machine through pipes, in an event loop."""


def imported(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.partition(".")[0]


def calls(tree: ast.Module) -> Iterator[ast.Call]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.Call))


def forbidden(
    source: str,
    *,
    may_evaluate: bool = False,
    may_wait: bool = False,
    may_unpickle: bool = False,
    may_serve: bool = False,
) -> list[str]:
    """What a source does that it may not."""
    tree = ast.parse(source)
    refused = (UNPICKLING | NETWORK) - {
        *(["asyncio"] if may_wait else []), *(["pickle"] if may_unpickle else []),
        *(["http", "socket"] if may_serve else []),
    }  # fmt: skip
    found = [f"imports {name}" for name in imported(tree) if name in refused]
    for call in calls(tree):
        if isinstance(call.func, ast.Name) and call.func.id in EVALUATING and not may_evaluate:
            found.append(f"calls {call.func.id}")
        for keyword in call.keywords:
            if keyword.arg in ("shell", "allow_pickle") and not (
                isinstance(keyword.value, ast.Constant) and keyword.value.value is False
            ):
                found.append(f"says {keyword.arg}")
    return found


def test_sources() -> None:
    found = {
        path: forbidden(
            path.read_text(encoding="utf-8"),
            may_evaluate=path in MAY_EVALUATE,
            may_wait=path in MAY_WAIT,
            may_unpickle=path in MAY_UNPICKLE,
            may_serve=path in MAY_SERVE,
        )
        for path in SOURCES
    }
    assert {str(path.relative_to(ROOT)): faults for path, faults in found.items() if faults} == {}
    assert set(SOURCES) > MAY_EVALUATE | MAY_WAIT | MAY_UNPICKLE | MAY_SERVE


@pytest.mark.parametrize(
    "source",
    [
        "import pickle",
        "from urllib.request import urlopen",
        "def f():\n    import socket",
        "eval('1')",
        "exec(text)",
        "np.load(path, allow_pickle=True)",
        "subprocess.run(line, shell=yes)",
    ],
)
def test_the_check_finds(source: str) -> None:
    assert len(forbidden(source)) == 1
