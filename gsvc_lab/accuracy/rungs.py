"""What the ladder varies: groups of rungs, each rung one choice with all others fixed."""

from dataclasses import dataclass, replace
from typing import Final, Literal

from gsvc_lab.accuracy.choices import QUICK_FIT, Choice, Coding, Reference, Rendering, Training
from gsvc_lab.accuracy.variants import Variant
from gsvc_ref.errors import UsageError
from gsvc_ref.rendering import PRECISIONS
from gsvc_ref.training import PAPER_SCHEDULE, Rates

Kind = Literal["rendering", "coding", "training"]

ENCODING: Final = "encoding"
"""The group of the curves, PSNR against seconds of each preset; it has no rungs."""


@dataclass(frozen=True)
class Rung:
    """A choice by name.

    Attributes
    ----------
    name
        What is chosen, short.
    choice
        What is done.
    base
        Whether the ratios of the group are to this rung: the exact or finest one, otherwise that of the preset quick.
    usual
        Whether the codec's presets choose it, and which: ``reference``, ``quick``, ``paper`` or nothing.
    """

    name: str
    choice: Choice
    base: bool = False
    usual: str = ""


@dataclass(frozen=True)
class Group:
    """Rungs that differ in one choice.

    Attributes
    ----------
    name
        As in ``--group``.
    title
        What is varied.
    kind
        What the rungs do: render fixed splats, code them, or fit them.
    against
        What the errors and the PSNR are against.
    note
        What a reader must know, or nothing.
    rungs
        From coarse to fine where there is an order; one is the base.
    """

    name: str
    title: str
    kind: Kind
    against: str
    rungs: tuple[Rung, ...]
    note: str = ""

    @property
    def cost(self) -> str:
        """What Pareto-best weighs against the RMS error: ``bytes`` of what is coded, else ``seconds``."""
        return "bytes" if self.kind == "coding" else "seconds"


DEFINITION: Final = "the exact sum of the same splats, before clamping"
BEFORE_CODING: Final = "the exact picture of the splats before coding"
THE_SOURCE: Final = "the source picture"


def _degree(degree: int | None) -> Rendering:
    return Rendering(Variant(degree=degree))


def _cutoff(cutoff: float) -> Rendering:
    return Rendering(Variant(cutoff=cutoff), uncut=True)


def _tile(width: int, height: int | None) -> Rendering:
    return Rendering(Variant(tile=(width, height)))


def _iterations(count: int) -> Training:
    return Training(fit=QUICK_FIT.with_(iterations=count))


PAPER_RATES: Final = replace(
    QUICK_FIT, rates=Rates(), schedule=PAPER_SCHEDULE, learn_pixels=False, relative_steps=False
)
"""1e-3 for every attribute, positions normalised, halved every 20,000 iterations."""

