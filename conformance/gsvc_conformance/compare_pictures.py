"""Compare pictures with what the glTF files beside this script must show. It needs NumPy alone.

    python compare_pictures.py FOLDER          # FOLDER/ID.npy for each picture, such as core/render_sum/one_splat.npy
    python compare_pictures.py FOLDER --plain  # only pictures that need nothing beyond KHR_gaussian_splatting

A picture is an .npy file (H, W, 3); row 0 is the top one. It has floating point, where 1 is white and nothing is
clamped, or samples: u2 where index.json has a bit_depth above 8, else u1. Each number must lie between lowest.npy and
highest.npy of its ID. Where index.json has a bit_depth these are samples: a picture of floating point is clamped to
0..1, multiplied by 2**bit_depth - 1 and rounded first. Elsewhere they are a sum, and for a picture of samples these
two are clamped, multiplied by 255 and rounded. Exit code 0: all are right; 1: one is wrong; 2: none is there.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).parent
EPSILON = 2.0**-23
MAX_BYTES = 1 << 28


def read(path: Path) -> tuple[NDArray[Any] | None, str]:
    """A picture, or what is wrong with its file, a sentence."""
    try:
        if path.stat().st_size > MAX_BYTES:
            return None, f"has {path.stat().st_size:,} bytes; at most {MAX_BYTES:,} are read"
        with path.open("rb") as file:
            return np.lib.format.read_array(file, allow_pickle=False), ""
    except Exception as error:  # any file may be there, and the other pictures must be judged
        return None, f"is not an .npy file of numbers ({type(error).__name__}: {error})"


def allowed(home: Path, of_samples: bool) -> tuple[NDArray[Any], NDArray[Any]]:
    """The least and the largest number that each sample may be."""
    low, high = np.load(home / "lowest.npy"), np.load(home / "highest.npy")
    if of_samples and low.dtype.kind == "f":  # a sum, which becomes samples
        low = np.rint(np.clip(low, 0, 1) * 255 * (1 - EPSILON)).astype(np.uint8)
        high = np.rint(np.clip(high, 0, 1) * 255 * (1 + EPSILON)).astype(np.uint8)
    return low, high


def judge(home: Path, picture: NDArray[Any], bit_depth: int | None) -> str:
    """What is wrong with a picture, a sentence; empty if nothing is. A sum has no `bit_depth`."""
    floating = picture.dtype.kind == "f"
    low, high = allowed(home, not floating)
    if picture.shape != low.shape:
        return f"has the shape {picture.shape}; it must be {low.shape}"
    if not floating and picture.dtype != low.dtype:
        return f"has numbers of type {picture.dtype}; they must be {low.dtype} or floating point"
    if floating and bit_depth:  # becomes samples, by R-9.1-1 of spec.md (the operation to_frame)
        picture = np.rint(np.clip(picture.astype(np.float64), 0, 1) * (2**bit_depth - 1))
    wide = picture.astype(np.float64)
    beyond = np.maximum(low - wide, wide - high)
    wrong = ~(beyond <= 0)
    if not wrong.any():
        return ""
    row, column, channel = np.unravel_index(np.argmax(np.where(np.isnan(beyond), np.inf, beyond)), beyond.shape)
    place = (row, column, channel)
    middle, half = (low[place] + high[place].astype(np.float64)) / 2, (high[place].astype(np.float64) - low[place]) / 2
    times = f", an error {abs(wide[place] - middle) / half:.3g} times what is allowed" if half else ""
    return (
        f"is {picture[place]!s} at x {column}, y {row}, {'RGB'[channel]}; {low[place]!s} to {high[place]!s} are right"
        f"{times} ({np.count_nonzero(wrong)} of {wrong.size} samples are wrong)"
    )


def main(words: list[str]) -> int:
    """Judge the pictures of a folder."""
    plain = "--plain" in words
    folders = [word for word in words if not word.startswith("--")]
    if len(folders) != 1 or set(words) - {"--plain", *folders}:
        print(__doc__, file=sys.stderr)
        return 2
    there = wrong = 0
    for entry in json.loads((HERE / "index.json").read_text(encoding="utf-8"))["pictures"]:
        path = Path(folders[0], f"{entry['id']}.npy")
        if not path.is_file() or (plain and entry["needs"]):
            continue
        there += 1
        picture, sentence = read(path)
        if picture is not None:
            sentence = judge(HERE / entry["id"], picture, entry.get("bit_depth"))
        if sentence:
            wrong += 1
            needs = f" (needs {', '.join(entry['needs'])})" if entry["needs"] else ""
            print(f"WRONG {entry['id']}{needs}: {sentence}")
    print(f"{there - wrong} of {there} pictures are right" if there else f"{folders[0]} has no ID.npy of index.json")
    return 2 if not there else 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
