"""Commands that render nothing start without the compiler and without rendering, if the stream is small."""

import json
import subprocess
import sys

import pytest

from gsvc_ref.cli import main
from gsvc_tools.cli.reading import reading

LOADED = """
import json, sys
from {package} import main
status = main({arguments!r})
print(status, json.dumps(sorted(sys.modules)), file=sys.stderr)
"""

COMMANDS = {
    "info": ("gsvc_ref.cli", ["info", "IN", "--frames-table"]),
    "dump": ("gsvc_ref.cli", ["dump", "IN"]),
    "cut": ("gsvc_ref.cli", ["cut", "IN", "OUT", "--frames", "0:1"]),
    "concat": ("gsvc_ref.cli", ["concat", "IN", "IN", "-o", "OUT"]),
    "check": ("gsvc_conformance.__main__", ["check", "IN"]),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_neither_compiler_nor_rendering_is_loaded(command, stream, tmp_path):
    package, arguments = COMMANDS[command]
    files = {"IN": str(stream), "OUT": str(tmp_path / "out.gsvc")}
    code = LOADED.format(package=package, arguments=[files.get(argument, argument) for argument in arguments])
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100, check=False)
    status, _, loaded = run.stderr.partition(" ")
    assert status == "0", run.stderr
    assert {"numba", "scipy", "gsvc_ref.rendering"} & set(json.loads(loaded)) == set()
    assert "gsvc_ref" in json.loads(loaded)


@pytest.mark.parametrize("command", ["info", "dump"])
def test_plain_kernels_say_the_same(command, stream, capsys, monkeypatch):
    said = []
    for small in (0, stream.stat().st_size):
        with monkeypatch.context() as patch:
            patch.setattr(reading.__wrapped__, "__kwdefaults__", {"small": small})
            assert main([command, str(stream), "--json"]) == 0
        said.append(capsys.readouterr())
    assert said[0].out == said[1].out
    assert said[1].err == ""
