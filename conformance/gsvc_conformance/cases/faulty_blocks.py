"""Faults of splat blocks: flags, quantisers and codebooks, what is kept of them, positions."""

from collections.abc import Iterator
from functools import partial
from typing import Final

from gsvc_conformance.cases.faults import Broken, colored, each_of, four, overview, three, with_an_empty_frame
from gsvc_ref.testing import Lie

INFINITE_HIGH_BYTE: Final = 0x7C
"""position_high of infinities and of what is not a number."""


def block_faults() -> Iterator[Broken]:
    """Faults of flags, of what blocks keep, and of positions."""
    reserved = {f"bits_{bits:03b}": (f"block_reserved is {bits}", (Lie("block_reserved", bits),)) for bits in (1, 2, 4)}
    yield from each_of("R-6.5-1", "unsupported", "it is reserved and 0", reserved, overview)
    yield from each_of("R-6.5-2", "invalid", "an intra block has all attributes", _absent(), overview)
    alone = {n: (f"{n}_present is 1 without the attribute", (Lie(f"{n}_present", 1, 1),))
             for n in ("quantizer", "codebooks")}  # fmt: skip
    yield from each_of("R-6.5-3", "invalid", "it is 0 where the attribute is not present", alone, overview, 1)
    what_there_is = {
        0: ("first_block", "there are none to use", 0, (0, 1)),
        1: ("inter", "what intra blocks have is not for inter blocks", 1, (2,)),
        2: ("second_i_frame", "an I-frame forgets", 2, (3, 4)),
    }
    for block, (name, truth, complete, stages) in what_there_is.items():
        for n, lies in (("quantizer", _no_quantizer(block)), ("codebooks", _no_codebooks(block, stages))):
            entry = {f"{name}_{n}": (f"block {block} has no {n} of its own", lies)}
            yield from each_of("R-6.5-4", "invalid", truth, entry, three, complete)
    for n, lies in (("quantizer", _no_quantizer(1)), ("codebooks", _no_codebooks(1, (2, 3)))):
        entry = {f"empty_i_frame_{n}": (f"after an I-frame without splats, a block has no {n} of its own", lies)}
        yield from each_of("R-6.5-4", "invalid", "every I-frame forgets", entry, with_an_empty_frame, 2)
    for n, lies in (("quantizer", _no_quantizer(3)), ("codebooks", _no_codebooks(3, (5,)))):
        entry = {f"second_i_frame_inter_{n}": (f"after a second I-frame, differences have no {n} of their own", lies)}
        yield from each_of("R-6.5-4", "invalid", "an I-frame forgets those of inter blocks, too", entry, four, 3)
    scales = {"zero": 0.0, "minus_zero": -0.0, "negative": -1.0, "subnormal": 2.0**-126 - 2.0**-149, "least": 2.0**-149}
    yield from each_of("R-6.5-5", "invalid", "it is a positive normal number",
                     {f"scale_{k}": (f"cholesky_scale is {v:.7g}", (Lie("cholesky_scale", [v], 1),))
                      for k, v in scales.items()}, overview)  # fmt: skip
    for name in ("stage_count", "codeword_count"):
        yield from each_of("R-6.5-6", "invalid", "it is 1, as the header has it",
                           {f"{name}_{n or 'zero'}": (f"{name} is {n}", (Lie(name, n),)) for n in (0, 255)},
                           overview)  # fmt: skip
    for name, there, counted in (("stage_count", 2, "color_stages"), ("codeword_count", 5, "color_codewords")):
        yield Broken("R-6.5-6", "invalid", f"{name}_{there}", f"{name} is {there}, all of them are there",
                     f"the header allows {there - 1}", partial(colored, 1, Lie(counted, there - 1)))  # fmt: skip
    positions = {
        "x_infinite": ("a position is infinite", (Lie("symbol", INFINITE_HIGH_BYTE),)),
        "y_infinite": ("a position is -infinity", (Lie("position_high[y].symbol", INFINITE_HIGH_BYTE | 0x80),)),
        "x_not_a_number": ("a position is NaN", (Lie("symbol", 0x7F), Lie("symbol", 0xFF, 1))),
    }
    yield from each_of("R-6.5-7", "invalid", "positions are finite", positions, overview)
    difference = {"difference": ("a difference is NaN", (Lie("symbol", INFINITE_HIGH_BYTE | 0x83, 9),))}
    yield from each_of("R-6.5-7", "invalid", "positions are finite", difference, overview, 1)


def _absent() -> dict[str, tuple[str, tuple[Lie, ...]]]:
    """An intra block without an attribute and all that would belong to it, so that the rest is read as it is meant."""
    planes = {
        "positions": [f"position_{part}[{axis}]" for axis in "xy" for part in ("high", "low")],
        "cholesky": [f"cholesky_code[{channel}]" for channel in ("l11", "l21", "l22")],
        "colors": ["color_index[1]"],
    }
    numbers = {
        "cholesky": [
            Lie("quantizer_present", 0),
            *(Lie(f"cholesky_{n}", [], k) for n in ("scale", "offset") for k in range(3)),
        ],
        "colors": [Lie("codebooks_present", 0), *(Lie(n, "") for n in ("stage_count", "codeword_count", "codeword"))],
    }
    found = {}
    for n, names in planes.items():
        parts = [Lie(f"{name}.{element}", "") for name in names for element in ("plane_mode", "symbol")]
        found[n] = f"{n}_present is 0 in an intra block", (Lie(f"{n}_present", 0), *numbers.get(n, ()), *parts)
    return found


def _no_quantizer(block: int) -> tuple[Lie, ...]:
    """Lies that take the quantiser out of a block, where all have one; else the stream is whole."""
    channels = range(3 * block, 3 * block + 3)
    parts = (Lie(element, [], k) for element in ("cholesky_scale", "cholesky_offset") for k in channels)
    return Lie("quantizer_present", 0, block), *parts


def _no_codebooks(block: int, stages: tuple[int, ...]) -> tuple[Lie, ...]:
    """Lies that take the codebooks out of a block, where all have them; `stages` are its own in the stream."""
    parts = (Lie(element, "", k) for element in ("codeword_count", "codeword") for k in stages)
    return Lie("codebooks_present", 0, block), Lie("stage_count", "", block), *parts
