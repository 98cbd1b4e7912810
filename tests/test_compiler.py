"""Variables of the environment that Numba cannot use are wrong use, which a sentence explains."""

import os
import subprocess
import sys

import pytest


@pytest.mark.parametrize("command", ["encode", "compare", "run"])
def test_a_number_of_threads_that_is_none_is_wrong_use(tmp_path, command):
    """It was reported as a fault of gsvc_ref."""
    video = tmp_path / "x.y4m"
    video.write_bytes(b"YUV4MPEG2 W16 H16 F25:1 Ip C444\nFRAME\n" + bytes(range(256)) * 3)
    arguments = {
        "encode": ["gsvc_ref", "encode", str(video), str(tmp_path / "x.gsvc")],
        "compare": ["gsvc_ref", "compare", str(video), str(video), "--no-vmaf"],
        "run": ["gsvc_conformance", "run", "--reference", "--case", "core/render_sum/a_splat_in_the_middle"],
    }
    environment = {**os.environ, "NUMBA_NUM_THREADS": "0"}
    run = subprocess.run([sys.executable, "-m", *arguments[command]], capture_output=True, text=True, env=environment)
    assert run.returncode == 2, run.stderr
    assert "Numba does not start (Number of threads specified must be > 0): correct or unset" in run.stderr
    assert "NUMBA_NUM_THREADS" in run.stderr
