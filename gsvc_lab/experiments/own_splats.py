"""Splats that a trainer gave, written as a stream: bits of each at a small loss, by profile and by what is refitted."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any, Final

from gsvc_base.arrays import F4
from gsvc_lab.experiments.experiment import Experiment, Result, Run, Table, Verdict
from gsvc_lab.experiments.fitting import Picture, quickly_fitted
from gsvc_lab.experiments.material import Still, stills
from gsvc_ref.main.tables import QUANTIZERS
from gsvc_ref.metrics import psnr
from gsvc_ref.stream import decode
from gsvc_tools.writing import write

PHOTOGRAPHS: Final = ("coffee", "astronaut", "chelsea")
COUNT: Final = 1000
ITERATIONS: Final = 300  # of the fit
MOST_LOSS: Final = 0.3
"""In dB: by how much the decoded picture may be further from the photograph than that of the splats given."""
MOST_BITS: Final = 45.0
"""Must, of a splat of a photograph at its own size."""
REFITS: Final = ("none", "colors", "all")


@dataclass(frozen=True)
class Written:
    """A photograph's splats as a stream."""

    photograph: str
    size: tuple[int, int]
    given: float  # PSNR in dB of the picture of the splats given, against the photograph
    way: str  # profile, and what is refitted
    quality: int | None  # of profile `main`
    loss: float  # in dB
    bits: float  # of a splat, of all that is in the file


def measure(still: Still, run: Run) -> list[Written]:
    """Profile `paper` by its defaults, and profile `main` at the least quality with the loss that is allowed."""
    picture, (width, height) = Picture(still.frame, run.threads), still.size
    splats, _ = quickly_fitted(picture, COUNT, ITERATIONS, 0)
    given, rows = psnr(still.frame, picture.rendered(splats), 255), splats.to_array()

    def written(rows: F4, way: str, quality: int | None = None, **options: Any) -> Written:
        file = BytesIO()
        report = write(file, [rows], width, height, quality=quality, threads=run.threads, **options)
        (shown,) = decode(file.getvalue(), threads=run.threads)
        loss = given - psnr(still.frame, shown, 255)
        return Written(still.name, still.size, given, way, quality, loss, 8 * report.file_bytes / len(rows))

    found = [written(rows, "paper", profile="paper")]
    for refit in REFITS:
        best, low, high = None, -1, QUANTIZERS - 1
        while high - low > 1 or best is None:
            quality = (low + high + 1) // 2
            one = written(rows, f"main, {refit}", quality, refit=refit)
            if one.loss <= MOST_LOSS or quality == QUANTIZERS - 1:
                best, high = one, quality
            else:
                low = quality
        run.say(f"{still.name}, {width}x{height}, refit {refit}: {best.bits:.1f} bits a splat, {best.loss:.2f} dB lost")
        found.append(best)
    return found


def verdict(all_of: Sequence[Written]) -> Verdict:
    """The must for the splats of photographs at their own size, and how far it is for the others."""
    refitted = [one for one in all_of if one.way == f"main, {REFITS[-1]}"]
    own = [one for one in refitted if one.size == max(o.size for o in refitted if o.photograph == one.photograph)]
    bits = {one.photograph: one.bits for one in own}
    others = [one.bits for one in refitted if one not in own]
    told = ", ".join(f"{name} {value:.1f}" for name, value in bits.items())
    small = f"; {min(others):.1f} to {max(others):.1f} in small ones" if others else ""
    sentence = (
        f"At a loss of at most {MOST_LOSS} dB a splat takes, all parameters being refitted, {told} bits in photographs "
        f"at their own size (must: at most {MOST_BITS:g}){small}."
    )
    return Verdict("yes" if max(bits.values()) <= MOST_BITS else "no", sentence)


def run(settings: Run) -> Result:
    """Write the splats of each photograph at two sizes."""
    small = stills(settings, PHOTOGRAPHS, 240, 160)
    own = stills(Run(True, settings.folder, settings.say, settings.clips, settings.uvg), PHOTOGRAPHS, 0, 0)
    all_of = [one for still in (*own, *small) for one in measure(still, settings)]
    rows = [
        (one.photograph, f"{one.size[0]}x{one.size[1]}", f"{one.given:.2f}", one.way,
         "" if one.quality is None else str(one.quality), f"{one.loss:.2f}", f"{one.bits:.1f}")
        for one in all_of
    ]  # fmt: skip
    columns = ("photograph", "size", "PSNR given, dB", "profile, refit", "quality", "loss, dB", "bits a splat")
    numbers = {
        f"{one.photograph} {one.size[0]}x{one.size[1]}, {one.way}": {
            "given": one.given, "quality": one.quality, "loss": one.loss, "bits": one.bits
        }
        for one in all_of
    }  # fmt: skip
    setting = (
        f"{COUNT:,} splats, fitted to {', '.join(still.about for still in own)}, and to the same at 240x160, by "
        f"{ITERATIONS} evaluations, seed 0. Bits are those of the whole file. Profile main has the least quality at "
        f"which the decoded picture is at most {MOST_LOSS} dB further from the photograph; profile paper its defaults."
    )
    return Result(setting, numbers, (Table("Splats of a trainer", columns, tuple(rows)),), {}, verdict(all_of))


EXPERIMENT: Final = Experiment(
    "own_splats",
    "Splats of a trainer as a stream",
    "It says nothing about splats that were not trained with its quantisers.",
    run,
)
