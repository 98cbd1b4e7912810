"""The tables of profile `main` in spec/tables.json and spec/gsvc_tables.h are what spec.md says and gsvc_ref has."""

import json
import re
import shutil
import subprocess
from math import comb, exp
from typing import Any

import numpy as np
import pytest

from gsvc_base.document import PATH
from gsvc_conformance.syntax_files import ROOT
from gsvc_conformance.tables import tables
from gsvc_ref.bitstream.crc import crc32c
from gsvc_ref.main import cells, codes, densities, models, state
from gsvc_ref.main import tables as of_main

DATA: dict[str, Any] = json.loads((ROOT / "spec/tables.json").read_text(encoding="utf-8"))
HEADER = (ROOT / "spec/gsvc_tables.h").read_text(encoding="utf-8")
MODELS = ("vector", "mode", "position", "shape", "color")


def test_checksums_are_those_of_the_document() -> None:
    section = PATH.read_text(encoding="utf-8").partition("### 15.3 Tables")[2].partition("### 15.4")[0]
    rows = re.findall(
        r"^\| ([A-Z0-9]+)(?:, ([A-Z]+))?(?: \([^|]*\))? \| (\d+)[^|]* \| (\d) \| ([^|]*) \|", section, re.MULTILINE
    )
    assert len(rows) == 5
    for *names, count, size, checksums in rows:
        for name, checksum in zip(filter(None, names), checksums.split(", "), strict=True):
            parts = [
                DATA[key] for key in ([f"MODELS_{model.upper()}" for model in MODELS] if name == "MODELS" else [name])
            ]
            numbers = np.concatenate([np.ravel(part) for part in parts])
            assert len(numbers) == int(count)
            assert f"{crc32c(numbers.astype(f'<u{size}').tobytes()):08X}" == checksum


def test_gsvc_ref_has_the_same() -> None:
    assert DATA["EXP2"] == of_main.EXP2.tolist()
    assert DATA["LOGISTIC"] == of_main.LOGISTIC.tolist()
    assert DATA["LAPLACE"] == of_main.LAPLACE.tolist()
    assert DATA["HALVES"] == cells.HALVES.tolist()
    assert DATA["ALPHAS"] == list(densities.ALPHAS)
    assert DATA["SIDES"] == list(codes.SIDES)
    assert DATA["MAIN_K"] == list(state.MAIN_K)
    assert DATA["HALVED_REACH"] == list(state.HALVED_REACH)
    for name in MODELS:
        rows, symbols = models.MODELS[name], models.SYMBOLS[name]
        assert DATA[f"MODELS_{name.upper()}"] == [[*row, *[1] * (symbols - len(row))] for row in rows]


def test_tables_are_of_what_they_are_named_for() -> None:
    assert DATA["EXP2"] == [round(2 ** (15 + i / 1024)) for i in range(1024)]
    for i in range(1, 256):
        x = (i - 128) * 96 / 1024 * np.log(2)
        assert DATA["LOGISTIC"][i] == pytest.approx(2**16 / (1 + exp(-x)), abs=2)
        assert DATA["LAPLACE"][i] == pytest.approx(2**15 * exp(x) if x < 0 else 2**16 - 2**15 * exp(-x), abs=2)
    place = 0
    for alpha in DATA["ALPHAS"]:
        for n in range(1, 16):
            chances = [
                comb(n, k) * rising(alpha, k) * rising(alpha, n - k) / rising(2 * alpha, n) for k in range(n + 1)
            ]
            wanted = np.arange(1, n + 1) + (2**14 - n - 1) * np.cumsum(chances)[:-1]
            assert DATA["HALVES"][place : place + n] == pytest.approx(wanted, abs=2.5)
            place += n
    assert place == len(DATA["HALVES"])


def rising(x: int, n: int) -> int:
    """X (x + 1) … (x + n - 1)."""
    return int(np.prod([x + i for i in range(n)], dtype=object)) if n else 1


def test_the_header_has_the_same_numbers() -> None:
    found = dict(re.findall(r"GSVC_(\w+)(?:\[\d+\])+ = ([^;]*);", HEADER))
    in_header = {name: json.loads(text.replace("{", "[").replace("}", "]")) for name, text in found.items()}
    assert in_header == DATA == {name: table.tolist() for name, table in tables().items()}


@pytest.mark.parametrize(
    ("compiler", "options"), [("cc", ["-x", "c", "-std=c99"]), ("c++", ["-x", "c++", "-std=c++17"])]
)
def test_compilers_take_the_header(tmp_path: Any, compiler: str, options: list[str]) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"there is no {compiler} here")
    program = tmp_path / "program.c"
    twice = '#include "gsvc_tables.h"\n' * 2
    right = f"GSVC_HALVES[959] == {DATA['HALVES'][-1]} && GSVC_MODELS_MODE[9][8] == 22"
    program.write_text(f"{twice}int main(void) {{ return {right} ? 0 : 1; }}\n")
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{ROOT / 'spec'}"]
    subprocess.run([compiler, *options, *strict, str(program), "-o", str(tmp_path / "run")], check=True)
    subprocess.run([str(tmp_path / "run")], check=True)
