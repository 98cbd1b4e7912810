"""Numba is set up: wrong variables of the environment are explained, and vectors are as wide as the processor has."""

import os
import platform
import subprocess
import sys

import numpy as np
import pytest

from gsvc_ref import _compiler
from gsvc_ref._jit import kernel


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


@pytest.mark.parametrize(
    ("cpu", "features", "expected"),
    [
        ("sapphirerapids", "+avx2,+avx512f,+avx512vl", "+avx2,+avx512f,+avx512vl,-prefer-256-bit"),
        ("sapphirerapids", "+avx2,-avx512f", None),  # switched off, as by NUMBA_ENABLE_AVX=0 or a virtual machine
        ("znver4", "+avx2,+avx512f", None),
        ("znver3", "+avx2,-avx512f", None),
        ("apple-m1", "+neon", None),
    ],
)
def test_vectors_are_widened_where_llvm_would_make_narrow_ones(cpu, features, expected):
    assert _compiler.widened(cpu, features) == expected


@pytest.mark.parametrize(
    ("name", "features", "after"),
    [
        (None, None, ("icelake-server", "+avx512f,-prefer-256-bit")),
        ("generic", "", ("generic", "")),
        (None, "+avx2", (None, "+avx2")),
        ("skylake", None, ("skylake", None)),
    ],
)
def test_what_the_user_says_about_the_processor_stays(monkeypatch, name, features, after):
    config = _compiler.numba.config
    monkeypatch.setattr(config, "CPU_NAME", name)
    monkeypatch.setattr(config, "CPU_FEATURES", features)
    monkeypatch.setattr(_compiler.codegen.ll, "get_host_cpu_name", lambda: "icelake-server")
    monkeypatch.setattr(_compiler.codegen, "get_host_cpu_features", lambda: "+avx512f")
    _compiler.use_wide_vectors()
    assert after == (config.CPU_NAME, config.CPU_FEATURES)


WIDE = """
import llvmlite.binding
from numba.core import codegen
llvmlite.binding.get_host_cpu_name = lambda: "skylake-avx512"
codegen.get_host_cpu_features = lambda: {features!r}
import numba, numpy as np
from gsvc_ref.rendering.fast.batches import Batch, Buffers
from gsvc_ref.rendering.fast.sums import add_batch
batch = Batch(np.zeros((4, 4), np.int32), np.zeros((4, 16), np.float32))
arguments = Buffers.of(8), 0, 0, 8, batch, 0, False, False
fresh = numba.jit(**add_batch.dispatcher().targetoptions)(add_batch.__wrapped__)
fresh.compile(tuple(map(numba.typeof, arguments)))  # it is not run: this machine may have no such vectors
[code] = fresh.inspect_asm().values()
print(code.count("zmm") > 100, code.count("ymm") > 100)
"""


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="another compiler makes other code")
@pytest.mark.parametrize(
    ("features", "wide"),
    [
        ("+avx512f,+avx512vl", True),
        pytest.param("+avx2,-avx512f", False, marks=pytest.mark.exhaustive),
    ],
)
def test_the_inner_loops_have_vectors_of_512_bits(tmp_path, features, wide):
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        pytest.skip("nothing is compiled")
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_CPU_")}
    environment = {**inherited, "NUMBA_CACHE_DIR": str(tmp_path)}
    code = WIDE.format(features=features)
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=300)
    assert (found.stdout.split(), found.stderr) == ([str(wide), str(not wide)], "")


@kernel(inline=True)
def _sum_of_products(a, b, c):
    return a * b + c


@kernel(contract=True)
def _contracted_caller(a, b, c):
    return _sum_of_products(a, b, c)


def test_a_kernel_is_not_contracted_because_its_caller_is():
    """Numba hands options that a kernel leaves open down to it from the one that has it compiled."""
    a = np.float32(1 + 2.0**-12)
    assert _contracted_caller(a, a, np.float32(-1 - 2.0**-11)) == 0  # fused, it is 2^-24
