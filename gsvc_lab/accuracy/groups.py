"""Groups of settings to measure, each an ablation that varies one thing with all others fixed."""

from dataclasses import dataclass, replace
from typing import Final, Literal

from gsvc_base.errors import UsageError
from gsvc_base.processors import processors
from gsvc_lab.accuracy.work import QUICK_FIT, Coding, CutOff, Rendering, Training, Work
from gsvc_ref.training import PAPER_SCHEDULE, Rates

Kind = Literal["rendering", "coding", "training"]

ENCODING: Final = "encoding"
"""The group of the curves, PSNR against seconds of each preset; it has no settings."""


@dataclass(frozen=True)
class Setting:
    """One value of what a group varies."""

    name: str  # its name in tables
    work: Work  # the work that is timed
    # Whether the ratios of the group are to this setting: that of the codec, or the finest one where frames are coded
    # and splats fitted
    base: bool = False
    usual: str = ""  # name of the preset or code that works with it: ``reference``, ``quick``, ``paper`` or nothing


@dataclass(frozen=True)
class Group:
    """Settings that differ in one thing."""

    name: str  # its name for ``--group``
    title: str  # the thing that is varied
    kind: Kind  # whether the work renders the fitted splats, codes them, or fits them
    against: str  # the picture that errors and PSNR are against
    settings: tuple[Setting, ...]  # the settings, from coarse to fine where there is an order; one is the base
    note: str = ""  # a sentence that a reader must know, or nothing

    @property
    def cost(self) -> str:
        """The cost that is weighed against the RMS error: ``bytes`` where frames are coded, else ``seconds``."""
        return "bytes" if self.kind == "coding" else "seconds"


DEFINITION: Final = "the exact sum of the same splats, before clamping"
BEFORE_CODING: Final = "the exact picture of the splats before coding"
THE_SOURCE: Final = "the source picture"


def thread_counts() -> tuple[int, ...]:
    """One thread, two, four and so on to all processors; always one and two."""
    most = max(2, processors())
    return (*(2**n for n in range(most.bit_length()) if 2**n < most), most)


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
            Setting("fast", Rendering("fast"), base=True, usual="reference"),
            Setting("deterministic", Rendering("deterministic"), usual="reference"),
            Setting("exact", Rendering("exact"), usual="reference"),
        ),
        "The precision exact is the definition in NumPy, written to be read and not to be fast.",
    ),
    Group(
        "threads",
        "Threads",
        "rendering",
        DEFINITION,
        tuple(
            Setting("1 thread" if count == 1 else f"{count} threads", Rendering(threads=count), base=count == 1)
            for count in thread_counts()
        ),
        "With the precision fast. The picture has the same bits for any number of threads: only the time differs.",
    ),
    Group(
        "cutoff",
        "Support cut-off",
        "rendering",
        "the exact sum without a cut-off",
        (
            Setting("1/255", CutOff(1 / 255), base=True, usual="reference"),
            Setting("1/1024", CutOff(1 / 1024)),
            Setting("1/4096", CutOff(1 / 4096)),
            Setting("none", CutOff(0)),
        ),
        "An analysis with the definition in binary64, whose time follows the pixels that splats cover. The cut at "
        "1/255 is part of the codec, and the splats were fitted with it, so that a decoder with another cut is wrong "
        "and not better, as the PSNR against the source shows.",
    ),
    Group(
        "position",
        "Bits of a position",
        "coding",
        BEFORE_CODING,
        (
            *(Setting(f"{bits} bits", Coding(position_bits=bits)) for bits in (7, 8, 9, 10, 11)),
            Setting("binary16", Coding(), base=True, usual="paper"),
        ),
        "Preset quick kept steps of 0.05 pixels until it rounded in stages; that lies between the last two "
        "at this size.",
    ),
    Group(
        "cholesky",
        "Bits of a Cholesky factor",
        "coding",
        BEFORE_CODING,
        (
            Setting("4 bits", Coding(cholesky_bits=4)),
            Setting("5 bits", Coding(cholesky_bits=5)),
            Setting("6 bits", Coding(cholesky_bits=6), usual="paper"),
            Setting("8 bits", Coding(cholesky_bits=8)),
            Setting("10 bits", Coding(cholesky_bits=10)),
            Setting("12 bits", Coding(cholesky_bits=12), base=True),
        ),
    ),
    Group(
        "color",
        "Colour stages and codewords",
        "coding",
        BEFORE_CODING,
        (
            Setting("1 x 64", Coding(stages=1, codewords=64)),
            Setting("2 x 8", Coding(stages=2, codewords=8), usual="paper"),
            Setting("2 x 16", Coding(stages=2, codewords=16)),
            Setting("3 x 16", Coding()),
            Setting("3 x 32", Coding(stages=3, codewords=32), usual="quick"),
            Setting("4 x 64", Coding(stages=4, codewords=64), base=True),
        ),
    ),
    Group(
        "gradients",
        "Precision of training",
        "training",
        THE_SOURCE,
        (
            Setting("fast", Training(), base=True, usual="quick"),
            Setting("deterministic", Training(precision="deterministic")),
        ),
        "The precision of the loss and its gradients. With deterministic the same seed gives the same splats on every "
        "machine.",
    ),
    Group(
        "splats",
        "Splats per frame",
        "training",
        THE_SOURCE,
        (
            Setting("1 for 160 pixels", Training(pixels_per_splat=160)),
            Setting("1 for 80 pixels", Training(pixels_per_splat=80)),
            Setting("1 for 40 pixels", Training(), usual="quick"),
            Setting("1 for 20 pixels", Training(pixels_per_splat=20), base=True),
        ),
    ),
    Group(
        "iterations",
        "Iterations",
        "training",
        THE_SOURCE,
        (
            Setting("25", _iterations(25)),
            Setting("50", _iterations(50)),
            Setting("100", _iterations(100)),
            Setting("150", Training(), usual="quick"),
            Setting("300", _iterations(300), base=True),
        ),
        "The cosine of the learning rates ends with the last iteration.",
    ),
    Group(
        "start",
        "Initialisation",
        "training",
        THE_SOURCE,
        (
            Setting("random", Training(start="random"), usual="paper"),
            Setting("image", Training(), base=True, usual="quick"),
        ),
        "Both begin with a tenth of the splats and add the others where the residual is.",
    ),
    Group(
        "rates",
        "Learning-rate rule",
        "training",
        THE_SOURCE,
        (
            Setting("1e-3 for all, halved in steps", Training(fit=PAPER_RATES), usual="paper"),
            Setting("per attribute, constant", Training(fit=replace(QUICK_FIT, schedule=PAPER_SCHEDULE))),
            Setting("without relative steps", Training(fit=replace(QUICK_FIT, relative_steps=False))),
            Setting("per attribute, cosine", Training(), base=True, usual="quick"),
        ),
        "All for 150 iterations of Adan, as preset quick made them before it took L-BFGS; the paper makes up to 50,000 "
        "(see the curves).",
    ),
)

GROUP_NAMES: Final = (*(group.name for group in GROUPS), ENCODING)


def check_names(names: tuple[str, ...]) -> None:
    """Refuse names that are no groups.

    A UsageError says that there is no such group, or none is named.
    """
    for name in names:
        if name not in GROUP_NAMES:
            raise UsageError(f"there is no group {name!r}; there are {', '.join(GROUP_NAMES)}")
    if not names:
        raise UsageError(f"no group is named; there are {', '.join(GROUP_NAMES)}")
