"""spec/gsvc_tables.h and spec/tables.json: the tables of profile `main` as numbers (spec.md section 15.3)."""

import json
from collections.abc import Mapping
from textwrap import fill
from typing import Final

import numpy as np

from gsvc_base import spec
from gsvc_base.arrays import I8

HEAD: Final = """\
/* Tables of profile `main` of GSVC, by spec.md section 15.3. `gsvc-conformance syntax --write` writes this file: do not
 * edit it. C99 or C++17. HALVES has C[1] to C[n] of (15-8) for each alpha of ALPHAS and for n = 1 to 15: those of alpha
 * number a and of n begin at 120 a + n (n - 1) / 2. MODELS are the counts of (15-11) at an I-frame. MAIN_K are the
 * factors of (15-5), HALVED_REACH the F_h of (5-2), and SIDES those of the cells of motion in pixels, by motion_cell.
 */
#ifndef GSVC_TABLES_H
#define GSVC_TABLES_H
#include <stdint.h>
"""


def tables() -> Mapping[str, I8]:
    """The tables by name: of one dimension, and of models (contexts, symbols)."""
    models = {f"MODELS_{name.upper()}": model["counts"] for name, model in spec.new_models().items()}
    names = ("EXP2", "LOGISTIC", "LAPLACE", "ALPHAS", "HALVES", "MAIN_K", "HALVED_REACH", "SIDES")
    return {**{name: np.array(getattr(spec, name), np.int64) for name in names}, **models}


def tables_json() -> str:
    """The text of spec/tables.json: lists by name, those of models of lists for each context."""
    return "{\n" + ",\n".join(f'"{name}": {json.dumps(table.tolist())}' for name, table in tables().items()) + "\n}\n"


def tables_header() -> str:
    """The text of spec/gsvc_tables.h."""
    parts = [HEAD]
    for name, table in tables().items():
        bits = next(bits for bits in (8, 16, 32) if table.max() < 1 << bits)
        shape = "".join(f"[{side}]" for side in table.shape)
        rows = "},\n{".join(map(_lines, table)) if table.ndim > 1 else _lines(table)
        braces = ("{{", "}}") if table.ndim > 1 else ("{", "}")
        parts.append(f"static const uint{bits}_t GSVC_{name}{shape} = {braces[0]}\n{rows}{braces[1]};\n")
    return "\n".join([*parts, "#endif\n"])


def _lines(row: I8) -> str:
    return fill(", ".join(map(str, row.tolist())), 118)