GROUPS: Final = (
    Group(
        "precision",
        "Renderer precision",
        "rendering",
        DEFINITION,
        (
            *(Rung(name, Reference(name), usual="reference") for name in PRECISIONS if name != "exact"),
            Rung("binary64, polynomial exp", Rendering(Variant(degree=9, bits=64))),
            Rung("exact", Reference("exact"), base=True, usual="reference"),
        ),
        "The exact rung is the definition in NumPy, written to be read and not to be fast.",
    ),
    Group(
        "exp",
        "Degree of the polynomial for exp",
        "rendering",
        DEFINITION,
        (
            Rung("degree 2", _degree(2)),
            Rung("degree 3", _degree(3)),
            Rung("degree 4", _degree(4)),
            Rung("degree 5", _degree(5), usual="reference"),
            Rung("degree 7", _degree(7)),
            Rung("C library", _degree(None), base=True),
        ),
        "All in binary32, whose own rounding is what remains from degree 5 on.",
    ),
    Group(
        "cutoff",
        "Support cut-off",
        "rendering",
        "the exact sum without a cut-off",
        (
            Rung("1/255", _cutoff(1 / 255), usual="reference"),
            Rung("1/1024", _cutoff(1 / 1024)),
            Rung("1/4096", _cutoff(1 / 4096)),
            Rung("none", _cutoff(0), base=True),
        ),
        "What the definition itself leaves out: the cut at 1/255 is part of the codec, and the splats were fitted with "
        "it, so that a decoder with another cut is wrong and not better, as the PSNR against the source shows.",
    ),
    Group(
        "tile",
        "Tile size",
        "rendering",
        DEFINITION,
        (
            Rung("16x16", _tile(16, 16)),
            Rung("16x64", _tile(16, 64)),
            Rung("8 x frame", _tile(8, None)),
            Rung("16 x frame", _tile(16, None), base=True, usual="reference"),
            Rung("32 x frame", _tile(32, None)),
            Rung("64 x frame", _tile(64, None)),
            Rung("64x64", _tile(64, 64)),
        ),
        "The picture does not depend on tiles: only the time differs.",
    ),
    Group(
        "position",
        "Bits of a position",
        "coding",
        BEFORE_CODING,
        (
            *(Rung(f"{bits} bits", Coding(position_bits=bits)) for bits in (7, 8, 9, 10, 11)),
            Rung("binary16", Coding(), base=True, usual="paper"),
        ),
        "The preset quick keeps steps of 0.05 pixels, which lies between the last two at this size.",
    ),
    Group(
        "cholesky",
        "Bits of a Cholesky factor",
        "coding",
        BEFORE_CODING,
        (
            Rung("4 bits", Coding(cholesky_bits=4)),
            Rung("5 bits", Coding(cholesky_bits=5)),
            Rung("6 bits", Coding(cholesky_bits=6), usual="paper"),
            Rung("8 bits", Coding(cholesky_bits=8), usual="quick"),
            Rung("10 bits", Coding(cholesky_bits=10)),
            Rung("12 bits", Coding(cholesky_bits=12), base=True),
        ),
    ),
    Group(
        "color",
        "Colour stages and codewords",
        "coding",
        BEFORE_CODING,
        (
            Rung("1 x 64", Coding(stages=1, codewords=64)),
            Rung("2 x 8", Coding(stages=2, codewords=8), usual="paper"),
            Rung("2 x 16", Coding(stages=2, codewords=16)),
            Rung("3 x 16", Coding(), usual="quick"),
            Rung("3 x 32", Coding(stages=3, codewords=32)),
            Rung("4 x 64", Coding(stages=4, codewords=64), base=True),
        ),
    ),
    Group(
        "splats",
        "Splats per frame",
        "training",
        THE_SOURCE,
        (
            Rung("1 for 160 pixels", Training(pixels_per_splat=160)),
            Rung("1 for 80 pixels", Training(pixels_per_splat=80)),
            Rung("1 for 40 pixels", Training(), usual="quick"),
            Rung("1 for 20 pixels", Training(pixels_per_splat=20), base=True),
        ),
    ),
    Group(
        "iterations",
        "Iterations",
        "training",
        THE_SOURCE,
        (
            Rung("25", _iterations(25)),
            Rung("50", _iterations(50)),
            Rung("100", _iterations(100)),
            Rung("150", Training(), usual="quick"),
            Rung("300", _iterations(300), base=True),
        ),
        "The cosine of the learning rates ends with the last iteration.",
    ),
    Group(
        "start",
        "Initialisation",
        "training",
        THE_SOURCE,
        (
            Rung("random", Training(start="random"), usual="paper"),
            Rung("image", Training(), base=True, usual="quick"),
        ),
        "Both begin with a tenth of the splats and add the others where the residual is.",
    ),
    Group(
        "rates",
        "Learning-rate rule",
        "training",
        THE_SOURCE,
        (
            Rung("1e-3 for all, halved in steps", Training(fit=PAPER_RATES), usual="paper"),
            Rung("per attribute, constant", Training(fit=replace(QUICK_FIT, schedule=PAPER_SCHEDULE))),
            Rung("without relative steps", Training(fit=replace(QUICK_FIT, relative_steps=False))),
            Rung("per attribute, cosine", Training(), base=True, usual="quick"),
        ),
        "All for the 150 iterations of the preset quick; the paper makes up to 50,000 (see the curves).",
    ),
)

GROUP_NAMES: Final = (*(group.name for group in GROUPS), ENCODING)


def check_names(names: tuple[str, ...]) -> None:
    """Refuse names that are no groups.

    Raises
    ------
    UsageError
        There is no such group, or none is named.
    """
    for name in names:
        if name not in GROUP_NAMES:
            raise UsageError(f"there is no group {name!r}; there are {', '.join(GROUP_NAMES)}")
    if not names:
        raise UsageError(f"no group is named; there are {', '.join(GROUP_NAMES)}")
