"""The commands work where there is no network, and do not try to reach one."""

import subprocess
import sys
from pathlib import Path

import pytest

OFFLINE = """
import sys

def refuse(event, arguments):
    if event.startswith("socket.") and event != "socket.__new__":
        raise AssertionError(f"{event} {arguments}")

sys.addaudithook(refuse)
"""
"""Only making a socket object is let through: libraries ask at import whether IPv6 is there."""

COMMANDS = {
    "gsvc": OFFLINE
    + """
from gsvc_ref.cli import main

source, folder = sys.argv[1:]
stream = f"{folder}/clip.gsvc"
for line in (["encode", source, stream, "--splats", "20"], ["info", stream],
             ["decode", stream, f"{folder}/clip.y4m"], ["compare", source, stream]):
    code = main([*line, *(["--quiet"] if line[0] in ("encode", "decode") else [])])
    if code:
        raise SystemExit(code)
""",
    "conformance": OFFLINE
    + """
from gsvc_conformance.__main__ import main

raise SystemExit(main(["run", "--reference", "--operation", "from_half"]))
""",
}


@pytest.mark.parametrize("name", COMMANDS)
def test_no_command_opens_a_connection(name: str, tmp_path: Path) -> None:
    source = tmp_path / "source.y4m"
    frame = b"FRAME\n" + bytes(range(192)) * 4
    source.write_bytes(b"YUV4MPEG2 W16 H16 F25:1 C444\n" + 3 * frame)
    result = subprocess.run(
        [sys.executable, "-c", COMMANDS[name], str(source), str(tmp_path)],
        cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_hook_would_notice() -> None:
    script = OFFLINE + "import socket; socket.create_connection(('127.0.0.1', 9))"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False)
    assert "AssertionError: socket." in result.stderr
