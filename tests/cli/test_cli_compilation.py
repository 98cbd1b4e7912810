import os
import subprocess
import sys

import pytest
from numba.core import event

from gsvc_ref.cli.compilation import COMPILE_EVENT, compilation_notice

NOTICE = "compiling kernels for this command, once for this version"
TIMEOUT_S = 120


@pytest.mark.parametrize("silent", [False, True])
def test_the_notice_comes_once_and_only_when_something_is_compiled(capsys, silent):
    with compilation_notice("gsvc test", silent=silent) as notice:
        assert capsys.readouterr().err == ""
        assert not notice.said
        for _ in range(2):
            with event.trigger_event(COMPILE_EVENT):
                pass
    assert capsys.readouterr().err.count(f"gsvc test: {NOTICE}") == (0 if silent else 1)
    assert notice.said is not silent


def test_nothing_is_said_after_the_command(capsys):
    with compilation_notice("gsvc test", silent=False):
        pass
    with event.trigger_event(COMPILE_EVENT):
        pass
    assert capsys.readouterr().err == ""


@pytest.mark.exhaustive
def test_a_first_start_tells_and_a_second_does_not(stream, tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}

    def decode():
        command = [sys.executable, "-m", "gsvc_ref", "decode", str(stream), str(tmp_path / "out.y4m")]
        run = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=True, env=environment)
        return run.stderr

    first, second = decode(), decode()
    assert first.count(f"gsvc decode: {NOTICE}") == 1
    assert NOTICE not in second
